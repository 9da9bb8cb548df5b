"""Which bodies are members of sub-stepped islands in a step, and which of them sleep (kernels); `advance.py` calls them in this order.

    gather     what moves, or sleeps in an island that others keep awake, may be a member unless it is too fast
    connect    near pairs and joints connect members to islands
    settle     islands that are stepped get their labels; members that no moving one wakes sleep

In between it is decided which islands stay exact (`regime.py`, `cheapest.py`).
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.union_find import root_of, unite
from rigidimpulse.engine.regime import RATIO
from rigidimpulse.engine.sleeping import wake_by_contact
from rigidimpulse.engine.substepped.trajectories import is_slow
from rigidimpulse.motion.evaluate import bring
from rigidimpulse.motion.trajectory import FIXED, LINEAR


class Candidates(NamedTuple):
    """What is known of n bodies where members are chosen; the last four vary."""

    dynamic: np.ndarray  # (n,) bool
    moving: np.ndarray  # (n,) bool, with a path of its own
    jointed: np.ndarray  # (n,) bool
    mass: np.ndarray  # (n,) kg
    inner: np.ndarray  # (n,) m, distance from the centre of mass to the nearest face
    steady: np.ndarray  # (n, 3) m/s2, what pulls them
    strength: np.ndarray  # (n,) m/s2, its size
    label: np.ndarray  # (n,) the island that a body belongs to, -1 for none
    sleep_timer: np.ndarray  # (n,) s
    asleep: np.ndarray  # (n,) bool
    let_go: np.ndarray  # (n,) bool, since the last step: bodies that something held


@jit
def gather_members(motion, candidates, time, limits, member):
    """Mark (n,) the bodies that may be members, and bring those to `time` whose trajectories have not ended there.

    limits: see `is_slow`. What joints join stays together, however fast. Returns the number of members, how many are left out that were in
    an island, and how many dynamic bodies are at rest outside of islands.
    """
    trajectory, now, acceleration = motion.trajectory, motion.now, motion.acceleration
    dynamic, asleep, number, left, resting = candidates.dynamic, candidates.asleep, 0, 0, 0
    for i in range(dynamic.shape[0]):
        member[i] = dynamic[i] and (trajectory.mode[i] != FIXED or asleep[i])
        number += member[i]
        resting += dynamic[i] and not member[i]
    if number == 0:
        return number, left, resting
    for i in range(dynamic.shape[0]):
        if not (trajectory.mode[i] == LINEAR or asleep[i]):
            bring(trajectory, i, time, now, motion.rotation, acceleration, motion.angular_acceleration)
        if dynamic[i]:
            for k in range(3):
                acceleration[i, k] = candidates.steady[i, k]
        if member[i] and not (candidates.jointed[i] or is_slow(now, i, candidates.inner[i], limits)):
            member[i] = False
            left += candidates.label[i] >= 0
    return number, left, resting


@jit
def connect_members(near, links, candidates, member, root, islands):
    """Write the root (n,) of the island of each member, -1 of others, and mark (n,), by root, islands that something is near.

    Mark those, too, that have neighbours of masses beyond RATIO : 1. near: (3, k) pairs of bodies that may meet, see `FatBoxes.near`;
    links: (m, 2) bodies that joints join; islands: `cheapest.Near`.
    """
    touches, unlike = islands
    number = root.shape[0]
    for i in range(number):
        root[i], touches[i], unlike[i] = i, False, False
    for k in range(near.shape[1]):
        if member[near[0, k]] and member[near[1, k]]:
            unite(root, near[0, k], near[1, k])
    for k in range(links.shape[0]):
        if member[links[k, 0]] and member[links[k, 1]]:
            unite(root, links[k, 0], links[k, 1])
    for i in range(number):
        # A root is the lowest of its set: it is final by now.
        root[i] = root_of(root, i) if member[i] else -1
    for k in range(near.shape[1]):
        a, b = root[near[0, k]], root[near[1, k]]
        touches[a if a >= 0 else b] = True
        if a >= 0 and b >= 0:
            first, second = candidates.mass[near[0, k]], candidates.mass[near[1, k]]
            unlike[a] = unlike[a] or max(first, second) > RATIO * min(first, second)


@jit_making_arrays
def _mark_restless(near, candidates, chosen, root, driven, rest, restless):
    """Mark (n,) chosen members that moved not long ago, and all of islands that something drives or carries; returns whether all are."""
    number = root.shape[0]
    strength, carried = np.zeros(number), driven.copy()
    for i in range(number):
        if chosen[i]:
            strength[root[i]] = max(strength[root[i]], candidates.strength[i])
    for k in range(near.shape[1]):
        a, b = near[0, k], near[1, k]
        if near[2, k] and (candidates.moving[a] or candidates.moving[b]):
            r = root[b if candidates.moving[a] else a]
            if r >= 0:
                carried[r] = True
    all_are = True
    for i in range(number):
        restless[i] = chosen[i]
        if chosen[i] and strength[root[i]] > 0.0 and not carried[root[i]]:
            restless[i] = candidates.sleep_timer[i] < rest * sqrt(candidates.inner[i] / strength[root[i]])
            all_are = all_are and restless[i]
    return all_are


@jit_making_arrays
def _spread_over_joints(links, chosen, marked):
    """Mark the chosen bodies that joints join to what is marked."""
    if links.shape[0] == 0:
        return
    number = chosen.shape[0]
    parent, with_marked = np.arange(number), np.zeros(number, np.bool_)
    for k in range(links.shape[0]):
        if chosen[links[k, 0]] and chosen[links[k, 1]]:
            unite(parent, links[k, 0], links[k, 1])
    for i in range(number):
        if chosen[i] and marked[i]:
            with_marked[root_of(parent, i)] = True
    for i in range(number):
        marked[i] = marked[i] or (chosen[i] and with_marked[root_of(parent, i)])


@jit_making_arrays
def settle_islands(now, candidates, near, links, chosen, root, driven, rest):
    """Label the islands of chosen members (n,) bool; unmark those of islands whose members all sleep, and say who sleeps in the others.

    Args:
        now: the state of the bodies. candidates: `Candidates`.
        near: (3, k) pairs of bodies; those touch each other whose third number is not 0. links: (m, 2) bodies that joints join.
        chosen: (n,) bool. root: (n,) of the island of each, see `connect_members`.
        driven: (n,) bool, by root, islands that never sleep.
        rest: for how long members must have hardly moved to be sleepy, in sqrt(r / g).

    Returns:
        (n,) bool, members that fall or stay asleep; none: an array of no length.

    """
    number = root.shape[0]
    for i in range(number):
        if chosen[i]:
            candidates.label[i] = root[i]
    restless = np.empty(number, np.bool_)
    all_are = _mark_restless(near, candidates, chosen, root, driven, rest, restless)
    _spread_over_joints(links, chosen, restless)
    if not all_are:
        all_are = True
        for i in range(number):
            all_are = all_are and restless[i] == chosen[i]
    if all_are:
        candidates.asleep[:] = False
        candidates.let_go[:] = False
        return np.zeros(0, np.bool_)
    count, first, second = 0, np.empty(near.shape[1] + links.shape[0], np.int64), np.empty(near.shape[1] + links.shape[0], np.int64)
    for k in range(near.shape[1]):
        if near[2, k]:
            first[count], second[count] = near[0, k], near[1, k]
            count += 1
    for k in range(links.shape[0]):
        first[count], second[count] = links[k, 0], links[k, 1]
        count += 1
    awake = wake_by_contact(first[:count], second[:count], chosen, restless, now, candidates)
    candidates.let_go[:] = False
    _spread_over_joints(links, chosen, awake)
    sleeps, alive = np.empty(number, np.bool_), np.zeros(number, np.bool_)
    for i in range(number):
        sleeps[i] = chosen[i] and not awake[i]
        if restless[i]:
            alive[root[i]] = True
    for i in range(number):
        # Islands whose members all sleep are not stepped.
        chosen[i] = chosen[i] and alive[root[i]]
        candidates.asleep[i] = sleeps[i] and chosen[i]
    return sleeps
