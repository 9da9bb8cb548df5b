"""Safe time of a half space and a ROUND primitive: every vertex along the normal, which the half space carries.

In the frame of the second body, with r the arm of a point, everything that the quadratic of `guard_root` needs is linear in r:

    gap g_0 + n.r,   closing c_0 + c_r.r,   bend a_0 + a_r.r + (J_c + J_r |r|) h / 3

so a box of the tree is bounded by its centre and its half extents, and a vertex costs three dot products.
"""

from __future__ import annotations

from rigidimpulse._jit import jit
from rigidimpulse.detect.features import cross, dot, row
from rigidimpulse.sweep.bound import SEEN_ACCELERATION, SEEN_SPIN, SEEN_TURN, SEEN_VELOCITY, length, vector
from rigidimpulse.sweep.guard_root import jerk_term, safe_until


@jit
def turned_back(R, v):
    """R^T v: a vector of the first body's frame in the axes of the second."""
    return (
        R[0, 0] * v[0] + R[1, 0] * v[1] + R[2, 0] * v[2],
        R[0, 1] * v[0] + R[1, 1] * v[1] + R[2, 1] * v[2],
        R[0, 2] * v[0] + R[1, 2] * v[1] + R[2, 2] * v[2],
    )


@jit
def _linear_terms(scratch, normal, level):
    """Return (g_0, c_0, a_0), n, c_r, a_r of the quadratic, in the axes of the second body; `level`: where the gap is zero."""
    seen = scratch.seen[0]
    spin_side = cross(normal, vector(seen, SEEN_SPIN))
    turn_side = (
        normal[0] * seen[SEEN_TURN] + normal[1] * seen[SEEN_TURN + 3] + normal[2] * seen[SEEN_TURN + 6],
        normal[0] * seen[SEEN_TURN + 1] + normal[1] * seen[SEEN_TURN + 4] + normal[2] * seen[SEEN_TURN + 7],
        normal[0] * seen[SEEN_TURN + 2] + normal[1] * seen[SEEN_TURN + 5] + normal[2] * seen[SEEN_TURN + 8],
    )
    constants = (
        dot(normal, vector(scratch.offset, 0)) - level,
        -dot(normal, vector(seen, SEEN_VELOCITY)),
        -dot(normal, vector(seen, SEEN_ACCELERATION)),
    )
    closing_arm = turned_back(scratch.rotation, (-spin_side[0], -spin_side[1], -spin_side[2]))
    bend_arm = turned_back(scratch.rotation, (-turn_side[0], -turn_side[1], -turn_side[2]))
    return constants, turned_back(scratch.rotation, normal), closing_arm, bend_arm


@jit
def _node_safe_until(geometry, scratch, node, terms, horizon):
    """Safe time of all points in the box of a node."""
    constants, normal, closing_arm, bend_arm = terms
    gap, closing, bend = constants
    distance = 0.0
    for k in range(3):
        centre = 0.5 * (geometry.node_max[node, k] + geometry.node_min[node, k])
        half = 0.5 * (geometry.node_max[node, k] - geometry.node_min[node, k])
        gap += normal[k] * centre - abs(normal[k]) * half
        closing += closing_arm[k] * centre + abs(closing_arm[k]) * half
        bend += bend_arm[k] * centre + abs(bend_arm[k]) * half
        distance += abs(centre) + half
    if gap <= 0.0:
        return 0.0
    return safe_until(gap, closing, bend + jerk_term(scratch.seen[0], distance, horizon), horizon)


@jit
def _vertices_safe_until(geometry, scratch, node, terms, horizon):
    """Lower the safe time by the vertices that the triangles of a leaf own."""
    constants, normal, closing_arm, bend_arm = terms
    for triangle in range(geometry.node_start[node], geometry.node_start[node] + geometry.node_count[node]):
        for k in range(3):
            if not geometry.triangle_owns[triangle] >> k & 1:
                continue
            r = row(geometry.vertex, geometry.triangle[triangle, k])
            gap = constants[0] + dot(normal, r)
            closing = constants[1] + dot(closing_arm, r)
            bend = constants[2] + dot(bend_arm, r) + jerk_term(scratch.seen[0], length(r), horizon)
            s = safe_until(gap, closing, bend, horizon)
            if s < horizon:
                horizon = s
                scratch.feature[3] = geometry.triangle[triangle, k]
    return horizon


@jit
def half_space_round_safe_until(geometry, scratch, half_space, other, threshold, horizon):
    """Safe time of a half space and a ROUND primitive; scratch.feature[3] is the vertex that limits it."""
    frame = geometry.frame[half_space]
    normal = vector(frame, 0)
    terms = _linear_terms(scratch, normal, frame[3] + threshold + geometry.radius[other])
    stack, child = scratch.stack, geometry.node_child
    stack[0, 0] = geometry.node_first[other]
    depth = 1
    while depth > 0 and horizon > 0.0:
        depth -= 1
        node = stack[depth, 0]
        if _node_safe_until(geometry, scratch, node, terms, horizon) >= horizon:
            continue
        if child[node] < 0:
            horizon = _vertices_safe_until(geometry, scratch, node, terms, horizon)
            continue
        stack[depth, 0] = child[node]
        stack[depth + 1, 0] = child[node] + 1
        depth += 2
    return horizon
