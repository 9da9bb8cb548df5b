"""Safe time of two ROUND primitives: simplices (triangles, a segment, a point) grown by a radius, in two box trees.

For each pair of simplices several directions n are tried and the best counts: the normal of either face, carried by its body; the
direction of the closest features, carried by either body; and, for crossing edges, n turning with both of them. For a carried n every
corner of the other simplex has its own offset and speed (`guard_root`). A fixed offset with the largest speed would stall a body that
rolls or slides.

n turning with both edges e_a (at rest in A) and e_b, seen from A: n stays across both to first order if n' = m,

    m = f (n x e_a),   f = -n.(w x e_b) / ((n x e_a).e_b),     n(s) = n cos(nu s) + (m / nu) sin(nu s),   nu = |m|

and for D the vector from a corner of A to one of B, f_ij = n.D:   f' = m.D + n.y',   f'' = -nu^2 n.D + 2 m.y' + n.y'',
|f'''| <= J + 3 nu |y''| + 3 nu^2 |y'| + nu^3 |D|, the lengths bounded over [0, h].

Everything is in the frame of the first body. A pair of boxes is bounded in the same way along the axes of either box.
"""

from __future__ import annotations

from rigidimpulse._jit import jit
from rigidimpulse.detect.box_tree import splits_first
from rigidimpulse.detect.features import along, cross, dot, row, subtract, turned
from rigidimpulse.sweep.bound import (
    SEEN_SPIN,
    SEEN_SPIN_SIZE,
    SEEN_TURN_SIZE,
    length,
    seen_acceleration,
    seen_velocity,
    vector,
)
from rigidimpulse.sweep.guard_closest import (
    NO_EDGES,
    box_centre,
    box_half_extent,
    closest_simplices,
    highest,
    load_corners,
    load_turned_corners,
    lowest,
)
from rigidimpulse.sweep.guard_root import jerk_term, point_safe_until, safe_until

_NOTHING = (0.0, 0.0, 0.0)
_FASTEST_TURN = 2.0  # a direction that turns faster than this many times |w| is not tried


@jit
def _carried(seen, carrier, num_carrier, moving, num_moving, origin, normal, threshold, horizon):
    """Safe time of the moving corners along `normal`, which the carrier takes along and which points at the moving body.

    `origin`: centre of mass of the moving body.
    """
    top = highest(carrier, num_carrier, normal) + threshold
    for k in range(num_moving):
        corner = row(moving, k)
        horizon = point_safe_until(seen, normal, subtract(corner, origin), dot(normal, corner) - top, horizon)
    return horizon


@jit
def _separates(scratch, num_first, num_second, normal, threshold):
    """Tell whether all corners lie apart by more than the threshold along a direction from first to second."""
    return (
        lowest(scratch.corners_second, num_second, normal) - highest(scratch.corners_first, num_first, normal) > threshold
    )


@jit
def _by_faces(scratch, num_first, normal_first, num_second, normal_second, threshold, horizon):
    """Safe time along the normals of the faces; 0 if neither separates."""
    best = 0.0
    first, second, origin = scratch.corners_first, scratch.corners_second, vector(scratch.offset, 0)
    between = subtract(row(second, 0), row(first, 0))
    if num_first == 3:
        normal = along(_NOTHING, 1.0 if dot(between, normal_first) > 0.0 else -1.0, normal_first)
        if _separates(scratch, num_first, num_second, normal, threshold):
            best = _carried(scratch.seen[0], first, num_first, second, num_second, origin, normal, threshold, horizon)
    if num_second == 3 and best < horizon:
        normal = along(_NOTHING, 1.0 if dot(between, normal_second) > 0.0 else -1.0, normal_second)
        if _separates(scratch, num_first, num_second, normal, threshold):
            back = (-normal[0], -normal[1], -normal[2])
            other = _carried(scratch.seen[1], second, num_second, first, num_first, _NOTHING, back, threshold, horizon)
            best = max(best, other)
    return best


@jit
def _with_edges(scratch, num_first, num_second, edges, normal, threshold, horizon):
    """Safe time along n turning with both crossing edges; 0 if it would have to turn too fast."""
    k, j = edges // 3, edges % 3
    seen = scratch.seen[0]
    edge_first = subtract(row(scratch.corners_first, (k + 1) % num_first), row(scratch.corners_first, k))
    edge_second = subtract(row(scratch.corners_second, (j + 1) % num_second), row(scratch.corners_second, j))
    m = cross(normal, edge_first)
    wanted = -dot(normal, cross(vector(seen, SEEN_SPIN), edge_second))
    available = dot(m, edge_second)
    if abs(wanted) * length(m) > _FASTEST_TURN * seen[SEEN_SPIN_SIZE] * abs(available) or available == 0.0:
        return 0.0
    m = along(_NOTHING, wanted / available, m)
    nu = length(m)
    for j in range(num_second):
        corner = row(scratch.corners_second, j)
        arm = subtract(corner, vector(scratch.offset, 0))
        velocity, acceleration = seen_velocity(seen, arm), seen_acceleration(seen, arm)
        jerk = 3.0 * jerk_term(seen, length(arm), 1.0)
        bend_bound = length(acceleration) + horizon * jerk
        speed_bound = length(velocity) + horizon * bend_bound
        for k in range(num_first):
            between = subtract(corner, row(scratch.corners_first, k))
            reach = length(between) + horizon * speed_bound
            rest = jerk + nu * (3.0 * bend_bound + nu * (3.0 * speed_bound + nu * reach))
            gap = dot(normal, between)
            closing = -dot(m, between) - dot(normal, velocity)
            bend = nu * nu * gap - 2.0 * dot(m, velocity) - dot(normal, acceleration) + rest * horizon / 3.0
            horizon = safe_until(gap - threshold, closing, bend, horizon)
    return horizon


@jit
def simplices_safe_until(scratch, num_first, normal_first, num_second, normal_second, threshold, horizon):
    """Safe time of the simplices in scratch.corners_first and corners_second (frame of the first body).

    If it is short of the horizon, scratch.closest holds the closest features.
    """
    best = _by_faces(scratch, num_first, normal_first, num_second, normal_second, threshold, horizon)
    if best >= horizon:
        return horizon
    first, second, closest = scratch.corners_first, scratch.corners_second, scratch.closest
    separation, edges = closest_simplices(first, num_first, normal_first, second, num_second, normal_second, closest)
    if separation <= 0.0:
        return 0.0
    normal, origin = vector(closest, 0), vector(scratch.offset, 0)
    best = max(best, _carried(scratch.seen[0], first, num_first, second, num_second, origin, normal, threshold, horizon))
    if best < horizon:
        back = (-normal[0], -normal[1], -normal[2])
        other = _carried(scratch.seen[1], second, num_second, first, num_first, _NOTHING, back, threshold, horizon)
        best = max(best, other)
    if best < horizon and edges != NO_EDGES:
        best = max(best, _with_edges(scratch, num_first, num_second, edges, normal, threshold, horizon))
    return best


@jit
def _box_along(seen, normal, arm, reach, gap, horizon):
    """Safe time along a carried direction of all points within `reach` of the point at `arm`; `gap` is left along it."""
    closing = seen[SEEN_SPIN_SIZE] * reach - dot(normal, seen_velocity(seen, arm))
    bend = seen[SEEN_TURN_SIZE] * reach - dot(normal, seen_acceleration(seen, arm))
    return safe_until(gap, closing, bend + jerk_term(seen, length(arm) + reach, horizon), horizon)


@jit
def boxes_safe_until(geometry, scratch, node_first, node_second, threshold, horizon):
    """Safe time of everything in two boxes: the best of the axes of either box; 0 where none separates them."""
    R = scratch.rotation
    half_first, half_second = box_half_extent(geometry, node_first), box_half_extent(geometry, node_second)
    arm_first, arm_second = box_centre(geometry, node_first), turned(R, box_centre(geometry, node_second))
    between = subtract(along(arm_second, 1.0, vector(scratch.offset, 0)), arm_first)
    reach_first, reach_second = length(half_first), length(half_second)
    best = 0.0
    for k in range(3):
        axis = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        distance = dot(axis, between)
        extent = abs(R[k, 0]) * half_second[0] + abs(R[k, 1]) * half_second[1] + abs(R[k, 2]) * half_second[2]
        gap = abs(distance) - extent - half_first[k] - threshold
        if gap > 0.0:
            normal = along(_NOTHING, 1.0 if distance > 0.0 else -1.0, axis)
            best = max(best, _box_along(scratch.seen[0], normal, arm_second, reach_second, gap, horizon))
            if best >= horizon:
                return horizon
    for k in range(3):
        axis = (R[0, k], R[1, k], R[2, k])
        distance = dot(axis, between)
        extent = abs(axis[0]) * half_first[0] + abs(axis[1]) * half_first[1] + abs(axis[2]) * half_first[2]
        gap = abs(distance) - extent - half_second[k] - threshold
        if gap > 0.0:
            normal = along(_NOTHING, -1.0 if distance > 0.0 else 1.0, axis)
            best = max(best, _box_along(scratch.seen[1], normal, arm_first, reach_first, gap, horizon))
            if best >= horizon:
                return horizon
    return best


@jit
def _axis_gap(scratch, num_first, num_second, axis):
    """Gap of the corners along one axis of the first body's frame; negative where they overlap."""
    first, second = scratch.corners_first, scratch.corners_second
    low_first = high_first = first[0, axis]
    low_second = high_second = second[0, axis]
    for k in range(1, num_first):
        low_first, high_first = min(low_first, first[k, axis]), max(high_first, first[k, axis])
    for k in range(1, num_second):
        low_second, high_second = min(low_second, second[k, axis]), max(high_second, second[k, axis])
    return max(low_second - high_first, low_first - high_second)


@jit
def _leaves_safe_until(geometry, scratch, node_first, node_second, threshold, horizon):
    """Lower the safe time by the pairs of triangles of two leaves; the last one that did is left in scratch."""
    seen = scratch.seen[0]
    arm = turned(scratch.rotation, box_centre(geometry, node_second))
    reach = length(box_half_extent(geometry, node_second))
    speed = length(seen_velocity(seen, arm)) + seen[SEEN_SPIN_SIZE] * reach
    bend = length(seen_acceleration(seen, arm)) + seen[SEEN_TURN_SIZE] * reach
    bend += jerk_term(seen, length(arm) + reach, horizon)
    for second in range(geometry.node_start[node_second], geometry.node_start[node_second] + geometry.node_count[node_second]):
        num_second = load_turned_corners(geometry, second, scratch.rotation, scratch.offset, scratch.corners_second)
        normal_second = turned(scratch.rotation, row(geometry.triangle_normal, second))
        for first in range(geometry.node_start[node_first], geometry.node_start[node_first] + geometry.node_count[node_first]):
            num_first = load_corners(geometry, first, scratch.corners_first)
            far = threshold + horizon * (speed + 0.5 * horizon * bend)
            if (
                _axis_gap(scratch, num_first, num_second, 0) > far
                or _axis_gap(scratch, num_first, num_second, 1) > far
                or _axis_gap(scratch, num_first, num_second, 2) > far
            ):
                continue
            normal_first = row(geometry.triangle_normal, first)
            s = simplices_safe_until(scratch, num_first, normal_first, num_second, normal_second, threshold, horizon)
            if s < horizon:
                horizon = s
                scratch.feature[1] = first
                scratch.feature[3] = second
    return horizon


@jit
def _push(geometry, scratch, depth, node_first, node_second, threshold, horizon):
    """Put a pair of nodes on the stack if it may lower the safe time; returns the new depth."""
    time = boxes_safe_until(geometry, scratch, node_first, node_second, threshold, horizon)
    if time >= horizon:
        return depth
    scratch.stack[depth, 0] = node_first
    scratch.stack[depth, 1] = node_second
    scratch.stack_time[depth] = time
    return depth + 1


@jit
def _soonest_last(scratch, depth, count):
    """Swap the two pairs just pushed so that the one with the smaller safe time is taken first."""
    if count == 2 and scratch.stack_time[depth - 1] > scratch.stack_time[depth - 2]:
        for k in range(2):
            node = scratch.stack[depth - 1, k]
            scratch.stack[depth - 1, k] = scratch.stack[depth - 2, k]
            scratch.stack[depth - 2, k] = node
        time = scratch.stack_time[depth - 1]
        scratch.stack_time[depth - 1] = scratch.stack_time[depth - 2]
        scratch.stack_time[depth - 2] = time


@jit
def round_round_safe_until(geometry, scratch, first, second, threshold, horizon):
    """Safe time of two ROUND primitives; scratch.feature[1] and [3] are the triangles that limit it."""
    core = threshold + geometry.radius[first] + geometry.radius[second]
    stack, child = scratch.stack, geometry.node_child
    depth = _push(geometry, scratch, 0, geometry.node_first[first], geometry.node_first[second], core, horizon)
    while depth > 0 and horizon > 0.0:
        depth -= 1
        if scratch.stack_time[depth] >= horizon:
            continue
        a, b = stack[depth, 0], stack[depth, 1]
        if child[a] < 0 and child[b] < 0:
            horizon = _leaves_safe_until(geometry, scratch, a, b, core, horizon)
            continue
        below = depth
        split_first = splits_first(geometry, a, b)
        for side in range(2):
            next_first = child[a] + side if split_first else a
            next_second = b if split_first else child[b] + side
            depth = _push(geometry, scratch, depth, next_first, next_second, core, horizon)
        _soonest_last(scratch, depth, depth - below)
    return horizon
