"""Frames inside a step of sub-stepped islands lie on the way of the sub-steps, and change nothing."""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate

SUBSTEPPED = ri.Accuracy(contact_solver="substepped")
OFTEN = 8
"""Frames in a step of 1/60 s."""


def pendulum() -> ri.Scene:
    """A rod of 0.5 m on a hinge at its end, that turns by 6 rad/s."""
    rod = ri.Body("rod", ri.Shape.box((0.5, 0.05, 0.05)), position=(0.25, 0.0, 0.0), velocity=(0, 0, -1.5), angular_velocity=(0, 6, 0))
    scene = ri.Scene(bodies=[rod])
    scene.add(ri.HingeJoint("rod", None, (0, 0, 0), (0, 1, 0)))
    return scene


def toppling_box() -> ri.Scene:
    """A box 0.6 m high that topples over its edge on a floor where it does not slip."""
    rough, size, tilt = ri.Material(restitution=0.0, static_friction=2.0, dynamic_friction=2.0), np.array([0.1, 0.3, 0.6]), 0.2
    turn = (np.cos(0.5 * tilt), 0.0, np.sin(0.5 * tilt), 0.0)
    centre = -rotate(np.array([turn]), np.array([[0.05, 0.0, -0.3]]))[0]
    box = ri.Body("box", ri.Shape.box(size), position=centre + (0, 0, 1e-4), orientation=turn, material=rough)
    return ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static", material=rough), box])


@pytest.mark.parametrize("make", [pendulum, toppling_box])
def test_frames_change_nothing(make) -> None:
    seldom, often = (ri.simulate(make(), 0.5, fps=fps, accuracy=SUBSTEPPED) for fps in (60, 60 * OFTEN))
    for name in ("positions", "orientations", "velocities", "angular_velocities"):
        assert getattr(seldom, name).tobytes() == np.ascontiguousarray(getattr(often, name)[::OFTEN]).tobytes()


def test_joints_are_closed_at_frames_inside_a_step() -> None:
    # The middle of the rod goes on an arc: the straight way to the end of a step leaves it by r (w h)^2 / 8, 0.3 mm. Sub-steps are an
    # eighth of that, which leaves a 64th.
    run = ri.simulate(pendulum(), 0.5, fps=60 * OFTEN, accuracy=SUBSTEPPED)
    end = run.position("rod") + rotate(run.orientation("rod"), np.tile((-0.25, 0.0, 0.0), (len(run.times), 1)))
    radius, turn = 0.25, np.abs(run.angular_velocity("rod")).max() / 60.0
    assert np.linalg.norm(end, axis=1).max() < 1.2 * radius * (turn / OFTEN) ** 2 / 8.0


def test_bodies_that_topple_stay_on_the_floor_at_frames_inside_a_step() -> None:
    # On straight ways over half a step the edge would go up and down by r (w h)^2 / 8, 0.05 mm at 4 rad/s.
    run = ri.simulate(toppling_box(), 0.8, fps=60 * OFTEN, accuracy=SUBSTEPPED)
    turning = np.abs(run.angular_velocity("box")[:, 1])
    last = int(np.argmax(turning))  # before the side lands
    edge = run.position("box") + rotate(run.orientation("box"), np.tile((0.05, 0.0, -0.3), (len(run.times), 1)))
    height = edge[: last - OFTEN, 2]
    assert turning[last] > 3.0
    assert np.ptp(height[OFTEN:]) < 2e-5


def test_frames_of_an_island_that_is_hit_within_a_step_follow_the_hit() -> None:
    """Two boxes that do not touch are stepped together. A bullet hits one in the middle of a step: it goes on from there in all frames.

    Between two frames a body moves by no more than its speed after the hit allows. Frames along the way of before would stand still until
    the step ends, and jump by up to 1/60 s of that speed then: sixteen frames at once.
    """
    ice, settings, fps = ri.Material(static_friction=0, dynamic_friction=0), ri.Accuracy(contact_solver="substepped"), 960
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for k in range(2):
        scene.add(ri.Body(f"box {k}", ri.Shape.box(0.1), position=(0, 2.0 * k, 0.05), velocity=(0, 0.4, 0), material=ice))
    heavy = ri.Material(density=8000)
    scene.add(ri.Body("bullet", ri.Shape.sphere(0.02), position=(-18.67, 0, 0.05), velocity=(200, 0.4, 0.456), material=heavy))
    run = ri.simulate(scene, 0.2, fps=fps, accuracy=settings)
    speed = np.linalg.norm(run.velocity("box 0"), axis=1).max()
    way = np.linalg.norm(np.diff(run.position("box 0"), axis=0), axis=1)
    assert speed > 5.0 and way.max() <= 1.01 * speed / fps
