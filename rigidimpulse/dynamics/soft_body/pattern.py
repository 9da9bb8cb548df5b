"""The fixed pattern of a soft body's matrices: 3 x 3 blocks in compressed rows, one row a vertex, both halves stored."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Pattern(NamedTuple):
    """Blocks of n vertices: row i has the blocks first[i] to first[i + 1], in columns `column`."""

    first: np.ndarray  # (n+1,)
    column: np.ndarray  # (b,)
    diagonal: np.ndarray  # (n,) place of the block ii
    spring_slot: np.ndarray  # (s, 4) places of the blocks ii, jj, ij, ji of each spring
    hinge_slot: np.ndarray  # (g, 16) places of the blocks of each hinge, by row


def build_pattern(num_vertices: int, spring: np.ndarray, hinge: np.ndarray) -> Pattern:
    """Return the pattern of springs (s, 2) and hinges (g, 4) over vertices 0 .. num_vertices - 1."""
    own = np.arange(num_vertices)
    i, j = spring.T
    spring_row, spring_column = np.column_stack([i, j, i, j]), np.column_stack([i, j, j, i])
    hinge_row, hinge_column = np.repeat(hinge, 4, axis=1), np.tile(hinge, (1, 4))
    keys = [own * num_vertices + own, spring_row * num_vertices + spring_column, hinge_row * num_vertices + hinge_column]
    unique = np.unique(np.concatenate([key.ravel() for key in keys]))
    first = np.searchsorted(unique, np.arange(num_vertices + 1) * num_vertices)
    diagonal, spring_slot, hinge_slot = (np.searchsorted(unique, key) for key in keys)
    return Pattern(first.astype(np.int64), unique % num_vertices, diagonal, spring_slot, hinge_slot)
