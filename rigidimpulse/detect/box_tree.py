"""Walks through one or two box trees (see `geometry`)."""

from __future__ import annotations


from rigidimpulse.detect.features import inner

STACK_ROWS = 128
"""Rows of the scratch buffer used as the stack of a walk through two trees; the rest holds pairs of leaves."""


@inner
def box_distance_squared(geometry, a, b, R, t):
    """Return a lower bound of the squared distance of the boxes of two nodes: seen from either frame, the larger."""
    in_a = 0.0
    in_b = 0.0
    for k in range(3):
        centre_a = t[k] - 0.5 * (geometry.node_min[a, k] + geometry.node_max[a, k])
        reach_a = 0.5 * (geometry.node_max[a, k] - geometry.node_min[a, k])
        centre_b = 0.5 * (geometry.node_min[b, k] + geometry.node_max[b, k])
        reach_b = 0.5 * (geometry.node_max[b, k] - geometry.node_min[b, k])
        for i in range(3):
            centre_a += R[k, i] * 0.5 * (geometry.node_min[b, i] + geometry.node_max[b, i])
            reach_a += abs(R[k, i]) * 0.5 * (geometry.node_max[b, i] - geometry.node_min[b, i])
            centre_b -= R[i, k] * (0.5 * (geometry.node_min[a, i] + geometry.node_max[a, i]) - t[i])
            reach_b += abs(R[i, k]) * 0.5 * (geometry.node_max[a, i] - geometry.node_min[a, i])
        in_a += max(0.0, abs(centre_a) - reach_a) ** 2
        in_b += max(0.0, abs(centre_b) - reach_b) ** 2
    return max(in_a, in_b)


@inner
def splits_first(geometry, a, b):
    """Tell whether the first of two nodes is the one to split: the larger one that is not a leaf."""
    if geometry.node_child[a] < 0 or geometry.node_child[b] < 0:
        return geometry.node_child[b] < 0
    extent_a = 0.0
    extent_b = 0.0
    for k in range(3):
        extent_a = max(extent_a, geometry.node_max[a, k] - geometry.node_min[a, k])
        extent_b = max(extent_b, geometry.node_max[b, k] - geometry.node_min[b, k])
    return extent_a >= extent_b


@inner
def gather_leaf_pairs(geometry, R, t, core, pairs, depth):
    """Walk on from the stack in rows [0, depth) of `pairs`; return (depth, end): leaf pairs in rows [STACK_ROWS, end)."""
    end = STACK_ROWS
    while depth > 0 and end < pairs.shape[0]:
        depth -= 1
        a = pairs[depth, 0]
        b = pairs[depth, 1]
        if box_distance_squared(geometry, a, b, R, t) > core * core:
            continue
        if geometry.node_child[a] < 0 and geometry.node_child[b] < 0:
            pairs[end, 0] = a
            pairs[end, 1] = b
            end += 1
            continue
        split_first = splits_first(geometry, a, b)
        for side in range(2):
            pairs[depth, 0] = geometry.node_child[a] + 1 - side if split_first else a
            pairs[depth, 1] = b if split_first else geometry.node_child[b] + 1 - side
            depth += 1
    return depth, end
