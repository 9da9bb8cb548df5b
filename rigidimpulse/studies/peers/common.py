"""What adapters need to know of a scene, and what they give back."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.dynamics.forces.constant import ConstantForce
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import BallJoint, HingeJoint
from rigidimpulse.scene.mass import BodyMass, body_mass
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Part


class PeerBody(NamedTuple):
    """One body in its own frame: the parts of its shape, mass properties, and coefficients against its like."""

    body: Body
    parts: list[Part]
    mass: BodyMass
    restitution: float
    friction: float
    force: np.ndarray
    """(3,) N, constant, at the centre of mass."""


class PeerJoint(NamedTuple):
    """A ball joint as one point, a hinge as two on its axis: bodies (None: the world) and points (k, 3) in the world at the start."""

    a: str | None
    b: str | None
    points: np.ndarray


class Peer(Protocol):
    """A scene in another engine."""

    def advance(self, count: int) -> None:
        """Take `count` steps."""
        ...

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Origins (n, 3), orientations (n, 4), velocities of centres of mass (n, 3), spins in the world (n, 3), centres of mass (n, 3)."""
        ...

    def close(self) -> None:
        """Let the engine forget the scene."""
        ...


def read_scene(scene: Scene, engine: str) -> tuple[list[PeerBody], list[PeerJoint]]:
    """Return bodies and joints of a scene that is found good.

    Raises:
        SceneError: the scene is bad, or has parts that adapters do not know.

    """
    world = compile_scene(scene)
    where = f"peer {engine!r}"
    forces = {body.name: np.zeros(3) for body in scene.bodies}
    joints = []
    for effect in scene.effects:
        if isinstance(effect, ConstantForce) and effect.point is None:
            forces[effect.body] = forces[effect.body] + np.asarray(effect.force, float)
        elif isinstance(effect, BallJoint | HingeJoint) and _is_plain(effect):
            sizes = [world.size[scene.names.index(name)] for name in (effect.a, effect.b) if name is not None]
            joints.append(_joint(effect, 0.5 * min(sizes)))
        else:
            raise SceneError(f"it has a {type(effect).__name__} that the adapter does not know", "leave the peer out", where)
    bodies = []
    for i, body in enumerate(scene.bodies):
        if body.motion == "kinematic" or body.gravity_factor != 1.0:
            raise SceneError(f"body {body.name!r} is kinematic or has a gravity factor", "leave the peer out", where)
        m = world.material_of_body[i]
        bounce, _, friction, _ = world.coefficients[m, m]
        bodies.append(PeerBody(body, body.shape.parts_flat(), body_mass(body), float(bounce), float(friction), forces[body.name]))
    return bodies, joints


def _is_plain(joint: BallJoint | HingeJoint) -> bool:
    """Hard, without limits, motor and end."""
    ends = joint.a, joint.b, joint.anchor
    plain = HingeJoint(*ends, joint.axis) if isinstance(joint, HingeJoint) else BallJoint(*ends)
    settings = [name for name in vars(joint) if name not in ("a", "b", "anchor", "axis", "name")]
    return all(getattr(joint, name) == getattr(plain, name) for name in settings)


def _joint(joint: BallJoint | HingeJoint, reach: float) -> PeerJoint:
    """The points of a hinge are `reach` m from its anchor."""
    anchor = np.asarray(joint.anchor, float)
    if isinstance(joint, HingeJoint):
        axis = np.array(joint.axis, float)
        axis *= reach / np.linalg.norm(axis)
        return PeerJoint(joint.a, joint.b, np.array([anchor - axis, anchor + axis]))
    return PeerJoint(joint.a, joint.b, anchor[None])
