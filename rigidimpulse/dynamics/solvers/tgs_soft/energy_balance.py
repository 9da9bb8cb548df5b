"""The energy of sub-stepped islands is balanced where it is made (kernels).

Sub-steps push bodies out of the skin, and round; both make a little energy. Members that no contact connects cannot give each other any.
So the members fall into clusters: those that contacts between them connect in the step. With the energy E of a cluster after a step, E_0
before it, the work G of moving supports and the kinetic energy T, its speeds are multiplied by f:

    gained = E - E_0 - G > 0:    f^2 = 1 - gained / T

A member without any contact flies, and is left as it is. Clusters at rest cannot pay: what they gain by rising out of each other is a
position correction. So is what moves bodies by dx when they join an island, which costs -m g.dx each. A body pays for its own rise, from
its own speed, as far as that goes. No other body pays: it would lose motion that it has nothing to do with.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_records import MEMBER
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.union_find import root_of, unite
from rigidimpulse.core.vector import turned_back_by

REPORTED = 0.5
"""Part of its kinetic energy from which what a body pays for its rise is reported, if it rises by a skin or more."""


class Weights(NamedTuple):
    """Of n bodies by rank."""

    mass: np.ndarray  # (n,) kg
    pull: np.ndarray  # (n, 3) m/s2, steady acceleration


class Balance(NamedTuple):
    """What is known of n bodies by rank, and one entry that is no body, while a step goes on."""

    parent: np.ndarray  # (n+1,) clusters, see `core.union_find`
    touched: np.ndarray  # (n+1,) bool, there was a contact
    before: np.ndarray  # (n+1,) J, energy of the body at the start
    given: np.ndarray  # (n+1,) J, work of moving supports on the body
    taken: np.ndarray  # (n+1,) J, taken off its speed at the end
    raised: np.ndarray  # (n+1,) J, what a cluster gained and cannot pay, of its root


def make_balance(n: int) -> Balance:
    """Arrays for n bodies."""
    none = np.zeros((4, n + 1))
    return Balance(np.arange(n + 1), np.zeros(n + 1, bool), none[0], none[1], none[2], none[3])


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
def _slow_down(bodies, i, factor):
    for k in range(8 * i, 8 * i + 6):
        bodies.velocity[k] *= factor


@jit
def begin_balance(balance, bodies, weights):
    """Forget the last step, and remember the energy of each member."""
    for i in range(balance.parent.shape[0]):
        balance.parent[i], balance.touched[i] = i, False
        balance.given[i] = balance.taken[i] = balance.before[i] = balance.raised[i] = 0.0
    for i in range(weights.mass.shape[0]):
        if bodies.part[i] == MEMBER:
            balance.before[i] = _energy(bodies, weights, i)[1]


@jit
def connect(balance, bodies, pairs, patches, count):
    """Make one cluster of members that the first `count` patches connect."""
    for m in range(count):
        a, b = pairs.first[patches.pair[m]], pairs.second[patches.pair[m]]
        balance.touched[a] = balance.touched[b] = True
        if bodies.part[a] == MEMBER and bodies.part[b] == MEMBER:
            unite(balance.parent, a, b)


@jit_making_arrays
def end_balance(balance, bodies, weights):
    """Take what clusters gained off their speeds."""
    n = weights.mass.shape[0]
    kinetic, gained, own = np.zeros(n), np.zeros(n), np.zeros(n)
    for i in range(n):
        if bodies.part[i] == MEMBER and balance.touched[i]:
            root = root_of(balance.parent, i)
            own[i], total = _energy(bodies, weights, i)
            kinetic[root] += own[i]
            gained[root] += total - balance.before[i] - balance.given[i]
    for i in range(n):
        if bodies.part[i] != MEMBER or not balance.touched[i]:
            continue
        root = root_of(balance.parent, i)
        balance.raised[root] = max(gained[root] - kinetic[root], 0.0)
        if gained[root] > 0.0 and kinetic[root] > 0.0:
            share = min(gained[root] / kinetic[root], 1.0)
            _slow_down(bodies, i, sqrt(1.0 - share))
            balance.taken[i] = share * own[i]


@jit_making_arrays
def pay_for_rise(bodies, weights, rise, fresh):
    """Take what a position correction gained off the speed of each body that it moved; returns (k,) bool who lost much by that.

    rise (n, 3) m: how each was moved; fresh (k,): who may have been moved, by rank.
    """
    slowed = np.zeros(fresh.shape[0], np.bool_)
    for c in range(fresh.shape[0]):
        i, cost = fresh[c], 0.0
        pull = weights.pull[i]
        for k in range(3):
            cost -= weights.mass[i] * pull[k] * rise[i, k]
        own = _energy(bodies, weights, i)[0]
        if cost > 0.0 and own > 0.0:
            paid = min(cost, own)
            _slow_down(bodies, i, sqrt(1.0 - paid / own))
            strength = sqrt(pull[0] * pull[0] + pull[1] * pull[1] + pull[2] * pull[2])
            slowed[c] = paid > max(REPORTED * own, weights.mass[i] * strength * bodies.skin[i])
    return slowed
