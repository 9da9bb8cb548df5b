"""Compounds of boxes and hulls in sub-stepped islands: found part by part, they collide like the one body that they are."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.collision.contact_records import CONTACT_MARGIN, SEPARATION
from rigidimpulse.collision.manifold.dispatch import SEVERAL, Posed, pair_gap
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.engine.begin import make_plan, make_run
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.loop import run_to_end
from rigidimpulse.engine.run import Run, start_trajectories
from rigidimpulse.engine.substepped.advance import SubsteppedIslands
from rigidimpulse.engine.substepped.contact_forces import COARSE, ContactStepper
from rigidimpulse.engine.substepped.sharing import Sharing
from rigidimpulse.model.plan import Plan
from rigidimpulse.motion.trajectory import FIXED
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.recorder import Recorder

SUB_STEPPED = ri.Accuracy(contact_solver="substepped")
SMOOTH = ri.Material(density=500, restitution=0, static_friction=0, dynamic_friction=0)
ROUGH = ri.Material(density=500, restitution=0, static_friction=0.5, dynamic_friction=0.5)
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def octants(size: float) -> ri.Shape:
    """A cube of eight cubes."""
    places = itertools.product((-0.25 * size, 0.25 * size), repeat=3)
    return ri.Shape.compound([(ri.Shape.box(0.5 * size), place, UPRIGHT) for place in places])


def stool() -> ri.Shape:
    """A seat on three legs that spread; they are hulls."""
    foot, top = [(x, y, 0.0) for x in (0.0, 0.05) for y in (0.0, 0.05)], [(x, y, 0.4) for x in (0.1, 0.13) for y in (0.1, 0.13)]
    leg = ri.Shape.convex_hull(foot + top)
    turns = [(np.cos(k * np.pi / 3.0), 0.0, 0.0, np.sin(k * np.pi / 3.0)) for k in range(3)]
    return ri.Shape.compound([(ri.Shape.box((0.4, 0.4, 0.05)), (0.0, 0.0, 0.42), UPRIGHT), *((leg, (0, 0, 0), turn) for turn in turns)])


def angle() -> ri.Shape:
    """Two planks that make a right angle."""
    return ri.Shape.compound([(ri.Shape.box((0.5, 0.1, 0.1)), (0.2, 0, 0), UPRIGHT), (ri.Shape.box((0.1, 0.1, 0.5)), (0, 0, 0.3), UPRIGHT)])


def test_a_cube_of_cubes_falls_and_rests_like_a_cube() -> None:
    """Its inner faces meet nothing. Both rest at the contact margin of their own inner radius, 0.8 % of it: below 4e-3 of the size.

    They tumble over edges before that, with margins that differ: they come to lie where the other does to a tenth of the size.
    """
    lying = []
    for shape in (ri.Shape.box(0.4), octants(0.4)):
        scene = ri.Scene()
        scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
        scene.add(ri.Body("cube", shape, position=(0, 0, 0.5), orientation=(1, 0.1, 0.05, 0.3), velocity=(0.5, 0, 0), material=ROUGH))
        run = ri.simulate(scene, 3.0, accuracy=SUB_STEPPED)
        assert run.status.ok, run.status.message
        lying.append(run.positions[-1, run.index("cube")])
        assert np.abs(run.velocities[-1]).max() < 1e-9
        assert run.ledger is not None and np.diff(run.ledger.total).max() < 1e-6 * run.ledger.kinetic.max()
    np.testing.assert_allclose(lying[1][2], 0.2, atol=4e-3 * 0.4)
    np.testing.assert_allclose(lying[1], lying[0], atol=0.1 * 0.4)


def test_seams_of_a_floor_stop_nothing() -> None:
    """A cube slides without friction over the seams of a floor of planks. A contact with the side of a plank would stop it.

    At the start it is raised to the contact margin z, a fifth of the skin of 0.8 mm, and its speed v pays for that: v'^2 = v^2 - 2 g z.
    Then it keeps v' to 1e-4: soft contact may turn the cube a little. The first side would take a third of it.
    """
    floor = ri.Shape.compound([(ri.Shape.box((0.3, 2.0, 0.2)), (0.3 * k, 0, -0.1), UPRIGHT) for k in range(12)])
    scene = ri.Scene()
    scene.add(ri.Body("floor", floor, motion="static", material=SMOOTH))
    scene.add(ri.Body("cube", ri.Shape.box(0.2), position=(0, 0, 0.1), velocity=(1.5, 0, 0), material=SMOOTH))
    run = ri.simulate(scene, 2.0, accuracy=SUB_STEPPED)
    assert run.status.ok, run.status.message
    cube = run.index("cube")
    paid = np.sqrt(1.5**2 - 2.0 * 9.81 * 0.2 * 0.8e-3)
    np.testing.assert_allclose(run.velocities[1:, cube, 0], paid, rtol=1e-4)
    np.testing.assert_allclose(run.positions[-1, cube], (2.0 * paid, 0.0, 0.1), atol=2e-3)


def test_an_arm_rests_between_the_centres_of_two_crosses() -> None:
    """Each corner of the flat where arms lie on each other is in the corner of two parts, of this cross or of the other.

    All four contacts were taken for covered, and the arm sank into the others for good. The gaps at the ends, 0.1 mm, are below IN.
    """
    arms = (0.12, 0.03, 0.03), (0.03, 0.12, 0.03), (0.03, 0.03, 0.12)
    cross = ri.Shape.compound([(ri.Shape.box(arm), (0, 0, 0), UPRIGHT) for arm in arms])
    scene = ri.Scene()
    for side in (-1, 1):
        scene.add(ri.Body(f"support {side}", cross, position=(0.0751 * side, 0, 0), motion="static", material=ROUGH))
    scene.add(ri.Body("cross", cross, position=(0, 0, 0.03), material=ROUGH))
    run = ri.simulate(scene, 1.0, accuracy=SUB_STEPPED)
    assert run.status.ok, run.status.message
    np.testing.assert_allclose(run.positions[-1, run.index("cross")], (0, 0, 0.03), atol=1.5e-4)


@pytest.mark.parametrize("make", [stool, angle, lambda: octants(0.3)], ids=("stool", "angle", "octants"))
def test_furniture_in_a_pile_comes_to_rest_apart(make) -> None:
    """Ten of one kind fall on each other: none is inside another, energy never grows, and all lie still in the end."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
    random = np.random.default_rng(3)
    for k in range(10):
        place, turn = (*random.uniform(-0.1, 0.1, 2), 0.6 + 1.1 * k), random.normal(size=4)
        scene.add(ri.Body(f"{k}", make(), position=place, orientation=turn, material=ROUGH))
    run = ri.simulate(scene, 8.0, accuracy=SUB_STEPPED)
    assert run.status.ok, run.status.message
    assert np.abs(run.velocities[-1]).max() < 0.05
    assert run.positions[-1, :, 2].min() > -1e-3


@pytest.mark.parametrize("seed", range(12))
def test_the_least_gap_of_the_contacts_is_the_distance(seed: int) -> None:
    """Two angles a millimetre apart: the nearest of their contacts is at the distance of their triangles.

    Edges must win over faces by 0.2 % of the inner radius (`manifold.edge_wins`), here 0.05 m: 1e-4 m. A part that is left out is wrong
    by its distance, centimetres.
    """
    random = np.random.default_rng(seed)
    q, way = random.normal(size=(2, 4)), random.normal(size=3)
    way /= np.linalg.norm(way)
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    for k in range(2):
        scene.add(ri.Body(f"{k}", angle(), position=(0, 0, 0), orientation=q[k]))
    world = compile_scene(scene, SUB_STEPPED)
    turns = [to_matrix(world.orientation[k]) for k in range(2)]
    low, high = 0.0, 2.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        posed = Posed(0, np.zeros(3), turns[0]), Posed(0, middle * way, turns[1])
        apart = pair_gap(world.geometry, *posed, 1.0, np.zeros(7))
        low, high = (middle, high) if apart < 1e-3 else (low, middle)
    world.position[1] = world.position[0] + high * way
    stepper = ContactStepper(world, world.dynamic, COARSE)
    stepper.set_up(Run(world, Plan(world, []), Recorder(np.zeros(1), 2), EventLog()), np.arange(2), np.zeros(0, np.int64), 1.0 / 60.0)
    pairs, points = stepper.table.pairs, stepper.table.points
    assert pairs.kind[0] == SEVERAL
    found = points[pairs.start[0] : pairs.start[0] + pairs.count[0]]
    assert len(found)
    np.testing.assert_allclose((found[:, SEPARATION] + found[:, CONTACT_MARGIN]).min(), 1e-3, atol=1e-4)


def test_many_contacts_of_a_pair_are_all_found() -> None:
    """A rake of 100 teeth lies on a floor of 100 planks, on end: 400 contacts of one pair are more than there is memory for at first.

    It stays where it is: its own margin, 0.8 % of the inner radius (a tenth of its reach, 5 m), is 4 mm.
    """
    teeth = [(ri.Shape.box((0.05, 0.05, 0.3)), (0.1 * k - 5.0, 0, -0.2), UPRIGHT) for k in range(100)]
    planks = [(ri.Shape.box((0.09, 1.0, 0.2)), (0.1 * k - 5.0, 0, -0.1), UPRIGHT) for k in range(100)]
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.compound(planks), motion="static", material=ROUGH))
    rake = ri.Shape.compound([(ri.Shape.box((10.0, 0.1, 0.1)), (0, 0, 0), UPRIGHT), *teeth])
    scene.add(ri.Body("rake", rake, position=(0, 0, 0.35), material=ROUGH))
    run = ri.simulate(scene, 0.5, accuracy=SUB_STEPPED)
    assert run.status.ok, run.status.message
    np.testing.assert_allclose(run.positions[-1, run.index("rake")], (0, 0, 0.35), atol=5e-3)


def test_a_body_may_have_more_parts_than_there_is_memory_for_at_first() -> None:
    """A floor of 300 planks: one cube comes before it in the order of the bodies, one after it. They rest at their margin, 1.6 mm."""
    planks = [(ri.Shape.box((0.1, 1.0, 0.2)), (0.1 * k - 15.0, 0, -0.1), UPRIGHT) for k in range(300)]
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.compound(planks), position=(0.0, 0.0, 0.0), motion="static", material=ROUGH))
    for x in (-14.0, 14.0):
        scene.add(ri.Body(f"cube {x}", octants(0.4), position=(x, 0, 0.21), material=ROUGH))
    run = ri.simulate(scene, 0.5, accuracy=SUB_STEPPED)
    assert run.status.ok, run.status.message
    np.testing.assert_allclose(run.positions[-1, 1:], [(-14.0, 0.0, 0.2), (14.0, 0.0, 0.2)], atol=2.5e-3)


def test_smaller_shapes_are_not_made_of_bodies_of_convex_parts() -> None:
    """They stand in for meshes. To make them took a sixth of a run of twelve rings in convex parts, when bodies fell asleep."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
    scene.add(ri.Body("angle", angle(), position=(0, 0, 0.35), material=ROUGH))
    world = compile_scene(scene, SUB_STEPPED)
    run = make_run(world, make_plan(world), Recorder(np.arange(181) / 60.0, 2), EventLog())
    start_trajectories(run)
    run_to_end(run, 3.0, None)
    assert isinstance(run.substepped, SubsteppedIslands)
    assert run.state.trajectory.mode[1] == FIXED
    assert "smaller" not in vars(run.substepped.stepper)


def test_any_number_of_shares_gives_the_same_bits() -> None:
    """Pairs are searched in shares; each has memory of its own."""
    scene = ri.Scene()
    for k in range(40):
        place = (0.35 * (k % 5), 0.35 * (k // 5 % 2), 0.3 + 0.45 * (k // 10))
        scene.add(ri.Body(f"{k}", angle(), position=place, orientation=(1, 0.1 * k, 0.2, 0), velocity=(0, 0, -1)))
    world = compile_scene(scene, SUB_STEPPED)
    outcomes = []
    for shares in (1, 2):
        stepper = ContactStepper(world, world.dynamic, COARSE, Sharing(most_cores=shares, pairs=1))
        run = Run(world, Plan(world, []), Recorder(np.zeros(1), 2), EventLog())
        for _ in range(3):
            stepper.set_up(run, np.arange(40), np.zeros(0, np.int64), 1.0 / 60.0)
            out = stepper.step(run, 0.0, 1.0 / 60.0)
        outcomes.append(np.concatenate([out.position.ravel(), out.velocity.ravel()]))
    assert outcomes[0].tobytes() == outcomes[1].tobytes()
