"""Issue 28: islands that are hit at one instant are stepped once each, and stay islands of their own.

Each of k islands that were hit in one instant was stepped with all others: the work grew with the square of k. Ten equal dolls far apart
cost a hundred times as much as one.
"""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri

WOOD = ri.Material(density=700, restitution=0.0, static_friction=0.5, dynamic_friction=0.5)


def flails(number: int) -> ri.Recording:
    """Pairs of sticks on a ball joint, far apart, fall on the floor, all at the same time."""
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static", material=WOOD)])
    for k in range(number):
        for side, x in (("left", -0.15), ("right", 0.15)):
            spins = {"position": (x, 2.0 * k, 0.4), "angular_velocity": (25, 10, 20)}
            scene.add(ri.Body(f"{side} {k}", ri.Shape.box((0.28, 0.05, 0.05)), material=WOOD, **spins))
        scene.add(ri.BallJoint(f"left {k}", f"right {k}", (0.0, 2.0 * k, 0.4)))
    return ri.simulate(scene, 0.8, accuracy="preview")


def calls(run: ri.Recording) -> int:
    """How many times islands were stepped."""
    return run.plan.line("sub-stepped islands").counts["steps"]


def test_equal_islands_are_stepped_together_and_alike() -> None:
    """Six flails take six times the steps of one (82; it was twenty times as many), and each moves like the one."""
    one, six = flails(1), flails(6)
    assert one.status.ok and six.status.ok
    assert calls(six) < 7 * calls(one)
    for k in range(6):
        alone, beside = one.position("left 0"), six.position(f"left {k}") - np.array([0.0, 2.0 * k, 0.0])
        hit = int(np.argmax(alone[:, 2] < 0.2))
        np.testing.assert_allclose(beside[: hit + 6], alone[: hit + 6], atol=1e-3)
