"""Controllers that pull a body to a pose or a velocity.

    F = k (x* - x) + c (v* - v),    tau = k_r theta + c_r (w* - w),    exp(theta) R = R*,  |theta| <= pi

x is the centre of mass, x* where it is when the body has the pose wished for. A controller of pose is the oscillator
m x'' + c x' + k x = k x*: w_0 = sqrt(k / m), damping ratio z = c / (2 sqrt(k m)), overshoot exp(-pi z / sqrt(1 - z^2)). One of velocity
alone, k = 0, comes to it as exp(-c t / m).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import conjugate, multiply, quaternion_from_rotation_vector, rotate, rotation_vector
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.forces.force import (
    Force,
    ForceTable,
    Instant,
    checked_number,
    checked_orientation,
    checked_vector,
    dynamic_body,
    named,
    no_links,
)
from rigidimpulse.model.world import World
from rigidimpulse.scene.keyframes import Keyframes


@dataclass(frozen=True, eq=False)
class PDController(Force):
    """A proportional-derivative controller of a body's pose, velocity, or both: a hand that moves it, a thermostat of speed.

    Only what is given is controlled: a target of None has no stiffness, a velocity of None is that of the target (0 for one that stands).
    Unlike a joint's drive it is not implicit: stiff controllers cost short steps; sqrt(stiffness / mass) tells how short.

    Checked when the scene is compiled: a `SceneError` names a body that is unknown or not dynamic, numbers that are negative or not
    finite, gains without anything to control, and targets without gains.

    Attributes:
        body: name of the body.
        position: (3,) m of the body's origin, or `Keyframes` of its pose, followed with their velocities.
        orientation: (4,) quaternion (w, x, y, z) of the body.
        velocity: (3,) m/s of the centre of mass. angular_velocity: (3,) rad/s, world axes.
        stiffness: k, N/m. damping: c, N s/m.
        angular_stiffness: k_r, N m/rad. angular_damping: c_r, N m s/rad.
        max_force: N, and max_torque: N m: the greatest it can do; direction is kept.
        name: what the ledger calls it; None makes one of the body's name.

    """

    body: str
    _: KW_ONLY
    position: ArrayLike | Keyframes | None = None
    orientation: ArrayLike | None = None
    velocity: ArrayLike | None = None
    angular_velocity: ArrayLike | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    angular_stiffness: float = 0.0
    angular_damping: float = 0.0
    max_force: float = math.inf
    max_torque: float = math.inf
    name: str | None = None
    kind: ClassVar[str] = "PD controllers"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> PDForces:
        """Check and bind all controllers."""
        hands = [_hand(force, world, f"PDController({force.body!r})") for force in forces]
        names = named(cls.kind, [f.name for f in forces], [f"controller of {f.body}" for f in forces])
        return PDForces(names, hands, world)


class Hand(NamedTuple):
    """One controller, checked: body; times (k,), positions (k, 3) and orientations (k, 4) of keys; velocities; gains; greatest values."""

    body: int
    times: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray
    velocity: np.ndarray | None
    angular_velocity: np.ndarray | None
    gains: np.ndarray  # (4,) stiffness, damping, the same of the rotation
    most: np.ndarray  # (2,)


def _hand(force: PDController, world: World, where: str) -> Hand:
    """Check a controller."""
    i = dynamic_body(world, force.body, where)
    body = world.scene[force.body]
    names = ("stiffness", "damping", "angular_stiffness", "angular_damping")
    units = ("N/m", "N s/m", "N m/rad", "N m s/rad")
    gains = np.array(
        [checked_number(getattr(force, name), name, unit, where, least=0.0) for name, unit in zip(names, units, strict=True)]
    )
    if not gains.any():
        raise SceneError("all its gains are 0", "give a stiffness or a damping", where)
    if gains[0] > 0.0 and force.position is None:
        raise SceneError(f"stiffness is {force.stiffness!r}, but there is no position", "give the position it pulls to", where)
    turns = force.orientation is not None or (isinstance(force.position, Keyframes) and force.position.orientations is not None)
    if gains[2] > 0.0 and not turns:
        raise SceneError(f"angular_stiffness is {force.angular_stiffness!r}, but there is no orientation", "give the orientation", where)
    _check_targets(force, gains, turns, where)
    start = body.unit_orientation()
    if isinstance(force.position, Keyframes):
        if force.orientation is not None:
            raise SceneError("it has keyframes and an orientation", "give the orientations with the keyframes", where)
        force.position.check()
        times, positions, orientations = force.position.arrays(start)
    else:
        place = body.position if force.position is None else checked_vector(force.position, "position", "m", where)
        turn = start if force.orientation is None else checked_orientation(force.orientation, where)
        times, positions, orientations = np.zeros(1), np.array([place], float), np.array([turn])
    velocity = None if force.velocity is None else checked_vector(force.velocity, "velocity", "m/s", where)
    spin = None if force.angular_velocity is None else checked_vector(force.angular_velocity, "angular_velocity", "rad/s", where)
    most = [
        value if (value := getattr(force, name)) == math.inf else checked_number(value, name, unit, where)
        for name, unit in (("max_force", "N"), ("max_torque", "N m"))
    ]
    if min(most) <= 0.0:
        raise SceneError(f"max_force, max_torque are {most}", "give values > 0, or leave them out", where)
    return Hand(i, times, positions, orientations, velocity, spin, gains, np.array(most, float))


def _check_targets(force: PDController, gains: np.ndarray, turns: bool, where: str) -> None:
    """Refuse targets that no gain pulls to."""
    place = force.position is not None and not (isinstance(force.position, Keyframes) and turns and gains[2:].any())
    needs = (
        ("position", place, gains[:2], "a stiffness"), ("velocity", force.velocity is not None, gains[1:2], "a damping"),
        ("orientation", force.orientation is not None, gains[2:], "an angular_stiffness"),
        ("angular_velocity", force.angular_velocity is not None, gains[3:], "an angular_damping"),
    )  # fmt: skip
    for name, given, gain, remedy in needs:
        if given and not gain.any():
            raise SceneError(f"{name} is given, but nothing pulls to it", f"give {remedy}, or leave the {name} out", where)


class PDForces(ForceTable):
    """Controllers, each on one body."""

    def __init__(self, names: list[str], hands: list[Hand], world: World) -> None:
        """Of k hands."""
        self.kind, self.names = PDController.kind, names
        self.body, self.cause = np.array([hand.body for hand in hands], np.int64), np.arange(len(hands))
        self.links = no_links()
        self.is_steady = all(len(hand.times) == 1 for hand in hands)
        self.reason = f"{len(hands)} acting"
        self._offset, self._turn = world.offset[self.body], world.turn[self.body]
        self._place = np.array([hand.positions[0] for hand in hands])
        self._orientation = np.array([hand.orientations[0] for hand in hands])
        self._keyed = [r for r, hand in enumerate(hands) if len(hand.times) > 1]
        self._hands = hands
        self._velocity, self._has_velocity = _given([hand.velocity for hand in hands])
        self._spin, self._has_spin = _given([hand.angular_velocity for hand in hands])
        self._gains, self._most = np.array([hand.gains for hand in hands]), np.array([hand.most for hand in hands])
        self._breaks = np.unique(np.concatenate([hand.times for hand in hands]))

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force and torque of rows."""
        i, (k, c, k_r, c_r) = self.body[rows], self._gains[rows].T[:, :, None]
        origin, turn, speed, spin = self._aims(at.time, rows)
        arm = rotate(turn, self._offset[rows])
        spin = np.where(self._has_spin[rows], self._spin[rows], spin)
        speed = np.where(self._has_velocity[rows], self._velocity[rows], speed + cross_arrays(spin, arm))
        off = multiply(multiply(turn, self._turn[rows]), conjugate(at.bodies.orientation[i]))
        force = k * (origin + arm - at.bodies.position[i]) + c * (speed - at.bodies.velocity[i])
        torque = k_r * rotation_vector(off) + c_r * (spin - at.bodies.angular_velocity[i])
        return np.hstack([_limited(force, self._most[rows, 0]), _limited(torque, self._most[rows, 1])])

    def _aims(self, time: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Origins, orientations, velocities of the origins and spins of the poses wished for; time (n,) s of the bodies."""
        origin, turn = self._place[rows], self._orientation[rows]
        speed, spin = np.zeros_like(origin), np.zeros_like(origin)
        for r in self._keyed:
            for m in np.flatnonzero(rows == r):
                origin[m], turn[m], speed[m], spin[m] = _aim(self._hands[r], float(time[self.body[r]]))
        return origin, turn, speed, spin

    def next_break(self, time: float) -> float:
        """Next key."""
        k = int(np.searchsorted(self._breaks, time, side="right"))
        return float(self._breaks[k]) if k < len(self._breaks) else np.inf


def _given(vectors: list[np.ndarray | None]) -> tuple[np.ndarray, np.ndarray]:
    """Vectors (k, 3), 0 for those that are None, and which are not, (k, 1)."""
    return np.array([np.zeros(3) if v is None else v for v in vectors]), np.array([[v is not None] for v in vectors])


def _limited(vectors: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Vectors (k, 3), those longer than most (k,) shortened to it."""
    length = np.linalg.norm(vectors, axis=1)
    share = np.divide(most, length, out=np.ones_like(length), where=length > most)
    return share[:, None] * vectors


def _aim(hand: Hand, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Origin, orientation, velocity of the origin and spin of the pose wished for."""
    still = np.zeros(3)
    if time <= hand.times[0]:
        return hand.positions[0], hand.orientations[0], still, still
    if time >= hand.times[-1]:
        return hand.positions[-1], hand.orientations[-1], still, still
    j = int(np.searchsorted(hand.times, time, side="right")) - 1
    span = hand.times[j + 1] - hand.times[j]
    share = (time - hand.times[j]) / span
    whole = rotation_vector(multiply(hand.orientations[j + 1], conjugate(hand.orientations[j])))
    place = hand.positions[j] + share * (hand.positions[j + 1] - hand.positions[j])
    turn = multiply(quaternion_from_rotation_vector(share * whole), hand.orientations[j])
    return place, turn, (hand.positions[j + 1] - hand.positions[j]) / span, whole / span
