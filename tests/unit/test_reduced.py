"""The start of Newton's method with joints eliminated: near the answer, and never another answer."""

from __future__ import annotations

import numpy as np
import pytest

from rigidimpulse.dynamics.constraints.rows import BOUNDED, DISC, DISC_SECOND, Rows, make_rows
from rigidimpulse.dynamics.solvers.free_rows import factor_free
from rigidimpulse.dynamics.solvers.newton import natural_residual, row_weights, solve_newton, velocities_from_impulses
from rigidimpulse.dynamics.solvers.reduced import MOST_ROWS_A_BODY, start_without_joints

TARGET = 1e-9


def chain_with_contacts(seed: int, bodies: int, contacts: int, softness: float = 0.0) -> Rows:
    """A chain on ball joints, hard or soft, with contacts (normal, two of friction) with the world, moving at about 1 m/s."""
    random = np.random.default_rng(seed)
    rows = make_rows(3 * (contacts + bodies - 1))
    rows.bias[:] = random.normal(size=len(rows.bias))
    for c in range(contacts):
        i = 3 * c
        rows.second[i : i + 3] = random.integers(bodies)
        # A contact at an arm of half a metre of a body whose radius of gyration is that long.
        turn, arm = np.linalg.qr(random.normal(size=(3, 3)))[0], random.normal(size=3)
        rows.jacobian[i : i + 3, 6:9], rows.jacobian[i : i + 3, 9:12] = turn, np.cross(arm / np.linalg.norm(arm), turn)
        rows.kind[i : i + 3], rows.lower[i] = (BOUNDED, DISC, DISC_SECOND), 0.0
        rows.master[i + 1 : i + 3], rows.coefficient[i + 1 : i + 3] = i, 0.5
    for k in range(bodies - 1):
        i = 3 * (contacts + k)
        rows.first[i : i + 3], rows.second[i : i + 3], rows.softness[i : i + 3] = k, k + 1, softness
        for side, sign in ((0, -1.0), (6, 1.0)):
            rows.jacobian[i : i + 3, side : side + 3] = sign * np.eye(3)
            rows.jacobian[i : i + 3, side + 3 : side + 6] = sign * np.cross(random.normal(size=3), np.eye(3))
    return rows


def residual_and_velocities(rows: Rows, bodies: int) -> tuple[float, np.ndarray]:
    """What is left of the laws of the rows, m/s, and y (n, 6): the change of velocities."""
    y, u, weight = np.zeros((bodies, 6)), np.zeros(len(rows.bias)), np.zeros(len(rows.bias))
    velocities_from_impulses(rows, rows.impulse, y, u)
    row_weights(rows, weight)
    return natural_residual(rows, u, rows.impulse, weight), y


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
