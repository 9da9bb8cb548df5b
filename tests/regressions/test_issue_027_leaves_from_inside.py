"""A body that starts inside another by a little, and leaves at once, leaves.

Flush positions in decimal numbers are inside each other by round-off: 2.8e-17 m for a crate of 0.3 m on a floor. Such a pair was in contact
on its whole way out: it was met 100 times at one instant, reported as "contact not resolved", and left alone until the end of the step.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

GRAVITY = 9.81


@pytest.mark.parametrize("speed", [1e-6, 1e-3, 0.1, 1.0])
@pytest.mark.parametrize("depth", [0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-7])
def test_a_body_that_leaves_from_inside_another_rises_as_if_it_were_free(depth: float, speed: float) -> None:
    """The crate and the ball follow the parabola of their speed for as long as it is above the floor, up to the lift by `depth`."""
    scene = ri.Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(ri.Body("floor", ri.Shape.box((2.0, 2.0, 0.1)), position=(0.0, 0.0, -0.05), motion="static"))
    scene.add(ri.Body("crate", ri.Shape.box((0.3, 0.3, 0.3)), position=(0.0, 0.0, 0.15 - depth), velocity=(0.0, 0.0, speed)))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0.5, 0.0, 0.1 - depth), velocity=(0.0, 0.0, speed)))
    run = ri.simulate(scene, 0.1, fps=1000)
    assert run.status.ok, run.status.message
    flies = run.times < 2.0 * speed / GRAVITY
    free = speed * run.times - 0.5 * GRAVITY * run.times**2
    for name in ("crate", "ball"):
        risen = run.position(name)[:, 2] - run.position(name)[0, 2]
        assert abs(risen - free)[flies].max() < depth + 1e-6
        assert risen.min() > -1e-6


def test_a_body_that_leaves_from_a_gap_of_exactly_nothing_leaves() -> None:
    """At this height the rounded corners of the box lie exactly in the top of the floor."""
    scene = ri.Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(ri.Body("floor", ri.Shape.box((5.0, 5.0, 0.5)), position=(0.1, 0.2, -0.25), motion="static"))
    size = (0.03025415, 1.51089546, 1.6248431240281453)
    scene.add(ri.Body("box", ri.Shape.box(size), position=(0.0, 0.0, 0.81242156201407256), velocity=(0.0, 0.0, 0.0076747887)))
    run = ri.simulate(scene, 0.2)
    assert run.status.ok, run.status.message
    assert np.ptp(run.position("box")[:, 2]) < 1e-5
