"""Edges of a set of triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class UniqueEdges(NamedTuple):
    """Edges of a set of triangles; half edge 3 t + k runs from vertex k to vertex (k + 1) % 3 of triangle t."""

    first: np.ndarray  # (e,) first half edge of each edge
    last: np.ndarray  # (e,) last half edge of each edge
    count: np.ndarray  # (e,) number of half edges
    balance: np.ndarray  # (e,) half edges that run one way minus those that run the other way
    triangle_edge: np.ndarray  # (t, 3) edge of each half edge


def unique_edges(triangle: np.ndarray, num_vertices: int) -> UniqueEdges:
    """Find the edges of triangles (t, 3) over vertices 0 .. num_vertices - 1."""
    tail = triangle.ravel()
    head = np.roll(triangle, -1, axis=1).ravel()
    key = np.minimum(tail, head) * num_vertices + np.maximum(tail, head)
    _, first, inverse, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    inverse = inverse.ravel()
    last = np.empty_like(first)
    last[inverse] = np.arange(len(key))  # later half edges overwrite earlier ones
    balance = np.bincount(inverse, weights=np.where(tail < head, 1, -1), minlength=len(first))
    return UniqueEdges(first, last, count, balance, inverse.reshape(-1, 3))
