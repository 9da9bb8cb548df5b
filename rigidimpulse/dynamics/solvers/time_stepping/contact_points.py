"""Contact points of an island at its present pose, as the rows of `constraints` take them, and their impulses kept for the next sub-step.

The contact table keeps points fixed in the bodies. With n the normal from a to b and the gap s less the contact margin,

    s = n.(c_b - c_a) - margin,     u_n = n.(v_b + w_b x r_b - v_a - w_a x r_a).

A point takes part where it may come to bear in the sub-step h:  s < AHEAD h |u_n| + NEAR skins.
"""

import numpy as np

from rigidimpulse.collision.contact_records import (
    DYNAMIC_FRICTION,
    FRICTION,
    IMPULSE,
    ROUND_A,
    ROUND_B,
    SEPARATION,
    SKELETON_B,
    SKIN,
    STATIC_FRICTION,
    in_play,
)
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.vector import turned_by
from rigidimpulse.dynamics.constraints.rows import impulse_along, rows_of
from rigidimpulse.dynamics.solvers.tgs_soft.records import normal_of, point_of
from rigidimpulse.model.contacts import Contacts

AHEAD, NEAR = 2.0, 1.0
GIVEN = 21
"""Fields of a contact point: the impulse on the second body since the caller set it to 0 (3), N s, world."""
FIRST, MIDDLE, SECOND = 1.0, 0.5, 0.0
"""Share of the first body in the place of an impulse: on a rounded surface that meets one with edges, else midway between both."""


@jit_making_arrays
def contact_points(bodies, now, pairs, points, coefficients, h):
    """The contacts that may bear in a sub-step of h s, and their places (m,) in the table.

    bodies: by rank, with the parts they play. now: their velocities. coefficients (k, k, 4): of two materials.
    """
    most = 0
    for p in range(pairs.first.shape[0]):
        if pairs.count[p] > 0 and in_play(bodies.part, pairs.first[p], pairs.second[p]):
            most += pairs.count[p]
    ends, place = np.empty((2, most), np.int64), np.empty(most, np.int64)
    arms, numbers = np.empty((3, most, 3)), np.empty((5, most))
    m = 0
    for p in range(pairs.first.shape[0]):
        a, b = pairs.first[p], pairs.second[p]
        if pairs.count[p] == 0 or not in_play(bodies.part, a, b):
            continue
        law = coefficients[bodies.material[a], bodies.material[b]]
        for r in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
            n = normal_of(bodies.position, bodies.rotation, points, r, a, b, pairs.carrier[p])
            x, y, z, gap = point_of(bodies.position, bodies.rotation, points, r, (a, b), n, _share(points, r))
            for k, along in enumerate((x, y, z)):
                arms[0, m, k] = along
                arms[1, m, k] = along - (bodies.position[b, k] - bodies.position[a, k])
                arms[2, m, k] = n[k]
            if gap >= AHEAD * h * abs(_normal_speed(now, a, b, arms[:, m])) + NEAR * points[r, SKIN]:
                # It is too far away to bear: what it carried is gone.
                points[r, IMPULSE], points[r, SEPARATION] = 0.0, gap
                points[r, FRICTION : FRICTION + 3] = 0.0
                continue
            ends[0, m], ends[1, m], place[m] = a, b, r
            numbers[0, m], numbers[1, m], numbers[2, m] = gap, law[0], 0.0
            numbers[3, m], numbers[4, m] = points[r, STATIC_FRICTION], points[r, DYNAMIC_FRICTION]
            m += 1
    contacts = Contacts(
        ends[0, :m], ends[1, :m], arms[0, :m], arms[1, :m], arms[2, :m], numbers[0, :m], numbers[1, :m], numbers[2, :m], numbers[3, :m],
        numbers[4, :m],
    )  # fmt: skip
    return contacts, place[:m]


@jit
def _share(points, r):
    """Share of the first body in the place of an impulse: what rolls is pressed where it touches now, not where it did at the last look."""
    if points[r, ROUND_A] > 0.0 and points[r, ROUND_B] == 0.0:
        return FIRST
    if points[r, ROUND_B] > 0.0 and points[r, ROUND_A] == 0.0:
        return SECOND
    return MIDDLE


@jit
def forget_given(bodies, pairs, points):
    """Count what contact points give from here on: others may have stood in their rows."""
    for p in range(pairs.first.shape[0]):
        if in_play(bodies.part, pairs.first[p], pairs.second[p]):
            for r in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
                points[r, GIVEN] = points[r, GIVEN + 1] = points[r, GIVEN + 2] = 0.0


@jit
def sum_given(bodies, pairs, points, given):
    """Add what contact points gave to given (p, 10) of their pairs: impulse, and its size times place, normal and 1."""
    for p in range(pairs.first.shape[0]):
        a, b = pairs.first[p], pairs.second[p]
        if not in_play(bodies.part, a, b):
            continue
        for r in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
            # Squares of impulses below 1e-160 N s are zero, and so is their length.
            size = np.sqrt(points[r, GIVEN] ** 2 + points[r, GIVEN + 1] ** 2 + points[r, GIVEN + 2] ** 2)
            if size == 0.0:
                continue
            n = normal_of(bodies.position, bodies.rotation, points, r, a, b, pairs.carrier[p])
            arm = turned_by(bodies.rotation, b, points[r, SKELETON_B], points[r, SKELETON_B + 1], points[r, SKELETON_B + 2])
            for k in range(3):
                given[p, k] += points[r, GIVEN + k]
                given[p, 3 + k] += size * (bodies.position[b, k] + arm[k])
                given[p, 6 + k] += size * n[k]
            given[p, 9] += size


@jit
def _normal_speed(now, a, b, arms):
    """u_n of a contact with arm_a, arm_b and normal (3, 3)."""
    total = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        va = now.velocity[a, k] + now.angular_velocity[a, i] * arms[0, j] - now.angular_velocity[a, j] * arms[0, i]
        vb = now.velocity[b, k] + now.angular_velocity[b, i] * arms[1, j] - now.angular_velocity[b, j] * arms[1, i]
        total += arms[2, k] * (vb - va)
    return total


@jit
def start_from_kept(rows, of_contacts, points, place):
    """Let the rows of contacts start from the impulses kept in the table."""
    for c in range(place.shape[0]):
        r, i, frame = place[c], of_contacts.first_row[c], of_contacts.frames[c]
        rows.impulse[i] = points[r, IMPULSE]
        for k in range(1, rows_of(rows, i)):
            along = 0.0
            for j in range(3):
                along += points[r, FRICTION + j] * frame[k, j]
            rows.impulse[i + k] = along


@jit_making_arrays
def keep_for_next(of_contacts, contacts, points, place):
    """Keep the impulses of the rows of contacts in the table, friction in the world; add them to what was given so far."""
    rows, whole = of_contacts.rows, np.empty(3)
    for c in range(place.shape[0]):
        r, i, frame = place[c], of_contacts.first_row[c], of_contacts.frames[c]
        impulse_along(rows, i, frame, whole)
        points[r, IMPULSE], points[r, SEPARATION] = rows.impulse[i], contacts.gap[c]
        for k in range(3):
            points[r, FRICTION + k] = whole[k] - rows.impulse[i] * frame[0, k]
            points[r, GIVEN + k] += whole[k]
