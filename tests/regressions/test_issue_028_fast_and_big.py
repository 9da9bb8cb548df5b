"""Issue 28: a big fast body that hits small ones in sub-stepped islands.

In a step of 1/60 s the ball comes farther than the 2 inner radii of a brick within which contacts are looked for. It was in no contact
until the step ended, and 33 mm inside the wall by then.
"""

from __future__ import annotations

import pytest

import rigidimpulse as ri
from rigidimpulse.engine.measure.measure import record_of_recording
from rigidimpulse.engine.measure.overlap import SUB_STEPPED, overlap_depths


@pytest.mark.parametrize("speed", [4.0, 10.0, 18.0])
@pytest.mark.parametrize("solver", ["auto", "substepped"])
def test_a_ball_does_not_enter_a_wall_of_bricks(solver: str, speed: float) -> None:
    """The wall is loose: the ball breaks it, and no brick is ever inside it by more than soft contacts may be."""
    material = ri.Material(density=700, restitution=0.0, static_friction=0.5, dynamic_friction=0.5)
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static", material=material)])
    for row in range(10):
        for column in range(6):
            place = (0.0, 0.2 * (column + 0.5 * (row % 2)) - 0.5, 0.05 + 0.1 * row)
            scene.add(ri.Body(f"brick {row} {column}", ri.Shape.box((0.1, 0.2, 0.1)), position=place, material=material))
    start = (-0.2 - 0.135 * speed, 0.0, 0.55)
    scene.add(ri.Body("ball", ri.Shape.sphere(0.15), position=start, velocity=(speed, 0, 0), mass=10.0, material=material))
    run = ri.simulate(scene, 0.3, 240.0, accuracy=ri.Accuracy(contact_solver=solver))
    found = overlap_depths(record_of_recording(run))
    assert run.status.ok, run.status.message
    assert len(found.depth) > 0
    assert (found.depth / found.size).max() < SUB_STEPPED
    assert abs(run.velocity("ball")[-1, 0]) < 0.6 * speed
