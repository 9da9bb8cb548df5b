"""Narrow phase of heaps, with memory: what a pair's contacts were, and how its bodies lay to each other when they were found.

Let m bound how far points of the pair have moved past each other since: m = |dp| + 2 r |dq|, p and q the pose of one body in the axes of
the other, the carrier, and r its reach. Then a pair that was s apart is at least s - m apart, and is left alone while that
is more than the margin within which contacts are looked for; contacts of touching ones are used again while m is below a
part of the smaller inner radius (their points are fixed in the bodies, so separations are exact, and the normal in the carrier).

The margin is what the pair may come in the step, so that contacts are known before they close.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_matching import NEAR, hand_over, take_up, write_row
from rigidimpulse.collision.contact_records import IMPULSE, ROW_SIZE, UNKNOWN, closing_speed, in_play
from rigidimpulse.collision.distance.epa import Polytope, make_polytope
from rigidimpulse.collision.distance.gjk import Simplex, closest, make_simplex
from rigidimpulse.collision.manifold.box_box import box_axis, edge_contact, face_along, face_contacts
from rigidimpulse.collision.manifold.convex_convex import hull_contacts, seen_from
from rigidimpulse.collision.manifold.polyhedra import ALIKE, POINTS, Scratch, along_edges, copy_contact, half_space_contacts, make_scratch
from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.quaternion import product
from rigidimpulse.core.vector import turned_back_by, turned_by

BOXES, PLANE, GENERAL, HULLS = 0, 1, 2, 3
"""Kinds of pairs: two boxes, a half space and a convex polyhedron, all others, two convex polyhedra."""
MOST_HULL_CORNERS = 256
"""Corners of a polyhedron that are all asked for the farthest one."""
AHEAD, AHEAD_GENERAL, FARTHEST = 0.05, 0.12, 2.0
"""Contacts are looked for at least and at most that many inner radii away, at least somewhat farther where pairs are general ones."""
SAME_GENERAL = 0.02
"""Part of the inner radius that touching general pairs may move past each other until they are looked at again, at least."""
FAR = 4.0
"""Margins within which it is found how far convex bodies are apart."""
BLOCK = 64
"""Pairs that are dealt out together."""


class Workspace(NamedTuple):
    """What a share of the pairs is looked at in."""

    real: np.ndarray  # (POINTS + 1, 10) the contacts of a pair
    found: np.ndarray  # (POINTS + 1, 3) their ids
    old: np.ndarray  # (POINTS, ROW_SIZE) rows that they replace
    old_ids: np.ndarray  # (POINTS, 3)
    scratch: Scratch
    simplex: Simplex
    polytope: Polytope
    work: np.ndarray  # (3, 3)
    axes: np.ndarray  # (3, 3) R_a^T R_b
    between: np.ndarray  # (3,) m, from a to b
    origin: np.ndarray  # (3,) zeros


def make_workspace() -> Workspace:
    """Room for one share."""
    number = POINTS + 1
    return Workspace(
        np.empty((number, 10)), np.empty((number, 3), np.int64), np.empty((POINTS, ROW_SIZE)), np.empty((POINTS, 3), np.int64),
        make_scratch.py_func(), make_simplex.py_func(), make_polytope.py_func(), *np.empty((2, 3, 3)), *np.zeros((2, 3)),
    )  # fmt: skip


@jit
def classify(pairs, bodies, shapes):
    """Fill what follows from the bodies of pairs, where that is not known yet."""
    for p in range(pairs.first.shape[0]):
        if pairs.kind[p] != UNKNOWN:
            continue
        a, b = pairs.first[p], pairs.second[p]
        s, t = bodies.shape[a], bodies.shape[b]
        pairs.carrier[p] = bodies.reach[a] <= bodies.reach[b]
        pairs.round[p] = (bodies.reach[a] if pairs.carrier[p] else bodies.reach[b]) == 0.0
        solid_s, solid_t = shapes.face_first[s] < shapes.face_first[s + 1], shapes.face_first[t] < shapes.face_first[t + 1]
        half_space_s, half_space_t = _is_half_space(shapes.half_space, s), _is_half_space(shapes.half_space, t)
        pairs.kind[p] = GENERAL
        if shapes.half[s, 0] > 0.0 and shapes.half[t, 0] > 0.0:
            pairs.kind[p] = BOXES
        elif (solid_s and half_space_t) or (half_space_s and solid_t):
            pairs.kind[p] = PLANE
        elif solid_s and solid_t and max(_corners(shapes, s), _corners(shapes, t)) <= MOST_HULL_CORNERS:
            pairs.kind[p] = HULLS


@inlined
def _is_half_space(half_space, s):
    """Whether shape s is a half space."""
    return half_space[s, 0] != 0.0 or half_space[s, 1] != 0.0 or half_space[s, 2] != 0.0


@inlined
def _corners(shapes, s):
    """Number of corners of shape s."""
    return shapes.corner_first[s + 1] - shapes.corner_first[s]


@inlined
def _relative_pose(position, orientation, rotation, carrier, other):
    """The pose of the other body in the axes of the carrier."""
    x, q = position, orientation
    dx, dy, dz = x[other, 0] - x[carrier, 0], x[other, 1] - x[carrier, 1], x[other, 2] - x[carrier, 2]
    turn = product(
        q[carrier, 0], -q[carrier, 1], -q[carrier, 2], -q[carrier, 3], q[other, 0], q[other, 1], q[other, 2], q[other, 3]
    )
    return turned_back_by(rotation, carrier, dx, dy, dz), turn


@inlined
def _motion(seen, p, is_round, reach, place, turn):
    """m: how far points of a pair have moved past each other at most since contacts were looked for."""
    d = (place[0] - seen[p, 0]) ** 2 + (place[1] - seen[p, 1]) ** 2 + (place[2] - seen[p, 2]) ** 2
    if is_round:
        return sqrt(d)
    same = turn[0] * seen[p, 3] + turn[1] * seen[p, 4] + turn[2] * seen[p, 5] + turn[3] * seen[p, 6]
    # |q - q'|^2 of unit quaternions, of which the one and its negative are the same rotation.
    return sqrt(d) + 2.0 * reach * sqrt(max(2.0 - 2.0 * abs(same), 0.0))


@inlined
def note_seen(bodies, pairs, p):
    """Remember how the bodies of a pair lie to each other now."""
    a, b = pairs.first[p], pairs.second[p]
    carrier, other = (b, a) if pairs.carrier[p] else (a, b)
    place, turn = _relative_pose(bodies.position, bodies.orientation, bodies.rotation, carrier, other)
    pairs.seen[p, 0], pairs.seen[p, 1], pairs.seen[p, 2] = place
    pairs.seen[p, 3], pairs.seen[p, 4], pairs.seen[p, 5], pairs.seen[p, 6] = turn
    pairs.known[p] = True


@jit
def most_motion(bodies, pairs, ahead):
    """How far, in inner radii, pairs in play that have contacts come past each other in `ahead` s, at most."""
    part, count, most = bodies.part, pairs.count, 0.0
    for p in range(pairs.first.shape[0]):
        a, b = pairs.first[p], pairs.second[p]
        if count[p] > 0 and in_play(part, a, b):
            speed = closing_speed(bodies.position, bodies.velocity, bodies.reach, a, b, pairs.carrier[p])
            most = max(most, ahead * speed / min(bodies.inner[a], bodies.inner[b]))
    return most


@jit
def share_of(number, share, shares):
    """Where the places of a share of so many pairs begin: pairs are dealt out in blocks, so that all shares are alike."""
    return share * (number // (BLOCK * shares) + 1) * BLOCK


@jit
def review(bodies, pairs, share, shares, ahead, same, kept, places, margins):
    """Write the pairs in play of quick bodies whose contacts must be looked for, and their margins, m: how far they come in `ahead` s.

    share: which of the `shares` of pairs. same: inner radii that touching pairs may have come past each other with the contacts they
    have; kept: the same, by the next look, in the middle of a step; 0 at its start. Pairs that are too far apart lose their contacts.
    Returns where the places (k,) and margins (k,) of the share begin and end.
    """
    part, position, orientation, rotation, velocity = bodies.part, bodies.position, bodies.orientation, bodies.rotation, bodies.velocity
    inner, skin, radius, reach, quick = bodies.inner, bodies.skin, bodies.radius, bodies.reach, bodies.quick
    seen, known, count, apart = pairs.seen, pairs.known, pairs.count, pairs.apart
    total = pairs.first.shape[0]
    begin = share_of(total, share, shares)
    end = begin
    for block in range(share * BLOCK, total, shares * BLOCK):
        for p in range(block, min(block + BLOCK, total)):
            a, b, is_second = pairs.first[p], pairs.second[p], pairs.carrier[p]
            if not (quick[a] or quick[b]) or not in_play(part, a, b):
                continue
            size = min(inner[a], inner[b])
            general = pairs.kind[p] == GENERAL
            speed = closing_speed(position, velocity, reach, a, b, is_second)
            margin = min(skin[a], skin[b]) + min(max(speed * ahead, (AHEAD_GENERAL if general else AHEAD) * size), FARTHEST * size)
            far = radius[a] + radius[b] + margin
            dx, dy, dz = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1], position[b, 2] - position[a, 2]
            if dx * dx + dy * dy + dz * dz > far * far:
                known[p] = known[p] and count[p] == 0
                count[p] = 0
                continue
            if known[p]:
                carrier, other = (b, a) if is_second else (a, b)
                place, turn = _relative_pose(position, orientation, rotation, carrier, other)
                motion = _motion(seen, p, pairs.round[p], reach[other], place, turn)
                if count[p] == 0 and apart[p] - motion > margin:
                    continue
                still = max(same, SAME_GENERAL) if general else same
                if count[p] > 0 and (motion <= still * size or (kept > 0.0 and motion + speed * ahead <= kept * size)):
                    continue
            places[end], margins[end] = p, margin
            end += 1
    return begin, end


@inlined
def _at_wall(shapes, rotation, a, b, s, t, between, margin, scratch, real, ids):
    """Contacts of a half space and a convex polyhedron relative to the first body; returns their number and the gap."""
    half_space_is_a = shapes.face_first[s] == shapes.face_first[s + 1]
    half_space, w, i, sign = shapes.half_space, s if half_space_is_a else t, a if half_space_is_a else b, 1.0 if half_space_is_a else -1.0
    nx, ny, nz = turned_by(rotation, i, half_space[w, 0], half_space[w, 1], half_space[w, 2])
    offset = half_space[w, 3] - sign * (nx * between[0] + ny * between[1] + nz * between[2])
    solid, j = (t, b) if half_space_is_a else (s, a)
    count, least = half_space_contacts(shapes, solid, rotation, j, nx, ny, nz, offset, margin, sign, scratch, real, ids)
    if half_space_is_a:
        for k in range(count):
            for c in range(3):
                real[k, c] += between[c]
                real[k, 3 + c] += between[c]
    return count, least


@inlined
def _of_boxes(half, velocity, rotation, a, b, s, t, between, margin, ahead, c, work, scratch, real, ids):
    """Contacts of two boxes relative to the first body; returns their number and a bound of the gap."""
    dx, dy, dz = between[0], between[1], between[2]
    gap, axis = box_axis(half, s, t, rotation, a, b, dx, dy, dz, margin, c)
    if gap > margin:
        return np.int64(0), gap
    cosine, edges = 1.0, axis
    if edges >= 6:
        edge_contact(half, s, t, rotation, a, dx, dy, dz, edges, gap, c, work, real, ids)
        axis, cosine = face_along(work[0], c)
        if cosine < ALIKE:
            return np.int64(1), gap
        copy_contact(real, ids, 0, POINTS)
        # What hangs down beside a tilted face is not to be held up by it.
        ahead = 0.0
    count = face_contacts(half, velocity, rotation, a, b, s, t, between, axis, margin, ahead, c, scratch, real, ids)
    if edges >= 6:
        size = min(half[s, 0], half[s, 1], half[s, 2], half[t, 0], half[t, 1], half[t, 2])
        if not along_edges(real, count, POINTS, cosine, axis >= 3, gap, size):
            copy_contact(real, ids, POINTS, 0)
            count = np.int64(1)
    return count, gap


@jit
def _are_apart(solids, inset, bodies, pairs, p, between, margin, c, simplex):
    """Whether the bodies of a general pair are known by `solids` to be farther apart than the margin; how far is noted."""
    a, b = pairs.first[p], pairs.second[p]
    s, t = bodies.shape[a], bodies.shape[b]
    if min(_corners(solids, s), _corners(solids, t)) == 0 or max(_corners(solids, s), _corners(solids, t)) > MOST_HULL_CORNERS:
        return False
    d, wanted = seen_from(bodies.rotation, a, b, between, c), margin + inset[s] + inset[t]
    _, _, _, gap, corners = closest(solids, s, t, d, c, 1.0, FAR * wanted, simplex)
    if corners == 5 or gap <= wanted:
        return False
    pairs.count[p], pairs.apart[p] = 0, gap - inset[s] - inset[t]
    note_seen(bodies, pairs, p)
    return True


@jit
def look(shapes, solids, inset, bodies, pairs, share, shares, ahead, same, kept, places, margins, rows, ids, free, coefficients, workspace):
    """Find the contacts of a share of the pairs where `review` says so, but for general ones, which are left at the begin of its places.

    solids, inset: see `heap_overlap`; ahead: length of the step, s; free (shares, 2): where the rows of the pool that each share may take
    begin and end; coefficients (k, k, 4) of two materials; room: of its own. Returns how many pairs were looked at, and how many general
    ones there are, -1 where there are too few rows (get more and call it again).
    """
    real, found, old, old_ids, scratch, simplex, polytope, work, c, between, origin = workspace
    position, rotation, velocity, shape = bodies.position, bodies.rotation, bodies.velocity, bodies.shape
    waiting = 0
    begin, end = review(bodies, pairs, share, shares, ahead, same, kept, places, margins)
    for k in range(begin, end):
        p, margin = places[k], margins[k]
        a, b = pairs.first[p], pairs.second[p]
        for i in range(3):
            between[i] = position[b, i] - position[a, i]
        if pairs.kind[p] == GENERAL:
            if not _are_apart(solids, inset, bodies, pairs, p, between, margin, c, simplex):
                places[begin + waiting], margins[begin + waiting] = p, margin
                waiting += 1
            continue
        s, t = shape[a], shape[b]
        if pairs.kind[p] == PLANE:
            count, gap = _at_wall(shapes, rotation, a, b, s, t, between, margin, scratch, real, found)
        elif pairs.kind[p] == HULLS:
            size = min(bodies.inner[a], bodies.inner[b])
            count, gap = hull_contacts(
                shapes, velocity, rotation, a, b, s, t, between, origin, size, margin, ahead, c, simplex, polytope, scratch, real, found
            )
        else:
            count, gap = _of_boxes(shapes.half, velocity, rotation, a, b, s, t, between, margin, ahead, c, work, scratch, real, found)
        if count > pairs.capacity[p]:
            used = free[share, 0]
            if used + POINTS > free[share, 1]:
                return end - begin, -1
            before = pairs.start[p]
            pairs.start[p], pairs.capacity[p] = used, POINTS
            for i in range(pairs.count[p]):
                for j in range(ROW_SIZE):
                    rows[used + i, j] = rows[before + i, j]
                for j in range(3):
                    ids[used + i, j] = ids[before + i, j]
            free[share, 0] = used + POINTS
        start, handed = pairs.start[p], 0
        for i in range(start, start + pairs.count[p]):
            # An old contact without impulse has nothing to hand over.
            if rows[i, IMPULSE] > 0.0:
                for j in range(ROW_SIZE):
                    old[handed, j] = rows[i, j]
                for j in range(3):
                    old_ids[handed, j] = ids[i, j]
                handed += 1
        if pairs.count[p] == 0:
            pairs.held[p] = min(bodies.skin[a], bodies.skin[b])
        held = pairs.held[p]
        for i in range(count):
            write_row(
                position, rotation, bodies.material, bodies.skin, held, a, b, pairs.carrier[p], real, i, 0.0, 0.0, 1.0, 1.0, coefficients,
                rows, start + i,
            )  # fmt: skip
            for j in range(3):
                ids[start + i, j] = found[i, j]
        if pairs.count[p] == 0:
            take_up(pairs.held, p, rows, start, start + count)
        if count > 0 and handed > 0:
            hand_over(old, old_ids, np.int64(0), handed, rows, ids, start, start + count, NEAR * min(bodies.inner[a], bodies.inner[b]))
        pairs.count[p] = count
        pairs.apart[p] = max(gap, 0.0) if count == 0 else 0.0
        note_seen(bodies, pairs, p)
    return end - begin, waiting
