"""Separation of two simplices (point, segment or triangle) along the direction of their closest features.

The direction of a vertex over a face is the normal of the face, that of two crossing edges their common normal: both
come from the surfaces, not from the difference of two close points, and stay exact however small the distance. Any
other direction is the difference of the closest points with its part along the edges in question taken out.

The separation along a unit direction n is min n.b - max n.a over the corners, a lower bound of the distance for every
n, equal to the distance for the direction of the closest features, and negative for simplices that cross.
"""

from __future__ import annotations

from math import inf, sqrt

from rigidimpulse.collision.distance.simplices import closest_on_segments, over_triangle
from rigidimpulse.collision.time_of_impact.motion_bound import put, vector
from rigidimpulse.collision.time_of_impact.scratch_layout import CORNER, COUNT, FACE, NORMAL, POINT_FIRST, POINT_SECOND
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, length, scaled, subtract

NO_EDGES = -1
"""In place of a pair of edges where the closest features are not two crossing edges."""

_CROSSING = TOLERANCES.time_of_impact.crossing_edges
_ROUND_OFF = TOLERANCES.arithmetic.round_off


@jit
def farthest(work, corners, count, normal):
    """Return max of normal . corner over `count` neighbouring points."""
    best = -inf
    for k in range(count):
        best = max(best, dot(normal, vector(work, corners + 3 * k)))
    return best


@jit
def _without(v, direction, is_inside):
    """Return v less its part along a direction, if `is_inside`."""
    square = dot(direction, direction)
    return along(v, -dot(v, direction) / square, direction) if is_inside and square > 0.0 else v


@jit
def _direction_of_edges(edge_first, edge_second, between, s, t):
    """Unit normal from the first edge to the second, and whether both are met inside, crossing."""
    inside_first, inside_second = 0.0 < s < 1.0, 0.0 < t < 1.0
    normal = cross(edge_first, edge_second)
    square = dot(normal, normal)
    crossing = square > _CROSSING * _CROSSING * dot(edge_first, edge_first) * dot(edge_second, edge_second)
    crossing = crossing and inside_first and inside_second
    if not crossing:
        normal = _without(_without(between, edge_first, inside_first), edge_second, inside_second)
        square = dot(normal, normal)
    factor = 1.0 / sqrt(square) if square > 0.0 else 0.0
    return scaled(normal, factor if dot(normal, between) >= 0.0 else -factor), crossing


@jit
def closest_simplices(work, index, closest):
    """Find the closest features of the two simplices at CORNER and FACE in `work`, with the counts at COUNT in `index`.

    Writes points and normal (zeros if the points coincide) to the record at `closest`.

    Returns:
        Separation along the normal, and 3 k + l for crossing edges k and l (edge k joins corners k and k + 1), else
        NO_EDGES.

    """
    edges = NO_EDGES
    best = inf
    num_first, num_second = index[COUNT], index[COUNT + 1]
    for side in range(2):
        if index[COUNT + side] < 3:
            continue
        corners, others = CORNER + 9 * side, CORNER + 9 - 9 * side
        a, normal = vector(work, corners), vector(work, FACE + 3 * side)
        for k in range(index[COUNT + 1 - side]):
            p = vector(work, others + 3 * k)
            height = dot(subtract(p, a), normal)
            # A vertex over a face: the normal of the face is exact however small the height is.
            if abs(height) < best and over_triangle(
                p, a, vector(work, corners + 3), vector(work, corners + 6), normal, 0.0, 0.0, 0.0
            ):
                best = abs(height)
                put(work, closest + (POINT_SECOND if side == 0 else POINT_FIRST), p)
                put(work, closest + (POINT_FIRST if side == 0 else POINT_SECOND), along(p, -height, normal))
                put(work, closest + NORMAL, scaled(normal, 1.0 if (height >= 0.0) == (side == 0) else -1.0))
    for k in range(3 if num_first == 3 else 1):
        p = vector(work, CORNER + 3 * k)
        d = subtract(vector(work, CORNER + 3 * ((k + 1) % num_first)), p)
        for j in range(3 if num_second == 3 else 1):
            q = vector(work, CORNER + 9 + 3 * j)
            e = subtract(vector(work, CORNER + 9 + 3 * ((j + 1) % num_second)), q)
            s, t = closest_on_segments(p, d, q, e)
            on_first, on_second = along(p, s, d), along(q, t, e)
            between = subtract(on_second, on_first)
            distance = length(between)
            # A tie keeps the vertex over a face, whose normal is exact.
            if distance < best * (1.0 - _ROUND_OFF):
                best = distance
                normal, crossing = _direction_of_edges(d, e, between, s, t)
                edges = 3 * k + j if crossing else NO_EDGES
                put(work, closest + POINT_FIRST, on_first)
                put(work, closest + POINT_SECOND, on_second)
                put(work, closest + NORMAL, normal)
    normal = vector(work, closest + NORMAL)
    top = farthest(work, CORNER, num_first, normal)
    return -farthest(work, CORNER + 9, num_second, scaled(normal, -1.0)) - top, edges
