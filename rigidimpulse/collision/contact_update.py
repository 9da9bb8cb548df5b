"""Contacts of heaps that the kernels of `detect` find: of all pairs but those that `heap_narrow` knows by itself.

Those kernels want bodies apart. So that soft contacts may sink in, convex bodies are shown to them shrunk about their centre of
mass by `shrunk` of all lengths: normals stay the same, and points are put back to where they are on the true body. Other bodies
that move are shown by their cores (`heap_cores`); where even these overlap, the contacts they had before they did are kept.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.contact_cache import note_seen
from rigidimpulse.collision.contact_matching import NEAR, hand_over, take_up, write_row
from rigidimpulse.collision.contact_records import ROUND_A, ROUND_B, SKELETON_A, SKELETON_B, SKIN
from rigidimpulse.collision.distance.epa import make_polytope
from rigidimpulse.collision.distance.gjk import make_simplex
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, Geometry
from rigidimpulse.collision.manifold.dispatch import reduce_contacts
from rigidimpulse.collision.manifold.inset_surface import put_back
from rigidimpulse.collision.manifold.penetrating import gap_along, overlap_contacts, support
from rigidimpulse.collision.manifold.polyhedra import POINTS, make_scratch
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import turned_by
from rigidimpulse.dynamics.constraints.contact_motion import only_primitive, side_radius

SHRINK = 1.5 * TOLERANCES.sub_stepping.skin
"""Part of their lengths by which convex bodies are shrunk for the contact kernels."""
PER_NORMAL = np.int64(4)
"""Contacts kept of one normal, beside the deepest."""
FARTHER = 1.5
"""Margins within which contacts are looked for, so that a pair without any is known to be apart for a while."""


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
def _contradicts(bodies, pairs, p, rows, new, new_end):
    """Whether the new contacts of a pair cannot be: there are none though an old one is closed, or its normal has turned round."""
    a, b = pairs.first[p], pairs.second[p]
    carrier = b if pairs.carrier[p] else a
    for o in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
        row = rows[o]
        nx, ny, nz = turned_by(bodies.rotation, carrier, row[0], row[1], row[2])
        ax, ay, az = turned_by(bodies.rotation, a, row[SKELETON_A], row[SKELETON_A + 1], row[SKELETON_A + 2])
        bx, by, bz = turned_by(bodies.rotation, b, row[SKELETON_B], row[SKELETON_B + 1], row[SKELETON_B + 2])
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
            cosine = rows[c, 0] * row[0] + rows[c, 1] * row[1] + rows[c, 2] * row[2]
            lowest, highest = min(lowest, cosine), max(highest, cosine)
        # (Bodies that hook into each other have normals either way.)
        if lowest < -0.5 and highest < 0.0:
            return True
    return False


@jit
def _is_sound(geometry, bodies, factor, a, b, real, first, last):
    """Whether the shrunk bodies are apart along the normal of a contact found for them."""
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
def _write(geometry, bodies, held, a, b, carrier, real, c, factor_a, factor_b, coefficients, rows, r):
    """A new row r of the contact real[c] (10,) of bodies a and b, with places in the world; returns its separation."""
    round_a = side_radius(geometry, only_primitive(geometry, bodies.shape[a]), bodies.rotation[a], real[c, 6:9])
    round_b = side_radius(geometry, only_primitive(geometry, bodies.shape[b]), bodies.rotation[b], real[c, 6:9])
    for k in range(3):
        real[c, k] -= bodies.position[a, k]
        real[c, 3 + k] -= bodies.position[a, k]
    return write_row(
        bodies.position, bodies.rotation, bodies.material, bodies.skin, held, a, b, carrier, real, c, round_a, round_b, factor_a, factor_b,
        coefficients, rows, r,
    )  # fmt: skip


@jit_making_arrays
def store_contacts(
    geometry, shown, back, polyhedra, bodies, pairs, places, margins, far, convex, factor, depth, coefficients, real, integer, count, order,
    rows, ids, used,
):
    """Put the contacts found for the pairs at `places` into rows from `used` on, with the impulses of those they replace.

    real, integer: `count` contacts in the order of the places, `integer[:, :2]` by indices of the scene, order (n,) indices by rank;
    geometry: the true shapes; shown: as the contacts were found; back, depth (n,) m by rank: see `heap_cores`; polyhedra: by which bodies
    inside each other are found, of those that are convex (n,) bool, see `heap_overlap`; these and factor (n,) by rank; margins (k,) m,
    far (k,) m: up to where pairs without contacts are known to be apart. Returns the rows used.
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
            pairs.held[p] = min(bodies.skin[a], bodies.skin[b])
        held = pairs.held[p]
        sunk = 0
        if convex[a] and convex[b] and factor[a] * factor[b] < 1.0 and not _is_sound(geometry, bodies, factor, a, b, real, first, last):
            sunk = overlap_contacts(polyhedra, bodies, a, b, size, work, deep, deep_ids)
        for s in range(sunk if sunk > 0 else last - first):
            if sunk > 0:
                separation = _write(geometry, bodies, held, a, b, carrier, deep, s, 1.0, 1.0, coefficients, rows, used)
                ids[used] = deep_ids[s]
            else:
                put_back(shown, back, depth, bodies, a, b, real, integer, first + s)
                separation = _write(geometry, bodies, held, a, b, carrier, real, first + s, factor[a], factor[b], coefficients, rows, used)
                ids[used] = integer[first + s, 2:]
            if separation <= margins[k]:
                used += 1
        if sunk == 0 and _contradicts(bodies, pairs, p, rows, new, used):
            used = new
        else:
            if pairs.count[p] == 0:
                take_up(pairs.held, p, rows, new, used)
            old = pairs.start[p]
            hand_over(rows, ids, old, old + pairs.count[p], rows, ids, new, used, NEAR * size)
            pairs.start[p], pairs.count[p], pairs.capacity[p] = new, used - new, used - new
        pairs.apart[p] = far[k] if pairs.count[p] == 0 and sunk == 0 and last == first else 0.0
        note_seen(bodies, pairs, p)
    return used
