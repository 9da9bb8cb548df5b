"""Walks through one or two box trees (see `geometry`)."""

from __future__ import annotations

from typing import NamedTuple

from rigidimpulse.collision.distance.simplices import inner
from rigidimpulse.core.vector import moved, row, subtract


class NodeLimits(NamedTuple):
    """What a walk through two trees looks at: gaps along normals, at the present pose and at any to which the bodies may go from there."""

    reach: float  # m, greatest gap
    far: float  # m, the same and how far points may move past each other
    depth: float  # m, how far surfaces may be inside each other, and how far points may move
    cosine: float  # of the angle by which the bodies may turn against each other
    sine: float


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
def _normals_oppose(cone, a, b, R, limits):
    """Whether some n may be in the cone of node a with -n in that of node b, turned by R and a little more; cone: see `normal_cones`."""
    between = 0.0
    for i in range(3):
        between -= cone[a, i] * (R[i, 0] * cone[b, 0] + R[i, 1] * cone[b, 1] + R[i, 2] * cone[b, 2])
    cosine, sine = cone[a, 3] * cone[b, 3] - cone[a, 4] * cone[b, 4], cone[a, 4] * cone[b, 3] + cone[a, 3] * cone[b, 4]
    # Two half angles of more than a half circle together leave nothing out.
    if sine <= 0.0 or between >= cosine:
        return True
    turned_sine = sine * limits.cosine + cosine * limits.sine
    return turned_sine <= 0.0 or between >= cosine * limits.cosine - sine * limits.sine


@inner
def _in_reach(geometry, a, b, R, t, limits):
    """Whether a point of node b may be at  p + g n,  -depth <= g <= reach,  for a point p of node a with a normal n of its cone, and back.

    Each box is put into an upright box of the other's frame, as in `box_distance_squared`. Along each axis the way g n is bounded by the
    least and the greatest component of the normals of the cone.
    """
    cone, reach, far, depth = geometry.node_cone, limits.reach, limits.far, limits.depth
    low_a, high_a = row(geometry.node_min, a), row(geometry.node_max, a)
    low_b, high_b = row(geometry.node_min, b), row(geometry.node_max, b)
    middle_a = (0.5 * (low_a[0] + high_a[0]), 0.5 * (low_a[1] + high_a[1]), 0.5 * (low_a[2] + high_a[2]))
    half_a = (high_a[0] - middle_a[0], high_a[1] - middle_a[1], high_a[2] - middle_a[2])
    middle_b = (0.5 * (low_b[0] + high_b[0]), 0.5 * (low_b[1] + high_b[1]), 0.5 * (low_b[2] + high_b[2]))
    half_b = (high_b[0] - middle_b[0], high_b[1] - middle_b[1], high_b[2] - middle_b[2])
    between = subtract(moved(R, t, middle_b), middle_a)
    squared = 0.0
    for k in range(3):
        half = half_a[k] + (abs(R[k, 0]) * half_b[0] + abs(R[k, 1]) * half_b[1] + abs(R[k, 2]) * half_b[2])
        if between[k] - half > reach * max(0.0, cone[a, 8 + k]) + depth or between[k] + half < reach * min(0.0, cone[a, 5 + k]) - depth:
            return False
        squared += max(0.0, abs(between[k]) - half) ** 2
    if squared > far * far:
        return False
    squared = 0.0
    for k in range(3):
        along_k = -(R[0, k] * between[0] + R[1, k] * between[1] + R[2, k] * between[2])
        half = half_b[k] + (abs(R[0, k]) * half_a[0] + abs(R[1, k]) * half_a[1] + abs(R[2, k]) * half_a[2])
        if along_k - half > reach * max(0.0, cone[b, 8 + k]) + depth or along_k + half < reach * min(0.0, cone[b, 5 + k]) - depth:
            return False
        squared += max(0.0, abs(along_k) - half) ** 2
    return squared <= far * far


@inner
def gather_leaf_pairs(geometry, R, t, limits, any_normal, pairs, stacked):
    """Walk on from the stack in rows [0, stacked) of `pairs`, for features within `NodeLimits`.

    any_normal: keep all pairs of boxes that are near enough, those too that cannot touch by their normals. Returns (stacked, end, left
    out): what is left of the stack, the pairs of leaves in rows [STACK_ROWS, end), and whether normals have left out boxes near enough.
    """
    node_min, node_max, node_child, cone = geometry.node_min, geometry.node_max, geometry.node_child, geometry.node_cone
    end, left_out, far_squared = STACK_ROWS, False, limits.far * limits.far
    while stacked > 0 and end < pairs.shape[0]:
        stacked -= 1
        a = pairs[stacked, 0]
        b = pairs[stacked, 1]
        low_a, high_a = row(node_min, a), row(node_max, a)
        low_b, high_b = row(node_min, b), row(node_max, b)
        if any_normal:
            if box_distance_squared(low_a, high_a, low_b, high_b, R, t, far_squared) > far_squared:
                continue
        elif not (_normals_oppose(cone, a, b, R, limits) and _in_reach(geometry, a, b, R, t, limits)):
            left_out = left_out or box_distance_squared(low_a, high_a, low_b, high_b, R, t, far_squared) <= far_squared
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
            pairs[stacked, 0] = child_a + 1 - side if split_first else a
            pairs[stacked, 1] = b if split_first else child_b + 1 - side
            stacked += 1
    return stacked, end, left_out
