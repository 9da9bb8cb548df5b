"""Contacts of boxes in sub-stepped islands, against separating axes by brute force."""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.collision.contact_cache import Limits, Share, review
from rigidimpulse.collision.contact_records import CONTACT_MARGIN, SEPARATION, SKELETON_A, SKELETON_B
from rigidimpulse.collision.manifold.polyhedra import EDGE_WINS
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import COARSE, ContactStepper
from rigidimpulse.model.plan import Plan
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.recorder import Recorder

SIDES = 2.0 * np.array([[0.5, 0.4, 0.3], [0.3, 0.6, 0.45]])


def gap_by_axes(x: np.ndarray, r: np.ndarray, half: np.ndarray) -> float:
    """Largest gap along the normals of faces and the cross products of edges, m."""
    axes = [*r[0].T, *r[1].T, *(np.cross(e, f) for e in r[0].T for f in r[1].T)]
    best = -np.inf
    for axis in axes:
        length = np.linalg.norm(axis)
        if length < 1e-6:
            continue
        n = axis / length * (1.0 if axis @ (x[1] - x[0]) > 0.0 else -1.0)
        reach = [np.abs(n @ r[k]) @ half[k] for k in range(2)]
        best = max(best, float(n @ (x[1] - x[0]) - reach[0] - reach[1]))
    return best


def stepper_of(seed: int, wanted: float):
    """Stepper with two boxes in random attitudes, moved along the line of their centres until their gap is `wanted` m."""
    random = np.random.default_rng(seed)
    q = random.normal(size=(2, 4))
    direction = random.normal(size=3)
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    for k in range(2):
        scene.add(ri.Body(f"{k}", ri.Shape.box(SIDES[k]), position=k * direction / np.linalg.norm(direction) * 3.0, orientation=q[k]))
    world = compile_scene(scene, ri.Accuracy(contact_solver="substepped"))
    run = Run(world, Plan(world, []), Recorder(np.zeros(1), 2), EventLog())
    stepper, now = ContactStepper(world, world.dynamic, COARSE), run.state.now
    order = stepper.order
    stepper.set_up(run, np.arange(2), np.zeros(0, np.int64), 1.0 / 60.0)
    low, high = 0.0, 3.0
    start, way = now.position[order[0]].copy(), now.position[order[1]] - now.position[order[0]]
    principal = stepper.bodies.rotation[:2].copy()
    half = stepper.shapes.half[world.shape_of_body[order]]
    for _ in range(60):
        middle = 0.5 * (low + high)
        gap = gap_by_axes(np.stack([start, start + middle * way]), principal, half)
        low, high = (middle, high) if gap < wanted else (low, middle)
    now.position[order[1]] = start + high * way
    stepper.set_up(run, np.arange(2), np.zeros(0, np.int64), 1.0 / 60.0)
    return stepper, half


@pytest.mark.parametrize("wanted", [1e-3, -1e-2])
def test_contacts_lie_on_both_boxes_at_the_gap_of_the_best_axis(wanted):
    # The deepest contact is at the largest gap of all axes, to the amount by which an edge must win over faces, EDGE_WINS of the least
    # half side (0.3 m): 0.6 mm. All lie on the surfaces of both boxes along one normal. A wrong axis, sign or clipped corner is off by
    # centimetres.
    for seed in range(40):
        stepper, half = stepper_of(seed, wanted)
        pairs, rows, bodies = stepper.table.pairs, stepper.table.points, stepper.bodies
        assert len(pairs.first) == 1
        count, start = int(pairs.count[0]), int(pairs.start[0])
        assert 1 <= count <= 4
        carrier = bodies.rotation[1 if pairs.carrier[0] else 0]
        gaps = []
        for row in rows[start : start + count]:
            n = carrier @ row[:3]
            points = [bodies.position[k] + bodies.rotation[k] @ row[at : at + 3] for k, at in ((0, SKELETON_A), (1, SKELETON_B))]
            gap = float((points[1] - points[0]) @ n)
            np.testing.assert_allclose(points[1] - points[0], gap * n, atol=1e-12)
            assert row[SEPARATION] + row[CONTACT_MARGIN] == pytest.approx(gap, abs=1e-12)
            for k, at in ((0, SKELETON_A), (1, SKELETON_B)):
                # On the surface of the one whose face or edge it is, and at most the depth inside the other.
                assert np.max(np.abs(row[at : at + 3]) - half[k]) <= 1e-9 + max(gap, 0.0) + max(-wanted, 0.0)
            gaps.append(gap)
        assert min(gaps) == pytest.approx(wanted, abs=EDGE_WINS * half.min() + 1e-9)


def test_pairs_that_have_not_moved_are_not_looked_at_again():
    # What is found once holds until the bodies have moved past each other by more than 2e-3 of the inner radius (0.3 m): 0.6 mm.
    stepper, _ = stepper_of(3, 1e-3)
    table, bodies = stepper.table, stepper.bodies
    places, margins = np.zeros(1, np.int64), np.zeros(1)
    before = table.points.copy()
    for moved, looked in ((0.0, 0), (5e-4, 0), (7e-4, 1)):
        bodies.position[1, 0] += moved
        assert review(bodies, table.pairs, Share(0, 1, places, margins), Limits(1.0 / 60.0, 2e-3, 0.0, 0.0)) == (0, looked)
        bodies.position[1, 0] -= moved
    np.testing.assert_array_equal(table.points, before)
    bodies.position[1] += bodies.position[1] - bodies.position[0]
    assert review(bodies, table.pairs, Share(0, 1, places, margins), Limits(1.0 / 60.0, 2e-3, 0.0, 0.0)) == (0, 0)
    assert table.pairs.count[0] == 0
