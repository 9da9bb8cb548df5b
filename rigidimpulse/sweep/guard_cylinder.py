"""Safe time of a cylinder against a half space, a ROUND primitive and another cylinder.

A cylinder with centre c, unit axis e, half height H and rim radius r reaches from c by the support H |n.e| + r |n x e| along -n. Along a
normal n that the other body carries, with q = n.e and N = n x e (q', q'', N', N'' from e' = w x e, e'' = beta x e + w x (w x e),
|e'''| <= J_r), over s in [0, h]:

    |q(s)|  <=  chord of |q + q' s|  + |q''| s^2 / 2 + J_r s^3 / 6          the chord of a convex function over [0, h] lies above it
    |q(s)|  =   sign(q) (q + q' s + q'' s^2 / 2) + J_r s^3 / 6              as long as q keeps its sign
    |N(s)|  <=  chord of |N + N' s|  + |N''| s^2 / 2 + J_r s^3 / 6          sharp for a cylinder that stands or lies
    |N(s)|  <=  (|N(s)|^2 + |N|^2) / (2 |N|),   |N(s)|^2 = 1 - q(s)^2       sharp for one that leans and rolls on its rim

(the last is the inequality of the means). Along a direction that the cylinder carries its support is constant, and the corners of the
other body move. The closest points of a cylinder and a triangle or cylinder come from `detect.cylinder`.
"""

from __future__ import annotations

from rigidimpulse._jit import jit
from rigidimpulse.detect.cylinder import cylinder_cylinder_distance, cylinder_support, cylinder_triangle_distance
from rigidimpulse.detect.features import along, cross, dot, row, subtract, turned
from rigidimpulse.sweep.bound import (
    SEEN_ARM_JERK,
    SEEN_SPIN,
    SEEN_TURN,
    length,
    seen_acceleration,
    seen_velocity,
    vector,
)
from rigidimpulse.sweep.guard_closest import box_centre, box_half_extent, highest, load_corners
from rigidimpulse.sweep.guard_root import jerk_term, point_safe_until, safe_until

_NOTHING = (0.0, 0.0, 0.0)


@jit
def _end_growth(q, q_rate, q_bend, jerk, horizon):
    """Return (rate, bend) of a quadratic above |q(s)| - |q| on [0, horizon]."""
    change = horizon * (abs(q_rate) + 0.5 * horizon * (abs(q_bend) + jerk * horizon / 3.0))
    if abs(q) > change:
        sign = 1.0 if q > 0.0 else -1.0
        return sign * q_rate, sign * q_bend + jerk * horizon / 3.0
    return (abs(q + q_rate * horizon) - abs(q)) / horizon, abs(q_bend) + jerk * horizon / 3.0


@jit
def cylinder_safe_until(seen, axis, arm, half_height, radius, normal, gap, horizon):
    """Safe time of a cylinder along a normal that points at it and is carried by the other body.

    Args:
        seen: motion of the cylinder's body as seen from the carrier.
        axis: unit axis of the cylinder, carrier's axes.
        arm: its centre from the centre of mass of its body, same axes.
        half_height: m.
        radius: m.
        normal: unit normal.
        gap: what is left above the threshold now, m.
        horizon: s.

    """
    if horizon <= 0.0:
        return 0.0
    axis_rate = cross(vector(seen, SEEN_SPIN), axis)
    axis_bend = (
        dot(vector(seen, SEEN_TURN), axis),
        dot(vector(seen, SEEN_TURN + 3), axis),
        dot(vector(seen, SEEN_TURN + 6), axis),
    )
    jerk = seen[SEEN_ARM_JERK]
    q, q_rate, q_bend = dot(normal, axis), dot(normal, axis_rate), dot(normal, axis_bend)
    end_rate, end_bend = _end_growth(q, q_rate, q_bend, jerk, horizon)
    closing = half_height * end_rate - dot(normal, seen_velocity(seen, arm))
    bend = half_height * end_bend - dot(normal, seen_acceleration(seen, arm)) + jerk_term(seen, length(arm), horizon)

    side, side_rate = cross(normal, axis), cross(normal, axis_rate)
    size = length(side)
    ahead = (side[0] + horizon * side_rate[0], side[1] + horizon * side_rate[1], side[2] + horizon * side_rate[2])
    rim_rate = (length(ahead) - size) / horizon
    rim_bend = length(cross(normal, axis_bend)) + jerk * horizon / 3.0
    best = safe_until(gap, closing + radius * rim_rate, bend + radius * rim_bend, horizon)
    if best >= horizon or size == 0.0:
        return best
    fastest_bend = abs(q_bend) + jerk * horizon
    fastest_rate = abs(q_rate) + fastest_bend * horizon
    third = 6.0 * fastest_rate * fastest_bend + 2.0 * jerk
    rim_rate = -q * q_rate / size
    rim_bend = (third * horizon / 6.0 - q_rate * q_rate - q * q_bend) / size
    return max(best, safe_until(gap, closing + radius * rim_rate, bend + radius * rim_bend, horizon))


@jit
def second_cylinder(geometry, scratch, cylinder):
    """Return (axis, arm, half height, radius) of a cylinder of the second body, in the frame of the first."""
    frame = geometry.frame[cylinder]
    axis, arm = turned(scratch.rotation, vector(frame, 3)), turned(scratch.rotation, vector(frame, 0))
    return axis, arm, frame[6], geometry.radius[cylinder]


@jit
def _second_along(scratch, cylinder, normal, level, horizon):
    """Safe time of the second body's cylinder above a level along a normal that the first body carries."""
    axis, arm, half_height, radius = cylinder
    reach = cylinder_support(axis, half_height, radius, normal)
    gap = dot(normal, arm) + dot(normal, vector(scratch.offset, 0)) - reach - level
    return cylinder_safe_until(scratch.seen[0], axis, arm, half_height, radius, normal, gap, horizon)


@jit
def _from_second(scratch, cylinder, num_first, normal, threshold, horizon):
    """Safe time of the first body's corners along `normal` (first to second), which the second body's cylinder carries."""
    axis, arm, half_height, radius = cylinder
    back = (-normal[0], -normal[1], -normal[2])
    centre = along(arm, 1.0, vector(scratch.offset, 0))
    top = dot(back, centre) + cylinder_support(axis, half_height, radius, back) + threshold
    for k in range(num_first):
        corner = row(scratch.corners_first, k)
        horizon = point_safe_until(scratch.seen[1], back, corner, dot(back, corner) - top, horizon)
    return horizon


@jit
def half_space_cylinder_safe_until(geometry, scratch, half_space, cylinder, threshold, horizon):
    """Safe time of a half space and a cylinder."""
    frame = geometry.frame[half_space]
    return _second_along(scratch, second_cylinder(geometry, scratch, cylinder), vector(frame, 0), frame[3] + threshold, horizon)


@jit
def _simplex_safe_until(scratch, num_first, normal_first, cylinder, threshold, horizon):
    """Safe time of the simplex in scratch.corners_first and the second body's cylinder."""
    axis, arm, half_height, radius = cylinder
    corners, centre = scratch.corners_first, along(arm, 1.0, vector(scratch.offset, 0))
    best = 0.0
    if num_first == 3:
        side = dot(normal_first, subtract(centre, row(corners, 0)))
        normal = along(_NOTHING, 1.0 if side > 0.0 else -1.0, normal_first)
        level = highest(corners, num_first, normal) + threshold
        if dot(normal, centre) - cylinder_support(axis, half_height, radius, normal) > level:
            best = _second_along(scratch, cylinder, normal, level, horizon)
            if best >= horizon:
                return horizon
    if cylinder_triangle_distance(centre, axis, half_height, radius, corners, scratch.closest) <= 0.0:
        return 0.0
    normal = along(_NOTHING, -1.0, vector(scratch.closest, 6))
    best = max(best, _second_along(scratch, cylinder, normal, highest(corners, num_first, normal) + threshold, horizon))
    if best < horizon:
        best = max(best, _from_second(scratch, cylinder, num_first, normal, threshold, horizon))
    return best


@jit
def _box_safe_until(geometry, scratch, node, cylinder, threshold, horizon):
    """Safe time of everything in a box of the first body: along its axes, the cylinder's axis and the line between them."""
    axis, arm, half_height, radius = cylinder
    centre, half = box_centre(geometry, node), box_half_extent(geometry, node)
    between = subtract(along(arm, 1.0, vector(scratch.offset, 0)), centre)
    across = along(between, -dot(between, axis), axis)
    distance = length(across)
    best = 0.0
    for k in range(5):
        if k < 3:
            normal = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        elif k == 3:
            normal = axis
        elif distance > 0.0:
            normal = along(_NOTHING, 1.0 / distance, across)
        else:
            break
        if dot(normal, between) < 0.0:
            normal = along(_NOTHING, -1.0, normal)
        extent = abs(normal[0]) * half[0] + abs(normal[1]) * half[1] + abs(normal[2]) * half[2] + threshold
        if dot(normal, between) - extent > cylinder_support(axis, half_height, radius, normal):
            best = max(best, _second_along(scratch, cylinder, normal, dot(normal, centre) + extent, horizon))
            if best >= horizon:
                return horizon
    return best


@jit
def round_cylinder_safe_until(geometry, scratch, first, second, threshold, horizon):
    """Safe time of a ROUND primitive and a cylinder; scratch.feature[1] is the triangle that limits it."""
    cylinder = second_cylinder(geometry, scratch, second)
    core = threshold + geometry.radius[first]
    stack = scratch.stack
    stack[0, 0] = geometry.node_first[first]
    depth = 1
    while depth > 0 and horizon > 0.0:
        depth -= 1
        node = stack[depth, 0]
        if _box_safe_until(geometry, scratch, node, cylinder, core, horizon) >= horizon:
            continue
        if geometry.node_child[node] >= 0:
            stack[depth, 0] = geometry.node_child[node]
            stack[depth + 1, 0] = geometry.node_child[node] + 1
            depth += 2
            continue
        for triangle in range(geometry.node_start[node], geometry.node_start[node] + geometry.node_count[node]):
            num_first = load_corners(geometry, triangle, scratch.corners_first)
            normal_first = row(geometry.triangle_normal, triangle)
            s = _simplex_safe_until(scratch, num_first, normal_first, cylinder, core, horizon)
            if s < horizon:
                horizon = s
                scratch.feature[1] = triangle
    return horizon


@jit
def cylinder_cylinder_safe_until(geometry, scratch, first, second, threshold, horizon):
    """Safe time of two cylinders along the direction of their closest points, carried by either."""
    axis, arm, half_height, radius = second_cylinder(geometry, scratch, second)
    frame, radius_first = geometry.frame[first], geometry.radius[first]
    centre = along(arm, 1.0, vector(scratch.offset, 0))
    axis_first, arm_first = vector(frame, 3), vector(frame, 0)
    distance = cylinder_cylinder_distance(
        arm_first, axis_first, frame[6], radius_first, centre, axis, half_height, radius, scratch.closest
    )
    if distance <= 0.0:
        return 0.0
    normal = vector(scratch.closest, 6)
    reach_first = cylinder_support(axis_first, frame[6], radius_first, normal)
    reach_second = cylinder_support(axis, half_height, radius, normal)
    gap = dot(normal, subtract(centre, arm_first)) - reach_first - reach_second - threshold
    best = cylinder_safe_until(scratch.seen[0], axis, arm, half_height, radius, normal, gap, horizon)
    if best < horizon:
        back = along(_NOTHING, -1.0, normal)
        other = cylinder_safe_until(scratch.seen[1], axis_first, arm_first, frame[6], radius_first, back, gap, horizon)
        best = max(best, other)
    return best
