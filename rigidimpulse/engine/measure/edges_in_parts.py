"""How deep edges of a shape are in the convex parts of another one (kernels); the check of a run asks nobody else.

The height of the point p + s (q - p) of an edge above a face n.x = d is  a + s (b - a),  a = n.p - d,  b = n.q - d. Behind all faces the
edge is for s between

    the largest -a / (b - a) of the faces with b < a, and 0      and      the least of those with b > a, and 1.

Its depth there is the least depth behind a face: a concave function of s. So its value at the ends and in the middle is at least half its
largest one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.vector import moved


class Parts(NamedTuple):
    """Convex parts of a shape, in its frame."""

    planes: np.ndarray  # (m, 4) outward normals and offsets of all
    first: np.ndarray  # (k+1,) where those of each part begin
    boxes: np.ndarray  # (k, 2, 3) m, lowest and highest corner of each
    whole: np.ndarray  # (2, 3) m, of all


def parts_of(planes: list[np.ndarray], boxes: list[np.ndarray]) -> Parts:
    """Parts with these planes (m, 4) and boxes (2, 3)."""
    if not planes:
        return Parts(np.zeros((0, 4)), np.zeros(1, np.int64), np.zeros((0, 2, 3)), np.zeros((2, 3)))
    corners = np.array(boxes)
    whole = np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
    return Parts(np.vstack(planes), np.cumsum([0, *map(len, planes)]), corners, whole)


@inlined
def _meets(p, q, box):
    """Whether the box of an edge meets a box (2, 3)."""
    for k in range(3):
        if max(p[k], q[k]) < box[0, k] or min(p[k], q[k]) > box[1, k]:
            return False
    return True


@inlined
def _height(planes, f, p):
    """Height of a point above face f, m."""
    return planes[f, 0] * p[0] + planes[f, 1] * p[1] + planes[f, 2] * p[2] - planes[f, 3]


@jit
def _depth_of_edge(planes, first, last, p, q):
    """Depth of the edge from p to q behind the faces from `first` to `last`, m, 0 where it is not behind all of them; see the head."""
    begin, end, depth = 0.0, 1.0, 0.0
    for f in range(first, last):
        a, b = _height(planes, f, p), _height(planes, f, q)
        if b < a:
            begin = max(begin, -a / (b - a))
        elif b > a:
            end = min(end, -a / (b - a))
        if begin > end or (a > 0.0 and b > 0.0):
            return 0.0
    for place in (begin, 0.5 * (begin + end), end):
        highest = -np.inf
        for f in range(first, last):
            a = _height(planes, f, p)
            highest = max(highest, a + place * (_height(planes, f, q) - a))
        depth = max(depth, -highest)
    return depth


@jit
def enter_with_edges(parts, edges, rotation, translation, depth):
    """Raise depths (c,) m to those of edges (e, 2, 3) at c poses, rotation (c, 3, 3) and translation (c, 3), in the frame of `Parts`."""
    for c in range(depth.shape[0]):
        for e in range(edges.shape[0]):
            p, q = moved(rotation[c], translation[c], edges[e, 0]), moved(rotation[c], translation[c], edges[e, 1])
            if not _meets(p, q, parts.whole):
                continue
            for k in range(parts.boxes.shape[0]):
                # Few edges are near a part: all with all took most of the time of a run.
                if _meets(p, q, parts.boxes[k]):
                    depth[c] = max(depth[c], _depth_of_edge(parts.planes, parts.first[k], parts.first[k + 1], p, q))
