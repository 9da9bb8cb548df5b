"""Corners of a mesh inside a convex polyhedron, against the least distance to its planes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.collision.manifold.polyhedra import POINTS, Points
from rigidimpulse.collision.manifold.sunk_corners import sunk_corners
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.substepped.contact_forces import COARSE, ContactStepper


@pytest.mark.parametrize("mesh_first", [True, False])
@pytest.mark.parametrize("seed", range(12))
def test_contacts_are_the_deepest_corners_on_the_nearest_faces(seed: int, mesh_first: bool) -> None:
    """The gap of each is minus the least height under a face, along its normal, from the body of lower rank to the other."""
    rng = np.random.default_rng(seed)
    hull = trimesh.convex.convex_hull(rng.normal(size=(14, 3)))
    ring = trimesh.creation.annulus(0.4, 0.8, 0.3)
    scene, turn = ri.Scene(), rng.normal(size=(2, 4))
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    # Bodies have their ranks by their places.
    scene.add(ri.Body("ring", ri.Shape.mesh(ring.vertices, ring.faces), position=(0, 0, 0), orientation=turn[0]))
    place = (0.6 if mesh_first else -0.6, 0.1, 0.2)
    scene.add(ri.Body("hull", ri.Shape.convex_hull(hull.vertices - hull.center_mass), position=place, orientation=turn[1]))
    world = compile_scene(scene)
    stepper = ContactStepper(world, world.dynamic, COARSE)
    bodies, order = stepper.bodies, stepper.order
    for k, i in enumerate(order.tolist()):
        bodies.position[k], bodies.rotation[k] = world.position[i], to_matrix(world.orientation[i])
    mesh, solid = int(stepper.rank[0]), int(stepper.rank[1])
    assert (mesh < solid) == mesh_first
    points = Points(np.empty((POINTS + 1, 10)), np.empty((POINTS + 1, 3), np.int64))
    count = sunk_corners(world.geometry, stepper.shapes, bodies, (mesh, solid), 1e-3, points)

    geometry, shape = world.geometry, world.shape_of_body
    corners = geometry.vertex[slice(*geometry.vertex_first[geometry.shape_first[shape[0]] + np.arange(2)])]
    placed = corners @ bodies.rotation[mesh].T + bodies.position[mesh]
    faces = slice(*stepper.shapes.face_first[shape[1] + np.arange(2)])
    normals = stepper.shapes.plane[faces, :3] @ bodies.rotation[solid].T
    heights = (placed - bodies.position[solid]) @ normals.T - stepper.shapes.plane[faces, 3]
    depth = np.sort(heights.max(axis=1))
    depth = depth[depth <= 0.0][:POINTS]
    if not len(depth) or depth[0] >= -1e-3:
        assert count == 0
        return
    assert count == len(depth)
    np.testing.assert_allclose(points.real[:count, 9], depth, atol=1e-12)
    sign = -1.0 if mesh_first else 1.0
    for on_a, on_b, n, gap in ((row[:3], row[3:6], row[6:9], row[9]) for row in points.real[:count]):
        np.testing.assert_allclose(on_b - on_a, gap * n, atol=1e-12)
        corner = on_a if mesh_first else on_b
        assert np.abs(placed - corner).sum(axis=1).min() < 1e-12
        assert np.abs(sign * normals - n).sum(axis=1).min() < 1e-12
    # Nothing is told of corners that are no deeper than is allowed.
    assert sunk_corners(world.geometry, stepper.shapes, bodies, (mesh, solid), -1.001 * depth[0], points) == 0
