"""Bodies that are not convex rest on a floor in sub-stepped islands, where they sank in by half a hundredth of their size.

Contacts are looked for a few millimetres ahead with surfaces that are moved in, and few of each normal are kept. The choice was made by
the gaps of those surfaces, and by how far out contacts are: what carried the body was dropped for what was far out and wide open. A ring
of hulls of 0.4 m rested 2.1 mm inside the floor and trembled.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate

RING = trimesh.creation.torus(0.15, 0.05, major_sections=40, minor_sections=15)


def _of_hulls(sectors: int) -> ri.Shape:
    """The ring as convex hulls of its sectors, as files of colliders have it."""
    along = np.arctan2(RING.vertices[:, 1], RING.vertices[:, 0]) / (2.0 * np.pi) * sectors
    parts = []
    for k in range(sectors):
        away = np.abs((along - k + 0.5 * sectors) % sectors - 0.5 * sectors)
        parts.append((ri.Shape.convex_hull(RING.vertices[away < 0.501]), (0, 0, 0), (1, 0, 0, 0)))
    return ri.Shape.compound(parts)


SHAPES = {"mesh": ri.Shape.mesh(RING.vertices, RING.faces), "hulls": _of_hulls(8)}
FLOORS = {"half space": ri.Body("floor", ri.Shape.half_space(), motion="static")}
FLOORS["box"] = ri.Body("floor", ri.Shape.box((3, 3, 0.2)), position=(0, 0, -0.1), motion="static")


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("shape", SHAPES)
def test_rings_rest_on_a_floor(shape: str, floor: str) -> None:
    """They lie at the gap of contacts, some 1e-4 of their size; before they lay up to 5e-3 inside the floor."""
    random = np.random.default_rng(4)
    scene = ri.Scene()
    scene.add(FLOORS[floor])
    for k in range(3):
        turn, spin = random.normal(size=4), 3.0 * random.normal(size=3)
        scene.add(ri.Body(f"ring {k}", SHAPES[shape], position=(0.5 * k, 0, 0.4), orientation=turn, angular_velocity=spin))
    run = ri.simulate(scene, 2.6, accuracy="preview")
    assert run.status.ok
    for k in range(3):
        place, turn = run.position(f"ring {k}")[-20:], run.orientation(f"ring {k}")[-20:]
        lowest = [rotate(q, RING.vertices)[:, 2].min() + x[2] for x, q in zip(place, turn, strict=True)]
        assert -1e-4 < min(lowest) and max(lowest) < 1e-3
        assert np.abs(run.velocity(f"ring {k}")[-20:]).max() < 0.02
