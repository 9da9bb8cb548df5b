"""Random scenes, as plain data that any source of choices can make, and the scene of the library that they stand for.

A scene has 2 to 8 bodies of all shapes (masses over six decades, sizes over one), none that overlap at the start, maybe a floor,
walls, joints, a constant force. All supports have one velocity, V: seen from there they rest, so they do no work, and the energy
of bodies may not grow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

import rigidimpulse as ri

SHAPES = ("sphere", "box", "capsule", "cylinder", "hull", "corner")
SIDES = 96
"""Sides of the prism inside a cylinder, for the check of overlap."""
APART = 1e-3
"""Least distance of bounding spheres at the start, of the larger radius, where bodies are not drawn touching."""
WALL = 4.0
"""m, half the distance of opposite walls."""


class Source(Protocol):
    """Where choices come from."""

    def real(self, low: float, high: float) -> float:
        """A number between two."""
        ...

    def integer(self, low: int, high: int) -> int:
        """A whole number between two, both included."""
        ...

    def pick(self, options: Sequence[Any]) -> Any:
        """One of several; the first is the simplest."""
        ...


class Dice:
    """Choices by a generator of random numbers."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def real(self, low: float, high: float) -> float:
        """See `Source`."""
        return float(self.random.uniform(low, high))

    def integer(self, low: int, high: int) -> int:
        """See `Source`."""
        return int(self.random.integers(low, high + 1))

    def pick(self, options: Sequence[Any]) -> Any:
        """See `Source`."""
        return options[self.integer(0, len(options) - 1)]


@dataclass(frozen=True)
class BodyPlan:
    """A body: shape of the lengths `size` (3,) m; for a hull the corners, in parts of them."""

    shape: str
    size: tuple[float, float, float]
    mass: float
    restitution: float
    friction: tuple[float, float]
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float]
    velocity: tuple[float, float, float]
    spin: tuple[float, float, float]
    corners: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True)
class JointPlan:
    """A joint of body k, and of the one before it or (`to_world`) of the world, at a point beside both."""

    kind: str
    body: int
    to_world: bool


@dataclass(frozen=True)
class ScenePlan:
    """A scene; see the head of the file. `support`: "none", "floor", "slab" (a static box) or "walls" (a floor and four walls)."""

    bodies: tuple[BodyPlan, ...]
    gravity: tuple[float, float, float]
    support: str
    support_friction: float
    support_velocity: tuple[float, float, float]
    joints: tuple[JointPlan, ...]
    force: tuple[float, float, float]
    duration: float


@dataclass(frozen=True)
class Choice:
    """What a scene may have."""

    supports: tuple[str, ...] = ("none", "floor", "floor", "slab", "walls")
    layouts: tuple[str, ...] = ("cloud", "pile", "stack")
    shapes: tuple[str, ...] = SHAPES
    most_bodies: int = 8
    joints: bool = True
    drift: bool = True


EVERYTHING = Choice()


def make_plan(source: Source, choice: Choice = EVERYTHING) -> ScenePlan:
    """Choose a scene."""
    support = source.pick(choice.supports)
    layout = source.pick(choice.layouts if support != "none" else ("cloud",))
    gravity = source.pick(((0.0, 0.0, -9.81), (0.0, 0.0, -9.81), (0.0, 0.0, 0.0), (1.7, -2.5, -9.0)))
    drifts = choice.drift and support != "none" and source.integer(0, 4) == 4
    drift = tuple(source.real(-2.0, 2.0) for _ in range(3)) if drifts else (0.0, 0.0, 0.0)
    bodies = _bodies(source, choice, layout)
    joints = _joints(source, bodies, drift) if choice.joints and source.integer(0, 3) == 3 else ()
    force = tuple(bodies[0].mass * source.real(-10.0, 10.0) for _ in range(3)) if source.integer(0, 4) == 4 else (0.0, 0.0, 0.0)
    return ScenePlan(
        bodies, gravity, support, source.pick((0.5, 0.0, 1.0)), drift, joints, force, source.pick((0.5, 0.75, 1.0))
    )  # fmt: skip


def _bodies(source: Source, choice: Choice, layout: str) -> tuple[BodyPlan, ...]:
    """Choose bodies that do not overlap: in cells and on their way to one place, one above the other with a gap, or flush on each other."""
    materials = [_material(source) for _ in range(source.integer(1, 2))]
    shapes = [_shape(source, choice.shapes) for _ in range(source.integer(2, choice.most_bodies))]
    pitch = 2.0 * (1.0 + APART) * max(bounding_radius(*chosen) for chosen in shapes)
    rate = source.real(1.0, 4.0)
    places, top = list(range(27)), 0.0
    bodies: list[BodyPlan] = []
    for shape, size, corners in shapes:
        upright = source.integer(0, 2) == 0
        restitution, friction = source.pick(materials)
        reach = bounding_radius(shape, size, corners)
        velocity = np.array([source.real(-1.0, 1.0) for _ in range(3)])
        if layout == "cloud":
            cell = places.pop(source.integer(0, len(places) - 1))
            place = np.array([cell % 3 - 1.0, cell // 3 % 3 - 1.0, cell // 9 + 0.5]) * pitch
            velocity = 0.2 * velocity - rate * (place - [0.0, 0.0, 0.5 * pitch])
        elif layout == "pile":
            top += APART * reach
            place = np.array([source.real(-0.2, 0.2), source.real(-0.2, 0.2), top + reach])
            top += 2.0 * reach
        else:
            upright, velocity = True, 0.0 * velocity
            half = half_height(shape, size, corners)
            place = np.array([0.1 * source.real(-1.0, 1.0) * size[0], 0.0, top + half])
            top += 2.0 * half
        orientation = (1.0, 0.0, 0.0, 0.0) if upright else _turn(source)
        most = 0.0 if layout == "stack" else source.pick((3.0, 0.0, 30.0))
        spin = tuple(source.real(-most, most) for _ in range(3)) if most else (0.0, 0.0, 0.0)
        mass = 10.0 ** source.real(-3.0, 3.0)
        bodies.append(BodyPlan(shape, size, mass, restitution, friction, tuple(place), orientation, tuple(velocity), spin, corners))
    return tuple(bodies)


def _material(source: Source) -> tuple[float, tuple[float, float]]:
    """Choose a restitution and frictions for rest and motion."""
    static = source.pick((0.5, 0.0, 0.2, 1.0))
    return source.pick((0.0, 0.3, 0.6, 0.9, 1.0)), (static, static * source.pick((1.0, 0.7)))


def _shape(source: Source, shapes: tuple[str, ...]) -> tuple[str, tuple[float, float, float], tuple]:
    """Choose a shape, its lengths (the largest 0.1 to 1 m, others from 0.2 of that) and the corners of a hull."""
    shape = source.pick(shapes)
    largest = 10.0 ** source.real(-1.0, 0.0)
    size = tuple(largest * source.pick((1.0, 0.6, 0.3, 0.2)) for _ in range(3))
    if shape != "hull":
        return shape, size, ()
    # Eight corners, one in each octant, are never flat.
    octants = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    return shape, size, tuple(tuple(c * source.real(0.4, 1.0) for c in octant) for octant in octants)


def _turn(source: Source) -> tuple[float, float, float, float]:
    q = np.array([source.real(-1.0, 1.0) for _ in range(4)])
    length = float(np.linalg.norm(q))
    return tuple(q / length) if length > 0.1 else (0.5, 0.5, 0.5, 0.5)


def _joints(source: Source, bodies, drift) -> tuple[JointPlan, ...]:
    """Choose joints of neighbours in the list, and maybe one of the first body with the world, where supports do not move."""
    kinds = ("ball", "hinge", "distance", "fixed", "slider")
    joints = [JointPlan(source.pick(kinds), k, False) for k in range(1, source.integer(1, min(3, len(bodies) - 1)) + 1)]
    if not any(drift) and source.integer(0, 1) == 1:
        joints.append(JointPlan(source.pick(kinds[:2]), 0, True))
    return tuple(joints)


def bounding_radius(shape: str, size, corners) -> float:
    """Radius of a ball about the origin that holds a shape, m."""
    x, y, z = size
    if shape == "sphere":
        return 0.5 * x
    if shape == "capsule":
        return 0.5 * (x + z)
    if shape == "cylinder":
        return math.hypot(0.5 * x, 0.5 * z)
    if shape == "hull":
        return float(np.linalg.norm(np.array(corners) * size, axis=1).max())
    return 0.5 * math.sqrt(x * x + y * y + z * z)


def half_height(shape: str, size, corners) -> float:
    """Half of the height of an upright shape, m; of a hull, that of its highest or lowest corner."""
    x, _, z = size
    if shape == "hull":
        return float(np.abs(np.array(corners)[:, 2]).max() * z)
    return {"sphere": 0.5 * x, "capsule": 0.5 * (x + z)}.get(shape, 0.5 * z)


def make_shape(plan: BodyPlan, inscribed: bool = False) -> ri.Shape:
    """The shape of a body; with `inscribed` cylinders are the prisms inside them, which FCL knows."""
    x, _, z = plan.size
    if plan.shape == "sphere":
        return ri.Shape.sphere(0.5 * x)
    if plan.shape == "capsule":
        return ri.Shape.capsule(0.5 * x, z)
    if plan.shape == "cylinder":
        if not inscribed:
            return ri.Shape.cylinder(0.5 * x, z)
        angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
        rim = 0.5 * x * np.column_stack([np.cos(angle), np.sin(angle)])
        return ri.Shape.convex_hull([(*p, h) for h in (-0.5 * z, 0.5 * z) for p in rim])
    if plan.shape == "hull":
        return ri.Shape.convex_hull(np.array(plan.corners) * plan.size)
    return ri.Shape.box(plan.size) if plan.shape == "box" else _corner(plan.size)


def _corner(size) -> ri.Shape:
    """A concave mesh: an L of two legs, half as thick as it is wide, within a box of the given lengths."""
    outline = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.0), (0.0, 0.0), (0.0, 0.5), (-0.5, 0.5)])
    vertices = np.array([(px, y, pz) for y in (-0.5, 0.5) for px, pz in outline]) * size
    caps = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = caps + [(c + 6, b + 6, a + 6) for a, b, c in caps]
    for k in range(6):
        n = (k + 1) % 6
        faces += [(k, k + 6, n), (n, k + 6, n + 6)]
    return ri.Shape.mesh(vertices, faces)


def make_scene(plan: ScenePlan, inscribed: bool = False) -> ri.Scene:
    """The scene of a plan."""
    scene = ri.Scene(gravity=plan.gravity)
    for k, body in enumerate(plan.bodies):
        static, dynamic = body.friction
        material = ri.Material(restitution=body.restitution, static_friction=static, dynamic_friction=dynamic)
        scene.add(
            ri.Body(f"body {k}", make_shape(body, inscribed), position=body.position, orientation=body.orientation,
                    velocity=body.velocity, angular_velocity=body.spin, mass=body.mass, material=material)
        )  # fmt: skip
    moving = {"motion": "kinematic", "velocity": plan.support_velocity} if any(plan.support_velocity) else {"motion": "static"}
    material = ri.Material(static_friction=plan.support_friction, dynamic_friction=plan.support_friction)
    if plan.support == "slab":
        scene.add(ri.Body("floor", ri.Shape.box((20.0, 20.0, 1.0)), position=(0.0, 0.0, -0.5), material=material, **moving))
    elif plan.support != "none":
        scene.add(ri.Body("floor", ri.Shape.half_space(), material=material, **moving))
    if plan.support == "walls":
        for k, way in enumerate(((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0))):
            scene.add(ri.Body(f"wall {k}", ri.Shape.half_space(normal=way, offset=-WALL), material=material, **moving))
    for joint in plan.joints:
        scene.add(_make_joint(plan, joint))
    if any(plan.force):
        scene.add(ri.ConstantForce("body 0", plan.force))
    return scene


def _make_joint(plan: ScenePlan, joint: JointPlan):
    b, here = f"body {joint.body}", np.array(plan.bodies[joint.body].position)
    a = None if joint.to_world else f"body {joint.body - 1}"
    other = here + [0.3, 0.0, 0.5] if joint.to_world else np.array(plan.bodies[joint.body - 1].position)
    if joint.kind == "distance":
        return ri.DistanceJoint(a, b, other, here)
    middle = 0.5 * (here + other)
    if joint.kind == "fixed":
        return ri.FixedJoint(a, b, anchor=middle)
    if joint.kind == "ball":
        return ri.BallJoint(a, b, middle)
    made = ri.HingeJoint if joint.kind == "hinge" else ri.SliderJoint
    return made(a, b, middle, (0.0, 0.6, 0.8))
