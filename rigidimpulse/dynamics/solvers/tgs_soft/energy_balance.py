"""The energy of sub-stepped islands is balanced where it is made (kernels).

Sub-steps push bodies out of the skin, and round; both make a little energy. Members that no contact connects cannot give each other any.
So the members fall into clusters: those that contacts between them connect in the step. With the energy E of a cluster after a step, E_0
before it, the work G of moving supports and of torques, and the kinetic energy T, its speeds are multiplied by f:

    gained = E - E_0 - G > 0:    f^2 = 1 - gained / T

A cluster that touches nothing but its own members is free: nothing may change its momentum P and angular momentum L. There T is the
energy of its motion against V and W, its motion as one body (`common_motion`), and only that motion is multiplied by f.

A member without any contact flies, and is left as it is. Clusters at rest cannot pay: what they gain by rising out of each other is a
position correction. So is what moves bodies by dx when they join an island, which costs -m g.dx each. A body pays for its own rise, from
its own speed, as far as that goes; a free cluster pays for the rise of all its bodies, from its motion against V and W. No other body
pays: it would lose motion that it has nothing to do with.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_records import MEMBER, in_play
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.symmetric import solved, times
from rigidimpulse.core.union_find import root_of, unite
from rigidimpulse.core.vector import along, cross, dot, length, row, scaled, subtract, turned_back_by
from rigidimpulse.dynamics.common_motion import add_turning

REPORTED = 0.5
"""Part of its kinetic energy from which what a body pays for its rise is reported, if it rises by a skin or more."""


MOST_TAKEN = 0.1
"""Part of what moves that the balance may take: more says that the forces were not found."""


class Weights(NamedTuple):
    """Of n bodies by rank."""

    mass: np.ndarray  # (n,) kg
    pull: np.ndarray  # (n, 3) m/s2, acceleration by gravity and forces


class Balance(NamedTuple):
    """What is known of n bodies by rank, and one entry that is no body, while a step goes on."""

    parent: np.ndarray  # (n+1,) clusters, see `core.union_find`
    touched: np.ndarray  # (n+1,) bool, there was a contact
    held: np.ndarray  # (n+1,) bool, there was something that is no member at a contact or a joint
    before: np.ndarray  # (n+1,) J, energy of the body at the start
    given: np.ndarray  # (n+1,) J, work of moving supports on the body
    taken: np.ndarray  # (n+1,) J, taken off its speed at the ends of the parts of a step
    raised: np.ndarray  # (n+1,) J, what a cluster gained and cannot pay, of its root


def make_balance(n: int) -> Balance:
    """Arrays for n bodies."""
    none = np.zeros((4, n + 1))
    return Balance(np.arange(n + 1), np.zeros(n + 1, bool), np.zeros(n + 1, bool), none[0], none[1], none[2], none[3])


@jit
def _energy(bodies, weights, i):
    """Kinetic energy of body i, and that with its potential, J."""
    o, v, moments, m = 8 * i, bodies.velocity, bodies.inertia[i], weights.mass[i]
    x, y, z = turned_back_by(bodies.rotation, i, v[o + 3], v[o + 4], v[o + 5])
    kinetic = 0.5 * m * (v[o] * v[o] + v[o + 1] * v[o + 1] + v[o + 2] * v[o + 2])
    kinetic += 0.5 * (moments[0] * x * x + moments[1] * y * y + moments[2] * z * z)
    total = kinetic
    for k in range(3):
        total -= m * weights.pull[i, k] * bodies.position[i, k]
    return kinetic, total


@jit
def takes_little(balance, bodies, weights, at):
    """Whether the balance took little from members `at` their ranks (k,): no more than MOST_TAKEN of what moves, and a rise by the skin.

    No if it is no number.
    """
    taken, allowed = 0.0, 0.0
    for i in at:
        pull = weights.pull[i]
        taken += balance.taken[i]
        allowed += MOST_TAKEN * _energy(bodies, weights, i)[0]
        allowed += weights.mass[i] * sqrt(pull[0] ** 2 + pull[1] ** 2 + pull[2] ** 2) * bodies.skin[i]
    return taken <= allowed


@jit
def _cost(weights, rise, i):
    """Energy -m g.dx that moving body i by rise[i] makes, J."""
    cost = 0.0
    for k in range(3):
        cost -= weights.mass[i] * weights.pull[i, k] * rise[i, k]
    return cost


@jit
def _slow_down(bodies, i, factor):
    for k in range(8 * i, 8 * i + 6):
        bodies.velocity[k] *= factor


@jit
def _velocity(bodies, i):
    """Velocity and angular velocity of body i."""
    v, o = bodies.velocity, 8 * i
    return (v[o], v[o + 1], v[o + 2]), (v[o + 3], v[o + 4], v[o + 5])


@jit
def _world_inertia(bodies, i):
    """Inertia of body i about the world's axes, R diag(moments) R^T."""
    m = bodies.inertia[i]
    x, y, z = turned_back_by(bodies.rotation, i, 1.0, 0.0, 0.0), turned_back_by(bodies.rotation, i, 0.0, 1.0, 0.0), turned_back_by(
        bodies.rotation, i, 0.0, 0.0, 1.0
    )
    return (
        m[0] * x[0] * x[0] + m[1] * x[1] * x[1] + m[2] * x[2] * x[2],
        m[0] * x[0] * y[0] + m[1] * x[1] * y[1] + m[2] * x[2] * y[2],
        m[0] * x[0] * z[0] + m[1] * x[1] * z[1] + m[2] * x[2] * z[2],
        m[0] * y[0] * y[0] + m[1] * y[1] * y[1] + m[2] * y[2] * y[2],
        m[0] * y[0] * z[0] + m[1] * y[1] * z[1] + m[2] * y[2] * z[2],
        m[0] * z[0] * z[0] + m[1] * z[1] * z[1] + m[2] * z[2] * z[2],
    )


@jit
def _common_motion(bodies, weights, members):
    """Return X, V, W of free members."""
    M, X, P = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in members:
        M += weights.mass[i]
        X = along(X, weights.mass[i], row(bodies.position, i))
        P = along(P, weights.mass[i], _velocity(bodies, i)[0])
    X, L, J = scaled(X, 1.0 / M), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in members:
        (v, w), inertia = _velocity(bodies, i), _world_inertia(bodies, i)
        L, J = add_turning(L, J, weights.mass[i], subtract(row(bodies.position, i), X), v, times(inertia, w), inertia)
    return X, scaled(P, 1.0 / M), solved(J, L)


@jit
def _pay_together(bodies, weights, members, cost):
    """Take up to `cost` J off how free members move against their common motion; returns what they pay."""
    X, V, W = _common_motion(bodies, weights, members)
    available = 0.0
    for i in members:
        v, w = _velocity(bodies, i)
        dv, dw = subtract(v, along(V, 1.0, cross(W, subtract(row(bodies.position, i), X)))), subtract(w, W)
        available += 0.5 * (weights.mass[i] * dot(dv, dv) + dot(dw, times(_world_inertia(bodies, i), dw)))
    if not available > 0.0:
        return 0.0
    paid = min(cost, available)
    less = 1.0 - sqrt(1.0 - paid / available)
    for i in members:
        v, w = _velocity(bodies, i)
        dv, dw = subtract(v, along(V, 1.0, cross(W, subtract(row(bodies.position, i), X)))), subtract(w, W)
        for k in range(3):
            bodies.velocity[8 * i + k] -= less * dv[k]
            bodies.velocity[8 * i + 3 + k] -= less * dw[k]
    return paid


@jit_making_arrays
def _free_clusters(balance, bodies):
    """Members of free clusters, cluster by cluster, and where each begins (the last entry: where the last one ends)."""
    n = bodies.position.shape[0]
    held, size = np.zeros(n, np.bool_), np.zeros(n + 1, np.int64)
    for i in range(n):
        if bodies.part[i] == MEMBER and balance.touched[i]:
            root = root_of(balance.parent, i)
            held[root] = held[root] or balance.held[i]
            size[root] += 1
    begin, place, number, total = np.empty(n + 1, np.int64), np.full(n, -1, np.int64), 0, 0
    for root in range(n):
        if size[root] > 0 and not held[root]:
            begin[number], place[root] = total, total
            total += size[root]
            number += 1
    begin[number] = total
    members = np.empty(total, np.int64)
    for i in range(n):
        if bodies.part[i] == MEMBER and balance.touched[i]:
            root = root_of(balance.parent, i)
            if place[root] >= 0:
                members[place[root]] = i
                place[root] += 1
    return members, begin[: number + 1]


@jit
def begin_balance(balance, bodies, weights):
    """Forget the last step, and remember the energy of each member."""
    for i in range(balance.parent.shape[0]):
        balance.taken[i] = balance.raised[i] = 0.0
    begin_part(balance, bodies, weights)


@jit
def begin_part(balance, bodies, weights):
    """Begin a part of a step: forget what was connected, and remember the energy of each member; what was taken and raised adds up."""
    for i in range(balance.parent.shape[0]):
        balance.parent[i], balance.touched[i], balance.held[i] = i, False, False
        balance.given[i] = balance.before[i] = bodies.work[i] = 0.0
    for i in range(weights.mass.shape[0]):
        if bodies.part[i] == MEMBER:
            balance.before[i] = _energy(bodies, weights, i)[1]


@jit
def connect(balance, bodies, pairs, patches, count):
    """Make one cluster of members that the first `count` patches connect."""
    for m in range(count):
        connect_pair(balance, bodies, pairs.first[patches.pair[m]], pairs.second[patches.pair[m]])


@jit
def connect_pair(balance, bodies, a, b):
    """Make one cluster of a and b, if both are members."""
    balance.touched[a] = balance.touched[b] = True
    if bodies.part[a] == MEMBER and bodies.part[b] == MEMBER:
        unite(balance.parent, a, b)
    else:
        balance.held[a] = balance.held[b] = True


@jit_making_arrays
def end_balance(balance, bodies, weights):
    """Take what clusters gained off their speeds."""
    n = weights.mass.shape[0]
    kinetic, gained, own, free = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n, np.bool_)
    for i in range(n):
        if bodies.part[i] == MEMBER and balance.touched[i]:
            root = root_of(balance.parent, i)
            own[i], total = _energy(bodies, weights, i)
            kinetic[root] += own[i]
            gained[root] += total - balance.before[i] - balance.given[i] - bodies.work[i]
    members, begin = _free_clusters(balance, bodies)
    for c in range(begin.shape[0] - 1):
        cluster = members[begin[c] : begin[c + 1]]
        root = cluster[0]
        free[root] = True
        if gained[root] > 0.0:
            balance.raised[root] += max(gained[root] - _pay_together(bodies, weights, cluster, gained[root]), 0.0)
            for i in cluster:
                balance.taken[i] += own[i] - _energy(bodies, weights, i)[0]
    for i in range(n):
        if bodies.part[i] != MEMBER or not balance.touched[i]:
            continue
        root = root_of(balance.parent, i)
        if free[root]:
            continue
        if i == root:
            balance.raised[root] += max(gained[root] - kinetic[root], 0.0)
        if gained[root] > 0.0 and kinetic[root] > 0.0:
            share = min(gained[root] / kinetic[root], 1.0)
            _slow_down(bodies, i, sqrt(1.0 - share))
            balance.taken[i] += share * own[i]


@jit_making_arrays
def pay_for_rise(balance, bodies, weights, pairs, rise, fresh):
    """Take what a position correction gained off the speed of those that it moved; returns (k,) bool who lost much by that.

    rise (n, 3) m: how each was moved; fresh (k,): who may have been moved, by rank. Pairs that have contacts are clusters here.
    """
    begin_balance(balance, bodies, weights)
    for p in range(pairs.first.shape[0]):
        if pairs.count[p] > 0 and in_play(bodies.part, pairs.first[p], pairs.second[p]):
            connect_pair(balance, bodies, pairs.first[p], pairs.second[p])
    members, begin = _free_clusters(balance, bodies)
    free = np.zeros(weights.mass.shape[0], np.bool_)
    for c in range(begin.shape[0] - 1):
        cost, cluster = 0.0, members[begin[c] : begin[c + 1]]
        for i in cluster:
            free[i] = True
            cost += _cost(weights, rise, i)
        if cost > 0.0:
            _pay_together(bodies, weights, cluster, cost)
    slowed = np.zeros(fresh.shape[0], np.bool_)
    for c in range(fresh.shape[0]):
        i = fresh[c]
        cost, own = _cost(weights, rise, i), _energy(bodies, weights, i)[0]
        if cost > 0.0 and own > 0.0 and not free[i]:
            paid = min(cost, own)
            _slow_down(bodies, i, sqrt(1.0 - paid / own))
            slowed[c] = paid > max(REPORTED * own, weights.mass[i] * length(row(weights.pull, i)) * bodies.skin[i])
    return slowed
