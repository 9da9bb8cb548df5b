"""Joints of UsdPhysics as `SixAxisJoint`s: a is body0, b is body1, and each has the joint's frame by localPos and localRot.

    fixed       all locked                         revolute    all but the turn about the axis locked
    prismatic   all but the way along it locked    spherical   the three translations locked, a cone about the axis
    distance    bounds of the distance of the two anchors
    D6          limits of transX to rotZ: low above high locks, what has no limit is free; two turns with the same even limits
                are a cone about the third axis
    drive       torque or force = stiffness (target - x) + damping (velocity - x'), within its greatest force

In files angles are degrees, and stiffness and damping of turns are a degree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.io.jointed import touch_at_joint
from rigidimpulse.io.usd.bodies import BodyReader
from rigidimpulse.io.usd.library import Prim, SdfPath, UsdPhysics
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint_six_axis import AXES, Drive, Limit, SixAxisJoint

UNBOUNDED = 1e30
"""Bounds beyond this are none: some writers say so for infinity."""


class JointReader:
    """Makes joints; notes: lines of the report."""

    def __init__(self, reader: BodyReader) -> None:
        """reader: of the bodies that they join."""
        self.reader, self.notes = reader, []
        self.bodies: Mapping[str, Body] = reader.bodies
        # A turn of one radian is 180 / pi degrees; kg m^2 of torques.
        length, mass = reader.units.length, reader.units.mass
        self._force = {True: mass * length, False: mass * length**2}
        self._per = {True: mass, False: mass * length**2 * 180.0 / math.pi}
        self._size = {True: length, False: math.pi / 180.0}

    def read(self, parsed: Mapping[str, list[tuple[SdfPath, Any]]]) -> list[SixAxisJoint]:
        """Return the joints of the descriptions by kind."""
        joints, names = [], set()
        for kind, entries in parsed.items():
            for path, desc in entries:
                if not kind.endswith("Joint"):
                    continue
                prim = self.reader.stage.GetPrimAtPath(path)
                name = prim.GetName() if prim.GetName() not in names else str(path)
                names.add(name)
                joint = self._joint(kind, prim, name, desc)
                if joint is not None:
                    joints.append(joint)
        return joints

    def _joint(self, kind: str, prim: Prim, name: str, desc: Any) -> SixAxisJoint | None:
        if kind == "CustomJoint":
            self.notes.append(f"joint {name!r} of type {prim.GetTypeName()} is not read")
            return None
        if not desc.jointEnabled:
            self.notes.append(f"joint {name!r} is not enabled: left out")
            return None
        api = UsdPhysics.Joint(prim)
        a, anchor_a, axes_a = self._side(name, api.GetBody0Rel(), api.GetLocalPos0Attr(), api.GetLocalRot0Attr())
        b, anchor_b, axes_b = self._side(name, api.GetBody1Rel(), api.GetLocalPos1Attr(), api.GetLocalRot1Attr())
        if a == b or not any(self.bodies[k].motion == "dynamic" for k in (a, b) if k is not None):
            self.notes.append(f"joint {name!r} joins nothing that moves ({a!r} and {b!r}): left out")
            return None
        limits, drives = self._parts(kind, desc, name)
        if math.isfinite(desc.breakTorque) and desc.breakTorque < UNBOUNDED:
            self.notes.append(f"joint {name!r}: its break torque is not read")
        strength = float(desc.breakForce) * self._force[True] if desc.breakForce < UNBOUNDED else math.inf
        collide = desc.collisionEnabled and not touch_at_joint(name, a, b, self.bodies, limits, anchor_a, self.notes)
        return SixAxisJoint(
            a, b, anchor=anchor_a, axes=axes_a, anchor_b=anchor_b, axes_b=axes_b, limits=limits, drives=drives, name=name,
            break_force=strength, collide=collide,
        )  # fmt: skip

    def _side(self, name: str, rel: Any, place: Any, turn: Any) -> tuple[str | None, np.ndarray, np.ndarray]:
        """Return the body of a side, None for the world, its anchor (3,) m and axes (3, 3) in rows, in the world."""
        frames, targets = self.reader.frames, rel.GetTargets()
        local, given = np.array(place.Get() or (0, 0, 0), float), turn.Get()
        quaternion = np.array([given.GetReal(), *given.GetImaginary()], float) if given is not None else np.zeros(4)
        length = float(np.linalg.norm(quaternion))
        rotation = to_matrix(quaternion / length) if length > 1e-6 else np.eye(3)
        prim = frames.stage.GetPrimAtPath(targets[0]) if targets else None
        if targets and not prim:
            self.notes.append(f"joint {name!r}: {rel.GetName()} is {targets[0]}, and there is no such prim: it counts as the world")
        if not prim:
            return None, local * frames.meters_per_unit, rotation.T
        matrix = frames.matrix(prim)
        anchor = (matrix[:3, :3] @ local + matrix[:3, 3]) * frames.meters_per_unit
        return self.reader.owner(prim), anchor, (frames.rigid(prim)[1] @ rotation).T

    def _parts(self, kind: str, desc: Any, name: str) -> tuple[list[Limit], list[Drive]]:
        """Return limits and drives of a joint."""
        if kind == "D6Joint":
            return self._d6(desc, name)
        if kind == "FixedJoint":
            return [Limit("xyz", lower=0.0, upper=0.0), Limit(rotation="xyz", lower=0.0, upper=0.0)], []
        length = self.reader.units.length
        if kind == "DistanceJoint":
            low = desc.limit.lower * length if desc.minEnabled and desc.limit.lower >= 0.0 else None
            high = desc.limit.upper * length if desc.maxEnabled and desc.limit.upper >= 0.0 else None
            return ([Limit("xyz", lower=low, upper=high)] if low is not None or high is not None else []), []
        axis = {"X": "x", "Y": "y", "Z": "z"}[str(desc.axis.name)]
        others = AXES.replace(axis, "")
        if kind == "SphericalJoint":
            return [Limit("xyz", lower=0.0, upper=0.0), *self._cone(desc.limit, others, name)], []
        linear = kind == "PrismaticJoint"
        held = [Limit(others, lower=0.0, upper=0.0), Limit(rotation="xyz", lower=0.0, upper=0.0)] if linear else [
            Limit("xyz", lower=0.0, upper=0.0), Limit(rotation=others, lower=0.0, upper=0.0)
        ]  # fmt: skip
        drive = self._drive(desc.drive, linear, axis, name)
        return held + (self._bounds(desc.limit, linear, axis) if desc.limit.enabled else []), [drive] if drive else []

    def _cone(self, limit: Any, others: str, name: str) -> list[Limit]:
        """Return the cone of a spherical joint, whose two angles are in one limit."""
        angles = [angle for angle in (limit.lower, limit.upper) if limit.enabled and 0.0 <= angle < UNBOUNDED]
        if not angles:
            return []
        if len(angles) == 1 or angles[0] != angles[1]:
            self.notes.append(f"joint {name!r}: its cone is not round; it is one of {min(angles):g} degrees all round")
        return [Limit(rotation=others, lower=0.0, upper=math.radians(min(angles)))]

    def _bounds(self, limit: Any, linear: bool, axis: str) -> list[Limit]:
        """Return the limit of one axis, none where it is without bounds."""
        size = self._size[linear]
        low, high = (None if abs(value) >= UNBOUNDED else value * size for value in (limit.lower, limit.upper))
        if low is None and high is None:
            return []
        if low is not None and high is not None and low > high:
            low = high = 0.0
        return [Limit(axis if linear else "", "" if linear else axis, lower=low, upper=high)]

    def _d6(self, desc: Any, name: str) -> tuple[list[Limit], list[Drive]]:
        limits, drives = [], []
        given = {str(entry.first.name): entry.second for entry in desc.jointLimits if entry.second.enabled}
        for dof, limit in given.items():
            if dof == "Distance":
                length = self.reader.units.length
                limits.append(Limit("xyz", lower=max(limit.lower, 0.0) * length, upper=limit.upper * length))
                continue
            limits += self._bounds(limit, dof.startswith("Trans"), dof[-1].lower())
        for dof, drive in ((str(entry.first.name), entry.second) for entry in desc.jointDrives):
            made = self._drive(drive, dof.startswith("Trans"), dof[-1].lower(), name)
            drives += [made] if made else []
        return self._swings(limits, name), drives

    def _swings(self, limits: list[Limit], name: str) -> list[Limit]:
        """Join two turns with the same even limits to a cone; say of others that they are bounds of twists."""
        turns = [limit for limit in limits if limit.rotation and not limit.lower == limit.upper == 0.0]
        if len(turns) < 2:
            return limits
        even = [limit for limit in turns if limit.upper and limit.lower == -limit.upper]
        pair = next(((p, q) for p in even for q in even if p.rotation < q.rotation and p.upper == q.upper), None)
        if pair is None or len(turns) > 3:
            self.notes.append(f"joint {name!r} bounds several turns: each is the twist about its axis")
            return limits
        rest = [limit for limit in limits if limit is not pair[0] and limit is not pair[1]]
        self.notes.append(f"joint {name!r}: bounds of two turns are a cone")
        return [*rest, Limit(rotation=pair[0].rotation + pair[1].rotation, lower=0.0, upper=pair[0].upper)]

    def _drive(self, drive: Any, linear: bool, axis: str, name: str) -> Drive | None:
        """Return the drive of an axis, None where it has no strength."""
        if not drive.enabled or not (drive.stiffness > 0.0 or drive.damping > 0.0) or drive.forceLimit == 0.0:
            return None
        size, per, mode = self._size[linear], self._per[linear], "acceleration" if drive.acceleration else "force"
        if drive.acceleration:
            per = 1.0
        bound = float(drive.forceLimit) * self._force[linear] if drive.forceLimit < UNBOUNDED else math.inf
        if drive.acceleration and math.isfinite(bound):
            self.notes.append(f"joint {name!r}: the greatest acceleration of its drive is taken as a force")
        return Drive(
            drive.targetVelocity * size, drive.targetPosition * size, stiffness=drive.stiffness * per, damping=drive.damping * per,
            max_force=bound, mode=mode, translation=axis if linear else "", rotation="" if linear else axis,
        )  # fmt: skip
