"""Least distance of two ROUND primitives.

The closest points of two sets of triangles that do not cross are a vertex and a point inside a face, or points of two edges
(their ends included). Each vertex and edge is owned by one triangle, so each pair is met once: about three tests for two
triangles instead of fifteen. Where boxes overlap, an edge of one that runs through a face of the other makes the distance 0.
Both box trees are walked nearest first; a pair of boxes farther apart than the best distance so far is left out.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse.detect.box_tree import STACK_ROWS, box_distance_squared, splits_first
from rigidimpulse.detect.features import (
    along,
    closest_on_segments,
    dot,
    inner,
    moved,
    over_triangle,
    pierces_triangle,
    row,
    subtract,
    turned,
)


@inner
def _keep_closer(best, p, q, out):
    """Keep p, q in out[0:6] if the square of their distance is below `best`; return the lesser square."""
    between = subtract(q, p)
    distance_squared = dot(between, between)
    if distance_squared >= best:
        return best
    for i in range(3):
        out[i] = p[i]
        out[3 + i] = q[i]
    return distance_squared


@inner
def _over_face(p, face, best):
    """Return (closer, foot): whether `p` lies over a face (a, b, c, normal), nearer than the root of `best`."""
    a, b, c, normal = face
    height = dot(subtract(p, a), normal)
    solid = dot(normal, normal) > 0.0  # not the point or segment of a sphere or a capsule
    closer = solid and height * height < best and over_triangle(p, a, b, c, normal, 0.0, 0.0, 0.0)
    return closer, along(p, -height, normal)


@inner
def _segment_ends(face, k):
    """Return the ends of side k of a face."""
    if k == 0:
        return face[0], face[1]
    if k == 1:
        return face[1], face[2]
    return face[2], face[0]


@inner
def _owned_segments(geometry, triangle):
    """Return the bits of the sides that a triangle owns; the first one for a sphere, a segment of no length."""
    if geometry.triangle[triangle, 0] == geometry.triangle[triangle, 1]:
        return 1
    return geometry.triangle_owns[triangle] >> 3


@inner
def _triangle_distance(geometry, triangle_a, triangle_b, face_a, face_b, may_cross, best, out):
    """Lower the squared distance `best`, with points in `out`, by the features that two triangles own."""
    owns_a = geometry.triangle_owns[triangle_a]
    owns_b = geometry.triangle_owns[triangle_b]
    for k in range(3):
        if owns_a >> k & 1:
            p = _segment_ends(face_a, k)[0]
            closer, foot = _over_face(p, face_b, best)
            if closer:
                best = _keep_closer(best, p, foot, out)
        if owns_b >> k & 1:
            p = _segment_ends(face_b, k)[0]
            closer, foot = _over_face(p, face_a, best)
            if closer:
                best = _keep_closer(best, foot, p, out)
    segments_a = _owned_segments(geometry, triangle_a)
    segments_b = _owned_segments(geometry, triangle_b)
    for k in range(3):
        if not segments_a >> k & 1:
            continue
        p, p_end = _segment_ends(face_a, k)
        d = subtract(p_end, p)
        if may_cross and pierces_triangle(p, p_end, face_b[0], face_b[1], face_b[2], face_b[3]):
            best = _keep_closer(best, p, p, out)
        for l in range(3):
            if segments_b >> l & 1:
                q, q_end = _segment_ends(face_b, l)
                e = subtract(q_end, q)
                s, t = closest_on_segments(p, d, q, e)
                best = _keep_closer(best, along(p, s, d), along(q, t, e), out)
    for l in range(3):
        if may_cross and segments_b >> l & 1:
            q, q_end = _segment_ends(face_b, l)
            if pierces_triangle(q, q_end, face_a[0], face_a[1], face_a[2], face_a[3]):
                best = _keep_closer(best, q, q, out)
    return best


@inner
def _boxes_squared(face_a, face_b):
    """Return the squared distance of the boxes of two triangles."""
    total = 0.0
    for k in range(3):
        low_a = min(face_a[0][k], face_a[1][k], face_a[2][k])
        high_a = max(face_a[0][k], face_a[1][k], face_a[2][k])
        low_b = min(face_b[0][k], face_b[1][k], face_b[2][k])
        high_b = max(face_b[0][k], face_b[1][k], face_b[2][k])
        total += max(0.0, low_a - high_b, low_b - high_a) ** 2
    return total


@inner
def _leaf_distance(geometry, a, b, R, t, best, out):
    """Lower the squared distance `best` by the triangles of two leaves."""
    for triangle_b in range(geometry.node_start[b], geometry.node_start[b] + geometry.node_count[b]):
        face_b = (
            moved(R, t, row(geometry.vertex, geometry.triangle[triangle_b, 0])),
            moved(R, t, row(geometry.vertex, geometry.triangle[triangle_b, 1])),
            moved(R, t, row(geometry.vertex, geometry.triangle[triangle_b, 2])),
            turned(R, row(geometry.triangle_normal, triangle_b)),
        )
        for triangle_a in range(geometry.node_start[a], geometry.node_start[a] + geometry.node_count[a]):
            face_a = (
                row(geometry.vertex, geometry.triangle[triangle_a, 0]),
                row(geometry.vertex, geometry.triangle[triangle_a, 1]),
                row(geometry.vertex, geometry.triangle[triangle_a, 2]),
                row(geometry.triangle_normal, triangle_a),
            )
            bound = _boxes_squared(face_a, face_b)
            if bound < best:
                best = _triangle_distance(
                    geometry, triangle_a, triangle_b, face_a, face_b, bound == 0.0, best, out
                )
    return best


@inner
def round_round_gap(geometry, first, second, R, t, limit, stack, out):
    """Return the least gap of two ROUND primitives, or `limit`, with `out` untouched, if it is not below.

    R, t: pose of the second body in the frame of the first; out[0:6]: a closest point of each surface in that frame;
    `stack`: scratch of at least `STACK_ROWS` rows. Crossing triangles have the distance 0 (gap minus both radii).
    """
    radius_a = geometry.radius[first]
    radius_b = geometry.radius[second]
    core = limit + radius_a + radius_b
    if core <= 0.0:
        return limit
    best = core * core
    bound = np.empty(STACK_ROWS)
    points = np.empty(6)
    stack[0, 0] = geometry.node_first[first]
    stack[0, 1] = geometry.node_first[second]
    bound[0] = box_distance_squared(geometry, stack[0, 0], stack[0, 1], R, t)
    depth = 1
    while depth > 0:
        depth -= 1
        a = stack[depth, 0]
        b = stack[depth, 1]
        if bound[depth] >= best:
            continue
        if geometry.node_child[a] < 0 and geometry.node_child[b] < 0:
            best = _leaf_distance(geometry, a, b, R, t, best, points)
            continue
        split_first = splits_first(geometry, a, b)
        for side in range(2):
            stack[depth + side, 0] = geometry.node_child[a] + side if split_first else a
            stack[depth + side, 1] = b if split_first else geometry.node_child[b] + side
            bound[depth + side] = box_distance_squared(geometry, stack[depth + side, 0], stack[depth + side, 1], R, t)
        if bound[depth] < bound[depth + 1]:  # the nearer pair on top
            for column in range(2):
                stack[depth, column], stack[depth + 1, column] = stack[depth + 1, column], stack[depth, column]
            bound[depth], bound[depth + 1] = bound[depth + 1], bound[depth]
        depth += 2
    if best >= core * core:
        return limit
    distance = sqrt(best)
    for i in range(3):
        normal = (points[3 + i] - points[i]) / distance if distance > 0.0 else 0.0
        out[i] = points[i] + radius_a * normal
        out[3 + i] = points[3 + i] - radius_b * normal
    return distance - radius_a - radius_b
