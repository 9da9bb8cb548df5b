"""Contacts of bodies that are made of several convex polyhedra: those of all their parts that are near each other.

A part with the centre c of a body is at x + R c, turns like the body, and moves with v + w x R c. So the kernels of convex polyhedra take
two parts for two bodies, see `polyhedra`. Their points are moved by R_a c_a, so that they are relative to the first body. Of many contacts
few stay (`reduce`). The gap of the bodies is at least the least of the gaps of their parts, or of spheres around them.

A part that lies against another part of its body has sides that nothing can touch. A box that slides over the seam of two planks, to which
the second one is beside it, would be stopped by the side of that one (a ghost collision). So a contact is left out if its point on a body,
moved out of the surface by OUT, is covered: it is in another part of the same body, and that part reaches farther out than the point. If
all are covered, and bodies are inside each other, the deepest one stays.

What "in" means near a face f of the covering part depends on the way n that the surface looks at the point:
  f looks the same way as n      not beyond f at all: parts side by side on a floor all have their contacts with it
  f looks against n              at most IN beyond f: the parts meet there, with a gap of round-off
  f looks aside of n             at most IN beyond f, if the point's own part ends there too: what slides is above a plank by its skin;
                                 at least IN behind f, if the point's own part goes on beyond f: the surface beside the point is free,
                                 and a body that lies in the corner of two parts needs both of them.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.gjk import farthest
from rigidimpulse.collision.manifold.dispatch import HULLS, PLANE, convex_contacts, is_half_space, num_parts
from rigidimpulse.collision.manifold.polyhedra import POINTS, Pair
from rigidimpulse.collision.manifold.reduce import GAP_WEIGHT, PER_NORMAL, reduce_contacts
from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.simd import EIGHT, eight, highest, load, root, spread, store
from rigidimpulse.core.vector import turned_back_by, turned_by

OUT: float = 1e-3
"""How far a point is moved out, in inner radii, to see whether it is in another part."""
IN: float = 2e-2
"""How near to a face of a covering part, in inner radii, a point is at that face: what slides towards the side of the next plank is above
this one by a skin (0.8e-2) at most."""
ALONG = 0.5
"""Cosine of the angle of a face and a contact's normal from which on the face looks the same way, or against it if negative."""
FIRST_PLACES = 256
"""Contacts for which there is memory at first."""


class PartScratch(NamedTuple):
    """Two parts as two bodies, and the contacts of all parts of a pair."""

    body: np.ndarray  # (2,) 0 and 1, of the type that numbers of bodies have in pairs: kernels are compiled for that one
    rotation: np.ndarray  # (2, 3, 3)
    velocity: np.ndarray  # (16,) v and w of each
    place: np.ndarray  # (4, k) m, centres of the parts of the second body from the first body, in world axes, and their bounds
    gap: np.ndarray  # (EIGHT,) m, of spheres
    real: np.ndarray  # (k, 10) on a, on b, normal, gap; relative to the first body
    integer: np.ndarray  # (k, 5) parts of both bodies, kind and features


def make_part_scratch(places: int = FIRST_PLACES) -> PartScratch:
    """Scratch memory for one pair of bodies that has `places` contacts, and parts of one body, at most."""
    body = np.arange(2, dtype=np.int32)
    return PartScratch(
        body, np.empty((2, 3, 3)), np.zeros(16), np.empty((4, places)), np.empty(EIGHT), np.empty((places, 10)),
        np.zeros((places, 5), np.int64),
    )  # fmt: skip


@inlined
def _set_part(bodies, i, centre, scratch, k):
    """Let part k of the scratch memory turn with body i and move like its centre (3,), in world axes from that of the body."""
    rotation, velocity, v = scratch.rotation, scratch.velocity, bodies.velocity
    x, y, z = centre
    wx, wy, wz = v[8 * i + 3], v[8 * i + 4], v[8 * i + 5]
    for m in range(3):
        for n in range(3):
            rotation[k, m, n] = bodies.rotation[i, m, n]
        velocity[8 * k + 3 + m] = v[8 * i + 3 + m]
    velocity[8 * k] = v[8 * i] + (wy * z - wz * y)
    velocity[8 * k + 1] = v[8 * i + 1] + (wz * x - wx * z)
    velocity[8 * k + 2] = v[8 * i + 2] + (wx * y - wy * x)


@inlined
def _place_of(shapes, bodies, p, i):
    """Where the centre of part p of body i is from that of the body, in world axes."""
    return turned_by(bodies.rotation, i, shapes.centre[p, 0], shapes.centre[p, 1], shapes.centre[p, 2])


@inlined
def _between_spheres(x, y, reach):
    """Gap of two spheres about x and y (3,) whose radii have the sum `reach`, m; below 0 where one is a half space."""
    dx, dy, dz = y[0] - x[0], y[1] - x[1], y[2] - x[2]
    return sqrt(dx * dx + dy * dy + dz * dz) - reach


@inlined
def _place_parts(shapes, bodies, i, away, place):
    """Write to place where the parts of body i are, which is `away` (3,) from another body, and their bounds; beyond them nothing is."""
    s = bodies.shape[i]
    first, number = shapes.part_first[s], shapes.part_first[s + 1] - shapes.part_first[s]
    for k in range(number):
        x, y, z = _place_of(shapes, bodies, first + k, i)
        place[0, k], place[1, k], place[2, k], place[3, k] = away[0] + x, away[1] + y, away[2] + z, shapes.bound[first + k]
    for k in range(number, number + EIGHT):
        place[0, k], place[1, k], place[2, k], place[3, k] = inf, 0.0, 0.0, 0.0


@inlined
def _gaps_of_spheres(x, radius, parts, begin):
    """Write the gaps (m) of a sphere about x (3,) and those about EIGHT placed parts from `begin` on; returns the least of them."""
    simd, place = eight(), parts.place
    dx, dy = load(simd, place[0], begin) - spread(simd, x[0]), load(simd, place[1], begin) - spread(simd, x[1])
    dz = load(simd, place[2], begin) - spread(simd, x[2])
    gap = root(dx * dx + dy * dy + dz * dz) - (spread(simd, radius) + load(simd, place[3], begin))
    store(parts.gap, 0, gap)
    less, _ = highest(-gap, spread(simd, 0.0))
    return -less


@jit
def contacts_of_parts(shapes, bodies, ends, query, scratch, found):
    """Find the contacts of two bodies, ends = (a, b), relative to the first, in the places of found[1]; both are solid or half spaces.

    shapes: `Polyhedra`; query: `polyhedra.Query`; scratch: `polyhedra.Scratch`, with the way between the bodies; found: `Points` of two
    parts, and `PartScratch`. Returns their number, -1 if there are too few places, and a lower bound of the gap, m.
    """
    (a, b), (points, parts) = ends, found
    s, t, between = bodies.shape[a], bodies.shape[b], scratch.between
    away = (between[0], between[1], between[2])
    count, least, radius, place = np.int64(0), inf, bodies.radius[b], parts.place
    first, last = shapes.part_first[t], shapes.part_first[t + 1]
    if last - first + EIGHT > place.shape[1]:
        return np.int64(-1), least
    _place_parts(shapes, bodies, b, away, place)
    for p in range(shapes.part_first[s], shapes.part_first[s + 1]):
        mine = _place_of(shapes, bodies, p, a)
        # Whole bodies first: most parts are near none of the other.
        gap = _between_spheres(mine, away, shapes.bound[p] + radius)
        if gap > query.margin:
            least = min(least, gap)
            continue
        _set_part(bodies, a, mine, parts, 0)
        for begin in range(0, last - first, EIGHT):
            # Most are far away: eight at once are told to be.
            nearest = _gaps_of_spheres(mine, shapes.bound[p], parts, begin)
            if nearest > query.margin:
                least = min(least, nearest)
                continue
            for k in range(begin, min(begin + EIGHT, last - first)):
                if parts.gap[k - begin] > query.margin:
                    least = min(least, parts.gap[k - begin])
                    continue
                if count + POINTS > parts.real.shape[0]:
                    return np.int64(-1), least
                q = first + k
                _set_part(bodies, b, _place_of(shapes, bodies, q, b), parts, 1)
                between[0], between[1], between[2] = place[0, k] - mine[0], place[1, k] - mine[1], place[2, k] - mine[2]
                i, j = shapes.part[p], shapes.part[q]
                flat = is_half_space(shapes.half_space, i) or is_half_space(shapes.half_space, j)
                pair = Pair(parts.rotation, parts.velocity, parts.body[0], parts.body[1], i, j)
                number, gap = convex_contacts(PLANE if flat else HULLS, shapes, pair, query, scratch, points)
                least = min(least, gap)
                _keep(points, number, mine, (p, q), parts, count)
                count += number
    count = _leave_out_hidden(shapes, bodies, ends, (away, query.size), parts, count)
    return reduce_contacts(parts.real, parts.integer, np.int64(0), count, PER_NORMAL, GAP_WEIGHT), least


@jit
def _leave_out_hidden(shapes, bodies, ends, pair, parts, count):
    """Leave out contacts at surfaces that other parts of the same body cover; returns how many stay. pair: (way from a to b, size)."""
    (a, b), (away, size) = ends, pair
    if count == 0 or max(num_parts(shapes, bodies.shape[a]), num_parts(shapes, bodies.shape[b])) == 1:
        return count
    real, kept, deepest = parts.real, np.int64(0), 0
    for c in range(count):
        deepest = c if real[c, 9] < real[deepest, 9] else deepest
    lowest = real[deepest, 9]
    for c in range(count):
        n = (real[c, 6], real[c, 7], real[c, 8])
        on_a = (real[c, 0], real[c, 1], real[c, 2])
        on_b = (real[c, 3] - away[0], real[c, 4] - away[1], real[c, 5] - away[2])
        hidden = _is_covered(shapes, bodies, (a, parts.integer[c, 0]), on_a, n, size)
        hidden = hidden or _is_covered(shapes, bodies, (b, parts.integer[c, 1]), on_b, (-n[0], -n[1], -n[2]), size)
        if not hidden:
            _move(parts, c, kept)
            kept += 1
    if kept == 0 and lowest <= 0.0:
        _move(parts, deepest, 0)
        kept = np.int64(1)
    return kept


@inlined
def _move(parts, source, target):
    """Write the contact at `source` over the one at `target`."""
    for k in range(10):
        parts.real[target, k] = parts.real[source, k]
    for k in range(5):
        parts.integer[target, k] = parts.integer[source, k]


@jit
def _is_covered(shapes, bodies, own, x, n, size):
    """Whether the place x (3,) on part own[1] of body own[0], moved out by OUT along n (3,), is in another part that reaches farther out.

    x, n: in world axes, x from the body's position; size: inner radius, m.
    """
    i, s, step = own[0], bodies.shape[own[0]], OUT * size
    px, py, pz = turned_back_by(bodies.rotation, i, x[0] + step * n[0], x[1] + step * n[1], x[2] + step * n[2])
    way = turned_back_by(bodies.rotation, i, n[0], n[1], n[2])
    for p in range(shapes.part_first[s], shapes.part_first[s + 1]):
        dx, dy, dz = px - shapes.centre[p, 0], py - shapes.centre[p, 1], pz - shapes.centre[p, 2]
        if p == own[1] or dx * dx + dy * dy + dz * dz > (shapes.bound[p] + IN * size) ** 2:
            continue
        if _is_in_part(shapes, (p, own[1]), (dx, dy, dz), way, IN * size):
            far = dx * way[0] + dy * way[1] + dz * way[2]
            if _reach(shapes, shapes.part[p], way) >= far:
                return True
    return False


@inlined
def _is_in_part(shapes, ends, d, way, near):
    """Whether d (3,), from the centre of part ends[0], is in it; it is on part ends[1] that looks along `way`; near: IN, m."""
    p, q = ends
    j = shapes.part[p]
    # Most points are in front of some face: how far the other part reaches is asked of the few that are not.
    for f in range(shapes.face_first[j], shapes.face_first[j + 1]):
        above = _above(shapes, f, d)
        if above > near or (above > 0.0 and _along(shapes, f, way) > ALONG):
            return False
    for f in range(shapes.face_first[j], shapes.face_first[j + 1]):
        if _above(shapes, f, d) > -near and -ALONG < _along(shapes, f, way) <= ALONG:
            plane, apart = shapes.plane[f], 0.0
            for k in range(3):
                apart += plane[k] * (shapes.centre[q, k] - shapes.centre[p, k])
            if apart + _reach(shapes, shapes.part[q], plane) > plane[3] + near:
                return False
    return True


@inlined
def _along(shapes, f, way):
    """Cosine of the normal of face f and `way` (3,)."""
    return shapes.plane[f, 0] * way[0] + shapes.plane[f, 1] * way[1] + shapes.plane[f, 2] * way[2]


@inlined
def _above(shapes, f, d):
    """Height of d (3,) above face f, m."""
    return _along(shapes, f, d) - shapes.plane[f, 3]


@inlined
def _reach(shapes, j, way):
    """How far out solid j reaches along `way` (3,) from its centre, m."""
    _, far = farthest(shapes, j, way[0], way[1], way[2])
    return far


@inlined
def _keep(points, number, mine, between, parts, count):
    """Copy the contacts of two parts, between = (p, q), behind `count` others; mine (3,): where the first part is from its body."""
    for n in range(number):
        parts.integer[count + n, 0], parts.integer[count + n, 1] = between
        for k in range(10):
            parts.real[count + n, k] = points.real[n, k]
        for k in range(3):
            parts.real[count + n, k] += mine[k]
            parts.real[count + n, 3 + k] += mine[k]
            parts.integer[count + n, 2 + k] = points.ids[n, k]
