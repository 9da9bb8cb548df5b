"""Joints as people write them.

Anchors and axes are given in world coordinates at the start. A joint's frame has its first axis along `axis`. What a
joint does is a list of `Row`s: coordinates (see `joint_coordinates`) with a target, bounds, and a stiffness.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.numeric import check_numbers, number_of
from rigidimpulse.core.portable import length
from rigidimpulse.scene.body import vector
from rigidimpulse.scene.effect import SceneEffect
from rigidimpulse.scene.joint_coordinates import ABOUT, ACROSS, ALONG, DISTANCE, SWING, TWIST

HARD = math.inf
Anchors = tuple[np.ndarray, np.ndarray, np.ndarray]


class PlacedBodies(Protocol):
    """Where the bodies of a scene are at the start; a `World` is one."""

    @property
    def names(self) -> Sequence[str]:
        """Names in order of index."""
        ...

    @property
    def position(self) -> np.ndarray:
        """(n, 3) m, centres of mass."""
        ...


@dataclass(frozen=True)
class Row:
    """One coordinate of a joint: where it shall be, what it may exert (N or N m), hard or as a spring and damper."""

    coordinate: int
    target: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf
    stiffness: float = HARD
    damping: float = 0.0
    rate: float = 0.0
    per_mass: bool = False


@dataclass(frozen=True)
class Motor:
    """A drive of a hinge or slider: a spring and damper with a moving aim, and a greatest force.

    Torque or force = stiffness (target - x) + damping (velocity - x'), kept within +- max_force. It is implicit: any
    stiffness and damping is stable at any step.

    Attributes:
        velocity: rad/s or m/s that the damping strives for.
        target: rad or m that the stiffness strives for.
        stiffness: N m/rad or N/m. damping: N m s/rad or N s/m.
        max_force: N m or N.
        mode: "force", or "acceleration": stiffness [1/s2] and damping [1/s] give the acceleration of x, whatever mass
            and inertia the two bodies oppose to it through this joint.

    """

    velocity: float = 0.0
    target: float = 0.0
    _: KW_ONLY
    stiffness: float = 0.0
    damping: float = 0.0
    max_force: float = math.inf
    mode: str = "force"

    def rows(self, coordinate: int) -> list[Row]:
        """Return the row of the drive."""
        check_numbers(self, "velocity", "target", "stiffness", "damping", "max_force")
        if not (self.stiffness > 0.0 or self.damping > 0.0):
            raise SceneError("the motor has neither stiffness nor damping", "give one of them, > 0", "motor")
        if self.mode not in ("force", "acceleration"):
            raise SceneError(f"mode is {self.mode!r}", "give 'force' or 'acceleration'", "motor")
        bound, per_mass = abs(self.max_force), self.mode == "acceleration"
        return [Row(coordinate, self.target, -bound, bound, self.stiffness, self.damping, self.velocity, per_mass)]


def bounds(coordinate: int, lower: float | None, upper: float | None, stiffness: float = HARD, damping: float = 0.0) -> list[Row]:
    """Rows that keep a coordinate between lower and upper, hard or with the stiffness and damping of a soft row.

    Raises:
        SceneError: lower is above upper.

    """
    if lower is not None and upper is not None and lower > upper:
        raise SceneError(f"lower = {lower} is above upper = {upper}", "exchange them")
    rows = []
    if lower is not None and lower > -math.inf:
        rows.append(Row(coordinate, float(lower), 0.0, math.inf, stiffness, damping))
    if upper is not None and upper < math.inf:
        rows.append(Row(coordinate, float(upper), -math.inf, 0.0, stiffness, damping))
    return rows


@dataclass(frozen=True, eq=False)
class Joint(SceneEffect, ABC):
    """Base of all joints: `a` and `b` are names of bodies, None is the world.

    Attributes:
        name: what `run.reaction` calls it; "joint0", "joint1", ... if not given.
        lower, upper: bounds of the joint's free coordinate: rad for a hinge (turn of b against a about the axis, right
            hand), m for a slider (way of b along the axis) and for a distance; upper alone for a ball joint (angle
            between the two axes, rad).
        stiffness, damping: make the joint soft: N/m and N s/m along, N m/rad and N m s/rad about its axes.
        break_force: N, the joint is gone when its force exceeds it. release_time: s, when it lets go: of a stage, of a bomb.
        collide: whether the two bodies touch each other.

    """

    a: str | None
    b: str | None
    _: KW_ONLY
    name: str | None = None
    lower: float | None = None
    upper: float | None = None
    stiffness: float | None = None
    damping: float = 0.0
    break_force: float = math.inf
    release_time: float = math.inf
    collide: bool = False
    stage: ClassVar[str] = "constrain"

    def check(self) -> None:
        """Raise a `SceneError` for values that are not of their kind, and for what cannot end the joint."""
        check_numbers(self, "damping", "break_force", "release_time", optional=("lower", "upper", "stiffness"))
        if not isinstance(self.collide, bool | np.bool_):
            raise SceneError(f"collide = {self.collide!r}", "give True or False")
        if not self.break_force > 0.0:
            raise SceneError(f"break_force = {self.break_force}", "give a force in N, > 0, or leave it out")
        if not self.release_time >= 0.0:
            raise SceneError(f"release_time = {self.release_time}", "give a time in s, >= 0, or leave it out")

    @abstractmethod
    def points(self, world: PlacedBodies) -> Anchors:
        """Anchor on a, anchor on b and first axis, (3,) each, in the world at the start."""

    def frames(self, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Axes of the joint's frame on a and on b (3, 3), in columns, in the world at the start."""
        frame = _frame(axis)
        return frame, frame

    @abstractmethod
    def rows(self, distance: float) -> list[Row]:
        """Rows of the joint, hard; `distance` m is that of its anchors at the start."""

    @property
    def label(self) -> str:
        """What errors call it."""
        return f"{type(self).__name__} {self.name!r}" if self.name else f"{type(self).__name__}({self.a!r}, {self.b!r})"


@dataclass(frozen=True, eq=False)
class _AnchoredJoint(Joint):
    """A joint with one point and one axis."""

    anchor: ArrayLike
    axis: ArrayLike

    def points(self, _world: PlacedBodies) -> Anchors:
        """See `Joint`."""
        anchor = vector(self.anchor, "anchor", "m")
        return anchor, anchor, vector(self.axis, "axis", "")


@dataclass(frozen=True, eq=False)
class BallJoint(_AnchoredJoint):
    """Two bodies share the point `anchor`: a shoulder, a trailer hitch, a pendulum that swings to all sides.

    Attributes:
        anchor: (3,) m, in the world, as the scene starts.
        axis: (3,), of any length: the direction from which each body's turn is measured, in the world, as the scene starts.
        upper: rad, greatest angle between the axes of the two bodies. Without it they turn freely.
        The others: see `Joint`.

    """

    axis: ArrayLike = (0.0, 0.0, 1.0)

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        if self.lower is not None:
            raise SceneError(f"lower = {self.lower}", "a ball joint has only an upper bound")
        return [Row(ALONG), Row(ALONG + 1), Row(ALONG + 2), *bounds(SWING, self.lower, self.upper)]


def across(axis: int) -> list[int]:
    """Coordinates whose rows leave free the turn about one axis only."""
    return [ACROSS + 3 * axis + (axis + 1) % 3, ACROSS + 3 * axis + (axis + 2) % 3]


@dataclass(frozen=True, eq=False)
class HingeJoint(_AnchoredJoint):
    """The bodies turn against each other about `axis` through `anchor`: a door, a wheel, an elbow.

    Attributes:
        anchor: (3,) m, a point on the axis. axis: (3,), of any length. Both in the world, as the scene starts.
        lower, upper: rad, bounds of the turn of b against a, by the right hand about the axis; it is 0 as the scene starts.
        motor: drives the turn, see `Motor`.
        The others: see `Joint`.

    """

    motor: Motor | None = None

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        fixed = [Row(ALONG), Row(ALONG + 1), Row(ALONG + 2), *(Row(code) for code in across(0))]
        return fixed + bounds(TWIST, self.lower, self.upper) + (self.motor.rows(TWIST) if self.motor else [])


@dataclass(frozen=True, eq=False)
class SliderJoint(_AnchoredJoint):
    """The bodies shift against each other along `axis` and do not turn: a drawer, a piston, a sliding door.

    Attributes:
        anchor: (3,) m, where the force acts. axis: (3,), of any length. Both in the world, as the scene starts.
        lower, upper: m, bounds of the way of b along the axis; it is 0 as the scene starts.
        motor: drives the shift, see `Motor`.
        The others: see `Joint`.

    """

    motor: Motor | None = None

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        fixed = [Row(ALONG + 1), Row(ALONG + 2), Row(ABOUT), Row(ABOUT + 1), Row(ABOUT + 2)]
        return fixed + bounds(ALONG, self.lower, self.upper) + (self.motor.rows(ALONG) if self.motor else [])


@dataclass(frozen=True, eq=False)
class FixedJoint(Joint):
    """The bodies keep the pose they have to each other as the scene starts: a weld, with `break_force` one that breaks.

    Attributes:
        anchor: (3,) m, where the force acts, in the world, as the scene starts; by default the centre of mass of b (of a, if b is None).
        The others: see `Joint`; there is nothing that lower and upper could bound.

    """

    anchor: ArrayLike | None = None

    def points(self, world: PlacedBodies) -> Anchors:
        """See `Joint`."""
        if self.anchor is not None:
            anchor = vector(self.anchor, "anchor", "m")
        else:
            anchor = world.position[world.names.index(self.b if self.b is not None else self.a)]
        return anchor, anchor, np.array([0.0, 0.0, 1.0])

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        for name, value in (("lower", self.lower), ("upper", self.upper)):
            if value is not None:
                raise SceneError(f"{name} = {value}", "a fixed joint leaves no motion to bound: leave it out, or use a hinge or a slider")
        return [Row(code + k) for code in (ALONG, ABOUT) for k in range(3)]


@dataclass(frozen=True, eq=False)
class DistanceJoint(Joint):
    """Two points keep their distance: a rod; with bounds a rope or a strut.

    Attributes:
        anchor_a, anchor_b: (3,) m, a point of each body, in the world, as the scene starts.
        length: m, > 0; by default that as the scene starts. With bounds alone the distance is free between them.
        lower, upper: m, bounds of the distance: `upper` alone is a rope.
        The others: see `Joint`.

    """

    anchor_a: ArrayLike
    anchor_b: ArrayLike
    length: float | None = None

    def points(self, _world: PlacedBodies) -> Anchors:
        """See `Joint`."""
        return vector(self.anchor_a, "anchor_a", "m"), vector(self.anchor_b, "anchor_b", "m"), np.array([0.0, 0.0, 1.0])

    def rows(self, distance: float) -> list[Row]:
        """See `Joint`."""
        limits = bounds(DISTANCE, self.lower, self.upper)
        length = distance if self.length is None else number_of(self.length)
        if not (math.isfinite(length) and length > 0.0):
            given = distance if self.length is None else self.length
            raise SceneError(f"length is {given!r} m", "give a length > 0, or two different anchors")
        return limits if limits and self.length is None else [Row(DISTANCE, length), *limits]


def _frame(axis: np.ndarray) -> np.ndarray:
    """Right-handed axes (3, 3) in columns, the first one along `axis`."""
    size = float(length(axis))
    if size == 0.0:
        raise SceneError("the axis is (0, 0, 0)", "give a direction")
    first = axis / size
    second = np.cross(first, np.eye(3)[int(np.argmin(np.abs(first)))])
    second /= length(second)
    return np.column_stack([first, second, np.cross(first, second)])
