"""Faces of convex polyhedra: triangles of one plane are one face, whose corners go around it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from rigidimpulse.core.portable import dot

ONE_PLANE: float = 1e-10
"""By how much less than 1 the cosine between the normals of triangles of one plane may be."""


def faces(normals: np.ndarray, triangles: np.ndarray) -> list[tuple[np.ndarray, list[int]]]:
    """Unit normals and corners, counter-clockwise from outside, of the faces that triangles (f, 3) with normals (f, 3) make.

    A face has the normal of its first triangle. Faces come in the order of those.
    """
    # |n - m|^2 = 2 (1 - n.m). Triangles with no other of their plane, most of a smooth hull, are done without a search.
    near = KDTree(normals).query_pairs(1.01 * (2.0 * ONE_PLANE) ** 0.5, output_type="ndarray")
    neighbours: dict[int, list[int]] = {}
    for first, second in near.tolist():
        neighbours.setdefault(first, []).append(second)
        neighbours.setdefault(second, []).append(first)
    turn = np.argmin(triangles, axis=1)
    turned = triangles[np.arange(len(triangles))[:, None], (turn[:, None] + np.arange(3)) % 3].tolist()
    taken, out = np.zeros(len(normals), bool), []
    for k, alone in enumerate(turned):
        if taken[k]:
            continue
        plane = [k]
        if k in neighbours:
            others = np.array(sorted(neighbours[k]))
            plane += others[~taken[others] & (dot(normals[others], normals[k]) > 1.0 - ONE_PLANE)].tolist()
            taken[plane] = True
        out.append((normals[k], alone if len(plane) == 1 else _loop(triangles[plane].tolist())))
    return out


def _loop(triangles: list[list[int]]) -> list[int]:
    """Corners of the polygon that triangles of one plane make, in order."""
    halves = {(t[k], t[(k + 1) % 3]) for t in triangles for k in range(3)}
    following = {tail: head for tail, head in halves if (head, tail) not in halves}
    start = min(following)
    loop, v = [start], following[start]
    while v != start:
        loop.append(v)
        v = following[v]
    return loop
