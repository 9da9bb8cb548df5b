"""Arrays of zeros of which only the pages that are touched take memory.

Those of numpy nearly do that, too. But of large ones it asks for pages of 2 MB, of which a few scattered rows fill many.
"""

from __future__ import annotations

import math
from mmap import ACCESS_COPY, mmap

import numpy as np
from numpy.typing import DTypeLike


def reserve(shape: tuple[int, ...], dtype: DTypeLike) -> np.ndarray:
    """Return zeros of a shape, which begin at a page of memory."""
    kind, count = np.dtype(dtype), math.prod(shape)
    memory = mmap(-1, max(count * kind.itemsize, 1), access=ACCESS_COPY)
    return np.frombuffer(memory, kind, count).reshape(shape)
