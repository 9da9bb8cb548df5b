"""Energies of layouts: their gradients, and the minima that closed forms tell.

Laws. A gradient is the derivative of its value: central differences with a step of 1e-6 leave 1e-12 of the third derivative and 1e-10 of
rounding, so 1e-8 relative is asked; a wrong factor or a left-out rotation shows as 1e-1. Internal energies neither push nor turn free
bodies as a whole: force and torque sum to 0. Exact pins close to 1e-12 of the size. Chains of n rods of mass m and length l hang as static
equilibrium says: straight down, rod i of soft pins lower by sum of (n - j) m g / k; between two hooks at equal height rod i rises by tan
t_i = (i - (n + 1) / 2) m g / H, where H follows from the span, sum of l cos t_i. The best common motion of bodies is Kabsch's, here by
scipy on six points for each body. Bodies that overlap by s: balls k s^2 / 4, boxes face to face 8 k (s / 2)^2 / 2; n corners sink under F
by F / (n k). Poses at a minimum of curvature c are exact to the rounding of forces over c: bounds 1e-9.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import rigidimpulse as ri
from rigidimpulse.collision.distance.fcl import Narrowphase
from rigidimpulse.core.quaternion import angle_between, multiply, quaternion_from_rotation_vector, rotate
from rigidimpulse.dynamics.forces.energy.layout import compile_energies, expanded
from rigidimpulse.dynamics.forces.energy.term import poses

G = 9.81
SHAPES = {
    "box": ri.Shape.box((0.5, 0.7, 0.9)),
    "ball": ri.Shape.sphere(0.4),
    "capsule": ri.Shape.capsule(0.2, 0.6),
    "cylinder": ri.Shape.cylinder(0.3, 0.8),
    "compound": ri.Shape.compound([(ri.Shape.box(0.5), (0, 0, 0), (1, 0, 0, 0)), (ri.Shape.sphere(0.3), (0.4, 0.1, 0), (1, 0, 0, 0))]),
}
NAMES = list(SHAPES)


def disorder(seed: int = 0, order: tuple[int, ...] = (0, 1, 2, 3, 4)) -> ri.Scene:
    """Bodies of all kinds inside each other, a floor and a static box."""
    random = np.random.default_rng(seed)
    places = [(random.normal(0.0, 0.35, 3) + (0, 0, 0.3), random.normal(size=4)) for _ in SHAPES]
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("block", ri.Shape.box(1.0), motion="static", position=(0.3, 0, 0)))
    for k in order:
        position, orientation = places[k]
        scene.add(ri.Body(NAMES[k], SHAPES[NAMES[k]], position=position, orientation=orientation, mass=1.0 + k))
    return scene


PLACE = (0.4, 0.2, 0.3)
TERMS = {
    "pin": ri.PinPoints("box", "ball", (0, 1, 0), (1, 0, 0), 3.0),
    "pin to the world": ri.PinPoints(None, "ball", (0, 1, 0), (1, 0, 0), 3.0),
    "shape": ri.RestoreShape(["box", "capsule", "cylinder"], 2.0, positions=[(0, 0, 0), (1, 0, 0), (0, 1, 2)]),
    "heights": ri.GravityPotential(),
    "surface of a box": ri.PointOnSurface("ball", "box", PLACE),
    "surface of a ball": ri.PointOnSurface("box", "ball", PLACE),
    "surface of a capsule": ri.PointOnSurface("box", "capsule", PLACE),
    "surface of a cylinder": ri.PointOnSurface("box", "cylinder", PLACE),
    "surface of a half space": ri.PointOnSurface("box", "floor", PLACE),
    "no overlap": ri.NoOverlap(2.0),
    "no overlap, gap": ri.NoOverlap(gap=0.05, bodies=["box", "ball", "cylinder"]),
}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", TERMS)
def test_the_gradient_is_the_derivative_of_the_value(name: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    world = ri.compile_scene(disorder(seed))
    compiled = compile_energies(world, [TERMS[name]])
    turn = quaternion_from_rotation_vector(random.normal(0.0, 0.3, (world.num_bodies, 3)))
    x, q = world.position + random.normal(0.0, 0.02, world.position.shape), multiply(turn, world.orientation)

    def value(step: np.ndarray) -> float:
        return expanded(compiled, poses(x + step[:, :3], multiply(quaternion_from_rotation_vector(step[:, 3:]), q))).value

    total = expanded(compiled, poses(x, q))
    assert total.value != 0.0
    numeric = np.zeros_like(total.gradient)
    for i in np.flatnonzero(world.dynamic):
        for k in range(6):
            step = np.zeros_like(numeric)
            step[i, k] = 1e-6
            numeric[i, k] = (value(step) - value(-step)) / 2e-6
    found = np.where(world.dynamic[:, None], total.gradient, 0.0)
    np.testing.assert_allclose(found, numeric, rtol=0, atol=1e-8 * np.abs(numeric).max())


@pytest.mark.parametrize("name", ["pin", "shape", "surface of a cylinder", "no overlap, gap"])
def test_bodies_do_not_push_themselves(name: str) -> None:
    world = ri.compile_scene(disorder())
    gradient = expanded(compile_energies(world, [TERMS[name]]), poses(world.position, world.orientation)).gradient
    force, torque = gradient[:, :3], gradient[:, 3:]
    size = np.abs(gradient).max()
    assert size > 0.01
    np.testing.assert_allclose(force.sum(0), 0.0, atol=1e-13 * size)
    np.testing.assert_allclose((torque + np.cross(world.position, force)).sum(0), 0.0, atol=1e-13 * size)


def point(scene: ri.Scene, settled: ri.Scene, name: str, anchor: tuple[float, float, float]) -> np.ndarray:
    """Where a point of a body went."""
    before, after = scene[name], settled[name]
    local = rotate(before.unit_orientation() * (1, -1, -1, -1), np.asarray(anchor) - np.asarray(before.position))
    return np.asarray(after.position) + rotate(after.unit_orientation(), local)


@pytest.mark.parametrize("weight", [1e-3, 1.0, np.inf])
def test_pinned_points_of_free_bodies_meet(weight: float) -> None:
    scene = disorder()
    ends = [("box", "ball", (0, 1, 0), (1, 0, 0)), ("ball", "capsule", (1, 2, 0), (0, 0, 2)), (None, "capsule", (3, 3, 3), (0, 0, 0))]
    settled, report = ri.settle(scene, [ri.PinPoints(*end, weight) for end in ends])
    assert report.ok, report.message
    for a, b, on_a, on_b in ends:
        p = np.asarray(on_a) if a is None else point(scene, settled, a, on_a)
        np.testing.assert_allclose(p, point(scene, settled, b, on_b), rtol=0, atol=1e-9)


ROD, MASS = 0.4, 0.7


def chain(prefix: str, joints: np.ndarray, weight: float) -> tuple[list[ri.Body], list[ri.PinPoints]]:
    """Rods between joints (n + 1, 3), which need not be as far apart as the rods are long, pinned end to end and the first to the world."""
    rod, bodies, pins = ri.Shape.box((ROD, 0.02, 0.02)), [], []
    last, end = None, joints[0]
    for i, (a, b) in enumerate(pairwise(joints)):
        along = (b - a) / np.linalg.norm(b - a)
        turn = Rotation.align_vectors([along], [[1, 0, 0]])[0].as_quat(scalar_first=True)
        middle, name = 0.5 * (a + b), f"{prefix}{i}"
        bodies.append(ri.Body(name, rod, position=middle, orientation=turn, mass=MASS))
        pins.append(ri.PinPoints(last, name, end, middle - 0.5 * ROD * along, weight))
        last, end = name, middle + 0.5 * ROD * along
    return bodies, pins


@pytest.mark.parametrize("weight", [300.0, 1e6, np.inf])
@pytest.mark.parametrize("start", ["bent", "on its head"])
def test_a_chain_hangs_straight_down(weight: float, start: str) -> None:
    """On its head the gradient vanishes, too: only the second derivatives tell that this is no minimum."""
    number = 5
    joints = np.outer(np.arange(number + 1), (0, 0, ROD))
    if start == "bent":
        joints = joints + np.random.default_rng(3).normal(0.0, 0.2, joints.shape) * np.arange(number + 1)[:, None]
    bodies, pins = chain("rod", joints, weight)
    settled, report = ri.settle(ri.Scene((0, 0, -G), bodies), [*pins, ri.GravityPotential()])
    assert report.ok, report.message
    sunk = np.cumsum(MASS * G / weight * (number - np.arange(number)))
    expected = joints[0] - np.outer(ROD * (np.arange(number) + 0.5) + sunk, (0, 0, 1))
    np.testing.assert_allclose([body.position for body in settled.bodies], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("number", "span"), [(2, 0.5), (7, 2.0), (12, 1.1)])
def test_a_chain_hangs_between_two_hooks(number: int, span: float) -> None:
    random = np.random.default_rng(number)
    joints = np.linspace((0, 0, 0), (span, 0, 0), number + 1)
    joints[1:-1] += random.normal(0.0, 0.1, (number - 1, 3))
    bodies, pins = chain("rod", joints, np.inf)
    last = bodies[-1]
    tip = np.asarray(last.position) + rotate(last.unit_orientation(), np.array([0.5 * ROD, 0, 0]))
    pins.append(ri.PinPoints(None, last.name, (span, 0, 0), tip))
    settled, report = ri.settle(ri.Scene((0, 0, -G), bodies), [*pins, ri.GravityPotential()])
    assert report.ok, report.message

    def tilts(pull: float) -> np.ndarray:
        return np.arctan((np.arange(1, number + 1) - 0.5 * (number + 1)) * MASS * G / pull)

    pull = brentq(lambda pull: ROD * np.cos(tilts(pull)).sum() - span, 1e-3, 1e4, xtol=1e-15, rtol=1e-15)
    rods = ROD * np.stack([np.cos(tilts(pull)), np.zeros(number), np.sin(tilts(pull))], axis=1)
    middle = np.cumsum(rods, axis=0) - 0.5 * rods
    np.testing.assert_allclose([body.position for body in settled.bodies], middle, rtol=0, atol=1e-9)
    np.testing.assert_allclose(report.value, MASS * G * middle[:, 2].sum(), rtol=1e-12)


def four_bodies(random: np.random.Generator, motions: str) -> tuple[list[ri.Body], np.ndarray, np.ndarray]:
    """Four bodies in disorder, and the layout wanted."""
    x, q = random.normal(0.0, 1.0, (4, 3)), random.normal(size=(4, 4))
    bodies = [
        ri.Body(
            f"b{k}", SHAPES[NAMES[k]], position=random.normal(0.0, 1.0, 3), orientation=random.normal(size=4),
            motion="dynamic" if m == "d" else "static",
        )
        for k, m in enumerate(motions)
    ]  # fmt: skip
    return bodies, x, q / np.linalg.norm(q, axis=1)[:, None]


def kabsch(bodies: list[ri.Body], world, x: np.ndarray, q: np.ndarray) -> tuple[Rotation, np.ndarray, float]:
    """Rotation, shift and sum of mean squares of the best motion of a layout onto bodies, by six points on the sphere around each."""
    there, here = [], []
    for k, body in enumerate(bodies):
        i = world.names.index(body.name)
        spikes = world.bound_radius[i] * np.vstack([np.eye(3), -np.eye(3)]) + world.offset[i]
        there.append(x[k] + rotate(q[k], spikes))
        here.append(np.asarray(body.position) + rotate(body.unit_orientation(), spikes))
    a, b = np.concatenate(there), np.concatenate(here)
    rotation, _ = Rotation.align_vectors(b - b.mean(0), a - a.mean(0))
    left = rotation.apply(a - a.mean(0)) - (b - b.mean(0))  # what align_vectors says is off by the round-off of a difference of squares
    return rotation, b.mean(0) - rotation.apply(a.mean(0)), float(np.sum(left**2)) / 6.0


def test_shape_matching_has_the_value_of_kabsch() -> None:
    for seed in range(5):
        bodies, x, q = four_bodies(np.random.default_rng(seed), "dddd")
        world = ri.compile_scene(ri.Scene(bodies=bodies))
        term = ri.RestoreShape([body.name for body in bodies], 3.0, x, q)
        value = expanded(compile_energies(world, [term]), poses(world.position, world.orientation)).value
        np.testing.assert_allclose(value, 1.5 * kabsch(bodies, world, x, q)[2], rtol=1e-12)


def test_shape_matching_restores_a_layout_and_leaves_a_moved_one_alone() -> None:
    bodies, x, q = four_bodies(np.random.default_rng(1), "dddd")
    names = [body.name for body in bodies]
    settled, report = ri.settle(ri.Scene(bodies=bodies), [ri.RestoreShape(names, 2.0, x, q)])
    assert report.ok and report.value < 1e-20, report
    rotation, shift, left = kabsch(list(settled.bodies), ri.compile_scene(settled), x, q)
    assert left < 1e-20
    np.testing.assert_allclose([body.position for body in settled.bodies], rotation.apply(x) + shift, rtol=0, atol=1e-9)
    again, report = ri.settle(settled, [ri.RestoreShape(names, 2.0, x, q)])
    np.testing.assert_allclose([b.position for b in again.bodies], [b.position for b in settled.bodies], rtol=0, atol=1e-10)


def test_a_free_body_joins_the_layout_of_fixed_ones_where_kabsch_says() -> None:
    """Its own square can be 0, so the common motion is the best one of the three that do not move."""
    bodies, x, q = four_bodies(np.random.default_rng(2), "sssd")
    settled, report = ri.settle(ri.Scene(bodies=bodies), [ri.RestoreShape([body.name for body in bodies], 2.0, x, q)])
    assert report.ok, report.message
    rotation, shift, left = kabsch(bodies[:3], ri.compile_scene(settled), x[:3], q[:3])
    assert left > 0.1
    free = settled["b3"]
    np.testing.assert_allclose(free.position, rotation.apply(x[3]) + shift, rtol=0, atol=1e-9)
    turned = multiply(rotation.as_quat(scalar_first=True), q[3])
    assert angle_between(free.unit_orientation(), turned) < 1e-9


def overlapping(scene: ri.Scene) -> list[tuple[str, str]]:
    """Pairs that have a point in common, asked of FCL."""
    world = ri.compile_scene(scene)
    narrow = Narrowphase(world.shapes)
    pose = [(int(world.shape_of_body[i]), (world.position[i], world.orientation[i])) for i in range(world.num_bodies)]
    pairs = [(a, b) for b in range(len(pose)) for a in range(b) if world.dynamic[a] or world.dynamic[b]]
    return [(world.names[a], world.names[b]) for a, b in pairs if narrow.overlap(*pose[a], *pose[b])]


@pytest.mark.parametrize("seed", range(6))
def test_bodies_inside_each_other_come_apart(seed: int) -> None:
    scene = disorder(seed)
    assert len(overlapping(scene)) > 2
    settled, report = ri.settle(scene, [ri.NoOverlap(gap=1e-3)])
    assert report.ok and report.value < 1e-12, report
    assert not overlapping(settled)


def test_depths_of_balls_and_boxes() -> None:
    for shape, size, factor in ((ri.Shape.sphere(0.5), 1.0, 0.25), (ri.Shape.box(1.0), 1.0, 1.0)):
        scene = ri.Scene(bodies=[ri.Body("a", shape), ri.Body("b", shape, position=(size - 0.1, 0.0, 0.0))])
        world = ri.compile_scene(scene)
        at = poses(world.position, world.orientation)
        total = expanded(compile_energies(world, [ri.NoOverlap(3.0)]), at)
        np.testing.assert_allclose(total.value, 3.0 * factor * 0.1**2, rtol=1e-12)
        np.testing.assert_allclose(total.gradient[1], [-6.0 * factor * 0.1, 0, 0, 0, 0, 0], rtol=0, atol=1e-12)
        apart = expanded(compile_energies(world, [ri.NoOverlap(3.0)]), poses(at.position * 1.2, at.orientation))
        assert apart.value == 0.0


def guides(scene: ri.Scene, name: str) -> list[ri.PointOnSurface]:
    """Planes that the centre of a body stays in: nothing rubs here, and the least tilt would let it slide off what it stands on."""
    place = np.array(scene[name].position)
    for k, guide in enumerate("xy"):
        normal = np.eye(3)[k]
        scene.add(ri.Body(guide, ri.Shape.half_space(normal, place[k]), motion="static"))
    return [ri.PointOnSurface(name, guide, place, 1e5) for guide in "xy"]


def test_boxes_sink_by_what_they_carry() -> None:
    """Four corners on the floor; between two boxes face to face four of each, which share the depth."""
    box, weight, mass = ri.Shape.box((1.0, 1.0, 0.5)), 1e4, 2.0
    for support, share in ((ri.Shape.half_space(offset=0.25), 1.0), (box, 2.0)):
        scene = ri.Scene((0, 0, -G), [ri.Body("support", support, motion="static")])
        scene.add(ri.Body("box", box, position=(0, 0, 0.53), orientation=(1, 0.02, 0.01, 0), mass=mass))
        settled, report = ri.settle(scene, [ri.NoOverlap(weight, bodies=["support", "box"]), ri.GravityPotential(), *guides(scene, "box")])
        assert report.ok, report.message
        height = 0.5 - share * mass * G / (4.0 * weight)
        np.testing.assert_allclose(settled["box"].position[2], height, rtol=0, atol=1e-9)
        np.testing.assert_allclose(settled["box"].orientation[1:3], 0.0, atol=1e-9)


@pytest.mark.parametrize("overhang", [0.3, 0.48, 0.52, 0.53])
def test_a_plank_tips_if_its_centre_is_beyond_the_edge(overhang: float) -> None:
    """Forces on the best plane balance, so they act where plank and block lie face to face.

    A plank of thickness 2 h whose centre is held e beyond the edge turns about the edge until the centre is lowest, sqrt(h^2 - e^2)
    above it.
    """
    thick, beyond = 0.1, max(overhang - 0.5, 0.0)
    scene = ri.Scene((0, 0, -G))
    scene.add(ri.Body("block", ri.Shape.box(1.0), motion="static"))
    scene.add(ri.Body("plank", ri.Shape.box((3.0, 0.6, thick)), position=(overhang, 0, 0.55), mass=1.0))
    bodies = list(scene.names)
    settled, report = ri.settle(scene, [ri.NoOverlap(1e5, bodies=bodies), ri.GravityPotential(), *guides(scene, "plank")])
    assert report.ok, report.message
    # It sinks by some m g / (2 k) = 5e-5 more where two corners carry it; level planks would stand 4e-3 and 1e-2 higher.
    height = settled["plank"].position[2] - 0.5
    assert -3e-4 < height - np.sqrt(0.25 * thick**2 - beyond**2) < 0.0


@pytest.mark.parametrize("name", [*NAMES, "mesh", "floor"])
@pytest.mark.parametrize("inside", [False, True])
def test_a_point_comes_to_the_surface(name: str, inside: bool) -> None:
    import trimesh

    mesh = trimesh.creation.torus(0.4, 0.15, 24, 12)
    shape = {**SHAPES, "mesh": ri.Shape.from_trimesh(mesh), "floor": ri.Shape.half_space()}[name]
    scene = ri.Scene(bodies=[ri.Body("solid", shape, motion="static"), ri.Body("probe", ri.Shape.sphere(0.1), position=(1, 1, 1))])
    anchor = {"mesh": (0.37, 0.03, 0.02), "floor": (0.1, 0.1, -0.3)}.get(name, (0.05, 0.03, 0.12)) if inside else (0.9, 0.8, 1.1)
    settled, report = ri.settle(scene, [ri.PointOnSurface("probe", "solid", anchor)])
    assert report.ok and report.value < 1e-20, report
    world = ri.compile_scene(ri.Scene(bodies=[scene["solid"], ri.Body("point", ri.Shape.sphere(1e-9), motion="kinematic")]))
    place = point(scene, settled, "probe", anchor)
    moved = np.linalg.norm(place - anchor)
    assert moved > 0.01
    unit = np.array([1.0, 0, 0, 0])
    for outward, expected in ((1e-6, 1e-6), (0.0, 0.0)):
        away = (place - anchor) / moved * (1.0 if inside else -1.0) * outward
        gap = Narrowphase(world.shapes).separation(0, (np.zeros(3), unit), 1, (place + away, unit)).gap
        assert abs(gap - expected) < 0.5e-6


def test_the_order_of_energies_and_bodies_plays_no_part() -> None:
    energies = [
        ri.PinPoints("box", "ball", (0, 1, 0), (1, 0, 0)), ri.PinPoints(None, "box", (0, 0, 2), (0.1, 0.2, 0.4)),
        ri.PinPoints("ball", "capsule", (0, 0, 1), (0.3, 0, 1)), ri.GravityPotential(),
        ri.NoOverlap(500.0, bodies=["cylinder", "compound", "floor"]),
        ri.RestoreShape(["cylinder", "compound"], 40.0), ri.PinPoints("cylinder", None, (0, 0, 0.5), (0.2, 0.3, 0.5), 80.0),
    ]  # fmt: skip
    one, report = ri.settle(disorder(), energies)
    other, again = ri.settle(disorder(order=(3, 0, 4, 2, 1)), energies[::-1])
    assert report.ok and again.ok
    np.testing.assert_allclose(again.value, report.value, rtol=1e-11)
    for name in NAMES:
        np.testing.assert_allclose(other[name].position, one[name].position, rtol=0, atol=1e-7)


def test_what_is_not_asked_for_stays() -> None:
    scene = disorder()
    scene.add(ri.ConstantForce("box", (0, 0, 1)))
    before = [(body.name, np.array(body.position)) for body in scene.bodies]
    settled, report = ri.settle(scene, [ri.PinPoints(None, "box", (0, 0, 3), (0, 0, 0))])
    assert report.ok and settled is not scene and settled.effects == scene.effects
    for name, position in before:
        np.testing.assert_array_equal(scene[name].position, position)
        if name != "box":
            np.testing.assert_allclose(settled[name].position, position, rtol=0, atol=1e-15)
    assert replace(settled["floor"]).position == scene["floor"].position


def test_a_failure_is_reported_with_the_remedy() -> None:
    ball = ri.Scene(bodies=[ri.Body("ball", ri.Shape.sphere(0.1))])
    contradiction = [ri.PinPoints(None, "ball", (x, 0, 0), (0, 0, 0)) for x in (1, -1)]
    for energies, options, words in (
        ([ri.GravityPotential()], {}, "no minimum"),
        (contradiction, {}, "stays open by 1 m.*finite weight"),
        ([ri.PinPoints(None, "ball", (1, 0, 0), (0.1, 0, 0))], {"max_iterations": 1}, "max_iterations"),
    ):
        _, report = ri.settle(ball, energies, **options)
        assert not report.ok
        with pytest.raises(AssertionError, match=words):
            raise AssertionError(report.message)
