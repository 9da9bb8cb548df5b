"""Contacts of two shapes against constructions with known answers (accuracy: see `contact_scenes`)."""

import numpy as np
import pytest
import trimesh
from contact_scenes import (
    CORNER,
    EDGE_EDGE,
    FACE_VERTEX,
    IDENTITY,
    L_NOTCH,
    ROUND_OFF,
    SQUARE,
    Scene,
    body_points,
    box,
    clipped,
    half_space,
    matched,
    mesh,
    placed,
    prism,
    random_pose,
    roof,
    sphere,
    turn,
)
from scipy.spatial.transform import Rotation

from rigidimpulse.collision.geometry import ROUND, Primitive


class TestFaces:
    scene = Scene(mesh(box()), mesh(box(1.4, 0.8, 1.0)))

    @pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-6, 1e-9, 1e-12])
    def test_face_on_face_gives_the_corners_of_the_clipped_polygon(self, gap):
        rng = np.random.default_rng(int(-np.log10(gap)))
        for _ in range(40):
            common = random_pose(rng)
            angle, shift = rng.uniform(-np.pi, np.pi), rng.uniform(-0.4, 0.4, 2)
            pose_b = placed(common, [*shift, 1.0 + gap], turn((0, 0, 1), angle))
            contacts = self.scene.contacts(common, pose_b, 2.0 * gap).check()
            R = turn((0, 0, 1), angle)[:2, :2]
            polygon = clipped((SQUARE * [1.4, 0.8]) @ R.T + shift, SQUARE)
            expected = np.column_stack([polygon, np.full(len(polygon), 0.5)])
            # Crossing points of edges at a small angle a lose 1 / a digits: a > 1e-3 here.
            assert matched(body_points(contacts.point_a, common), expected, 1e3 * ROUND_OFF)
            np.testing.assert_allclose(contacts.gap, gap, rtol=0, atol=ROUND_OFF)
            # Crossing edges: the same for the normal.
            np.testing.assert_allclose(
                contacts.normal, np.tile(common[1][:, 2], (len(contacts), 1)), rtol=0, atol=1e3 * ROUND_OFF
            )
            of_face = contacts.kind != EDGE_EDGE
            np.testing.assert_allclose(
                contacts.normal[of_face], np.tile(common[1][:, 2], (of_face.sum(), 1)), rtol=0, atol=ROUND_OFF
            )

    @pytest.mark.parametrize("offset", [0.0, 1e-15, 1e-12, 1e-6])
    @pytest.mark.parametrize("gap", [1e-3, 1e-9])
    def test_aligned_stack_has_four_contacts(self, gap, offset):
        # Vertices over vertices and edges over edges: all coincide, and the contacts of faces are kept.
        scene = Scene(mesh(box()), mesh(box()))
        for quarter in range(4):
            pose_b = (np.array([offset, -offset, 1.0 + gap]), turn((0, 0, 1), quarter * np.pi / 2))
            contacts = scene.contacts(IDENTITY, pose_b, 2.0 * gap).check()
            assert matched(contacts.point_a[:, :2], SQUARE, 2.0 * offset + ROUND_OFF)
            np.testing.assert_allclose(contacts.normal, np.tile([0, 0, 1.0], (4, 1)), rtol=0, atol=ROUND_OFF)

    def test_slightly_tilted_face_keeps_its_corners(self):
        # All four within the margin: the far side is 1e-5 * 0.5 m away, crossing edges are as far out of their arcs.
        margin, tilt = 2e-5, 1e-5
        for axis in ((1, 0, 0), (1, 1, 0), (0.3, -1, 0)):
            for angle in (0.0, 0.5):
                R = turn(axis, tilt) @ turn((0, 0, 1), angle)
                lowest = (R @ np.array([[x, y, -0.5] for x, y in SQUARE * [1.4, 0.8]]).T)[2].min()
                pose_b = (np.array([0.05, 0.02, 0.5 - lowest + 1e-6]), R)
                contacts = self.scene.contacts(IDENTITY, pose_b, margin).check()
                polygon = clipped((SQUARE * [1.4, 0.8]) @ turn((0, 0, 1), angle)[:2, :2].T + [0.05, 0.02], SQUARE)
                assert matched(contacts.point_a[:, :2], polygon, 2.0 * tilt)
                assert np.all(contacts.normal[:, 2] > 1.0 - tilt)

    @pytest.mark.parametrize("yaw", [1e-9, 1e-6, 1e-4, 1e-3])
    def test_nearly_aligned_stack_has_no_leaning_normal(self, yaw):
        # Borders that cross at a small angle a have a common normal that leans by tilt / a: up to 1e-2 here, a force of
        # 1 % sideways. Contacts on faces that lie on each other get the normal of a face instead.
        scene = Scene(mesh(box()), mesh(box()))
        rng = np.random.default_rng(15)
        directions = np.column_stack([np.cos(np.arange(64) * np.pi / 32), np.sin(np.arange(64) * np.pi / 32)])
        for _ in range(60):
            tilt, offset = 1e-6 * rng.uniform(-1, 1, 2), 10.0 ** rng.uniform(-9, -3, 2) * rng.choice([-1, 1], 2)
            R = turn((1, 0, 0), tilt[0]) @ turn((0, 1, 0), tilt[1]) @ turn((0, 0, 1), yaw)
            lowest = (R @ np.array([[*corner, -0.5] for corner in SQUARE]).T)[2].min()
            contacts = scene.contacts(IDENTITY, (np.array([*offset, 0.5 - lowest + 5e-6]), R), 2e-5).check()
            polygon = clipped(SQUARE @ R[:2, :2].T + offset, SQUARE)
            # Corners of nearly 180 degrees may be left out: they lie within L yaw / 4 of the hull of the others, and no
            # direction between two kept corners is lost.
            lack = (polygon @ directions.T).max(axis=0) - (contacts.point_a[:, :2] @ directions.T).max(axis=0)
            assert np.all(lack <= 0.25 * yaw + 1e-5)
            assert np.all(np.linalg.norm(contacts.normal[:, :2], axis=1) <= 2e-6)

    def test_vertex_on_face(self):
        rng = np.random.default_rng(3)
        scene = Scene(mesh(box(4.0, 4.0, 1.0)), mesh(box()))
        for _ in range(100):
            common, gap = random_pose(rng), 10.0 ** rng.uniform(-12, -2)
            R = Rotation.random(random_state=rng).as_matrix()
            corners = np.array(box().vertices) @ R.T
            heights = np.sort(corners[:, 2])
            if heights[1] - heights[0] <= 2.0 * gap:
                continue
            lowest = corners[corners[:, 2].argmin()]
            shift = rng.uniform(-1.0, 1.0, 2)
            pose_b = placed(common, [*shift, 0.5 + gap - lowest[2]], R)
            contacts = scene.contacts(common, pose_b, 2.0 * gap).check()
            assert len(contacts) == 1 and contacts.kind[0] == FACE_VERTEX
            np.testing.assert_allclose(contacts.gap, gap, rtol=0, atol=ROUND_OFF)
            np.testing.assert_allclose(contacts.normal[0], common[1][:, 2], rtol=0, atol=ROUND_OFF)
            at = pose_b[0] + pose_b[1] @ scene.geometry.vertex[contacts.feature_b[0]]
            np.testing.assert_allclose(contacts.point_b[0], at, rtol=0, atol=ROUND_OFF)
            corner = scene.geometry.vertex[scene.geometry.triangle[contacts.feature_a[0]]]
            np.testing.assert_allclose(corner[:, 2], 0.5)


def test_edge_on_edge():
    # Edge a along `along_a` through the origin with z inside its arc, edge b above it; they cross at the origin.
    rng = np.random.default_rng(4)
    scene = Scene(mesh(box()), mesh(box()))
    edge_to_x = np.array([[1.0, 0.0, 0.0], [0.0, 0.5**0.5, -(0.5**0.5)], [0.0, 0.5**0.5, 0.5**0.5]])
    ridge = np.array([0.0, 0.0, 0.5**0.5])  # middle of the edge along x, after that turn
    for _ in range(300):
        common, gap = random_pose(rng), 10.0 ** rng.uniform(-12, -3)
        yaw = rng.uniform(0.2, np.pi - 0.2)
        poses = []
        for sense, heading, height in ((1.0, 0.0, 0.0), (-1.0, yaw, gap)):
            lean, slide = rng.uniform(-0.6, 0.6), rng.uniform(-0.3, 0.3)
            upright = np.diag([1.0, sense, sense]) @ turn((1, 0, 0), lean)
            R = turn((0, 0, 1), heading) @ upright
            x = np.array([0.0, 0.0, height]) - R @ (ridge + [slide, 0.0, 0.0])
            poses.append(placed(common, x, R @ edge_to_x))
        contacts = scene.contacts(*poses, 2.0 * gap).check()
        assert len(contacts) == 1 and contacts.kind[0] == EDGE_EDGE
        np.testing.assert_allclose(contacts.gap, gap, rtol=0, atol=ROUND_OFF)
        np.testing.assert_allclose(contacts.normal[0], common[1][:, 2], rtol=0, atol=5 * ROUND_OFF)
        np.testing.assert_allclose(contacts.point_a[0], common[0], rtol=0, atol=5 * ROUND_OFF)
        assert scene.gap(*poses)[0] == pytest.approx(gap, abs=ROUND_OFF)


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-6, 5e-6])
def test_ridges_along_each_other_touch_at_both_ends_of_their_overlap(tilt):
    # b is turned upside down and half a length ahead: the overlap is 1 m long and reaches from y = 0 to 1.
    scene = Scene(mesh(roof()), mesh(roof()))
    gap = 1e-5
    pose_b = (np.array([0.0, 1.0, gap + tilt]), turn((1, 0, 0), np.pi + tilt))
    contacts = scene.contacts(IDENTITY, pose_b, 2.0 * gap).check()
    assert matched(contacts.point_a, [[0, 0, 0], [0, 1, 0]], 1e-9)
    np.testing.assert_allclose(contacts.normal, np.tile([0, 0, 1.0], (2, 1)), rtol=0, atol=2 * tilt + 1e-10)
    assert np.all(contacts.kind == CORNER)


def test_ridges_with_a_slight_yaw_keep_the_overlap():
    # 1e-7 rad: beside each other by at most 1e-7 m where 1e-5 m apart.
    scene = Scene(mesh(roof()), mesh(roof()))
    gap = 1e-5
    contacts = scene.contacts(IDENTITY, (np.array([0, 0, gap]), turn((0, 0, 1), 1e-7) @ turn((1, 0, 0), np.pi)), 2e-5)
    assert matched(contacts.check().point_a[contacts.kind == CORNER], [[0, -1, 0], [0, 1, 0]], 1e-6)
    assert np.all(contacts.normal[:, 2] > 1.0 - 1e-3)


@pytest.mark.parametrize("gap", [1e-2, 1e-5, 1e-8])
@pytest.mark.parametrize("tip", [(0.1, 0.0, 0.2), (0.0, 0.15, -0.1), (0.2, -0.1, 0.1)])
def test_vertex_beside_an_edge_or_a_vertex(gap, tip):
    # Corner of b against an edge or a corner of a, along a direction inside arc and cone. The normal is known to
    # ROUND_OFF / gap.
    spike = trimesh.Trimesh(
        np.array([[-0.1, -0.1, -1], [0.1, -0.1, -1], [0, 0.1, -1], [0, 0, 0.0]]),
        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        process=False,
    )
    scene = Scene(mesh(spike), mesh(box()))
    normal = np.array([*tip[:2], 1.0]) / np.linalg.norm([*tip[:2], 1.0])
    # The box is turned so that its corner (or edge) -x -y -z points against the normal.
    for corner in (np.array([-0.5, -0.5, -0.5]), np.array([-0.5, 0.1, -0.5])):
        into = -np.sign(np.where(np.abs(corner) == 0.5, corner, 0.0))
        R, _ = Rotation.align_vectors([normal], [into / np.linalg.norm(into)])
        R = R.as_matrix()
        contacts = scene.contacts(IDENTITY, (gap * normal - R @ corner, R), 2.0 * gap).check()
        assert len(contacts) == 1 and contacts.kind[0] == CORNER
        np.testing.assert_allclose(contacts.gap, gap, rtol=0, atol=ROUND_OFF)
        np.testing.assert_allclose(contacts.normal[0], normal, rtol=0, atol=2 * ROUND_OFF / gap)
        np.testing.assert_allclose(contacts.point_a[0], 0.0, atol=ROUND_OFF)


class TestConcave:
    @pytest.mark.parametrize("is_closed", [True, False])
    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_a_corner_near_the_bottom_of_a_valley_meets_both_slopes(self, side, is_closed):
        """A cube on edge over one slope, `before` m from the bottom: its foot on the other slope's plane is not on that slope."""
        slope, before, height, margin = 0.6, 0.02, 1e-3, 0.05
        n = np.array([[-slope, 0.0, 1.0], [slope, 0.0, 1.0]]) / np.hypot(1.0, slope)
        solid = prism([(-2.0, -1.0), (2.0, -1.0), (2.0, 2.0 * slope), (0.0, 0.0), (-2.0, 2.0 * slope)], 4.0)
        surface = mesh(solid)
        if not is_closed:
            upper = np.asarray(solid.face_normals)[:, 2] * np.abs(np.asarray(solid.face_normals)[:, 0]) > 0.1
            surface = Primitive(ROUND, vertices=surface.vertices, faces=surface.faces[upper])
        on, other = (n[0], n[1]) if side > 0 else (n[1], n[0])
        down = np.array([-side, 0.0, -slope]) / np.hypot(1.0, slope)
        scene = Scene(surface, mesh(box()))
        # The lowest edge of the cube runs along y, its two faces lean by 45 degrees to the vertical.
        R = turn((0, 1, 0), np.pi / 4)
        lowest = height * on - before * down
        position = lowest + np.array([0.0, 0.0, 0.5**0.5])
        contacts = scene.contacts(IDENTITY, (position, R), margin).check()
        gaps = {1: float(lowest @ on), 2: float(lowest @ other)}
        assert gaps[2] > 0.01
        for expected, wanted in ((on, gaps[1]), (other, gaps[2])):
            mine = contacts.normal @ expected > 1.0 - 1e-12
            assert mine.sum() == 2 and np.allclose(contacts.gap[mine], wanted, rtol=0, atol=ROUND_OFF)
            assert np.allclose(np.sort(contacts.point_b[mine][:, 1]), [-0.5, 0.5])
        # Farther from the bottom than the margin only its own slope counts.
        far = scene.contacts(IDENTITY, (position - (margin - before + 0.01) * down, R), margin)
        assert np.all(far.normal @ on > 1.0 - 1e-12) and len(far) == 2
        # From the back of an open surface the valley is a ridge: nothing is beyond it.
        if not is_closed:
            below = -0.01 * on - before * down - np.array([0.0, 0.0, 0.5**0.5])
            assert not np.any(np.abs(scene.contacts(IDENTITY, (below, R), margin).normal @ other) > 1.0 - 1e-12)

    @pytest.mark.parametrize("gap", [(1e-3, 4e-4), (1e-6, 1e-6), (1e-9, 3e-10)])
    def test_cube_in_a_notch_touches_both_walls(self, gap):
        rng = np.random.default_rng(5)
        scene = Scene(mesh(prism(L_NOTCH, 4.0)), mesh(box()))
        for _ in range(10):
            common = random_pose(rng)
            pose_b = placed(common, [1.5 + gap[0], 0.3, 1.5 + gap[1]])
            contacts = scene.contacts(common, pose_b, 1.5 * gap[0]).check()
            local = contacts.normal @ common[1]
            for axis, distance in ((0, gap[0]), (2, gap[1])):
                of_wall = local[:, axis] > 0.9
                assert of_wall.sum() == 4
                np.testing.assert_allclose(local[of_wall], np.tile(np.eye(3)[axis], (4, 1)), rtol=0, atol=ROUND_OFF)
                np.testing.assert_allclose(contacts.gap[of_wall], distance, rtol=0, atol=5 * ROUND_OFF)
            assert len(contacts) == 8
            assert len(scene.contacts(common, pose_b, 1.5 * gap[0], reduced=True)) == 8

    def test_table_stands_on_all_corners_of_its_legs(self):
        legs = [box(0.1, 0.1, 0.8, at=(x, y, -0.4)) for x in (-0.9, 0.9) for y in (-0.4, 0.4)]
        top = box(2.0, 1.0, 0.1, at=(0.0, 0.0, 0.1))
        whole = mesh(trimesh.util.concatenate([*legs, top]))
        pieces = [mesh(piece) for piece in (*legs, top)]
        feet = np.array(
            [[x + u, y + v] for x in (-0.9, 0.9) for y in (-0.4, 0.4) for u in (-0.05, 0.05) for v in (-0.05, 0.05)]
        )
        outer = np.array([[x, y] for x in (-0.95, 0.95) for y in (-0.45, 0.45)])
        for table in (whole, pieces):
            for floor in (mesh(box(5.0, 5.0, 1.0, at=(0, 0, -0.5))), half_space()):
                scene = Scene(floor, table)
                contacts = scene.contacts(IDENTITY, (np.array([0, 0, 0.8 + 1e-5]), np.eye(3)), 2e-5).check()
                assert matched(contacts.point_b[:, :2], feet, ROUND_OFF)
                reduced = scene.contacts(IDENTITY, (np.array([0, 0, 0.8 + 1e-5]), np.eye(3)), 2e-5, reduced=True)
                assert len(reduced) <= 9
                distance = np.linalg.norm(reduced.point_b[None, :, :2] - outer[:, None], axis=2)
                assert np.all(distance.min(axis=1) <= ROUND_OFF)

    def test_sphere_in_a_notch_touches_both_walls(self):
        scene = Scene(mesh(prism(L_NOTCH, 4.0)), sphere(0.5))
        contacts = scene.contacts(IDENTITY, (np.array([1.5 + 1e-5, 0.2, 1.5 + 2e-6]), np.eye(3)), 2e-5).check()
        order = np.argsort(contacts.normal[:, 2])
        np.testing.assert_allclose(contacts.normal[order], [[1, 0, 0], [0, 0, 1]], rtol=0, atol=ROUND_OFF)
        np.testing.assert_allclose(contacts.gap[order], [1e-5, 2e-6], rtol=0, atol=ROUND_OFF)
