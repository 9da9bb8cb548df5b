"""Walks through one or two box trees (see `geometry`)."""

from __future__ import annotations

from rigidimpulse.collision.distance.simplices import inner
from rigidimpulse.core.vector import moved, row, subtract

STACK_ROWS = 128
"""Rows of the scratch buffer used as the stack of a walk through two trees; the rest holds pairs of leaves."""


@inner
def box_distance_squared(low_a, high_a, low_b, high_b, R, t, limit):
    """Return a lower bound of the squared distance of two boxes, each in its own frame, y_a = R y_b + t.

    Either box is put into an upright box of the other's frame; the larger of the two distances is returned, or the
    first one if it is not below `limit`.
    """
    middle_a = (0.5 * (low_a[0] + high_a[0]), 0.5 * (low_a[1] + high_a[1]), 0.5 * (low_a[2] + high_a[2]))
    reach_a = (high_a[0] - middle_a[0], high_a[1] - middle_a[1], high_a[2] - middle_a[2])
    middle_b = (0.5 * (low_b[0] + high_b[0]), 0.5 * (low_b[1] + high_b[1]), 0.5 * (low_b[2] + high_b[2]))
    reach_b = (high_b[0] - middle_b[0], high_b[1] - middle_b[1], high_b[2] - middle_b[2])
    between = subtract(moved(R, t, middle_b), middle_a)
    in_a = 0.0
    for k in range(3):
        reach = abs(R[k, 0]) * reach_b[0] + abs(R[k, 1]) * reach_b[1] + abs(R[k, 2]) * reach_b[2]
        in_a += max(0.0, abs(between[k]) - reach_a[k] - reach) ** 2
    # The second direction can only raise the bound, and the caller has what it needs.
    if in_a >= limit:
        return in_a
    in_b = 0.0
    for k in range(3):
        along_k = R[0, k] * between[0] + R[1, k] * between[1] + R[2, k] * between[2]
        reach = abs(R[0, k]) * reach_a[0] + abs(R[1, k]) * reach_a[1] + abs(R[2, k]) * reach_a[2]
        in_b += max(0.0, abs(along_k) - reach_b[k] - reach) ** 2
    return max(in_a, in_b)


@inner
def splits_first(low_a, high_a, low_b, high_b):
    """Tell whether the first of two boxes is the longer one, to be split."""
    extent_a = max(high_a[0] - low_a[0], high_a[1] - low_a[1], high_a[2] - low_a[2])
    return extent_a >= max(high_b[0] - low_b[0], high_b[1] - low_b[1], high_b[2] - low_b[2])


@inner
def gather_leaf_pairs(node_min, node_max, node_child, R, t, skeleton, pairs, depth):
    """Walk on from the stack in rows [0, depth) of `pairs`, for boxes within the distance `skeleton`.

    Returns (depth, end): what is left of the stack, and the pairs of leaves in rows [STACK_ROWS, end).
    """
    end = STACK_ROWS
    while depth > 0 and end < pairs.shape[0]:
        depth -= 1
        a = pairs[depth, 0]
        b = pairs[depth, 1]
        low_a, high_a = row(node_min, a), row(node_max, a)
        low_b, high_b = row(node_min, b), row(node_max, b)
        if box_distance_squared(low_a, high_a, low_b, high_b, R, t, skeleton * skeleton) > skeleton * skeleton:
            continue
        child_a = node_child[a]
        child_b = node_child[b]
        if child_a < 0 and child_b < 0:
            pairs[end, 0] = a
            pairs[end, 1] = b
            end += 1
            continue
        # The longer box is split, so that both boxes shrink alike.
        split_first = child_b < 0 or (child_a >= 0 and splits_first(low_a, high_a, low_b, high_b))
        for side in range(2):
            pairs[depth, 0] = child_a + 1 - side if split_first else a
            pairs[depth, 1] = b if split_first else child_b + 1 - side
            depth += 1
    return depth, end
