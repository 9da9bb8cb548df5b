"""Pairs of features that may touch, kept from look to look (temporal coherence).

Two meshes that touch are looked at again and again while they hardly move past each other. To find the features that are near takes most of
the time of a look. They are found once, for all poses at which points of the bodies have moved past each other by at most s, and kept until
they have moved farther (a Verlet list: Verlet, Physical Review 159, 98, 1967, "bookkeeping"). What touches is asked of these only.

With R, t the pose of a body seen from the other, R_0, t_0 when the pairs were found, and a sphere (c, r) around it, every point of the body
or within `reach` of it has moved by at most

    w = |(R - R_0) c + t - t_0| + f (r + reach),   f = |R - R_0| = 2 sin(turn / 2),

so that  turn <= 1.05 f <= 1.05 s / (r + reach)  while w <= s. The smaller body is the one that is looked at: a floor has a large r.

s is as far as bodies went in a few looks, if that is not too far: with a longer way there are more pairs to ask, and if they are kept for
a look or two only, finding more of them is not worth it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.simplices import inner
from rigidimpulse.core.kernels import jit_making_arrays

LEAST: float = 1e-6
"""Least s, in radii of the smaller body: more than round-off."""
FEW_ROWS = 4096
"""Pairs of features for which there is space where no list is kept."""
MANY_PAIRS, PLACES, MANY_ROWS = 2**15, 2**13, 2**21
"""Where lists are kept: pairs of leaves that are looked at together, of which contacts are in the same order whatever s is, and space."""
LOOKS = 8.0
"""Looks for which pairs are to be kept."""
MOST = 0.025
"""Greatest s, in radii of the smaller body."""
FEWEST_LOOKS = 1.5
"""Looks for which it is worth to find more pairs."""
TRIES = 4
"""Neighbouring places of the table at which a pair of bodies may be."""
SEARCHES = 8
"""Parts into which the rows are divided: a search may use one, which is at least 168 rows, what two leaves may need."""
A, B, FIRST, SECOND, BEGIN, END, LOOKED, IS_NEAR, LEFT_OUT, INTEGERS = range(10)
"""Columns of `FeatureScratch.integer`: bodies, primitives, rows of the list, looks since it was found, and what `end_list` keeps. Column
LOOKED is 0 at a free place."""
WAY, MARGIN, LEVER, SEEN, REALS = 0, 1, 2, 3, 15
"""Columns of `FeatureScratch.real`: s, margin and r + reach of a list, m; the pose (12) at which it was found."""


class FeatureScratch(NamedTuple):
    """Lists of pairs of features, one after another, and the table that tells which is whose."""

    rows: np.ndarray  # (f, 3) int32, see `near_features`
    integer: np.ndarray  # (h, INTEGERS) int64; h = 0: no list is kept, else a power of 2
    real: np.ndarray  # (h, REALS)
    state: np.ndarray  # (3,) int64: rows in use, and the bodies a and b that are asked about


class ContactScratch(NamedTuple):
    """Scratch memory for finding contacts."""

    pairs: np.ndarray  # (p, 2) int64, p > STACK_ROWS: a stack of nodes, and pairs of leaves
    features: FeatureScratch


@jit_making_arrays
def make_contact_scratch(stack, places, rows):
    """Make a `ContactScratch` with `stack` rows for the walk, and `rows` rows for all lists together.

    places: of the table, a power of 2, or 0 if no list is to be kept.
    """
    features = FeatureScratch(
        np.empty((rows, 3), np.int32), np.zeros((places, INTEGERS), np.int64), np.empty((places, REALS)), np.zeros(3, np.int64)
    )
    return ContactScratch(np.empty((stack, 2), np.int64), features)


@inner
def place_of(lists, first, second):
    """Return (place, known): where the list of two primitives of the bodies that are asked about is, or may be put."""
    integer, a, b = lists.integer, lists.state[1], lists.state[2]
    last = integer.shape[0] - 1
    begin = (a * 7919 + b * 104729 + first * 31 + second * 17) & last
    for k in range(TRIES):
        place = (begin + k) & last
        if integer[place, LOOKED] == 0:
            return place, False
        if integer[place, A] == a and integer[place, B] == b and integer[place, FIRST] == first and integer[place, SECOND] == second:
            return place, True
    return begin, False


@inner
def moved_by(real, place, R, t, centre, lever):
    """Return w for the pose R, t, since the list at a place was found; lever: r + reach."""
    squared, turned = 0.0, 0.0
    for i in range(3):
        along = t[i] - real[place, SEEN + 9 + i]
        for k in range(3):
            change = R[i, k] - real[place, SEEN + 3 * i + k]
            along += change * centre[k]
            turned += change * change
        squared += along * along
    # The sum of squares of a difference of rotations is 2 f^2.
    return np.sqrt(squared) + np.sqrt(0.5 * turned) * lever


@inner
def next_way(way, looks, size):
    """Return s of a new list for bodies that have gone `way` m in `looks` looks; size: m, radius of the smaller one."""
    wanted = LOOKS * way / looks
    if wanted > LOOKS / FEWEST_LOOKS * MOST * size:
        return LEAST * size
    return min(max(wanted, LEAST * size), MOST * size)


@inner
def note_list(lists, place, primitives, bounds, R, t):
    """Write what a new list is for: bodies, primitives, (s, margin, lever) in m and the pose; its rows are written by `end_list`."""
    integer, real, (first, second), (way, margin, lever) = lists.integer, lists.real, primitives, bounds
    integer[place, A], integer[place, B], integer[place, FIRST], integer[place, SECOND] = lists.state[1], lists.state[2], first, second
    real[place, WAY], real[place, MARGIN], real[place, LEVER] = way, margin, lever
    for i in range(3):
        real[place, SEEN + 9 + i] = t[i]
        for k in range(3):
            real[place, SEEN + 3 * i + k] = R[i, k]


@inner
def end_list(lists, place, rows, is_near, left_out):
    """Keep a new list with `rows` rows; -1: there were too few, and it is not kept.

    is_near, left_out: whether features were in reach, and boxes left out by their normals.
    """
    integer = lists.integer
    integer[place, LOOKED] = 1 if rows >= 0 else 0
    if rows < 0:
        return
    integer[place, BEGIN], integer[place, END] = lists.state[0], lists.state[0] + rows
    integer[place, IS_NEAR], integer[place, LEFT_OUT] = is_near, left_out
    lists.state[0] += rows


@inner
def rows_of_search(lists):
    """Return (begin, end) of the rows that one search may use: as many whatever is kept. If they are not free, all lists are given up."""
    rows, places = lists.rows.shape[0], lists.integer.shape[0]
    number = rows // SEARCHES if places > 0 else rows
    if lists.state[0] + number > rows:
        lists.state[0] = 0
        for place in range(places):
            lists.integer[place, LOOKED] = 0
    return lists.state[0], lists.state[0] + number
