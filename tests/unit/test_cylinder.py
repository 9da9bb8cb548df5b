"""Contacts of cylinders: the sets of points that an arrangement has, and random poses where each contact is checked.

Expected points and normals are closed forms; coordinates of size 1 in double precision leave 1e-15, and 1e-12 is
allowed down to gaps of 1e-10. A normal taken from the difference of two points would be off by 1e-6 there.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from cylinder_arrangements import (
    Contacts,
    Z,
    box,
    capsule,
    circle,
    contacts_kernel,
    cylinder,
    gap_kernel,
    half_space,
    mesh,
    outside,
    sphere,
    support,
    unit,
)
from scipy.spatial.transform import Rotation

from rigidimpulse.collision.geometry import CYLINDER, ROUND, CompiledShape, Primitive, build_geometry
from rigidimpulse.collision.manifold.contact_points import Contacts as Buffers
from rigidimpulse.collision.manifold.contact_points import Pose
from rigidimpulse.collision.manifold.kept_features import FEW_ROWS, make_contact_scratch

EIGHTHS = 2.0 * np.pi * np.arange(8) / 8
GAP = 1e-5


# -- contacts: half space ---------------------------------------------------------------------------------------------


def test_half_space_standing_lying_tilted():
    down = [0.0, 0.0, -1.0]
    floor = half_space()
    standing = Contacts(cylinder(0.5, 1.0, [0.2, 0.1, 1.0 + GAP]), floor)
    standing.expect(np.array(circle(0.5, EIGHTHS, GAP)) + [0.2, 0.1, 0.0], down, GAP)
    lying = Contacts(cylinder(0.5, 1.0, [0.0, 0.0, 0.5 + GAP], [0.6, 0.8, 0.0]), floor)
    lying.expect([[0.6, 0.8, GAP], [-0.6, -0.8, GAP]], down, GAP)
    axis = np.array([np.sin(0.3), 0.0, np.cos(0.3)])
    lowest = -1.0 * axis - 0.5 * np.array([-np.cos(0.3), 0.0, np.sin(0.3)])
    tilted = Contacts(cylinder(0.5, 1.0, [0.0, 0.0, GAP - lowest[2]], axis), floor)
    tilted.expect([[lowest[0], 0.0, GAP]], down, GAP)
    assert abs(tilted.least_gap()[0] - GAP) < 1e-15
    deep = Contacts(cylinder(0.5, 1.0, [0.0, 0.0, -lowest[2] - 0.01], axis), floor)
    deep.expect([[lowest[0], 0.0, -0.01]], down, -0.01)


def test_half_space_tilt_within_the_margin_keeps_all_directions():
    """A wobble of 1e-5 keeps the fixed points and adds the lowest one; they do not move over the cylinder."""
    tilt = 1e-5
    axis = np.array([np.sin(tilt) * np.cos(0.3), np.sin(tilt) * np.sin(0.3), np.cos(tilt)])
    contacts = Contacts(cylinder(1.0, 1.0, [0.0, 0.0, 1.0 + 3e-5], axis), half_space())
    assert len(contacts.gap) == 9
    lowest = contacts.gap.argmin()
    assert abs(contacts.gap[lowest] - contacts.least_gap()[0]) < 1e-15
    assert np.all(contacts.point_a[:, 2] > 0.0) and np.ptp(contacts.gap) > 1.9e-5
    fixed = np.delete(contacts.point_a, lowest, axis=0) - [0.0, 0.0, 1.0 + 3e-5] + axis
    assert np.allclose(np.linalg.norm(fixed, axis=1), 1.0, rtol=0.0, atol=1e-14)
    assert np.allclose(
        np.linalg.norm(fixed - np.roll(fixed, 1, axis=0), axis=1), 2.0 * np.sin(np.pi / 8), rtol=0.0, atol=1e-14
    )


# -- contacts: polyhedra ----------------------------------------------------------------------------------------------

UP = [0.0, 0.0, 1.0]


def test_box_under_the_cap():
    """Inside the rim, larger than the cap, and across the rim: corners, rim points, crossings of rim and edges."""
    inner = Contacts(cylinder(), box([0.6, 0.8, 1.0]), [0.1, 0.0, 1.5 + GAP])
    inner.expect([[0.1 + x, y, 1.0] for x in (-0.3, 0.3) for y in (-0.4, 0.4)], UP, GAP)
    outer = Contacts(cylinder(), box([4.0, 4.0, 1.0]), [0.1, 0.0, 1.5 + GAP])
    outer.expect(circle(1.0, EIGHTHS, 1.0), UP, GAP)
    half = Contacts(cylinder(), box([4.0, 4.0, 1.0]), [2.3, 0.0, 1.5 + GAP])
    crossings = [[0.3, y, 1.0] for y in (-np.sqrt(0.91), np.sqrt(0.91))]
    half.expect([*circle(1.0, EIGHTHS[[0, 1, 7]], 1.0), *crossings], UP, GAP)
    corner = Contacts(cylinder(), box([4.0, 4.0, 1.0]), [2.3, 2.4, 1.5 + GAP])
    crossings = [[0.3, np.sqrt(0.91), 1.0], [np.sqrt(0.84), 0.4, 1.0]]
    corner.expect([*circle(1.0, [EIGHTHS[1]], 1.0), [0.3, 0.4, 1.0], *crossings], UP, GAP)


def test_cylinder_lying_on_a_box():
    top = box([4.0, 4.0, 1.0])
    lying = cylinder(0.5, 1.0, axis=[1.0, 0.0, 0.0])
    down = [0.0, 0.0, -1.0]
    Contacts(lying, top, [0.0, 0.0, -1.0 - GAP]).expect([[1.0, 0.0, -0.5], [-1.0, 0.0, -0.5]], down, GAP)
    over_the_edge = Contacts(lying, top, [1.6, 0.0, -1.0 - GAP])
    over_the_edge.expect([[1.0, 0.0, -0.5], [-0.4, 0.0, -0.5]], down, GAP)
    plank = Contacts(lying, box([0.6, 4.0, 1.0]), [0.1, 0.0, -1.0 - GAP])
    plank.expect([[-0.2, 0.0, -0.5], [0.4, 0.0, -0.5]], down, GAP)


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_single_features(gap):
    """Ridge across side and cap, vertex on cap and side, tilted rim on a face: the normal does not suffer."""
    quarter = Rotation.from_euler("x", 45, degrees=True)
    ridge, root = box([4.0, 1.0, 1.0]), np.sqrt(0.5)
    lying = cylinder(0.5, 1.0, axis=[0.0, 1.0, 0.0])
    down = [0.0, 0.0, -1.0]
    Contacts(lying, ridge, [0.0, 0.3, -0.5 - root - gap], quarter, 2.0 * gap).expect([[0.0, 0.3, -0.5]], down, gap)
    across = [[x, 0.3, 1.0] for x in (-np.sqrt(0.91), np.sqrt(0.91))]
    Contacts(cylinder(), ridge, [0.0, 0.3, 1.0 + root + gap], quarter, 2.0 * gap).expect(across, UP, gap)
    tip = Rotation.align_vectors([[0.0, 0.0, -1.0]], [[1.0, 1.0, 1.0]])[0]
    cube, reach = box([1.0, 1.0, 1.0]), np.sqrt(0.75)
    Contacts(cylinder(), cube, [0.3, 0.4, 1.0 + reach + gap], tip, 2.0 * gap).expect([[0.3, 0.4, 1.0]], UP, gap)
    side = Contacts(
        cylinder(0.5),
        cube,
        np.array([0.6, 0.8, 0.0]) * (0.5 + reach + gap) + [0.0, 0.0, 0.3],
        Rotation.align_vectors([[-0.6, -0.8, 0.0]], [[1.0, 1.0, 1.0]])[0],
        2.0 * gap,
    )
    side.expect([[0.3, 0.4, 0.3]], [0.6, 0.8, 0.0], gap)
    axis, radial = np.array([0.6, 0.0, 0.8]), np.array([0.8, 0.0, -0.6])
    lowest = radial - axis
    table = Contacts(cylinder(axis=axis), box([4.0, 4.0, 1.0]), [0.0, 0.0, lowest[2] - 0.5 - gap], None, 2.0 * gap)
    table.expect([lowest], down, gap)


def test_rim_and_edge_meet_at_an_angle():
    """The edge slants past the rim; the normal is perpendicular to both curves and 45 degrees up."""
    for gap in (1e-3, 1e-6, 1e-10):
        normal = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
        along = np.array([np.sqrt(0.5) * -1.0, 1.0, np.sqrt(0.5)])
        rotation = Rotation.align_vectors(
            [-normal, along / np.linalg.norm(along)], [[0.0, np.sqrt(0.5), np.sqrt(0.5)], [1.0, 0.0, 0.0]]
        )[0]
        edge = np.array([0.0, 0.5, 0.5])
        contact = np.array([1.0, 0.0, 1.0])
        position = contact + gap * normal - rotation.apply(edge)
        Contacts(cylinder(), box([4.0, 1.0, 1.0]), position, rotation, 2.0 * gap).expect([contact], normal, gap)


def test_two_walls_at_once():
    """A cylinder in a notch (one concave mesh): both walls, each with its own normal."""
    outline = np.array([[-1.0, -1.0], [3.0, -1.0], [3.0, 0.0], [0.0, 0.0], [0.0, 3.0], [-1.0, 3.0]])
    vertices = np.array([[x, y, z] for z in (-2.0, 2.0) for x, y in outline])
    cap = [[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]]
    sides = [[i, (i + 1) % 6, (i + 1) % 6 + 6] for i in range(6)] + [[i, (i + 1) % 6 + 6, i + 6] for i in range(6)]
    faces = [[c, b, a] for a, b, c in cap] + [[a + 6, b + 6, c + 6] for a, b, c in cap] + sides
    notch = Primitive(ROUND, vertices=vertices, faces=np.array(faces))
    contacts = Contacts(cylinder(0.5, 1.0), notch, [-0.5 - GAP, -0.5 - 2.0 * GAP, 0.0])
    points = [[-0.5, 0.0, 1.0], [-0.5, 0.0, -1.0], [0.0, -0.5, 1.0], [0.0, -0.5, -1.0]]
    contacts.expect(points, [[-1.0, 0.0, 0.0]] * 2 + [[0.0, -1.0, 0.0]] * 2)
    assert np.allclose(np.sort(contacts.gap), [GAP, GAP, 2.0 * GAP, 2.0 * GAP], atol=1e-15)
    assert contacts.geometry.closed[1]


# -- contacts: spheres and capsules -----------------------------------------------------------------------------------


def test_sphere_on_cap_side_and_rim():
    for gap in (1e-2, 1e-6, 1e-10, -1e-3):
        reach = 0.3 + gap
        Contacts(cylinder(), sphere(0.3), [0.2, 0.1, 1.0 + reach], margin=0.1).expect([[0.2, 0.1, 1.0]], UP, gap)
        Contacts(cylinder(), sphere(0.3), [0.6 * (1.0 + reach), 0.8 * (1.0 + reach), 0.2], margin=0.1).expect(
            [[0.6, 0.8, 0.2]], [0.6, 0.8, 0.0], gap
        )
        n = np.array([0.8, 0.0, 0.6])
        Contacts(cylinder(), sphere(0.3), [1.0, 0.0, 1.0] + reach * n, margin=0.1).expect([[1.0, 0.0, 1.0]], n, gap)


def test_capsule_lying_on_side_and_cap():
    beside = Contacts(cylinder(0.5, 1.0), capsule(0.3, 0.6), [0.8 + GAP, 0.0, 0.0])
    beside.expect([[0.5, 0.0, 0.6], [0.5, 0.0, -0.6]], [1.0, 0.0, 0.0], GAP)
    overhang = Contacts(cylinder(0.5, 1.0), capsule(0.3, 0.6), [0.8 + GAP, 0.0, 0.8])
    overhang.expect([[0.5, 0.0, 0.2], [0.5, 0.0, 1.0]], [1.0, 0.0, 0.0], GAP)
    quarter = Rotation.from_euler("y", 90, degrees=True)
    Contacts(cylinder(), capsule(0.3, 0.5), [0.0, 0.0, 1.3 + GAP], quarter).expect(
        [[0.5, 0.0, 1.0], [-0.5, 0.0, 1.0]], UP, GAP
    )
    across = [[x, 0.6, 1.0] for x in (-0.8, 0.8)]
    Contacts(cylinder(), capsule(0.3, 2.0), [0.0, 0.6, 1.3 + GAP], quarter).expect(across, UP, GAP)
    crossed = Contacts(cylinder(0.5, 1.0), capsule(0.3, 2.0), [0.0, 0.8 + GAP, 0.2], quarter)
    crossed.expect([[0.0, 0.5, 0.2]], [0.0, 1.0, 0.0], GAP)
    standing = Contacts(cylinder(), capsule(0.3, 0.5), [0.2, 0.1, 1.8 + GAP])
    standing.expect([[0.2, 0.1, 1.0]], UP, GAP)


# -- contacts: two cylinders ------------------------------------------------------------------------------------------


def test_stacked_cylinders():
    same = Contacts(cylinder(), cylinder(), [0.0, 0.0, 2.0 + GAP])
    same.expect(circle(1.0, EIGHTHS, 1.0), UP, GAP)
    small = Contacts(cylinder(), cylinder(0.4, 1.0), [0.3, 0.2, 2.0 + GAP])
    small.expect(np.array(circle(0.4, EIGHTHS, 1.0)) + [0.3, 0.2, 0.0], UP, GAP)
    offset = Contacts(cylinder(), cylinder(), [0.5, 0.0, 2.0 + GAP])
    own = circle(1.0, EIGHTHS[[7, 0, 1]], 1.0)
    other = np.array(circle(1.0, EIGHTHS[[3, 4, 5]], 1.0)) + [0.5, 0.0, 0.0]
    crossings = [[0.25, y, 1.0] for y in (-np.sqrt(0.9375), np.sqrt(0.9375))]
    offset.expect([*own, *other, *crossings], UP, GAP)


def test_cylinders_side_by_side_and_crossed():
    beside = Contacts(cylinder(0.5, 1.0), cylinder(0.3, 2.0), [0.8 + GAP, 0.0, 1.5])
    beside.expect([[0.5, 0.0, 1.0], [0.5, 0.0, -0.5]], [1.0, 0.0, 0.0], GAP)
    flush = Contacts(cylinder(0.5, 1.0), cylinder(0.3, 1.0), [0.0, 0.8 + GAP, 0.0])
    flush.expect([[0.0, 0.5, 1.0], [0.0, 0.5, -1.0]], [0.0, 1.0, 0.0], GAP)
    for gap in (1e-2, 1e-6, 1e-10):
        crossed = Contacts(
            cylinder(0.5, 1.0), cylinder(0.3, 2.0, axis=[0.6, 0.0, 0.8]), [0.1, 0.8 + gap, 0.2], margin=2.0 * gap
        )
        height = 0.2 - 0.1 * 0.8 / 0.6
        crossed.expect([[0.0, 0.5, height]], [0.0, 1.0, 0.0], gap)


def test_cylinder_lying_on_a_cap():
    lying = cylinder(0.3, 0.5, axis=[1.0, 0.0, 0.0])
    Contacts(cylinder(), lying, [0.1, 0.2, 1.3 + GAP]).expect([[0.6, 0.2, 1.0], [-0.4, 0.2, 1.0]], UP, GAP)
    long = cylinder(0.3, 3.0, axis=[1.0, 0.0, 0.0])
    Contacts(cylinder(), long, [0.1, 0.6, 1.3 + GAP]).expect([[0.8, 0.6, 1.0], [-0.8, 0.6, 1.0]], UP, GAP)
    Contacts(cylinder(), long, [2.5, 0.6, 1.3 + GAP]).expect([[0.8, 0.6, 1.0], [-0.5, 0.6, 1.0]], UP, GAP)


def test_rim_on_side_and_rim_on_rim():
    root = np.sqrt(0.5)
    for gap in (1e-3, 1e-6, 1e-9):
        # a rim point straight above the side of a lying cylinder; the lowest point of the tilted one
        leaning = cylinder(0.5, 1.0, axis=[0.0, root, root])
        lying = cylinder(0.4, 3.0, axis=[1.0, 0.0, 0.0])
        lowest = -root * np.array([0.0, 1.0, 1.0]) - 0.5 * root * np.array([0.0, -1.0, 1.0])
        at = lowest - [0.0, 0.0, 0.4 + gap]
        Contacts(leaning, lying, at, margin=2.0 * gap).expect([lowest], [0.0, 0.0, -1.0], gap)
        # two rims cross at right angles, 45 degrees up
        normal = np.array([root, 0.0, root])
        other_axis = -np.array([root * np.cos(0.8), -np.sin(0.8), root * np.cos(0.8)])
        radial = -np.array([root * np.sin(0.8), np.cos(0.8), root * np.sin(0.8)])
        assert abs(other_axis @ radial) < 1e-15
        second = cylinder(0.7, 0.9, axis=other_axis)
        contact = np.array([1.0, 0.0, 1.0])
        contacts = Contacts(
            cylinder(), second, contact + gap * normal - 0.9 * other_axis - 0.7 * radial, margin=2.0 * gap
        )
        distance, p, q = contacts.least_gap()
        assert len(contacts.gap) == 1 and abs(contacts.gap[0] - distance) < 1e-12
        assert np.linalg.norm(contacts.point_a[0] - p) < 1e-9 and np.linalg.norm(contacts.point_b[0] - q) < 1e-9


# -- contacts: random poses -------------------------------------------------------------------------------------------

OTHERS = {
    "box": box([1.0, 1.0, 1.0]),
    "hull": mesh(trimesh.convex.convex_hull(np.random.default_rng(9).normal(size=(12, 3)))),
    "sphere mesh": mesh(trimesh.creation.icosphere(subdivisions=1)),
    "sphere": sphere(0.3),
    "capsule": capsule(0.3, 0.7),
    "cylinder": cylinder(0.6, 0.5, [0.1, 0.2, -0.1], [0.0, 0.6, 0.8]),
}


def surface_distance(primitive, point):
    """Return the distance of a point to the surface of a primitive in its own frame."""
    if primitive.kind == CYLINDER:
        return abs(outside(point, primitive.frame[:3], primitive.frame[3:6], primitive.frame[6], primitive.radius))
    if len(primitive.faces):
        triangles = primitive.vertices[primitive.faces]
        return np.linalg.norm(
            trimesh.triangles.closest_point(triangles, np.tile(point, (len(triangles), 1))) - point, axis=1
        ).min()
    a, b = primitive.vertices[0], primitive.vertices[-1]
    fraction = np.clip((point - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0.0, 1.0)
    return abs(np.linalg.norm(point - a - fraction * (b - a)) - primitive.radius)


def facing(rng, first_axis, primitive):
    """A rotation that turns a face, or an axis, of the second body flat against the cylinder, exactly or nearly so."""
    target = [first_axis, np.cross(first_axis, unit(rng))][rng.integers(2)]
    target = target / np.linalg.norm(target)
    if len(primitive.faces):
        a, b, c = primitive.vertices[primitive.faces[rng.integers(len(primitive.faces))]]
        source = np.cross(b - a, c - a)
    else:
        source = primitive.frame[3:6] if primitive.kind == CYLINDER else Z
        source = [source, np.cross(source, unit(rng))][rng.integers(2)]
    turn = Rotation.align_vectors([target], [-source / np.linalg.norm(source)])[0]
    wobble = Rotation.from_rotvec(unit(rng) * 10.0 ** rng.uniform(-12, -5) * rng.integers(2))
    return target, wobble * Rotation.from_rotvec(target * rng.uniform(0.0, 6.0)) * turn


@pytest.mark.parametrize("name", OTHERS)
def test_random_contacts(name):
    """Each contact joins two surfaces along its normal, the least gap is the distance, and one normal proves it.

    Where a face lies flat the least contact may miss the closest pair by the tilt below which a rim has no lowest
    point, 1e-12.
    """
    rng = np.random.default_rng(23)
    first, second = cylinder(0.7, 0.9, [0.1, -0.2, 0.3], [0.6, 0.0, 0.8]), OTHERS[name]
    centre, axis = first.frame[:3], first.frame[3:6]
    num_checked = 0
    for trial in range(150):
        direction, rotation = (unit(rng), Rotation.random(random_state=rng)) if trial % 2 else facing(rng, axis, second)
        position = centre + 5.0 * direction + np.cross(direction, unit(rng)) * rng.choice([0.0, 0.3, 0.8])
        gap = 10.0 ** rng.uniform(-9, -4)
        margin = max(2.0 * gap, 1e-6)
        for _ in range(100):
            distance = Contacts(first, second, position, rotation, -1.0).least_gap()[0]
            if abs(distance - gap) < 1e-3 * gap or distance > 9.0:
                break
            position = position - direction * (distance - gap)
        if abs(distance - gap) > 1e-2 * gap:
            continue
        num_checked += 1
        contacts = Contacts(first, second, position, rotation, margin)
        least = contacts.gap.argmin()
        assert abs(contacts.gap[least] - distance) < 1e-11
        for p, q, n, g in zip(contacts.point_a, contacts.point_b, contacts.normal, contacts.gap, strict=True):
            assert 0.0 < g <= margin and abs(np.linalg.norm(n) - 1.0) < 1e-14
            assert np.abs(p + g * n - q).max() < 1e-11
            assert abs(outside(p, centre, axis, 0.9, 0.7)) < 1e-11
            assert surface_distance(second, rotation.inv().apply(q - position)) < 1e-11
        n = contacts.normal[least]
        if second.kind == CYLINDER:
            lowest = n @ (rotation.apply(second.frame[:3]) + position) - support(
                rotation.apply(second.frame[3:6]), 0.5, 0.6, n
            )
        else:
            lowest = ((rotation.apply(second.vertices) + position) @ n).min() - second.radius
        assert abs(lowest - n @ centre - support(axis, 0.9, 0.7, n) - distance) < 1e-9
    assert num_checked > 60


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_contacts_scale_with_the_scene(scale):
    rotation = Rotation.from_euler("zyx", [0.3, np.pi / 2 + 1e-6, 0.2])
    for name, second in OTHERS.items():
        frame = np.concatenate([second.frame[:3] * scale, second.frame[3:6], second.frame[6:] * scale])
        scaled = Primitive(second.kind, second.radius * scale, frame, second.vertices * scale, second.faces)
        position = np.array([0.1, 0.2, 5.0])
        for _ in range(60):
            position[2] += GAP - Contacts(cylinder(), second, position, rotation, -1.0).least_gap()[0]
        reference = Contacts(cylinder(), second, position, rotation, 1e-4)
        other = Contacts(cylinder(scale, scale), scaled, position * scale, rotation, 1e-4 * scale)
        assert len(other.gap) == len(reference.gap) > 0, name
        assert np.allclose(other.point_a, reference.point_a * scale, rtol=0.0, atol=1e-9 * scale)
        assert np.allclose(other.normal, reference.normal, rtol=0.0, atol=1e-9)


def test_full_buffer_counts_on_and_limit_is_kept():
    geometry = build_geometry([CompiledShape((cylinder(),)), CompiledShape((half_space(offset=-1.0 - GAP),))])
    real, integer = np.zeros((3, 10)), np.zeros((3, 5), np.int64)
    scratch, out = make_contact_scratch.py_func(200, 0, FEW_ROWS), np.full(9, 7.0)
    pose = Pose(np.eye(3), np.zeros(3))
    assert contacts_kernel(geometry, 0, 1, pose, 1e-4, Buffers(real, integer, scratch)) == 8
    assert gap_kernel(geometry, 0, 1, pose, 1e-6, scratch.pairs, out) == 1e-6
    assert np.all(out == 7.0)
