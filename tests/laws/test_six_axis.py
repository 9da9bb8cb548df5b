"""The joint of six axes: the other joints are special cases of it, limits stop bodies where they are and when they are reached.

Laws. A hard limit is an impact without rebound: before it the body moves freely, at the bound it stops, to 1e-9 of its
size at any frame rate (a limit met half a step early or late is off by 1e-3). A soft limit pushes with max(0, -k g - c
g'), so a body that falls on it is in turn a stone and a damped oscillator, in closed form. No limit feeds energy in.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import expm

import rigidimpulse as ri

G, MASS = 9.81, 2.0
LOCK = {"lower": 0.0, "upper": 0.0}
ROUND = ((0, 1, 0), (0, 0, 1), (1, 0, 0))  # x of the joint along y of the world
AWAY = (0.3, -0.4, 0.1)
BALL, STILL = ri.Limit(translation="xyz", upper=0.0), ri.Limit(rotation="xyz", **LOCK)


def thrown(joint: object, **body: object) -> ri.Recording:
    scene = ri.Scene(gravity=(0, 0, -G))
    given = {"position": (0.3, 0.1, -0.4), "velocity": (0, 0.2, 0.1), "angular_velocity": (0.4, 1.0, -0.3), "mass": MASS}
    scene.add(ri.Body("bar", ri.Shape.box((0.2, 0.3, 1.0)), **(given | body)))
    scene.add(joint)
    return ri.simulate(scene, 1.0)


@pytest.mark.parametrize(
    ("joint", "limits", "drives"),
    [
        (ri.BallJoint(None, "bar", (0, 0, 0), axis=(0, 1, 0), upper=0.4), [BALL, ri.Limit(rotation="yz", upper=0.4)], []),
        (
            ri.HingeJoint(None, "bar", (0, 0, 0), (0, 1, 0), lower=-0.2, upper=0.1, motor=ri.Motor(1.0, damping=2.0)),
            [BALL, ri.Limit(rotation="y", **LOCK), ri.Limit(rotation="z", **LOCK), ri.Limit(rotation="x", lower=-0.2, upper=0.1)],
            [ri.Drive(1.0, damping=2.0, rotation="x")],
        ),
        (
            ri.SliderJoint(None, "bar", (0, 0, 0), (0, 1, 0), upper=0.15, motor=ri.Motor(target=0.3, stiffness=40.0)),
            [STILL, ri.Limit("yz", **LOCK), ri.Limit("x", upper=0.15)],
            [ri.Drive(target=0.3, stiffness=40.0, translation="x")],
        ),
        (ri.FixedJoint(None, "bar", (0, 0, 0)), [BALL, STILL], []),
        (ri.DistanceJoint(None, "bar", AWAY, (0, 0, 0), upper=0.6), [ri.Limit("xyz", upper=0.6)], []),
    ],
)
def test_other_joints_are_special_cases(joint: object, limits: list, drives: list) -> None:
    anchor = getattr(joint, "anchor_a", (0, 0, 0))
    one, other = thrown(joint), thrown(ri.SixAxisJoint(None, "bar", anchor, ROUND, limits, drives, anchor_b=(0, 0, 0)))
    for name in ("position", "orientation", "velocity", "angular_velocity"):
        np.testing.assert_allclose(getattr(other, name)("bar"), getattr(one, name)("bar"), atol=1e-9)
    assert other.status.ok, other.status.message


@pytest.mark.parametrize("fps", [60.0, 250.0])
def test_hard_limit_stops_at_its_bound_when_it_is_reached(fps: float) -> None:
    scene = ri.Scene(gravity=(0, 0, 0))
    moving = {"velocity": (-1.5, 0, 0), "angular_velocity": (0, 3, 0)}
    scene.add(ri.Body("bar", ri.Shape.box((0.1, 0.1, 1)), position=(0, 0, -0.5), mass=1.0, **moving))
    locked, bounded = ri.Limit(rotation="yz", upper=0.0), ri.Limit(rotation="x", upper=0.5)
    scene.add(ri.SixAxisJoint(None, "bar", (0, 0, 0), ROUND, [BALL, locked, bounded]))
    run = ri.simulate(scene, 0.5, fps=fps)
    angle = 2 * np.arctan2(run.orientation("bar")[:, 2], run.orientation("bar")[:, 0])
    np.testing.assert_allclose(angle, np.minimum(3 * run.times, 0.5), atol=3e-5)  # pivot off the centre: second order
    hit = run.times > 0.5 / 3
    np.testing.assert_allclose(angle[hit], 0.5, atol=1e-9)
    assert np.abs(run.angular_velocity("bar")[hit]).max() < 1e-9


def test_hinge_through_two_full_turns_stops_at_its_limit() -> None:
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("wheel", ri.Shape.cylinder(0.5, 0.1), angular_velocity=(0, 0, 10.0)))
    axes = ((0, 0, 1), (1, 0, 0), (0, 1, 0))
    limits = [BALL, ri.Limit(rotation="yz", upper=0.0), ri.Limit(rotation="x", upper=13.0)]
    scene.add(ri.SixAxisJoint(None, "wheel", (0, 0, 0), axes, limits))
    run = ri.simulate(scene, 2.0)
    q = run.orientation("wheel")
    angle = np.unwrap(2 * np.arctan2(q[:, 3], q[:, 0]))
    np.testing.assert_allclose(angle, np.minimum(10 * run.times, 13.0), atol=1e-8)


def root(function: Callable[[float], float], low: float, high: float) -> float:
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if function(middle) > 0 else (middle, high)
    return low


def falls_on_a_spring(times: np.ndarray, height: float, k: float, c: float) -> np.ndarray:
    """Height of a stone over a soft limit at 0, in closed form from touch to touch."""
    flow = np.array([[0, 1, 0], [-k / MASS, -c / MASS, -G], [0, 0, 0]])
    z, v, begin, touching, out = height, 0.0, 0.0, False, np.empty(len(times))
    while begin < times[-1]:
        if touching:
            path = lambda t, z=z, v=v: expm(flow * t) @ (z, v, 1.0)  # noqa: E731
            push = lambda t, path=path: k * path(t)[0] + c * path(t)[1]  # noqa: E731
            tries = np.linspace(1e-9, 5.0, 5000).tolist()
            pushes = np.array([push(t) for t in tries])
            lost = np.flatnonzero(pushes > 0)
            length = root(push, tries[lost[0] - 1], tries[lost[0]]) if len(lost) else np.inf
        else:
            path = lambda t, z=z, v=v: np.array([z + v * t - 0.5 * G * t * t, v - G * t])  # noqa: E731
            length = (v + np.sqrt(v * v + 2 * G * z)) / G
        inside = (times >= begin) & (times < begin + length)
        out[inside] = [path(t - begin)[0] for t in times[inside]]
        begin += length
        if np.isfinite(length):
            z, v = path(length)[:2]
        touching = not touching
    return out


@pytest.mark.parametrize(("stiffness", "damping"), [(500.0, 0.0), (500.0, 10.0), (2e5, 100.0), (30.0, 40.0)])
def test_soft_limit_is_the_damped_oscillator_from_touch_to_touch(stiffness: float, damping: float) -> None:
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("stone", ri.Shape.sphere(0.1), position=(0, 0, 0.5), mass=MASS))
    soft = ri.Limit("z", lower=0.0, stiffness=stiffness, damping=damping)
    scene.add(ri.SixAxisJoint(None, "stone", (0, 0, 0), limits=[soft], anchor_b=(0, 0, 0.5)))
    run = ri.simulate(scene, 2.0)
    np.testing.assert_allclose(run.position("stone")[:, 2], falls_on_a_spring(run.times, 0.5, stiffness, damping), atol=1e-8)


def test_limits_hit_at_speed_never_feed_energy_in() -> None:
    limits = [
        ri.Limit("x", lower=-0.2, upper=0.1),
        ri.Limit("yz", upper=0.3, stiffness=2e4, damping=5.0),
        ri.Limit(rotation="x", lower=-0.5, upper=0.3),
        ri.Limit(rotation="yz", upper=0.6),
    ]
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("bar", ri.Shape.box((0.2, 0.3, 1.0)), velocity=(3.0, 2.0, -1.0), angular_velocity=(4.0, 6.0, -9.0), mass=MASS))
    scene.add(ri.SixAxisJoint(None, "bar", (0.1, 0.05, 0.4), limits=limits))
    run = ri.simulate(scene, 2.0)
    kinetic = run.ledger.kinetic
    # The spring of the soft limit gives back what it took: the bound is what there was at the start.
    assert kinetic.max() <= kinetic[0] * (1 + 1e-9)
    assert kinetic[-1] < 0.5 * kinetic[0]
    assert run.status.ok, run.status.message


def test_reaction_is_the_load() -> None:
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("load", ri.Shape.sphere(0.1), position=(0, 0, -0.5), mass=MASS))
    scene.add(ri.SixAxisJoint(None, "load", (0, 0, 0), limits=[ri.Limit("xyz", upper=0.5)], anchor_b=(0, 0, -0.5), name="rope"))
    run = ri.simulate(scene, 0.5)
    np.testing.assert_allclose(run.reaction("rope")[1:], [(0, 0, MASS * G)] * (len(run.times) - 1), atol=1e-9)
    np.testing.assert_allclose(run.position("load")[:, 2], -0.5, atol=1e-9)


def test_distance_from_a_line_and_cone_hold_and_leave_the_rest_free() -> None:
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("bead", ri.Shape.sphere(0.1), velocity=(1.0, 0.3, 0.4), angular_velocity=(0.1, 0.5, -0.2), mass=MASS))
    scene.add(ri.SixAxisJoint(None, "bead", (0, 0, 0), limits=[ri.Limit("yz", upper=0.2), ri.Limit(rotation="yz", upper=0.3)]))
    run = ri.simulate(scene, 2.0)
    x, q = run.position("bead"), run.orientation("bead")
    np.testing.assert_allclose(x[:, 0], run.times, atol=1e-9)
    away = np.hypot(x[:, 1], x[:, 2])
    assert away.max() == pytest.approx(0.2, abs=1e-9)
    swing = np.arccos(1 - 2 * (q[:, 2] ** 2 + q[:, 3] ** 2))
    assert 0.3 - 1e-6 < swing.max() < 0.3 + 1e-9


def test_locked_twist_swings_without_turning_about_its_axis() -> None:
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("arm", ri.Shape.box((1.0, 0.2, 0.1)), angular_velocity=(0.5, 1.0, -0.7), mass=MASS))
    scene.add(ri.SixAxisJoint(None, "arm", (0, 0, 0), limits=[BALL, ri.Limit(rotation="x", **LOCK)]))
    run = ri.simulate(scene, 1.5)
    q = run.orientation("arm")
    # The swing alone has no part about x; the free body turns by 0.2 rad about it.
    np.testing.assert_allclose(q[:, 1], 0.0, atol=1e-9)
    assert np.ptp(run.ledger.kinetic[1:]) < 1e-6 * run.ledger.kinetic[0]


def test_half_a_turn_of_swing_is_reported_as_singular() -> None:
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("arm", ri.Shape.sphere(0.1), angular_velocity=(0, np.pi, 0)))
    scene.add(ri.SixAxisJoint(None, "arm", (0, 0, 0), limits=[BALL, ri.Limit(rotation="x", **LOCK)], name="elbow"))
    run = ri.simulate(scene, 1.5)
    assert [event.kind for event in run.status.events] == ["singular joint"]
    assert np.all(np.isfinite(run.orientations))


def test_drive_by_acceleration_does_not_feel_mass_nor_lever() -> None:
    for mass, arm in ((1.0, 0.0), (50.0, 0.7)):
        scene = ri.Scene(gravity=(0, 0, 0))
        scene.add(ri.Body("door", ri.Shape.box((0.1, 0.5, 1)), position=(0, arm, 0), mass=mass))
        hinge = [BALL, ri.Limit(rotation="yz", upper=0.0)]
        drive = ri.Drive(2.0, damping=3.0, mode="acceleration", rotation="x")
        scene.add(ri.SixAxisJoint(None, "door", (0, 0, 0), ((0, 0, 1), (1, 0, 0), (0, 1, 0)), hinge, [drive]))
        run = ri.simulate(scene, 1.0)
        # One that did not feel the lever would be slower by a factor of 20. Off the centre a drive is of second order.
        exact = 2 * (1 - np.exp(-3 * run.times))
        np.testing.assert_allclose(run.angular_velocity("door")[:, 2], exact, atol=1e-9 if arm == 0.0 else 2e-4)


def test_frames_that_differ_at_the_start_are_closed_by_position() -> None:
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("part", ri.Shape.box((0.2, 0.3, 0.4)), position=(1, 0, 0), orientation=(np.cos(0.4), 0, np.sin(0.4), 0)))
    turned = ((np.cos(0.8), 0, -np.sin(0.8)), (0, 1, 0), (np.sin(0.8), 0, np.cos(0.8)))
    scene.add(ri.SixAxisJoint(None, "part", (0, 0, 0), limits=[BALL, STILL], anchor_b=(1, 0, 0), axes_b=turned))
    run = ri.simulate(scene, 0.2)
    np.testing.assert_allclose(run.position("part")[1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(run.orientation("part")[1:, 0]), 1.0, atol=1e-9)
    assert run.ledger.kinetic.max() < 1e-12


@pytest.mark.parametrize(
    ("joint", "problem"),
    [
        (ri.SixAxisJoint(None, "load", (0, 0, 0), limits=[ri.Limit("xw")]), "letters x, y, z"),
        (ri.SixAxisJoint(None, "load", (0, 0, 0), limits=[ri.Limit("x", "y")]), "give one of them"),
        (ri.SixAxisJoint(None, "load", (0, 0, 0), limits=[ri.Limit("x", lower=1.0, upper=0.0)]), "above upper"),
        (ri.SixAxisJoint(None, "load", (0, 0, 0), limits=[ri.Limit("xy", upper=-1.0)]), "upper = -1.0"),
        (ri.SixAxisJoint(None, "load", (0, 0, 0), limits=[ri.Limit("x", upper=1.0, damping=2.0)]), "without stiffness"),
        (ri.SixAxisJoint(None, "load", (0, 0, 0), axes=((1, 0, 0), (0, 1, 0), (0, 0, -1))), "right-handed"),
        (ri.SixAxisJoint(None, "load", (0, 0, 0), upper=1.0), "Limit"),
        (ri.SixAxisJoint(None, "load", (0, 0, 0), drives=[ri.Drive(1.0, damping=1.0, rotation="xy")]), "one axis"),
        (ri.SixAxisJoint(None, "load", (0, 0, 0), drives=[ri.Drive(1.0, damping=1.0, rotation="x", mode="speed")]), "mode"),
    ],
)
def test_bad_joints_are_refused(joint: object, problem: str) -> None:
    scene = ri.Scene()
    scene.add(ri.Body("load", ri.Shape.sphere(0.1)))
    scene.add(joint)
    with pytest.raises(ri.SceneError, match=problem) as caught:
        ri.simulate(scene, 0.1)
    assert "SixAxisJoint" in str(caught.value)
