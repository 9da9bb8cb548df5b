"""Contacts and least distances of random pairs: symmetry, scale, all triangle pairs (accuracy: `contact_scenes`)."""

import numpy as np
import pytest
import trimesh
from contact_scenes import (
    CORNER,
    EDGE_EDGE,
    FACE_VERTEX,
    L_NOTCH,
    PLANE,
    ROUND_OFF,
    VERTEX_FACE,
    Scene,
    approached,
    box,
    capsule,
    half_space,
    matched,
    mesh,
    prism,
    random_pose,
    sphere,
    spot_like,
)
from hypothesis import given, settings
from hypothesis import strategies as st

fixed = settings(deadline=None, derandomize=True, max_examples=60)  # no deadline: the first call compiles

ALL = Scene(
    mesh(box()),
    mesh(spot_like(1)),
    mesh(prism(L_NOTCH, 1.0), 0.4),
    sphere(0.4),
    capsule(0.3, 0.8),
    [sphere(0.2, at=(0.4, 0, 0)), mesh(box(0.5, 0.3, 0.4)), capsule(0.15, 1.0)],
    half_space(),
    mesh(trimesh.creation.icosphere(2, 0.5)),
)
ROUND_SHAPES = [0, 1, 2, 3, 4, 5, 7]
pairs = st.tuples(st.sampled_from(ROUND_SHAPES), st.sampled_from(range(8)))
seeds = st.integers(0, 2**20)


def near_poses(shapes, seed, gap):
    rng = np.random.default_rng(seed)
    pose_a, (_, R_b) = random_pose(rng), random_pose(rng)
    direction = rng.normal(size=3)
    if shapes[1] == 6:  # towards the half space, which is turned by R_b
        direction = -R_b[:, 2]
    return pose_a, approached(ALL, pose_a, direction / np.linalg.norm(direction), R_b, gap, shapes)


@fixed
@given(pairs, seeds, st.sampled_from([1e-2, 1e-4, 1e-7]))
def test_swapping_the_bodies_swaps_the_contacts(shapes, seed, gap):
    pose_a, pose_b = near_poses(shapes, seed, gap)
    there = ALL.contacts(pose_a, pose_b, 2.0 * gap, shapes)
    back = ALL.contacts(pose_b, pose_a, 2.0 * gap, shapes[::-1])
    assert len(there) == len(back) > 0
    # The other body's frame rounds differently; normals between points carry ROUND_OFF / gap.
    distance = np.linalg.norm(there.point_a[:, None] - back.point_b[None], axis=2)
    distance += np.linalg.norm(there.normal[:, None] + back.normal[None], axis=2) * 1e-3
    partner = distance.argmin(axis=1)
    assert sorted(partner) == list(range(len(there)))
    assert np.all(distance.min(axis=1) <= 1e-12 + 1e-3 * 5 * ROUND_OFF / gap)
    np.testing.assert_allclose(there.gap, back.gap[partner], rtol=0, atol=2 * ROUND_OFF)
    swapped_kind = np.array([FACE_VERTEX, VERTEX_FACE, EDGE_EDGE, CORNER, PLANE])[back.kind[partner]]
    np.testing.assert_array_equal(there.kind, swapped_kind)
    of_face = np.isin(there.kind, (EDGE_EDGE, CORNER, PLANE))
    np.testing.assert_array_equal(there.feature_a[of_face], back.feature_b[partner][of_face])


@fixed
@given(pairs, seeds, st.sampled_from([1e-2, 1e-4, 1e-7]))
def test_closest_points_are_among_the_contacts(shapes, seed, gap):
    pose_a, pose_b = near_poses(shapes, seed, gap)
    contacts = ALL.contacts(pose_a, pose_b, 2.0 * gap, shapes).check()
    least, point_a, point_b = ALL.gap(pose_a, pose_b, 1.0, shapes)
    assert contacts.gap.min() == pytest.approx(least, abs=2 * ROUND_OFF)
    assert np.linalg.norm(point_b - point_a) == pytest.approx(least, abs=2 * ROUND_OFF)
    assert np.all(contacts.gap <= 2.0 * gap)


@fixed
@given(pairs, seeds)
def test_contacts_move_with_the_scene(shapes, seed):
    pose_a, pose_b = near_poses(shapes, seed, 1e-3)
    x, R = random_pose(np.random.default_rng(seed + 1))
    contacts = ALL.contacts(pose_a, pose_b, 2e-3, shapes)
    moved = ALL.contacts((x + R @ pose_a[0], R @ pose_a[1]), (x + R @ pose_b[0], R @ pose_b[1]), 2e-3, shapes)
    assert matched(moved.point_a, contacts.point_a @ R.T + x, 1e-12)
    assert matched(moved.normal, contacts.normal @ R.T, 1e-11)
    np.testing.assert_allclose(np.sort(moved.gap), np.sort(contacts.gap), rtol=0, atol=5 * ROUND_OFF)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_scale_does_not_matter(scale):
    rng = np.random.default_rng(12)
    shapes = [box(), spot_like(1), prism(L_NOTCH, 1.0)]
    big = Scene(*(mesh(s, scale) for s in shapes), sphere(0.4 * scale), capsule(0.3 * scale, 0.8 * scale))
    unit = Scene(*(mesh(s) for s in shapes), sphere(0.4), capsule(0.3, 0.8))
    for _ in range(60):
        pair = tuple(rng.integers(0, 5, 2))
        pose_a, (_, R_b) = random_pose(rng), random_pose(rng)
        direction = rng.normal(size=3)
        pose_b = approached(unit, pose_a, direction / np.linalg.norm(direction), R_b, 1e-5, pair)
        if pose_b is None:
            continue
        contacts = unit.contacts(pose_a, pose_b, 2e-5, pair)
        scaled = big.contacts((scale * pose_a[0], pose_a[1]), (scale * pose_b[0], pose_b[1]), 2e-5 * scale, pair)
        assert matched(scaled.point_a / scale, contacts.point_a, 1e-12)
        np.testing.assert_allclose(np.sort(scaled.gap) / scale, np.sort(contacts.gap), rtol=0, atol=ROUND_OFF)
        np.testing.assert_array_equal(np.sort(scaled.kind), np.sort(contacts.kind))


def brute_distance(first, second):
    """Least distance of two sets of triangles (n, 3, 3), (m, 3, 3): every vertex - face and edge - edge pair."""
    best = np.inf
    for a, b in ((first, second), (second, first)):
        best = min(best, _points_to_faces(a.reshape(-1, 3), b))
    edges = [np.stack([t, np.roll(t, -1, axis=1)], axis=2).reshape(-1, 2, 3) for t in (first, second)]
    return min(best, _segments(*edges))


def _points_to_faces(points, faces):
    a, normal = faces[:, 0], np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    height = np.einsum("pfk,fk->pf", points[:, None] - a[None], normal)
    inside = np.ones_like(height, dtype=bool)
    for k in range(3):
        side = np.cross(normal, faces[:, (k + 1) % 3] - faces[:, k])
        inside &= np.einsum("pfk,fk->pf", points[:, None] - faces[None, :, k], side) >= 0.0
    return np.abs(np.where(inside, height, np.inf)).min()


def _segments(first, second):
    p, d = first[:, None, 0], (first[:, 1] - first[:, 0])[:, None]
    q, e = second[None, :, 0], (second[:, 1] - second[:, 0])[None]
    dd, ee, de = (d * d).sum(-1), (e * e).sum(-1), (d * e).sum(-1)
    r = q - p
    dr, er = (d * r).sum(-1), (e * r).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.nan_to_num((dr * ee - er * de) / (dd * ee - de * de), nan=0.0, posinf=0.0, neginf=0.0)
    best = np.inf
    for start in (np.clip(s, 0.0, 1.0), np.zeros_like(s), np.ones_like(s)):
        t = np.clip((start * de - er) / ee, 0.0, 1.0)
        s = np.clip((dr + t * de) / dd, 0.0, 1.0)
        best = min(best, np.linalg.norm(r + t[..., None] * e - s[..., None] * d, axis=-1).min())
    return best


def test_least_distance_of_concave_meshes_is_that_of_all_triangle_pairs():
    rng = np.random.default_rng(13)
    surfaces = [spot_like(2), spot_like(3), prism(L_NOTCH, 1.0), box()]
    scene = Scene(*(mesh(s) for s in surfaces))
    for _ in range(120):
        a, b = rng.integers(0, 4, 2)
        pose_a, pose_b = random_pose(rng), random_pose(rng)
        direction = rng.normal(size=3)
        pose_b = (pose_a[0] + direction / np.linalg.norm(direction) * rng.uniform(0.8, 4.0), pose_b[1])
        triangles = [np.array(surfaces[k].triangles) @ pose[1].T + pose[0] for k, pose in ((a, pose_a), (b, pose_b))]
        exact = brute_distance(*triangles)
        gap, point_a, point_b = scene.gap(pose_a, pose_b, 10.0, (a, b))
        if gap == 0.0:  # the surfaces cross: an edge of one runs through a face of the other
            assert surfaces_cross(*triangles)
            continue
        assert gap == pytest.approx(exact, abs=5 * ROUND_OFF)
        assert np.linalg.norm(point_b - point_a) == pytest.approx(gap, abs=5 * ROUND_OFF)
        assert scene.gap(pose_a, pose_b, 0.5 * exact, (a, b))[0] == 0.5 * exact
        assert scene.gap(pose_a, pose_b, 1.01 * exact, (a, b))[0] == gap


def surfaces_cross(first, second):
    """Tell whether an edge of one set of triangles crosses a face of the other."""
    for a, b in ((first, second), (second, first)):
        start, end = a.reshape(-1, 3), np.roll(a, -1, axis=1).reshape(-1, 3)
        normal = np.cross(b[:, 1] - b[:, 0], b[:, 2] - b[:, 0])
        h0 = np.einsum("pfk,fk->pf", start[:, None] - b[None, :, 0], normal)
        h1 = np.einsum("pfk,fk->pf", end[:, None] - b[None, :, 0], normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = start[:, None] + (h0 / (h0 - h1))[..., None] * (end - start)[:, None]
        inside = h0 * h1 <= 0.0
        for k in range(3):
            side = np.cross(normal, b[:, (k + 1) % 3] - b[:, k])
            inside &= np.einsum("pfk,fk->pf", at - b[None, :, k], side) >= 0.0
        if inside.any():
            return True
    return False
