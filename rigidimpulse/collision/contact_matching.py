"""New contact points, the impulses they take over from the points they replace (a warm start), and the contact margin of a pair.

The contact margin is the gap at which contacts rest. It is the skin, into which soft contacts may sink. Pairs that are closer when they
first have contacts keep the gap they have, down to LEAST_MARGIN skins. If they were pushed out to the skin, a sliding block would hop, and
a stack built without gaps would rise. Bodies that join an island closer than that are moved apart at once, without speed (depenetration).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_records import (
    CARRIER,
    CONTACT_MARGIN,
    DYNAMIC_FRICTION,
    FRICTION,
    IMPULSE,
    POINT_FIELDS,
    ROUND_A,
    ROUND_B,
    SEPARATION,
    SKELETON_A,
    SKELETON_B,
    SKIN,
    STATIC_FRICTION,
)
from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.vector import turned_back_by

NEAR = 0.2
"""Distance, in inner radii, within which a new point takes over the impulse of an old one of other features."""
LEAST_MARGIN = 0.2
"""Least contact margin of a pair, in skins: as far as the load of a column presses a contact in."""


class Source(NamedTuple):
    """A contact as it was found, relative to the first body."""

    real: np.ndarray  # (k, 10) on a, on b, normal, gap
    place: int  # of the contact in it
    round_a: float  # m, radius of the rounded surface of a at the contact
    round_b: float


class Points(NamedTuple):
    """Contact points of one pair."""

    points: np.ndarray  # (P, POINT_FIELDS)
    ids: np.ndarray  # (P, 3)
    begin: int
    end: int


@inlined
def write_point(bodies, pairs, p, source, coefficients, points, r):
    """Write point r of pair p, without impulse; returns its separation. coefficients (k, k, 4): of two materials."""
    real, c, round_a, round_b = source
    position, rotation, material, skin = bodies.position, bodies.rotation, bodies.material, bodies.skin
    a, b, carrier, contact_margin = pairs.first[p], pairs.second[p], pairs.carrier[p], pairs.contact_margin[p]
    nx, ny, nz = real[c, 6], real[c, 7], real[c, 8]
    dx, dy, dz = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1], position[b, 2] - position[a, 2]
    # Rounded surfaces keep their skeleton's point.
    ax, ay, az = real[c, 0] - round_a * nx, real[c, 1] - round_a * ny, real[c, 2] - round_a * nz
    bx, by, bz = real[c, 3] - dx + round_b * nx, real[c, 4] - dy + round_b * ny, real[c, 5] - dz + round_b * nz
    m, t = material[a], material[b]
    for k in range(IMPULSE, POINT_FIELDS):
        points[r, k] = 0.0
    points[r, 0], points[r, 1], points[r, 2] = turned_back_by(rotation, b if carrier else a, nx, ny, nz)
    points[r, SKELETON_A], points[r, SKELETON_A + 1], points[r, SKELETON_A + 2] = turned_back_by(rotation, a, ax, ay, az)
    points[r, SKELETON_B], points[r, SKELETON_B + 1], points[r, SKELETON_B + 2] = turned_back_by(rotation, b, bx, by, bz)
    points[r, ROUND_A], points[r, ROUND_B], points[r, CARRIER] = round_a, round_b, 1.0 if carrier else 0.0
    points[r, STATIC_FRICTION], points[r, DYNAMIC_FRICTION] = coefficients[m, t, 1], coefficients[m, t, 2]
    points[r, SKIN], points[r, CONTACT_MARGIN] = min(skin[a], skin[b]), contact_margin
    apart = nx * (dx + (bx - ax)) + ny * (dy + (by - ay)) + nz * (dz + (bz - az))
    points[r, SEPARATION] = apart - (round_a + round_b) - contact_margin
    return points[r, SEPARATION]


@jit
def set_contact_margin(margins, p, points, begin, end):
    """Let pair p, with first contacts from `begin` to `end`, rest at the gap it has, if that is between LEAST_MARGIN and the skin."""
    closer = 0.0
    for r in range(begin, end):
        closer = max(closer, min(-points[r, SEPARATION], margins[p] - LEAST_MARGIN * points[r, SKIN]))
    if closer > 0.0:
        margins[p] -= closer
        for r in range(begin, end):
            points[r, CONTACT_MARGIN] -= closer
            points[r, SEPARATION] += closer


@inlined
def match_contacts(old, new, near):
    """Give new points the impulses of the old points of the same features, else of one within `near` with almost the same normal.

    old, new: `Points`. An old point gives its impulse once.
    """
    old_points, old_ids, old_begin, old_end = old
    points, ids, new_begin, new_end = new
    # First by features; what is left then by place.
    for nearby in range(2):
        for c in range(new_begin, new_end):
            if points[c, IMPULSE] > 0.0:
                continue
            for o in range(old_begin, old_end):
                if old_points[o, IMPULSE] == 0.0:
                    continue
                cosine = points[c, 0] * old_points[o, 0] + points[c, 1] * old_points[o, 1] + points[c, 2] * old_points[o, 2]
                same = ids[c, 0] == old_ids[o, 0] and ids[c, 1] == old_ids[o, 1] and ids[c, 2] == old_ids[o, 2]
                if nearby == 1:
                    x, y = points[c, SKELETON_A] - old_points[o, SKELETON_A], points[c, SKELETON_A + 1] - old_points[o, SKELETON_A + 1]
                    z = points[c, SKELETON_A + 2] - old_points[o, SKELETON_A + 2]
                    same = x * x + y * y + z * z < near * near
                if not same or cosine < 0.9:
                    continue
                # The old point is emptied, so that its impulse is given once.
                points[c, IMPULSE], old_points[o, IMPULSE] = old_points[o, IMPULSE], 0.0
                for k in range(FRICTION, FRICTION + 3):
                    points[c, k] = old_points[o, k]
                break
