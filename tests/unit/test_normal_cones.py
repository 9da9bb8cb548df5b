"""Cones of the normals of box trees: what they leave out has no contact, they hold what the kernels accept, and they leave out much."""

import numpy as np
import pytest
import trimesh
from contact_scenes import L_NOTCH, Scene, approached, box, capsule, mesh, prism, random_pose, spot_like, turn

from rigidimpulse.collision.bvh import STACK_ROWS, NodeLimits, gather_leaf_pairs
from rigidimpulse.collision.manifold.contact_points import STRICT, TILT
from rigidimpulse.collision.manifold.mesh_edges import NEARLY_PARALLEL
from rigidimpulse.collision.normal_cones import EDGE_SLACK, TAU, every_direction, vertex_cones

RING = trimesh.creation.torus(0.5, 0.11, major_sections=50, minor_sections=20)


def _rough(seed):
    """A ball of 320 triangles with bumps and dents, so that it has saddles."""
    ball = trimesh.creation.icosphere(2, 0.5)
    ball.vertices += np.random.default_rng(seed).normal(scale=0.03, size=ball.vertices.shape)
    return ball


def _bowl():
    """A half of a sphere, which bounds no solid."""
    ball = trimesh.creation.icosphere(2, 0.5)
    ball.update_faces(ball.triangles_center[:, 2] > 0.0)
    ball.remove_unreferenced_vertices()
    return ball


SHAPES = [box(), RING, spot_like(1), prism(L_NOTCH, 1.0), _rough(1), _bowl(), trimesh.creation.cone(0.3, 1.0, sections=40)]
WITH_CONES = Scene(*(mesh(shape) for shape in SHAPES), capsule(0.2, 0.8))
WITHOUT = Scene(*(mesh(shape) for shape in SHAPES), capsule(0.2, 0.8))
WITHOUT.geometry = WITHOUT.geometry._replace(node_cone=every_direction(len(WITHOUT.geometry.node_cone)))
WITHOUT.shapes = WITHOUT.shapes._replace(geometry=WITHOUT.geometry)


def _sorted(contacts):
    rows = np.column_stack([contacts.point_a, contacts.point_b, contacts.normal, contacts.gap, contacts.kind, contacts.feature_a])
    return rows[np.lexsort(rows.T)]


@pytest.mark.parametrize("seed", range(4))
def test_cones_leave_out_no_contact(seed):
    """Also of bodies that are nearly flush (the kernels keep contacts that miss being locally closest a little), and of some that cross."""
    rng, found = np.random.default_rng(seed), 0
    for k in range(400):
        a, b = rng.integers(len(SHAPES) + 1, size=2).tolist()
        pose_a, (_, R_b) = random_pose(rng), random_pose(rng)
        if k % 3 == 0:
            R_b = pose_a[1] @ turn(rng.normal(size=3), 10.0 ** rng.uniform(-4.0, -1.5))
        direction = pose_a[1][:, 0] if k % 6 == 0 else rng.normal(size=3)
        gap = 10.0 ** rng.uniform(-7.0, -1.3)
        pose_b = approached(WITH_CONES, pose_a, direction / np.linalg.norm(direction), R_b, gap, (a, b))
        if pose_b is None:
            continue
        if k % 5 == 0:
            pose_b = pose_b[0] - 10.0 ** rng.uniform(-9.0, -1.0) * (pose_b[0] - pose_a[0]), R_b
        margin = gap * 10.0 ** rng.uniform(0.0, 2.0)
        there = WITH_CONES.contacts(pose_a, pose_b, margin, (a, b))
        np.testing.assert_array_equal(_sorted(there), _sorted(WITHOUT.contacts(pose_a, pose_b, margin, (a, b))))
        found += len(there)
    assert found > 300


def test_cones_leave_out_three_of_four_pairs_of_leaves_of_rings():
    """Two rings of tubes 0.22 m thick that hang in each other and touch, looked at within 0.04 m: 150 of 700 pairs are left."""
    hanging = np.array([0.78, 0.0, 0.0]), turn((1.0, 0.0, 0.0), 0.5 * np.pi)
    counts = []
    for scene in (WITH_CONES, WITHOUT):
        pairs, geometry = np.empty((1 << 16, 2), np.int64), scene.geometry
        pairs[0] = geometry.node_first[1]
        limits = NodeLimits(0.04, 0.04, 1e-6, 1.0, 0.0)
        counts.append(gather_leaf_pairs(geometry, hanging[1], hanging[0], limits, False, pairs, 1)[1] - STACK_ROWS)
    assert counts[1] > 300
    assert counts[0] < 0.25 * counts[1]


def test_cone_of_a_corner_of_a_cube():
    """The set is  n_k >= -tau ; its farthest point from the diagonal is (-tau, -tau, sqrt(1 - 2 tau^2)), at 59.2 degrees, not 54.7."""
    vertex, edge = np.array([[0.0, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1]]), np.array([[0, 1], [0, 2], [0, 3]])
    angle = vertex_cones(vertex, edge, np.full((4, 3), 3.0**-0.5))[0]
    assert np.cos(angle) == pytest.approx((np.sqrt(1.0 - 2.0 * TAU**2) - 2.0 * TAU) / np.sqrt(3.0), abs=1e-9)


def test_nothing_touches_a_saddle():
    vertex = np.array([[0.0, 0, 0], [1, 0, 0.5], [0, 1, -0.5], [-1, 0, 0.5], [0, -1, -0.5]])
    edge = np.array([[0, 1], [0, 2], [0, 3], [0, 4]])
    assert vertex_cones(vertex, edge, np.tile([0.0, 0.0, 1.0], (5, 1)))[0] == -1.0


def test_a_vertex_that_sees_every_direction_of_a_half_space_has_no_narrow_cone():
    """Two edges in a line: every normal across them is free."""
    vertex, edge = np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0]]), np.array([[0, 1], [0, 2]])
    assert vertex_cones(vertex, edge, np.tile([0.0, 0.0, 1.0], (3, 1)))[0] == np.pi


def test_cones_are_wider_than_the_kernels_accept():
    """A vertex may miss by a tilt and as much round-off; an edge by these and by what counts as parallel."""
    assert TAU > 2.0 * TILT + STRICT
    assert EDGE_SLACK > np.arcsin(2.0 * TILT + STRICT) + np.arcsin(NEARLY_PARALLEL)
