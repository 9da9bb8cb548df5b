"""The normal impulse of one contact point of the sub-stepped solver, by its law (see the head of `tgs_soft.solver`).

    gap s > 0:   p = max(0, -m (u_n + s / h)): free to close the gap, no further
    gap s <= 0:  p = max(0, -m k (u_n + s c) - i p_old): a spring pushes out, at rest by -m k c s > 0

With the wrong sign of the bias a contact that has sunk would be drawn in, and one that is open would be stopped too early.
"""

from __future__ import annotations

import numpy as np
import pytest

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.simd import Simd, load, spread, store
from rigidimpulse.dynamics.solvers.tgs_soft.passes import _press
from rigidimpulse.dynamics.solvers.tgs_soft.records import MASS, POINT_SIZE, PRESS

WIDTH = 2
H, STIFF, HARD, SOFT, DEEPEST = 0.01, 3.0, 0.8, 0.2, 10.0
M, OLD = 2.0, 0.5


@jit
def press(simd, record, gap, speed):
    """Write the impulse of the only contact point into a record, and its change into gap; gap [m] and speed [m/s]: (2,)."""
    stiff, hard, soft, deepest = spread(simd, STIFF), spread(simd, HARD), spread(simd, SOFT), spread(simd, DEEPEST)
    old, new = _press(simd, record, 0, load(simd, speed, 0), load(simd, gap, 0), False, spread(simd, 1.0 / H), (stiff, hard, soft, deepest))
    store(record, PRESS * WIDTH, new)
    store(gap, 0, new - old)


@pytest.mark.parametrize(("gap", "speed", "expected"), [
    (0.02, -1.0, 0.0),
    (0.02, -3.0, M * (3.0 - 0.02 / H)),
    (-0.02, 0.0, M * HARD * 0.02 * STIFF + (1.0 - SOFT) * OLD),
    (-0.02, -1.0, M * HARD * (1.0 + 0.02 * STIFF) + (1.0 - SOFT) * OLD),
])  # fmt: skip
def test_an_open_contact_may_close_and_a_sunk_one_is_pushed_out(gap: float, speed: float, expected: float) -> None:
    record, gaps = np.zeros(POINT_SIZE * WIDTH), np.full(WIDTH, gap)
    old = OLD if gap < 0.0 else 0.0
    record[MASS * WIDTH : (MASS + 1) * WIDTH], record[PRESS * WIDTH : (PRESS + 1) * WIDTH] = M, old
    press(Simd(WIDTH), record, gaps, np.full(WIDTH, speed))
    np.testing.assert_allclose(record[PRESS * WIDTH : (PRESS + 1) * WIDTH], expected, rtol=1e-12)
    np.testing.assert_allclose(gaps, expected - old, rtol=1e-12, atol=1e-15)
