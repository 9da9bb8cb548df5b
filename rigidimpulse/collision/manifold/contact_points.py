"""Contacts as kernels write them, and what the kernels of ROUND primitives share: tolerances, and one body seen from the other.

A contact of two bodies a and b is a point on the surface of each, the unit normal n from a to b, and the gap g along it:
point_b - point_a = g n. Its kind and its two features tell which vertex, edge or face of each body it belongs to. They are its id: a
contact of the same id in the next step is the same contact (a warm start needs that).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.simplices import CORNER, inner
from rigidimpulse.collision.manifold.kept_features import ContactScratch
from rigidimpulse.core.tolerances import TOLERANCES

INSIDE = TOLERANCES.manifold.inside
STRICT = TOLERANCES.manifold.arc
ROUND_OFF = TOLERANCES.manifold.point_round_off
DEPTH, MOST_DEPTH = TOLERANCES.manifold.depth, TOLERANCES.manifold.most_depth
TILT = 0.02
"""Greatest sine of the angle by which a contact within the margin may miss being locally closest."""
ANY = 2.0
"""Leeway with which every normal passes."""
MERGE = TOLERANCES.manifold.merge
SAME_NORMAL = 1.0 - TOLERANCES.manifold.same_normal
ALIKE_NORMAL = 0.99
"""The same for a CORNER, whose normal is the less certain."""


class View(NamedTuple):
    """The vertices of one body seen from the triangles of the other: y_t = R y_v + t."""

    flipped: bool  # the vertices are those of the second body
    R: np.ndarray  # (3, 3) from the frame of the vertices to that of the triangles
    t: np.ndarray  # (3,)
    R_back: np.ndarray  # (3, 3) the other way
    t_back: np.ndarray  # (3,)
    radius_v: float
    radius_t: float
    margin: float
    depth: float  # how far the surfaces may be inside each other, m
    skeleton: float  # greatest distance of the skeletons: margin and radii
    reach: float  # how far apart features are looked at: the larger of both, m
    slack: float  # how far a capsule may miss being locally closest, m
    leeway: float  # added to the sine by which a normal may miss an arc or a cone
    two_sided: bool  # the triangles bound no solid: their back is outside too


class Pose(NamedTuple):
    """The second body's frame in that of the first: y_first = R y_second + t."""

    R: np.ndarray  # (3, 3)
    t: np.ndarray  # (3,) m


class Contact(NamedTuple):
    """One contact of a first and a second body."""

    point_a: tuple[float, float, float]  # on the surface of the first, m
    point_b: tuple[float, float, float]  # on that of the second, m
    normal: tuple[float, float, float]  # unit, from first to second
    gap: float  # m
    kind: int | np.integer
    feature_a: int
    feature_b: int


class Contacts(NamedTuple):
    """Buffers for contacts, and scratch memory for finding them; they belong to the caller."""

    real: np.ndarray  # (c, 10) point_a (3), point_b (3), normal (3), gap; m
    integer: np.ndarray  # (c, 5) body_a, body_b (left to the caller), kind, feature_a, feature_b
    scratch: ContactScratch


class Found(NamedTuple):
    """The contacts of one pair of primitives, among which none is to be there twice."""

    real: np.ndarray
    integer: np.ndarray
    first: int  # place of the pair's first contact


@inner
def write_contact(real, integer, index, contact):
    """Write a contact at `index` if the buffer is large enough; return `index + 1` in any case, so that the size needed is known."""
    if index < real.shape[0]:
        for axis in range(3):
            real[index, axis] = contact.point_a[axis]
            real[index, 3 + axis] = contact.point_b[axis]
            real[index, 6 + axis] = contact.normal[axis]
        real[index, 9] = contact.gap
        integer[index, 2] = contact.kind
        integer[index, 3] = contact.feature_a
        integer[index, 4] = contact.feature_b
    return index + 1


@inner
def append_contact(found, count, contact, merge):
    """Append a contact to those `found` unless it is there already; `count`: contacts in the buffer, of all pairs.

    Of two that coincide within `merge` [m] the one of the lower kind stays.
    """
    real, integer, point_a, normal = found.real, found.integer, contact.point_a, contact.normal
    for other in range(found.first, min(count, real.shape[0])):
        if (
            abs(real[other, 0] - point_a[0]) > merge
            or abs(real[other, 1] - point_a[1]) > merge
            or abs(real[other, 2] - point_a[2]) > merge
        ):
            continue
        cosine = real[other, 6] * normal[0] + real[other, 7] * normal[1] + real[other, 8] * normal[2]
        uncertain = contact.kind == CORNER or integer[other, 2] == CORNER
        if cosine > (ALIKE_NORMAL if uncertain else SAME_NORMAL):
            if contact.kind < integer[other, 2]:
                write_contact(real, integer, other, contact)
            return count
    return write_contact(real, integer, count, contact)


@inner
def outside_box(p, q, low, high, margin):
    """Tell whether the box around two points is farther than `margin` from a box."""
    for k in range(3):
        if min(p[k], q[k]) > high[k] + margin or max(p[k], q[k]) < low[k] - margin:
            return True
    return False
