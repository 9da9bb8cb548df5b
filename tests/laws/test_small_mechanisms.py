""""auto" gives mechanisms of a few bodies to sub-steps where they land and get expensive, and leaves those that touch nothing exact."""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate


def links_on_a_stair(number: int, height: float) -> ri.Scene:
    """Boxes in a row, on ball joints, that fall level onto a stair of three steps."""
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    for k in range(3):
        step = ri.Shape.box((0.5, 3.0, 0.15 * (3 - k)))
        scene.add(ri.Body(f"step {k}", step, position=(0.5 * k, 0.0, 0.075 * (3 - k)), motion="static"))
    for k in range(number):
        place = (0.25 * k - 0.3, 0.0, height)
        scene.add(ri.Body(f"link {k}", ri.Shape.box((0.2, 0.08, 0.06)), position=place, velocity=(1.0, 0.3, 0.0)))
        if k:
            scene.add(ri.BallJoint(f"link {k - 1}", f"link {k}", (0.25 * k - 0.425, 0.0, height)))
    return scene


@pytest.mark.parametrize("height", [0.6, 1.0])
@pytest.mark.parametrize("number", [3, 5, 7])
def test_what_lands_goes_to_sub_steps(number: int, height: float) -> None:
    """Joints stay closed to 1e-6 of a link, energy never grows, and the status, which knows overlaps, says nothing."""
    run = ri.simulate(links_on_a_stair(number, height), 1.5)
    assert run.plan.line("sub-stepped islands").counts["steps"] > 20
    assert run.status.message == "finished"
    energy = run.ledger.kinetic + run.ledger.potential
    assert np.all(np.diff(energy) <= 1e-9 * energy[0])
    for k in range(1, number):
        ends = [
            run.position(name) + rotate(run.orientation(name), np.array([x, 0.0, 0.0]))
            for name, x in ((f"link {k - 1}", 0.125), (f"link {k}", -0.125))
        ]
        assert np.linalg.norm(ends[0] - ends[1], axis=1).max() < 2e-7


def test_what_swings_over_a_stair_and_touches_nothing_stays_exact() -> None:
    """Near it, and solved several times a step, as doors on soft hinges are."""
    scene = links_on_a_stair(3, 1.25)
    scene.add(ri.BallJoint(None, "link 0", (-0.425, 0.0, 1.25)))
    run = ri.simulate(scene, 0.6)
    assert run.plan.line("sub-stepped islands").counts.get("steps", 0) == 0
    assert len(run.impacts) == 0 and run.status.message == "finished"
