"""Kernels: what is refused when they are compiled, and that memory they make is freed."""

from __future__ import annotations

import resource

import numpy as np
import pytest
from numba.core.errors import NumbaError

from rigidimpulse.core.kernels import jit, jit_making_arrays


@jit_making_arrays
def _made(number):
    return np.full(number, 1.0)


@jit
def _makes(number):
    made = np.empty(number)
    return made[0]


@jit
def _gets(number):
    return _made(number)[0]


@jit
def _passes_on(pair):
    return pair


@jit_making_arrays
def _gets_often(number, times):
    total = 0.0
    for _ in range(times):
        total += _made(number)[0]
    return total


@pytest.mark.parametrize(("kernel", "arguments"), [(_makes, (3,)), (_gets, (3,)), (_passes_on, ((np.zeros(1), np.zeros(1)),))])
def test_kernels_that_would_never_free_an_array_are_refused(kernel, arguments) -> None:
    with pytest.raises(NumbaError):
        kernel(*arguments)


def test_arrays_that_kernels_make_are_freed() -> None:
    # 2,000 arrays of 0.8 MB are 1.6 GB if they are kept.
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert _gets_often(100_000, 2000) == 2000.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000
