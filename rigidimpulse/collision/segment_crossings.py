"""How often does a segment cross a surface?

The segment from p to q crosses the triangle a, b, c where p and q are on different sides of its plane, and the line through both passes
all three sides on the same hand:

    [a, b, c, x] = (a - x) . ((b - x) x (c - x))

    [a, b, c, p] [a, b, c, q] < 0,    [p, q, a, b], [p, q, b, c], [p, q, c, a]  of one sign

A segment through an edge or a corner counts for any of the triangles there, or for none: choose ends that are in no line with them.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.distance.simplices import inner
from rigidimpulse.collision.geometry import Geometry
from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.core.vector import cross, dot, row, subtract

_STACK_SIZE = 128  # a tree of leaves holding at least one triangle is less deep


def crossings(geometry: Geometry, primitive: int, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Numbers (k,) of crossings of segments from `begin` to `end` (k, 3) m, in the shape's frame, with the surface of a primitive."""
    count = np.zeros(len(begin), np.int64)
    _count_crossings(geometry, primitive, np.ascontiguousarray(begin), np.ascontiguousarray(end), count)
    return count


@jit_making_arrays
def _count_crossings(geometry, primitive, begin, end, count):
    """Write how often each segment crosses the surface to `count` (k,)."""
    stack = np.empty(_STACK_SIZE, np.int64)
    for k in range(begin.shape[0]):
        p, q = row(begin, k), row(end, k)
        stack[0] = geometry.node_first[primitive]
        depth = 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if _is_beside(geometry.node_min[node], geometry.node_max[node], p, q):
                continue
            child = geometry.node_child[node]
            if child >= 0:
                stack[depth] = child
                stack[depth + 1] = child + 1
                depth += 2
                continue
            first = geometry.node_start[node]
            for t in range(first, first + geometry.node_count[node]):
                corners = geometry.triangle[t]
                a, b, c = row(geometry.vertex, corners[0]), row(geometry.vertex, corners[1]), row(geometry.vertex, corners[2])
                if _crosses(p, q, a, b, c):
                    count[k] += 1


@inner
def _is_beside(low, high, p, q):
    """Say whether the box around a segment is apart from another one."""
    for k in range(3):
        if max(p[k], q[k]) < low[k] or min(p[k], q[k]) > high[k]:
            return True
    return False


@inner
def _volume(a, b, c, x):
    """[a, b, c, x] of the head of the file."""
    return dot(subtract(a, x), cross(subtract(b, x), subtract(c, x)))


@inner
def _crosses(p, q, a, b, c):
    """Say whether the segment from p to q crosses the triangle a, b, c."""
    if _volume(a, b, c, p) * _volume(a, b, c, q) >= 0.0:
        return False
    first, second, third = _volume(p, q, a, b), _volume(p, q, b, c), _volume(p, q, c, a)
    return (first > 0.0 and second > 0.0 and third > 0.0) or (first < 0.0 and second < 0.0 and third < 0.0)
