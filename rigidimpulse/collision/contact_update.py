"""Contacts of general pairs: those for which the contact cache has no kernel of its own.

The kernels of `manifold.dispatch` need bodies that are apart, and soft contacts sink in. So the search is done with smaller shapes. Convex
bodies are shrunk about their centre of mass by the factor SHRINK: normals stay the same, and points are put back on the true body. Other
bodies that move have an inset surface (`manifold.inset_surface`). If even these shapes overlap, a pair keeps the contacts it had before.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.contact_cache import note_seen
from rigidimpulse.collision.contact_matching import NEAR, match_contacts, set_contact_margin, write_point
from rigidimpulse.collision.contact_records import ROUND_A, ROUND_B, SKELETON_A, SKELETON_B, SKIN, turned
from rigidimpulse.collision.distance.epa import make_polytope
from rigidimpulse.collision.distance.gjk import make_simplex
from rigidimpulse.collision.manifold.dispatch import reduce_contacts
from rigidimpulse.collision.manifold.inset_surface import put_back
from rigidimpulse.collision.manifold.penetrating import gap_along, overlap_contacts, support
from rigidimpulse.collision.manifold.polyhedra import POINTS, make_scratch
from rigidimpulse.collision.manifold.rounding import only_primitive, side_radius
from rigidimpulse.core.kernels import jit, jit_making_arrays

PER_NORMAL = np.int64(4)
"""Contacts kept of one normal, in addition to the deepest."""
FARTHER = 1.5
"""Distance of the search in margins: a pair without contacts is then known to be apart for some time."""


@jit
def _contradicts(bodies, pairs, p, points, new, new_end):
    """Whether the new contacts of a pair are impossible: there are none though an old one is closed, or its normal has turned round."""
    a, b = pairs.first[p], pairs.second[p]
    carrier = b if pairs.carrier[p] else a
    for o in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
        row = points[o]
        nx, ny, nz = turned(bodies.rotation, carrier, row[0], row[1], row[2])
        ax, ay, az = turned(bodies.rotation, a, row[SKELETON_A], row[SKELETON_A + 1], row[SKELETON_A + 2])
        bx, by, bz = turned(bodies.rotation, b, row[SKELETON_B], row[SKELETON_B + 1], row[SKELETON_B + 2])
        gap = (
            (bodies.position[b, 0] - bodies.position[a, 0] + bx - ax) * nx
            + (bodies.position[b, 1] - bodies.position[a, 1] + by - ay) * ny
            + (bodies.position[b, 2] - bodies.position[a, 2] + bz - az) * nz
        ) - (row[ROUND_A] + row[ROUND_B])
        if new == new_end and gap < row[SKIN]:
            return True
        if gap > row[SKIN]:
            continue
        lowest, highest = 1.0, -1.0
        for c in range(new, new_end):
            cosine = points[c, 0] * row[0] + points[c, 1] * row[1] + points[c, 2] * row[2]
            lowest, highest = min(lowest, cosine), max(highest, cosine)
        # Bodies that hook into each other have normals in both directions.
        if lowest < -0.5 and highest < 0.0:
            return True
    return False


@jit
def _is_sound(geometry, bodies, factor, a, b, real, first, last):
    """Whether the shrunk bodies are apart along the normal of one of their contacts."""
    p, q = geometry.shape_first[bodies.shape[a]], geometry.shape_first[bodies.shape[b]]
    for s in range(first, last):
        gap = gap_along(geometry, bodies, a, b, p, q, real[s, 6:9])
        if gap + _shrunk_by(geometry, bodies, factor, a, b, p, q, real[s, 6:9]) > 0.0:
            return True
    return False


@jit
def _shrunk_by(geometry, bodies, factor, a, b, p, q, n):
    """How much wider the gap along n is between the shrunk bodies, m."""
    x, y = bodies.position[a], bodies.position[b]
    reach_a = support(geometry, p, x, bodies.rotation[a], n, 1.0) - (n[0] * x[0] + n[1] * x[1] + n[2] * x[2])
    reach_b = support(geometry, q, y, bodies.rotation[b], n, -1.0) + (n[0] * y[0] + n[1] * y[1] + n[2] * y[2])
    return (1.0 - factor[a]) * reach_a + (1.0 - factor[b]) * reach_b


@jit_making_arrays
def _write(geometry, bodies, margin_at_rest, a, b, carrier, real, c, factor_a, factor_b, coefficients, points, r):
    """Write point r from the contact real[c] (10,) of bodies a and b, given in the world; returns its separation."""
    round_a = side_radius(geometry, only_primitive(geometry, bodies.shape[a]), bodies.rotation[a], real[c, 6:9])
    round_b = side_radius(geometry, only_primitive(geometry, bodies.shape[b]), bodies.rotation[b], real[c, 6:9])
    for k in range(3):
        real[c, k] -= bodies.position[a, k]
        real[c, 3 + k] -= bodies.position[a, k]
    return write_point(
        bodies.position, bodies.rotation, bodies.material, bodies.skin, margin_at_rest, a, b, carrier, real, c, round_a, round_b,
        factor_a, factor_b, coefficients, points, r,
    )  # fmt: skip


@jit_making_arrays
def store_contacts(
    geometry, shown, back, polyhedra, bodies, pairs, places, margins, far, convex, factor, depth, coefficients, real, integer, count, order,
    points, ids, used,
):
    """Store the contacts found for the pairs at `places` in points from `used` on, with the impulses of those they replace.

    real, integer: `count` contacts in the order of the places, `integer[:, :2]` by indices of the scene, order (n,) indices by rank;
    geometry: the true shapes; shown: the shapes for the search; back, depth (n,) m by rank: see `inset_surface`; polyhedra: for convex
    bodies (n,) bool inside each other, see `penetrating`; factor (n,), by rank as well; margins (k,) m; far (k,) m: distance of the
    search. Returns the points used.
    """
    c = np.int64(0)
    deep, deep_ids = np.empty((POINTS + 1, 10)), np.empty((POINTS + 1, 3), np.int64)
    work = np.empty(3), np.zeros(3), np.empty((3, 3)), make_simplex(), make_polytope(), make_scratch()
    for k in range(places.shape[0]):
        p = places[k]
        a, b = pairs.first[p], pairs.second[p]
        first = c
        while c < count and integer[c, 0] == order[a] and integer[c, 1] == order[b]:
            c += 1
        last = reduce_contacts(real, integer, first, c, PER_NORMAL)
        new = used
        size = min(bodies.inner[a], bodies.inner[b])
        carrier = pairs.carrier[p]
        if pairs.count[p] == 0:
            pairs.contact_margin[p] = min(bodies.skin[a], bodies.skin[b])
        margin_at_rest = pairs.contact_margin[p]
        deep_count = 0
        if convex[a] and convex[b] and factor[a] * factor[b] < 1.0 and not _is_sound(geometry, bodies, factor, a, b, real, first, last):
            deep_count = overlap_contacts(polyhedra, bodies, a, b, size, work, deep, deep_ids)
        for s in range(deep_count if deep_count > 0 else last - first):
            if deep_count > 0:
                separation = _write(geometry, bodies, margin_at_rest, a, b, carrier, deep, s, 1.0, 1.0, coefficients, points, used)
                ids[used] = deep_ids[s]
            else:
                put_back(shown, back, depth, bodies, a, b, real, integer, first + s)
                separation = _write(
                    geometry, bodies, margin_at_rest, a, b, carrier, real, first + s, factor[a], factor[b], coefficients, points, used
                )
                ids[used] = integer[first + s, 2:]
            if separation <= margins[k]:
                used += 1
        if deep_count == 0 and _contradicts(bodies, pairs, p, points, new, used):
            used = new
        else:
            if pairs.count[p] == 0:
                set_contact_margin(pairs.contact_margin, p, points, new, used)
            old = pairs.start[p]
            match_contacts(points, ids, old, old + pairs.count[p], points, ids, new, used, NEAR * size)
            pairs.start[p], pairs.count[p], pairs.capacity[p] = new, used - new, used - new
        pairs.apart[p] = far[k] if pairs.count[p] == 0 and deep_count == 0 and last == first else 0.0
        note_seen(bodies, pairs, p)
    return used
