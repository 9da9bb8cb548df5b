"""Contacts of convex polyhedra in sub-stepped islands, against separating axes by brute force."""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.collision.contact_records import CONTACT_MARGIN, SEPARATION, SKELETON_A, SKELETON_B
from rigidimpulse.collision.distance.epa import EXACT
from rigidimpulse.collision.manifold.convex_convex import SHRINK
from rigidimpulse.collision.manifold.dispatch import HULLS
from rigidimpulse.collision.manifold.polyhedra import EDGE_WINS
from rigidimpulse.core.quaternion import multiply, rotate, to_matrix
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import COARSE, ContactStepper
from rigidimpulse.model.plan import Plan
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.recorder import Recorder


def hull(random: np.random.Generator) -> np.ndarray:
    """Corners on an ellipsoid of about 0.3 m."""
    corners = random.normal(size=(14, 3))
    return corners / np.linalg.norm(corners, axis=1)[:, None] * random.uniform(0.25, 0.4, 3)


def gap_by_axes(corners: list[np.ndarray], shapes: list[ri.Shape], turns: np.ndarray, between: np.ndarray) -> float:
    """Largest s(n) = min n.b - max n.a over the normals of faces and the cross products of edges, m."""
    points = [corners[k] @ turns[k].T for k in range(2)]
    edges, axes = [], []
    for k in range(2):
        surface = shapes[k].surface()
        triangles = surface.vertices[surface.faces] @ turns[k].T
        sides = [triangles[:, (m + 1) % 3] - triangles[:, m] for m in range(3)]
        edges.append(np.concatenate(sides))
        axes.append((1.0 - 2.0 * k) * np.cross(sides[0], sides[1]))
    crossed = np.cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)
    every = np.concatenate([*axes, crossed, -crossed])
    length = np.linalg.norm(every, axis=1)
    every = every[length > 1e-9] / length[length > 1e-9, None]
    return float(((every @ (points[1] + between).T).min(1) - (every @ points[0].T).max(1)).max())


def stepper_at(seed: int, wanted: float):
    """Stepper with two hulls, moved along the line of their centres until their gap is `wanted` m; and its world."""
    random = np.random.default_rng(seed)
    corners = [hull(random) for _ in range(2)]
    q, way = random.normal(size=(2, 4)), random.normal(size=3)
    q /= np.linalg.norm(q, axis=1)[:, None]
    return moved_together(corners, q, 1.5 * way / np.linalg.norm(way), wanted)


def with_parallel_edges(seed: int, wanted: float):
    """The same of two tetrahedra, an edge of each along one line."""
    random = np.random.default_rng(seed)
    corners = 0.35 / np.sqrt(8.0) * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    along = np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)  # of the edge from the second corner to the first
    across, turn = np.cross(random.normal(size=3), along), random.normal(size=4)
    half = random.uniform(0.0, np.pi, 2)
    about = [np.concatenate([[np.cos(angle)], np.sin(angle) * along]) for angle in half]
    q = np.stack([multiply(turn / np.linalg.norm(turn), spin) for spin in about])
    way = across / np.linalg.norm(across) + 0.2 * random.normal() * along
    return moved_together([corners, corners], q, rotate(turn / np.linalg.norm(turn), way), wanted)


def moved_together(corners: list[np.ndarray], q: np.ndarray, way: np.ndarray, wanted: float):
    """Stepper with two hulls, the second moved back along `way` until their gap is `wanted` m; and its world."""
    shapes = [ri.Shape.convex_hull(c) for c in corners]
    turns = np.stack([to_matrix(q[k]) for k in range(2)])
    low, high = 0.0, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gap_by_axes(corners, shapes, turns, middle * way) < wanted else (low, middle)
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    for k in range(2):
        scene.add(ri.Body(f"{k}", shapes[k], position=k * high * way, orientation=q[k]))
    world = compile_scene(scene, ri.Accuracy(contact_solver="substepped"))
    stepper = ContactStepper(world, world.dynamic, COARSE)
    stepper.set_up(Run(world, Plan(world, []), Recorder(np.zeros(1), 2), EventLog()), np.arange(2), np.zeros(0, np.int64), 1.0 / 60.0)
    return stepper, world


@pytest.mark.parametrize("wanted", [5e-3, 1e-4, -3e-3, -3e-2, -0.1, -0.2])
def test_contacts_are_at_the_gap_of_the_best_axis(wanted):
    # The deepest contact is at the gap of the best axis n*, to the amount by which an edge must win over faces: EDGE_WINS of the inner
    # radius (0.1 to 0.2 m), 0.2 to 0.4 mm. Inside each other the axis n is the best of bodies shorter by the factor f: f s(n) + (1 - f)
    # n.d is largest, d from centre to centre, so s(n*) - s(n) <= (1/f - 1) (n - n*).d <= (1/f - 1) (|d| - s(n*) - both inner radii): 2
    # mm. Where even these are inside each other the least depth is found to EXACT of the inner radius, 0.2 mm. (The deepest corner may
    # lie beside the face that bears it, one time in 40: then the deepest point over the face counts, at a quarter less.) A wrong sign,
    # simplex or face is off by centimetres.
    beside = 0
    for seed in range(40):
        stepper, world = stepper_at(seed, wanted)
        pairs, rows, bodies = stepper.table.pairs, stepper.table.points, stepper.bodies
        assert pairs.kind[0] == HULLS
        count, start = int(pairs.count[0]), int(pairs.start[0])
        assert 1 <= count <= 4
        carrier = bodies.rotation[1 if pairs.carrier[0] else 0]
        gaps = []
        for row in rows[start : start + count]:
            n = carrier @ row[:3]
            points = [bodies.position[k] + bodies.rotation[k] @ row[at : at + 3] for k, at in ((0, SKELETON_A), (1, SKELETON_B))]
            gaps.append(float((points[1] - points[0]) @ n))
            np.testing.assert_allclose(points[1] - points[0], gaps[-1] * n, atol=1e-12)
        slack = EDGE_WINS * float(stepper.inner.min())
        if wanted < 0.0:
            distance = float(np.linalg.norm(world.position[1] - world.position[0]))
            slack += SHRINK / (1.0 - SHRINK) * (distance - wanted - float(stepper.inner.sum())) + EXACT * float(stepper.inner.min())
        if wanted < -0.02 and wanted + slack < min(gaps) < 0.7 * wanted:
            beside += 1
            continue
        assert min(gaps) == pytest.approx(wanted, abs=slack + 1e-9)
    assert beside <= 1


@pytest.mark.parametrize("wanted", [3e-3, 6e-4, 1e-5])
def test_issue_005_parallel_edges_do_not_lead_astray(wanted):
    # Corners that tie make flat simplices. Where which side of them 0 is on is left to round-off, the axis of one pair in 300 (the first
    # four seeds here) is any other: contacts 0.1 m deep, or 0.4 mm apart too much. The gap must be that of the best axis, to the
    # amount by which an edge must win over faces.
    for seed in (55, 128, 552, 582, *range(30)):
        stepper, _ = with_parallel_edges(seed, wanted)
        pairs, rows = stepper.table.pairs, stepper.table.points
        start, count = int(pairs.start[0]), int(pairs.count[0])
        gaps = rows[start : start + count, SEPARATION] + rows[start : start + count, CONTACT_MARGIN]
        assert count > 0
        assert gaps.min() == pytest.approx(wanted, abs=EDGE_WINS * float(stepper.inner.min()) + 1e-9)


def test_issue_005_corner_beside_the_face_that_bears_it_has_a_contact():
    # Two of the hulls of tests/bench/piles.py as they came to rest, 2.24 mm inside each other along a pair of edges, than which a face is
    # 0.28 mm less good. Clipped on that face there were three contacts, all of them apart: by 1.7, 11 and 11 mm.
    random = np.random.default_rng(5)
    hulls = []
    for _ in range(11):
        corners = random.normal(size=(32, 3))
        hulls.append(ri.Shape.convex_hull(corners / np.linalg.norm(corners, axis=1)[:, None] * random.uniform(0.25, 0.4, 3)))
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    places = [(-3.0015052, -1.3554154, 0.2264786), (-3.028079, -0.9363094, 0.6423754)]
    turns = [(-0.520265, -0.1454268, 0.1967693, -0.8182036), (-0.697718, 0.0625537, 0.013487, -0.7135087)]
    for k, place, turn in zip((1, 10), places, turns, strict=True):
        scene.add(ri.Body(f"{k}", hulls[k], position=place, orientation=turn))
    world = compile_scene(scene, ri.Accuracy(contact_solver="substepped"))
    stepper = ContactStepper(world, world.dynamic, COARSE)
    stepper.set_up(Run(world, Plan(world, []), Recorder(np.zeros(1), 2), EventLog()), np.arange(2), np.zeros(0, np.int64), 1.0 / 60.0)
    pairs, rows = stepper.table.pairs, stepper.table.points
    start, count = int(pairs.start[0]), int(pairs.count[0])
    gaps = rows[start : start + count, SEPARATION] + rows[start : start + count, CONTACT_MARGIN]
    assert count == 4
    assert gaps.min() == pytest.approx(-2.24e-3, abs=1e-5)
