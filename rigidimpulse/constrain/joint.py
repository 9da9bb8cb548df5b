"""Joints as people write them, and the table that the kernels read.

Anchors and axes are given in world coordinates at the start. A joint's frame has its first axis along `axis`. What a
joint does is a list of `Row`s: coordinates (see `joint_rows`) with a target, bounds, and a stiffness.
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.body import vector
from rigidimpulse.constrain.joint_rows import ABOUT, ACROSS, ALONG, DISTANCE, SWING, TWIST, Joints
from rigidimpulse.errors import SceneError, unknown_name
from rigidimpulse.plan import Skip
from rigidimpulse.rotation import to_matrix

HARD = math.inf


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

    """

    velocity: float = 0.0
    target: float = 0.0
    _: KW_ONLY
    stiffness: float = 0.0
    damping: float = 0.0
    max_force: float = math.inf

    def rows(self, coordinate: int) -> list[Row]:
        """Return the row of the drive."""
        if not (self.stiffness > 0.0 or self.damping > 0.0):
            raise SceneError("the motor has neither stiffness nor damping", "give one of them, > 0", "motor")
        bound = abs(self.max_force)
        return [Row(coordinate, self.target, -bound, bound, self.stiffness, self.damping, self.velocity)]


@dataclass(frozen=True, eq=False)
class Joint:
    """Base of all joints: `a` and `b` are names of bodies, None is the world.

    Attributes:
        name: what `run.reaction` calls it; "joint0", "joint1", ... if not given.
        lower, upper: bounds of the joint's free coordinate: rad for a hinge (turn of b against a about the axis, right
            hand), m for a slider (way of b along the axis) and for a distance; upper alone for a ball joint (angle
            between the two axes, rad).
        stiffness, damping: make the joint soft: N/m and N s/m along, N m/rad and N m s/rad about its axes.
        break_force: N, the joint is gone when its force exceeds it.
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
    collide: bool = False
    stage: ClassVar[str] = "constrain"

    def bind(self, _world) -> Skip:
        """Joints are rows of the stage constrain, not stages of their own."""
        return Skip("a joint; see joint forces")

    def points(self, _world) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Anchor on a, anchor on b and first axis, (3,) each, in the world at the start."""
        raise NotImplementedError

    def rows(self, _distance: float) -> list[Row]:
        """Rows of the joint, hard; `_distance` m is that of its anchors at the start."""
        raise NotImplementedError

    def limits(self, coordinate: int) -> list[Row]:
        """Rows that keep a coordinate between the bounds."""
        if self.lower is not None and self.upper is not None and self.lower > self.upper:
            raise SceneError(f"lower = {self.lower} is above upper = {self.upper}", "exchange them", self.label)
        rows = []
        if self.lower is not None:
            rows.append(Row(coordinate, float(self.lower), lower=0.0))
        if self.upper is not None:
            rows.append(Row(coordinate, float(self.upper), upper=0.0))
        return rows

    @property
    def label(self) -> str:
        """What errors call it."""
        return f"{type(self).__name__} {self.name!r}" if self.name else f"{type(self).__name__}({self.a!r}, {self.b!r})"


@dataclass(frozen=True, eq=False)
class _AnchoredJoint(Joint):
    """A joint with one point and one axis."""

    anchor: ArrayLike
    axis: ArrayLike

    def points(self, _world):
        """See `Joint`."""
        anchor = vector(self.anchor, "anchor", "m")
        return anchor, anchor, vector(self.axis, "axis", "")


@dataclass(frozen=True, eq=False)
class BallJoint(_AnchoredJoint):
    """Two bodies share the point `anchor`; `upper` bounds the angle between the axes (at the start both `axis`)."""

    axis: ArrayLike = (0.0, 0.0, 1.0)

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        if self.lower is not None:
            raise SceneError(f"lower = {self.lower}", "a ball joint has only an upper bound", self.label)
        return [Row(ALONG), Row(ALONG + 1), Row(ALONG + 2), *self.limits(SWING)]


@dataclass(frozen=True, eq=False)
class HingeJoint(_AnchoredJoint):
    """The bodies turn against each other about `axis` through `anchor`."""

    motor: Motor | None = None

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        held = [Row(ALONG), Row(ALONG + 1), Row(ALONG + 2), Row(ACROSS + 1), Row(ACROSS + 2)]
        return held + self.limits(TWIST) + (self.motor.rows(TWIST) if self.motor else [])


@dataclass(frozen=True, eq=False)
class SliderJoint(_AnchoredJoint):
    """The bodies shift against each other along `axis`; they do not turn."""

    motor: Motor | None = None

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        held = [Row(ALONG + 1), Row(ALONG + 2), Row(ABOUT), Row(ABOUT + 1), Row(ABOUT + 2)]
        return held + self.limits(ALONG) + (self.motor.rows(ALONG) if self.motor else [])


@dataclass(frozen=True, eq=False)
class FixedJoint(Joint):
    """The bodies keep the pose they have to each other at the start."""

    anchor: ArrayLike | None = None

    def points(self, world):
        """See `Joint`."""
        if self.anchor is not None:
            anchor = vector(self.anchor, "anchor", "m")
        else:
            anchor = world.position[world.names.index(self.b if self.b is not None else self.a)]
        return anchor, anchor, np.array([0.0, 0.0, 1.0])

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        return [Row(code + k) for code in (ALONG, ABOUT) for k in range(3)]


@dataclass(frozen=True, eq=False)
class DistanceJoint(Joint):
    """Two points keep their distance `length` (that at the start by default); with bounds it is a rope or a strut."""

    anchor_a: ArrayLike
    anchor_b: ArrayLike
    length: float | None = None

    def points(self, _world):
        """See `Joint`."""
        return vector(self.anchor_a, "anchor_a", "m"), vector(self.anchor_b, "anchor_b", "m"), np.array([0.0, 0.0, 1.0])

    def rows(self, distance: float) -> list[Row]:
        """See `Joint`."""
        limits = self.limits(DISTANCE)
        length = distance if self.length is None else float(self.length)
        if not (math.isfinite(length) and length > 0.0):
            raise SceneError(f"length is {length} m", "give a length > 0, or two different anchors", self.label)
        return limits if limits and self.length is None else [Row(DISTANCE, length), *limits]


def _frame(axis: np.ndarray, label: str) -> np.ndarray:
    """Right-handed axes (3, 3) in columns, the first one along `axis`."""
    size = float(np.linalg.norm(axis))
    if size == 0.0:
        raise SceneError("the axis is (0, 0, 0)", "give a direction", label)
    first = axis / size
    second = np.cross(first, np.eye(3)[int(np.argmin(np.abs(first)))])
    second /= np.linalg.norm(second)
    return np.column_stack([first, second, np.cross(first, second)])


def _soften(joint: Joint, rows: list[Row]) -> list[Row]:
    """The rows with the joint's stiffness and damping; drives keep their own."""
    if joint.stiffness is None:
        if joint.damping != 0.0:
            raise SceneError(f"damping = {joint.damping} without stiffness", "give a stiffness too", joint.label)
        return rows
    stiffness = float(joint.stiffness)
    if not (math.isfinite(stiffness) and stiffness >= 0.0 and math.isfinite(joint.damping) and joint.damping >= 0.0):
        raise SceneError(f"stiffness {joint.stiffness}, damping {joint.damping}", "give finite values >= 0", joint.label)
    return [
        Row(r.coordinate, r.target, r.lower, r.upper, stiffness, float(joint.damping)) if r.stiffness == HARD else r
        for r in rows
    ]


def compile_joints(joints: list[Joint], world) -> Joints:
    """The table of joints of a world whose bodies are compiled.

    Raises:
        SceneError: unknown bodies, bad values; names the joint.

    """
    columns: dict[str, list] = {field: [] for field in Joints._fields}
    columns["first"].append(0)
    for joint in joints:
        sides = [_side(joint, world, name) for name in (joint.a, joint.b)]
        if sides[0][0] == sides[1][0]:
            raise SceneError(f"it joins {joint.a!r} to itself", "name two different bodies", joint.label)
        if not any(i >= 0 and world.dynamic[i] for i, _, _ in sides):
            raise SceneError("neither body is dynamic", "join at least one that moves", joint.label)
        try:
            anchor_a, anchor_b, axis = joint.points(world)
        except SceneError as error:
            raise error.within(joint.label) from None
        frame = _frame(axis, joint.label)
        for side, anchor, (i, turn, origin) in zip("ab", (anchor_a, anchor_b), sides, strict=True):
            columns[f"body_{side}"].append(i)
            columns[f"anchor_{side}"].append(turn.T @ (anchor - origin))
            columns[f"frame_{side}"].append(turn.T @ frame)
        rows = _soften(joint, joint.rows(float(np.linalg.norm(anchor_b - anchor_a))))
        for row in rows:
            for field in ("coordinate", "target", "lower", "upper", "stiffness", "damping", "rate"):
                columns[field].append(getattr(row, field))
        columns["first"].append(columns["first"][-1] + len(rows))
    integers = ("body_a", "body_b", "first", "coordinate")
    arrays = (np.array(columns[f], np.int64 if f in integers else float) for f in Joints._fields)
    return Joints(*(np.ascontiguousarray(array) for array in arrays))


def _side(joint: Joint, world, name: str | None) -> tuple[int, np.ndarray, np.ndarray]:
    """Index, rotation (3, 3) and position (3,) of one side's principal frame at the start."""
    if name is None:
        return -1, np.eye(3), np.zeros(3)
    if name not in world.names:
        raise unknown_name("body", name, world.names, joint.label)
    i = world.names.index(name)
    return i, to_matrix(world.orientation[i]), world.position[i]
