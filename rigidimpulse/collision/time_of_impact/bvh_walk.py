"""Safe time of two primitives with many pieces: walks through their box trees, soonest pair of boxes first.

A pair of boxes is bounded along the axes of either box, each carried by its body; only pairs that could lower the
safe time found so far are opened. A cylinder counts as one box.
"""

from __future__ import annotations

from rigidimpulse.collision.time_of_impact.convex_pieces import pieces_safe_until
from rigidimpulse.collision.time_of_impact.motion_bound import SEEN_SIZE, put, turned, turned_back, vector
from rigidimpulse.collision.time_of_impact.scratch_layout import (
    AXIS_VIEWS,
    BASE,
    CARRIER,
    CLOSEST,
    CORNER,
    COUNT,
    CYLINDER,
    CYLINDER_AXES,
    CYLINDER_HEIGHT,
    CYLINDER_RADIUS,
    CYLINDER_SIZE,
    DIRECTION,
    ELEMENT_A,
    ELEMENT_B,
    FACE,
    FIRST,
    LIMIT,
    LIMIT_SIZE,
    LIMIT_VIEW,
    ORIGIN,
    OTHER_VIEW,
    ROTATION,
    SECOND,
    SEEN,
    STACK,
    STACK_TIME,
    VIEW_SIZE,
)
from rigidimpulse.collision.time_of_impact.separating_quadratic import viewed_safe_until, write_view
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import along, dot, length, row, scaled, subtract

NO_NODE = -1
"""In place of a tree node: the cylinder."""


@jit
def _load_triangle(vertex, triangle, triangle_normal, i, work, index, side):
    """Put triangle i into the place of the first (0) or second (1) piece, in the frame of the first body."""
    normal = row(triangle_normal, i)
    put(work, FACE + 3 * side, turned(work, ROTATION, normal) if side else normal)
    for k in range(3):
        point = row(vertex, triangle[i, k])
        if side:
            point = along(turned(work, ROTATION, point), 1.0, vector(work, ORIGIN + 3))
        put(work, CORNER + 9 * side + 3 * k, point)
    index[COUNT + side] = 3
    if triangle[i, 1] == triangle[i, 2]:
        index[COUNT + side] = 1 if triangle[i, 0] == triangle[i, 1] else 2


@jit
def _write_axis_views(work, axes):
    """Views along the axes of the first body's boxes and, against them, the columns of the matrix at `axes`."""
    for k in range(3):
        axis = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        write_view(work, SEEN, axis, AXIS_VIEWS + VIEW_SIZE * k)
        column = (-work[axes + k], -work[axes + 3 + k], -work[axes + 6 + k])
        write_view(work, SEEN + SEEN_SIZE, column, AXIS_VIEWS + VIEW_SIZE * (3 + k))


@jit
def _boxes_safe_until(low, high, box, work, carrier, threshold, horizon):
    """Safe time of a box [low, high] of the first body and a box of the second; 0 where no direction separates them.

    box: (centre, half, axes) of the second box, with its half extents along the columns of the matrix at `axes`; frame of the first
    body. Directions: the one that limits the safe time so far (`carrier`: its side), and the axes of both
    boxes. All have views, from the carrier outward where the direction points from the first box to the second.
    """
    centre, half, axes = box
    middle, half_first = scaled(along(low, 1.0, high), 0.5), scaled(subtract(high, low), 0.5)
    between, arm = subtract(centre, middle), subtract(centre, vector(work, ORIGIN + 3))
    reach, reach_first = length(half), length(half_first)
    far, far_first = length(arm), length(middle)
    best = 0.0
    for trial in range(7):
        k, side = (trial - 1) % 3, 0
        if trial == 0:
            # What limits the safe time so far is the best guess for the next boxes.
            axis, side = vector(work, LIMIT + DIRECTION), carrier
            if dot(axis, axis) == 0.0:
                continue
            other = turned_back(work, axes, axis)
            distance = dot(axis, between)
            extent = abs(axis[0]) * half_first[0] + abs(axis[1]) * half_first[1] + abs(axis[2]) * half_first[2]
            extent += abs(other[0]) * half[0] + abs(other[1]) * half[1] + abs(other[2]) * half[2]
        elif trial < 4:
            other = vector(work, axes + 3 * k)
            distance = between[k]
            extent = half_first[k] + (abs(other[0]) * half[0] + abs(other[1]) * half[1] + abs(other[2]) * half[2])
        else:
            axis, side = (work[axes + k], work[axes + 3 + k], work[axes + 6 + k]), 1
            distance = dot(axis, between)
            extent = half[k] + (abs(axis[0]) * half_first[0] + abs(axis[1]) * half_first[1] + abs(axis[2]) * half_first[2])
        gap = abs(distance) - extent - threshold
        if gap > 0.0:
            view, sign = LIMIT_VIEW + VIEW_SIZE * trial, 1.0 if distance > 0.0 else -1.0
            seen = SEEN + SEEN_SIZE * side
            if side:
                s = viewed_safe_until(work, seen, view, sign, (middle, far_first, reach_first), gap, horizon)
            else:
                s = viewed_safe_until(work, seen, view, sign, (arm, far, reach), gap, horizon)
            # Each direction gives a safe time of its own; the longest counts.
            best = max(best, s)
            if best >= horizon:
                return horizon
    return best


@jit
def _pair_safe_until(node_min, node_max, first, second, work, carrier, threshold, horizon):
    """Safe time of two boxes of the trees, or of one and the cylinder."""
    if second == NO_NODE:
        at = CYLINDER + CYLINDER_SIZE
        radius = work[at + CYLINDER_RADIUS]
        centre, half, axes = vector(work, at), (radius, radius, work[at + CYLINDER_HEIGHT]), CYLINDER_AXES
    else:
        low, high = row(node_min, second), row(node_max, second)
        centre = along(turned(work, ROTATION, scaled(along(low, 1.0, high), 0.5)), 1.0, vector(work, ORIGIN + 3))
        half, axes = scaled(subtract(high, low), 0.5), ROTATION
    return _boxes_safe_until(row(node_min, first), row(node_max, first), (centre, half, axes), work, carrier, threshold, horizon)


@jit
def _push(work, index, depth, first, second, time):
    """Put a pair of nodes on the stack, or under the top pair if that one is sooner; returns the new depth."""
    place = depth
    if depth > index[BASE] and work[STACK_TIME + depth - 1] < time:
        place = depth - 1
        work[STACK_TIME + depth] = work[STACK_TIME + place]
        for k in range(2):
            index[STACK + 2 * depth + k] = index[STACK + 2 * place + k]
    index[STACK + 2 * place] = first
    index[STACK + 2 * place + 1] = second
    work[STACK_TIME + place] = time
    return depth + 1


@jit
def _is_larger(node_min, node_max, a, b):
    """Tell whether the box of node a is longer across than that of b."""
    across_a = subtract(row(node_max, a), row(node_min, a))
    across_b = subtract(row(node_max, b), row(node_min, b))
    return dot(across_a, across_a) >= dot(across_b, across_b)


@jit
def trees_safe_until(geometry, first, second, scratch, threshold, horizon):
    """Safe time of two primitives, given by the roots of their trees; NO_NODE for a cylinder as the second.

    What limits it: triangles at ELEMENT_A (of the first) and ELEMENT_B, side at CARRIER, record at LIMIT.

    Args:
        geometry: the compiled shapes.
        first, second: roots.
        scratch, threshold, horizon: as for `pieces_safe_until`.

    """
    work, index, node_min, node_max = scratch.work, scratch.index, geometry.node_min, geometry.node_max
    child, start, count = geometry.node_child, geometry.node_start, geometry.node_count
    vertex, triangle, triangle_normal = geometry.vertex, geometry.triangle, geometry.triangle_normal
    put(work, LIMIT + DIRECTION, (0.0, 0.0, 0.0))
    _write_axis_views(work, CYLINDER_AXES if second == NO_NODE else ROTATION)
    index[BASE] = 0
    depth = _push(work, index, FIRST, first, second, 0.0)
    while depth > 0 and horizon > 0.0:
        depth -= 1
        a, b = index[STACK + 2 * depth], index[STACK + 2 * depth + 1]
        # A shorter safe time was found since: these boxes cannot lower it.
        if work[STACK_TIME + depth] >= horizon:
            continue
        index[BASE] = depth
        open_a = b == NO_NODE or child[b] < 0
        if child[a] >= 0 or not open_a:
            if child[a] >= 0 and not open_a:
                # The larger box is opened, so that both shrink alike.
                open_a = _is_larger(node_min, node_max, a, b)
            for k in range(2):
                next_a, next_b = child[a] + k if open_a else a, b if open_a else child[b] + k
                time = _pair_safe_until(node_min, node_max, next_a, next_b, work, index[CARRIER], threshold, horizon)
                if time < horizon:
                    depth = _push(work, index, depth, next_a, next_b, time)
            continue
        for j in range(start[b] if b != NO_NODE else 0, start[b] + count[b] if b != NO_NODE else 1):
            index[COUNT + 1] = 0
            if b != NO_NODE:
                _load_triangle(vertex, triangle, triangle_normal, j, work, index, SECOND)
            for i in range(start[a], start[a] + count[a]):
                _load_triangle(vertex, triangle, triangle_normal, i, work, index, FIRST)
                s, carrier = pieces_safe_until(scratch, threshold, horizon)
                if s < horizon:
                    horizon = s
                    index[ELEMENT_A], index[ELEMENT_B], index[CARRIER] = i, j, carrier
                    for k in range(LIMIT_SIZE):
                        work[LIMIT + k] = work[CLOSEST + k]
                    outward = scaled(vector(work, LIMIT + DIRECTION), -1.0 if carrier else 1.0)
                    write_view(work, SEEN + SEEN_SIZE * carrier, outward, LIMIT_VIEW)
    return horizon


@jit
def half_space_safe_until(geometry, root, normal, level, scratch, horizon):
    """Safe time of a ROUND primitive of the second body above a level along a normal; ELEMENT_B tells the vertex."""
    work, index, node_min, node_max = scratch.work, scratch.index, geometry.node_min, geometry.node_max
    child, start, count = geometry.node_child, geometry.node_start, geometry.node_count
    vertex, triangle, owns = geometry.vertex, geometry.triangle, geometry.triangle_owns
    back = turned_back(work, ROTATION, normal)
    level -= dot(normal, vector(work, ORIGIN + 3))
    write_view(work, SEEN, normal, OTHER_VIEW)
    index[STACK] = root
    depth = 1
    while depth > 0 and horizon > 0.0:
        depth -= 1
        node = index[STACK + depth]
        low, high = row(node_min, node), row(node_max, node)
        half, middle = scaled(subtract(high, low), 0.5), scaled(along(low, 1.0, high), 0.5)
        gap = dot(back, middle) - (abs(back[0]) * half[0] + abs(back[1]) * half[1] + abs(back[2]) * half[2]) - level
        arm = turned(work, ROTATION, middle)
        # Boxes that stay above the level for the whole horizon need not be opened.
        if gap > 0.0 and viewed_safe_until(work, SEEN, OTHER_VIEW, 1.0, (arm, length(arm), length(half)), gap, horizon) >= horizon:
            continue
        if child[node] >= 0:
            index[STACK + depth] = child[node]
            index[STACK + depth + 1] = child[node] + 1
            depth += 2
            continue
        for i in range(start[node], start[node] + count[node]):
            for k in range(3):
                if owns[i] >> k & 1:
                    point = row(vertex, triangle[i, k])
                    arm = turned(work, ROTATION, point)
                    s = viewed_safe_until(work, SEEN, OTHER_VIEW, 1.0, (arm, length(arm), 0.0), dot(back, point) - level, horizon)
                    if s < horizon:
                        horizon = s
                        index[ELEMENT_B] = -1 - triangle[i, k]
    return horizon
