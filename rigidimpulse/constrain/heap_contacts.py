"""Contacts of heaps: pairs that are near, their manifolds as rows, kept while the bodies hardly move past each other.

Manifolds come from the kernels of `detect`, which want bodies apart. So that soft contacts may sink in, convex bodies are
shown to them shrunk about their centre of mass by `shrunk` of all lengths: normals stay the same, and points are put
back to where they are on the true body. Other bodies are shown as they are; where they overlap, the contacts they had
before they did are kept.

A pair is looked at again when it has moved so far that it may have other contacts: separate ones when they may have come
within the skin, touching ones after a slide of SLIDE of the smaller body's inner radius or a turn of TURN.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.contact_motion import only_primitive, side_radius
from rigidimpulse.constrain.heap_overlap import FLUSH, deepest_normal, gap_along, overlap_contacts, support
from rigidimpulse.constrain.heap_rows import (
    APPROACH,
    CORE_A,
    CORE_B,
    DYNAMIC_FRICTION,
    FRICTION,
    IMPULSE,
    MASS_N,
    RESTITUTION,
    ROUND_A,
    ROUND_B,
    SEPARATION,
    SKIN,
    STATIC_FRICTION,
    pair_speeds,
    turned_row,
)
from rigidimpulse.conventions import TOLERANCES
from rigidimpulse.detect.manifold import reduce_contacts
from rigidimpulse.geometry import CYLINDER, HALF_SPACE, ROUND, Geometry

SHRINK = 1.5 * TOLERANCES.skin
"""Part of their lengths by which convex bodies are shrunk for the contact kernels."""
SLIDE, TURN = 0.04, 0.03
"""Part of the inner radius, and rad, after which touching pairs are looked at again."""
AHEAD, FARTHEST = 0.2, 1.0
"""Contacts are looked for at least and at most that many inner radii away."""
MOST_SUNK = 8
"""Contacts of a pair of bodies that sank into each other, at most."""
POINTS = np.int64(4)
"""Contacts kept of one normal, beside the deepest."""
NEAR = 0.2
"""Inner radii within which an old contact hands its impulse to a new one of other features."""


def inner_radii(geometry: Geometry) -> np.ndarray:
    """Distance (s,) from the centre of mass of each shape to its nearest face, m; inf for half spaces.

    Shapes that are no single convex piece count with a tenth of the radius that encloses them.
    """
    out = np.full(len(geometry.shape_first) - 1, np.inf)
    for s in range(len(out)):
        first, last = int(geometry.shape_first[s]), int(geometry.shape_first[s + 1])
        if np.all(geometry.kind[first:last] == HALF_SPACE):
            continue
        depth = _convex_depth(geometry, first) if last == first + 1 else 0.0
        reach = np.linalg.norm(geometry.bound_centre[first:last], axis=1) + geometry.bound_radius[first:last]
        out[s] = depth if depth > 0.0 else 0.1 * float(reach[np.isfinite(reach)].max())
    return out


def _convex_depth(geometry: Geometry, p: int) -> float:
    """Distance from the centre of mass to the nearest face of a convex primitive, m; 0 where it is none or does not hold the centre."""
    if geometry.kind[p] == CYLINDER:
        centre, axis, half = geometry.frame[p, :3], geometry.frame[p, 3:6], geometry.frame[p, 6]
        along = float(centre @ axis)
        return float(min(half - abs(along), geometry.radius[p] - np.linalg.norm(centre - along * axis)))
    vertices = geometry.vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]]
    faces = slice(int(geometry.triangle_first[p]), int(geometry.triangle_first[p + 1]))
    normals = geometry.triangle_normal[faces]
    if not np.any(normals):
        # A ball or a capsule.
        return float(geometry.radius[p]) if np.abs(vertices.sum(0)).max() <= 1e-9 * geometry.bound_radius[p] else 0.0
    depth = np.einsum("ij,ij->i", normals, geometry.vertex[geometry.triangle[faces, 0]])
    size = float(geometry.bound_radius[p])
    for n, d in zip(normals, depth, strict=True):
        if d <= 0.0 or float((vertices @ n).max()) > d + 1e-9 * size:
            return 0.0
    return float(depth.min() + geometry.radius[p])


def convex_polyhedra(geometry: Geometry) -> np.ndarray:
    """Which shapes (s,) bool are one convex polyhedron around their centre of mass, with sharp edges."""
    out = np.zeros(len(geometry.shape_first) - 1, bool)
    for s in range(len(out)):
        p = int(geometry.shape_first[s])
        single = geometry.shape_first[s + 1] == p + 1 and geometry.kind[p] == ROUND and geometry.radius[p] == 0.0
        out[s] = single and _convex_depth(geometry, p) > 0.0
    return out


def shrunk_geometry(geometry: Geometry, dynamic_shapes: np.ndarray) -> tuple[Geometry, np.ndarray]:
    """The shapes as the contact kernels are shown them, and the factor (s,) of their lengths; 1 where they are as they were.

    dynamic_shapes (s,) bool: shapes of bodies that move freely.
    """
    factor = np.ones(len(geometry.shape_first) - 1)
    vertex, frame, radius = geometry.vertex.copy(), geometry.frame.copy(), geometry.radius.copy()
    low, high = geometry.node_min.copy(), geometry.node_max.copy()
    centre, bound = geometry.bound_centre.copy(), geometry.bound_radius.copy()
    for s in np.flatnonzero(dynamic_shapes):
        p = int(geometry.shape_first[s])
        rounded = geometry.kind[p] == ROUND and geometry.radius[p] > 0.0
        if geometry.shape_first[s + 1] != p + 1 or geometry.kind[p] == HALF_SPACE or rounded or _convex_depth(geometry, p) <= 0.0:
            continue
        factor[s] = 1.0 - SHRINK
        vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]] *= factor[s]
        nodes = slice(int(geometry.node_first[p]), int(geometry.node_first[p + 1]))
        low[nodes] *= factor[s]
        high[nodes] *= factor[s]
        centre[p] *= factor[s]
        bound[p] *= factor[s]
        if geometry.kind[p] == CYLINDER:
            frame[p, :3] *= factor[s]
            frame[p, 6] *= factor[s]
            radius[p] *= factor[s]
    return geometry._replace(
        vertex=vertex, frame=frame, radius=radius, node_min=low, node_max=high, bound_centre=centre, bound_radius=bound
    ), factor


@jit
def margins(bodies, pairs, places, inner, skin, ahead, out):
    """How far away contacts of the pairs at `places` are looked for, (k,) m: as far as they come in `ahead` s, within bounds."""
    for k in range(places.shape[0]):
        p = places[k]
        speed, _ = pair_speeds(bodies, pairs, p)
        size = min(inner[pairs.first[p]], inner[pairs.second[p]])
        out[k] = min(skin[pairs.first[p]], skin[pairs.second[p]]) + min(max(speed * ahead, AHEAD * size), FARTHEST * size)


@jit
def _write(geometry, shape, coefficients, bodies, factor, skin, a, b, real, row):
    """A new row of the contact `real` (10,) of bodies a and b, without impulse, and its separation."""
    n = real[6:9]
    ra, rb = bodies.rotation[a], bodies.rotation[b]
    round_a = side_radius(geometry, only_primitive(geometry, shape[a]), ra, n)
    round_b = side_radius(geometry, only_primitive(geometry, shape[b]), rb, n)
    arm_a, arm_b = np.empty(3), np.empty(3)
    row[:] = 0.0
    separation = 0.0
    for k in range(3):
        arm_a[k] = (real[k] - bodies.position[a, k]) / factor[a] - round_a * n[k]
        arm_b[k] = (real[3 + k] - bodies.position[b, k]) / factor[b] + round_b * n[k]
        row[k] = n[k]
        separation += n[k] * ((bodies.position[b, k] - bodies.position[a, k]) + (arm_b[k] - arm_a[k]))
    for k in range(3):
        row[CORE_A + k] = ra[0, k] * arm_a[0] + ra[1, k] * arm_a[1] + ra[2, k] * arm_a[2]
        row[CORE_B + k] = rb[0, k] * arm_b[0] + rb[1, k] * arm_b[1] + rb[2, k] * arm_b[2]
    row[ROUND_A], row[ROUND_B] = round_a, round_b
    row[RESTITUTION], row[STATIC_FRICTION], row[DYNAMIC_FRICTION] = coefficients[0], coefficients[1], coefficients[2]
    row[SKIN] = min(skin[a], skin[b])
    row[SEPARATION] = separation - (round_a + round_b) - row[SKIN]


@jit
def _approach(bodies, a, b, row):
    """u.n of a new row, m/s."""
    va, vb = bodies.velocity[a], bodies.velocity[b]
    xa, ya, za = turned_row(bodies.rotation[a], row, CORE_A)
    xb, yb, zb = turned_row(bodies.rotation[b], row, CORE_B)
    x = (vb[0] + vb[4] * zb - vb[5] * yb) - (va[0] + va[4] * za - va[5] * ya)
    y = (vb[1] + vb[5] * xb - vb[3] * zb) - (va[1] + va[5] * xa - va[3] * za)
    z = (vb[2] + vb[3] * yb - vb[4] * xb) - (va[2] + va[3] * ya - va[4] * xa)
    return x * row[0] + y * row[1] + z * row[2]


@jit
def _hand_over(rows, ids, old, old_end, new, new_end, near):
    """Give new rows the impulses of the old ones of the same features, else of one nearby with much the same normal."""
    taken = np.zeros(old_end - old, np.bool_)
    for nearby in range(2):
        for c in range(new, new_end):
            if rows[c, IMPULSE] > 0.0:
                continue
            for o in range(old, old_end):
                if taken[o - old]:
                    continue
                cosine = rows[c, 0] * rows[o, 0] + rows[c, 1] * rows[o, 1] + rows[c, 2] * rows[o, 2]
                same = ids[c, 0] == ids[o, 0] and ids[c, 1] == ids[o, 1] and ids[c, 2] == ids[o, 2]
                if nearby == 1:
                    x, y = rows[c, CORE_A] - rows[o, CORE_A], rows[c, CORE_A + 1] - rows[o, CORE_A + 1]
                    z = rows[c, CORE_A + 2] - rows[o, CORE_A + 2]
                    same = x * x + y * y + z * z < near * near
                if not same or cosine < 0.9:
                    continue
                taken[o - old] = True
                rows[c, APPROACH] = rows[o, APPROACH]
                rows[c, IMPULSE] = rows[o, IMPULSE]
                along = 0.0
                for k in range(3):
                    along += rows[o, FRICTION + k] * rows[c, k]
                for k in range(3):
                    rows[c, FRICTION + k] = rows[o, FRICTION + k] - along * rows[c, k]
                break


@jit
def _contradicts(bodies, pairs, p, rows, new, new_end):
    """Whether the new contacts of a pair cannot be: there are none though an old one is closed, or a normal has turned round."""
    a, b = pairs.first[p], pairs.second[p]
    for o in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
        row = rows[o]
        ax, ay, az = turned_row(bodies.rotation[a], row, CORE_A)
        bx, by, bz = turned_row(bodies.rotation[b], row, CORE_B)
        gap = (
            (bodies.position[b, 0] - bodies.position[a, 0] + bx - ax) * row[0]
            + (bodies.position[b, 1] - bodies.position[a, 1] + by - ay) * row[1]
            + (bodies.position[b, 2] - bodies.position[a, 2] + bz - az) * row[2]
        ) - (row[ROUND_A] + row[ROUND_B])
        if new == new_end and gap < row[SKIN]:
            return True
        if gap > row[SKIN]:
            continue
        for c in range(new, new_end):
            if rows[c, 0] * row[0] + rows[c, 1] * row[1] + rows[c, 2] * row[2] < -0.5:
                return True
    return False


@jit
def _sunk(geometry, shape, bodies, convex, factor, a, b, real, first, last, flush, deep, deep_ids):
    """Contacts into deep (cap, 10), deep_ids (cap, 3) of convex bodies that the kernels found no sound contact for; their number."""
    if not (convex[a] and convex[b]) or factor[a] * factor[b] == 1.0:
        return 0
    p, q = geometry.shape_first[shape[a]], geometry.shape_first[shape[b]]
    bearing = np.empty(3)
    for s in range(first, last):
        # Along a sound contact's normal the shrunk bodies are apart.
        gap = gap_along(geometry, bodies, a, b, p, q, real[s, 6:9])
        if gap + _shrunk_by(geometry, bodies, factor, a, b, p, q, real[s, 6:9]) > 0.0:
            return 0
    depth, of_b = deepest_normal(geometry, bodies, a, b, p, q, bearing)
    if depth > 0.0:
        return 0
    return overlap_contacts(geometry, bodies, a, b, p, q, bearing, depth, of_b, flush, deep, deep_ids)


@jit
def _shrunk_by(geometry, bodies, factor, a, b, p, q, n):
    """How much wider the gap along n is between the shrunk bodies, m."""
    x, y = bodies.position[a], bodies.position[b]
    reach_a = support(geometry, p, x, bodies.rotation[a], n, 1.0) - (n[0] * x[0] + n[1] * x[1] + n[2] * x[2])
    reach_b = support(geometry, q, y, bodies.rotation[b], n, -1.0) + (n[0] * y[0] + n[1] * y[1] + n[2] * y[2])
    return (1.0 - factor[a]) * reach_a + (1.0 - factor[b]) * reach_b


@jit
def store_contacts(
    geometry, shape, material, coefficients, convex, bodies, pairs, places, margin, radius, inner, skin, factor, real, integer, count, body,
    rows, ids, used,
):  # fmt: skip
    """Put the contacts found for the pairs at `places` into rows from `used` on, with the impulses of those they replace.

    real, integer: `count` contacts in the order of the places, `integer[:, :2]` as in the scene, `body` (l,) their indices there;
    shape, material, convex (polyhedra), radius (about the centre of mass), inner, skin, factor by body number. Returns the rows used.
    """
    c = np.int64(0)
    deep, deep_ids, one = np.empty((MOST_SUNK, 10)), np.empty((MOST_SUNK, 3), np.int64), np.ones(factor.shape[0])
    for k in range(places.shape[0]):
        p = places[k]
        a, b = pairs.first[p], pairs.second[p]
        first = c
        while c < count and integer[c, 0] == body[a] and integer[c, 1] == body[b]:
            c += 1
        last = reduce_contacts(real, integer, first, c, POINTS)
        new = used
        size = min(inner[a], inner[b])
        nearest = margin[k]
        sunk = _sunk(geometry, shape, bodies, convex, factor, a, b, real, first, last, FLUSH * size, deep, deep_ids)
        for s in range(sunk if sunk > 0 else last - first):
            if sunk > 0:
                _write(geometry, shape, coefficients[material[a], material[b]], bodies, one, skin, a, b, deep[s], rows[used])
                ids[used] = deep_ids[s]
            else:
                at = first + s
                _write(geometry, shape, coefficients[material[a], material[b]], bodies, factor, skin, a, b, real[at], rows[used])
                ids[used] = integer[at, 2:]
            rows[used, APPROACH] = _approach(bodies, a, b, rows[used])
            if rows[used, SEPARATION] <= margin[k]:
                nearest = min(nearest, rows[used, SEPARATION] + rows[used, SKIN])
                used += 1
        if sunk == 0 and _contradicts(bodies, pairs, p, rows, new, used):
            used = new
            for o in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
                rows[o, MASS_N] = 0.0
        else:
            _hand_over(rows, ids, pairs.start[p], pairs.start[p] + pairs.count[p], new, used, NEAR * size)
            pairs.start[p], pairs.count[p] = new, used - new
        allowed = margin[k] - min(skin[a], skin[b])
        if pairs.count[p] == 0:
            between = bodies.position[b] - bodies.position[a]
            apart = sqrt(between[0] ** 2 + between[1] ** 2 + between[2] ** 2) - radius[a] - radius[b] - min(skin[a], skin[b])
            pairs.slide[p] = max(allowed, apart)
        else:
            pairs.slide[p] = min(allowed, max(SLIDE * size, nearest))
        pairs.turn[p] = TURN
    return used
