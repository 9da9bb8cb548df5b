"""Contacts of general pairs: those for which the contact cache has no kernel of its own.

The kernels of `manifold.dispatch` need bodies that are apart, and soft contacts sink in. So the search is done with smaller shapes, and
what it finds is put back on the true ones (`manifold.smaller_shapes`). Where even these overlap, two convex bodies get contacts of the true
ones (`manifold.penetrating`), and so do corners of a mesh in a convex body (`manifold.sunk_corners`). Other pairs keep those they had.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_cache import moved_since_seen, note_seen
from rigidimpulse.collision.contact_matching import NEAR, Points, Source, match_contacts, set_contact_margin, write_point
from rigidimpulse.collision.contact_records import ROUND_A, ROUND_B, SKELETON_A, SKELETON_B, SKIN
from rigidimpulse.collision.manifold.dispatch import Posed, pair_gap
from rigidimpulse.collision.manifold.penetrating import gap_along, overlap_contacts, support
from rigidimpulse.collision.manifold.polyhedra import POINTS, Polyhedra, make_scratch
from rigidimpulse.collision.manifold.polyhedra import Points as Found
from rigidimpulse.collision.manifold.reduce import GAP_WEIGHT, PER_NORMAL, reduce_contacts
from rigidimpulse.collision.manifold.rounding import only_primitive, side_radius
from rigidimpulse.collision.manifold.smaller_shapes import level_of, put_back
from rigidimpulse.collision.manifold.sunk_corners import sunk_corners
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.vector import along, dot, row, turned_by

FARTHER = 1.5
"""Distance of the search in margins: a pair without contacts is then known to be apart for some time."""


FARTHEST = 2.5
"""The same of the gap of meshes."""


class Deep(NamedTuple):
    """Contacts of convex bodies that are deeper inside each other than the smaller shapes allow."""

    convex: np.ndarray  # (n,) bool, by rank: bodies in `solids`
    solids: Polyhedra  # see `penetrating`


class Searched(NamedTuple):
    """Pairs (k,) that were searched, in the order of the contacts found."""

    places: np.ndarray  # (k,) in the table
    margins: np.ndarray  # (k,) m, greatest gap of a contact that is kept
    far: np.ndarray  # (k,) m, distance of the search


class Asked(NamedTuple):
    """What `manifold.dispatch` is asked about the k pairs, and where the n bodies are, for each of the L levels of their shapes."""

    a: np.ndarray  # (k,)
    b: np.ndarray  # (k,)
    shown: np.ndarray  # (k,) m, distance of the search, between the shapes that are asked about
    far: np.ndarray  # (k,) m, the same between the true ones
    position: np.ndarray  # (L n, 3) m
    orientation: np.ndarray  # (L n, 4)
    rotation: np.ndarray  # (L n, 3, 3)
    is_apart: np.ndarray  # (k,) bool, there is no contact, see `mark_apart`


def make_asked(pairs: int, number: int) -> Asked:
    """Space for questions about `pairs` pairs of bodies; number: of bodies and levels, n L."""
    a, b, shown, far = np.zeros(pairs, np.int64), np.zeros(pairs, np.int64), np.zeros(pairs), np.zeros(pairs)
    return Asked(a, b, shown, far, np.zeros((number, 3)), np.zeros((number, 4)), np.zeros((number, 3, 3)), np.zeros(pairs, bool))


@jit
def _gap_now(bodies, pairs, p, point):
    """Gap of a contact point of pair p as the bodies are now, m, and its normal."""
    a, b = pairs.first[p], pairs.second[p]
    nx, ny, nz = turned_by(bodies.rotation, b if pairs.carrier[p] else a, point[0], point[1], point[2])
    ax, ay, az = turned_by(bodies.rotation, a, point[SKELETON_A], point[SKELETON_A + 1], point[SKELETON_A + 2])
    bx, by, bz = turned_by(bodies.rotation, b, point[SKELETON_B], point[SKELETON_B + 1], point[SKELETON_B + 2])
    apart = (
        (bodies.position[b, 0] - bodies.position[a, 0] + bx - ax) * nx
        + (bodies.position[b, 1] - bodies.position[a, 1] + by - ay) * ny
        + (bodies.position[b, 2] - bodies.position[a, 2] + bz - az) * nz
    )
    return apart - (point[ROUND_A] + point[ROUND_B]), nx, ny, nz


@jit
def _deepest(smaller, bodies, table, p):
    """How deep the bodies of a pair may be inside each other, m: at the contacts that it had, and at others with the same normals.

    Where a flat body wobbles, other corners or points of its rim are the lowest by now: such bodies lost all contacts on a floor that is a
    mesh. So the support s(n) of the body in the plane of each contact counts, up to how far the pair has moved since the last look.
    """
    pairs, points, _, _ = table
    a, b = pairs.first[p], pairs.second[p]
    deepest, sunk = 0.0, 0.0
    # Only beside what is not convex do smaller shapes have more levels.
    is_first, is_one = smaller.deeper[a], smaller.deeper[a] != smaller.deeper[b]
    i, other, at, sign = (a, b, SKELETON_B, 1.0) if is_first else (b, a, SKELETON_A, -1.0)
    primitive = smaller.geometry.shape_first[bodies.shape[i]]
    for r in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
        point = points[r]
        gap, nx, ny, nz = _gap_now(bodies, pairs, p, point)
        deepest, n = max(deepest, -gap), (nx, ny, nz)
        if is_one:
            on = turned_by(bodies.rotation, other, point[at], point[at + 1], point[at + 2])
            plane = sign * dot(along(on, 1.0, row(bodies.position, other)), n) - point[ROUND_B if is_first else ROUND_A]
            sunk = max(sunk, support(smaller.geometry, primitive, bodies.position[i], bodies.rotation[i], n, sign) - plane)
    return max(deepest, min(sunk, deepest + moved_since_seen(bodies, pairs, p))) if sunk > deepest else deepest


@jit
def ask_general(smaller, bodies, table, places, margins, order, asked):
    """Write what is asked about the pairs at `places` (k,), whose contacts are wanted within margins (k,) m.

    order (n,): indices of the scene by rank.
    """
    depth, position, orientation, rotation, n = smaller.depth, bodies.position, bodies.orientation, bodies.rotation, order.shape[0]
    for k in range(places.shape[0]):
        first, second = table.pairs.first[places[k]], table.pairs.second[places[k]]
        # A wide margin is expensive for meshes.
        far = margins[k] if depth[first] + depth[second] > 0.0 else FARTHER * margins[k]
        deepest = _deepest(smaller, bodies, table, places[k])
        level_first, level_second = level_of(smaller, first, second, deepest), level_of(smaller, second, first, deepest)
        asked.a[k], asked.b[k] = order[first] + n * level_first, order[second] + n * level_second
        asked.far[k] = far
        asked.shown[k] = far + smaller.taken_off[level_first, first] + smaller.taken_off[level_second, second]
        # In the middle of a step bodies are elsewhere than at its start.
        for i, at in ((first, asked.a[k]), (second, asked.b[k])):
            for j in range(3):
                asked.position[at, j] = position[i, j]
                for c in range(3):
                    asked.rotation[at, j, c] = rotation[i, j, c]
            for j in range(4):
                asked.orientation[at, j] = orientation[i, j]


@jit_making_arrays
def mark_apart(smaller, bodies, asked, pairs, places, span):
    """Mark the pairs of meshes at `places` that have had no contacts and are too far apart for any, and note how far: they need no search.

    A search for contacts is expensive for meshes, their gap is less so, and tells for how long there are none. asked: `Asked`, of these
    pairs; span: (begin, end) of those that are looked at.
    """
    out, is_apart = np.empty(7), asked.is_apart
    for k in range(span[0], span[1]):
        p = places[k]
        is_apart[k] = False
        if pairs.count[p] > 0 or smaller.depth[pairs.first[p]] + smaller.depth[pairs.second[p]] == 0.0:
            continue
        a, b, taken_off = asked.a[k], asked.b[k], asked.shown[k] - asked.far[k]
        posed_a = Posed(smaller.of_body[a], asked.position[a], asked.rotation[a])
        posed_b = Posed(smaller.of_body[b], asked.position[b], asked.rotation[b])
        gap = pair_gap(smaller.geometry, posed_a, posed_b, FARTHEST * asked.shown[k], out)
        if gap > asked.shown[k]:
            is_apart[k], pairs.apart[p] = True, gap - taken_off
            note_seen(bodies, pairs, p)


@jit
def _contradicts(bodies, pairs, p, points, new, new_end):
    """Whether the new contacts of a pair are impossible: there are none though an old one is closed, or its normal has turned round."""
    for o in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
        old = points[o]
        gap, _, _, _ = _gap_now(bodies, pairs, p, old)
        if new == new_end and gap < old[SKIN]:
            return True
        if gap > old[SKIN]:
            continue
        lowest, highest = 1.0, -1.0
        for c in range(new, new_end):
            cosine = points[c, 0] * old[0] + points[c, 1] * old[1] + points[c, 2] * old[2]
            lowest, highest = min(lowest, cosine), max(highest, cosine)
        # Bodies that hook into each other have normals in both directions.
        if lowest < -0.5 and highest < 0.0:
            return True
    return False


@jit
def _is_sound(smaller, bodies, a, b, found, first, last):
    """Whether the bodies that were asked about are apart along the normal of one of their contacts."""
    real, integer = found
    for s in range(first, last):
        shapes = (smaller.of_body[integer[s, 0]], smaller.of_body[integer[s, 1]])
        if gap_along(smaller.geometry, bodies, a, b, shapes, real[s, 6:9]) > 0.0:
            return True
    return False


@jit_making_arrays
def _write(geometry, bodies, pairs, p, contact, coefficients, points, r):
    """Write point r of pair p from a contact in the world, (real, place); returns its separation."""
    real, c = contact
    a, b = pairs.first[p], pairs.second[p]
    round_a = side_radius(geometry, only_primitive(geometry, bodies.shape[a]), bodies.rotation[a], real[c, 6:9])
    round_b = side_radius(geometry, only_primitive(geometry, bodies.shape[b]), bodies.rotation[b], real[c, 6:9])
    for k in range(3):
        real[c, k] -= bodies.position[a, k]
        real[c, 3 + k] -= bodies.position[a, k]
    return write_point(bodies, pairs, p, Source(real, c, round_a, round_b), coefficients, points, r)


@jit_making_arrays
def store_contacts(shapes, bodies, table, searched, found, count, order, coefficients):
    """Store the contacts found for the pairs `searched` in the points that are free for share 0, with the impulses of those they replace.

    shapes: (`SmallerShapes`, `Deep`); table: `contact_table.Table`; found: (real, integer) of `count` contacts in the order of the pairs,
    with `integer[:, :2]` as in `Asked`; order (n,): indices by rank; coefficients (k, k, 4) of two materials.
    """
    smaller, (convex, solids) = shapes
    pairs, points, ids, free = table
    real, integer = found
    c, used, n = np.int64(0), free[0, 0], order.shape[0]
    deep, deep_ids = np.empty((POINTS + 1, 10)), np.empty((POINTS + 1, 3), np.int64)
    scratch = make_scratch()
    for k in range(searched.places.shape[0]):
        p = searched.places[k]
        a, b = pairs.first[p], pairs.second[p]
        first = c
        while c < count and integer[c, 0] % n == order[a] and integer[c, 1] % n == order[b]:
            put_back(smaller, bodies, a, b, real, integer, c)
            c += 1
        last = reduce_contacts(real, integer, first, c, PER_NORMAL, GAP_WEIGHT)
        new = used
        size = min(bodies.inner[a], bodies.inner[b])
        if pairs.count[p] == 0:
            pairs.contact_margin[p] = min(bodies.skin[a], bodies.skin[b])
        deep_count = 0
        # Bodies deeper inside each other than the smaller shapes allow: contacts from the true ones.
        if convex[a] and convex[b] and not _is_sound(smaller, bodies, a, b, found, first, last):
            deep_count = overlap_contacts(solids, bodies, a, b, size, scratch, Found(deep, deep_ids))
        elif convex[a] != convex[b] and smaller.polyhedron[a] != smaller.polyhedron[b] and smaller.depth[a] + smaller.depth[b] > 0.0:
            # Points of a star that spun went through a floor: once the smaller shapes cross, they find nothing.
            ends = (b, a) if convex[a] else (a, b)
            allowed = smaller.depth[a] + smaller.depth[b]
            deep_count = sunk_corners(smaller.geometry, solids, bodies, ends, allowed, Found(deep, deep_ids))
        for s in range(deep_count if deep_count > 0 else last - first):
            contact = (deep, s) if deep_count > 0 else (real, first + s)
            separation = _write(smaller.geometry, bodies, pairs, p, contact, coefficients, points, used)
            for j in range(3):
                ids[used, j] = deep_ids[s, j] if deep_count > 0 else integer[first + s, 2 + j]
            # Each point is written before it is known to be kept; the next one then takes its place.
            if separation <= searched.margins[k]:
                used += 1
        # No contact although an old one is closed, or a normal turned round: the pair keeps the contacts it had.
        if deep_count == 0 and _contradicts(bodies, pairs, p, points, new, used):
            used = new
        else:
            if pairs.count[p] == 0:
                set_contact_margin(pairs.contact_margin, p, points, new, used)
            old = pairs.start[p]
            match_contacts(Points(points, ids, old, old + pairs.count[p]), Points(points, ids, new, used), NEAR * size)
            pairs.start[p], pairs.count[p], pairs.capacity[p] = new, used - new, used - new
        # Nothing was found within this distance; the cache may skip the pair until it has moved that much.
        pairs.apart[p] = searched.far[k] if pairs.count[p] == 0 and deep_count == 0 and last == first else 0.0
        note_seen(bodies, pairs, p)
    free[0, 0] = used
