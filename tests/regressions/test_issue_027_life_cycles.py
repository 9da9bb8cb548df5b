"""Joints that let go: of a body that rests, and of one that then lands on a body with joints of its own.

The run was lost with "max() arg is an empty sequence" where a body whose only joint had gone came to an island with joints, and a body at
rest was never let go at its release time.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

G = 9.81


def box_over_a_hinged_plank(**joint: float) -> ri.Scene:
    """A box held over the end of a plank that turns about its middle."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("plank", ri.Shape.box((2, 0.3, 0.05)), position=(0, 0, 0.5)))
    scene.add(ri.HingeJoint("plank", None, (0, 0, 0.5), (0, 1, 0)))
    scene.add(ri.Body("box", ri.Shape.box(0.2), position=(0.6, 0, 1.2)))
    scene.add(ri.FixedJoint("box", None, **joint))
    return scene


@pytest.mark.parametrize(("joint", "begin"), [({"release_time": 0.3}, 0.3), ({"break_force": 1.0}, 0.0)])
def test_a_body_whose_only_joint_let_go_lands_on_a_jointed_one(joint, begin):
    run = ri.simulate(box_over_a_hinged_plank(**joint), 1.5)
    assert run.status.ok
    falls = (run.times >= begin) & (run.times < begin + 0.3)
    expected = 1.2 - 0.5 * G * (run.times[falls] - begin) ** 2
    np.testing.assert_allclose(run.position("box")[falls, 2], expected, atol=1e-9)
    assert run.position("box")[-1, 2] < 0.3, "it has slid off the plank, which turns"
    mechanical = run.ledger.kinetic + run.ledger.potential
    assert np.diff(mechanical).max() <= 1e-9 * np.ptp(mechanical)


def test_a_resting_body_is_let_go_at_its_time():
    scene = ri.Scene()
    scene.add(ri.Body("bob", ri.Shape.sphere(0.1), position=(0, 0, 5)))
    scene.add(ri.FixedJoint("bob", None, release_time=0.25))
    run = ri.simulate(scene, 1.0)
    fallen = 0.5 * G * np.maximum(run.times - 0.25, 0.0) ** 2
    np.testing.assert_allclose(run.position("bob")[:, 2], 5.0 - fallen, atol=1e-9)
