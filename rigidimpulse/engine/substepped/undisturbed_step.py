"""A step in which nothing moves but members of sub-stepped islands: how it begins, and what comes of each piece of it (kernels)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_records import MEMBER, SUPPORT
from rigidimpulse.collision.fat_boxes import near_pairs
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.sorted_values import place_in
from rigidimpulse.engine.cheapest import Costs, Near, judge_islands
from rigidimpulse.engine.exact.step_begin import SolveCounts, begin_counts
from rigidimpulse.engine.regime import KEPT
from rigidimpulse.engine.sleeping import advance_sleep_timers
from rigidimpulse.engine.substepped.island_step import energies_of_islands
from rigidimpulse.engine.substepped.membership import connect_members, gather_members, settle_islands
from rigidimpulse.engine.substepped.trajectories import depart
from rigidimpulse.model.world import BodyConstants
from rigidimpulse.motion.trajectory import FIXED, LINEAR
from rigidimpulse.recording.recorder import sample_paths

DISTURBED, NO_PAIRS, BEGUN = map(np.int64, range(3))
"""How a step begins: something asks for the loop; the pairs of bodies that may meet must be found again first; it does."""
KEEPS_LARGE, KEEPS_CHEAP, KEEPS_TOUCHING = range(3)
"""Which islands stay sub-stepped, by `Accuracy.contact_solver`: "auto", "cheapest", "substepped"."""


class Choice(NamedTuple):
    """How members are chosen, of n bodies; what is scratch has no meaning between two steps."""

    rule: int  # of those above
    limits: tuple[float, float]  # see `is_slow`
    rest: float  # see `settle_islands`
    counts: SolveCounts
    costs: Costs
    taken: np.ndarray  # (n,) bool, members that sub-steps have taken over from the exact regime
    member: np.ndarray  # (n,) bool, who is stepped
    root: np.ndarray  # (n,) scratch
    islands: Near  # scratch
    no_links: np.ndarray  # (0, 2), nothing is joined
    no_drives: np.ndarray  # (n,) bool, and nothing driven


class Landing(NamedTuple):
    """What is brought up to date where members of n bodies have been stepped, and what that depends on."""

    constants: BodyConstants
    label: np.ndarray  # (n,)
    energies: np.ndarray  # (4, n) J, see `energies_of_islands`
    stood: np.ndarray  # (n, 7), see `advance_sleep_timers`
    sleep_timer: np.ndarray  # (n,) s
    inner: np.ndarray  # (n,) m
    skin: np.ndarray  # (n,) m


@jit
def is_undisturbed(trajectory, constants):
    """Whether all that moves are members, and some do."""
    moves = False
    for i in range(constants.dynamic.shape[0]):
        mode = trajectory.mode[i]
        if mode != FIXED and (constants.moving[i] or (constants.dynamic[i] and mode != LINEAR)):
            return False
        moves = moves or mode == LINEAR
    return moves


@jit_making_arrays
def _stay_cheap(choice, candidates):
    """Whether the rule of costs lets all islands be sub-stepped; the costs are as before where it does not."""
    costs, number = choice.costs, choice.root.shape[0]
    before, solves, reason = np.empty((4, number)), np.empty(number), np.empty(number, np.int64)
    for i in range(number):
        before[0, i], before[1, i], before[2, i], before[3, i] = costs.limit[i], costs.exact[i], costs.pieces[i], costs.looks[i]
        solves[i] = max(choice.counts.solves[i], 0.0)
    if judge_islands(costs, choice.root, candidates.label, candidates.jointed, choice.islands, solves, reason) == 0:
        return True
    for i in range(number):
        costs.limit[i], costs.exact[i], costs.pieces[i], costs.looks[i] = before[0, i], before[1, i], before[2, i], before[3, i]
    return False


@jit_making_arrays
def _all_stay(choice, candidates):
    """Whether all islands of members stay sub-stepped, and no member is new."""
    number, size = choice.root.shape[0], np.zeros(choice.root.shape[0], np.int64)
    for i in range(number):
        if choice.member[i]:
            size[choice.root[i]] += 1
            if candidates.label[i] < 0 or not choice.taken[i]:
                return False
    if choice.rule == KEEPS_CHEAP:
        return _stay_cheap(choice, candidates)
    for i in range(number):
        if size[i] > 0 and (size[i] < KEPT if choice.rule == KEEPS_LARGE else not choice.islands.touches[i]):
            return False
    return True


@jit_making_arrays
def begin_undisturbed_step(choice, candidates, around, motion, pairs, scratch, span):
    """Choose who is stepped over a span (begin, end) [s], as at the begin of any step; those that move have arrived.

    around: `Surroundings`; pairs: that may meet; scratch (3, k): space for as many. Returns how it begins (if not BEGUN, nothing is done),
    and the members (n,) bool that fall or stay asleep: an array of no length if none does.
    """
    member, part, (begin, end) = choice.member, around.part, span
    nobody = np.zeros(0, np.bool_)
    chosen, left, resting = gather_members(motion, candidates, begin, choice.limits, member)
    if chosen == 0 or left > 0:
        return DISTURBED, nobody
    for i in range(part.shape[0]):
        part[i] = MEMBER if member[i] else SUPPORT
    count = near_pairs(around.bounds, around.fat, pairs, motion.now, motion.acceleration, part, end - begin, scratch)
    if count < 0:
        return NO_PAIRS, nobody
    near = np.empty((3, count), np.int64)
    for k in range(count):
        a, b = scratch[0, k], scratch[1, k]
        # Who rests beside members may be woken by them.
        if resting > 0 and ((candidates.dynamic[a] and not member[a]) or (candidates.dynamic[b] and not member[b])):
            return DISTURBED, nobody
        near[0, k], near[1, k], near[2, k] = a, b, scratch[2, k]
    connect_members(near, choice.no_links, candidates, member, choice.root, choice.islands)
    if not _all_stay(choice, candidates):
        return DISTURBED, nobody
    sleeps = settle_islands(
        motion.now, candidates, near, choice.no_links, member, choice.root, choice.no_drives, choice.rest
    )
    if end > choice.counts.step_end[0]:
        begin_counts(choice.counts, end)
    for i in range(part.shape[0]):
        choice.taken[i] = choice.taken[i] and member[i]
        candidates.asleep[i] = candidates.asleep[i] and member[i]
    return BEGUN, sleeps


@jit
def land_members(landing, motion, correction, recorded, members, reached, span):
    """Take what came of a piece of a step over a span (time, length) [s], and let members (k,) go there.

    correction: (n, 6) of trajectories, which these have none of. recorded: frames, and how many of each body are written: members that
    slept have some to write. reached: positions, orientations, velocities and energies of the members, see `Outcome`.
    """
    position, orientation, velocity, energies = reached
    trajectory, now, (time, length) = motion.trajectory, motion.now, span
    frames, written = recorded
    sample_paths(trajectory, members, place_in(frames.times, time), written, frames)
    for k in range(members.shape[0]):
        for c in range(6):
            correction[members[k], c] = 0.0
    energies_of_islands(now, landing.constants, members, landing.label, energies, landing.energies)
    depart(trajectory, members, time, length, now, position, orientation, velocity)
    of_sleep = landing.constants.steady_strength, landing.inner, landing.skin
    advance_sleep_timers(members, (position, orientation, velocity), of_sleep, length, landing.stood, landing.sleep_timer)

