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

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.vector import length
from rigidimpulse.dynamics.constraints.rows import DISC, DISC_SECOND, SEGMENT, write_body


class Rolling(NamedTuple):
    """Rolling and spinning friction of m contacts, of none of them where no material asks for any."""

    rolling: np.ndarray  # (m,) b, m
    spinning: np.ndarray  # (m,) s, m
    lever: np.ndarray  # (m,) L, m


NO_ROLLING = Rolling(*np.zeros((3, 0)))
"""Where no material asks for any."""


@jit_making_arrays
def rolling_of(coefficients, material, bodies, contacts):
    """The `Rolling` of m contacts.

    coefficients: (k, k, 2) m of pairs of materials, with k = 0 where no material asks for any: then there is none; material (n,) of bodies.
    """
    m = contacts.gap.shape[0] if coefficients.shape[0] > 0 else 0
    rolling, spinning, lever = np.zeros(m), np.zeros(m), np.zeros(m)
    for c in range(m):
        a, b = contacts.body_a[c], contacts.body_b[c]
        if contacts.static_friction[c] > 0.0:
            rolling[c], spinning[c] = coefficients[material[a], material[b], 0], coefficients[material[a], material[b], 1]
        if bodies.inv_mass[a] > 0.0:
            lever[c] = length(contacts.arm_a[c])
        if bodies.inv_mass[b] > 0.0:
            lever[c] = max(lever[c], length(contacts.arm_b[c]))
    return Rolling(rolling, spinning, lever)


@jit
def count_rolling_rows(rolling):
    """Rows that `fill_rolling_rows` will fill; rolling: a `Rolling`."""
    count = 0
    for c in range(rolling.lever.shape[0]):
        count += (2 if rolling.rolling[c] > 0.0 else 0) + (1 if rolling.spinning[c] > 0.0 else 0)
    return count


@jit
def fill_rolling_rows(problem, rolling, h, of_contacts, start):
    """Fill the rows from `start` on, with the velocities L t.w that they would have after h without moments.

    problem: a `ContactProblem`; of_contacts: `ContactRows`.
    """
    bodies, contacts, number = problem.bodies, problem.contacts, problem.number
    rows, first_row, frames = of_contacts.rows, of_contacts.first_row, of_contacts.frames
    i = start
    for c in range(rolling.lever.shape[0]):
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
    for c in range(rolling.lever.shape[0]):
        for k in range(3):
            if not (rolling.spinning[c] if k == 0 else rolling.rolling[c]) > 0.0:
                continue
            for r in range(3):
                moment = rolling.lever[c] * rows.impulse[i] * frames[c, k, r] / h
                wrench[contacts.body_a[c], 3 + r] -= moment
                wrench[contacts.body_b[c], 3 + r] += moment
            i += 1


@jit
def add_rolling_slips(problem, rolling, of_contacts, slow, slips, count):
    """Add to `count` slips (`stop_split.Slips`) what rolls and spins faster than `slow` [m/s]; returns how many there are then."""
    contacts, frames, w = problem.contacts, of_contacts.frames, problem.bodies.angular_velocity
    i = of_contacts.rows.bias.shape[0] - count_rolling_rows(rolling)
    for c in range(rolling.lever.shape[0]):
        a, b, lever = contacts.body_a[c], contacts.body_b[c], rolling.lever[c]
        x, y, z = lever * (w[b, 0] - w[a, 0]), lever * (w[b, 1] - w[a, 1]), lever * (w[b, 2] - w[a, 2])
        if rolling.spinning[c] > 0.0:
            n = frames[c, 0]
            spin = n[0] * x + n[1] * y + n[2] * z
            if abs(spin) > slow:
                slips.first[count], slips.second[count] = i, i
                slips.velocity[count, 0], slips.velocity[count, 1] = spin, 0.0
                count += 1
            i += 1
        if rolling.rolling[c] > 0.0:
            t1, t2 = frames[c, 1], frames[c, 2]
            first, second = t1[0] * x + t1[1] * y + t1[2] * z, t2[0] * x + t2[1] * y + t2[2] * z
            if abs(first) + abs(second) > slow:
                slips.first[count], slips.second[count] = i, i + 1
                slips.velocity[count, 0], slips.velocity[count, 1] = first, second
                count += 1
            i += 2
    return count
