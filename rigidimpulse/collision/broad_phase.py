"""Pairs of axis-aligned boxes that overlap: strips across one axis, sort and sweep along another.

Bodies are sorted by the low end of their boxes along the axis of greatest spread. The axis of next greatest spread is
cut into strips a few mean boxes wide, at most about sqrt(n) of them; a body is listed in all strips it reaches, and a
pair is reported in the first strip that both reach. In each strip the sorted list is swept. Cost for n bodies of like
size: n log n and a factor that grows as the number of boxes stacked along the third axis. Boxes may be infinite (half
spaces).

The pairs depend on the boxes only and come in ascending order. `fat_boxes` keeps pairs from step to step.
"""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.simplices import inner
from rigidimpulse.core.kernels import jit, jit_making_arrays

FEW = 64
"""Number of bodies up to which all pairs are tested directly."""
STRIP_WIDTH = 2.0
"""Width of a strip in mean box lengths."""


@inner
def _overlap(box_min, box_max, i, j):
    """Tell whether two boxes overlap or touch (without branches: their outcome would be guessed wrong too often)."""
    apart = False
    for axis in range(3):
        apart |= (box_min[i, axis] > box_max[j, axis]) | (box_min[j, axis] > box_max[i, axis])
    return not apart


@inner
def _spread(box_min, box_max, axis):
    """Return the sum of squared deviations of the finite boxes' centres along an axis (Welford's recurrence)."""
    count = 0
    mean = 0.0
    spread = 0.0
    for i in range(box_min.shape[0]):
        middle = 0.5 * (box_min[i, axis] + box_max[i, axis])
        if isfinite(middle):
            count += 1
            step = middle - mean
            mean += step / count
            spread += step * (middle - mean)
    return spread


@jit_making_arrays
def _sorted_order(box_min, axis):
    """Return the bodies in ascending order of the low ends of their boxes, equal ones by index (merge sort)."""
    n = box_min.shape[0]
    order, merged = np.empty(n, np.int64), np.empty(n, np.int64)
    key, merged_key = np.empty(n), np.empty(n)
    for i in range(n):
        order[i] = i
        key[i] = box_min[i, axis]
    width = 1
    while width < n:
        for start in range(0, n, 2 * width):
            left = start
            right = min(start + width, n)
            middle = right
            end = min(start + 2 * width, n)
            for place in range(start, end):
                # <= keeps bodies with equal keys in order of their index.
                if left < middle and (right >= end or key[left] <= key[right]):
                    merged[place], merged_key[place] = order[left], key[left]
                    left += 1
                else:
                    merged[place], merged_key[place] = order[right], key[right]
                    right += 1
        order, merged = merged, order
        key, merged_key = merged_key, key
        width *= 2
    return order


@inner
def _strip_at(place, num_strips):
    """Return the strip at a place, the first or the last one beyond the ends (and the first one for a NaN)."""
    if not place > 0.0:
        return 0
    return int(place) if place < num_strips else num_strips - 1


@jit_making_arrays
def _strips(box_min, box_max, axis):
    """Return the number of strips across an axis and, for each body, the first and the last one it reaches."""
    n = box_min.shape[0]
    low = inf
    high = -inf
    total = 0.0
    count = 0
    for i in range(n):
        if isfinite(box_min[i, axis]) and isfinite(box_max[i, axis]):
            low = min(low, box_min[i, axis])
            high = max(high, box_max[i, axis])
            total += box_max[i, axis] - box_min[i, axis]
            count += 1
    apart = high > low
    width = max(STRIP_WIDTH * total / max(count, 1), (high - low) / sqrt(n)) if apart else 1.0
    num_strips = int((high - low) / width) + 1 if apart else 1
    reach = np.empty((n, 2), np.int64)
    for i in range(n):
        reach[i, 0] = _strip_at((box_min[i, axis] - low) / width, num_strips)
        reach[i, 1] = _strip_at((box_max[i, axis] - low) / width, num_strips)
    return num_strips, reach


@jit_making_arrays
def _strip_lists(order, num_strips, reach):
    """Return offsets and bodies of each strip, the bodies in the given order."""
    first = np.zeros(num_strips + 2, np.int64)
    for i in range(len(order)):
        for strip in range(reach[i, 0], reach[i, 1] + 1):
            first[strip + 2] += 1
    for strip in range(num_strips):
        first[strip + 2] += first[strip + 1]
    members = np.empty(first[num_strips + 1], np.int64)
    for k in range(len(order)):
        i = order[k]
        for strip in range(reach[i, 0], reach[i, 1] + 1):
            members[first[strip + 1]] = i
            first[strip + 1] += 1  # the end of the strip, when all are in
    return first, members


@jit_making_arrays
def _sort_pairs(pairs, count, num_bodies):
    """Put the first `count` pairs into ascending order, by a counting sort on the second, then on the first column."""
    other = np.empty((count, 2), pairs.dtype)
    for column in range(1, -1, -1):
        place = np.zeros(num_bodies + 1, np.int64)
        for k in range(count):
            other[k, 0], other[k, 1] = pairs[k, 0], pairs[k, 1]
            place[pairs[k, column] + 1] += 1
        for body in range(num_bodies):
            place[body + 1] += place[body]
        for k in range(count):
            at = place[other[k, column]]
            place[other[k, column]] += 1
            pairs[at, 0], pairs[at, 1] = other[k, 0], other[k, 1]


@inner
def _keep(pairs_out, count, i, j):
    """Write the pair (i, j), lower index first, if the buffer is large enough; return `count + 1`."""
    if count < pairs_out.shape[0]:
        pairs_out[count, 0] = min(i, j)
        pairs_out[count, 1] = max(i, j)
    return count + 1


@jit_making_arrays
def _column(bounds, axis, members):
    """Return the bounds of the listed bodies along an axis."""
    column = np.empty(len(members))
    for at in range(len(members)):
        column[at] = bounds[members[at], axis]
    return column


class _Strips(NamedTuple):
    """Bodies in strips across an axis, in each of them sorted along another."""

    axis: int  # along which they are sorted
    across: int  # the axis that is cut into strips
    reach: np.ndarray  # (n, 2) first and last strip of each body
    first: np.ndarray  # (s + 2,) where the bodies of each strip begin
    members: np.ndarray  # (m,) bodies, strip by strip


@jit_making_arrays
def _sweep(box_min, box_max, movable, strips, pairs_out):
    """Write all overlapping pairs, in no particular order; return how many there are.

    Candidates of a body are first listed without a branch, as the outcome of a test can hardly be predicted.
    """
    axis, across, reach, first, members = strips
    low, high = _column(box_min, axis, members), _column(box_max, axis, members)
    low_u, high_u = _column(box_min, across, members), _column(box_max, across, members)
    low_v, high_v = _column(box_min, 3 - axis - across, members), _column(box_max, 3 - axis - across, members)
    candidate = np.empty(len(members), np.int64)
    count = np.int64(0)
    for strip in range(len(first) - 2):
        for at in range(first[strip], first[strip + 1]):
            num_candidates = 0
            for other in range(at + 1, first[strip + 1]):
                # Low ends ascend: no later body of the strip can overlap.
                if low[other] > high[at]:
                    break
                candidate[num_candidates] = members[other]
                beside = (low_u[other] <= high_u[at]) & (low_u[at] <= high_u[other])
                # No branch: the candidate counts or is overwritten by the next.
                num_candidates += beside & (low_v[other] <= high_v[at]) & (low_v[at] <= high_v[other])
            i = members[at]
            for k in range(num_candidates):
                j = candidate[k]
                # Each pair is reported once, in the first strip that both reach.
                if (movable[i] or movable[j]) and strip == max(reach[i, 0], reach[j, 0]):
                    count = _keep(pairs_out, count, i, j)
    return count


@jit_making_arrays
def overlapping_pairs(box_min, box_max, movable, pairs_out):
    """Write all pairs of boxes that overlap or touch, lower index first, in ascending order.

    Args:
        box_min, box_max: (n, 3) m, box of each body, widened as the caller needs; may be -inf, inf.
        movable: (n,) bool; a pair of which neither can move is left out.
        pairs_out: (cap, 2) int32, written.

    Returns:
        The number of pairs; minus the number needed if there are more than `cap`, and then `pairs_out` means nothing.

    """
    n = len(movable)
    count = np.int64(0)
    if n <= FEW:
        for i in range(n):
            for j in range(i + 1, n):
                if (movable[i] or movable[j]) and _overlap(box_min, box_max, i, j):
                    count = _keep(pairs_out, count, i, j)
        return count if count <= pairs_out.shape[0] else -count
    x = _spread(box_min, box_max, np.int64(0))  # (literals would be compiled once each)
    y = _spread(box_min, box_max, np.int64(1))
    z = _spread(box_min, box_max, np.int64(2))
    axis = 0 if x >= y and x >= z else (1 if y >= z else 2)
    across = (1 if y >= z else 2) if axis == 0 else (0 if x >= (z if axis == 1 else y) else 3 - axis)
    num_strips, reach = _strips(box_min, box_max, across)
    first, members = _strip_lists(_sorted_order(box_min, axis), num_strips, reach)
    count = _sweep(box_min, box_max, movable, _Strips(axis, across, reach, first, members), pairs_out)
    if count > pairs_out.shape[0]:
        return -count
    _sort_pairs(pairs_out, count, n)
    return count


def find_overlapping(box_min: np.ndarray, box_max: np.ndarray, movable: np.ndarray, capacity: int) -> np.ndarray:
    """Pairs (k, 2) int32 of boxes that overlap, see `overlapping_pairs`; capacity: number of pairs that is expected."""
    pairs = np.empty((capacity, 2), np.int32)
    count = overlapping_pairs(box_min, box_max, movable, pairs)
    if count < 0:
        pairs = np.empty((-count, 2), np.int32)
        count = overlapping_pairs(box_min, box_max, movable, pairs)
    return pairs[:count]


@jit
def overlapping_with(i, box_min, box_max, movable, bodies_out):
    """Write the bodies whose boxes overlap or touch that of body `i`, in ascending order.

    Arguments as for `overlapping_pairs`; bodies_out: (cap,) int64. Returns their number, or minus the number needed.
    """
    count = 0
    for j in range(len(movable)):
        if j != i and (movable[i] or movable[j]) and _overlap(box_min, box_max, i, j):
            if count < len(bodies_out):
                bodies_out[count] = j
            count += 1
    return count if count <= len(bodies_out) else -count
