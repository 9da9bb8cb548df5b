"""What holds bodies together, as the page draws it: joints with their anchors, axis and limits, and springs.

An anchor is given in the frame of its body at the start, in the world's where the joint holds to the world.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidimpulse.core.quaternion import rotate_inverse
from rigidimpulse.scene.joint import BallJoint, DistanceJoint, FixedJoint, HingeJoint, Joint, SliderJoint

KINDS = {HingeJoint: "hinge", BallJoint: "ball", SliderJoint: "slider", FixedJoint: "fixed", DistanceJoint: "distance"}
"""What the page calls them; any other joint is drawn as a ball."""


@dataclass(frozen=True)
class _Start:
    """Where bodies are at the start, as joints ask for it."""

    names: list[str]
    position: np.ndarray


def joint_entries(recording: Any) -> list[dict[str, Any]]:
    """Return what the manifest says of each joint and spring of a recording with its scene."""
    names = [body.name for body in recording.scene.bodies]
    start = _Start(names, np.array([recording.center_of_mass(name)[0] for name in names]).reshape(-1, 3))
    entries, num_joints = [], 0
    for effect in recording.scene.effects:
        if isinstance(effect, Joint):
            anchor_a, anchor_b, axis = effect.points(start)
            label, num_joints = effect.name or f"joint{num_joints}", num_joints + 1
            entry = {"kind": KINDS.get(type(effect), "ball"), "lower": _finite(effect.lower), "upper": _finite(effect.upper)}
            entry["axis"] = _local(recording, effect.a, np.asarray(axis, float), is_point=False)
            entry["until"] = _last_time(recording, effect, label)
        elif all(hasattr(effect, name) for name in ("a", "b", "anchor_a", "anchor_b")):
            anchor_a, anchor_b = np.asarray(effect.anchor_a, float), np.asarray(effect.anchor_b, float)
            label = effect.name or f"spring of {effect.a or 'the world'} and {effect.b or 'the world'}"
            entry = {"kind": "spring", "lower": None, "upper": None, "axis": None, "until": None}
        else:
            continue
        entry |= {"name": label, "a": effect.a, "b": effect.b}
        entry |= {"anchorA": _local(recording, effect.a, anchor_a), "anchorB": _local(recording, effect.b, anchor_b)}
        entries.append(entry)
    return entries


def fixed_anchors(recording: Any) -> list[tuple[str, np.ndarray]]:
    """Return name and place (1, 3), m, of each end that holds to the world: the picture should have them in it."""
    ends = [(entry["name"], entry[anchor]) for entry in joint_entries(recording) for side, anchor in (("a", "anchorA"), ("b", "anchorB"))
            if entry[side] is None]  # fmt: skip
    return [(name, np.asarray(place)[None, :]) for name, place in ends]


def _local(recording: Any, name: str | None, vector: np.ndarray, is_point: bool = True) -> list[float]:
    """A point or direction (3,) of the world at the start, in the frame of a body."""
    if name is None:
        return vector.tolist()
    shift = recording.position(name)[0] if is_point else 0.0
    return rotate_inverse(recording.orientation(name)[0], vector - shift).tolist()


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _last_time(recording: Any, joint: Joint, name: str) -> float | None:
    """Until when a joint holds, s: it is let go, or breaks and bears nothing from then on. None: always."""
    if math.isfinite(joint.release_time):
        return float(joint.release_time)
    force = recording.reactions.get(name)
    if math.isfinite(joint.break_force) and force is not None and not np.any(force[-1]):
        bearing = np.flatnonzero(np.any(force != 0.0, axis=1))
        return float(recording.times[bearing[-1]]) if len(bearing) else None
    return None
