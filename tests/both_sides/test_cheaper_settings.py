"""Where an option is the point of a scene: the setting that is enough, and the cheaper one that is not.

Each scene of the gallery here comes with checks against its law. With the setting that is enough all hold, with the cheaper one
those named here fail, by more than ten times the bound: the option does what it is there for.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import rigidimpulse as ri
from rigidimpulse import gallery

G = 9.81


@cache
def checks(name: str, *settings: tuple) -> list:
    """Checks of a scene of the gallery under settings, (key, value) each."""
    entry = gallery.load(name)
    return entry.check(ri.simulate(entry.scene(), entry.duration, entry.fps, accuracy=ri.Accuracy(**dict(settings))))


SUBSTEPPED, AFTER, LINEAR = ("contact_solver", "substepped"), ("impact_time", "after"), ("impact_time", "linear")


@pytest.mark.parametrize(
    ("name", "cheaper", "quantity"),
    [
        # Looking after each step finds a ball as deep as it gets in a step; a straight line through two gaps is off by g h^2 / 8.
        ("bounces_to_rest", LINEAR, "e = 0.5: error of ten impact times"),
        ("bounces_to_rest", AFTER, "e = 0.8: last impact from the time of rest"),
        ("galperin_1", AFTER, "error of the impact times"),
        ("disks_in_a_box", LINEAR, "error of final positions"),
        ("backing_up_bisection", LINEAR, "whirling: error of the impact time"),
        ("disks_in_a_box", AFTER, "error of final positions"),
        ("heavy_dropped_1e3", AFTER, "heavy one sinks into the light one"),
        ("rimless_wheel", AFTER, "w+ / w- from the law"),
        ("bounce_over_triangles", AFTER, "off its height"),
        ("bounce_over_tiles", LINEAR, "off its height"),
        ("cube_in_hole", AFTER, "error of the landing"),
        # All impacts of a row at once push every ball; a reflected speed knows no spin.
        ("cradle_one", ("response", "simultaneous"), "error of positions"),
        ("superball", ("response", "kinematic"), "error of the change of v"),
        # Soft contacts give way in sub-steps: loads pass on a part at a time, friction creeps, what rocks over an edge loses energy.
        ("heavy_dropped_1e3", SUBSTEPPED, "heavy one sinks into the light one"),
        ("incline", SUBSTEPPED, "0.1 degrees below: creep along the slope"),
        ("stopping", SUBSTEPPED, "stopping distance"),
        ("emergency_stop", SUBSTEPPED, "error of the way at any time"),
        ("sliding_to_rolling", SUBSTEPPED, "error of the way"),
        ("ball_off_ball", SUBSTEPPED, "level speed after it leaves"),
        ("rocking_block", SUBSTEPPED, "w+ / w-"),
        # A step of a quarter of a second leaves the arms off their hinges between frames.
        ("motor_hinge", ("step", 0.25), "ends of the arms off their hinges"),
    ],
)  # fmt: skip
def test_the_cheaper_setting_fails(name: str, cheaper: tuple, quantity: str) -> None:
    assert all(check.passed for check in checks(name))
    failed = [check for check in checks(name, cheaper) if quantity in check.what]
    assert len(failed) == 1 and failed[0].value > 10.0 * failed[0].bound


def test_conservative_advancement_is_enough_where_a_straight_line_is_not() -> None:
    assert all(check.passed for check in checks("disks_in_a_box", ("impact_time", "conservative")))


def triangle_of_balls(response: str) -> ri.Recording:
    """A ball flies at the gap between two touching ones, e = 1, and meets both at the same instant."""
    scene = ri.Scene(gravity=(0, 0, 0))
    smooth = ri.Material(restitution=1.0, static_friction=0.0)
    ball = ri.Shape.sphere(0.5)
    scene.add(ri.Body("cue", ball, position=(-2, 0, 0), velocity=(1, 0, 0), mass=1.0, material=smooth))
    for name, y in (("left", 0.5), ("right", -0.5)):
        scene.add(ri.Body(name, ball, position=(0, y, 0), mass=1.0, material=smooth))
    return ri.simulate(scene, 3.0, accuracy=ri.Accuracy(response=response))


def test_only_impacts_all_at_once_keep_mirror_symmetry() -> None:
    """By symmetry both impulses are equal: j = (6/5) m v cos 30, so v' = -v / 5 and u = (3/5) (v, +-v / sqrt 3).

    One after the other, the first ball takes cos^2 30 of the speed, and what is left meets the second one.
    """
    together = triangle_of_balls("simultaneous")
    np.testing.assert_allclose(together.velocity("cue")[-1], (-0.2, 0, 0), atol=1e-12)
    for name, side in (("left", 1), ("right", -1)):
        np.testing.assert_allclose(together.velocity(name)[-1], (0.6, side * 0.6 / math.sqrt(3), 0), atol=1e-12)
    in_turn = triangle_of_balls("sequential")
    assert abs(in_turn.velocity("cue")[-1, 1]) > 0.2
    assert in_turn.ledger.kinetic[-1] == pytest.approx(0.5, rel=1e-12)


def test_kinematic_response_does_not_keep_momentum() -> None:
    """A ball of 1 kg and 1 m/s strikes one of 3 kg at rest, e = 0.5: v = (1 - 3 e) / 4, u = (1 + e) / 4."""

    def speeds(response: str) -> tuple[float, float]:
        scene, dull = ri.Scene(gravity=(0, 0, 0)), ri.Material(restitution=0.5)
        scene.add(ri.Body("light", ri.Shape.sphere(0.5), position=(-2, 0, 0), velocity=(1, 0, 0), mass=1.0, material=dull))
        scene.add(ri.Body("heavy", ri.Shape.sphere(0.5), mass=3.0, material=dull))
        run = ri.simulate(scene, 2.0, accuracy=ri.Accuracy(response=response))
        return float(run.velocity("light")[-1, 0]), float(run.velocity("heavy")[-1, 0])

    v, u = speeds("sequential")
    assert (v, u) == pytest.approx(((1 - 1.5) / 4, 1.5 / 4), abs=1e-14)
    v, u = speeds("kinematic")
    assert v + 3.0 * u > 1.5


def swing_error(step: float) -> float:
    """Error of the spin [rad/s] over 2 s of an arm at a hinge off its centre that a spring turns to and fro: w^2 = k / I."""
    scene = ri.Scene(gravity=(0, 0, 0))
    turning = {"velocity": (0, 0.8, 0), "angular_velocity": (0, 0, 2), "mass": 2.0, "inertia": (0.1,) * 3}
    scene.add(ri.Body("arm", ri.Shape.box((0.3, 0.2, 0.1)), position=(0.4, 0, 0), **turning))
    held = [ri.Limit("xyz", lower=0, upper=0), ri.Limit(rotation="xy", lower=0, upper=0)]
    scene.add(ri.SixAxisJoint(None, "arm", (0, 0, 0), limits=[*held, ri.Limit(rotation="z", lower=0, upper=0, stiffness=6.0)]))
    run = ri.simulate(scene, 2.0, accuracy=ri.Accuracy(step=step))
    rate = math.sqrt(6.0 / (0.1 + 2.0 * 0.4**2))
    return float(np.abs(run.angular_velocity("arm")[:, 2] - 2.0 * np.cos(rate * run.times)).max())


def test_a_long_step_is_not_felt_where_springs_of_joints_pull() -> None:
    """What touches nothing flies by a method of order 8, in steps of its own. In sub-steps of second order 1/10 s was off by 4e-3."""
    assert swing_error(1 / 240) < 1e-10
    assert swing_error(1 / 10) < 1e-10


def bend_error(step: float) -> float:
    """How far a block is off after it has slid across an incline of 25 degrees for 0.5 s, m."""
    friction, tilt = 0.5, np.radians(25.0)
    material = ri.Material(static_friction=friction, dynamic_friction=friction, restitution=0.0)
    scene = ri.Scene(gravity=(9.81 * np.sin(tilt), 0, -9.81 * np.cos(tilt)))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    block = ri.Shape.box((0.01, 0.01, 1e-4))
    scene.add(ri.Body("block", block, position=(0, 0, 5e-5), velocity=(0, 2, 0), material=material))
    run = ri.simulate(scene, 0.5, accuracy=ri.Accuracy(step=step))

    def slope(_t, y):
        pull = np.array([9.81 * np.sin(tilt), 0.0]) - friction * 9.81 * np.cos(tilt) * y[2:] / np.linalg.norm(y[2:])
        return [*y[2:], *pull]

    true = solve_ivp(slope, (0.0, 0.5), [0.0, 0.0, 0.0, 2.0], rtol=1e-11, atol=1e-12).y[:2, -1]
    return float(np.abs(run.position("block")[-1, :2] - true).max())


def test_a_long_step_is_felt_where_friction_turns() -> None:
    """Of second order. Contact of faces does not turn: a block that slides straight down a slope does not feel the step."""
    assert bend_error(1 / 240) < 5e-5
    assert bend_error(1 / 10) > 1e-3
    assert all(check.passed for check in checks("incline", ("step", 0.5)))
