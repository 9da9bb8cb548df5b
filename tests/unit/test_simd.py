"""Vectors of lanes in kernels against numpy, bit for bit, at every width."""

from __future__ import annotations

import numpy as np
import pytest

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.simd import ROW, Simd, aligned, fma, gather, load, root, scatter, spread, store, where_greater, width_of


@jit
def _mix_rows(simd, rows, index, out):
    for first in range(0, index.shape[0], width_of(simd)):
        a = gather(simd, rows, index, first)
        two = spread(simd, 2.0)
        mixed = (a[0] + a[1], a[0] - a[1], a[2] * a[3], a[2] / a[3], -a[4], root(a[5]), where_greater(a[6], two, a[6], two), a[7])
        scatter(out, index, first, mixed)


@jit
def _multiply_add(simd, a, b, c, out):
    for first in range(0, a.shape[0], width_of(simd)):
        store(out, first, fma(load(simd, a, first), load(simd, b, first), load(simd, c, first)))


@pytest.mark.parametrize("width", [2, 4, 8])
def test_rows_and_arithmetic(width):
    # A lane or a column that is mixed up gives another row's numbers: all of order 1.
    random = np.random.default_rng(0)
    rows, out = aligned(32), aligned(32)
    assert rows.ctypes.data % 64 == 0
    rows[:] = random.uniform(1.0, 3.0, rows.shape)
    index = random.permutation(32)[:24].astype(np.int32)
    _mix_rows(Simd(width), rows, index, out)
    a, got = rows.reshape(-1, ROW), out.reshape(-1, ROW)
    expected = np.zeros_like(a)
    x = a[index].T
    expected[index] = np.stack([x[0] + x[1], x[0] - x[1], x[2] * x[3], x[2] / x[3], -x[4], np.sqrt(x[5]), np.maximum(x[6], 2.0), x[7]], 1)
    np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("width", [2, 4, 8])
def test_multiply_add_rounds_once(width):
    # (1 + e)(1 - e) - 1 = -e^2: rounded twice it is 0.
    e = np.ldexp(1.0, -np.arange(27, 43))
    out = np.zeros(16)
    _multiply_add(Simd(width), 1.0 + e, 1.0 - e, np.full(16, -1.0), out)
    np.testing.assert_array_equal(out, -(e**2))
