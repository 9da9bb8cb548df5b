"""A run measures itself: planted faults are found with time, bodies and amount, and sound runs of ordinary scenes show none.

Faults are planted in recorded arrays. The measures are functions of them, so what finds these finds those of a solver, too.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.collision.distance.fcl import Narrowphase
from rigidimpulse.collision.geometry import CompiledShape, build_geometry, compile_shape
from rigidimpulse.core.quaternion import rotate, to_matrix
from rigidimpulse.engine.measure.depth import Posed, Probe, Solid, depth_in, probe_of, solid_of, surely_apart, whole_solid
from rigidimpulse.engine.measure.edges_in_parts import enter_with_edges, parts_of
from rigidimpulse.engine.measure.energy import energy_rise
from rigidimpulse.engine.measure.measure import measured_faults, record_of_recording
from rigidimpulse.engine.measure.overlap import box_pairs
from rigidimpulse.engine.measure.record import RunRecord
from rigidimpulse.recording.ledger import Masses, mechanics
from rigidimpulse.recording.recorder import Frames

BOX = ri.Shape.box((0.2, 0.2, 0.2))
FLOOR = ri.Body("floor", ri.Shape.half_space(), motion="static")


def scene_of(*bodies: ri.Body, gravity: float = -9.81) -> ri.Scene:
    """A scene of these bodies."""
    scene = ri.Scene(gravity=(0.0, 0.0, gravity))
    for body in bodies:
        scene.add(body)
    return scene


def falling_boxes() -> ri.Recording:
    """Three boxes fall, tilted, onto a floor."""
    scene = scene_of(FLOOR)
    for k in range(3):
        scene.add(ri.Body(f"box {k}", BOX, position=(0.05 * k, 0.0, 0.3 + 0.3 * k), angular_velocity=(1.0, 0.5 * k, 0.0)))
    return ri.simulate(scene, 0.6)


def sub_stepped_pile() -> ri.Recording:
    """Four boxes fall on each other and are sub-stepped."""
    scene = scene_of(FLOOR)
    for k in range(4):
        scene.add(ri.Body(f"box {k}", BOX, position=(0.03 * k, 0.0, 0.11 + 0.205 * k)))
    return ri.simulate(scene, 1.0, accuracy=ri.Accuracy(contact_solver="substepped"))


def boxes_dropped_on_boxes(**accuracy) -> ri.Recording:
    """Four boxes fall on each other from 5 cm, at 32 places: scenes of fewer bodies are stepped finely."""
    scene = scene_of(FLOOR)
    for k in range(128):
        scene.add(ri.Body(f"box {k}", BOX, position=(0.03 * (k % 4), 1.0 * (k // 4), 0.11 + 0.25 * (k % 4))))
    return ri.simulate(scene, 1.0, accuracy=ri.Accuracy(**accuracy))


def pendulum() -> ri.Recording:
    """A box swings on a hinge."""
    scene = scene_of(ri.Body("bob", BOX, position=(0.5, 0.0, 0.0)))
    scene.add(ri.HingeJoint(None, "bob", anchor=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0)))
    return ri.simulate(scene, 1.0)


def motor() -> ri.Recording:
    """A motor turns a box up."""
    scene = scene_of(ri.Body("arm", BOX, position=(0.3, 0.0, 0.0), mass=1.0))
    drive = ri.Motor(velocity=4.0, damping=50.0)
    scene.add(ri.HingeJoint(None, "arm", anchor=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0), motor=drive))
    return ri.simulate(scene, 0.5)


def moving_platform() -> ri.Recording:
    """A platform that moves up carries a box."""
    scene = scene_of(FLOOR)
    keys = ri.Keyframes((0.0, 1.0), ((0.0, 0.0, 0.5), (0.5, 0.0, 1.5)))
    scene.add(ri.Body("platform", ri.Shape.box((1.0, 1.0, 0.1)), motion="kinematic", position=(0.0, 0.0, 0.5), keyframes=keys))
    scene.add(ri.Body("box", BOX, position=(0.0, 0.0, 0.7)))
    return ri.simulate(scene, 1.2)


def carried_boxes(**accuracy) -> ri.Recording:
    """Boxes fall on a floor that moves with a steady velocity, up and to the side, and rub on it."""
    scene = scene_of(ri.Body("floor", ri.Shape.half_space(), motion="kinematic", velocity=(0.8, 0.0, 0.5)))
    for k in range(3):
        scene.add(ri.Body(f"box {k}", BOX, position=(0.05 * k, 0.0, 0.5 + 0.3 * k), angular_velocity=(1.0, 0.5 * k, 0.0)))
    return ri.simulate(scene, 0.6, accuracy=ri.Accuracy(**accuracy))


def spring() -> ri.Recording:
    """A spring throws a box up."""
    scene = scene_of(ri.Body("bob", BOX, position=(0.0, 0.0, 1.0), mass=1.0))
    scene.add(ri.Spring(None, "bob", (0.0, 0.0, 2.0), (0.0, 0.0, 1.1), stiffness=100.0, rest_length=0.3))
    return ri.simulate(scene, 1.0)


def collision_in_space() -> ri.Recording:
    """Two boxes meet without gravity, off centre and rough; a third one is far away."""
    moving = ri.Body("a", BOX, velocity=(1.0, 0.0, 0.0), angular_velocity=(0.3, 0.2, 1.0))
    hit = ri.Body("b", BOX, position=(0.6, 0.08, 0.05), mass=5.0)
    far = ri.Body("c", BOX, position=(0.0, 5.0, 0.0), angular_velocity=(1.0, 2.0, 3.0))
    return ri.simulate(scene_of(moving, hit, far, gravity=0.0), 1.0)


def one_ball_without_spin() -> ri.Recording:
    """A ball flies alone: its angular momentum about its centre is round-off, and so is all that it is compared with."""
    place, velocity = (0.0, 0.5286447460381469, 0.7929671190572204), (0.05341491584292473, -0.7192520293909543, -0.5544959907061975)
    scene = ri.Scene(gravity=(1.7, -2.5, -9.0))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.046), position=place, velocity=velocity, mass=5.475242303717654))
    return ri.simulate(scene, 1.0)


def two_boxes_that_touch_in_space() -> ri.Recording:
    """Nothing moves: energy and momentum are round-off."""
    return ri.simulate(scene_of(ri.Body("a", BOX), ri.Body("b", BOX, position=(0.2 - 1e-8, 0.01, 0.0), mass=0.3), gravity=0.0), 1.0)


SOUND = (
    falling_boxes, sub_stepped_pile, pendulum, motor, moving_platform, carried_boxes, spring, collision_in_space, one_ball_without_spin,
    two_boxes_that_touch_in_space,
)  # fmt: skip


def test_what_rises_out_of_deep_overlaps_is_reported_and_the_remedies_help() -> None:
    """In steps of 1/60 s boxes at 2 m/s go 16 mm into each other and rise out of that: 2 % of the energy, which no speed pays."""
    coarse = boxes_dropped_on_boxes(contact_solver="substepped")
    assert {event.kind for event in coarse.status.problems} == {"energy made"}
    assert boxes_dropped_on_boxes(contact_solver="substepped", step=1.0 / 240.0).status.ok
    assert boxes_dropped_on_boxes(contact_solver="newton").status.ok


@pytest.mark.parametrize("make", SOUND, ids=lambda make: make.__name__)
def test_a_sound_run_shows_nothing(make) -> None:
    run = make()
    assert run.status.ok, run.status.message
    assert measured_faults(recorded(run)) == []


def recorded(run: ri.Recording, **altered: np.ndarray) -> RunRecord:
    """The record of a run with some arrays altered: position, velocity, angular_velocity. The ledger follows, except its causes."""
    record = record_of_recording(run)
    frames, ledger = record.frames._replace(**altered), record.ledger
    before, after = (_mechanical(record.world, one) for one in (record.frames, frames))
    kinetic, potential = (old + new - was for old, new, was in zip((ledger.kinetic, ledger.potential), after, before, strict=True))
    return replace(record, frames=frames, ledger=replace(ledger, kinetic=kinetic, potential=potential))


def _mechanical(world, frames: Frames) -> tuple[np.ndarray, np.ndarray]:
    masses = Masses(np.where(world.dynamic, world.mass, 0.0), world.inertia, world.steady_acceleration)
    kinetic, potential, _, _ = mechanics(frames, masses, np.ones((1, 1)))
    return kinetic.sum(1), potential.sum(1)


@pytest.mark.parametrize("make", [falling_boxes, pendulum, motor, spring, collision_in_space], ids=lambda make: make.__name__)
def test_faster_bodies_are_energy_made(make) -> None:
    """All speeds are 1 % larger from the fastest frame on: 2 % of the kinetic energy of that instant appears."""
    run = make()
    frame = 1 + int(np.argmax(run.ledger.kinetic[1:-1]))
    faster = np.ones(len(run.times))
    faster[frame:] = 1.01
    record = recorded(run, velocity=run.velocities * faster[:, None, None], angular_velocity=run.angular_velocities * faster[:, None, None])
    fault = next(fault for fault in measured_faults(record) if fault.kind == "energy made")
    kinetic = run.ledger.kinetic[frame]
    assert fault.time == run.times[frame] and fault.bodies
    assert 0.5 * 0.0201 * kinetic < fault.amount < 0.0202 * run.ledger.kinetic.max()


@pytest.mark.parametrize("solver", ["newton", "substepped"])
def test_steady_supports_hide_no_energy(solver: str) -> None:
    """A floor that moves gives energy, by friction too, but none as seen from it: a kick to the side of 2 m/s is found there: 16 J.

    Before, everything that the floor may have given was left out; a jointed island gained a twentieth of the energy and the run said ok.
    """
    run = carried_boxes(contact_solver=solver)
    assert run.status.ok, run.status.message
    assert run.ledger is not None and np.ptp(run.ledger.total) > 1.0
    velocity = run.velocities.copy()
    velocity[20:, run.index("box 1"), 1] += 2.0
    fault = next(fault for fault in measured_faults(recorded(run, velocity=velocity)) if fault.kind == "energy made")
    assert fault.time >= run.times[20]


def test_energy_of_nothing_names_the_body_that_got_it() -> None:
    run = falling_boxes()
    velocity = run.velocities.copy()
    velocity[20:, run.index("box 1"), 0] += 1.0
    fault = next(fault for fault in measured_faults(recorded(run, velocity=velocity)) if fault.kind == "energy made")
    assert fault.time == run.times[20] and fault.bodies[0] == "box 1"


@pytest.mark.parametrize("fps", [480.0, 110.0, 60.0, 1000.0 / 41.0])
def test_frames_inside_sub_stepped_steps_hide_no_energy_and_make_none(fps: float) -> None:
    """Bodies that rebound are slow in the middle of a step: at 480 fps, 73 of 250 sound runs said that up to 5 % were made of nothing.

    Kicks that give 2 % of the energy from a frame on are found at all rates.
    """
    for seed in range(4):
        run = _boards_that_hit(seed, fps)
        assert run.status.ok, run.status.message
        frame = 2 * len(run.times) // 3
        faster = np.where(np.arange(len(run.times)) >= frame, 1.01, 1.0)[:, None, None]
        record = recorded(run, velocity=run.velocities * faster, angular_velocity=run.angular_velocities * faster)
        fault = next(fault for fault in measured_faults(record) if fault.kind == "energy made")
        assert run.times[frame] <= fault.time <= run.times[frame] + 2.0 / min(fps, 60.0)
        assert fault.amount > 0.005 * run.ledger.kinetic[-1]


def _boards_that_hit(seed: int, fps: float) -> ri.Recording:
    """Two boards that turn meet in space, and rebound as sub-stepped bodies."""
    random = np.random.default_rng(seed)
    scene, shape = ri.Scene(gravity=(0, 0, 0)), ri.Shape.box((0.2, 0.12, 0.03))
    for name, place, speed in (("a", (0, 0, 0), 0.0), ("b", (0.24, 0.02, 0.01), -2.0)):
        turn, spin = random.normal(size=4), random.normal(0.0, 5.0, 3)
        material = ri.Material(restitution=0.3)
        scene.add(ri.Body(name, shape, position=place, orientation=turn, velocity=(speed, 0, 0), angular_velocity=spin, material=material))
    return ri.simulate(scene, 0.5, accuracy=ri.Accuracy(contact_solver="substepped"), fps=fps)


@pytest.mark.parametrize(("part", "raised", "is_said"), [(0.04, 0.0, False), (0.06, 0.0, True), (0.06, 0.02, False)])
def test_energy_that_a_run_took_back_is_said(part: float, raised: float, is_said: bool) -> None:
    """A twentieth of the energy that moves is the bound; it was taken in one frame, and box 2 loses most there.

    What bodies pay for being raised out of each other does not count.
    """
    run = falling_boxes()
    record = record_of_recording(run)
    _, moved = energy_rise(record)
    then = np.where(np.arange(len(run.times)) >= 20, moved, 0.0)
    given = {"energy correction": part * then, "position correction": -raised * then}
    velocity = run.velocities.copy()
    velocity[20:, run.index("box 2")] *= 0.5
    record = recorded(run, velocity=velocity)
    record = replace(record, ledger=replace(record.ledger, dissipated=record.ledger.dissipated | given))
    faults = [fault for fault in measured_faults(record) if fault.kind == "energy taken"]
    assert len(faults) == is_said
    if is_said:
        assert faults[0].time == run.times[20] and faults[0].bodies[0] == "box 2"
        assert faults[0].amount == pytest.approx(part * moved)


@pytest.mark.parametrize(("what", "kick"), [("velocity", (1e-4, 0.0, 0.0)), ("angular_velocity", (0.0, 0.0, 1e-2))])
def test_a_kick_is_momentum_that_is_not_kept(what: str, kick: tuple[float, float, float]) -> None:
    """The kick is a ten-thousandth of the speed of the bodies: far too small to be seen in the energy."""
    run = collision_in_space()
    state = {"velocity": run.velocities, "angular_velocity": run.angular_velocities}[what].copy()
    state[25:, run.index("b")] += kick
    faults = measured_faults(recorded(run, **{what: state}))
    assert [fault.kind for fault in faults if fault.kind != "energy made"] == ["momentum not kept"]
    fault = next(fault for fault in faults if fault.kind == "momentum not kept")
    assert fault.time == run.times[25] and fault.bodies == ("a", "b")
    assert 1e-5 < fault.amount < 1.0
    assert "joint" not in fault.message


@pytest.mark.parametrize("is_driven", [False, True])
def test_a_kick_to_a_chain_names_a_remedy_that_there_is(is_driven: bool) -> None:
    """Limits are for joints with motors; of others they change nothing."""
    scene = ri.Scene(gravity=(0, 0, 0))
    for k, name in enumerate("ab"):
        scene.add(ri.Body(name, ri.Shape.box((0.2, 0.1, 0.1)), position=(0.25 * k, 0, 0)))
    motor = ri.Motor(1.0, damping=0.01) if is_driven else None
    scene.add(ri.HingeJoint("a", "b", (0.125, 0, 0), (0, 1, 0), motor=motor))
    run = ri.simulate(scene, 0.5)
    velocity = run.velocities.copy()
    velocity[25:, run.index("b"), 0] += 1e-3
    fault = next(fault for fault in measured_faults(recorded(run, velocity=velocity)) if fault.kind == "momentum not kept")
    assert ("motors" in fault.message) == is_driven and ("smaller step" in fault.message) != is_driven


@pytest.mark.parametrize("make", [falling_boxes, sub_stepped_pile], ids=lambda make: make.__name__)
def test_a_body_moved_into_another_is_inside_it(make) -> None:
    """For one of the frames that are looked at, box 1 stands 38 % of its size inside box 0, face to face."""
    run = make()
    frame = int(np.unique(np.linspace(0, len(run.times) - 1, 24).astype(int))[10])
    a, b = run.index("box 0"), run.index("box 1")
    position = run.centers.copy()
    inside = 0.2 * (1.0 - 0.38)
    axis = axis_of(run, a, frame)
    position[frame, b] = position[frame, a] + inside * axis
    faults = [f for f in measured_faults(recorded(run, position=position)) if f.bodies == ("box 0", "box 1") and f.kind != "energy made"]
    assert [fault.kind for fault in faults] == ["bodies inside each other"]
    assert faults[0].time == run.times[frame]
    assert 0.2 * 0.19 < faults[0].amount < 0.2 * 0.6


@pytest.mark.parametrize("frame", range(1, 61))
def test_every_frame_of_few_sub_stepped_bodies_is_looked_at(frame: int) -> None:
    """A box that is crushed for one frame: 4 of 10,000 random scenes had that between the frames looked at, and said ok (issue 27)."""
    run = _pile_of_four()
    a, b = run.index("box 0"), run.index("box 1")
    position = run.centers.copy()
    position[frame, b] = position[frame, a] + 0.2 * (1.0 - 0.013) * axis_of(run, a, frame)
    faults = [f for f in measured_faults(recorded(run, position=position)) if f.bodies == ("box 0", "box 1") and f.kind != "energy made"]
    assert [(fault.kind, fault.time) for fault in faults] == [("bodies inside each other", run.times[frame])]


@cache
def _pile_of_four() -> ri.Recording:
    return sub_stepped_pile()


def axis_of(run: ri.Recording, body: int, frame: int) -> np.ndarray:
    """The x axis (3,) of a body."""
    return rotate(run.orientations[frame, body], np.array([1.0, 0.0, 0.0]))


def test_an_overlap_that_the_scene_begins_with_is_reported_once() -> None:
    """The engine says that the boxes were drawn inside each other; the measures do not say so again."""
    run = ri.simulate(scene_of(ri.Body("a", BOX), ri.Body("b", BOX, position=(0.15, 0.0, 0.0)), gravity=0.0), 0.5)
    assert [event.kind for event in run.status.problems] == ["overlap at the start"]


SHAPES = {
    "box": ri.Shape.box((0.2, 0.3, 0.4)),
    "hull": ri.Shape.convex_hull(0.2 * np.random.default_rng(3).normal(size=(20, 3))),
    "sphere": ri.Shape.sphere(0.15),
    "capsule": ri.Shape.capsule(0.1, 0.4),
    "cylinder": ri.Shape.cylinder(0.15, 0.3),
    "half space": ri.Shape.half_space(),
}


def probe(shape: CompiledShape) -> Probe:
    """What of a shape may enter another one."""
    return probe_of(shape)


def solid(shape: CompiledShape) -> Solid:
    """What of a shape may be entered."""
    return whole_solid(solid_of(shape), shape, build_geometry([shape]), 0)


@pytest.mark.parametrize("other", SHAPES)
@pytest.mark.parametrize("mine", [name for name in SHAPES if name != "half space"])
def test_depths_are_lower_bounds(mine: str, other: str) -> None:
    """Bodies at random poses. Where FCL says that they are apart the depth is 0; where they are deep inside each other it is not."""
    rng = np.random.default_rng(7)
    shapes = [compile_shape(SHAPES[name], np.zeros(3), np.eye(3)) for name in (mine, other)]
    probes, solids, exact = [probe(shape) for shape in shapes], [solid(shape) for shape in shapes], Narrowphase(shapes)
    found = 0
    for _ in range(150):
        x, q = rng.normal(size=3) * 0.2, rng.normal(size=4)
        q /= np.linalg.norm(q)
        rotation = to_matrix(q)
        there, back = Posed(rotation[None], x[None]), Posed(rotation.T[None], -(rotation.T @ x)[None])
        depth = depth_in(solids[1], probes[0], there)[0]
        depth = max(depth, depth_in(solids[0], probes[1], back)[0] if other != "half space" else 0.0)
        still = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
        apart = exact.separation(1, still, 0, (x, q))
        if apart.gap > 0.0:
            assert depth <= 1e-6
            continue
        assert not surely_apart(probes[0].corners[None], solids[1].bounds[None], there)[0] or apart.gap > -1e-9
        if np.all(np.isfinite(apart.normal)) and "cylinder" not in (mine, other):
            # Closed forms: of balls, and of half spaces.
            assert depth <= -apart.gap * (1.0 + 1e-9) + 1e-12
        # No way out along any axis of the world by 6 cm: deep.
        ways = 0.06 * np.vstack([np.eye(3), -np.eye(3)])
        if all(exact.overlap(1, still, 0, (x + way, q)) for way in ways):
            found += 1
            assert depth > 0.005
    assert found > 5


@pytest.mark.parametrize("seed", range(8))
def test_the_depth_of_an_edge_is_at_least_half_of_its_largest_one(seed: int) -> None:
    """Along an edge the depth in a convex part is concave: looked at in a thousand places, it is nowhere more than twice what is found."""
    rng = np.random.default_rng(seed)
    parts, boxes = [], []
    for _ in range(3):
        corners = rng.normal(size=(12, 3)) + rng.normal(size=3)
        hull = trimesh.convex.convex_hull(corners)
        normals = np.asarray(hull.face_normals)
        parts.append(np.column_stack([normals, np.einsum("ij,ij->i", normals, hull.triangles[:, 0])]))
        boxes.append(np.array([hull.vertices.min(axis=0), hull.vertices.max(axis=0)]))
    edges, places = 2.0 * rng.normal(size=(40, 2, 3)), np.linspace(0.0, 1.0, 1001)[:, None]
    entered = 0
    for edge in edges:
        found = np.zeros(1)
        enter_with_edges(parts_of(parts, boxes), edge[None], np.eye(3)[None], np.zeros((1, 3)), found)
        points = edge[0] + places * (edge[1] - edge[0])
        largest = max(0.0, *(float((planes[:, 3] - points @ planes[:, :3].T).min(axis=1).max()) for planes in parts))
        # Between two places the depth grows by a thousandth of the length of the edge at most.
        assert 0.5 * largest <= found[0] <= largest + 1e-3 * float(np.linalg.norm(edge[1] - edge[0]))
        entered += largest > 0.0
    assert entered > 10


def test_rods_that_cross_are_inside_each_other() -> None:
    """Two long boxes cross: no corner of one is in the other, only edges are."""

    rod = compile_shape(ri.Shape.box((2.0, 0.02, 0.02)), np.zeros(3), np.eye(3))
    turned = Posed(np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]), np.array([[0.31, 0.17, 0.015]]))
    assert depth_in(solid(rod), probe(rod), turned)[0] == pytest.approx(0.005)


def test_a_point_in_a_tube_is_in_the_air() -> None:
    """A surface with a hole is entered in its walls only."""

    tube = trimesh.creation.annulus(0.5, 0.7, 1.0)
    shape = compile_shape(ri.Shape.mesh(tube.vertices, tube.faces), np.zeros(3), np.eye(3))
    ball = probe(compile_shape(ri.Shape.sphere(1e-3), np.zeros(3), np.eye(3)))
    places = np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [0.8, 0.0, 0.0]])
    depth = depth_in(solid(shape), ball, Posed(np.tile(np.eye(3), (3, 1, 1)), places))
    assert depth[0] == depth[2] == 0.0 and 0.09 < depth[1] < 0.102


@pytest.mark.parametrize("number", [10, 60])
def test_boxes_that_overlap_are_all_found(number: int) -> None:
    rng = np.random.default_rng(1)
    low = rng.normal(size=(3, number, 3))
    high = low + rng.uniform(0.0, 1.0, size=low.shape)
    low[:, 7], high[:, 7] = -np.inf, np.inf
    every = [(f, i, j) for f in range(3) for i in range(number) for j in range(i + 1, number)]
    expected = [(f, i, j) for f, i, j in every if np.all((low[f, i] <= high[f, j]) & (low[f, j] <= high[f, i]))]
    assert list(zip(*(side.tolist() for side in box_pairs(low, high)), strict=True)) == expected
