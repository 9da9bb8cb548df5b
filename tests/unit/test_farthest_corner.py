"""The corner of a polyhedron that is farthest along a direction, against numpy: the first one of equal ones, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.collision.distance.gjk import farthest
from rigidimpulse.collision.manifold.polyhedra import Polyhedra, make_polyhedra
from rigidimpulse.engine.compile_scene import compile_scene


def _polyhedra(points: np.ndarray) -> Polyhedra:
    hull = trimesh.convex.convex_hull(points)
    scene = ri.Scene()
    scene.add(ri.Body("box", ri.Shape.box(1)))
    scene.add(ri.Body("hull", ri.Shape.from_trimesh(hull), position=(5, 0, 0)))
    world = compile_scene(scene)
    return make_polyhedra(world.geometry, world.convex_depths > 0.0)


@pytest.mark.parametrize("number", [4, 7, 8, 9, 64, 150])
def test_the_farthest_corner_is_that_of_numpy(number: int) -> None:
    random = np.random.default_rng(number)
    points = random.normal(size=(number, 3))
    shapes = _polyhedra(points / np.linalg.norm(points, axis=1)[:, None])
    for s in range(2):
        corners = shapes.corner[shapes.corner_first[s] : shapes.corner_first[s + 1]]
        assert len(corners) == (number if s else 8)
        # Along the axes of a box four corners are as far.
        for x, y, z in [*random.normal(size=(200, 3)).tolist(), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)]:
            heights = corners[:, 0] * x + corners[:, 1] * y + corners[:, 2] * z
            at, far = farthest(shapes, s, x, y, z)
            assert (at, far) == (shapes.corner_first[s] + np.argmax(heights), heights.max())


def test_a_direction_that_is_no_number_leads_to_the_first_corner() -> None:
    shapes = _polyhedra(np.random.default_rng(1).normal(size=(20, 3)))
    at, far = farthest(shapes, 1, np.nan, 0.0, 0.0)
    assert at == shapes.corner_first[1] and far == -np.inf
