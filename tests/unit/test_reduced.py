"""The start of Newton's method with joints eliminated: near the answer, and never another answer."""

from __future__ import annotations

import numpy as np
import pytest
from chain_rows import chain_with_contacts, residual_and_velocities

from rigidimpulse.dynamics.solvers.free_rows import factor_free
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.dynamics.solvers.reduced import MOST_ROWS_A_BODY, start_without_joints

TARGET = 1e-9


@pytest.mark.parametrize("softness", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(8))
def test_the_start_is_near_the_answer_and_leads_to_it(seed: int, softness: float) -> None:
    """What is left is at most 1e-4 of what was; Newton's method comes from there to the velocities that it finds from nothing."""
    bodies, contacts = 8, 4
    rows, cold = (chain_with_contacts(seed, bodies, contacts, softness) for _ in range(2))
    before, _ = residual_and_velocities(rows, bodies)
    assert start_without_joints(rows, factor_free(rows, bodies), TARGET) >= 2
    after, _ = residual_and_velocities(rows, bodies)
    assert after < 1e-4 * before
    assert solve_newton(rows, bodies, TARGET) <= TARGET
    assert solve_newton(cold, bodies, TARGET) <= TARGET
    np.testing.assert_allclose(residual_and_velocities(rows, bodies)[1], residual_and_velocities(cold, bodies)[1], atol=1e-6)


def test_joints_alone_are_solved_at_once() -> None:
    """What is left is 1e-9, the regularisation, times what joints hang on each other, of what was."""
    rows = chain_with_contacts(0, 5, 0)
    before, _ = residual_and_velocities(rows, 5)
    assert start_without_joints(rows, factor_free(rows, 5), TARGET) == 0
    assert residual_and_velocities(rows, 5)[0] < 1e-6 * before


def test_rows_that_are_too_many_are_left_alone() -> None:
    """More than MOST_ROWS_A_BODY rows a body cost more than they save."""
    rows = chain_with_contacts(0, 2, MOST_ROWS_A_BODY)
    assert start_without_joints(rows, factor_free(rows, 2), TARGET) == 0
    assert not rows.impulse.any()
