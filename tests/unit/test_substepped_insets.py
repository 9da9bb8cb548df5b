"""Inset surfaces of bodies that are not convex: every face moved inwards by the depth, thin and open parts left where they are."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from rigidimpulse.collision.geometry import build_geometry, compile_shape
from rigidimpulse.collision.manifold.inset_surface import DEPTH, inset_surfaces
from rigidimpulse.scene.shape import Shape


def inset_of(shape: Shape) -> tuple[np.ndarray, np.ndarray, float]:
    """Triangles (t, 3, 3) of a shape of one mesh, those of its inset surface, and the depth of that, m."""
    compiled = compile_shape(shape, np.zeros(3), np.eye(3))
    geometry = build_geometry([compiled])
    inset, depth, back = inset_surfaces([compiled], geometry, np.zeros(1, bool), np.ones(1, bool))
    np.testing.assert_array_equal(inset.vertex + back[:, :3], geometry.vertex)
    faces = compiled.primitives[0].faces
    return geometry.vertex[faces], inset.vertex[faces], float(depth[0])


RING = trimesh.creation.torus(0.045, 0.02, major_sections=16, minor_sections=8)


@pytest.mark.parametrize("mesh", [RING, trimesh.creation.box((1, 2, 3))])
def test_every_face_moves_inwards_by_the_depth(mesh: trimesh.Trimesh) -> None:
    # Three faces meet at a corner of the box, planes of several triangles at one of the ring: all are met exactly. A sign that is wrong
    # is off by two depths, corners moved by d along mean normals leave faces of the box at d / sqrt(3).
    true, inset, depth = inset_of(Shape.mesh(mesh.vertices, mesh.faces))
    assert depth == pytest.approx(DEPTH * np.linalg.norm(mesh.vertices, axis=1).max(), rel=1e-6)
    normal = np.cross(true[:, 1] - true[:, 0], true[:, 2] - true[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    np.testing.assert_allclose(np.einsum("tki,ti->tk", true - inset, normal), depth, rtol=1e-3)


def test_what_is_thinner_than_twice_the_depth_does_not_turn_inside_out() -> None:
    # A plate of 1 m, 10 mm thick: the depth is 8.5 mm, and corners move by a quarter of it at most. A sheet has no inside to move to.
    plate = trimesh.creation.box((1.0, 1.0, 0.01))
    true, inset, depth = inset_of(Shape.mesh(plate.vertices, plate.faces))
    assert depth > 8e-3
    assert 0.0 < np.ptp(inset[..., 2]) <= 0.01
    sheet = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    true, inset, _ = inset_of(Shape.mesh(sheet, [(0, 1, 2), (0, 2, 3)]))
    np.testing.assert_array_equal(inset, true)
