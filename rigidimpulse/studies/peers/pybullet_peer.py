"""Bullet, through PyBullet: maximal coordinates, sequential impulses, moving meshes as their convex hulls.

It multiplies the coefficients of two bodies, so each gets the square root of that against its like. Where bodies rebound, contacts act only
once they touch and overlap is not taken out by speed, both of which would change the energy by tens of percent.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
import pybullet

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import conjugate, from_matrix, multiply, rotate
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Part
from rigidimpulse.studies.peers.common import PeerBody, PeerJoint, read_scene

ITERATIONS = 200
RESIDUAL = 1e-12
MOST_FORCE = 1e10
"""N, of joints."""
DULL = 0.01
"""Restitution below which contacts are dull."""


class PybulletPeer:
    """A scene in Bullet; poses there are of the principal frame."""

    def __init__(self, bodies: list[PeerBody], joints: list[PeerJoint], gravity: np.ndarray, step: float) -> None:
        """Fill a world of its own; see `read_scene`."""
        self._client = pybullet.connect(pybullet.DIRECT)
        self._bodies = bodies
        self._centre = np.array([body.mass.center_of_mass for body in bodies])
        self._axes = np.array([body.mass.turn for body in bodies])
        pybullet.setGravity(*gravity, physicsClientId=self._client)
        self._bouncy = any(body.restitution > DULL for body in bodies)
        bouncy = {"contactERP": 0.0} if self._bouncy else {}
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=step, numSolverIterations=ITERATIONS, solverResidualThreshold=RESIDUAL, restitutionVelocityThreshold=0.0,
            **bouncy, physicsClientId=self._client,
        )  # fmt: skip
        self._id = [self._add_body(body, turn) for body, turn in zip(bodies, self._axes, strict=True)]
        self._pushed = [(i, body.force) for i, body in zip(self._id, bodies, strict=True) if body.force.any()]
        for joint in joints:
            self._add_joint(joint)

    def _add_body(self, body: PeerBody, axes: np.ndarray) -> int:
        """A body whose frame is principal; parts of compounds are placed in it."""
        dynamic = body.body.motion == "dynamic"
        turn = body.body.unit_orientation()
        shapes = [_shape(part, dynamic) for part in body.parts]
        places = [rotate(conjugate(axes), part.position + _origin(part) - body.mass.center_of_mass) for part in body.parts]
        turns = [multiply(conjugate(axes), from_matrix(part.rotation)) for part in body.parts]
        made = [
            pybullet.createCollisionShape(
                **shape, collisionFramePosition=place.tolist(), collisionFrameOrientation=_xyzw(q), physicsClientId=self._client
            )
            for shape, place, q in zip(shapes, places, turns, strict=True)
        ]
        if len(made) > 1:
            raise SceneError(f"body {body.body.name!r} is a compound", "leave the peer out", "peer 'pybullet'")
        i = pybullet.createMultiBody(
            baseMass=body.mass.mass if dynamic else 0.0, baseCollisionShapeIndex=made[0],
            basePosition=(np.asarray(body.body.position, float) + rotate(turn, body.mass.center_of_mass)).tolist(),
            baseOrientation=_xyzw(multiply(turn, axes)), physicsClientId=self._client,
        )  # fmt: skip
        settings = {"localInertiaDiagonal": body.mass.moments.tolist()} if dynamic else {}
        if self._bouncy:
            settings["contactProcessingThreshold"] = 0.0
        pybullet.changeDynamics(
            i, -1, restitution=sqrt(body.restitution), lateralFriction=sqrt(body.friction), linearDamping=0.0, angularDamping=0.0,
            rollingFriction=0.0, spinningFriction=0.0, activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            maxJointVelocity=1e9, **settings, physicsClientId=self._client,
        )  # fmt: skip
        if dynamic:
            velocity, spin = np.asarray(body.body.velocity, float), np.asarray(body.body.angular_velocity, float)
            pybullet.resetBaseVelocity(i, velocity.tolist(), spin.tolist(), physicsClientId=self._client)
        return i

    def _add_joint(self, joint: PeerJoint) -> None:
        """A point-to-point constraint for each point."""
        places = {body.body.name: (i, k) for k, (i, body) in enumerate(zip(self._id, self._bodies, strict=True))}
        first, second = (joint.a, joint.b) if joint.a is not None else (joint.b, None)
        assert first is not None
        if second is not None:
            pybullet.setCollisionFilterPair(places[first][0], places[second][0], -1, -1, 0, physicsClientId=self._client)
        for point in joint.points:
            i, k = places[first]
            j, arm = -1, point
            if second is not None:
                j, arm = places[second][0], self._arm(places[second][1], point)
            constraint = pybullet.createConstraint(
                i, -1, j, -1, pybullet.JOINT_POINT2POINT, [0, 0, 0], self._arm(k, point).tolist(), arm.tolist(),
                physicsClientId=self._client,
            )  # fmt: skip
            pybullet.changeConstraint(constraint, maxForce=MOST_FORCE, physicsClientId=self._client)

    def _arm(self, k: int, point: np.ndarray) -> np.ndarray:
        """A point of the world at the start in the principal frame of a body."""
        body = self._bodies[k]
        turn = body.body.unit_orientation()
        centre = np.asarray(body.body.position, float) + rotate(turn, body.mass.center_of_mass)
        return rotate(conjugate(multiply(turn, self._axes[k])), point - centre)

    def advance(self, count: int) -> None:
        """See `Peer`."""
        for _ in range(count):
            for i, force in self._pushed:
                centre = pybullet.getBasePositionAndOrientation(i, physicsClientId=self._client)[0]
                pybullet.applyExternalForce(i, -1, force.tolist(), centre, pybullet.WORLD_FRAME, physicsClientId=self._client)
            pybullet.stepSimulation(physicsClientId=self._client)

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """See `Peer`."""
        poses = [pybullet.getBasePositionAndOrientation(i, physicsClientId=self._client) for i in self._id]
        speeds = [pybullet.getBaseVelocity(i, physicsClientId=self._client) for i in self._id]
        centre = np.array([pose[0] for pose in poses])
        turn = multiply(np.array([pose[1] for pose in poses])[:, [3, 0, 1, 2]], conjugate(self._axes))
        velocity, spin = (np.array([speed[k] for speed in speeds]) for k in range(2))
        return centre - rotate(turn, self._centre), turn, velocity, spin, centre

    def close(self) -> None:
        """See `Peer`."""
        pybullet.disconnect(physicsClientId=self._client)


def make(scene: Scene, step: float) -> PybulletPeer:
    """Put a scene into Bullet with steps of `step` s."""
    bodies, joints = read_scene(scene, "pybullet")
    return PybulletPeer(bodies, joints, np.asarray(scene.gravity, float), step)


def _xyzw(quaternion: np.ndarray) -> list[float]:
    return quaternion[[1, 2, 3, 0]].tolist()


def _origin(part: Part) -> np.ndarray:
    """Where the engine's shape has its origin, from that of the part: its planes go through theirs."""
    if part.shape.kind != "half_space":
        return np.zeros(3)
    normal, offset = part.shape.plane()
    return part.rotation @ (offset * normal)


def _shape(part: Part, dynamic: bool) -> dict:
    """Arguments of a collision shape."""
    shape = part.shape
    if shape.kind == "half_space":
        normal, _ = shape.plane()
        return {"shapeType": pybullet.GEOM_PLANE, "planeNormal": normal.tolist()}
    if shape.kind == "sphere":
        return {"shapeType": pybullet.GEOM_SPHERE, "radius": shape.radius}
    if shape.kind == "box":
        return {"shapeType": pybullet.GEOM_BOX, "halfExtents": (0.5 * np.broadcast_to(np.asarray(shape.size, float), 3)).tolist()}
    if shape.kind in ("capsule", "cylinder"):
        kind = pybullet.GEOM_CAPSULE if shape.kind == "capsule" else pybullet.GEOM_CYLINDER
        return {"shapeType": kind, "radius": shape.radius, "height": shape.height}
    if shape.kind != "mesh":
        raise SceneError(f"a {shape.kind} is unknown to the adapter", "leave the peer out", "peer 'pybullet'")
    surface = shape.surface()
    flags = 0 if dynamic else pybullet.GEOM_FORCE_CONCAVE_TRIMESH
    return {
        "shapeType": pybullet.GEOM_MESH, "vertices": surface.vertices.tolist(), "indices": surface.faces.ravel().tolist(), "flags": flags,
    }  # fmt: skip
