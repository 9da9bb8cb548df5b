"""Contacts of spheres, capsules and half spaces against constructions with known answers."""

import numpy as np
import pytest
import trimesh
from contact_scenes import (
    EDGE_EDGE,
    IDENTITY,
    PLANE,
    ROUND_OFF,
    SQUARE,
    Scene,
    body_points,
    box,
    capsule,
    half_space,
    matched,
    mesh,
    placed,
    random_pose,
    roof,
    sphere,
    turn,
)
from scipy.spatial.transform import Rotation


def grid_floor():
    """A slab with its top at z = 0, tiled by 16 x 16 squares of side 1/4."""
    slab = box(4.0, 4.0, 1.0, at=(0.0, 0.0, -0.5))
    for _ in range(4):
        slab = slab.subdivide()
    return mesh(slab)


class TestRounded:
    def test_sphere_on_a_tiled_floor_has_one_contact(self):
        # Also right over the inner edges and vertices of the tiling (pitch 1/8 after halving), where ghosts would come.
        scene = Scene(grid_floor(), sphere(0.3))
        places = [(0.0, 0.0), (0.25, 0.0), (0.125, 0.125), (0.1, 0.1), (0.1, 0.0), (0.3, 0.2), (1.0, 0.75)]
        rng = np.random.default_rng(6)
        for x, y in [*places, *rng.uniform(-1.5, 1.5, (40, 2))]:
            for dx in (0.0, 1e-13, -1e-9):
                contacts = scene.contacts(IDENTITY, (np.array([x + dx, y, 0.3 + 1e-6]), np.eye(3)), 1e-5).check()
                assert len(contacts) == 1
                np.testing.assert_allclose(contacts.normal[0], [0, 0, 1], rtol=0, atol=ROUND_OFF)
                np.testing.assert_allclose(contacts.gap, 1e-6, rtol=0, atol=ROUND_OFF)
                np.testing.assert_allclose(contacts.point_a[0], [x + dx, y, 0.0], rtol=0, atol=ROUND_OFF)

    @pytest.mark.parametrize("gap", [1e-2, 1e-6, 1e-12, -1e-9, -1e-3])
    def test_sphere_at_faces_edges_and_vertices_of_a_box(self, gap):
        rng = np.random.default_rng(7)
        scene = Scene(sphere(0.2), mesh(box()))
        for _ in range(40):
            common = random_pose(rng)
            free = rng.integers(0, 2, 3).astype(bool)  # directions in which the closest point is at the border
            if not free.any():
                continue
            direction = np.where(free, rng.uniform(0.1, 1.0, 3) * rng.choice([-1, 1], 3), 0.0)
            direction /= np.linalg.norm(direction)
            foot = np.where(free, 0.5 * np.sign(direction), rng.uniform(-0.4, 0.4, 3))
            pose_a = placed(common, foot + (0.2 + gap) * direction)
            contacts = scene.contacts(pose_a, common, max(gap, 0.0) + 1e-6).check()
            assert len(contacts) == 1
            np.testing.assert_allclose(contacts.gap, gap, rtol=0, atol=ROUND_OFF)
            np.testing.assert_allclose(contacts.normal[0], -common[1] @ direction, rtol=0, atol=10 * ROUND_OFF)
            np.testing.assert_allclose(body_points(contacts.point_b, common)[0], foot, rtol=0, atol=5 * ROUND_OFF)

    @pytest.mark.parametrize("gap", [1e-2, 1e-9, -1e-9])
    def test_spheres(self, gap):
        scene = Scene(sphere(0.2, at=(0.1, 0.0, 0.0)), sphere(0.3))
        rng = np.random.default_rng(8)
        for _ in range(20):
            pose_a = random_pose(rng)
            direction = rng.normal(size=3)
            direction /= np.linalg.norm(direction)
            centre = pose_a[0] + pose_a[1] @ [0.1, 0.0, 0.0]
            pose_b = (centre + (0.5 + gap) * direction, random_pose(rng)[1])
            contacts = scene.contacts(pose_a, pose_b, 2e-2).check()
            assert len(contacts) == 1
            np.testing.assert_allclose(contacts.gap, gap, rtol=0, atol=ROUND_OFF)
            np.testing.assert_allclose(contacts.normal[0], direction, rtol=0, atol=ROUND_OFF)
            np.testing.assert_allclose(contacts.point_a[0], centre + 0.2 * direction, rtol=0, atol=ROUND_OFF)
            assert scene.gap(pose_a, pose_b)[0] == pytest.approx(gap, abs=ROUND_OFF)
            assert len(scene.contacts(pose_a, pose_b, gap - 1e-10)) == 0

    @pytest.mark.parametrize("tilt", [0.0, 1e-6, -1e-5])
    def test_parallel_capsules_touch_at_both_ends_of_their_overlap(self, tilt):
        scene = Scene(capsule(0.2, 1.0), capsule(0.3, 1.0))
        rng = np.random.default_rng(9)
        for _ in range(10):
            common = random_pose(rng)
            pose_b = placed(common, [0.4, 0.0, 0.5 + 1e-5], turn((0, 1, 0), tilt))
            contacts = scene.contacts(common, pose_b, 2e-5).check()
            assert len(contacts) == 2
            local = body_points(contacts.point_a, common)
            assert matched(local, [[-0.1, 0, 0.2], [0.5, 0, 0.2]], 1e-4)
            np.testing.assert_allclose(contacts.normal @ common[1], [[0, 0, 1.0]] * 2, rtol=0, atol=abs(tilt) + 1e-13)

    def test_crossing_capsules_touch_once(self):
        scene = Scene(capsule(0.2, 1.0), capsule(0.3, 1.0))
        for angle in (0.1, 1.0, np.pi / 2):
            pose_b = (np.array([0.1, 0.02, 0.5 + 1e-6]), turn((0, 0, 1), angle))
            contacts = scene.contacts(IDENTITY, pose_b, 1e-5).check()
            assert len(contacts) == 1 and contacts.kind[0] == EDGE_EDGE
            np.testing.assert_allclose(contacts.gap, 1e-6, rtol=0, atol=ROUND_OFF)
            np.testing.assert_allclose(contacts.normal[0], [0, 0, 1], rtol=0, atol=ROUND_OFF)

    def test_sphere_touches_a_capsule_once(self):
        scene = Scene(capsule(0.2, 1.0), sphere(0.3))
        for x, direction in [
            (0.1, (0, 0, 1)),
            (0.5, (0, 0, 1)),
            (0.5, (1, 0, 1)),
            (-0.5, (-1, 0.2, 0)),
            (0.5, (0, 1, 0)),
        ]:
            direction = np.array(direction) / np.linalg.norm(direction)
            pose_b = (np.array([x, 0, 0]) + (0.5 + 1e-6) * direction, np.eye(3))
            contacts = scene.contacts(IDENTITY, pose_b, 1e-5).check()
            assert len(contacts) == 1
            np.testing.assert_allclose(contacts.normal[0], direction, rtol=0, atol=ROUND_OFF)
            np.testing.assert_allclose(contacts.gap, 1e-6, rtol=0, atol=ROUND_OFF)

    @pytest.mark.parametrize("tilt", [0.0, 1e-5, -1e-5])
    def test_capsule_on_a_face(self, tilt):
        # Wholly over the top of a box 2 m wide, and reaching 0.3 m beyond its border (at x = 1).
        scene = Scene(mesh(box(2.0, 2.0, 1.0)), capsule(0.2, 1.0))
        for centre, ends in ((0.1, (-0.4, 0.6)), (0.8, (0.3, 1.0))):
            pose_b = (np.array([centre, 0.1, 0.7 + 1e-5]), turn((0, 1, 0), tilt) @ turn((0, 0, 1), 0.0))
            contacts = scene.contacts(IDENTITY, pose_b, 2e-5).check()
            assert matched(contacts.point_a, [[x, 0.1, 0.5] for x in ends], 1e-5)
            np.testing.assert_allclose(contacts.normal, [[0, 0, 1.0]] * 2, rtol=0, atol=1.1 * abs(tilt) + ROUND_OFF)

    def test_capsule_across_an_edge_touches_once(self):
        scene = Scene(mesh(roof()), capsule(0.2, 1.0))
        for angle in (np.pi / 2, 0.3):
            pose_b = (np.array([0.1, 0.0, 0.2 + 1e-6]), turn((0, 0, 1), np.pi / 2 - angle))
            contacts = scene.contacts(IDENTITY, pose_b, 1e-5).check()
            assert len(contacts) == 1 and contacts.kind[0] == EDGE_EDGE
            np.testing.assert_allclose(contacts.normal[0], [0, 0, 1], rtol=0, atol=ROUND_OFF)
            np.testing.assert_allclose(contacts.gap, 1e-6, rtol=0, atol=ROUND_OFF)

    def test_capsule_along_a_ridge_touches_at_its_ends(self):
        scene = Scene(mesh(roof()), capsule(0.2, 1.0))
        contacts = scene.contacts(IDENTITY, (np.array([0, 0.7, 0.2 + 1e-6]), turn((0, 0, 1), np.pi / 2)), 1e-5).check()
        assert matched(contacts.point_a, [[0, 0.2, 0], [0, 1.0, 0]], 1e-12)


class TestHalfSpace:
    @pytest.mark.parametrize("gap", [1e-3, 1e-12, -1e-9, -1e-3])
    def test_box_lies_on_four_corners(self, gap):
        scene = Scene(mesh(box()), half_space(normal=(0.6, 0.0, 0.8), offset=0.3))
        rng = np.random.default_rng(10)
        upright, _ = Rotation.align_vectors([[0.6, 0.0, 0.8]], [[0, 0, 1.0]])
        for _ in range(10):
            common = random_pose(rng)
            R = upright.as_matrix() @ turn((0, 0, 1), rng.uniform(0, 6))
            middle = np.array([0.6, 0.0, 0.8]) * (0.3 + 0.5 + gap) + rng.uniform(-1, 1) * np.array([0.8, 0.0, -0.6])
            pose_a = placed(common, middle, R)
            contacts = scene.contacts(pose_a, common, abs(gap) * 2.0).check()
            assert matched(body_points(contacts.point_a, pose_a), [[*p, -0.5] for p in SQUARE], 5 * ROUND_OFF)
            assert np.all(contacts.kind == PLANE) and np.all(contacts.feature_b == 1)
            np.testing.assert_allclose(contacts.gap, gap, rtol=0, atol=5 * ROUND_OFF)
            np.testing.assert_allclose(contacts.normal, [-common[1] @ [0.6, 0, 0.8]] * 4, rtol=0, atol=ROUND_OFF)
            assert scene.gap(pose_a, common)[0] == pytest.approx(gap, abs=5 * ROUND_OFF)

    @pytest.mark.parametrize("shape", [capsule(0.2, 1.0), sphere(0.3), mesh(trimesh.creation.icosphere(4, 0.5))])
    def test_all_vertices_within_the_margin(self, shape):
        scene = Scene(shape, half_space())
        rng = np.random.default_rng(11)
        for _ in range(20):
            x, R = random_pose(rng)
            skeleton = shape.vertices @ R.T
            x[2] = 1e-4 + shape.radius - skeleton[:, 2].min()
            height = skeleton[:, 2] + x[2] - shape.radius
            margin = 2e-2
            contacts = scene.contacts((x, R), IDENTITY, margin).check()
            expected = (skeleton + x - [0, 0, shape.radius])[height <= margin]
            assert matched(contacts.point_a, expected, ROUND_OFF)
            np.testing.assert_allclose(contacts.gap, contacts.point_a[:, 2], rtol=0, atol=ROUND_OFF)
            gap, point_a, point_b = scene.gap((x, R), IDENTITY)
            assert gap == pytest.approx(1e-4, abs=ROUND_OFF)
            np.testing.assert_allclose(point_a - point_b, [0, 0, gap], rtol=0, atol=ROUND_OFF)

    def test_half_spaces_have_no_contact(self):
        scene = Scene(half_space(), half_space((0.0, 0.0, -1.0), -1.0))
        assert len(scene.contacts(IDENTITY, IDENTITY, 5.0)) == 0
        assert scene.gap(IDENTITY, IDENTITY, 3.0)[0] == 3.0
