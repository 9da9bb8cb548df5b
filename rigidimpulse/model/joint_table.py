"""The table of joints that the kernels read."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.portable import dot, length, matmul
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.scene.joint import HARD, Joint, Motor, Row

if TYPE_CHECKING:
    from rigidimpulse.model.world import World


class Joints(NamedTuple):
    """j joints with k rows; bodies are indices into the world, -1 is the world itself."""

    body_a: np.ndarray  # (j,)
    body_b: np.ndarray  # (j,)
    anchor_a: np.ndarray  # (j, 3) m, in the principal frame of a (in the world if a is -1)
    anchor_b: np.ndarray  # (j, 3)
    frame_a: np.ndarray  # (j, 3, 3) columns: the axes in the principal frame of a
    frame_b: np.ndarray  # (j, 3, 3)
    first: np.ndarray  # (j + 1,) first row of each joint
    coordinate: np.ndarray  # (k,)
    target: np.ndarray  # (k,) m or rad
    lower: np.ndarray  # (k,) N or N m, least and most that the row may exert
    upper: np.ndarray  # (k,)
    stiffness: np.ndarray  # (k,) N/m or N m/rad; inf: hard
    damping: np.ndarray  # (k,) N s/m or N m s/rad
    rate: np.ndarray  # (k,) m/s or rad/s, the rate that the damping strives for
    per_mass: np.ndarray  # (k,) bool, stiffness and damping are those of a unit of the mass or inertia that the row moves


def _soften(joint: Joint, rows: list[Row]) -> list[Row]:
    """The rows with the joint's stiffness and damping; drives keep their own."""
    if joint.stiffness is None:
        if joint.damping != 0.0:
            raise SceneError(f"damping = {joint.damping} without stiffness", "give a stiffness too")
        return rows
    stiffness = float(joint.stiffness)
    if not (math.isfinite(stiffness) and stiffness >= 0.0 and math.isfinite(joint.damping) and joint.damping >= 0.0):
        raise SceneError(f"stiffness {joint.stiffness}, damping {joint.damping}", "give finite values >= 0")
    return [replace(r, stiffness=stiffness, damping=float(joint.damping)) if r.stiffness == HARD else r for r in rows]


def compile_joints(joints: list[Joint], world: World) -> Joints:
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
        if joint.name is not None and sum(other.name == joint.name for other in joints) > 1:
            raise SceneError(f"another joint has the name {joint.name!r}, too", "give each joint a name of its own", joint.label)
        motor = getattr(joint, "motor", None)
        if not isinstance(motor, Motor | None):
            raise SceneError(f"motor = {motor!r}", "give ri.Motor(velocity=..., damping=...) or another Motor", joint.label)
        if not any(i >= 0 and world.dynamic[i] for i, _, _ in sides):
            raise SceneError("neither body is dynamic", "join at least one that moves", joint.label)
        try:
            joint.check()
            anchor_a, anchor_b, axis = joint.points(world)
            frames = joint.frames(axis)
            rows = _soften(joint, joint.rows(float(length(anchor_b - anchor_a))))
        except SceneError as error:
            raise error.within(joint.label) from None
        ends = zip("ab", (anchor_a, anchor_b), frames, sides, strict=True)
        for side, anchor, frame, (i, turn, origin) in ends:
            columns[f"body_{side}"].append(i)
            columns[f"anchor_{side}"].append(dot(turn.T, anchor - origin))
            columns[f"frame_{side}"].append(matmul(turn.T, frame))
        for row in rows:
            for field in ("coordinate", "target", "lower", "upper", "stiffness", "damping", "rate", "per_mass"):
                columns[field].append(getattr(row, field))
        columns["first"].append(columns["first"][-1] + len(rows))
    integers = ("body_a", "body_b", "first", "coordinate")
    types = dict.fromkeys(integers, np.int64) | {"per_mass": np.bool_}
    shapes = {"anchor_a": (-1, 3), "anchor_b": (-1, 3), "frame_a": (-1, 3, 3), "frame_b": (-1, 3, 3)}
    arrays = (np.array(columns[f], types.get(f, float)).reshape(shapes.get(f, -1)) for f in Joints._fields)
    return Joints(*(np.ascontiguousarray(array) for array in arrays))


def _side(joint: Joint, world: World, name: str | None) -> tuple[int, np.ndarray, np.ndarray]:
    """Index, rotation (3, 3) and position (3,) of one side's principal frame at the start."""
    if name is None:
        return -1, np.eye(3), np.zeros(3)
    if name not in world.names:
        raise unknown_name("body", name, world.names, joint.label)
    i = world.names.index(name)
    return i, to_matrix(world.orientation[i]), world.position[i]
