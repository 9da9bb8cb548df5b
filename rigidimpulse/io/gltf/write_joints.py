"""Joints as limits and drives of glTF's KHR_physics_rigid_bodies.

    ball      the three translations locked; upper: a cone about x        hinge   all but the turn about x locked
    slider    all but the way along x locked                              fixed   all locked
    distance  bounds of the distance of the anchors

A joint's frame has x along its axis. Soft joints have the stiffness and damping of all their limits.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rigidimpulse.model.world import World
from rigidimpulse.scene.joint import BallJoint, DistanceJoint, FixedJoint, HingeJoint, Joint, Motor, SliderJoint
from rigidimpulse.scene.joint_six_axis import AXES, Limit, SixAxisJoint

ALL = [0, 1, 2]


def joint_entry(
    joint: Joint, world: World
) -> tuple[dict[str, Any], tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray], list[str]]:
    """Return the limits and drives of a joint, its anchors (3,) and frames (3, 3) in the world at the start, and what is left out.

    world: the compiled scene, for anchors that follow from it.
    """
    anchor_a, anchor_b, axis = joint.points(world)
    frames = joint.frames(axis)
    limits, drives = _parts(joint, float(np.linalg.norm(anchor_b - anchor_a)))
    if joint.stiffness is not None:
        limits = [limit if "stiffness" in limit else {**limit, **_soft(joint.stiffness, joint.damping)} for limit in limits]
    entry: dict[str, Any] = {"limits": limits} if limits else {}
    if drives:
        entry["drives"] = drives
    lines = []
    for name in ("break_force", "release_time"):
        if getattr(joint, name) < math.inf:
            lines.append(f"{joint.label}: {name} cannot be said in glTF")
    return entry, (anchor_a, anchor_b), frames, lines


def _parts(joint: Joint, distance: float) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Limits and drives of a joint."""
    if isinstance(joint, SixAxisJoint):
        return [_limit_of(limit) for limit in joint.limits], [
            _drive(drive, "linear" if drive.translation else "angular", AXES.index(drive.translation or drive.rotation))
            for drive in joint.drives
        ]
    if isinstance(joint, DistanceJoint):
        bounds = _bounds("linearAxes", ALL, joint.lower, joint.upper)
        if bounds and joint.length is None:
            return bounds, []
        length = distance if joint.length is None else float(joint.length)
        return [*_bounds("linearAxes", ALL, length, length), *bounds], []
    held = _bounds("linearAxes", ALL, 0.0, 0.0)
    if isinstance(joint, BallJoint):
        return held + _bounds("angularAxes", [1, 2], None, joint.upper), []
    if isinstance(joint, HingeJoint):
        limits = held + _bounds("angularAxes", [1, 2], 0.0, 0.0) + _bounds("angularAxes", [0], joint.lower, joint.upper)
        return limits, [_drive(joint.motor, "angular", 0)] if joint.motor else []
    if isinstance(joint, SliderJoint):
        limits = _bounds("linearAxes", [1, 2], 0.0, 0.0) + _bounds("angularAxes", ALL, 0.0, 0.0)
        return limits + _bounds("linearAxes", [0], joint.lower, joint.upper), [_drive(joint.motor, "linear", 0)] if joint.motor else []
    assert isinstance(joint, FixedJoint)
    return held + _bounds("angularAxes", ALL, 0.0, 0.0), []


def _bounds(kind: str, axes: list[int], lower: float | None, upper: float | None) -> list[dict[str, Any]]:
    entry: dict[str, Any] = {kind: axes}
    if lower is not None and lower > -math.inf:
        entry["min"] = float(lower)
    if upper is not None and upper < math.inf:
        entry["max"] = float(upper)
    return [entry] if len(entry) > 1 else []


def _soft(stiffness: float, damping: float) -> dict[str, float]:
    return {"stiffness": float(stiffness), "damping": float(damping)}


def _limit_of(limit: Limit) -> dict[str, Any]:
    linear, axes, _ = limit.parts()
    entry: dict[str, Any] = {"linearAxes" if linear else "angularAxes": list(axes)}
    entry |= {key: float(value) for key, value in (("min", limit.lower), ("max", limit.upper)) if value is not None}
    return entry if limit.stiffness is None else {**entry, **_soft(limit.stiffness, limit.damping)}


def _drive(motor: Motor, kind: str, axis: int) -> dict[str, Any]:
    entry: dict[str, Any] = {"type": kind, "mode": motor.mode, "axis": axis}
    entry |= {"positionTarget": float(motor.target), "stiffness": float(motor.stiffness)}
    entry |= {"velocityTarget": float(motor.velocity), "damping": float(motor.damping)}
    return entry if math.isinf(motor.max_force) else {**entry, "maxForce": float(abs(motor.max_force))}
