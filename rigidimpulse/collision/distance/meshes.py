"""Least distance of two ROUND primitives.

The closest points of two sets of triangles that do not cross are a vertex and a point inside a face, or points of two
edges (their ends included). Each vertex and edge is owned by one triangle, so each pair is met once: about three tests
for two triangles instead of fifteen. Where boxes overlap, an edge that runs through a face makes the distance 0.
Both box trees are walked nearest first; a pair of boxes farther apart than the best distance so far is left out.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse.collision.bvh import STACK_ROWS, box_distance_squared, splits_first
from rigidimpulse.collision.distance.simplices import closest_on_segments, inner, over_triangle, pierces_triangle
from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.core.vector import along, dot, moved, row, subtract, turned


@inner
def _closer(best, p, q):
    """Return the triple (squared distance, p, q) if it is closer than the triple `best`, else `best`."""
    between = subtract(q, p)
    distance_squared = dot(between, between)
    return (distance_squared, p, q) if distance_squared < best[0] else best


@inner
def _foot(p, face, limit):
    """Return (over, foot): whether `p` lies over the face (a, b, c, normal), with a squared height below `limit`."""
    height = dot(subtract(p, face[0]), face[3])
    over = height * height < limit and over_triangle(p, face[0], face[1], face[2], face[3], 0.0, 0.0, 0.0)
    return over and dot(face[3], face[3]) > 0.0, along(p, -height, face[3])


@inner
def _triangle_box(a, b, c):
    """Return the box of a triangle."""
    low = (min(a[0], b[0], c[0]), min(a[1], b[1], c[1]), min(a[2], b[2], c[2]))
    return low, (max(a[0], b[0], c[0]), max(a[1], b[1], c[1]), max(a[2], b[2], c[2]))


@inner
def _boxes_squared(low_a, high_a, low_b, high_b):
    """Return the squared distance of two boxes of one frame."""
    x = max(0.0, low_a[0] - high_b[0], low_b[0] - high_a[0])
    y = max(0.0, low_a[1] - high_b[1], low_b[1] - high_a[1])
    z = max(0.0, low_a[2] - high_b[2], low_b[2] - high_a[2])
    return x * x + y * y + z * z


@inner
def _triangle_distance(owns_a, owns_b, face_a, face_b, may_cross, best):
    """Return the closest of `best` and the features that two triangles own (bits as in `geometry`)."""
    corners_a = (face_a[0], face_a[1], face_a[2], face_a[0])
    corners_b = (face_b[0], face_b[1], face_b[2], face_b[0])
    for k in range(3):
        if owns_a >> k & 1:
            over, foot = _foot(corners_a[k], face_b, best[0])
            if over:
                best = _closer(best, corners_a[k], foot)
        if owns_b >> k & 1:
            over, foot = _foot(corners_b[k], face_a, best[0])
            if over:
                best = _closer(best, foot, corners_b[k])
    for k in range(3):
        if not owns_a >> (3 + k) & 1:
            continue
        p = corners_a[k]
        d = subtract(corners_a[k + 1], p)
        # An edge through a face: the surfaces cross, the distance is 0.
        if may_cross and pierces_triangle(p, corners_a[k + 1], face_b[0], face_b[1], face_b[2], face_b[3]):
            best = _closer(best, p, p)
        for m in range(3):
            if owns_b >> (3 + m) & 1:
                q = corners_b[m]
                e = subtract(corners_b[m + 1], q)
                s, t = closest_on_segments(p, d, q, e)
                best = _closer(best, along(p, s, d), along(q, t, e))
    for m in range(3):
        if may_cross and owns_b >> (3 + m) & 1:
            q = corners_b[m]
            if pierces_triangle(q, corners_b[m + 1], face_a[0], face_a[1], face_a[2], face_a[3]):
                best = _closer(best, q, q)
    return best


@inner
def _leaf_distance(geometry, a, b, R, t, best):
    """Return the closest of `best` and the triangles of two leaves."""
    vertex, triangle, owns = geometry.vertex, geometry.triangle, geometry.triangle_owns
    normal = geometry.triangle_normal
    start_a, count_a = geometry.node_start[a], geometry.node_count[a]
    start_b, count_b = geometry.node_start[b], geometry.node_count[b]
    low_node, high_node = row(geometry.node_min, a), row(geometry.node_max, a)
    for j in range(start_b, start_b + count_b):
        q0 = moved(R, t, row(vertex, triangle[j, 0]))
        q1 = moved(R, t, row(vertex, triangle[j, 1]))
        q2 = moved(R, t, row(vertex, triangle[j, 2]))
        low_b, high_b = _triangle_box(q0, q1, q2)
        if _boxes_squared(low_node, high_node, low_b, high_b) >= best[0]:
            continue
        face_b = (q0, q1, q2, turned(R, row(normal, j)))
        # A sphere has no edge; the first side of its triangle, of no length, stands for its point.
        owns_b = owns[j] | (8 if triangle[j, 0] == triangle[j, 1] else 0)
        for i in range(start_a, start_a + count_a):
            p0, p1, p2 = row(vertex, triangle[i, 0]), row(vertex, triangle[i, 1]), row(vertex, triangle[i, 2])
            low_a, high_a = _triangle_box(p0, p1, p2)
            bound = _boxes_squared(low_a, high_a, low_b, high_b)
            if bound < best[0]:
                face_a = (p0, p1, p2, row(normal, i))
                owns_a = owns[i] | (8 if triangle[i, 0] == triangle[i, 1] else 0)
                best = _triangle_distance(owns_a, owns_b, face_a, face_b, bound == 0.0, best)
    return best


@jit_making_arrays
def round_round_gap(geometry, first, second, pose, limit, stack, out):
    """Return the least gap of two ROUND primitives, or `limit`, with `out` untouched, if it is not below.

    pose: `Pose` of the second body in the frame of the first; out[0:6]: a closest point of each surface in that frame;
    `stack`: scratch of at least `STACK_ROWS` rows. Crossing triangles have the distance 0 (gap minus both radii).
    """
    node_min, node_max, node_child, R, t = geometry.node_min, geometry.node_max, geometry.node_child, pose.R, pose.t
    reach = geometry.radius[first] + geometry.radius[second]
    skeleton = limit + reach
    if skeleton <= 0.0:
        return limit
    nowhere = (0.0, 0.0, 0.0)
    best = (skeleton * skeleton, nowhere, nowhere)
    bound = np.empty(STACK_ROWS)
    stack[0, 0] = geometry.node_first[first]
    stack[0, 1] = geometry.node_first[second]
    bound[0] = 0.0
    depth = 1
    while depth > 0:
        depth -= 1
        a, b = stack[depth, 0], stack[depth, 1]
        if bound[depth] >= best[0]:
            continue
        child_a, child_b = node_child[a], node_child[b]
        if child_a < 0 and child_b < 0:
            best = _leaf_distance(geometry, a, b, R, t, best)
            continue
        split_first = child_b < 0 or (
            child_a >= 0 and splits_first(row(node_min, a), row(node_max, a), row(node_min, b), row(node_max, b))
        )
        for side in range(2):
            a = child_a + side if split_first else a
            b = b if split_first else child_b + side
            squared = box_distance_squared(
                row(node_min, a), row(node_max, a), row(node_min, b), row(node_max, b), R, t, best[0]
            )
            place = depth + side
            if side == 1 and squared > bound[depth]:  # the nearer pair comes on top
                stack[place, 0], stack[place, 1], bound[place] = stack[depth, 0], stack[depth, 1], bound[depth]
                place = depth
            stack[place, 0], stack[place, 1], bound[place] = a, b, squared
        depth += 2
    if best[0] >= skeleton * skeleton:
        return limit
    distance = sqrt(best[0])
    for i in range(3):
        normal = (best[2][i] - best[1][i]) / distance if distance > 0.0 else 0.0
        out[i] = best[1][i] + geometry.radius[first] * normal
        out[3 + i] = best[2][i] - geometry.radius[second] * normal
    return distance - reach
