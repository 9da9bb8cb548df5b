"""The begin of a step, compiled: what the loop in Python does there, for steps that need nothing but exact contact.

The events of a few bodies take less time than a step of the loop in Python. So `event_loop` takes one step after the other. Python begins
the next one where

    the run is at the time that it was given, or nothing moves,
    the exact regime dealt so often with the bodies in the last step that islands may begin to be sub-stepped,
    there is a problem to tell of, or no space for the pairs.
"""

from math import floor
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.broad_phase import overlapping_pairs
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.engine.pair_table import MARGIN, RUNAWAY, SHORT, append_pairs, clear_pairs, path_box
from rigidimpulse.motion.trajectory import FIXED

GRID = TOLERANCES.events.grid
BEGIN, END = np.arange(2)
"""Places in `Steps.times`."""
OF_MEAN = 0.125
"""Part of the mean number of solves that each step is."""


class SolveCounts(NamedTuple):
    """How often the exact regime dealt with each of n bodies."""

    solves: np.ndarray  # (n,) times in the step; inf: no impulse keeps the body apart from another, `NEVER`: it is not handed over
    mean: np.ndarray  # (n,) times a step, in the mean of the last ones
    spared: np.ndarray  # (n,) bool, bodies that were given more of them in the step
    step_end: np.ndarray  # (1,) s, end of the step that is counted in
    first: float  # of each body where a step begins
    most: float  # of all bodies in a step, beyond which Python is asked whether islands begin to be sub-stepped


def make_counts(number: int, first: float, most: float) -> SolveCounts:
    """Counts of a number of bodies before the first step; first, most: see `SolveCounts`."""
    return SolveCounts(np.full(number, first), np.zeros(number), np.zeros(number, bool), np.zeros(1), first, most)


class Steps(NamedTuple):
    """The step under way, and what the next one begins with."""

    times: np.ndarray  # (2,) s, begin and end
    static_min: np.ndarray  # (n, 3) m, boxes of bodies where they started
    static_max: np.ndarray  # (n, 3) m
    pairs: np.ndarray  # (c, 2) int32, working memory for pairs whose boxes overlap


@jit
def begin_counts(counts, end):
    """Count from nought in the step that ends at `end` [s]; what was counted before goes into the mean."""
    for i in range(counts.solves.shape[0]):
        last = min(max(counts.solves[i], 0.0), RUNAWAY)
        counts.mean[i] += OF_MEAN * (last - counts.mean[i])
        counts.solves[i], counts.spared[i] = counts.first, False
    counts.step_end[0] = end


@jit
def _all_solves(counts):
    """How often all bodies were dealt with in the step."""
    total = 0.0
    for solves in counts.solves:
        total += max(solves, 0.0)
    return total


@jit
def step_end(begin, until, size):
    """End of the step that begins at `begin` [s]: the next point of the grid of steps of `size` [s], or `until` [s]."""
    boundary = (floor(begin / size + GRID) + 1) * size
    return until if until < boundary + GRID * size else boundary


@jit
def _mark_moving(trajectory, bodies):
    """Mark the bodies (n,) bool that move; returns whether one does."""
    moves = False
    for i in range(bodies.shape[0]):
        bodies[i] = trajectory.mode[i] != FIXED
        moves = moves or bodies[i]
    return moves


@jit
def _boxes(loop, begin, end):
    """Boxes of the paths from begin to end [s]; see `PairEvents.find_pairs`."""
    steps, table, radius, reach = loop.steps, loop.table, loop.bodies.constants.bound_radius, MARGIN * loop.margins.largest
    for i in range(radius.shape[0]):
        for k in range(3):
            table.box_min[i, k], table.box_max[i, k] = steps.static_min[i, k], steps.static_max[i, k]
        if table.movable[i]:
            path_box(loop.motion.trajectory, i, begin, end, radius[i], table.box_min, table.box_max)
            for k in range(3):
                table.box_min[i, k] -= reach
                table.box_max[i, k] += reach


@jit_making_arrays
def begin_step(loop, until, bodies):
    """Begin the step after that which has ended; bodies (n,) bool: those that move are marked.

    until: up to when steps may be taken [s]. Returns whether it has begun; if not, Python must look after it.
    """
    times, table, trajectory, size = loop.steps.times, loop.table, loop.motion.trajectory, loop.settings.step
    begin = times[END]
    if until - begin <= GRID * size or _all_solves(loop.counts) > loop.counts.most or not _mark_moving(trajectory, bodies):
        return False
    end = step_end(begin, until, size)
    clear_pairs(table, trajectory, loop.bodies.constants)
    _boxes(loop, begin, end)
    count = overlapping_pairs(table.box_min, table.box_max, table.movable, loop.steps.pairs)
    if count < 0:
        return False
    first, second = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        first[k], second[k] = loop.steps.pairs[k, 0], loop.steps.pairs[k, 1]
    append_pairs(loop.bodies, loop.margins, table, first, second, begin)
    if table.number[SHORT]:
        return False
    begin_counts(loop.counts, end)
    times[BEGIN], times[END] = begin, end
    return True
