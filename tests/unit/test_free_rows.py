"""FREE rows solved directly: their velocities vanish, and the factors of all rows serve for the FREE ones alone."""

from __future__ import annotations

import numpy as np
import pytest
from chain_rows import chain_with_contacts, residual_and_velocities

from rigidimpulse.dynamics.constraints.rows import FREE, take_rows
from rigidimpulse.dynamics.solvers.free_rows import FreeRows, count_free, factor_free, give, take_free


def closed(free: FreeRows, bodies: int, seed: int) -> tuple[float, np.ndarray]:
    """Solve the joints of a chain with contacts by these factors; returns what is left of their velocities, of what was, and y (n, 6)."""
    rows = chain_with_contacts(seed, bodies, contacts=3)
    joints = take_rows(rows, np.flatnonzero(rows.kind == FREE))
    before, _ = residual_and_velocities(joints, bodies)
    give(joints, free, joints.bias, np.empty(len(joints.bias)), np.empty((bodies, 6)))
    after, y = residual_and_velocities(joints, bodies)
    return after / before, y


@pytest.mark.parametrize("seed", range(6))
def test_factors_of_all_rows_serve_for_joints_alone(seed: int) -> None:
    """Contacts have no part in A: both ways leave 1e-9, the regularisation, times what joints hang on each other."""
    bodies = 9
    rows = chain_with_contacts(seed, bodies, contacts=3)
    which = np.flatnonzero(rows.kind == FREE)
    assert count_free(rows) == len(which) == 3 * (bodies - 1)
    left, y = closed(take_free(factor_free(rows, bodies), which), bodies, seed)
    left_alone, y_alone = closed(factor_free(take_rows(rows, which), bodies), bodies, seed)
    assert max(left, left_alone) < 1e-6
    np.testing.assert_allclose(y, y_alone, atol=1e-6 * np.abs(y).max())
