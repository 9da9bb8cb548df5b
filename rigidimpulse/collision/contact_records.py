"""What is kept of pairs and contact points from step to step: the layout that kernels share.

Bodies are numbered in the order of their positions at the start of the run (their rank). The first body of a pair is the one of lower
rank. So scenes whose bodies were added in another order give the same bits. Pair p has the contact points
[start[p], start[p] + count[p]) of the contact table.

Kernels get a record of bodies by rank. They read these of its fields: `shape` and `material`; `inner`, `skin`, `reach` and `radius`, m;
`part`, one of OUTSIDE, MEMBER and SUPPORT; `quick`; the poses `position`, `orientation` and `rotation`; `velocity`, of which body i has the
6 numbers (v, w) from 8 i on; and `mass`, of which it has 1/m at 8 i + INVERSE_MASS. They write `change` and `held`. The solver's record of
bodies has these fields and more.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import inlined

# Kernels that are called for each pair or point get few arrays, and indices. A tuple of twenty arrays is passed word by word, and the
# holders of a view are counted: both cost more time than the computation.

NORMAL, SKELETON_A, ROUND_A, ROUND_B, SKELETON_B = 0, 3, 6, 7, 8
"""Fields of a contact point: unit normal from first to second in the axes of the pair's carrier; points of the skeletons, fixed in the
bodies and in their axes, and the radii of the rounded surfaces around them, m."""
SKIN, STATIC_FRICTION, DYNAMIC_FRICTION, CONTACT_MARGIN, CARRIER = 11, 12, 13, 14, 15
"""Fields: skin, m; coefficients of friction; contact margin, the gap at rest, m; 1 where the carrier is the second body, else 0."""
IMPULSE, FRICTION, SEPARATION, POINT_FIELDS = 16, 17, 20, 24
"""Fields: normal impulse, N s; friction impulse (3), N s, world; gap less the contact margin when the point was last written or read, m.
A point is three lines of 8 numbers. The solver writes the last of them. Point 0 of a table stands for no point: all its fields are 0."""

UNKNOWN = -1
"""Kind of a new pair."""
INVERSE_MASS = 6
"""Place of 1/m among the 8 numbers of a body in `mass`."""
OUTSIDE, MEMBER, SUPPORT = 0, 1, 2
"""Part of a body in a step: outside of it, a member that is stepped, a support that is near and does not move."""


class ContactPairs(NamedTuple):
    """k pairs, ascending."""

    first: np.ndarray  # (k,) number of a body
    second: np.ndarray  # (k,)
    carrier: np.ndarray  # (k,) bool, relative motion is measured in the axes of the second body, the one of larger reach
    round: np.ndarray  # (k,) bool, the other body is a ball: its rotation changes no contact
    kind: np.ndarray  # (k,) how contacts are found, see `contact_cache`; UNKNOWN for a new pair
    start: np.ndarray  # (k,) first contact point
    count: np.ndarray  # (k,) contact points
    capacity: np.ndarray  # (k,) places that belong to the pair
    known: np.ndarray  # (k,) bool, `seen` and `apart` are valid
    apart: np.ndarray  # (k,) m, lower bound of the gap; 0 for a pair with contact points
    contact_margin: np.ndarray  # (k,) m, gap of its contacts at rest
    seen: np.ndarray  # (k, 7) pose of the other body in the axes of the carrier when contacts were last found: m, quaternion


@inlined
def in_play(part, a, b):
    """Whether a pair takes part in the step."""
    return part[a] != OUTSIDE and part[b] != OUTSIDE and (part[a] == MEMBER or part[b] == MEMBER)


@inlined
def closing_speed(position, velocity, reach, a, b, carrier):
    """How fast the points of bodies a and b move past each other at most, m/s, seen from the carrier (b where it is true)."""
    v, i, j = velocity, 8 * a, 8 * b
    spin, other = (j, a) if carrier else (i, b)
    dx, dy, dz = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1], position[b, 2] - position[a, 2]
    x = v[j] - v[i] - (v[spin + 4] * dz - v[spin + 5] * dy)
    y = v[j + 1] - v[i + 1] - (v[spin + 5] * dx - v[spin + 3] * dz)
    z = v[j + 2] - v[i + 2] - (v[spin + 3] * dy - v[spin + 4] * dx)
    wx, wy, wz = v[j + 3] - v[i + 3], v[j + 4] - v[i + 4], v[j + 5] - v[i + 5]
    turn = sqrt(wx * wx + wy * wy + wz * wz)
    return sqrt(x * x + y * y + z * z) + (reach[other] * turn if turn > 0.0 else 0.0)
