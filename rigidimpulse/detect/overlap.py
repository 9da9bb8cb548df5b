"""Overlap at the start: found with FCL before the first frame, and reported.

Bodies that merely touch are no overlap. FCL's yes-or-no answer counts touching, so a pair is an overlap only if it
stays one when a body is moved by DEPTH of its size along each axis: whoever only touches, along whatever normal, is
free in one of the six directions.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.detect.narrowphase import Narrowphase
from rigidimpulse.detect.window import Window

DEPTH = 1e-5
DIRECTIONS = np.vstack([np.eye(3), -np.eye(3)])


def report_overlaps(context) -> None:
    """Report pairs that overlap by more than DEPTH of the smaller body's size where the run starts."""
    world = context.world
    if not world.can_collide:
        return
    window = Window(context, context.state.time)
    window.find_pairs()
    narrowphase = Narrowphase(world.shapes)
    for a, b in zip(window.a.tolist(), window.b.tolist(), strict=True):
        if _overlap(world, narrowphase, a, b):
            context.log.report(
                0.0, "overlap at the start", (world.names[a], world.names[b]),
                "the bodies are inside each other; move them apart, or expect an unphysical first instant",
            )


def _overlap(world, narrowphase: Narrowphase, a: int, b: int) -> bool:
    shape_a, shape_b = int(world.shape_of_body[a]), int(world.shape_of_body[b])
    pose_a = (world.position[a], world.orientation[a])
    moved = DEPTH * min(world.size[a], world.size[b])
    return all(
        narrowphase.overlap(shape_a, pose_a, shape_b, (world.position[b] + moved * d, world.orientation[b]))
        for d in np.vstack([np.zeros(3), DIRECTIONS])
    )
