"""Issue 27: a hit in a sub-stepped island with joints may set a link turning many times as fast as the step was made for."""

from __future__ import annotations

import pytest

import rigidimpulse as ri


@pytest.mark.parametrize("offset", [0.0, 0.01, 0.02, 0.03, 0.04])
@pytest.mark.parametrize("speed", [2.0, 3.8, 8.0])
def test_a_ball_that_hits_a_link_off_its_centre_does_not_enter_it(offset: float, speed: float) -> None:
    """Two balls on a joint hit the middle one of three links: at 3.8 m/s, 2 cm off, one was inside the link by 2.5 % of its size."""
    scene = ri.Scene()
    for k in range(3):
        scene.add(ri.Body(f"link {k}", ri.Shape.box((0.1, 0.05, 0.04)), position=(0.13 * k, 0.0, 1.0)))
        if k:
            scene.add(ri.BallJoint(f"link {k - 1}", f"link {k}", (0.13 * k - 0.065, 0.0, 1.0)))
    for k in range(2):
        place = (0.15 + 0.13 * k, offset, 1.1 + 0.3 * k)
        scene.add(ri.Body(f"ball {k}", ri.Shape.sphere(0.05), position=place, velocity=(0.0, 0.0, -speed)))
    scene.add(ri.BallJoint("ball 0", "ball 1", (0.215, offset, 1.25)))
    run = ri.simulate(scene, 0.1, accuracy="preview")
    assert run.plan.line("sub-stepped islands").counts["steps"] > 0
    assert run.status.ok, run.status.message
