"""Separation of two simplices (point, segment or triangle) along the direction of their closest features.

The direction of a vertex over a face is the normal of the face, that of two crossing edges their common normal: both come from the
surfaces, not from the difference of two close points, and stay exact however small the distance. Any other direction is the
difference of the closest points with its part along the edges in question taken out.

The separation along a unit direction n is min n.b - max n.a over the corners, a lower bound of the distance for every n, equal to the
distance for the direction of the closest features, and negative for simplices that cross.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.conventions import TOLERANCES
from rigidimpulse.detect.features import along, closest_on_segments, cross, dot, moved, over_triangle, row, subtract

CLOSEST_NORMAL, CLOSEST_FIRST, CLOSEST_SECOND = 0, 3, 6
CLOSEST_SIZE = 9
"""Offsets into the row of a closest pair: unit normal from first to second, point on the first, point on the second."""

NO_EDGES = -1
"""Returned in place of a pair of edges where the closest features are not two crossing edges."""

_CROSSING = 1e-4  # least sine of the angle of two edges whose common normal is taken from their directions
_EDGES_IN = (0, 0, 1, 3)  # edges of a simplex with 1, 2, 3 corners
_ROUND_OFF = TOLERANCES.round_off


@jit
def corner_count(geometry, triangle):
    """Corners of a stored triangle: 1 for a sphere (v, v, v), 2 for a capsule (a, b, b), else 3."""
    if geometry.triangle[triangle, 1] != geometry.triangle[triangle, 2]:
        return 3
    return 1 if geometry.triangle[triangle, 0] == geometry.triangle[triangle, 1] else 2


@jit
def load_corners(geometry, triangle, corners):
    """Copy the corners of a stored triangle; returns how many there are."""
    for k in range(3):
        for axis in range(3):
            corners[k, axis] = geometry.vertex[geometry.triangle[triangle, k], axis]
    return corner_count(geometry, triangle)


@jit
def load_turned_corners(geometry, triangle, rotation, offset, corners):
    """Copy the corners of a stored triangle, moved by R y + t; returns how many there are."""
    for k in range(3):
        moved_corner = moved(rotation, offset, row(geometry.vertex, geometry.triangle[triangle, k]))
        for axis in range(3):
            corners[k, axis] = moved_corner[axis]
    return corner_count(geometry, triangle)


@jit
def box_half_extent(geometry, node):
    """Half the size of the box of a node along its axes."""
    return (
        0.5 * (geometry.node_max[node, 0] - geometry.node_min[node, 0]),
        0.5 * (geometry.node_max[node, 1] - geometry.node_min[node, 1]),
        0.5 * (geometry.node_max[node, 2] - geometry.node_min[node, 2]),
    )


@jit
def box_centre(geometry, node):
    """Middle of the box of a node."""
    return (
        0.5 * (geometry.node_max[node, 0] + geometry.node_min[node, 0]),
        0.5 * (geometry.node_max[node, 1] + geometry.node_min[node, 1]),
        0.5 * (geometry.node_max[node, 2] + geometry.node_min[node, 2]),
    )


@jit
def highest(corners, count, normal):
    """Return max of normal . corner."""
    best = -np.inf
    for k in range(count):
        best = max(best, normal[0] * corners[k, 0] + normal[1] * corners[k, 1] + normal[2] * corners[k, 2])
    return best


@jit
def lowest(corners, count, normal):
    """Return min of normal . corner."""
    best = np.inf
    for k in range(count):
        best = min(best, normal[0] * corners[k, 0] + normal[1] * corners[k, 1] + normal[2] * corners[k, 2])
    return best


@jit
def _write_closest(normal, first, second, closest):
    for k in range(3):
        closest[CLOSEST_NORMAL + k] = normal[k]
        closest[CLOSEST_FIRST + k] = first[k]
        closest[CLOSEST_SECOND + k] = second[k]


@jit
def _without(v, direction):
    """Return v less its part along a direction."""
    square = dot(direction, direction)
    return along(v, -dot(v, direction) / square, direction) if square > 0.0 else v


@jit
def _direction_of_edges(edge_first, edge_second, between, s, t):
    """Unit normal from the first edge to the second, and whether both are met inside, crossing."""
    square = dot(between, between)
    inside_first, inside_second = 0.0 < s < 1.0, 0.0 < t < 1.0
    common = cross(edge_first, edge_second)
    size = dot(common, common)
    crossing = size > _CROSSING * _CROSSING * dot(edge_first, edge_first) * dot(edge_second, edge_second)
    if inside_first and inside_second and crossing:
        factor = (1.0 if dot(common, between) >= 0.0 else -1.0) / sqrt(size)
        return along((0.0, 0.0, 0.0), factor, common), True
    normal = along((0.0, 0.0, 0.0), 1.0 / sqrt(square), between) if square > 0.0 else (0.0, 0.0, 0.0)
    if inside_first:
        normal = _without(normal, edge_first)
    if inside_second:
        normal = _without(normal, edge_second)
    size = dot(normal, normal)
    return along((0.0, 0.0, 0.0), 1.0 / sqrt(size) if size > 0.0 else 0.0, normal), False


@jit
def _vertices_over_face(corners, count, face, normal, flip, best, closest):
    """Find the nearest corner that projects into a face; `flip`: the face belongs to the first simplex. Returns the distance."""
    a, b, c = row(face, 0), row(face, 1), row(face, 2)
    for k in range(count):
        p = row(corners, k)
        height = dot(subtract(p, a), normal)
        if abs(height) < best and over_triangle(p, a, b, c, normal, 0.0, 0.0, 0.0):
            best = abs(height)
            foot = along(p, -height, normal)
            up = 1.0 if (height >= 0.0) == flip else -1.0
            towards = along((0.0, 0.0, 0.0), up, normal)
            if flip:
                _write_closest(towards, foot, p, closest)
            else:
                _write_closest(towards, p, foot, closest)
    return best


@jit
def closest_simplices(first, num_first, normal_first, second, num_second, normal_second, closest):
    """Find the closest features of two simplices.

    Args:
        first: (3, 3) corners of the first simplex; the first num_first rows count.
        num_first: 1, 2 or 3 corners.
        normal_first: unit normal of the first simplex as a 3-tuple, read if it is a triangle.
        second: corners of the second simplex, in the same axes; likewise num_second, normal_second.
        closest: (CLOSEST_SIZE,) written: normal (zeros if the points coincide) and closest points.

    Returns:
        Separation along the normal, and 3 k + l for crossing edges k and l (edge k joins corners k and k + 1), else NO_EDGES.

    """
    edges = NO_EDGES
    best = np.inf
    if num_second == 3:
        best = _vertices_over_face(first, num_first, second, normal_second, False, best, closest)
    if num_first == 3:
        best = _vertices_over_face(second, num_second, first, normal_first, True, best, closest)
    for k in range(max(_EDGES_IN[num_first], 1)):
        p = row(first, k)
        d = subtract(row(first, (k + 1) % num_first), p)
        for j in range(max(_EDGES_IN[num_second], 1)):
            q = row(second, j)
            e = subtract(row(second, (j + 1) % num_second), q)
            s, t = closest_on_segments(p, d, q, e)
            on_first, on_second = along(p, s, d), along(q, t, e)
            between = subtract(on_second, on_first)
            distance = sqrt(dot(between, between))
            if distance < best * (1.0 - _ROUND_OFF):
                best = distance
                normal, crossing = _direction_of_edges(d, e, between, s, t)
                edges = 3 * k + j if crossing else NO_EDGES
                _write_closest(normal, on_first, on_second, closest)
    normal = (closest[0], closest[1], closest[2])
    return lowest(second, num_second, normal) - highest(first, num_first, normal), edges
