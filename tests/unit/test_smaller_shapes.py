"""Smaller shapes of the search: what they are, and that contacts found on them are put back on the true shapes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.collision.contact_records import CONTACT_MARGIN, SEPARATION, SKELETON_A, SKELETON_B
from rigidimpulse.collision.geometry import build_geometry, compile_shape
from rigidimpulse.collision.manifold.make_smaller_shapes import DEPTH, make_smaller_shapes
from rigidimpulse.collision.manifold.smaller_shapes import BESIDE_MESHES, PARTS
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import COARSE, ContactStepper
from rigidimpulse.model.plan import Plan
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.recorder import Recorder
from rigidimpulse.scene.shape import Shape


def inset_of(shape: Shape) -> tuple[np.ndarray, np.ndarray, float]:
    """Triangles (t, 3, 3) of a shape of one mesh, those of its inset surface, and the depth of that, m."""
    compiled = compile_shape(shape, np.zeros(3), np.eye(3))
    geometry = build_geometry([compiled])
    one = np.zeros(1, np.int64)
    smaller = make_smaller_shapes([compiled], geometry, np.zeros(1), np.ones(1, bool), one, one)
    inset, faces = smaller.geometry.vertex[len(geometry.vertex) :], compiled.primitives[0].faces
    np.testing.assert_array_equal(inset + smaller.back[len(geometry.vertex) :, :3], geometry.vertex)
    return geometry.vertex[faces], inset[faces], float(smaller.depth[0])


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


def levels_of(shape: Shape) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """d, triangles (t, 3, 3), and those of the smaller shape, of each level that a convex polyhedron has beside a sheet."""
    sheet = Shape.mesh(np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float), [(0, 1, 2), (0, 2, 3)])
    scene = ri.Scene(bodies=[ri.Body("sheet", sheet, motion="static"), ri.Body("body", shape, position=(0, 0, 9))])
    world = compile_scene(scene)
    moves, own = np.zeros(len(world.shapes), bool), int(world.shape_of_body[1])
    moves[own] = True
    smaller = make_smaller_shapes(world.shapes, world.geometry, world.convex_depths, moves, world.shape_of_body, np.arange(2))
    true, levels = world.shapes[own].primitives[0], []
    for level, number in enumerate(smaller.of_body.reshape(-1, 2)[:, 1].tolist()):
        first = smaller.geometry.vertex_first[smaller.geometry.shape_first[number]]
        levels.append((float(smaller.slack[level, 1]), true.vertices[true.faces], smaller.geometry.vertex[first:][true.faces]))
    return levels[BESIDE_MESHES:]


@pytest.mark.parametrize("flat", [1.0, 0.2, 0.04])
@pytest.mark.parametrize("seed", range(6))
def test_levels_of_hulls_are_inside_them(seed: int, flat: float) -> None:
    """All faces are d farther in, and nothing comes out, though the faces are at any angle to the axes.

    With d / h_k along the axes corners of flat hulls came out of them, and no contact was found for what they were inside of.
    """
    hull = Shape.convex_hull(np.random.default_rng(seed).normal(size=(14, 3)) * [1.0, 0.8, flat])
    levels = levels_of(hull)
    assert len(levels) == len(PARTS) - 1
    for d, true, small in levels:
        normal = np.cross(true[:, 1] - true[:, 0], true[:, 2] - true[:, 0])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        assert np.all(np.einsum("tki,ti->tk", true - small, normal) >= d * (1.0 - 1e-6))
        height = np.einsum("vi,ti->vt", small.reshape(-1, 3), normal) - np.einsum("ti,ti->t", true[:, 0], normal)
        assert np.all(height <= -d * (1.0 - 1e-6))


def test_levels_of_a_box_lose_the_same_on_all_sides() -> None:
    for d, true, small in levels_of(Shape.box((1.0, 0.3, 0.1))):
        np.testing.assert_allclose(np.abs(true) - np.abs(small), d, rtol=1e-12)


VALLEY = np.array([(-1.0, -0.5), (1.0, -0.5), (1.0, 0.0), (0.5, -0.2), (0.0, 0.0), (-0.5, -0.2), (-1.0, 0.0)])
"""Section of a static body that is not convex: a ridge along y at x = z = 0."""


def ridge() -> Shape:
    """A prism of that section, 4 m long."""
    n = len(VALLEY)
    ends = [np.column_stack([VALLEY[:, 0], np.full(n, y), VALLEY[:, 1]]) for y in (-2.0, 2.0)]
    sides = [(k, (k + 1) % n, n + (k + 1) % n) for k in range(n)] + [(k, n + (k + 1) % n, n + k) for k in range(n)]
    # The section is seen whole from its lower corners: fans from these, with the middle of the lower side between them.
    section = [(0, 5, 6), (0, 4, 5), (0, 1, 4), (1, 3, 4), (1, 2, 3)]
    faces = sides + [(a, c, b) for a, b, c in section] + [(n + a, n + b, n + c) for a, b, c in section]
    mesh = trimesh.Trimesh(np.vstack(ends), faces, process=False)
    trimesh.repair.fix_normals(mesh)
    assert mesh.is_watertight and mesh.volume > 0.0
    return ri.Shape.mesh(mesh.vertices, mesh.faces)


def contacts_of(body: ri.Body, other: ri.Body) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Contact points of the first body and the other one in sub-steps, in the world, and their gaps, m."""
    world = compile_scene(ri.Scene(gravity=(0.0, 0.0, 0.0), bodies=[body, other]), ri.Accuracy(contact_solver="substepped"))
    stepper = ContactStepper(world, world.dynamic, COARSE)
    members, others = np.flatnonzero(world.dynamic), np.flatnonzero(~world.dynamic)
    stepper.set_up(Run(world, Plan(world, []), Recorder(np.zeros(1), 2), EventLog()), members, others, 1.0 / 60.0)
    pairs, points, bodies = stepper.table.pairs, stepper.table.points, stepper.bodies
    found, start = [], int(pairs.start[0])
    a, b = (int(pairs.first[0]), int(pairs.second[0]))
    for r in range(start, start + int(pairs.count[0])):
        ends = [bodies.position[i] + bodies.rotation[i] @ points[r, at : at + 3] for i, at in ((a, SKELETON_A), (b, SKELETON_B))]
        if int(stepper.order[a]) != 0:
            ends.reverse()
        found.append((ends[0], ends[1], float(points[r, SEPARATION] + points[r, CONTACT_MARGIN])))
    return found


def turned_plank(gap: float, along: float) -> tuple[ri.Body, np.ndarray, np.ndarray]:
    """A plank on its edge across a ridge, `along` m off its middle and `gap` m above; its turn, and where the edge is over the ridge."""
    q = np.array([0.93, 0.21, 0.05, 0.3])
    turn = to_matrix(q / np.linalg.norm(q))
    edges = [turn @ (0.0, y, z) for y in (-0.03, 0.03) for z in (-0.03, 0.03)]
    lowest = min(edges, key=lambda edge: edge[2])
    place = np.array([0.0, 0.2, gap])
    centre = place - lowest - along * turn[:, 0]
    return ri.Body("plank", ri.Shape.box((2.0, 0.06, 0.06)), position=centre, orientation=q), turn, place


@pytest.mark.parametrize("along", [0.0, 0.8])
@pytest.mark.parametrize("gap", [1e-4, -1e-4])
def test_edges_that_cross_touch_where_they_cross(gap: float, along: float) -> None:
    """Of a plank shrunk by 1.2 % the points were 9.6 mm off 0.8 m from its middle, and its spin moved them so."""
    plank, turn, place = turned_plank(gap, along)
    ((on_plank, on_ridge, found),) = contacts_of(plank, ri.Body("ridge", ridge(), motion="static"))
    normal = np.cross(turn[:, 0], (0.0, 1.0, 0.0))
    normal *= np.sign(normal[2]) / np.linalg.norm(normal)
    assert found == pytest.approx(gap * normal[2], abs=1e-12)
    # Two lines, gap m apart above each other at `place`: their nearest points are not just there, by the slope of the plank.
    between = np.linalg.lstsq(np.column_stack([turn[:, 0], (0.0, -1.0, 0.0)]), -gap * np.array([0.0, 0.0, 1.0]), rcond=None)[0]
    np.testing.assert_allclose(on_plank, place + between[0] * turn[:, 0], atol=1e-9)
    np.testing.assert_allclose(on_plank - on_ridge, found * normal, atol=1e-12)


@pytest.mark.parametrize("gap", [1e-4, -1e-4])
def test_faces_of_a_crystal_keep_their_normals(gap: float) -> None:
    """An irregular hull, longer than wide, hangs from the ridge by one of its faces: less of all axes alike turns such a face by 4 mrad."""
    corners = np.random.default_rng(5).normal(size=(16, 3)) * (0.5, 0.15, 0.1)
    hull = trimesh.Trimesh(corners).convex_hull
    face = int(np.argmax(hull.area_faces))
    turn = trimesh.geometry.align_vectors(hull.face_normals[face], (0.0, 0.0, -1.0))[:3, :3] @ np.eye(3)
    turn = trimesh.transformations.rotation_matrix(0.4, (0.0, 1.0, 0.0))[:3, :3] @ turn
    normal = -turn @ hull.face_normals[face]
    place = np.array([0.0, 0.2, 0.0]) + gap * normal
    centre = place - turn @ hull.triangles_center[face]
    q = trimesh.transformations.quaternion_from_matrix(np.block([[turn, np.zeros((3, 1))], [np.zeros((1, 3)), 1.0]]))
    body = ri.Body("hull", ri.Shape.convex_hull(corners), position=centre, orientation=q)
    contacts = contacts_of(body, ri.Body("ridge", ridge(), motion="static"))
    assert contacts
    for on_hull, on_ridge, found in contacts:
        np.testing.assert_allclose((on_hull - on_ridge) / found, normal, atol=1e-9)


@pytest.mark.parametrize("gap", [1e-4, -1e-4])
def test_corners_and_rims_touch_at_their_true_places(gap: float) -> None:
    """A box on a corner, and a drum on its rim, over the flat part of a body that is not convex. A corner off by m across n is 4 mm off."""
    table = ri.Body("table", ridge(), position=(0.0, 0.0, 0.5), orientation=(0.0, 0.0, 1.0, 0.0), motion="static")
    # Drums with an axis less upright count as touched at their side.
    q = np.array([0.95, 0.2, 0.15, 0.1])
    turn = to_matrix(q / np.linalg.norm(q))
    corners = np.array([(x, y, z) for x in (-0.3, 0.3) for y in (-0.2, 0.2) for z in (-0.1, 0.1)]) @ turn.T
    lowest = corners[corners[:, 2].argmin()]
    box = ri.Body("box", ri.Shape.box((0.6, 0.4, 0.2)), position=(0.1, 0.3, 1.0 + gap - lowest[2]), orientation=q)
    ((on_box, on_table, found),) = contacts_of(box, table)
    assert found == pytest.approx(gap, abs=1e-12)
    np.testing.assert_allclose(on_box, lowest + np.asarray(box.position), atol=1e-12)
    np.testing.assert_allclose(on_table, on_box - (0.0, 0.0, gap), atol=1e-12)
    axis = turn[:, 2]
    outward = np.array([0.0, 0.0, -1.0]) + axis[2] * axis
    rim = 0.2 * outward / np.linalg.norm(outward) - np.sign(axis[2]) * 0.15 * axis
    drum = ri.Body("drum", ri.Shape.cylinder(0.2, 0.3), position=(0.1, 0.3, 1.0 + gap - rim[2]), orientation=q)
    ((on_drum, on_table, found),) = contacts_of(drum, table)
    assert found == pytest.approx(gap, abs=1e-12)
    np.testing.assert_allclose(on_drum, rim + np.asarray(drum.position), atol=1e-9)
    np.testing.assert_allclose(on_table, on_drum - (0.0, 0.0, gap), atol=1e-9)
