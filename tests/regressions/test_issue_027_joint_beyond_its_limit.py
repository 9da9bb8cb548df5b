"""A joint that is placed beyond its limit is moved there in the first step; the status says so.

A door whose hinge had a lower limit of 1 rad, placed at 0, turned through a ball within a step, and the run said ok.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri


def door(lower: float) -> ri.Recording:
    """A door at the angle 0 whose hinge has limits."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("door", ri.Shape.box((0.8, 0.04, 2)), position=(0.4, 0, 1), mass=20))
    scene.add(ri.HingeJoint(None, "door", anchor=(0, 0, 1), axis=(0, 0, 1), lower=lower, upper=2, name="hinge"))
    return ri.simulate(scene, 0.1)


@pytest.mark.parametrize("lower", [1.0, 0.01])
def test_a_hinge_beyond_its_limit_is_said(lower: float) -> None:
    run = door(lower)
    (event,) = run.status.problems
    assert event.kind == "joint beyond its limit at the start" and event.bodies == ("door",) and event.time == 0.0
    assert "hinge" in event.message and f"{lower:.4g}" in event.message
    angle = np.arctan2(run.position("door")[-1, 1], run.position("door")[-1, 0])
    assert angle == pytest.approx(lower, abs=1e-9)


@pytest.mark.parametrize("lower", [-1.0, 0.0, 1e-9])
def test_a_hinge_within_its_limits_or_at_one_is_in_order(lower: float) -> None:
    assert door(lower).status.ok
