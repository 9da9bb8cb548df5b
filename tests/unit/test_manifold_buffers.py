"""Open surfaces, the buffers of contacts, their reduction, and pairs with a cylinder."""

import numpy as np
import pytest
import trimesh
from contact_scenes import IDENTITY, ROUND_OFF, SQUARE, Scene, approached, box, half_space, matched, mesh, sphere, turn

from rigidimpulse.collision.bvh import STACK_ROWS
from rigidimpulse.collision.geometry import CYLINDER, Primitive
from rigidimpulse.collision.manifold.dispatch import Posed, pair_contacts
from rigidimpulse.collision.manifold.reduce import reduce_contacts


def test_open_sheet_is_touched_from_both_sides():
    sheet = trimesh.Trimesh(np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])
    scene = Scene(mesh(sheet), mesh(box()), sphere(0.5))
    for side in (1.0, -1.0):
        contacts = scene.contacts(IDENTITY, (np.array([0.1, 0.2, side * (0.5 + 1e-5)]), np.eye(3)), 2e-5).check()
        assert matched(contacts.point_a[:, :2], SQUARE + [0.1, 0.2], ROUND_OFF)
        np.testing.assert_allclose(contacts.normal, [[0, 0, side]] * 4, rtol=0, atol=ROUND_OFF)
        # Beyond the border: the sphere meets the edge, and half a box hangs over it.
        pose = (np.array([1.0 + 0.3, 0.0, side * 0.4]), np.eye(3))
        contacts = scene.contacts(IDENTITY, pose, 1e-5, (0, 2)).check()
        assert len(contacts) == 1
        np.testing.assert_allclose(contacts.normal[0], [0.6, 0, 0.8 * side], rtol=0, atol=5 * ROUND_OFF)
        contacts = scene.contacts(IDENTITY, (np.array([0.9, 0.2, side * (0.5 + 1e-5)]), np.eye(3)), 2e-5).check()
        assert matched(contacts.point_a[:, :2], [[0.4, -0.3], [1, -0.3], [1, 0.7], [0.4, 0.7]], ROUND_OFF)


class TestBuffers:
    def test_tells_how_many_contacts_it_needs(self):
        small = Scene(mesh(box()), mesh(box()), capacity=3)
        pose_b = (np.array([0.1, 0.2, 1.0 + 1e-5]), np.eye(3))
        arguments = (Posed(0, *IDENTITY), Posed(1, *pose_b), 2e-5)
        assert pair_contacts(small.shapes, *arguments, small.buffers, 0) == -4
        enough = Scene(mesh(box()), mesh(box()), capacity=6)
        enough.real[:2] = 5.0
        assert pair_contacts(enough.shapes, *arguments, enough.buffers, 2) == 6
        assert np.all(enough.real[:2] == 5.0) and np.all(enough.integer[:, :2] == -7)

    def test_chunks_of_leaf_pairs_change_nothing(self):
        surface = trimesh.creation.icosphere(3, 0.5)
        wide = Scene(mesh(surface), mesh(surface), scratch_rows=20000)
        narrow = Scene(mesh(surface), mesh(surface), scratch_rows=STACK_ROWS + 1)
        pose_b = approached(wide, IDENTITY, np.array([0, 0, 1.0]), turn((1, 2, 3), 1.0), 1e-3)
        a, b = wide.contacts(IDENTITY, pose_b, 2e-3), narrow.contacts(IDENTITY, pose_b, 2e-3)
        order_a, order_b = (np.lexsort((c.feature_b, c.feature_a, c.kind)) for c in (a, b))
        np.testing.assert_array_equal(a.point_a[order_a], b.point_a[order_b])


class TestReduction:
    def test_ring_keeps_a_stable_octagon_and_the_deepest(self):
        angle = np.arange(32) * 2 * np.pi / 32 + 0.05
        rows = np.zeros((40, 10))
        rows[:32, 0], rows[:32, 1], rows[:32, 8] = np.cos(angle), np.sin(angle), 1.0
        rows[:32, 9] = 1e-5
        rows[13, 9] = 1e-6
        integer = np.arange(200).reshape(40, 5)
        before = rows.copy()
        count = reduce_contacts(rows, integer, 0, 32)
        assert 8 <= count <= 9
        kept = integer[:count, 0] // 5
        assert 13 in kept and np.all(np.diff(kept) > 0)
        np.testing.assert_array_equal(rows[:count], before[kept])
        spread = np.sort(np.delete(angle[kept], list(kept).index(13)))
        assert np.diff([*spread, spread[0] + 2 * np.pi]).max() < 2.1 * np.pi / 4

    def test_patches_are_not_mixed_and_few_contacts_stay(self):
        rng = np.random.default_rng(14)
        rows, integer = np.zeros((60, 10)), np.zeros((60, 5), dtype=np.int64)
        rows[:, :2] = rng.normal(size=(60, 2))
        rows[:40, 8], rows[40:45, 6], rows[45:, 8] = 1.0, 1.0, -1.0
        integer[:, 4] = np.arange(60)
        before = rows.copy()
        count = reduce_contacts(rows, integer, 0, 60)
        kept = integer[:count, 4]
        np.testing.assert_array_equal(rows[:count], before[kept])
        assert np.isin(range(40, 45), kept).all()
        assert (kept < 40).sum() <= 9 and (kept >= 45).sum() <= 9
        # The hull's support in the kept directions is that of all.
        assert before[:40, :2].max() == before[kept[kept < 40], :2].max()

    def test_contacts_outside_the_range_are_left_alone(self):
        rows, integer = np.zeros((30, 10)), np.zeros((30, 5), dtype=np.int64)
        rows[:, 0], rows[:, 8], rows[:5, 3] = np.arange(30), 1.0, 9.0
        count = reduce_contacts(rows, integer, 5, 30)
        assert 7 <= count < 30 and np.all(rows[:5, 3] == 9.0) and rows[count - 1, 0] == 29.0 and rows[5, 0] == 5.0


@pytest.mark.parametrize("shape", [0, 1, 2, 3, 4, 7])
def test_cylinder_takes_part_on_either_side(shape):
    # Its kernels have their own tests; here: dispatch and swapped results. A cap 0.5 m across is 1e-5 above the top.
    scene = Scene(
        Primitive(CYLINDER, 0.25, frame=np.array([0, 0, 0, 0, 0, 1.0, 0.5])),
        mesh(box()),
        half_space(offset=0.5),
    )
    pose = (np.array([0.05, 0.0, 1.0 + 1e-5]), np.eye(3))
    other = 1 + shape % 2
    there = scene.contacts(pose, IDENTITY, 2e-5, (0, other)).check()
    back = scene.contacts(IDENTITY, pose, 2e-5, (other, 0)).check()
    assert len(there) == len(back) >= 3
    np.testing.assert_array_equal(there.point_a, back.point_b)
    np.testing.assert_array_equal(there.normal, -back.normal)
    np.testing.assert_allclose(back.normal, [[0, 0, 1.0]] * len(back), rtol=0, atol=ROUND_OFF)
    assert scene.gap(pose, IDENTITY, 1.0, (0, other))[0] == pytest.approx(1e-5, abs=ROUND_OFF)
