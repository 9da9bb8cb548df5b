"""Issue 27: joints that let go. A body whose only joint broke or was released is a free body, asleep before or not.

In each scene a box is held above a plank on a hinge. Until its joint lets go it stays where it is; then it falls as a free body does,
by g t^2 / 2, lands on the plank, which has a joint, and goes on to the floor.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

GRAVITY = 9.81
RELEASE = 0.1
"""s, when the joint lets go in the scenes with a release time."""


def hinged_plank_below_a_held_box(**lets_go: float) -> ri.Scene:
    """A plank on a hinge through its middle, and a box 0.43 m above one of its arms, fixed to the world by a joint that lets go."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("plank", ri.Shape.box((1.0, 0.2, 0.04)), position=(0.0, 0.0, 0.5)))
    scene.add(ri.Body("box", ri.Shape.box((0.1, 0.1, 0.1)), position=(0.3, 0.0, 1.0)))
    scene.add(ri.HingeJoint("plank", None, (0.0, 0.0, 0.5), (0.0, 1.0, 0.0)))
    scene.add(ri.FixedJoint("box", None, name="hold", **lets_go))
    return scene


@pytest.mark.parametrize(("lets_go", "start"), [({"release_time": RELEASE}, RELEASE), ({"break_force": 1.0}, 0.0)])
def test_a_body_whose_only_joint_let_go_lands_on_a_jointed_body(lets_go: dict[str, float], start: float) -> None:
    """It raised an error when the box landed, and a box at rest was never let go: its island slept through the release time."""
    run = ri.simulate(hinged_plank_below_a_held_box(**lets_go), duration=0.6, fps=60)
    height, since = run.position("box")[:, 2], np.maximum(run.times - start, 0.0)
    falls = 0.5 * GRAVITY * since**2 < 0.42
    assert np.abs(height - (1.0 - 0.5 * GRAVITY * since**2))[falls].max() < 1e-9
    # The plank has turned below it, about its hinge.
    assert abs(run.orientation("plank")[-1, 2]) > 0.01 and np.abs(run.position("plank")[-1] - [0.0, 0.0, 0.5]).max() < 1e-5
    assert np.isfinite(run.positions).all()
