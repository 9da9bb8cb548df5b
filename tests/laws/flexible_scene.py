"""Scenes of flexible bodies and a plain loop around `Flexibles.step`: rigid bodies fly freely and get the impulses of the nets."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import rigidimpulse as ri
from rigidimpulse.core.quaternion import quaternion_from_rotation_vector, to_matrix
from rigidimpulse.dynamics.soft_body import FlexibleBody, Flexibles, FlexibleStep, RigidMotion
from rigidimpulse.dynamics.soft_body.mass_spring import SpringMesh


def sheet_mesh(n: int, length: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n^2, 3) and faces of a square in the plane z = 0."""
    u = np.linspace(0.0, length, n)
    x, y = np.meshgrid(u, u, indexing="ij")
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)]), faces


def cube_mesh(n: int, length: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of the surface of a cube about the origin, n vertices along an edge."""
    flat, faces = sheet_mesh(n, 1.0)
    points, triangles = [], []
    for axis in range(3):
        for side in (0.0, 1.0):
            face = np.roll(np.column_stack([flat[:, :2], np.full(len(flat), side)]), axis + 1, axis=1)
            triangles.append((faces if side else faces[:, ::-1]) + len(flat) * len(points))
            points.append(face)
    _, first, index = np.unique(np.round(np.concatenate(points), 9), axis=0, return_index=True, return_inverse=True)
    return length * (np.concatenate(points)[first] - 0.5), index.ravel()[np.concatenate(triangles)]


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Volume of a closed mesh."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.sum(a * np.cross(b, c))) / 6.0


@dataclass(frozen=True, eq=False)
class GridCloth(FlexibleBody):
    """Point masses (n,) at mesh (n, 3) with given springs, hinges and rest lengths, of which a body without faces is made."""

    springs: SpringMesh | None = None

    def build(self) -> SpringMesh:
        assert self.springs is not None
        return self.springs

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        assert self.springs is not None
        return self.springs.position, np.zeros((0, 3), np.int64)


def spring_mesh(x, mass, springs, stiffness, rest=None, damping=0.0, **more) -> GridCloth:
    """Body of springs (s, 2) at points x (n, 3)."""
    x, springs = np.asarray(x, float), np.asarray(springs, np.int64).reshape(-1, 2)
    k = np.broadcast_to(np.asarray(stiffness, float), len(springs)).copy()
    soft_body = SpringMesh(x, np.broadcast_to(np.asarray(mass, float), len(x)).copy(), springs, np.zeros(len(springs)), k, damping * k)
    soft_body = replace(soft_body, spring_rest=soft_body.lengths(x) if rest is None else np.asarray(rest, float))
    return GridCloth("net", None, stiffness=1.0, springs=soft_body, **more)


class Run:
    """Flexible and rigid bodies of a scene, moved together; rigid bodies do not touch each other."""

    def __init__(self, scene: ri.Scene, **settings) -> None:
        self.world = ri.compile_scene(scene)
        self.soft_bodies = Flexibles(self.world, **settings)
        self.x, self.v, self.w = (a.copy() for a in (self.world.position, self.world.velocity, self.world.angular_velocity))
        self.R = np.array([to_matrix(q) for q in self.world.orientation])
        self.time = 0.0

    def inverse_inertia(self) -> np.ndarray:
        """(n, 3, 3) in world axes."""
        return np.einsum("nij,nj,nkj->nik", self.R, self.world.dynamic[:, None] / self.world.inertia, self.R)

    def motion(self, h: float) -> RigidMotion:
        """Rigid bodies over a step, without the nets."""
        end = self.x + h * self.v + 0.5 * h * h * self.world.gravity
        return RigidMotion(
            self.x, self.R, self.v, self.w, end, turned(self.R, h * self.w), self.world.inv_mass, self.inverse_inertia(),
            self.world.dynamic,
        )  # fmt: skip

    def step(self, h: float) -> FlexibleStep:
        """One step: bodies fly under gravity and the ramp F0 + F1 s; their spin takes the impulse of the torque and its way."""
        world, motion = self.world, self.motion(h)
        done = self.soft_bodies.step(self.time, h, motion)
        gained = world.inv_mass[:, None] * done.impulse[:, :3]
        spun = np.einsum("nij,nj->ni", motion.inv_inertia, done.impulse[:, 3:])
        way = 0.5 * h * h * done.ramp[0, :, :3] + h**3 / 6.0 * done.ramp[1, :, :3]
        self.x, self.R = motion.end_position + world.inv_mass[:, None] * way, turned(motion.end_rotation, h * spun)
        self.v, self.w = self.v + h * world.gravity + gained, self.w + spun
        self.time += h
        return done


def turned(rotation: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) turned by rotation vectors (n, 3)."""
    return np.array([to_matrix(quaternion_from_rotation_vector(v)) @ R for v, R in zip(vectors, rotation, strict=True)])


def anchor_scene(*soft_bodies: FlexibleBody, gravity=(0.0, 0.0, -9.81)) -> ri.Scene:
    """Nets far from the one body that a scene needs."""
    scene = ri.Scene(gravity=gravity)
    scene.add(ri.Body("far", ri.Shape.sphere(0.1), motion="static", position=(0, 0, -1e3)))
    for soft_body in soft_bodies:
        scene.add(soft_body)
    return scene
