"""Which bodies touch at one instant (kernels): from some bodies on, contact by contact, and what presses each contact.

Poses are brought to the instant, and the contacts of all pairs that are near are written into one buffer: those of the given bodies, of the
bodies they touch, and so on. Bodies that share the forces of an island come along even if they touch nothing any more: those forces end for
all of them at once, or momentum would not be kept.

The acceleration that presses contact i together, without the force the contact itself carried before, is

    a_i = -n.(a_b + alpha_b x r_b - a_a - alpha_a x r_a) - d(u.n)/dt + f_i (n.K n)

with the present accelerations of the bodies (forces and contacts included), d(u.n)/dt what the gap gains at constant
velocities, as the place of contact wanders and the normal turns (dynamics/constraints/contact_motion.py), and f_i the normal force
it carried. It is what a rebound is measured against: one that rises less than delta, v^2 < 2 a delta, is none, and a
contact that leaves more slowly than that is held. So a ball that slides in a spinning hollow is held without gravity.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.simplices import CORNER
from rigidimpulse.collision.manifold.contact_points import Contacts as ContactBuffers
from rigidimpulse.collision.manifold.dispatch import PairQuery, contacts_of_pairs
from rigidimpulse.collision.manifold.reduce import MAX_PER_NORMAL
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.union_find import root_of, unite
from rigidimpulse.dynamics.constraints.contact_motion import contact_motion
from rigidimpulse.dynamics.impact.point import inverse_effective_mass, relative_velocity
from rigidimpulse.engine.pair_table import MARGIN, USED
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import bring
from rigidimpulse.motion.trajectory import Trajectories, place_at

# Part of bounding radii and of held gaps that rounding may take.
ROUND_OFF = TOLERANCES.events.reach_round_off
FAR_MARGIN = 30.0
"""Contacts that a position correction may close are looked for within this many contact margins."""


class Motion(NamedTuple):
    """Paths of n bodies, and their state at the instant being worked on."""

    trajectory: Trajectories
    now: BodyState
    rotation: np.ndarray  # (n, 3, 3)
    acceleration: np.ndarray  # (n, 3) m/s2
    angular_acceleration: np.ndarray  # (n, 3) rad/s2


class Found(NamedTuple):
    """Where contacts are written to; `place` has as many rows as the buffers."""

    buffers: ContactBuffers
    place: np.ndarray  # (c,) pair of each contact
    brought: np.ndarray  # (n,) bool, bodies brought to the instant
    reached: np.ndarray  # (n,) bool, bodies looked at


class Shared(NamedTuple):
    """What ties bodies together besides contacts."""

    under_contact: np.ndarray  # (n,) bool
    sharing: np.ndarray  # (n,) first body of the island whose forces bodies under contact share
    links: np.ndarray  # (l, 2) bodies joined by joints and forces


class Pressing(NamedTuple):
    """What a contact is measured against."""

    least: float  # m/s2, least acceleration that presses
    step: float  # s


@jit_making_arrays
def near_pairs(trajectory, time, table, radius, bodies, seen, near):
    """Write the pairs of the given bodies (n,) bool that are not `seen` (p,) yet and whose bounding spheres are near at `time`.

    radius (n,) m. near (p,): their places, in order. Marks the pairs that were looked at as seen, and returns how many are near.
    """
    x, y = np.empty(3), np.empty(3)
    count = np.int64(0)
    for p in range(table.number[USED]):
        pair = table.pairs[p]
        a, b = pair.a, pair.b
        if seen[p] or not (bodies[a] or bodies[b]):
            continue
        seen[p] = True
        reach = (radius[a] + radius[b]) * (1.0 + ROUND_OFF) + FAR_MARGIN * pair.contact_margin
        if reach < np.inf:
            place_at(trajectory, a, time, x)
            place_at(trajectory, b, time, y)
            if (y[0] - x[0]) ** 2 + (y[1] - x[1]) ** 2 + (y[2] - x[2]) ** 2 > reach * reach:
                continue
        near[count] = p
        count += 1
    return count


@jit_making_arrays
def contacts_at(shapes, motion, table, places, margin, found, count):
    """Append the contacts of the pairs at these places, within `margin` contact margins, at the present poses.

    Returns the new count, or minus the number of contacts that there must be space for.
    """
    a, b, reach = np.empty(1, np.int64), np.empty(1, np.int64), np.empty(1)
    buffers = found.buffers
    for p in places:
        pair = table.pairs[p]
        a[0], b[0], reach[0] = pair.a, pair.b, margin * pair.contact_margin
        rest = ContactBuffers(buffers.real[count:], buffers.integer[count:], buffers.scratch)
        more = contacts_of_pairs(shapes, motion.now, motion.rotation, PairQuery(a, b, reach), rest, MAX_PER_NORMAL)
        if more < 0 or count + more >= len(found.place):
            return -(count + abs(more) + 1)
        for c in range(count, count + more):
            found.place[c] = p
        count += more
    return count


@jit
def witness_contacts(table, places, time, found, first, count):
    """Append the witness of each pair that just came to contact but has no contact from `first` on; returns the new count.

    Such a pair overlaps, since its sweep does not back up time.
    """
    real, integer = found.buffers.real, found.buffers.integer
    for p in places:
        pair = table.pairs[p]
        normal = pair.witness[6] != 0.0 or pair.witness[7] != 0.0 or pair.witness[8] != 0.0
        if pair.time > time or not normal:
            continue
        known = False
        for c in range(first, count):
            known = known or found.place[c] == p
        if known:
            continue
        if count >= len(found.place):
            return -(count + 1)
        for k in range(10):
            real[count, k] = pair.witness[k]
        integer[count, 0], integer[count, 1], integer[count, 2] = pair.a, pair.b, CORNER
        integer[count, 3] = integer[count, 4] = -1
        found.place[count] = p
        count += 1
    return count


@jit
def _mark_ties(shared, frontier, mark):
    """Mark (n,) whom links tie to bodies of the frontier (n,) bool, and those that share forces with them."""
    for k in range(shared.links.shape[0]):
        i, j = shared.links[k, 0], shared.links[k, 1]
        if frontier[i] or frontier[j]:
            mark[i] = mark[j] = True
    for i in range(frontier.shape[0]):
        if not (frontier[i] and shared.under_contact[i]):
            continue
        for j in range(frontier.shape[0]):
            if shared.under_contact[j] and shared.sharing[j] == shared.sharing[i]:
                mark[j] = True


@jit_making_arrays
def find_touching(shapes, constants, motion, table, shared, found, time):
    """Write the contacts of all bodies that hang together with those marked in `found.reached` at `time`; returns their number.

    Minus the number of contacts that there must be space for, if there is too little: then call it again with larger buffers.
    `found.reached` gets all bodies that were looked at, `found.brought` those that were brought to `time`.
    """
    n, used = constants.dynamic.shape[0], table.number[USED]
    seen, near = np.zeros(used, np.bool_), np.empty(used, np.int64)
    frontier, mark = found.reached.copy(), np.empty(n, np.bool_)
    found.reached[:] = False
    found.brought[:] = False
    count, active = np.int64(0), True
    while active:
        for i in range(n):
            found.reached[i] = found.reached[i] or frontier[i]
            mark[i] = frontier[i]
        # All that a position correction may come near is brought to `time` with what touches.
        number = near_pairs(motion.trajectory, time, table, constants.bound_radius, frontier, seen, near)
        places = near[:number]
        for p in places:
            mark[table.pairs[p].a] = mark[table.pairs[p].b] = True
        _mark_ties(shared, frontier, mark)
        for i in range(n):
            if mark[i] and not found.brought[i]:
                found.brought[i] = True
                bring(motion.trajectory, i, time, motion.now, motion.rotation, motion.acceleration, motion.angular_acceleration)
        first = count
        count = contacts_at(shapes, motion, table, places, MARGIN, found, count)
        if count >= 0:
            count = witness_contacts(table, places, time, found, first, count)
        if count < 0:
            return count
        mark[:] = False
        for c in range(first, count):
            mark[found.buffers.integer[c, 0]] = mark[found.buffers.integer[c, 1]] = True
        _mark_ties(shared, frontier, mark)
        active = False
        for i in range(n):
            frontier[i] = mark[i] and constants.dynamic[i] and not found.reached[i]
            active = active or frontier[i]
    return count


@jit
def _comes_before(owner, integer, c, d):
    """Whether contact c comes before d: by island, pair, and what touches."""
    if owner[c] != owner[d]:
        return owner[c] < owner[d]
    for k in range(5):
        if integer[c, k] != integer[d, k]:
            return integer[c, k] < integer[d, k]
    return c < d


@jit_making_arrays
def sort_contacts(owner, integer, order):
    """Sort places of contacts, order (m,), by their owner (c,), pair, and what touches; by merging."""
    m, width = order.shape[0], np.int64(1)
    merged = np.empty(m, np.int64)
    while width < m:
        for start in range(0, m, 2 * width):
            left, middle, end = start, min(start + width, m), min(start + 2 * width, m)
            right = middle
            for place in range(start, end):
                if left < middle and (right >= end or _comes_before(owner, integer, order[left], order[right])):
                    merged[place] = order[left]
                    left += 1
                else:
                    merged[place] = order[right]
                    right += 1
        for place in range(m):
            order[place] = merged[place]
        width *= 2


@jit_making_arrays
def split_islands(dynamic, links, found, count, root, order):
    """Put contacts into islands of movable bodies (n,) that contacts and links (l, 2) join.

    Writes the root (n,) of each body, the lowest of its island, and the contacts in order (count,): island after island, pair after pair.
    """
    integer = found.buffers.integer
    for i in range(root.shape[0]):
        root[i] = i
    for c in range(count):
        a, b = integer[c, 0], integer[c, 1]
        if dynamic[a] and dynamic[b]:
            unite(root, a, b)
    for k in range(links.shape[0]):
        i, j = links[k, 0], links[k, 1]
        if dynamic[i] and dynamic[j] and found.reached[i] and found.reached[j]:
            unite(root, i, j)
    for i in range(root.shape[0]):
        root[i] = root_of(root, i)
    owner = np.empty(count, np.int64)
    for c in range(count):
        a, b = integer[c, 0], integer[c, 1]
        owner[c] = root[a] if dynamic[a] else root[b]
        order[c] = c
    sort_contacts(owner, integer, order)


@jit
def fill_contacts(bodies, real, integer, rows, material_of_body, coefficients, contacts):
    """Contacts (see dynamics/impact/point.py) from the buffer rows; coefficients (k, k, 4): e, mu_s, mu_k, e_t of two materials."""
    for s in range(rows.shape[0]):
        c = rows[s]
        a, b = integer[c, 0], integer[c, 1]
        contacts.body_a[s] = a
        contacts.body_b[s] = b
        for k in range(3):
            contacts.arm_a[s, k] = real[c, k] - bodies.position[a, k]
            contacts.arm_b[s, k] = real[c, 3 + k] - bodies.position[b, k]
            contacts.normal[s, k] = real[c, 6 + k]
        contacts.gap[s] = real[c, 9]
        pair = coefficients[material_of_body[a], material_of_body[b]]
        contacts.restitution[s] = pair[0]
        contacts.static_friction[s] = pair[1]
        contacts.dynamic_friction[s] = pair[2]
        contacts.tangential_restitution[s] = pair[3]


@jit_making_arrays
def make_contacts(m):
    """Arrays for m contacts."""
    return Contacts(
        np.empty(m, np.int64), np.empty(m, np.int64), np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 3)), np.empty(m), np.empty(m),
        np.empty(m), np.empty(m), np.empty(m),
    )  # fmt: skip


@jit
def _point_acceleration(acceleration, angular_acceleration, i, r, n):
    """n.(a + alpha x r) of body i."""
    a, alpha = acceleration[i], angular_acceleration[i]
    x = a[0] + alpha[1] * r[2] - alpha[2] * r[1]
    y = a[1] + alpha[2] * r[0] - alpha[0] * r[2]
    z = a[2] + alpha[0] * r[1] - alpha[1] * r[0]
    return n[0] * x + n[1] * y + n[2] * z


@jit_making_arrays
def press(shapes, motion, contacts, touching, normal_force, pressing, contact_margin, speeds):
    """Fill speeds (2, m): the approach u.n, and the rest speed sqrt(2 a delta) [m/s]; a is at least `pressing.least`.

    What the motion gives counts where it makes more than round-off of delta in a step [s]: bodies that stand still do so by round-off.

    touching: `Touching`; normal_force (m,) N carried; contact_margin (m,) delta, m.
    """
    bodies = motion.now
    turning = contact_motion(
        shapes.geometry, shapes.of_body, motion.rotation, bodies, contacts, touching.kind, touching.feature
    ).turning
    u = np.empty(3)
    k = np.empty((3, 3))
    for c in range(contacts.gap.shape[0]):
        n = contacts.normal[c]
        speeds[0, c] = relative_velocity(bodies, contacts, c, u)
        a = _point_acceleration(
            motion.acceleration, motion.angular_acceleration, contacts.body_a[c], contacts.arm_a[c], n
        ) - _point_acceleration(motion.acceleration, motion.angular_acceleration, contacts.body_b[c], contacts.arm_b[c], n)
        turn = turning[c, 0] * n[0] + turning[c, 1] * n[1] + turning[c, 2] * n[2]
        if abs(turn) * pressing.step * pressing.step > ROUND_OFF * contact_margin[c]:
            a -= turn
        if normal_force[c] > 0.0:
            inverse_effective_mass(bodies, contacts, c, k)
            for i in range(3):
                for j in range(3):
                    a += normal_force[c] * n[i] * k[i, j] * n[j]
        speeds[1, c] = sqrt(2.0 * max(a, pressing.least) * contact_margin[c])
