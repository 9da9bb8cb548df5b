"""MuJoCo: generalised coordinates, soft convex contact, meshes as their convex hulls.

Contacts are springs and dampers with the stiffness of ten steps a half wave and the damping ratio that restitution e asks for,
z = -ln e / sqrt(pi^2 + ln^2 e): the direct form of `solref`. Contacts end when their force does, which makes e larger, and ten steps are
coarse, which makes it smaller: it rebounds with 1.002, 0.798, 0.507 and 0.249 where 1, 0.8, 0.5 and 0.2 are asked for. Dull contacts have
the stiffest form that stays stable, a time constant of two steps.
"""

from __future__ import annotations

from importlib import import_module
from math import log, pi, sqrt
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import conjugate, from_matrix, rotate
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.io.robots.mjcf import warnings_in
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Part
from rigidimpulse.studies.peers.common import PeerBody, PeerJoint, read_scene

mujoco: Any = import_module("mujoco")

STEPS_A_CONTACT = 10
DULL = 0.01
"""Restitution below which a contact is dull."""
TOLERANCE = 1e-12
"""Of the solver, where there are at most MANY bodies; crowds have its defaults, which cost less."""
MANY = 50
PLANE = 100.0
"""m, half of what is drawn of a plane; it is endless."""


class MujocoPeer:
    """A scene in MuJoCo."""

    def __init__(self, bodies: list[PeerBody], joints: list[PeerJoint], gravity: np.ndarray, step: float) -> None:
        """Build the model; see `read_scene`."""
        spec = mujoco.MjSpec()
        spec.option.timestep, spec.option.gravity = step, gravity
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        if len(bodies) <= MANY:
            spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
            spec.option.tolerance, spec.option.impratio = TOLERANCE, 10.0
        for body in bodies:
            _add_body(spec, body, step)
        for joint in joints:
            _add_joint(spec, joint)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._bodies = bodies
        self._id = np.array([mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, body.body.name) for body in bodies])
        self._dynamic = np.array([body.body.motion == "dynamic" for body in bodies])
        self._centre = np.array([body.mass.center_of_mass for body in bodies])
        first = np.array([self._model.body_dofadr[i] for i in self._id])
        self._columns = first[self._dynamic][:, None] + np.arange(6)
        self._start()

    def _start(self) -> None:
        data = self._data
        for body, i, columns in zip(
            [body for body in self._bodies if body.body.motion == "dynamic"], self._id[self._dynamic], self._columns, strict=True
        ):
            turn, spin = body.body.unit_orientation(), np.asarray(body.body.angular_velocity, float)
            arm = rotate(turn, body.mass.center_of_mass)
            data.qvel[columns[:3]] = np.asarray(body.body.velocity, float) - cross_arrays(spin, arm)
            data.qvel[columns[3:]] = rotate(conjugate(turn), spin)
            data.xfrc_applied[i, :3] = body.force
        mujoco.mj_forward(self._model, data)

    def advance(self, count: int) -> None:
        """See `Peer`; raises `SceneError` where MuJoCo warns: after numbers that are none it begins again with the start."""
        notes: list[str] = []
        with warnings_in(notes, mujoco):
            mujoco.mj_step(self._model, self._data, nstep=count)
        if notes:
            raise SceneError(notes[0], "use a smaller step, or leave the peer out", "peer 'mujoco'")

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """See `Peer`."""
        data, dynamic = self._data, self._dynamic
        mujoco.mj_kinematics(self._model, data)
        position, turn = data.xpos[self._id].copy(), data.xquat[self._id].copy()
        velocity, spin = np.zeros((2, len(self._id), 3))
        arm = rotate(turn, self._centre)
        spin[dynamic] = rotate(turn[dynamic], data.qvel[self._columns[:, 3:]])
        velocity[dynamic] = data.qvel[self._columns[:, :3]] + cross_arrays(spin, arm)[dynamic]
        return position, turn, velocity, spin, position + arm

    def close(self) -> None:
        """See `Peer`: the model goes with its last user."""


def make(scene: Scene, step: float) -> MujocoPeer:
    """Put a scene into MuJoCo with steps of `step` s."""
    bodies, joints = read_scene(scene, "mujoco")
    return MujocoPeer(bodies, joints, np.asarray(scene.gravity, float), step)


def _contact(restitution: float, step: float) -> list[float]:
    """`solref` of a restitution."""
    if restitution < DULL:
        return [2.0 * step, 1.0]
    z = -log(restitution) / sqrt(pi**2 + log(restitution) ** 2)
    w = pi / (STEPS_A_CONTACT * step * sqrt(1.0 - z * z))
    return [-w * w, -2.0 * z * w]


def _add_body(spec: Any, body: PeerBody, step: float) -> None:
    added = spec.worldbody.add_body(name=body.body.name, pos=np.asarray(body.body.position, float), quat=body.body.unit_orientation())
    if body.body.motion == "dynamic":
        added.add_freejoint()
        added.explicitinertial = True
        added.mass, added.ipos = body.mass.mass, body.mass.center_of_mass
        added.iquat, added.inertia = body.mass.turn, body.mass.moments
    for k, part in enumerate(body.parts):
        placed = {"pos": part.position, "quat": from_matrix(part.rotation)}
        geom = added.add_geom(**placed | _geometry(spec, f"{body.body.name} {k}", part))
        geom.friction = [body.friction, 0.0, 0.0]
        geom.condim = 3 if body.friction > 0.0 else 1
        geom.solref, geom.solimp = _contact(body.restitution, step), [0.99, 0.99, 0.001, 0.5, 2.0]
        if body.body.motion != "dynamic":
            # Pairs of bodies that do not move are no contacts.
            geom.contype, geom.conaffinity = 2, 1


def _geometry(spec: Any, name: str, part: Part) -> dict:
    """Arguments of a geometry."""
    shape, kinds = part.shape, mujoco.mjtGeom
    if shape.kind == "half_space":
        normal, offset = shape.plane()
        turned = part.rotation @ normal
        across = np.eye(3)[int(np.argmin(np.abs(turned)))]
        first = across - (across @ turned) * turned
        first /= np.linalg.norm(first)
        frame = np.column_stack([first, np.cross(turned, first), turned])
        return {"type": kinds.mjGEOM_PLANE, "size": [PLANE, PLANE, 1.0], "pos": part.position + offset * turned, "quat": from_matrix(frame)}
    if shape.kind == "sphere":
        return {"type": kinds.mjGEOM_SPHERE, "size": [shape.radius, 0.0, 0.0]}
    if shape.kind == "box":
        return {"type": kinds.mjGEOM_BOX, "size": 0.5 * np.broadcast_to(np.asarray(shape.size, float), 3)}
    if shape.kind in ("capsule", "cylinder"):
        kind = kinds.mjGEOM_CAPSULE if shape.kind == "capsule" else kinds.mjGEOM_CYLINDER
        return {"type": kind, "size": [shape.radius, 0.5 * shape.height, 0.0]}
    if shape.kind != "mesh":
        raise SceneError(f"a {shape.kind} is unknown to the adapter", "leave the peer out", "peer 'mujoco'")
    surface = shape.surface()
    mesh = spec.add_mesh(name=name)
    mesh.uservert, mesh.userface = surface.vertices.ravel().astype(np.float32), surface.faces.ravel().astype(np.int32)
    return {"type": kinds.mjGEOM_MESH, "meshname": name}


def _add_joint(spec: Any, joint: PeerJoint) -> None:
    """A constraint that holds a point of both bodies together, for each point."""
    name = joint.b if joint.a is None else joint.a
    body = spec.body(name)
    turn = np.asarray(body.quat, float)
    if joint.a is not None and joint.b is not None:
        spec.add_exclude(bodyname1=joint.a, bodyname2=joint.b)
    for point in joint.points:
        equality = spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_BODY)
        equality.name1, equality.name2 = name, "world" if joint.a is None or joint.b is None else joint.b
        equality.data[:3] = rotate(conjugate(turn), point - np.asarray(body.pos, float))
