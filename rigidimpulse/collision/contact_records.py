"""What the kernels of heaps work on: bodies, pairs and contact points, kept from step to step.

Bodies are numbered in the order of their places at the start of the run (their rank), and of a pair the first is the one of lower
number, so that scenes whose bodies were added in another order give the same bits. Pair p has the contact points
[start[p], start[p] + count[p]) of a pool of rows.

What changes in a sub-step lies in rows of 8 doubles, see `lanes`: velocity (v, w), moved and drift (displacement and rotation vector),
mass (inverse inertia xx, xy, xz, yy, yz, zz in world axes, and 1/m).
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix

# Kernels that are called for each pair or point get arrays one by one, and indices: a tuple of twenty arrays is passed word by word,
# and a view is counted, which costs more than what is computed.

NORMAL, SKELETON_A, ROUND_A, ROUND_B, SKELETON_B = 0, 3, 6, 7, 8
"""Offsets in a row: unit normal from first to second in the axes of the pair's carrier; body-fixed points, in the axes of their
bodies, and the radii of the rounded surfaces around them, m."""
SKIN, STATIC_FRICTION, DYNAMIC_FRICTION, HELD, CARRIER = 11, 12, 13, 14, 15
"""Offsets in a row: skin, m; coefficients; gap at which it is held, m; 1 where the carrier is the second body, else 0."""
IMPULSE, FRICTION, SEPARATION, ROW_SIZE = 16, 17, 20, 24
"""Offsets in a row: normal impulse, N s; friction impulse (3), N s, world; gap less the held one when the row was last written or read, m.
A row is three lines of 8, the last of which the solver writes. Row 0 of a pool is none: all 0."""

UNKNOWN = -1
"""Kind of a pair that is new."""
OUTSIDE, MEMBER, SUPPORT = 0, 1, 2
"""Parts that a body may play in a step: none, stepped, immovable and near."""
INVERSE_MASS = 6
"""Place of 1/m in a row of `mass`."""


class SolverBodies(NamedTuple):
    """n bodies by rank, and one more row that is no body, for lanes that have nothing to do."""

    shape: np.ndarray  # (n+1,)
    material: np.ndarray  # (n+1,)
    inertia: np.ndarray  # (n+1, 3) principal
    alike: np.ndarray  # (n+1,) bool, all moments equal: the inverse inertia does not turn
    inner: np.ndarray  # (n+1,) m, distance from the centre of mass to the nearest face; inf for what cannot be moved
    skin: np.ndarray  # (n+1,) m, gap at which contacts are held
    reach: np.ndarray  # (n+1,) m, radius about the centre of mass, 0 for balls, inf for half spaces
    radius: np.ndarray  # (n+1,) m, of the sphere about the centre of mass that holds the body
    part: np.ndarray  # (n+1,) OUTSIDE, MEMBER or SUPPORT
    position: np.ndarray  # (n+1, 3) m
    orientation: np.ndarray  # (n+1, 4)
    rotation: np.ndarray  # (n+1, 3, 3)
    gravity: np.ndarray  # (n+1, 3) m/s2
    velocity: np.ndarray  # (8 (n+1),) m/s and rad/s, world
    before: np.ndarray  # (8 (n+1),) the same before contacts acted in the sub-step
    moved: np.ndarray  # (8 (n+1),) m and rad, since contacts were last looked for
    drift: np.ndarray  # (8 (n+1),) the same since the steady batches were made
    quick: np.ndarray  # (n+1,) bool, its contacts are in none of these
    mass: np.ndarray  # (8 (n+1),)


class ContactPairs(NamedTuple):
    """k pairs, ascending."""

    first: np.ndarray  # (k,) number of a body
    second: np.ndarray  # (k,)
    carrier: np.ndarray  # (k,) bool, relative motion is seen from the second body, the one of larger reach
    round: np.ndarray  # (k,) bool, the body that is not the carrier is a ball: its turning changes no contact
    kind: np.ndarray  # (k,) how contacts are found, see `heap_narrow`; UNKNOWN for a new pair
    start: np.ndarray  # (k,) first row
    count: np.ndarray  # (k,) rows
    capacity: np.ndarray  # (k,) rows that are the pair's own
    known: np.ndarray  # (k,) bool, `seen` and `apart` hold
    apart: np.ndarray  # (k,) m, the gap was at least that; 0 for a pair that has rows
    held: np.ndarray  # (k,) m, gap at which contacts are held
    seen: np.ndarray  # (k, 7) pose of the other body in the axes of the carrier when contacts were looked for: m, and quaternion


@jit
def set_inverse_inertia(bodies, i):
    """Fill the row of `mass` of body i for its rotation."""
    r, moments, m = bodies.rotation[i], bodies.inertia[i], 8 * i
    a, b, c = 1.0 / moments[0], 1.0 / moments[1], 1.0 / moments[2]
    bodies.mass[m] = a * r[0, 0] * r[0, 0] + b * r[0, 1] * r[0, 1] + c * r[0, 2] * r[0, 2]
    bodies.mass[m + 1] = a * r[0, 0] * r[1, 0] + b * r[0, 1] * r[1, 1] + c * r[0, 2] * r[1, 2]
    bodies.mass[m + 2] = a * r[0, 0] * r[2, 0] + b * r[0, 1] * r[2, 1] + c * r[0, 2] * r[2, 2]
    bodies.mass[m + 3] = a * r[1, 0] * r[1, 0] + b * r[1, 1] * r[1, 1] + c * r[1, 2] * r[1, 2]
    bodies.mass[m + 4] = a * r[1, 0] * r[2, 0] + b * r[1, 1] * r[2, 1] + c * r[1, 2] * r[2, 2]
    bodies.mass[m + 5] = a * r[2, 0] * r[2, 0] + b * r[2, 1] * r[2, 1] + c * r[2, 2] * r[2, 2]


@jit_making_arrays
def load_bodies(bodies, order, now, acceleration, inv_mass, part):
    """Put the bodies that play a part (n,) by index, at the present instant, before the kernels; order (n,) index by rank."""
    for k in range(order.shape[0]):
        i = order[k]
        bodies.part[k], bodies.quick[k] = part[i], True
        if part[i] == OUTSIDE:
            continue
        for c in range(3):
            bodies.position[k, c] = now.position[i, c]
            bodies.velocity[8 * k + c] = now.velocity[i, c]
            bodies.velocity[8 * k + 3 + c] = now.angular_velocity[i, c]
            bodies.gravity[k, c] = acceleration[i, c] if part[i] == MEMBER else 0.0
        for c in range(4):
            bodies.orientation[k, c] = now.orientation[i, c]
        for c in range(6):
            bodies.moved[8 * k + c] = bodies.drift[8 * k + c] = 0.0
        quaternion_to_matrix(bodies.orientation[k], bodies.rotation[k])
        if part[i] == MEMBER:
            bodies.mass[8 * k + INVERSE_MASS] = inv_mass[i]
            set_inverse_inertia(bodies, k)
        else:
            bodies.mass[8 * k : 8 * k + 8] = 0.0


@inlined
def in_play(part, a, b):
    """Whether a pair is stepped."""
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
