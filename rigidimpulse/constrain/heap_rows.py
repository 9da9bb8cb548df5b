"""What the solver of heaps works on: bodies, pairs and contact rows, in one order that does not depend on indices.

Bodies of a heap are numbered in the order of their places at the start of the run, and of a pair the first is the one
with the lower number, so that scenes whose bodies were added in another order give the same bits. The contacts of pair
p are the rows [start[p], start[p] + count[p]) of a pool of rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.detect.touching import world_inverse_inertia
from rigidimpulse.rotation import quaternion_to_matrix

NORMAL, ARM_A, ARM_B, CORE_A, CORE_B, ROUND_A, ROUND_B = 0, 3, 6, 9, 12, 15, 16
"""Offsets in a row: unit normal from first to second; world arms to the contact points; body-fixed points, in the axes
of their bodies, and the radii of the rounded surfaces around them, m."""
MASS_N, MASS_T, IMPULSE, FRICTION, STATIC_FRICTION, DYNAMIC_FRICTION, RESTITUTION = 17, 18, 19, 20, 23, 24, 25
"""Offsets in a row: effective masses, kg; normal impulse, N s; friction impulse (3), N s; coefficients."""
APPROACH, SEPARATION, SKIN, ROW_SIZE = 26, 27, 28, 29
"""Offsets in a row: u.n when it was first seen in the step, m/s, 0 after a rebound; gap less the skin, m; skin, m."""


class HeapBodies(NamedTuple):
    """l bodies of heaps and what they touch; those that cannot be moved have no inverse mass."""

    position: np.ndarray  # (l, 3) m
    orientation: np.ndarray  # (l, 4)
    rotation: np.ndarray  # (l, 3, 3)
    velocity: np.ndarray  # (l, 6) m/s and rad/s, world
    mass: np.ndarray  # (l, 7) 1/m, and the inverse inertia in world axes: xx, xy, xz, yy, yz, zz
    inertia: np.ndarray  # (l, 3) principal
    gravity: np.ndarray  # (l, 3) m/s2
    reach: np.ndarray  # (l,) m, radius about the centre of mass; 0 for balls about it and for half spaces
    path: np.ndarray  # (l,) m, how far its centre may still come until it may meet bodies that are not in its pairs
    loose: np.ndarray  # (l,) bool, no contact pushed it in this sub-step


class HeapPairs(NamedTuple):
    """k pairs, ascending."""

    first: np.ndarray  # (k,) number of a body
    second: np.ndarray  # (k,)
    carrier: np.ndarray  # (k,) bool, relative motion is seen from the second body
    round: np.ndarray  # (k,) bool, one of the two is a ball: its turning changes no contact
    start: np.ndarray  # (k,) first row
    count: np.ndarray  # (k,) rows
    slide: np.ndarray  # (k,) m, how far the points of the pair may move past each other until it is looked at again
    turn: np.ndarray  # (k,) rad, the same for the rotation of a pair with rows


@jit
def set_pose(bodies, i):
    """Fill rotation and inverse inertia of body i from its orientation."""
    inverse = np.empty((3, 3))
    quaternion_to_matrix(bodies.orientation[i], bodies.rotation[i])
    if bodies.mass[i, 0] > 0.0:
        world_inverse_inertia(bodies.rotation[i], bodies.inertia[i], inverse)
        m = bodies.mass[i]
        m[1], m[2], m[3] = inverse[0, 0], inverse[0, 1], inverse[0, 2]
        m[4], m[5], m[6] = inverse[1, 1], inverse[1, 2], inverse[2, 2]


@jit
def set_poses(bodies):
    """Fill rotations and inverse inertias of all bodies."""
    for i in range(bodies.mass.shape[0]):
        set_pose(bodies, i)


@jit
def turned_row(r, row, at):
    """The vector row[at:at + 3] turned by the matrix r."""
    x, y, z = row[at], row[at + 1], row[at + 2]
    return (
        r[0, 0] * x + r[0, 1] * y + r[0, 2] * z,
        r[1, 0] * x + r[1, 1] * y + r[1, 2] * z,
        r[2, 0] * x + r[2, 1] * y + r[2, 2] * z,
    )


@jit
def pair_speeds(bodies, pairs, p):
    """How fast the points of a pair move past each other at most [m/s], and how fast it turns [rad/s]."""
    a, b = pairs.first[p], pairs.second[p]
    va, vb = bodies.velocity[a], bodies.velocity[b]
    spin = vb if pairs.carrier[p] else va
    dx = bodies.position[b, 0] - bodies.position[a, 0]
    dy = bodies.position[b, 1] - bodies.position[a, 1]
    dz = bodies.position[b, 2] - bodies.position[a, 2]
    x = vb[0] - va[0] - (spin[4] * dz - spin[5] * dy)
    y = vb[1] - va[1] - (spin[5] * dx - spin[3] * dz)
    z = vb[2] - va[2] - (spin[3] * dy - spin[4] * dx)
    wx, wy, wz = vb[3] - va[3], vb[4] - va[4], vb[5] - va[5]
    turn = np.sqrt(wx * wx + wy * wy + wz * wz)
    reach = bodies.reach[a] if pairs.carrier[p] else bodies.reach[b]
    return np.sqrt(x * x + y * y + z * z) + reach * turn, 0.0 if pairs.round[p] else turn
