"""Rolling and spinning friction of contacts that last.

A contact that presses with N resists the relative rotation w = w_b - w_a of its bodies by a moment of up to

    |M_t| <= b N   about axes in the tangent plane, against w_t    (rolling: the contact force moves ahead by b)
    |M_n| <= s N   about the normal, against w_n                   (spinning: s = 2/3 mu R of a disc of contact of radius R)

b, s in m (Coulomb 1785 for rolling; Leine & van de Wouw 2008 for both as set-valued laws). They are rows of the kinds
DISC and SEGMENT whose master is the contact's normal. With L the longest lever of the contact the rows hold L t, so
that their velocity L w is that of a point and b / L is the coefficient. Contacts without friction have none, impacts
have none: for a finite moment an impact is too short.

Where a roll or a spin stops the sub-step ends, as it does for a slip (`resting`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.dynamics.constraints.rows import DISC, DISC_SECOND, SEGMENT, write_body
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState


class Rolling(NamedTuple):
    """Rolling and spinning friction of m contacts."""

    rolling: np.ndarray  # (m,) b, m
    spinning: np.ndarray  # (m,) s, m
    lever: np.ndarray  # (m,) L, m


def rolling_of(world: World, bodies: BodyState, contacts: Contacts) -> Rolling | None:
    """Of the given contacts; None where no material asks for any."""
    if world.rolling is None or not len(contacts.gap):
        return None
    pair = world.rolling[world.material_of_body[contacts.body_a], world.material_of_body[contacts.body_b]]
    pair = np.where(contacts.static_friction[:, None] > 0.0, pair, 0.0)
    if not pair.any():
        return None
    lever_a = np.where(bodies.inv_mass[contacts.body_a] > 0.0, np.linalg.norm(contacts.arm_a, axis=1), 0.0)
    lever_b = np.where(bodies.inv_mass[contacts.body_b] > 0.0, np.linalg.norm(contacts.arm_b, axis=1), 0.0)
    return Rolling(pair[:, 0].copy(), pair[:, 1].copy(), np.maximum(lever_a, lever_b))


def count_rolling_rows(rolling: Rolling | None) -> int:
    """Rows that `fill_rolling_rows` will fill."""
    return 0 if rolling is None else int(2 * np.sum(rolling.rolling > 0.0) + np.sum(rolling.spinning > 0.0))


@jit
def fill_rolling_rows(problem, rolling, h, of_contacts, start):
    """Fill the rows from `start` on, with the velocities L t.w that they would have after h without moments.

    problem: a `ContactProblem`; of_contacts: `ContactRows`.
    """
    bodies, contacts, number = problem.bodies, problem.contacts, problem.number
    rows, first_row, frames = of_contacts.rows, of_contacts.first_row, of_contacts.frames
    i = start
    for c in range(first_row.shape[0]):
        lever = rolling.lever[c]
        for k in range(3):
            bound = rolling.spinning[c] if k == 0 else rolling.rolling[c]
            if not bound > 0.0:
                continue
            a, b = contacts.body_a[c], contacts.body_b[c]
            # The row holds L t, so that its velocity L w is comparable with the speeds of points.
            x, y, z = lever * frames[c, k, 0], lever * frames[c, k, 1], lever * frames[c, k, 2]
            if bodies.inv_mass[a] > 0.0:
                rows.first[i] = number[a]
                write_body(bodies, a, rows.jacobian[i, :6], (0.0, 0.0, 0.0), (-x, -y, -z))
            if bodies.inv_mass[b] > 0.0:
                rows.second[i] = number[b]
                write_body(bodies, b, rows.jacobian[i, 6:], (0.0, 0.0, 0.0), (x, y, z))
            rows.kind[i] = SEGMENT if k == 0 else (DISC if k == 1 else DISC_SECOND)
            # The bound b N in units of the scaled row is (b / L) times the normal impulse.
            rows.master[i], rows.coefficient[i] = first_row[c], bound / lever
            w, alpha = bodies.angular_velocity, problem.angular_acceleration
            rows.bias[i] = (
                x * (w[b, 0] - w[a, 0] + h * (alpha[b, 0] - alpha[a, 0]))
                + y * (w[b, 1] - w[a, 1] + h * (alpha[b, 1] - alpha[a, 1]))
                + z * (w[b, 2] - w[a, 2] + h * (alpha[b, 2] - alpha[a, 2]))
            )
            i += 1


@jit
def add_rolling_wrench(contacts, rolling, rows, frames, h, start, wrench):
    """Moments of the rows' impulses over h, on both bodies of each contact, added to wrench."""
    i = start
    for c in range(frames.shape[0]):
        for k in range(3):
            if not (rolling.spinning[c] if k == 0 else rolling.rolling[c]) > 0.0:
                continue
            for r in range(3):
                moment = rolling.lever[c] * rows.impulse[i] * frames[c, k, r] / h
                wrench[contacts.body_a[c], 3 + r] -= moment
                wrench[contacts.body_b[c], 3 + r] += moment
            i += 1


def rolling_slip(
    bodies: BodyState, contacts: Contacts, rolling: Rolling, frames: np.ndarray, start: int, slow: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What rolls and spins faster than `slow` [m/s]: first and second row (s,), the same for a spin, and L w along them (s, 2)."""
    w = rolling.lever[:, None] * (bodies.angular_velocity[contacts.body_b] - bodies.angular_velocity[contacts.body_a])
    spin, roll = rolling.spinning > 0.0, rolling.rolling > 0.0
    along = np.einsum("ckj,cj->ck", frames, w)
    size = 1 * spin + 2 * roll
    first = start + np.cumsum(size) - size
    rows = np.concatenate([first[spin], (first + spin)[roll]])
    seconds = np.concatenate([first[spin], (first + spin)[roll] + 1])
    slip = np.concatenate([np.column_stack([along[spin, 0], np.zeros(spin.sum())]), along[roll, 1:]])
    moves = np.abs(slip).sum(axis=1) > slow
    return rows[moves], seconds[moves], slip[moves]
