"""Cylinders in a pile stay apart, among themselves and among other shapes."""

from __future__ import annotations

import pytest
import trimesh
from box_pit import inside_each_other, pit

import rigidimpulse as ri

DRUM = ri.Shape.cylinder(0.05, 0.08)
OTHERS = [
    ri.Shape.box((0.1, 0.08, 0.06)), ri.Shape.sphere(0.05), ri.Shape.cylinder(0.04, 0.1),
    ri.Shape.convex_hull(trimesh.creation.icosahedron().vertices * 0.06),
]  # fmt: skip


@pytest.mark.parametrize(("shapes", "seed"), [([DRUM], 3), ([DRUM], 5), (OTHERS, 3)])
@pytest.mark.parametrize(("accuracy", "bearable"), [("standard", 4e-3), ("preview", 8e-3)])
def test_cylinders_of_a_substepped_island_stay_out_of_each_other(shapes: list[ri.Shape], seed: int, accuracy: str, bearable: float) -> None:
    """Two that had sunk farther than they are made smaller for the contact kernels had no contact any more.

    They passed into each other, to 9 mm from centre to centre, and "contact not resolved" was reported. Now a prism tells where to push.
    On the way they are 2 mm deep at worst; at the end, at rest, they are apart.
    """
    scene = pit(shapes, seed)
    run = ri.simulate(scene, 3.0, accuracy=accuracy)
    assert run.status.ok, run.status.message
    for frame in (30, 45, 60, 90):
        assert inside_each_other(scene, run, frame, bearable) == []
    assert inside_each_other(scene, run, -1, 0.0) == []
