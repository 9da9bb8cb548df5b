"""The scenes of the page on what accuracy costs, and what is said of them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

KEPT = Path(__file__).resolve().parent / "accuracy_costs"


class Topic(NamedTuple):
    """A scene of the page: how long it is run [s], whether other engines know it, and what to say of it."""

    duration: float
    peers: bool
    words: str


TOPICS = {
    "bounce": Topic(10.0, True, "A ball falls on a floor and bounces without loss. Between impacts it follows parabolas."),
    "tumbling_box": Topic(10.0, True, "A box tumbles through the air without an impact. Only free rotation is tested."),
    "disks_in_a_box": Topic(60.0, True, "Three elastic disks collide in a box. Each impact between disks multiplies the error."),
    "pool_break": Topic(5.0, True, "A cue ball breaks a rack of balls. After many impacts the motion is chaotic."),
    "stack_10": Topic(4.0, True, "Ten boxes stand on each other. Nothing may move."),
    "incline": Topic(4.0, True, "Blocks lie on a slope, a little below, at and above the angle at which friction fails."),
    "chain_swinging": Topic(0.05, False, "A chain of links begins to swing a ball that is a thousand times as heavy as a link."),
    "arm": Topic(2.0, False, "An arm of two parts falls against the limits of its joints: a cone, a soft twist, a hinge."),
    "spot": Topic(2.0, True, "A cow falls on a torus. Both are meshes. (MuJoCo uses hulls for meshes, Bullet for moving ones.)"),
    "toss_alone": Topic(81 / 148, True, "A real cube was thrown on a board and filmed. The reference is the recording."),
}
METHODS = {
    "kinematic": "kinematic, step", "penalty": "penalty, step", "linear": "linear, step", "bisection": "bisection, step",
    "after the fact": "after, step", "MuJoCo": "mujoco", "Bullet": "pybullet",
}  # fmt: skip
"""Columns of the table side by side: title and family."""
