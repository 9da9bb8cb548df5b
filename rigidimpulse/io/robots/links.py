"""Links of robots as bodies, and their joints: what URDF and MJCF have in common.

A joint of one axis has the frame whose x is that axis. Beside its bounds it may have

    spring and damper    torque or force = k (x_0 - x) - d x'
    dry friction         -f sign(x'): a damper of f / v_0, at most f, with v_0 = `CREEP`: below that speed it gives way

which are drives. A link is what the file calls so; those without mass that are fixed to another one are parts of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from rigidimpulse.core.quaternion import multiply, rotate
from rigidimpulse.io.inertia import with_possible_inertia
from rigidimpulse.io.looks import Look, colliders_as_looks, visual_of
from rigidimpulse.io.pieces import GHOST, Piece, Weight, fill_mass, joined
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.collision_filter import CollisionFilter
from rigidimpulse.scene.joint_six_axis import Drive, Limit, SixAxisJoint

CREEP = 1e-4
"""rad/s or m/s, speed below which dry friction of joints gives way in proportion."""
LEAST_MASS = 1e-3
"""kg, of links that move and have neither mass nor shape."""


@dataclass
class Link:
    """A link: name, pose in the world at the start, colliders in its frame, and its mass properties where they are given.

    motion, gravity_factor: as of `Body`. is_between: whether it stands for nothing in the file. looks: what is seen of it; none: its
    colliders.
    """

    name: str
    position: np.ndarray
    orientation: np.ndarray
    pieces: list[Piece] = field(default_factory=list)
    weight: Weight | None = None
    motion: Literal["dynamic", "kinematic", "static"] = "dynamic"
    gravity_factor: float = 1.0
    is_between: bool = False
    looks: list[Look] = field(default_factory=list)

    def take(self, other: Link) -> None:
        """Make the colliders and the looks of another link parts of this one."""
        if self.looks or other.looks:
            # Of one of them that says nothing its colliders are seen.
            self.looks, other.looks = self.looks or colliders_as_looks(self.pieces), other.looks or colliders_as_looks(other.pieces)
        back = self.orientation * [1.0, -1.0, -1.0, -1.0]
        way, turn = rotate(back, other.position - self.position), multiply(back, other.orientation)
        for mine, its in ((self.pieces, other.pieces), (self.looks, other.looks)):
            mine += [
                each._replace(position=way + rotate(turn, each.position), orientation=multiply(turn, each.orientation)) for each in its
            ]  # fmt: skip

    def body(self, filter_: CollisionFilter | None, notes: list[str]) -> Body:
        """Return the body of the link; notes: lines of the report."""
        pieces = self.pieces
        if not pieces:
            pieces, filter_ = [GHOST], GHOST.collision_filter
            if self.motion == "dynamic" and not self.is_between:
                notes.append(f"link {self.name!r} has no collider: it touches nothing")
        if any(piece.material != pieces[0].material for piece in pieces):
            notes.append(f"link {self.name!r} has colliders of several materials: that of the first counts")
        shape, values = joined(pieces), {}
        if self.motion == "dynamic":
            values = self._mass(notes)
            fill_mass(self.name, shape, values, notes)
        made = Body(
            self.name, shape, motion=self.motion, position=self.position, orientation=self.orientation, material=pieces[0].material,
            gravity_factor=self.gravity_factor, collision_filter=filter_, visual=visual_of(self.looks, pieces), **values,
        )  # fmt: skip
        return with_possible_inertia(made, notes)

    def _mass(self, notes: list[str]) -> dict[str, Any]:
        """Return mass properties as far as they are given."""
        if self.weight is not None:
            return self.weight._asdict()
        if self.pieces:
            notes.append(f"link {self.name!r} moves and has no mass: its shape has 1,000 kg/m^3")
            return {}
        notes.append(f"link {self.name!r} moves and has neither mass nor shape: it has {LEAST_MASS:g} kg")
        return {"mass": LEAST_MASS, "center_of_mass": np.zeros(3), "inertia": np.full(3, LEAST_MASS * GHOST.shape.radius**2)}


def carried(carrier: Mapping[str, str | None]) -> list[str]:
    """Return lines about links that are no bodies; carrier: the body of each link by name, None for the world."""
    lines = [f"link {name!r} is part of {other!r}, to which it is fixed" for name, other in carrier.items() if other not in (name, None)]
    return lines + [f"link {name!r} stands and has no shape: it is no body" for name, other in carrier.items() if other is None]


def axis_frame(axis: np.ndarray) -> np.ndarray:
    """Return a right-handed frame (3, 3), in rows, whose x is along a unit vector (3,)."""
    second = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    second /= np.linalg.norm(second)
    return np.array([axis, second, np.cross(axis, second)])


def axis_limits(linear: bool, lower: float | None, upper: float | None) -> list[Limit]:
    """Return the limits of a joint that moves along (`linear`) or about its x axis, between bounds in m or rad."""
    if linear:
        held = [Limit("yz", lower=0.0, upper=0.0), Limit(rotation="xyz", lower=0.0, upper=0.0)]
    else:
        held = [Limit("xyz", lower=0.0, upper=0.0), Limit(rotation="yz", lower=0.0, upper=0.0)]
    if lower is None and upper is None:
        return held
    return [*held, Limit("x" if linear else "", "" if linear else "x", lower=lower, upper=upper)]


def axis_drives(
    linear: bool, damping: float, friction: float, stiffness: float = 0.0, rest: float = 0.0, axis: str = "x"
) -> list[Drive]:
    """Return spring and damper and dry friction of a joint along or about an axis of its frame.

    Args:
        linear: whether along. damping: N s/m or N m s/rad. friction: N or N m. stiffness: N/m or N m/rad. rest: m or rad.
        axis: "x", "y" or "z".

    """
    along, about = (axis, "") if linear else ("", axis)
    drives = []
    if damping > 0.0 or stiffness > 0.0:
        drives.append(Drive(0.0, rest, stiffness=stiffness, damping=damping, translation=along, rotation=about))
    if friction > 0.0:
        drives.append(Drive(damping=friction / CREEP, max_force=friction, translation=along, rotation=about))
    return drives


def fixed(a: str | None, b: str, anchor: np.ndarray, name: str) -> SixAxisJoint:
    """Return the joint that holds b to a as they are."""
    held = [Limit("xyz", lower=0.0, upper=0.0), Limit(rotation="xyz", lower=0.0, upper=0.0)]
    return SixAxisJoint(a, b, anchor=anchor, limits=held, name=name)


def filters(names: Iterable[str], apart: Iterable[tuple[str, str]]) -> Mapping[str, CollisionFilter | None]:
    """Return the collision filter of each body, None where it meets all; apart: pairs of names that do not meet."""
    barred: dict[str, list[str]] = {}
    for a, b in dict.fromkeys(tuple(sorted(pair)) for pair in apart):
        barred.setdefault(a, []).append(b)
        barred.setdefault(b, []).append(a)
    return {
        name: CollisionFilter([name], not_collide_with=barred[name]) if name in barred else None for name in names
    }  # fmt: skip
