"""Contact cache: the contacts of a pair are kept as long as its bodies have hardly moved relative to each other.

Let p and q be the position and the orientation of one body in the axes of the other, the carrier, and r the reach of the first. Since the
contacts were found, points of the pair have moved past each other by at most

    m = |dp| + 2 r |dq|.

A pair that was s apart is still at least s - m apart. It needs no search while s - m is above the margin. The contacts of a touching pair
are used again while m is below a part of the smaller inner radius. Their points are fixed in the bodies, so that separations stay exact.
Their normals are fixed in the carrier. Where m is large, because the bodies were elsewhere for a while, the contacts are forgotten.

The margin is the distance that the pair may come closer in the step (speculative contacts): contacts are known before they close. Bodies
that fall one behind the other do not come closer until the first of them is stopped. So a pair may also come closer as fast as contacts
with others may change the velocity of one of its bodies until the next search. With s the closing speed of a pair that may meet until then,
w the inverse masses and e the largest restitution of body i, it changes by at most 1 + e times

    s                     where it moves, and the other is held: it is at rest, or is itself stopped by what is held
    s w_i / (w_i + w_j)   else,

and s is as large as the change of the other one without the rebound. A pair closes as fast as either changes; if it closes already, faster
by the smaller of both changes; and faster by half of what gravity adds. Layers of a falling pile went 13 % of their size into each other
without it.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_matching import NEAR, Points, Source, match_contacts, set_contact_margin, write_point
from rigidimpulse.collision.contact_records import IMPULSE, INVERSE_MASS, OUTSIDE, POINT_FIELDS, UNKNOWN, closing_speed, in_play
from rigidimpulse.collision.distance.epa import make_polytope
from rigidimpulse.collision.distance.gjk import closest, make_simplex
from rigidimpulse.collision.manifold.convex_convex import seen_from
from rigidimpulse.collision.manifold.convex_parts import FIRST_PLACES, PartScratch, contacts_of_parts, make_part_scratch
from rigidimpulse.collision.manifold.dispatch import GENERAL, MOST_HULL_CORNERS, SEVERAL, convex_contacts, num_corners, pair_kind
from rigidimpulse.collision.manifold.polyhedra import POINTS, Pair, Polyhedra, Query, Scratch, make_polygon
from rigidimpulse.collision.manifold.polyhedra import Points as Found
from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.quaternion import product
from rigidimpulse.core.vector import turned_back_by

AHEAD, AHEAD_GENERAL, FARTHEST = 0.05, 0.12, 2.0
"""Least margin, least margin of general pairs, and greatest margin of the search for contacts, in inner radii."""
SAME_GENERAL = 0.02
"""Least relative motion, in inner radii, after which the contacts of a touching general pair are found again; also of SEVERAL parts."""
FORGOTTEN = 1.0
"""Relative motion, in inner radii, after which contacts found before say nothing: their planes do not end, and bodies may be beyond what
touched. A capsule that had rolled over a rim, and came back from free flight below it, was thrown by 0.6 rad (issue 27)."""
TOO_FEW_POINTS, TOO_FEW_PLACES = -1, -2
"""What `find_contacts` ran out of: points of the table, or places of its workspace."""
FAR = 4.0
"""Distance, in margins, up to which the gap of convex bodies is measured."""
BLOCK = 64
"""Pairs that go to one share together."""
CHAIN = 8
"""Contacts in a row along which bodies may stop each other until the next search, at most."""
GROWN = 0.1
"""Part of the speed that the least margin allows by which a change must grow to count."""


class Convex(NamedTuple):
    """The convex shapes of a scene."""

    shapes: Polyhedra  # boxes, polyhedra and half spaces
    solids: Polyhedra  # the same, and convex bodies inside the other shapes, see `penetrating.solids`
    inset: np.ndarray  # (s,) m, how far each of those is inside its shape


class Share(NamedTuple):
    """A part of the pairs, and where the pairs are listed whose contacts must be found."""

    number: int | np.int64  # which of the shares
    shares: int | np.int64
    places: np.ndarray  # (k,) pairs
    margins: np.ndarray  # (k,) m


class Limits(NamedTuple):
    """How far pairs may move with the contacts they have."""

    ahead: float  # s, until the next search
    same: float  # inner radii, relative motion within which touching pairs keep their contacts
    kept: float  # the same until the next search, in the middle of a step; 0 at its start
    fall: float  # m/s, half of what steady forces may add to a speed until the next search


class Workspace(NamedTuple):
    """Scratch memory of one share of the pairs."""

    found: Found  # the contacts of a pair
    old: np.ndarray  # (POINTS, POINT_FIELDS) points that they replace
    old_ids: np.ndarray  # (POINTS, 3)
    scratch: Scratch
    parts: PartScratch


def make_workspace(places: int = FIRST_PLACES) -> Workspace:
    """Scratch memory for one share, in which pairs of bodies of several parts have `places` contacts at most."""
    number = POINTS + 1
    scratch = Scratch(
        make_polygon.py_func(), make_simplex.py_func(), make_polytope.py_func(), *np.empty((2, 3, 3)), *np.zeros((2, 3))
    )
    return Workspace(
        Found(np.empty((number, 10)), np.empty((number, 3), np.int64)), np.empty((POINTS, POINT_FIELDS)), np.empty((POINTS, 3), np.int64),
        scratch, make_part_scratch(places),
    )  # fmt: skip


@jit
def classify(pairs, bodies, shapes):
    """Fill in kind and carrier of the new pairs."""
    for p in range(pairs.first.shape[0]):
        if pairs.kind[p] != UNKNOWN:
            continue
        a, b = pairs.first[p], pairs.second[p]
        s, t = bodies.shape[a], bodies.shape[b]
        pairs.carrier[p] = bodies.reach[a] <= bodies.reach[b]
        pairs.round[p] = (bodies.reach[a] if pairs.carrier[p] else bodies.reach[b]) == 0.0
        pairs.kind[p] = pair_kind(shapes, s, t)


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
    """m: upper bound of how far points of a pair have moved past each other since its contacts were found."""
    d = (place[0] - seen[p, 0]) ** 2 + (place[1] - seen[p, 1]) ** 2 + (place[2] - seen[p, 2]) ** 2
    if is_round:
        return sqrt(d)
    same = turn[0] * seen[p, 3] + turn[1] * seen[p, 4] + turn[2] * seen[p, 5] + turn[3] * seen[p, 6]
    # |q - q'|^2 of unit quaternions; q and -q are the same rotation.
    return sqrt(d) + 2.0 * reach * sqrt(max(2.0 - 2.0 * abs(same), 0.0))


@inlined
def moved_since_seen(bodies, pairs, p):
    """How far points of a pair have moved past each other at most since its contacts were found, m."""
    carrier, other = (pairs.second[p], pairs.first[p]) if pairs.carrier[p] else (pairs.first[p], pairs.second[p])
    place, turn = _relative_pose(bodies.position, bodies.orientation, bodies.rotation, carrier, other)
    return _motion(pairs.seen, p, pairs.round[p], bodies.reach[other], place, turn)


@inlined
def note_seen(bodies, pairs, p):
    """Store the present relative pose of a pair."""
    a, b = pairs.first[p], pairs.second[p]
    carrier, other = (b, a) if pairs.carrier[p] else (a, b)
    place, turn = _relative_pose(bodies.position, bodies.orientation, bodies.rotation, carrier, other)
    pairs.seen[p, 0], pairs.seen[p, 1], pairs.seen[p, 2] = place
    pairs.seen[p, 3], pairs.seen[p, 4], pairs.seen[p, 5], pairs.seen[p, 6] = turn
    pairs.known[p] = True


@inlined
def _can_meet(bodies, pairs, p, far):
    """Whether a pair may come closer by `far` m without being known to stay apart."""
    a, b = pairs.first[p], pairs.second[p]
    x, reach = bodies.position, bodies.radius[a] + bodies.radius[b] + far
    dx, dy, dz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    if dx * dx + dy * dy + dz * dz > reach * reach:
        return False
    if not pairs.known[p] or pairs.count[p] > 0:
        return True
    return pairs.apart[p] - moved_since_seen(bodies, pairs, p) <= far


@inlined
def _may_close(bodies, a, b, speed, fall):
    """How fast a pair may close until the next search, m/s, if it closes at a speed now."""
    one, other = bodies.change[a], bodies.change[b]
    return max(speed + min(one, other), one, other) + fall


@inlined
def _is_slow(bodies, i, ahead):
    """Whether a body moves by less than the least margin in `ahead` s."""
    v, k, most = bodies.velocity, 8 * i, AHEAD * bodies.inner[i]
    return ahead * ahead * (v[k] * v[k] + v[k + 1] * v[k + 1] + v[k + 2] * v[k + 2]) <= most * most


@jit
def note_changes(bodies, pairs, ahead, fall, coefficients):
    """Estimate how much contacts may change the velocity of each body in `ahead` s, m/s: writes `bodies.change`, and who is `held`.

    fall: see `Limits`.
    """
    part, change, held, mass, material = bodies.part, bodies.change, bodies.held, bodies.mass, bodies.material
    for i in range(part.shape[0] - 1):
        change[i] = 0.0
        held[i] = part[i] != OUTSIDE and _is_slow(bodies, i, ahead)
    for _ in range(CHAIN):
        grown = False
        for p in range(pairs.first.shape[0]):
            a, b = pairs.first[p], pairs.second[p]
            if not in_play(part, a, b):
                continue
            speed = closing_speed(bodies.position, bodies.velocity, bodies.reach, a, b, pairs.carrier[p])
            closing, least = max(speed, change[a], change[b]), AHEAD * min(bodies.inner[a], bodies.inner[b])
            if ahead * closing <= least or not _can_meet(bodies, pairs, p, ahead * (closing + fall)):
                continue
            for i, j in ((a, b), (b, a)):
                own, other = mass[8 * i + INVERSE_MASS], mass[8 * j + INVERSE_MASS]
                if own == 0.0:
                    continue
                stopped = held[j] and not _is_slow(bodies, i, ahead)
                share = 1.0 if stopped else own / (own + other)
                most = share * max(speed, change[j])
                if ahead * (most - change[i]) > GROWN * least:
                    change[i], grown = most, True
                held[i] = held[i] or stopped
        if not grown:
            break
    # Once, and not in each contact of a row: two bodies between which a change goes back and forth would make it grow without end.
    for i in range(part.shape[0] - 1):
        if change[i] > 0.0:
            rebound = 0.0
            for k in range(coefficients.shape[0]):
                rebound = max(rebound, coefficients[material[i], k, 0])
            change[i] *= 1.0 + rebound


@jit
def most_motion(bodies, pairs, ahead):
    """Greatest relative motion, in inner radii, in `ahead` s of the pairs that take part and have contacts."""
    part, count, most = bodies.part, pairs.count, 0.0
    for p in range(pairs.first.shape[0]):
        a, b = pairs.first[p], pairs.second[p]
        if count[p] > 0 and in_play(part, a, b):
            speed = closing_speed(bodies.position, bodies.velocity, bodies.reach, a, b, pairs.carrier[p])
            most = max(most, ahead * speed / min(bodies.inner[a], bodies.inner[b]))
    return most


@jit
def most_turn(bodies, pairs, cornered, ahead):
    """Greatest angle [rad] by which bodies of general pairs that take part and have contacts turn against each other in `ahead` s.

    cornered (n,): which bodies have corners or rims; pairs of others are left out.
    """
    part, count, velocity, most = bodies.part, pairs.count, bodies.velocity, 0.0
    for p in range(pairs.first.shape[0]):
        a, b = pairs.first[p], pairs.second[p]
        if count[p] > 0 and pairs.kind[p] == GENERAL and cornered[a] and cornered[b] and in_play(part, a, b):
            x, y, z = velocity[8 * b + 3], velocity[8 * b + 4], velocity[8 * b + 5]
            x, y, z = x - velocity[8 * a + 3], y - velocity[8 * a + 4], z - velocity[8 * a + 5]
            most = max(most, ahead * sqrt(x * x + y * y + z * z))
    return most


@jit
def most_approach(bodies, pairs, ahead, fall):
    """Greatest relative motion in `ahead` s of the pairs that may meet in that time, in the farthest that contacts are looked for."""
    part, x, radius, most = bodies.part, bodies.position, bodies.radius, 0.0
    for p in range(pairs.first.shape[0]):
        a, b = pairs.first[p], pairs.second[p]
        if not in_play(part, a, b):
            continue
        speed = closing_speed(x, bodies.velocity, bodies.reach, a, b, pairs.carrier[p])
        motion = ahead * _may_close(bodies, a, b, speed, fall)
        far = radius[a] + radius[b] + motion
        dx, dy, dz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        if dx * dx + dy * dy + dz * dz <= far * far:
            most = max(most, motion / (FARTHEST * min(bodies.inner[a], bodies.inner[b])))
    return most


@jit
def share_of(number, share, shares):
    """Where the places of a share of `number` pairs begin. Pairs are divided in blocks, so that all shares have equal work."""
    return share * (number // (BLOCK * shares) + 1) * BLOCK


@jit
def review(bodies, pairs, share, limits):
    """Write the pairs of quick bodies whose contacts must be found again to a `Share`, and their margins, m.

    The margin is how far a pair comes in `limits.ahead` s, see `Limits`. Pairs that are too far apart lose their contacts. Returns where
    the places and margins of the share begin and end.
    """
    number, shares, places, margins = share
    ahead, same, kept, fall = limits
    part, position, orientation, rotation, velocity = bodies.part, bodies.position, bodies.orientation, bodies.rotation, bodies.velocity
    inner, skin, radius, reach, quick = bodies.inner, bodies.skin, bodies.radius, bodies.reach, bodies.quick
    seen, known, count, apart = pairs.seen, pairs.known, pairs.count, pairs.apart
    total = pairs.first.shape[0]
    begin = share_of(total, number, shares)
    end = begin
    for block in range(number * BLOCK, total, shares * BLOCK):
        for p in range(block, min(block + BLOCK, total)):
            a, b, is_second = pairs.first[p], pairs.second[p], pairs.carrier[p]
            if not (quick[a] or quick[b]) or not in_play(part, a, b):
                continue
            size = min(inner[a], inner[b])
            general = pairs.kind[p] == GENERAL
            speed = _may_close(bodies, a, b, closing_speed(position, velocity, reach, a, b, is_second), fall)
            # Contacts that may close until the next look are found before they do (speculative contacts).
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
                if motion > FORGOTTEN * size:
                    count[p] = 0
                # A pair that was s apart is still at least s - m apart.
                if count[p] == 0 and apart[p] - motion > margin:
                    continue
                still = max(same, SAME_GENERAL) if general or pairs.kind[p] == SEVERAL else same
                if count[p] > 0 and (motion <= still * size or (kept > 0.0 and motion + speed * ahead <= kept * size)):
                    continue
            places[end], margins[end] = p, margin
            end += 1
    return begin, end


@jit
def _are_apart(convex, bodies, pairs, p, margin, workspace):
    """Whether `convex.solids` show that the bodies of a general pair are farther apart than the margin; if so, stores the gap."""
    solids, inset, scratch = convex.solids, convex.inset, workspace.scratch
    a, b = pairs.first[p], pairs.second[p]
    s, t = bodies.shape[a], bodies.shape[b]
    if min(num_corners(solids, s), num_corners(solids, t)) == 0 or max(num_corners(solids, s), num_corners(solids, t)) > MOST_HULL_CORNERS:
        return False
    c = scratch.axes
    d, wanted = seen_from(bodies.rotation, a, b, scratch.between, c), margin + inset[s] + inset[t]
    _, _, _, gap, corners = closest(solids, s, t, d, c, 1.0, FAR * wanted, scratch.simplex)
    if corners == 5 or gap <= wanted:
        return False
    pairs.count[p], pairs.apart[p] = 0, gap - inset[s] - inset[t]
    note_seen(bodies, pairs, p)
    return True


@inlined
def _take_points(table, p, number):
    """Give pair p places for POINTS points from those free for share `number`; returns whether there are enough."""
    pairs, points, ids, free = table
    used = free[number, 0]
    if used + POINTS > free[number, 1]:
        return False
    before = pairs.start[p]
    pairs.start[p], pairs.capacity[p] = used, POINTS
    for i in range(pairs.count[p]):
        for j in range(POINT_FIELDS):
            points[used + i, j] = points[before + i, j]
        for j in range(3):
            ids[used + i, j] = ids[before + i, j]
    free[number, 0] = used + POINTS
    return True


@jit
def _find_of_parts(convex, bodies, table, p, share, query, coefficients, workspace):
    """Find the contacts of a pair of kind SEVERAL; returns 0, or what there is too little of."""
    pairs, points, ids, free = table
    number, parts = share.number, workspace.parts
    ends = pairs.first[p], pairs.second[p]
    count, gap = contacts_of_parts(convex.shapes, bodies, ends, query, workspace.scratch, (workspace.found, parts))
    if count < 0:
        return TOO_FEW_PLACES
    new, old = free[number, 0], pairs.start[p]
    if new + count > free[number, 1]:
        return TOO_FEW_POINTS
    if pairs.count[p] == 0:
        pairs.contact_margin[p] = min(bodies.skin[ends[0]], bodies.skin[ends[1]])
    for i in range(count):
        write_point(bodies, pairs, p, Source(parts.real, i, 0.0, 0.0), coefficients, points, new + i)
        for j in range(3):
            ids[new + i, j] = parts.integer[i, 2 + j]
    if pairs.count[p] == 0:
        set_contact_margin(pairs.contact_margin, p, points, new, new + count)
    else:
        match_contacts(Points(points, ids, old, old + pairs.count[p]), Points(points, ids, new, new + count), NEAR * query.size)
    pairs.start[p], pairs.count[p], pairs.capacity[p] = new, count, count
    free[number, 0] = new + count
    pairs.apart[p] = max(gap, 0.0) if count == 0 else 0.0
    note_seen(bodies, pairs, p)
    return 0


@jit
def find_contacts(convex, bodies, table, share, limits, coefficients, workspace):
    """Find the contacts of a share of the pairs where `review` asks for them. General pairs are left at the begin of its places.

    convex: `Convex`; table: `contact_table.Table`; coefficients (k, k, 4) of two materials; workspace: of the share. Returns the number of
    pairs that were searched, and the number of general ones, or what there is too little of (get more and call again).
    """
    found, old, old_ids, scratch, _ = workspace
    pairs, points, ids, _ = table
    position, rotation, velocity, shape, between = bodies.position, bodies.rotation, bodies.velocity, bodies.shape, scratch.between
    waiting = 0
    begin, end = review(bodies, pairs, share, limits)
    for k in range(begin, end):
        p, margin = share.places[k], share.margins[k]
        a, b = pairs.first[p], pairs.second[p]
        for i in range(3):
            between[i] = position[b, i] - position[a, i]
        if pairs.kind[p] == GENERAL:
            if not _are_apart(convex, bodies, pairs, p, margin, workspace):
                share.places[begin + waiting], share.margins[begin + waiting] = p, margin
                waiting += 1
            continue
        size = min(bodies.inner[a], bodies.inner[b])
        pair, query = Pair(rotation, velocity, a, b, shape[a], shape[b]), Query(margin, limits.ahead, size)
        if pairs.kind[p] == SEVERAL:
            lacks = _find_of_parts(convex, bodies, table, p, share, query, coefficients, workspace)
            if lacks < 0:
                return end - begin, lacks
            continue
        count, gap = convex_contacts(pairs.kind[p], convex.shapes, pair, query, scratch, found)
        if count > pairs.capacity[p] and not _take_points(table, p, share.number):
            return end - begin, TOO_FEW_POINTS
        start, handed = pairs.start[p], 0
        for i in range(start, start + pairs.count[p]):
            # An old contact without impulse gives nothing to a new one.
            if points[i, IMPULSE] > 0.0:
                for j in range(POINT_FIELDS):
                    old[handed, j] = points[i, j]
                for j in range(3):
                    old_ids[handed, j] = ids[i, j]
                handed += 1
        if pairs.count[p] == 0:
            pairs.contact_margin[p] = min(bodies.skin[a], bodies.skin[b])
        for i in range(count):
            write_point(bodies, pairs, p, Source(found.real, i, 0.0, 0.0), coefficients, points, start + i)
            for j in range(3):
                ids[start + i, j] = found.ids[i, j]
        if pairs.count[p] == 0:
            set_contact_margin(pairs.contact_margin, p, points, start, start + count)
        if count > 0 and handed > 0:
            match_contacts(Points(old, old_ids, 0, handed), Points(points, ids, start, start + count), NEAR * size)
        pairs.count[p] = count
        pairs.apart[p] = max(gap, 0.0) if count == 0 else 0.0
        note_seen(bodies, pairs, p)
    return end - begin, waiting
