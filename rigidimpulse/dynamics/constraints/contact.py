"""Contacts that last: forces that keep bodies apart over a sub-step.

Over a sub-step of length h the contact forces f are constant. Row i of a contact has the velocity u_i + h a_i + W p_i at
the end, p = h f, with u the velocity now and a the acceleration that the row would have without contact forces, as the
place of contact moves (see `contact_motion`):

    a = a_b + alpha_b x r_b + w_b x r_b' - (a_a + alpha_a x r_a + w_a x r_a') + n (u.n')

The solver finds p >= 0 in Coulomb's cone so that no contact approaches at the end. Positions follow x0 + v0 h + a h^2 / 2,
so sliding and standing are exact. Where arms or normals turn, velocities are put right at the end (velocity projection, see `rattle`), and
the gap g is brought to the contact margin d by position: with u_n = 0, g + h^2/2 (a_n + W f) = d adds 2 (g - d) / h to
the bias, limited to a part of the pressing acceleration.

A contact that carries load but leaves slowly (it would rise less than the contact margin) sticks first: its normal
velocity is set to zero in the metric of mass, which only dissipates. Otherwise the force would do work on it and it
would hover for ever.

A contact that slips stops at t = |u_t| / |a_t + W_t f|, and its friction changes there, also where it slips back: the sub-step ends at the
first such time (stop split). The same holds for rolling and spinning friction (see `rolling_friction`).
"""

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.rolling_friction import (
    Rolling,
    add_rolling_wrench,
    count_rolling_rows,
    fill_rolling_rows,
    rolling_slip,
)
from rigidimpulse.dynamics.constraints.rows import (
    FREE,
    Rows,
    RowSolver,
    change_velocities,
    contact_rows,
    contact_velocity,
    impulse_along,
    response_to,
    rows_of,
    solve_with_slip,
    take_rows,
)
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.motion.body_state import BodyState

STICK_PASSES = 4
# Residual asked of the solver and slip that counts, relative to the speed gained in the sub-step.
SOLVE_TOLERANCE = TOLERANCES.contact_forces.residual
POOR = TOLERANCES.contact_forces.poor_residual
SLIP = TOLERANCES.contact_forces.no_slip
TINY = TOLERANCES.arithmetic.least_divisor
# Part of the pressing acceleration that brings a gap back.
CLOSING = 0.25
# Length, as a part of the sub-step, over which forces are found that last until a contact stops.
BRIEF = TOLERANCES.contact_forces.brief


class Held(NamedTuple):
    """What holds m contacts over a sub-step."""

    residual: float  # relative to the speed gained in the sub-step
    length: float  # s, how long the forces last
    slides: np.ndarray  # (m,) bool, contacts that slip
    force: np.ndarray  # (m, 3) N on b, in the world


class ContactProblem(NamedTuple):
    """The m lasting contacts of an island, and how its bodies accelerate without them."""

    bodies: BodyState
    contacts: Contacts
    members: np.ndarray  # movable bodies of the island
    number: np.ndarray  # (n,) working memory: the number of each member among the members
    turning: np.ndarray  # (m, 3) m/s2, from `contact_motion`
    acceleration: np.ndarray  # (n, 3) m/s2
    angular_acceleration: np.ndarray  # (n, 3) rad/s2


@jit
def start_contact_impulses(rows, first_row, force, h):
    """Impulses of the contact rows to start from, by the forces (m, 3) of last time."""
    for c in range(first_row.shape[0]):
        for k in range(rows_of(rows, first_row[c])):
            rows.impulse[first_row[c] + k] = force[c, k] * h


@jit_making_arrays
def fill_contact_bias(problem, excess, h, of_contacts):
    """Write b = u + h a of the contact rows; excess (m,): g - d to be closed, m.

    Returns the largest speed h a gained [m/s] and the velocities u (m, 3) along the frames.
    """
    bodies, contacts, turning = problem.bodies, problem.contacts, problem.turning
    rows, first_row, frames = of_contacts.rows, of_contacts.first_row, of_contacts.frames
    m = first_row.shape[0]
    u, a, scale = np.empty((m, 3)), np.empty((m, 3)), TINY
    for c in range(m):
        contact_velocity(contacts, c, frames[c], problem.acceleration, problem.angular_acceleration, a[c])
        for k in range(3):
            for j in range(3):
                # What the moving place of contact and the turning normal add: see the head of the file.
                a[c, k] += turning[c, j] * frames[c, k, j]
            scale = max(scale, abs(a[c, k]) * h)
    for c in range(m):
        contact_velocity(contacts, c, frames[c], bodies.velocity, bodies.angular_velocity, u[c])
        for k in range(rows_of(rows, first_row[c])):
            rows.bias[first_row[c] + k] = u[c, k] + h * a[c, k]
        # 2 (g - d) / h brings the gap to the contact margin, limited to a part of what presses the contact.
        most = CLOSING * h * max(-a[c, 0], 0.0)
        rows.bias[first_row[c]] += min(max(2.0 * excess[c] / h, -most), most)
    return scale, u


def hold_contacts(
    solve: RowSolver, problem: ContactProblem, excess: np.ndarray, h: float, shortest: float, force: np.ndarray, wrench: np.ndarray,
    rolling: Rolling | None = None,
) -> Held:
    """Contact forces of the sub-step for m contacts.

    excess (m,): gaps to be closed, m; h: length of the sub-step, s, that is not split in parts below `shortest`; force (m, 3) in
    (n, t1, t2) [N], start and answer; wrench (n, 6): force and torque on the members are added; rolling: their rolling friction, if any.
    May change velocities: contacts that leave slowly stick.
    """
    bodies, contacts, members = problem.bodies, problem.contacts, problem.members
    extra = count_rolling_rows(rolling)
    of_contacts = contact_rows(bodies, contacts, members, problem.number, extra)
    rows, first_row, frames = of_contacts
    start = len(rows.bias) - extra
    # Warm start from the forces of the last sub-step.
    start_contact_impulses(rows, first_row, force, h)
    n, rough = len(members), contacts.static_friction > 0.0

    def attempt(h: float) -> tuple[float, float, np.ndarray, np.ndarray]:
        scale, u = fill_contact_bias(problem, excess, h, of_contacts)
        if rolling is not None:
            fill_rolling_rows(problem, rolling, h, of_contacts, start)
        slides = rough & (np.abs(u[:, 1]) + np.abs(u[:, 2]) > SLIP * scale)
        residual = solve_with_slip(solve, of_contacts, n, contacts, slides, SOLVE_TOLERANCE * scale, SLIP * scale)
        return residual / scale, scale, u, slides

    residual, scale, u, slides = attempt(h)
    # Contacts that carry load but leave slowly stick; that changes velocities, so the forces are found again.
    for _ in range(STICK_PASSES):
        loaded = np.flatnonzero(rows.impulse[first_row] > 0.0)
        target = SOLVE_TOLERANCE * scale
        if not np.any(u[loaded, 0] > target):
            break
        stick(solve, bodies, members, rows, first_row[loaded], u[loaded, 0], target)
        residual, scale, u, slides = attempt(h)
    disc, slip = first_row[slides] + 1, u[slides, 1:]
    second = disc + 1
    if rolling is not None:
        rolled = rolling_slip(bodies, contacts, rolling, frames, start, SLIP * scale)
        disc, second, slip = (np.concatenate(both) for both in zip((disc, second, slip), rolled, strict=True))
    # Stop split. A failed solve has no reliable slip, so it is not split.
    if len(disc) and residual <= POOR and _stops(slip, _end_slip(rows, n, disc, second), SLIP * scale):
        # A very short trial gives the deceleration |a_t + W_t f| of every slip, and so the first stop.
        brief, whole = BRIEF * h, rows.impulse.copy()
        rows.impulse[:] *= BRIEF
        attempt(brief)
        stop = _first_stop(slip, _end_slip(rows, n, disc, second), brief)
        if shortest < stop < h:
            rows.impulse[:] *= stop / brief
            # The split must not replace a good solution by a poor one.
            stopped, *_ = attempt(stop)
            if stopped <= max(residual, POOR):
                residual, h, whole = stopped, stop, rows.impulse
        rows.impulse[:] = whole
    world_force = add_contact_wrench(contacts, rows, first_row, frames, h, force, wrench)
    if rolling is not None:
        add_rolling_wrench(contacts, rolling, rows, frames, h, start, wrench)
    return Held(residual, h, slides, world_force)


def _end_slip(rows: Rows, n: int, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Slip (s, 2) at the end along pairs of rows; a single row is given twice."""
    after = rows.bias + response_to(rows, n, rows.impulse)
    return np.column_stack([after[first], np.where(second > first, after[second], 0.0)])


def _stops(slip: np.ndarray, end: np.ndarray, none: float) -> bool:
    """Whether one of s slips (s, 2) stops or turns back until the end; speeds up to `none` are none."""
    return bool(np.any((np.abs(end).sum(axis=1) <= none) | (np.einsum("ij,ij->i", slip, end) < 0.0)))


def _first_stop(slip: np.ndarray, end: np.ndarray, brief: float) -> float:
    """When the first of s slips (s, 2) stops [s], if it goes on to change as it does over a brief time, to `end`."""
    change = (end - slip) / brief
    slows = np.einsum("ij,ij->i", slip, change) < 0.0
    time = -np.einsum("ij,ij->i", slip, change)[slows] / np.einsum("ij,ij->i", change, change)[slows]
    return float(time.min(initial=np.inf))


def stick(
    solve: RowSolver, bodies: BodyState, members: np.ndarray, rows: Rows, normals: np.ndarray, leaving: np.ndarray, target: float
) -> None:
    """Stop load-bearing contacts that leave slowly; normals: their rows, leaving: their u.n [m/s]."""
    stops = take_rows(rows, normals)
    stops.kind[:], stops.bias[:], stops.impulse[:] = FREE, leaving, 0.0
    stops.lower[:] = -np.inf
    solve(stops, len(members), target)
    change_velocities(bodies, members, stops)


@jit_making_arrays
def add_contact_wrench(contacts, rows, first_row, frames, h, force, wrench):
    """The rows' impulses over h as forces (m, 3), and their sum on both bodies of each contact, added to wrench.

    Returns the forces on b in the world (m, 3).
    """
    world = np.empty((first_row.shape[0], 3))
    for c in range(first_row.shape[0]):
        force[c] = 0.0
        for k in range(rows_of(rows, first_row[c])):
            force[c, k] = rows.impulse[first_row[c] + k] / h
        f = world[c]
        impulse_along(rows, first_row[c], frames[c], f)
        for k in range(3):
            f[k] /= h
        for body, r, sign in ((contacts.body_a[c], contacts.arm_a[c], -1.0), (contacts.body_b[c], contacts.arm_b[c], 1.0)):
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                wrench[body, k] += sign * f[k]
                wrench[body, 3 + k] += sign * (r[i] * f[j] - r[j] * f[i])
    return world
