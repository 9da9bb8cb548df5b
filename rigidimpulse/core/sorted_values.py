"""Places in sorted arrays (kernels)."""

import numpy as np

from rigidimpulse.core.kernels import jit


@jit
def place_in(values, value):
    """Place of the first of ascending values (k,) that is not below `value`; k if all are."""
    low, high = np.int64(0), np.int64(values.shape[0])
    while low < high:
        middle = (low + high) // 2
        if values[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@jit
def is_among(values, value):
    """Whether a value is one of ascending values (k,)."""
    place = place_in(values, value)
    return place < values.shape[0] and values[place] == value
