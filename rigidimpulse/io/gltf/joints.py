"""Joints of a glTF file as `SixAxisJoint`s.

The node with the joint has frame a, the connected node frame b: axes and limits are those of a, translation is that of b
against a. Each frame moves with the body that its node belongs to; a node of no body is the world. A mirrored frame M has the
axes -M: turns about them have the sense that they have in the file, ways along them the other one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from rigidimpulse.core.portable import matmul
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.io.gltf import schema
from rigidimpulse.io.gltf.nodes import Hierarchy
from rigidimpulse.io.jointed import touch_at_joint
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint_six_axis import AXES, Drive, Limit, SixAxisJoint


def read_joints(
    hierarchy: Hierarchy, body_of: Callable[[int], str | None], bodies: Mapping[str, Body]
) -> tuple[list[SixAxisJoint], list[str]]:
    """Return the joints of a file, and lines about what is left out of them.

    Args:
        hierarchy: the nodes. body_of: name of the body that a node belongs to. bodies: by name.

    Raises:
        SceneError: an index that is wrong; bounds that are none are refused when the scene is compiled.

    """
    joints, notes = [], []
    for node in sorted(hierarchy.order):
        entry = hierarchy.nodes[node].physics.joint
        if entry is None:
            continue
        hierarchy.file.entry(hierarchy.nodes, entry.connected_node, "node")
        name = hierarchy.names[node] if hierarchy.nodes[node].name else f"joint of node {node}"
        a, b = body_of(node), body_of(entry.connected_node)
        joint = hierarchy.file.entry(hierarchy.file.document.extensions.physics.physics_joints, entry.joint, "joint")
        if a == b or not any(bodies[k].motion == "dynamic" for k in (a, b) if k is not None):
            notes.append(f"joint at node {name!r} joins nothing that moves ({a!r} and {b!r}): left out")
            continue
        (axes, hand), (axes_b, hand_b) = _axes(hierarchy, node), _axes(hierarchy, entry.connected_node)
        limits = [_limit(limit, hand, name, notes) for limit in joint.limits]
        drives = [_drive(drive, hand, name, notes) for drive in joint.drives]
        frames = hand * axes.T, hand_b * axes_b.T
        limits = [limit for limit in limits if limit is not None]
        collide = entry.enable_collision and not touch_at_joint(name, a, b, bodies, limits, hierarchy.position(node), notes)
        joints.append(SixAxisJoint(
            a, b, anchor=hierarchy.position(node), axes=frames[0], anchor_b=hierarchy.position(entry.connected_node), axes_b=frames[1],
            limits=limits, drives=[drive for drive in drives if drive is not None], name=name, collide=collide,
        ))  # fmt: skip
    return joints, notes


def _axes(hierarchy: Hierarchy, node: int) -> tuple[np.ndarray, float]:
    """Axes (3, 3) of a node in the world, as columns, and their hand."""
    axes, hand = hierarchy.axes(node)
    return matmul(to_matrix(hierarchy.turn[node]), axes), hand


def _letters(axes: list[int] | None) -> str:
    return "".join(AXES[k] for k in sorted(set(axes or ())))


def _limit(limit: schema.Limit, hand: float, name: str, notes: list[str]) -> Limit | None:
    where = f"a limit of joint {name!r}"
    if (limit.linear_axes is None) == (limit.angular_axes is None):
        notes.append(f"{where} names not one of linear and angular axes: left out")
        return None
    if limit.min is None and limit.max is None:
        notes.append(f"{where} has neither min nor max: left out")
        return None
    damping = limit.damping
    if limit.stiffness is None and damping:
        notes.append(f"{where} has damping but no stiffness: it is hard")
        damping = 0.0
    axes = _letters(limit.linear_axes), _letters(limit.angular_axes)
    lower, upper = limit.min, limit.max
    if hand < 0.0 and len(axes[0]) == 1:  # along more axes it is a distance, which has no sense
        lower, upper = None if upper is None else -upper, None if lower is None else -lower
    return Limit(*axes, lower=lower, upper=upper, stiffness=limit.stiffness, damping=damping)


def _drive(drive: schema.Drive, hand: float, name: str, notes: list[str]) -> Drive | None:
    where = f"a drive of joint {name!r}"
    if drive.type not in ("linear", "angular") or drive.mode not in ("force", "acceleration"):
        notes.append(f"{where} is of type {drive.type[:40]!r}, mode {drive.mode[:40]!r}: left out")
        return None
    if not (drive.stiffness or drive.damping) or drive.max_force == 0.0:
        notes.append(f"{where} has no strength: left out")
        return None
    axis, linear = AXES[drive.axis], drive.type == "linear"
    bound = {} if drive.max_force is None else {"max_force": drive.max_force}
    sense = hand if linear else 1.0
    return Drive(
        sense * drive.velocity_target, sense * drive.position_target, stiffness=drive.stiffness, damping=drive.damping, mode=drive.mode,
        translation=axis if linear else "", rotation="" if linear else axis, **bound,
    )  # fmt: skip
