"""Rows of a chain on ball joints that touches the world, and what is left of their laws."""

from __future__ import annotations

import numpy as np

from rigidimpulse.dynamics.constraints.rows import BOUNDED, DISC, DISC_SECOND, Rows, make_rows
from rigidimpulse.dynamics.solvers.newton import natural_residual, row_weights, velocities_from_impulses


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
