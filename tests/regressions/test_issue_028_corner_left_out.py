"""Stones that roll over their corners on a floor at "preview" do not sink in.

Contacts are looked for some millimetres ahead, and four of a pair are kept. They were chosen by how far out they are: a corner 7 mm above
the floor took the place of one 0.3 mm above it, which was 4 mm inside the floor at the next look, 2.6 % of the size of a stone. What is
higher counts as less far out now, as it did in the search of concave meshes.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate


@pytest.mark.parametrize("seed", [22, 31, 33, 34, 38])
def test_no_corner_of_a_stone_is_left_out(seed: int) -> None:
    """The lowest corner of nine stones, at 120 frames a second; the deepest was at 0.010 to 0.021 of the size, of these seeds."""
    random = np.random.default_rng(seed)
    scene, corners = ri.Scene(), {}
    material = ri.Material(restitution=random.uniform(0.0, 0.4), static_friction=0.6, dynamic_friction=0.6)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    for k in range(9):
        points = random.normal(size=(random.integers(6, 20), 3)) * 0.03 * random.uniform(0.3, 1.0, 3)
        shape = ri.Shape.convex_hull(trimesh.convex.convex_hull(points).vertices)
        corners[f"stone {k}"] = np.asarray(shape.vertices)
        place, turn = (0.25 * (k % 3), 0.25 * (k // 3), 0.15), random.normal(size=4)
        speed, spin = random.normal(0.0, 0.7, 3), random.normal(0.0, 8.0, 3)
        scene.add(ri.Body(f"stone {k}", shape, position=place, orientation=turn, velocity=speed, angular_velocity=spin, material=material))
    run = ri.simulate(scene, 1.0, accuracy="preview", fps=120)
    for name, vertices in corners.items():
        lowest = min((rotate(q, vertices) + x)[:, 2].min() for x, q in zip(run.position(name), run.orientation(name), strict=True))
        assert lowest > -5e-3 * np.linalg.norm(np.ptp(vertices, axis=0)), name
