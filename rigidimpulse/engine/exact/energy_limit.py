"""The energy limiter: no energy from constant contact forces.

Over a sub-step contact forces are constant while contacts move, so they do a little work that they should not. Bodies that
together touched nothing but each other and ground of one velocity cannot have gained energy, seen from that ground: what they
gained is taken off what moves against the motion of their common rigid body, V, W, by one factor:

    v_i = V + W x (x_i - X) + dv_i,  w_i = W + dw_i,    T = T_rigid(V, W) + T_d(dv, dw),    T_d' = T_d - gained

T_rigid and T_d are orthogonal, so momentum and angular momentum stay. Ground that takes part pushes along some directions, and turns
about those across them: V and W then have only what is left, the part of the common motion whose momentum no such push changes (along
a smooth floor: V level, W upright), and are zero where the ground has friction.

The energy that ground of velocity U sees grows by this from t_0 to t; a is the acceleration by gravity and constant forces:

    gained = E - E_0 - sum m (v - v_0).U + sum m a.U (t - t_0)
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.symmetric import inverse, solved, symmetric_at, times
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, length, row, scaled, subtract
from rigidimpulse.dynamics.common_motion import add_turning
from rigidimpulse.dynamics.energy import kinetic_energy, mechanical_energy

PARALLEL = TOLERANCES.contact_forces.same_direction
AT_REST = (0.0, 0.0, 0.0)
MAY_GIVE = -1
"""Rank of ground that may give energy."""


class Ground(NamedTuple):
    """What stands by an island."""

    rank: int  # in how many independent directions it may push, MAY_GIVE where it may give energy
    velocity: tuple[float, float, float]  # m/s of all that stands, seen from where it does no work
    axis: tuple[float, float, float]  # that direction if there is one, the one across them if there are two


@jit
def note_hold(limiter, bodies, constants, contacts, members, supports, passive):
    """Remember who shares the forces of the held contacts from now on, and whether they may make energy.

    supports (k,): what else stands by the island, see `_ground_of`; passive: whether neither joints nor varying forces make energy.
    """
    first = members[0]
    ground = _ground_of(bodies, constants.dynamic, contacts, supports)
    closed = passive and ground.rank != MAY_GIVE
    for i in members:
        limiter.sharing[i] = first
        limiter.closed[i] = closed
    if closed:
        limiter.ground_rank[first] = ground.rank
        for k in range(3):
            limiter.ground_velocity[first, k] = ground.velocity[k]
            limiter.ground_axis[first, k] = ground.axis[k]


@jit
def _ground_of(bodies, dynamic, contacts, supports):
    """What stands by an island: at its contacts, and the supports (k,), which hold it in every direction, -1 for the world.

    It may give no energy where all of it moves with one velocity.
    """
    m = contacts.body_a.shape[0]
    velocity, known, steady = AT_REST, False, True
    for c in range(2 * m + supports.shape[0]):
        i = contacts.body_a[c] if c < m else contacts.body_b[c - m] if c < 2 * m else supports[c - 2 * m]
        if i >= 0 and dynamic[i]:
            continue
        v, w = (row(bodies.velocity, i), row(bodies.angular_velocity, i)) if i >= 0 else (AT_REST, AT_REST)
        if not known:
            velocity, known = v, True
        steady = steady and v == velocity and w == AT_REST
    rank, axis = _pushes(dynamic, contacts)
    if not steady:
        rank = MAY_GIVE
    elif supports.shape[0] > 0:
        rank = 3
    return Ground(rank, velocity, axis)


@jit
def _pushes(dynamic, contacts):
    """In how many independent directions contacts push that dynamic bodies have with others, and the axis of `Ground`."""
    rank, first, axis, widest = 0, AT_REST, AT_REST, PARALLEL
    for c in range(contacts.gap.shape[0]):
        if dynamic[contacts.body_a[c]] and dynamic[contacts.body_b[c]]:
            continue
        if contacts.static_friction[c] > 0.0:
            return 3, AT_REST
        n = row(contacts.normal, c)
        if rank == 0:
            rank, first = 1, n
        across = cross(first, n)
        if length(across) > widest:
            rank, axis, widest = 2, across, length(across)
    if rank < 2:
        return rank, first
    axis = scaled(axis, 1.0 / widest)
    for c in range(contacts.gap.shape[0]):
        stands = not (dynamic[contacts.body_a[c]] and dynamic[contacts.body_b[c]])
        if stands and abs(dot(axis, row(contacts.normal, c))) > PARALLEL:
            rank = 3
    return rank, axis


@jit
def limit_correction_energy(bodies, constants, contacts, members, supports, way, depth):
    """Take off the members' speeds what a position correction by `way` (k, 3) m gained; returns how their energy changes, J.

    That is beyond their weight times the depth [m] that contacts may sink. supports (k,): as for `note_hold`.
    """
    lost, sinking = 0.0, 0.0
    for n in range(members.shape[0]):
        weight = scaled(row(constants.steady_acceleration, members[n]), constants.mass[members[n]])
        lost += dot(weight, row(way, n))
        sinking += length(weight)
    excess = -lost - depth * sinking
    if not excess > 0.0:
        return 0.0
    ground = _ground_of(bodies, constants.dynamic, contacts, supports)
    return _slow_down(bodies, constants, members, excess, ground) if ground.rank != MAY_GIVE else 0.0


@jit
def note_end_energy(limiter, bodies, constants, members):
    """Keep the energy with which members under contact forces arrive, from which the work of those forces follows."""
    for n in range(members.shape[0]):
        if limiter.under_contact[members[n]]:
            limiter.end_energy[members[n]] = mechanical_energy(bodies, constants, members[n : n + 1])


@jit_making_arrays
def limit_energy(limiter, bodies, constants, trajectory, brought, time, slowed, changes):
    """Take what islands gained since they share their forces off the velocities of the bodies (k,) that are brought to `time`.

    All that share forces arrive together. Marks in slowed (n,) whom it slows, writes into changes (k,) how the energy of each such island
    changes [J], and returns how many these are.
    """
    # Island by island, in order of their first bodies.
    order, count = np.empty(brought.shape[0], np.int64), 0
    for i in brought:
        if limiter.under_contact[i] and limiter.closed[i]:
            place = count
            while place > 0 and limiter.sharing[order[place - 1]] > limiter.sharing[i]:
                order[place] = order[place - 1]
                place -= 1
            order[place] = i
            count += 1
    before = np.empty((count, 6))
    begin, done = 0, 0
    while begin < count:
        first, end = limiter.sharing[order[begin]], begin
        while end < count and limiter.sharing[order[end]] == first:
            end += 1
        members = order[begin:end]
        gained = _gained(limiter, bodies, constants, trajectory, members, time)
        if gained > limiter.gain * kinetic_energy(bodies, constants, members):
            for n in range(begin, end):
                for k in range(3):
                    before[n, k], before[n, 3 + k] = bodies.velocity[order[n], k], bodies.angular_velocity[order[n], k]
            ground = Ground(limiter.ground_rank[first], row(limiter.ground_velocity, first), row(limiter.ground_axis, first))
            changes[done] = _slow_down(bodies, constants, members, gained, ground)
            done += 1
            for n in range(begin, end):
                slowed[order[n]] = True
                for k in range(3):
                    # Frames on the way have their share of it.
                    limiter.correction[order[n], k] += bodies.velocity[order[n], k] - before[n, k]
                    limiter.correction[order[n], 3 + k] += bodies.angular_velocity[order[n], k] - before[n, 3 + k]
        begin = end
    return done


@jit
def _gained(limiter, bodies, constants, trajectory, members, time):
    """What members gained since they share their forces, as their ground sees it, J."""
    begun, moved, first = 0.0, 0.0, limiter.sharing[members[0]]
    U = row(limiter.ground_velocity, first)
    for i in members:
        begun += limiter.energy_at_start[i]
        change = subtract(row(bodies.velocity, i), row(trajectory.velocity, i))
        change = along(change, -(time - trajectory.start[i]), row(constants.steady_acceleration, i))
        moved += constants.mass[i] * dot(change, U)
    return mechanical_energy(bodies, constants, members) - begun - moved


@jit
def _slow_down(bodies, constants, members, energy, ground):
    """Take energy [J], seen from the ground, off the members' motion; returns how their kinetic energy changes, J."""
    before = kinetic_energy(bodies, constants, members)
    for i in members:
        for k in range(3):
            bodies.velocity[i, k] -= ground.velocity[k]
    take_off(bodies, constants.mass, members, energy, ground)
    for i in members:
        for k in range(3):
            bodies.velocity[i, k] += ground.velocity[k]
    return kinetic_energy(bodies, constants, members) - before


@jit
def take_off(bodies, mass, members, energy, ground):
    """Take energy [J], or all there is, off how the members move against each other or the ground, which stands."""
    X, V, W = _common_motion(bodies, mass, members, ground)
    available = 0.0
    for i in members:
        dv, dw = _against(bodies, i, X, V, W)
        available += mass[i] * dot(dv, dv) + dot(dw, solved(symmetric_at(bodies.inv_inertia, i), dw))
    available *= 0.5
    if not available > 0.0:
        return
    share = sqrt(max(1.0 - energy / available, 0.0))
    for i in members:
        dv, dw = _against(bodies, i, X, V, W)
        v = along(V, 1.0, cross(W, subtract(row(bodies.position, i), X)))
        for k in range(3):
            bodies.velocity[i, k] = v[k] + share * dv[k]
            bodies.angular_velocity[i, k] = W[k] + share * dw[k]


@jit
def _against(bodies, i, X, V, W):
    """Return dv, dw: how body i moves against the common motion."""
    v = along(V, 1.0, cross(W, subtract(row(bodies.position, i), X)))
    return subtract(row(bodies.velocity, i), v), subtract(row(bodies.angular_velocity, i), W)


@jit
def _common_motion(bodies, mass, members, ground):
    """Return X, V, W: the centre of mass, and the part of the common motion that no push of the ground changes."""
    M, X, P = 0.0, AT_REST, AT_REST
    for i in members:
        M += mass[i]
        X = along(X, mass[i], row(bodies.position, i))
        P = along(P, mass[i], row(bodies.velocity, i))
    X, axis = scaled(X, 1.0 / M), ground.axis
    if ground.rank > 2:
        return X, AT_REST, AT_REST
    if ground.rank == 2:
        return X, scaled(axis, dot(axis, P) / M), AT_REST
    L, J = _turning(bodies, mass, members, X)
    if ground.rank == 1:
        turn = dot(axis, L) / dot(axis, times(J, axis))
        return X, scaled(along(P, -dot(axis, P), axis), 1.0 / M), scaled(axis, turn)
    return X, scaled(P, 1.0 / M), solved(J, L)


@jit
def _turning(bodies, mass, members, X):
    """Return the angular momentum about X and the inertia of the members as one body, a symmetric matrix."""
    L, J = AT_REST, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in members:
        A, v, w = symmetric_at(bodies.inv_inertia, i), row(bodies.velocity, i), row(bodies.angular_velocity, i)
        L, J = add_turning(L, J, mass[i], subtract(row(bodies.position, i), X), v, solved(A, w), inverse(A))
    return L, J
