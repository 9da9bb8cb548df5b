"""A run says where a body went through an open surface, and says nothing of those that went around it or through a hole."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.collision.geometry import CompiledShape, build_geometry, compile_shape
from rigidimpulse.collision.segment_crossings import crossings
from rigidimpulse.core.quaternion import quaternion_from_axis_angle, rotate, to_matrix
from rigidimpulse.engine.measure.depth import inner_points
from rigidimpulse.engine.measure.measure import record_of_recording
from rigidimpulse.engine.measure.record import Fault, RunRecord
from rigidimpulse.engine.measure.tunnelling import KIND, tunnelling_faults

RADIUS, FALL = 0.05, 0.5
SHAPES = {
    "ball": ri.Shape.sphere(RADIUS),
    "box": ri.Shape.box((0.1, 0.1, 0.1)),
    "cylinder": ri.Shape.cylinder(0.05, 0.1),
    "two balls": ri.Shape.compound([(ri.Shape.sphere(0.05), (x, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)) for x in (-0.06, 0.06)]),
}


def sheet(hole: float = 0.0, size: float = 1.0) -> ri.Shape:
    """A level square of 2 `size`, in the middle a hole of 2 `hole`."""
    lines = [-size, -hole, hole, size] if hole > 0.0 else [-size, 0.0, size]
    vertices = [(x, y, 0.0) for y in lines for x in lines]
    faces, n = [], len(lines)
    for row, column in np.ndindex(n - 1, n - 1):
        if not (hole > 0.0 and row == column == 1):
            a = n * row + column
            faces += [(a, a + 1, a + n + 1), (a, a + n + 1, a + n)]
    return ri.Shape.mesh(np.array(vertices), np.array(faces))


def run_above(shape: ri.Shape, surface: ri.Shape, x: float = 0.0) -> ri.Recording:
    """A body 0.3 m above a surface that stands, for a second without gravity."""
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(ri.Body("sheet", surface, motion="static"))
    scene.add(ri.Body("body", shape, position=(x, 0.0, 0.3)))
    return ri.simulate(scene, 1.0)


def planted(run: ri.Recording, height: np.ndarray, move: np.ndarray | None = None) -> RunRecord:
    """The record of a run in which the body is at these heights (f,) m, and `sheet` moves by (f, 3) m, with the velocities of that."""
    record = record_of_recording(run)
    position, velocity = run.centers.copy(), run.velocities.copy()
    position[:, run.index("body"), 2] = height
    if move is not None:
        position[:, run.index("sheet")] += move
    velocity[:] = np.gradient(position, run.times, axis=0)
    return replace(record, frames=record.frames._replace(position=position, velocity=velocity))


def fall(run: ri.Recording, speed: float) -> np.ndarray:
    """Heights (f,) m of a body that goes down from 0.3 m at a steady speed."""
    return 0.3 - speed * run.times


@pytest.mark.parametrize("speed", [0.4, 2.0, 8.0])
@pytest.mark.parametrize("name", SHAPES)
def test_a_body_that_went_through_a_sheet_is_named(name: str, speed: float) -> None:
    """At the first frame on the far side, whether it creeps or falls; depth: at least half of the 5 cm that it was in the sheet."""
    run = run_above(SHAPES[name], sheet())
    faults = tunnelling_faults(planted(run, fall(run, speed)))
    assert [(fault.kind, fault.bodies) for fault in faults] == [(KIND, ("body", "sheet"))]
    # The point that is followed is up to 2 cm beside the middle; a creeping body is looked at twice in half its depth.
    assert abs(faults[0].time - 0.3 / speed) < 0.05 / speed + 1.0 / 60.0
    assert 0.5 * RADIUS < faults[0].amount <= RADIUS


@pytest.mark.parametrize("x", [1.06, 3.0])
def test_a_body_that_passes_beside_a_sheet_is_not_named(x: float) -> None:
    run = run_above(SHAPES["ball"], sheet(), x)
    assert tunnelling_faults(planted(run, fall(run, 2.0))) == []


def test_a_body_that_falls_through_a_hole_is_not_named() -> None:
    run = run_above(SHAPES["ball"], sheet(hole=0.06))
    assert tunnelling_faults(planted(run, fall(run, 2.0))) == []


def test_a_body_that_may_have_gone_around_is_not_named() -> None:
    """At 60 m/s it goes 1 m in a frame, farther than the border is: nothing is known."""
    run = run_above(SHAPES["ball"], sheet(size=0.8))
    assert tunnelling_faults(planted(run, fall(run, 60.0))) == []
    wide = run_above(SHAPES["ball"], sheet(size=10.0))
    assert len(tunnelling_faults(planted(wide, fall(wide, 60.0)))) == 1


def test_a_sheet_that_moves_through_a_body_is_named() -> None:
    """And not where it carries the body up."""
    run = run_above(SHAPES["box"], sheet())
    up = np.zeros((len(run.times), 3))
    up[:, 2] = run.times
    height = np.full(len(run.times), 0.3)
    assert [fault.bodies for fault in tunnelling_faults(planted(run, height, up))] == [("body", "sheet")]
    assert tunnelling_faults(planted(run, np.maximum(height, run.times + 0.05), up)) == []


def test_a_body_that_starts_in_a_sheet_is_not_named() -> None:
    """It is moved out to either side: the start is reported as an overlap."""
    run = run_above(SHAPES["ball"], sheet())
    assert tunnelling_faults(planted(run, 0.01 - 0.08 * run.times)) == []


def test_bodies_that_a_joint_connects_are_not_named() -> None:
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(ri.Body("sheet", sheet(), motion="static"))
    scene.add(ri.Body("body", SHAPES["ball"], position=(0.0, 0.0, 0.3)))
    scene.add(ri.HingeJoint("sheet", "body", (0.0, 0.0, 0.3), (0.0, 1.0, 0.0)))
    run = ri.simulate(scene, 1.0)
    assert tunnelling_faults(planted(run, fall(run, 2.0))) == []


def test_corners_of_each_triangle_make_no_border() -> None:
    """Files may give each triangle corners of its own."""
    whole = sheet()
    torn = ri.Shape.mesh(whole.vertices[whole.faces].reshape(-1, 3), np.arange(whole.faces.size).reshape(-1, 3))
    run = run_above(SHAPES["ball"], torn)
    assert len(tunnelling_faults(planted(run, fall(run, 2.0)))) == 1


def test_triangles_that_run_the_wrong_way_round_make_no_border() -> None:
    """As in files whose triangles were never brought into order."""
    whole = sheet()
    faces = whole.faces.copy()
    faces[::2] = faces[::2, ::-1]
    run = run_above(SHAPES["ball"], ri.Shape.mesh(whole.vertices, faces))
    assert len(tunnelling_faults(planted(run, fall(run, 2.0)))) == 1


@pytest.mark.parametrize("seed", range(4))
def test_what_rests_on_a_landscape_or_falls_off_it_is_ok(seed: int) -> None:
    """Balls and boxes roll down a wavy sheet, and over its border: faults that are none would be seen here."""
    rng, n = np.random.default_rng(seed), 13
    x, y = np.meshgrid(*2 * [np.linspace(-1.0, 1.0, n)])
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = np.vstack([np.column_stack([p.ravel() for p in corners]) for corners in ((a, b, c), (a, c, d))])
    z = 0.3 * x + 0.05 * np.sin(6.0 * x) * np.cos(5.0 * y)
    scene = ri.Scene()
    scene.add(ri.Body("land", ri.Shape.mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces), motion="static"))
    for k in range(6):
        shape = list(SHAPES.values())[k % len(SHAPES)]
        place = (*rng.uniform(-0.9, 0.9, size=2), 0.6 + 0.2 * k)
        scene.add(ri.Body(f"body {k}", shape, position=place, angular_velocity=tuple(3.0 * rng.normal(size=3))))
    run = ri.simulate(scene, 1.5, accuracy="preview" if seed % 2 else "standard")
    assert tunnelling_faults(record_of_recording(run)) == []


def faults_of_turning_sheet(turn: float) -> list[Fault]:
    """A sheet on edge turns about its middle, a ball 0.5 m beside it goes round with it, by `turn` of its angle."""
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(ri.Body("sheet", sheet(), motion="kinematic", angular_velocity=(0.0, 3.0, 0.0)))
    scene.add(ri.Body("body", SHAPES["ball"], position=(0.5, 0.0, 0.3)))
    run = ri.simulate(scene, 0.05)
    record, times = record_of_recording(run), np.linspace(0.0, 1.0, 61)
    turned = quaternion_from_axis_angle(np.array([0.0, 1.0, 0.0]), 3.0 * times)
    ball = rotate(quaternion_from_axis_angle(np.array([0.0, 1.0, 0.0]), 3.0 * turn * times), np.array([0.5, 0.0, 0.3]))
    position = np.stack([np.zeros((61, 3)), ball], axis=1)
    orientation = np.stack([turned, np.tile([1.0, 0.0, 0.0, 0.0], (61, 1))], axis=1)
    spin = np.zeros((61, 2, 3))
    spin[:, 0, 1] = 3.0
    velocity = np.gradient(position, times, axis=0)
    # The sheet's principal axes are those that it was drawn in, so its quaternion is that of its turn.
    np.testing.assert_allclose(to_matrix(record.frames.orientation[0, 0]), np.eye(3), atol=1e-12)
    frames = record.frames._replace(times=times, position=position, orientation=orientation, velocity=velocity, angular_velocity=spin)
    return tunnelling_faults(replace(record, frames=frames))


def test_the_way_is_that_in_the_frame_of_the_sheet() -> None:
    """A ball that keeps its place beside a turning sheet is clear of it; one that goes ahead of it goes through."""
    assert faults_of_turning_sheet(1.0) == []
    assert len(faults_of_turning_sheet(1.5)) == 1


@pytest.mark.parametrize("seed", range(3))
def test_crossings_are_those_of_each_triangle(seed: int) -> None:
    """Against the solution of  p + s (q - p) = a + u (b - a) + v (c - a)  for each triangle, 0 < s < 1, u, v > 0, u + v < 1."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(40, 3, 3))
    shape = compile_shape(ri.Shape.mesh(corners.reshape(-1, 3), np.arange(120).reshape(-1, 3)), np.zeros(3), np.eye(3))
    begin, end = rng.normal(size=(2, 200, 3))
    found = crossings(build_geometry([shape]), 0, begin, end)
    expected = np.zeros(200, int)
    for a, b, c in corners:
        matrix = np.stack([np.broadcast_to(b - a, begin.shape), np.broadcast_to(c - a, begin.shape), begin - end], axis=2)
        u, v, s = np.linalg.solve(matrix, (begin - a)[..., None])[..., 0].T
        expected += (u > 0.0) & (v > 0.0) & (u + v < 1.0) & (s > 0.0) & (s < 1.0)
    assert expected.max() > 2
    assert np.array_equal(found, expected)


def test_a_way_through_a_sheet_crosses_it_an_odd_number_of_times_however_it_is_cut() -> None:
    whole = compile_shape(sheet(), np.zeros(3), np.eye(3))
    geometry = build_geometry([whole])
    way = np.array([[0.11, 0.2, 0.5], [0.3, -0.17, 0.2], [0.21, 0.37, -0.1], [-0.4, 0.3, 0.3], [-0.1, 0.2, -0.6]])
    total = sum(int(crossings(geometry, 0, p[None], q[None])[0]) for p, q in pairwise(way))
    assert total == 3 and int(crossings(geometry, 0, way[:1], way[-1:])[0]) == 1


@pytest.mark.parametrize("name", SHAPES)
def test_inner_points_are_as_deep_as_they_say(name: str) -> None:
    """All points of a ball around them are in the shape."""
    shape = SHAPES[name]
    rng = np.random.default_rng(1)
    for point in inner_points(compile_shape(shape, np.zeros(3), np.eye(3))):
        assert point[3] > 0.5 * RADIUS
        around = rng.normal(size=(200, 3))
        around *= 0.999 * point[3] / np.linalg.norm(around, axis=1)[:, None]
        assert ri.contains(shape, point[:3] + around).all()


def test_a_mesh_that_is_not_convex_has_its_point_inside() -> None:
    """The middle of a ring is in the air."""
    angle, small = np.meshgrid(2.0 * np.pi * np.arange(24) / 24, 2.0 * np.pi * np.arange(10) / 10, indexing="ij")
    out = 0.3 + 0.1 * np.cos(small)
    vertices = np.stack([out * np.cos(angle), out * np.sin(angle), 0.1 * np.sin(small)], axis=-1).reshape(-1, 3)
    at = np.arange(240).reshape(24, 10)
    a, b, c, d = at, np.roll(at, -1, 0), np.roll(np.roll(at, -1, 0), -1, 1), np.roll(at, -1, 1)
    faces = np.vstack([np.column_stack([p.ravel() for p in corners]) for corners in ((a, b, c), (a, c, d))])
    shape = ri.Shape.mesh(vertices, faces)
    compiled: CompiledShape = compile_shape(shape, np.zeros(3), np.eye(3))
    (point,) = inner_points(compiled)
    assert 0.03 < point[3] < 0.1
    assert ri.contains(shape, point[None, :3])[0]
