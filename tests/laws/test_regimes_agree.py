"""What both regimes must do alike: exact contact ("newton"), and sub-steps that are forced ("substepped").

Planted faults, each of them once real: dynamic friction from the first slip on lets boxes slide off a slope that holds them; bounds of a
whole sub-step where a motor acts for half of one lift 1/16 more; joints that close where their support was are a sub-step behind it;
sleepers whose support was let go hang in the air.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

G = 9.81
BOTH = pytest.mark.parametrize("solver", ["newton", "substepped"])


def by(solver: str) -> ri.Accuracy:
    """The settings that force a regime."""
    return ri.Accuracy(contact_solver=solver)


@BOTH
@pytest.mark.parametrize("size", [(0.2, 0.2, 0.2), (0.4, 0.1, 0.05), (0.05, 0.05, 0.02)])
@pytest.mark.parametrize("slope", [0.35, 0.45])
def test_a_slope_between_both_coefficients_holds_what_is_put_on_it(solver: str, size: tuple[float, ...], slope: float) -> None:
    """mu_k < slope < mu_s: a box that is put on it stays. With mu_k it would come 0.5 g (sin - mu_k cos) t^2 = 0.23 m and more."""
    angle = np.arctan(slope)
    normal, scene = np.array([np.sin(angle), 0.0, np.cos(angle)]), ri.Scene(gravity=(0, 0, -G))
    rough = ri.Material(static_friction=0.5, dynamic_friction=0.3)
    scene.add(ri.Body("slope", ri.Shape.half_space(normal=normal), motion="static"))
    turned = (np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0)
    scene.add(ri.Body("box", ri.Shape.box(size), position=0.5 * size[2] * normal, orientation=turned, material=rough))
    run = ri.simulate(scene, 1.0, accuracy=by(solver))
    # Its first sub-steps bear little: g h^2, some times over.
    assert np.linalg.norm(run.position("box")[-1] - run.position("box")[0]) < 1e-3


@BOTH
@pytest.mark.parametrize(("pull", "moves"), [(0.45, False), (0.55, True)])
def test_a_pull_within_static_friction_moves_nothing(solver: str, pull: float, moves: bool) -> None:
    """mu_s = 0.5, mu_k = 0.4: 0.45 m g does not move a box, 0.55 m g gives it 0.15 g.

    Sub-steps have static friction up to some 0.01 m/s, which at 0.05 g takes 0.03 s: 0.1 g of that time are missed, in all of 1 s.
    """
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    rough = ri.Material(static_friction=0.5, dynamic_friction=0.4)
    scene.add(ri.Body("box", ri.Shape.box((0.4, 0.4, 0.1)), position=(0, 0, 0.05), mass=1.0, material=rough))
    scene.add(ri.ConstantForce("box", (pull * G, 0, 0)))
    run = ri.simulate(scene, 1.0, accuracy=by(solver))
    expected = 0.5 * (pull - 0.4) * G if moves else 0.0
    assert run.position("box")[-1, 0] == pytest.approx(expected, abs=1e-3 if not moves or solver == "newton" else 2e-2)


@BOTH
@pytest.mark.parametrize(("stiffness", "damping"), [(500.0, 60.0), (500.0, 0.0), (0.0, 400.0)])
@pytest.mark.parametrize("force", [19.0, 20.0])
def test_a_motor_that_gives_all_it_can_lifts_no_more(solver: str, stiffness: float, damping: float, force: float) -> None:
    """z = (F / m - g) t^2 / 2 as long as the motor is at its bound; a bound of 17/16 F would lift what 19 N cannot hold."""
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("load", ri.Shape.box((0.2, 0.2, 0.2)), mass=2.0))
    motor = {"target": 1.0, "stiffness": stiffness} if stiffness else {"velocity": 5.0}
    scene.add(ri.SliderJoint(None, "load", (0, 0, 0), (0, 0, 1), motor=ri.Motor(**motor, damping=damping, max_force=force)))
    run = ri.simulate(scene, 1.0, accuracy=by(solver))
    assert run.position("load")[-1, 2] == pytest.approx(0.5 * (force / 2.0 - G), abs=1e-6)


@BOTH
@pytest.mark.parametrize("turns", [False, True])
def test_what_hangs_on_a_moving_body_is_where_that_is(solver: str, turns: bool) -> None:
    """A ball joint to a kinematic body: no gap at any frame; a sub-step of 1/480 s behind it was 3e-3 m."""
    scene, motion = ri.Scene(gravity=(0, 0, 0)), {"angular_velocity": (0, 0, 3.0)} if turns else {"velocity": (1.5, 0, 0)}
    scene.add(ri.Body("carrier", ri.Shape.box((0.2, 0.2, 0.2)), motion="kinematic", **motion))
    velocity = (0, 1.5, 0) if turns else (1.5, 0, 0)
    scene.add(ri.Body("carried", ri.Shape.box((0.2, 0.2, 0.2)), position=(0.5, 0, 0), mass=1.0, velocity=velocity))
    scene.add(ri.BallJoint("carrier", "carried", (0.5, 0, 0)))
    run = ri.simulate(scene, 1.0, accuracy=by(solver))
    t, zero = run.times, np.zeros(len(run.times))
    there = np.column_stack([0.5 * np.cos(3 * t), 0.5 * np.sin(3 * t), zero] if turns else [0.5 + 1.5 * t, zero, zero])
    assert np.linalg.norm(run.position("carried") - there, axis=1).max() < 1e-8


@BOTH
@pytest.mark.parametrize("held_by", ["path", "joint"])
def test_what_stands_on_a_plate_falls_with_it(solver: str, held_by: str) -> None:
    """A plate with a column of boxes is let go when they sleep: all fall by g t^2 / 2 = 1.226 m. Sleepers that hung on: 0.08 m less.

    The springs of sub-stepped contacts, which bore the column, push it apart by 0.016 m/s.
    """
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(offset=-20.0), motion="static"))
    held = {"motion": "kinematic", "release_time": 2.0} if held_by == "path" else {}
    scene.add(ri.Body("plate", ri.Shape.box((1.0, 1.0, 0.2)), position=(0, 0, 2.0), **held))
    if held_by == "joint":
        scene.add(ri.FixedJoint(None, "plate", release_time=2.0))
    heights = [2.2 + 0.2 * k for k in range(4)]
    for k, z in enumerate(heights):
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.2, 0.2, 0.2)), position=(0, 0, z)))
    run = ri.simulate(scene, 2.5, accuracy=by(solver))
    fallen = [z - run.position(f"box {k}")[-1, 2] for k, z in enumerate(heights)]
    assert fallen == pytest.approx([0.5 * G * 0.25] * 4, abs=1e-3 if solver == "newton" else 1e-2)
    assert run.status.ok, run.status.message


@BOTH
def test_a_scene_may_begin_with_nothing_that_moves(solver: str) -> None:
    """The only body is carried at first: there was no longest sub-step of no bodies."""
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("box", ri.Shape.box((0.2, 0.2, 0.2)), position=(0, 0, 1.0), motion="kinematic", release_time=0.5))
    run = ri.simulate(scene, 1.5, accuracy=by(solver))
    assert run.position("box")[-1, 2] == pytest.approx(0.1, abs=1e-3)
