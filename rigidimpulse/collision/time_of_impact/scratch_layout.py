"""The scratch memory of a safe step: one array of floats in which every record has its place, and one of integers.

Two bodies are looked at from the *first*: its frame is the one of all points, directions and arms (arms start at the
centres of mass). Records that come in pairs have that of the first body or piece, then that of the second.

One array instead of many: numba passes an array as seven numbers from kernel to kernel, so each costs compile time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.time_of_impact.motion_bound import MOTION_SIZE, SEEN_SIZE

FIRST, SECOND = np.array([0, 1])
"""Sides."""

CYLINDER_AXIS, CYLINDER_HEIGHT, CYLINDER_RADIUS, CYLINDER_SIZE = np.array([3, 6, 7, 8])
"""Offsets into the record of a cylinder: it starts with the centre; unit axis, half height, rim radius."""

POINT_FIRST, POINT_SECOND, NORMAL, GAP, DIRECTION, LIMIT_SIZE = np.array([0, 3, 6, 9, 10, 13])
"""Offsets into the record of what limits a safe time: closest points of two pieces, unit normal from first to second
(zeros if unknown), gap along it, and the direction that did best, from first to second. The witness has the first
four, from a to b in the world."""

VIEW_SIZE = 8
"""Of a direction that is carried: how points move along it, see `separating_quadratic`."""

STACK_SIZE = 128
"""Depth of a walk through two trees; they are less deep than that together."""

_SIZES = {
    "motion": 2 * MOTION_SIZE,  # of bodies a and b (see `motion_bound`)
    "rotation": 9,  # columns: axes of the second body
    "origin": 6,  # centres of mass
    "seen": 2 * SEEN_SIZE,  # second body seen from the first, first seen from the second; all in the first's axes
    "views": 8 * VIEW_SIZE,  # along the direction at LIMIT, the axes of the first and of the second box, and another direction
    "corner": 18,  # three points each
    "face": 6,  # unit normals
    "cylinder": 2 * CYLINDER_SIZE,
    "cylinder_axes": 9,  # columns: two directions across the second cylinder, and its axis
    "closest": LIMIT_SIZE,  # of the pieces looked at last
    "thinned": LIMIT_SIZE,  # the same with cylinders thinned to their axes
    "limit": LIMIT_SIZE,  # of the pieces that limit the safe time
    "towards": 3,  # direction from a to b along which they do, in the axes of its carrier; zeros if there is none
    "witness": GAP + 1,
    "place": 6,  # centres of mass of bodies a and b at another time
    "turn": 8,  # their orientations
    "frame": 18,  # their axes
    "stack_time": STACK_SIZE,
}
_STARTS = np.concatenate([[0], np.cumsum(list(_SIZES.values()))])
MOTION, ROTATION, ORIGIN, SEEN, VIEWS, CORNER, FACE, CYLINDER, CYLINDER_AXES = _STARTS[:9]
CLOSEST, THINNED, LIMIT, TOWARDS, WITNESS, PLACE, TURN, FRAME, STACK_TIME, WORK_SIZE = _STARTS[9:]
LIMIT_VIEW, AXIS_VIEWS, OTHER_VIEW = VIEWS + VIEW_SIZE * np.array([0, 1, 7])
"""Places in the float array, in the order of `_SIZES`."""

PRIMITIVE_A, ELEMENT_A, PRIMITIVE_B, ELEMENT_B, CARRIER, COUNT, BASE, STACK = np.array([0, 1, 2, 3, 4, 5, 7, 8])
INDEX_SIZE = STACK + 2 * STACK_SIZE
"""Places in the integer array. The witness: primitives of a and b, their elements (a triangle, or -1 - vertex), and
which of them carries the direction (0: a, 1: b). Then the number of corners of both pieces, 0 for a cylinder, and the
stack of pairs of nodes, with the depth at which the last opened pair lay."""


class PairScratch(NamedTuple):
    """The two arrays."""

    work: np.ndarray  # (WORK_SIZE,)
    index: np.ndarray  # (INDEX_SIZE,) int64
