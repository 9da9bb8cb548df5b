"""A joint of six axes, made of limits and drives: what other joints are made of, and all that glTF's physics asks of joints.

The joint has a frame (x, y, z) on each of its bodies. A limit keeps one quantity between bounds, by how many axes it
names, with d the offset of b's anchor from a's, and (k, l, m) cyclic:

    translation   1 axis k    d along k                                    m, signed
                  2 axes l m  distance from the line of k                  m, >= 0
                  3 axes      distance of the anchors                      m, >= 0
    rotation      1 axis k    twist about k (`joint_rows`)                 rad, signed, counted through full turns
                  2 axes l m  angle between the two k axes: a cone         rad, 0 to pi
                  3 axes      angle of the whole rotation                  rad, 0 to pi

Axes of a are the reference. An axis that no limit names is free. Axes that are locked (lower = upper = 0) are held all
together, however many limits say so: one rotation by its twist, two like a hinge, three like a fixed joint.
Meaning of limits and drives: KHR_physics_rigid_bodies (draft of the Khronos group, 2024).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.numeric import check_numbers, numbers_of
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.scene.body import vector
from rigidimpulse.scene.joint import HARD, Anchors, Joint, Motor, PlacedBodies, Row, across, bounds
from rigidimpulse.scene.joint_coordinates import ABOUT, ALONG, ANGLE, DISTANCE, RADIUS, SWING, TWIST

AXES = "xyz"
ORTHONORMAL = TOLERANCES.joint.orthonormal_axes


def _axes(translation: str, rotation: str, owner: str) -> tuple[bool, tuple[int, ...]]:
    """Whether it is a translation, and its axes in order."""
    given = translation or rotation
    if not isinstance(given, str) or bool(translation) == bool(rotation) or len(set(given)) != len(given) or not set(given) <= set(AXES):
        raise SceneError(
            f"translation is {translation!r}, rotation is {rotation!r}", "give one of them, as some of the letters x, y, z", owner
        )
    return bool(translation), tuple(sorted(AXES.index(letter) for letter in given))


@dataclass(frozen=True)
class Limit:
    """Bounds of one, two or three axes of a `SixAxisJoint` together; see the head of the module for what they bound.

    Attributes:
        translation: axes along which, some of the letters "xyz"; or
        rotation: axes about which.
        lower, upper: m or rad; None is no bound. Of two or three axes lower <= 0 is no bound, and upper = 0 locks.
        stiffness: N/m or N m/rad beyond the bound; None is hard: the bodies stop there, without rebound.
        damping: N s/m or N m s/rad beyond the bound. A soft limit only ever pushes back.

    """

    translation: str = ""
    rotation: str = ""
    _: KW_ONLY
    lower: float | None = None
    upper: float | None = None
    stiffness: float | None = None
    damping: float = 0.0

    def parts(self) -> tuple[bool, tuple[int, ...], bool]:
        """Whether it is a translation, its axes, and whether it locks them.

        Raises:
            SceneError: bad axes, bounds or softness.

        """
        linear, axes = _axes(self.translation, self.rotation, "limit")
        check_numbers(self, "damping", optional=("lower", "upper", "stiffness"))
        stiffness = 0.0 if self.stiffness is None else self.stiffness
        if not (0.0 <= stiffness < math.inf and 0.0 <= self.damping < math.inf):
            raise SceneError(f"stiffness {self.stiffness}, damping {self.damping}", "give finite values >= 0", "limit")
        if self.stiffness is None and self.damping != 0.0:
            raise SceneError(f"damping = {self.damping} without stiffness", "give a stiffness too", "limit")
        if len(axes) > 1 and self.upper is not None and self.upper < 0.0:
            raise SceneError(f"upper = {self.upper} of {len(axes)} axes together", "give a value >= 0", "limit")
        lower = 0.0 if len(axes) > 1 and (self.lower is None or self.lower < 0.0) else self.lower
        return linear, axes, lower == 0.0 and self.upper == 0.0

    def rows(self) -> list[Row]:
        """Rows of a limit that does not lock hard."""
        linear, axes, locks = self.parts()
        stiffness, damping = HARD if self.stiffness is None else float(self.stiffness), float(self.damping)
        if locks:
            return [Row(code, stiffness=stiffness, damping=damping) for code in _fixed(linear, axes)]
        others = [k for k in range(3) if k not in axes]
        if len(axes) == 1:
            code = (ALONG if linear else TWIST) + axes[0]
        elif len(axes) == 2:
            code = (RADIUS if linear else SWING) + others[0]
        else:
            code = DISTANCE if linear else ANGLE
        if self.lower is not None and self.lower == self.upper:
            return [Row(code, float(self.lower), stiffness=stiffness, damping=damping)]
        lower = None if len(axes) > 1 and self.lower is not None and self.lower <= 0.0 else self.lower
        return bounds(code, lower, self.upper, stiffness, damping)


@dataclass(frozen=True)
class Drive(Motor):
    """A `Motor` of one axis of a `SixAxisJoint`: along it (`translation`) or about it (`rotation`, the twist), "x", "y" or "z"."""

    translation: str = ""
    rotation: str = ""

    def axis_rows(self) -> list[Row]:
        """Return the row of the drive."""
        linear, axes = _axes(self.translation, self.rotation, "drive")
        if len(axes) != 1:
            raise SceneError(f"axes {self.translation or self.rotation!r}", "give one axis a drive", "drive")
        return self.rows((ALONG if linear else TWIST) + axes[0])


def _fixed(linear: bool, axes: Sequence[int]) -> list[int]:
    """Coordinates that are zero where the axes are locked."""
    if linear:
        return [ALONG + k for k in axes]
    if len(axes) == 3:
        return [ABOUT + k for k in axes]
    return across(3 - sum(axes)) if len(axes) == 2 else [TWIST + axes[0]]


def _frame(axes: ArrayLike, name: str) -> np.ndarray:
    """Columns (3, 3) of the given directions of x, y, z (rows), made orthonormal to round-off."""
    given = numbers_of(axes)
    if given.shape != (3, 3) or not np.abs(given @ given.T - np.eye(3)).max() <= ORTHONORMAL or np.linalg.det(given) < 0.0:
        raise SceneError(f"{name} is {axes!r}", "give the directions of x, y and z: three unit vectors, a right-handed frame")
    u, _, v = np.linalg.svd(given)
    return (u @ v).T


@dataclass(frozen=True, eq=False)
class SixAxisJoint(Joint):
    """Two bodies joined by limits and drives on the axes of a frame.

    Attributes:
        anchor: (3,) m, origin of the frame on a, in the world at the start. anchor_b: on b, the same by default.
        axes: (3, 3), rows are the directions of x, y, z of the frame on a, in the world at the start. axes_b: on b.
        limits, drives: see `Limit`, `Drive`. Axes without any are free and cost nothing.

    Where the two frames differ at the start the joint is closed before the first step, by position.
    `stiffness` and `damping` make all its hard rows soft; bounds are given by limits, not by `lower` and `upper`.

    Raises:
        SceneError: when the scene is compiled, for bad axes, bounds or softness; names the joint.

    """

    anchor: ArrayLike
    axes: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    limits: Sequence[Limit] = ()
    drives: Sequence[Drive] = ()
    anchor_b: ArrayLike | None = None
    axes_b: ArrayLike | None = None

    def points(self, _world: PlacedBodies) -> Anchors:
        """See `Joint`."""
        anchor = vector(self.anchor, "anchor", "m")
        anchor_b = anchor if self.anchor_b is None else vector(self.anchor_b, "anchor_b", "m")
        return anchor, anchor_b, np.array([1.0, 0.0, 0.0])

    def frames(self, _axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Joint`."""
        frame = _frame(self.axes, "axes")
        return frame, frame if self.axes_b is None else _frame(self.axes_b, "axes_b")

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        if self.lower is not None or self.upper is not None:
            raise SceneError("lower and upper", "give them to a Limit of the axes they bound")
        for name, kind in (("limits", Limit), ("drives", Drive)):
            given = getattr(self, name)
            if not isinstance(given, Sequence) or not all(isinstance(one, kind) for one in given):
                raise SceneError(f"{name} = {given!r}", f"give a list of ri.{kind.__name__}")
        locked: dict[bool, set[int]] = {True: set(), False: set()}
        rows = []
        for limit in self.limits:
            linear, axes, locks = limit.parts()
            if locks and limit.stiffness is None:
                locked[linear].update(axes)
            else:
                rows += limit.rows()
        fixed = [Row(code) for linear, axes in locked.items() if axes for code in _fixed(linear, sorted(axes))]
        return fixed + rows + [row for drive in self.drives for row in drive.axis_rows()]
