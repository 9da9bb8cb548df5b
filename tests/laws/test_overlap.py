"""Overlap at the start: reported with its depth, taken out by position alone.

Laws. Frame 0 is the state as given; from frame 1 on no two bodies overlap. No velocity comes from it: without gravity
bodies at rest stay at rest, and the centre of mass of free bodies stays. Lifting m by d costs m g d, booked as "overlap",
so that energy and books balance to round-off. The depth is the least way out: s of two boxes that overlap by s along
their nearest axis, r_1 + r_2 - d of two balls. Two masses share it as 1/m. Mirror images stay mirror images.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.collision.distance.fcl import Narrowphase

G = 9.81
FLOOR = {"shape": ri.Shape.half_space(), "motion": "static"}


def simulate(bodies: dict[str, dict], gravity: float = 0.0, duration: float = 0.2, joints: tuple = ()) -> ri.Recording:
    scene = ri.Scene(gravity=(0, 0, -gravity), bodies=[ri.Body(name, **body) for name, body in bodies.items()])
    for joint in joints:
        scene.add(joint)
    return ri.simulate(scene, duration)


def depths(run: ri.Recording) -> dict[tuple[str, ...], float]:
    """Depth that the status reports, by pair."""
    found = {}
    for event in run.status.events:
        if event.kind == "overlap at the start":
            match = re.search(r"by ([-\d.e]+) m", event.message)
            assert match and event.time == 0.0
            found[event.bodies] = float(match[1])
    return found


def all_apart(run: ri.Recording, frame: int) -> bool:
    """Whether the surfaces of all pairs with a movable body are apart at a frame."""
    assert run.scene is not None
    world = ri.compile_scene(run.scene)
    narrow = Narrowphase(world.shapes)
    poses = [(run.centers[frame, i], world.orientation[i]) for i in range(world.num_bodies)]
    pairs = [(a, b) for a in range(len(poses)) for b in range(a) if world.dynamic[a] or world.dynamic[b]]
    shape = world.shape_of_body
    return not any(narrow.overlap(int(shape[a]), poses[a], int(shape[b]), poses[b]) for a, b in pairs)


BOX, BALL = ri.Shape.box((1.0, 1.0, 1.0)), ri.Shape.sphere(0.5)
FREE = {
    "boxes, half way": ({"shape": BOX, "mass": 1.0}, {"shape": BOX, "mass": 3.0, "position": (0.5, 0.1, 0.2)}, 0.5),
    "boxes, same place": ({"shape": BOX, "mass": 1.0}, {"shape": BOX, "mass": 1.0}, 1.0),
    "balls": ({"shape": BALL, "mass": 1.0}, {"shape": BALL, "mass": 3.0, "position": (0.3, 0.4, 0.0)}, 0.5),
    "balls, same place": ({"shape": BALL, "mass": 1.0}, {"shape": BALL, "mass": 1.0}, 1.0),
    "ball in box": ({"shape": BOX, "mass": 1.0}, {"shape": ri.Shape.sphere(0.1), "mass": 1.0, "position": (0, 0.2, 0.1)}, 0.4),
    "ball in ball": ({"shape": BALL, "mass": 1.0}, {"shape": ri.Shape.sphere(0.1), "mass": 1.0, "position": (0, 0.2, 0)}, 0.4),
}


@pytest.mark.parametrize("case", FREE)
def test_free_bodies_are_moved_apart_and_stay_at_rest(case: str) -> None:
    first, second, depth = FREE[case]
    run = simulate({"first": first, "second": second})
    assert depths(run) == {("first", "second"): pytest.approx(depth, rel=1e-3)}
    start = np.array([first.get("position", (0, 0, 0)), second.get("position", (0, 0, 0))])
    np.testing.assert_array_equal(run.positions[0], start)
    assert all_apart(run, 1)
    assert not run.velocities.any()
    assert not run.angular_velocities.any()
    mass = np.array([first["mass"], second["mass"]])
    moved = run.positions[-1] - start
    np.testing.assert_allclose(mass @ moved, 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1) * mass, depth / np.sum(1 / mass), rtol=1e-4)


def test_box_sunk_in_the_floor_is_lifted_and_the_books_balance() -> None:
    run = simulate({"floor": FLOOR, "box": {"shape": BOX, "mass": 2.0, "position": (0, 0, 0.3)}}, G)
    assert depths(run) == {("floor", "box"): pytest.approx(0.2, rel=1e-4)}
    np.testing.assert_allclose(run.position("box")[1:], [(0, 0, 0.5)] * (len(run.times) - 1), atol=2e-6)
    assert not run.velocity("box")[1:].any()
    assert run.ledger is not None
    assert run.ledger.dissipated["overlap"][[0, -1]] == pytest.approx([0, -2 * G * 0.2], rel=1e-4)
    balance = run.ledger.total + sum(run.ledger.dissipated.values())
    np.testing.assert_allclose(balance, balance[0], atol=1e-12 * 2 * G)


def test_moving_bodies_keep_their_velocities() -> None:
    moving = {"velocity": (-1.0, 0.5, 0.2), "angular_velocity": (0.1, 0.2, 0.3)}
    run = simulate({"first": {"shape": BALL}, "second": {"shape": BALL, "position": (0.3, 0, 0), "velocity": (1.0, 0, 0)} | moving})
    still, thrown = run.velocities[0]
    assert not still.any()
    np.testing.assert_array_equal(thrown, (-1.0, 0.5, 0.2))
    # They are apart, so what follows is an ordinary impact: nothing is gained.
    assert run.ledger is not None
    assert np.all(np.diff(run.ledger.kinetic) <= 1e-12)


def test_sunken_stack_is_lifted_as_a_whole() -> None:
    boxes = {f"box{k}": {"shape": BOX, "mass": 1.0, "position": (0, 0, 0.4 + 0.8 * k)} for k in range(4)}
    run = simulate({"floor": FLOOR} | boxes, G)
    np.testing.assert_allclose(run.positions[-1, 1:, 2], 0.5 + np.arange(4), atol=1e-5)
    assert not run.velocities[-1].any()


def test_symmetric_overlap_stays_symmetric() -> None:
    angles = 2 * np.pi * np.arange(3) / 3
    places = 0.3 * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    run = simulate({f"ball{k}": {"shape": BALL, "mass": 1.0, "position": place} for k, place in enumerate(places)})
    np.testing.assert_allclose(run.positions[-1], places / 0.3 / np.sqrt(3), atol=1e-5)


def test_concave_mesh_comes_out_of_the_floor_and_of_another() -> None:
    from trimesh.creation import torus

    ring = torus(0.5, 0.15, 24, 12)
    shape = ri.Shape.mesh(ring.vertices, ring.faces)
    sunk = simulate({"floor": FLOOR, "ring": {"shape": shape, "position": (0, 0, -0.05)}}, G)
    assert depths(sunk) == {("floor", "ring"): pytest.approx(0.2, rel=1e-2)}
    assert all_apart(sunk, 1)
    pair = simulate({"first": {"shape": shape}, "second": {"shape": shape, "position": (0.05, 0, 0.1)}})
    assert depths(pair) == {("first", "second"): pytest.approx(0.2, rel=0.05)}
    assert all_apart(pair, 1)
    assert not pair.velocities.any()


def test_what_is_joined_moves_as_one() -> None:
    bodies = {"low": {"shape": BOX, "position": (0, 0, 0.2)}, "high": {"shape": BOX, "position": (0, 0, 1.5)}}
    run = simulate({"floor": FLOOR} | bodies, G, joints=(ri.FixedJoint("low", "high", anchor=(0, 0, 1)),))
    np.testing.assert_allclose(run.positions[-1, 1:, 2], (0.5, 1.8), atol=1e-5)


def test_cube_in_a_hole_too_small_is_said_and_nothing_freezes() -> None:
    walls = {
        f"wall {x:+}{y:+}": {"shape": ri.Shape.box((0.2, 2, 2) if x else (2, 0.2, 2)), "motion": "static", "position": (x, y, 1.2)}
        for x, y in ((-0.55, 0), (0.55, 0), (0, -0.55), (0, 0.55))
    }
    run = simulate({"floor": FLOOR} | walls | {"cube": {"shape": BOX, "position": (0, 0, 1.0)}}, G, 1.0)
    kinds = [event.kind for event in run.status.events]
    assert kinds.count("overlap at the start") == kinds.count("overlap not resolved") == 4
    # It falls through the walls that it is inside of and lands on the floor.
    fallen = 1.0 - 0.5 * G * run.times**2
    np.testing.assert_allclose(run.position("cube")[:, 2], np.maximum(fallen, 0.5), atol=1e-5)


def crowd(shapes: list[ri.Shape], number: int, seed: int, spread: float) -> dict[str, dict]:
    """Bodies at random places within a spread, m, turned at random."""
    numbers = np.random.default_rng(seed)
    turns = numbers.normal(size=(number, 4))
    places = numbers.uniform(-spread, spread, (number, 3)) + (0.0, 0.0, spread)
    return {
        f"body{k}": {"shape": shapes[k % len(shapes)], "position": places[k], "orientation": turns[k] / np.linalg.norm(turns[k])}
        for k in range(number)
    }


@pytest.mark.parametrize("kind", ["balls", "boxes", "all kinds"])
def test_no_pair_of_a_crowd_is_left_inside_another(kind: str) -> None:
    from trimesh.creation import torus

    ring = torus(0.1, 0.03, 24, 12)
    ball, box = ri.Shape.sphere(0.05), ri.Shape.box((0.1, 0.08, 0.06))
    shapes = {
        "balls": [ball],
        "boxes": [box],
        "all kinds": [ri.Shape.mesh(ring.vertices, ring.faces), box, ball, ri.Shape.cylinder(0.04, 0.1), ri.Shape.capsule(0.03, 0.1)],
    }[kind]
    # So few that the exact regime deals with them: sub-steps would let them sink in by a skin.
    run = simulate({"floor": FLOOR} | crowd(shapes, 50, 8, 0.12), duration=0.02)
    kinds = {event.kind for event in run.status.events}
    assert kinds == {"overlap at the start"}
    assert len(run.status.events) > 100
    assert all_apart(run, 1)
    # They do not fly about: a ring is moved farthest, 0.94 m up.
    assert np.abs(run.positions[1] - run.positions[0]).max() < 1.5


def test_links_put_into_each_other_come_apart_and_what_is_in_a_pipe_stays_in_it() -> None:
    from trimesh.creation import annulus, torus

    ring = torus(0.5, 0.15, 24, 12)
    shape = ri.Shape.mesh(ring.vertices, ring.faces)
    turned = {"orientation": (np.sqrt(0.5), np.sqrt(0.5), 0, 0)}
    linked = simulate({"first": {"shape": shape}, "second": {"shape": shape, "position": (0.1, 0, 0)} | turned})
    assert [event.kind for event in linked.status.events] == ["overlap at the start"]
    assert all_apart(linked, 1)
    hollow = annulus(0.5, 0.6, 2.0, sections=32)
    pipe = {"shape": ri.Shape.mesh(hollow.vertices, hollow.faces), "motion": "static"}
    balls = {f"ball{k}": {"shape": ri.Shape.sphere(0.2), "position": place} for k, place in enumerate([(-0.2, 0, 0), (0.0, 0, 0)])}
    inside = simulate({"pipe": pipe} | balls)
    assert [event.bodies for event in inside.status.events] == [("ball0", "ball1")]
    assert all_apart(inside, 1)
    assert np.linalg.norm(inside.positions[1, 1:, :2], axis=1).max() < 0.3


@pytest.mark.parametrize("seed", [9, 10, 11])
def test_the_way_out_of_the_wall_of_a_pipe_does_not_lead_through_its_hole_and_on(seed: int) -> None:
    """A hull was said to be inside by -2e9 m: steps along a way out passed the hole, and doubled behind it."""
    from trimesh.creation import annulus

    hollow, random = annulus(0.5, 0.6, 0.5, sections=32), np.random.default_rng(seed)
    turn, corners = random.normal(size=4), random.normal(size=(12, 3))
    hull = ri.Shape.convex_hull(0.15 * corners / np.linalg.norm(corners, axis=1)[:, None])
    angle, height = random.uniform(0.0, 6.3), random.uniform(-0.1, 0.1)
    place = {"position": (0.4 * np.cos(angle), 0.4 * np.sin(angle), height), "orientation": turn / np.linalg.norm(turn)}
    run = simulate({"pipe": {"shape": ri.Shape.mesh(hollow.vertices, hollow.faces), "motion": "static"}, "hull": {"shape": hull} | place})
    assert 0.0 < depths(run)["pipe", "hull"] < 0.3
    assert [event.kind for event in run.status.events] == ["overlap at the start"]
    assert all_apart(run, 1)


def test_static_bodies_may_overlap_and_touching_is_no_overlap() -> None:
    bodies = {"floor": FLOOR, "post": {"shape": BOX, "motion": "static"}, "box": {"shape": BOX, "position": (0, 0, 1.0)}}
    assert simulate(bodies, G).status.ok
