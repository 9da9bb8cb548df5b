"""Arrays of zeros: rows of records for kernels, and arrays of which only the pages that are touched take memory.

Those of numpy nearly do the latter, too. But of large ones it asks for pages of 2 MB, of which a few scattered rows fill many.
"""

from __future__ import annotations

import math
from mmap import ACCESS_COPY, mmap

import numpy as np
from numpy.typing import DTypeLike

from rigidimpulse.core.kernels import INTERPRETED


def rows_of(count: int, dtype: np.dtype) -> np.ndarray:
    """Return zeroed rows (count,) of a structured dtype for kernels, which write row.field.

    Where kernels run as the Python they are written in, numpy must understand that, too.
    """
    rows = np.zeros(count, dtype)
    return rows.view(np.recarray) if INTERPRETED else rows


def longer(rows: np.ndarray, count: int) -> np.ndarray:
    """Return the same rows with `count` zeroed ones behind them."""
    out = rows_of(len(rows) + count, rows.dtype)
    out[: len(rows)] = rows
    return out


def reserve(shape: tuple[int, ...], dtype: DTypeLike) -> np.ndarray:
    """Return zeros of a shape, which begin at a page of memory."""
    kind, count = np.dtype(dtype), math.prod(shape)
    memory = mmap(-1, max(count * kind.itemsize, 1), access=ACCESS_COPY)
    return np.frombuffer(memory, kind, count).reshape(shape)
