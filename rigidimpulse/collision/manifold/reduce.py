"""Reduction of a manifold: of many contacts with one normal few stay, those that can carry the load of all.

A load spread over contacts of one normal is carried just as well by the corners of their convex hull. The extreme contacts in
MAX_PER_NORMAL directions stand for these corners. The deepest contact stays in any case.

Contacts with a gap carry nothing until the bodies have tilted by about gap / place. Where contacts are looked for far ahead, those far out
and wide open must not take the place of those that carry now: each counts as less far out, by its gap times `gap_weight`.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np

from rigidimpulse.collision.distance.simplices import inner
from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, row

MAX_PER_NORMAL = np.int64(8)
"""Directions in which the extreme contacts of one normal are kept."""
PER_NORMAL, GAP_WEIGHT = np.int64(4), 20.0
"""The same of sub-stepped islands, where few contacts are enough; and how far out those with a gap count: bodies tilt by a twentieth at
most until they are looked at again."""
SAME_PATCH = 0.999
"""Cosine of the angle between normals above which contacts belong to one patch."""
TIE = TOLERANCES.manifold.tie
STEEP = 0.77
"""|n_z| from which on the tangents of a normal are built on x instead of z (no common slope has this value)."""


@inner
def _deepest_left(real, patch, first):
    """Return the deepest contact without a patch, or -1."""
    deepest = -1
    for i in range(len(patch)):
        if patch[i] < 0 and (deepest < 0 or real[first + i, 9] < real[deepest, 9]):
            deepest = first + i
    return deepest


@inner
def _tangents(normal):
    """Return two unit tangents of a normal, the same for all normals near it."""
    pole = (1.0, 0.0, 0.0) if abs(normal[2]) > STEEP else (0.0, 0.0, 1.0)
    tangent = cross(pole, normal)
    length = sqrt(dot(tangent, tangent))
    tangent = (tangent[0] / length, tangent[1] / length, tangent[2] / length)
    return tangent, cross(normal, tangent)


@inner
def _extreme(real, integer, patch, label, first, direction, gap_weight):
    """Return the contact of a patch that lies farthest along a direction; of equal ones that of the least features; see the head."""
    best = -1
    farthest = 0.0
    for i in range(len(patch)):
        if patch[i] != label:
            continue
        at = first + i
        place = dot(row(real, at), direction)
        if gap_weight > 0.0:
            place -= gap_weight * real[at, 9]
        tie = TIE * (abs(place) + abs(farthest))
        earlier = best >= 0 and (integer[at, 3], integer[at, 4]) < (integer[best, 3], integer[best, 4])
        if best < 0 or place > farthest + tie or (place >= farthest - tie and earlier):
            best = at
            farthest = place
    return best


@jit_making_arrays
def reduce_contacts(real, integer, first, count, max_per_normal=MAX_PER_NORMAL, gap_weight=0.0):
    """Keep the contacts that carry load, of contacts [first, count), which belong to one pair of bodies.

    Contacts whose normals agree (`SAME_PATCH`) form a patch. Of a patch with more than `max_per_normal` contacts the
    deepest and the extreme ones in that many directions stay, unchanged and in their order; gap_weight: see the head. Returns the new
    count.
    """
    if count - first <= max_per_normal:
        return count
    patch = np.full(count - first, -1, np.int64)
    kept = np.zeros(count - first, np.bool_)
    label = np.int64(0)  # (a literal would compile `_extreme` twice)
    while True:
        leader = _deepest_left(real, patch, first)
        if leader < 0:
            break
        normal = (real[leader, 6], real[leader, 7], real[leader, 8])
        members = 0
        for i in range(len(patch)):
            at = first + i
            cosine = normal[0] * real[at, 6] + normal[1] * real[at, 7] + normal[2] * real[at, 8]
            if patch[i] < 0 and (at == leader or cosine > SAME_PATCH):
                patch[i] = label
                kept[i] = True
                members += 1
        # The extreme contacts in some directions stand for the corners of the hull, which carry any load of the patch.
        if members > max_per_normal:
            for i in range(len(patch)):
                kept[i] = kept[i] and patch[i] != label
            kept[leader - first] = True
            u, v = _tangents(normal)
            for k in range(max_per_normal):
                angle = 2.0 * pi * k / max_per_normal
                direction = along((cos(angle) * u[0], cos(angle) * u[1], cos(angle) * u[2]), sin(angle), v)
                kept[_extreme(real, integer, patch, label, first, direction, gap_weight) - first] = True
        label += 1
    end = first
    for i in range(len(patch)):
        if kept[i]:
            for column in range(real.shape[1]):
                real[end, column] = real[first + i, column]
            for column in range(integer.shape[1]):
                integer[end, column] = integer[first + i, column]
            end += 1
    return end
