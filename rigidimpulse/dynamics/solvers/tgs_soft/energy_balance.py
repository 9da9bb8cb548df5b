"""The energy of sub-stepped islands is balanced where it is made (kernels).

Sub-steps push bodies out of the skin, and round; both make a little energy. Members that no contact connects cannot give each other any.
So the members fall into clusters: those that contacts between them connect in the step. With the energy E of a cluster after a step, E_0
before it, the work G of moving supports and the kinetic energy T, its speeds are multiplied by f:

    gained = E - E_0 - G > 0:    f^2 = 1 - gained / T

A member without any contact flies, and is left as it is. A position correction that moves bodies by dx costs -m g.dx each. A body pays
for its own rise first, from its own speed. What it cannot pay is paid by those that were moved apart from it, and from each other: by
one factor in each such set; what is owed still, by their clusters at the end of the step. Clusters at rest cannot pay: what they gain by
rising out of each other is a position correction, too.
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
"""Part of its kinetic energy from which what is taken off a body is reported, if it would also raise the body by SEEN skins."""
SEEN = 10.0
"""Skins that a body moves within are not seen: 8 % of its inner radius."""


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
    owed: np.ndarray  # (n+1,) J, of position corrections: what is to be paid at the end of the step
    raised: np.ndarray  # (n+1,) J, what a cluster gained beyond that and cannot pay, of its root
    slowed: np.ndarray  # (n+1,) bool, lost a part of its motion that is worth a report


def make_balance(n: int) -> Balance:
    """Arrays for n bodies."""
    none, no = np.zeros((5, n + 1)), np.zeros((2, n + 1), bool)
    return Balance(np.arange(n + 1), no[0], none[0], none[1], none[2], none[3], none[4], no[1])


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
def _weight_times_skin(bodies, weights, i):
    pull = weights.pull[i]
    return weights.mass[i] * bodies.skin[i] * sqrt(pull[0] * pull[0] + pull[1] * pull[1] + pull[2] * pull[2])


@jit
def _slow_down(bodies, i, factor):
    for k in range(8 * i, 8 * i + 6):
        bodies.velocity[k] *= factor


@jit
def clear_balance(balance):
    """Forget the last step."""
    for i in range(balance.parent.shape[0]):
        balance.parent[i], balance.touched[i], balance.slowed[i] = i, False, False
        balance.given[i] = balance.taken[i] = balance.before[i] = balance.raised[i] = 0.0


@jit
def begin_balance(balance, bodies, weights):
    """Forget the last step, and remember the energy of each member."""
    clear_balance(balance)
    for i in range(weights.mass.shape[0]):
        if bodies.part[i] == MEMBER:
            balance.before[i] = _energy(bodies, weights, i)[1] - balance.owed[i]


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
    """Take what clusters gained off their speeds.

    What sub-steps made, and lose again, is no motion lost. What is paid for a position correction is.
    """
    n = weights.mass.shape[0]
    kinetic, gained, debt, own, weight = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    for i in range(n):
        if bodies.part[i] == MEMBER and balance.touched[i]:
            root = root_of(balance.parent, i)
            own[i], total = _energy(bodies, weights, i)
            kinetic[root] += own[i]
            gained[root] += total - balance.before[i] - balance.given[i]
            debt[root] += balance.owed[i]
            weight[i] = _weight_times_skin(bodies, weights, i)
    for i in range(n):
        balance.owed[i] = 0.0
        if bodies.part[i] != MEMBER or not balance.touched[i]:
            continue
        root = root_of(balance.parent, i)
        balance.raised[root] = max(gained[root] - debt[root] - kinetic[root], 0.0)
        if gained[root] > 0.0 and kinetic[root] > 0.0:
            share = min(gained[root] / kinetic[root], 1.0)
            _slow_down(bodies, i, sqrt(1.0 - share))
            balance.taken[i] = share * own[i]
            paid = min(debt[root] / kinetic[root], share)
            balance.slowed[i] = paid > REPORTED and paid * own[i] > SEEN * weight[i]


@jit_making_arrays
def pay_for_rise(balance, bodies, weights, rise, fresh):
    """Take what a position correction gained off the speeds of the bodies that it moved; marks in balance.slowed who lost much.

    balance.parent: sets that were moved apart; rise (n, 3) m: how each was moved; fresh (k,): who may have been moved, by rank.
    """
    n = weights.mass.shape[0]
    owed, left, own, weight = balance.owed, np.zeros(n), np.zeros(n), np.zeros(n)
    for i in fresh:
        cost, pull = 0.0, weights.pull[i]
        for k in range(3):
            cost -= weights.mass[i] * pull[k] * rise[i, k]
        root, own[i] = root_of(balance.parent, i), _energy(bodies, weights, i)[0]
        weight[i] = _weight_times_skin(bodies, weights, i)
        paid = min(max(cost, 0.0), own[i])
        balance.taken[i] = paid
        owed[root] += cost - paid
        left[root] += own[i] - paid
    for i in fresh:
        root = root_of(balance.parent, i)
        if owed[root] > 0.0 and left[root] > 0.0:
            balance.taken[i] += min(owed[root] / left[root], 1.0) * (own[i] - balance.taken[i])
        if balance.taken[i] > 0.0:
            _slow_down(bodies, i, sqrt(max(1.0 - balance.taken[i] / own[i], 0.0)))
        balance.slowed[i] = balance.taken[i] > max(REPORTED * own[i], SEEN * weight[i])
    for i in fresh:
        owed[i] = max(owed[i] - left[i], 0.0)
