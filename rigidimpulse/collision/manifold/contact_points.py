"""What the contact kernels of ROUND primitives share: tolerances, one body seen from the other, the contacts they write."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.simplices import CORNER, inner, write_contact

INSIDE = 1e-11
"""How far outside a face or an edge a point still counts as inside, relative to the edge."""
STRICT = 1e-9
"""Sine of the angle by which a normal may miss an arc or a cone."""
ROUND_OFF = 1e-15
"""Error of a point, relative to its coordinates."""
PENETRATION = 1e-9
"""Depth down to which a contact of faces or edges is still recognised, relative to the edge."""
TILT = 0.02
"""Greatest sine of the angle by which a contact within the margin may miss being locally closest."""
ANY = 2.0
"""Leeway with which every normal passes."""
MERGE = 1e-9
"""Distance below which two contacts are one, relative to the edge."""
SAME_NORMAL = 1.0 - 1e-9
"""Cosine of the angle below which normals at one place are one."""
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
    skeleton: float  # greatest distance of the skeletons: margin and radii
    slack: float  # how far a capsule may miss being locally closest, m
    leeway: float  # added to the sine by which a normal may miss an arc or a cone
    two_sided: bool  # the triangles bound no solid: their back is outside too


@inner
def append_contact(rows, count, point_a, point_b, normal, gap, kind, feature_a, feature_b, merge):
    """Append a contact to `rows` (contact_real, contact_int, first row) unless it is there already.

    Of two that coincide within `merge` [m] the one of the lower kind stays.
    """
    real, integer, first_row = rows
    for other in range(first_row, min(count, real.shape[0])):
        if (
            abs(real[other, 0] - point_a[0]) > merge
            or abs(real[other, 1] - point_a[1]) > merge
            or abs(real[other, 2] - point_a[2]) > merge
        ):
            continue
        cosine = real[other, 6] * normal[0] + real[other, 7] * normal[1] + real[other, 8] * normal[2]
        uncertain = kind == CORNER or integer[other, 2] == CORNER
        if cosine > (ALIKE_NORMAL if uncertain else SAME_NORMAL):
            if kind < integer[other, 2]:
                write_contact(real, integer, other, point_a, point_b, normal, gap, kind, feature_a, feature_b)
            return count
    return write_contact(real, integer, count, point_a, point_b, normal, gap, kind, feature_a, feature_b)


@inner
def outside_box(p, q, low, high, margin):
    """Tell whether the box around two points is farther than `margin` from a box."""
    for k in range(3):
        if min(p[k], q[k]) > high[k] + margin or max(p[k], q[k]) < low[k] - margin:
            return True
    return False
