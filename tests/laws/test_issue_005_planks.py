"""Regression: planks of a pile that passed into each other."""

from __future__ import annotations

import numpy as np
import pytest
from box_pit import STONE, inside_each_other

import rigidimpulse as ri

SIDES = np.array([0.3, 0.06, 0.03])


def hexagon() -> np.ndarray:
    """Corners of a hexagonal prism about as large."""
    angle = np.arange(6) * np.pi / 3.0
    ring = np.column_stack([np.zeros(6), 0.03 * np.cos(angle), 0.016 * np.sin(angle)])
    return np.vstack([ring + [0.15, 0.0, 0.0], ring - [0.15, 0.0, 0.0]])


@pytest.mark.parametrize("accuracy", ["standard", "preview"])
@pytest.mark.parametrize("shape", [ri.Shape.box(SIDES), ri.Shape.convex_hull(hexagon())], ids=["boxes", "prisms"])
def test_planks_lie_crosswise_on_each_other_and_do_not_pass_through(shape: ri.Shape, accuracy: str) -> None:
    """100 planks, 30 mm thick, fall at up to 5 m/s and spin at some 10 rad/s; they come by 5 thicknesses in a step.

    They had half as many sub-steps as they need to see each other coming, and one contact where two edges were nearest: planks that lay
    crosswise rocked about it, and were up to 20 mm deep in each other ("preview": 38 mm, and 31 mm at rest). Of 13 piles of boxes the
    deepest is now at 1.0 mm (0.7), of 4 of prisms at 0.2 (0.5).
    """
    random = np.random.default_rng(2)
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=STONE))
    for normal in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)):
        scene.add(ri.Body(f"wall {normal}", ri.Shape.half_space(normal=normal, offset=-0.75), motion="static", material=STONE))
    for k in range(100):
        place, turn, spin = 0.34 * (k % 4 - 1.5), random.normal(size=4), 2.0 * random.normal(size=3)
        position = place, 0.34 * (k // 4 % 4 - 1.5), 0.2 + 0.34 * (k // 16)
        scene.add(ri.Body(f"plank {k}", shape, position=position, orientation=turn, angular_velocity=spin, material=STONE))
    run = ri.simulate(scene, 2.0, accuracy=accuracy)
    for frame in (25, 35, 45, 60, 80, -1):
        assert inside_each_other(scene, run, frame, 3e-3) == []
    assert inside_each_other(scene, run, -1, 2e-3) == []
