"""Contacts that last: forces that keep bodies apart over a sub-step.

Over a sub-step of length h the contact forces f are constant. Row i of a contact has the velocity u_i + h a_i + W p_i at
the end, p = h f, with u the velocity now and a the acceleration that the row would have without contact forces, as the
place of contact moves (see `contact_motion`):

    a = a_b + alpha_b x r_b + w_b x r_b' - (a_a + alpha_a x r_a + w_a x r_a') + n (u.n')

The solver finds p >= 0 in Coulomb's cone so that no contact approaches at the end. Positions follow x0 + v0 h + a h^2 / 2,
so sliding and standing are exact. Where arms or normals turn, velocities are put right at the end (see `velocity_projection`), and
the gap g is brought to the contact margin d by position: with u_n = 0, g + h^2/2 (a_n + W f) = d adds 2 (g - d) / h to
the bias, limited to a part of the pressing acceleration.

A contact that carries load but leaves slowly (it would rise less than the contact margin) sticks first: its normal
velocity is set to zero in the metric of mass, which only dissipates. Otherwise the force would do work on it and it
would hover for ever.

A contact that slips may stop within the sub-step, and its friction changes there, also where it slips back: the sub-step ends at the
first such time. Where the slip turns, friction turns with it (see `stop_split`). The same holds for rolling and spinning friction (see
`rolling_friction`).
"""

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays, jit_with_callbacks
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import copy_vector
from rigidimpulse.dynamics.constraints.rolling_friction import add_rolling_wrench, count_rolling_rows, fill_rolling_rows
from rigidimpulse.dynamics.constraints.rows import (
    FREE,
    change_velocities,
    contact_rows,
    contact_velocity,
    impulse_along,
    rows_of,
    take_rows,
)
from rigidimpulse.dynamics.constraints.slip import set_friction, solve_rows, solve_until_slip, solve_with_slip
from rigidimpulse.dynamics.constraints.stop_split import any_stops, end_slides, find_slips, first_stop, middle_of_slips, start_slides
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.motion.body_state import BodyState

STICK_PASSES = 4
# Residual asked of the solver and slip that counts, relative to the speed gained in the sub-step.
SOLVE_TOLERANCE = TOLERANCES.contact_forces.residual
POOR = TOLERANCES.contact_forces.poor_residual
SLIP = TOLERANCES.contact_forces.no_slip
TINY = TOLERANCES.arithmetic.least_divisor
ROUND_OFF = TOLERANCES.arithmetic.round_off
# Part of the pressing acceleration that brings a gap back.
CLOSING = 0.25


class Held(NamedTuple):
    """What holds m contacts over a sub-step."""

    residual: float  # relative to the speed gained in the sub-step
    length: float  # s, how long the forces last
    slides: np.ndarray  # (m,) bool, contacts that slip
    force: np.ndarray  # (m, 3) N on b, in the world


class SubStep(NamedTuple):
    """The sub-step that forces of m contacts are asked for."""

    excess: np.ndarray  # (m,) m, gaps to be closed
    length: float  # s
    shortest: float  # s, it is not split in parts below that


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


@jit
def _inverse_mass(bodies, i):
    """1 / m of a body, 0 of the world."""
    return bodies.inv_mass[i] if i >= 0 else 0.0


@jit_making_arrays
def fill_contact_bias(problem, excess, h, of_contacts):
    """Write b = u + h a of the contact rows; excess (m,): g - d to be closed, m.

    Returns the largest speed h a gained [m/s], or the round-off of the members' speeds, of what they gain, and of what the impulses give
    them from which the solver starts, if that is larger; and the velocities u (m, 3) along the frames. Bodies that fall freely side by side
    gain none from each other: their residual is round-off, and means nothing by itself. Nor when what bore them has just been let go.
    """
    bodies, contacts, turning = problem.bodies, problem.contacts, problem.turning
    rows, first_row, frames = of_contacts.rows, of_contacts.first_row, of_contacts.frames
    m = first_row.shape[0]
    u, a, scale = np.empty((m, 3)), np.empty((m, 3)), TINY
    for i in problem.members:
        for k in range(3):
            scale = max(scale, ROUND_OFF * (abs(bodies.velocity[i, k]) + h * abs(problem.acceleration[i, k])))
    for c in range(m):
        a_gives, b_gives = _inverse_mass(bodies, contacts.body_a[c]), _inverse_mass(bodies, contacts.body_b[c])
        scale = max(scale, ROUND_OFF * abs(rows.impulse[first_row[c]]) * max(a_gives, b_gives))
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


@jit_with_callbacks
def hold_contacts(solve, problem, sub_step, force, wrench, rolling):
    """Contact forces over a `SubStep` for m contacts, as `Held`.

    solve: as in `slip.solve_rows`; problem: a `ContactProblem`; force (m, 3) in (n, t1, t2) [N], start and answer; wrench (n, 6): force and
    torque on the members are added; rolling: their `Rolling`.
    May change velocities: contacts that leave slowly stick.
    """
    contacts, h = problem.contacts, sub_step.length
    extra = count_rolling_rows(rolling)
    of_contacts = contact_rows(problem.bodies, contacts, problem.members, problem.number, extra)
    rows, first_row, frames = of_contacts
    start_contact_impulses(rows, first_row, force, h)
    found = attempt(solve, problem, of_contacts, sub_step.excess, h, rolling)
    for _ in range(STICK_PASSES):
        if not stick(solve, problem, of_contacts, found):
            break
        found = attempt(solve, problem, of_contacts, sub_step.excess, h, rolling)
    slips, residual = find_slips(problem, of_contacts, found.slides, found.velocity, rolling, SLIP * found.scale), found.residual
    if slips.first.shape[0] > 0 and residual <= POOR:
        if any_stops(rows, problem.members.shape[0], slips, SLIP * found.scale):
            residual, h = end_at_stop(problem, sub_step, of_contacts, slips, found)
        else:
            residual = turn_friction(problem, of_contacts, slips, found)
    world_force = add_contact_wrench(contacts, rows, first_row, frames, h, force, wrench)
    add_rolling_wrench(contacts, rolling, rows, frames, h, rows.bias.shape[0] - extra, wrench)
    return Held(residual, h, found.slides, world_force)


class Attempt(NamedTuple):
    """Impulses of the rows over a length, as they were found."""

    residual: float  # relative to `scale`
    scale: float  # m/s, largest speed gained
    velocity: np.ndarray  # (m, 3) m/s at the start, along the frames
    slides: np.ndarray  # (m,) bool, contacts that slip at the start


@jit_with_callbacks
def attempt(solve, problem, of_contacts, excess, h, rolling):
    """Solve the rows over the length h; `rows.impulse` is start and answer. Other arguments as in `hold_contacts`."""
    contacts, rows, m = problem.contacts, of_contacts.rows, of_contacts.first_row.shape[0]
    scale, u = fill_contact_bias(problem, excess, h, of_contacts)
    fill_rolling_rows(problem, rolling, h, of_contacts, rows.bias.shape[0] - count_rolling_rows(rolling))
    slides = np.empty(m, np.bool_)
    for c in range(m):
        slides[c] = contacts.static_friction[c] > 0.0 and abs(u[c, 1]) + abs(u[c, 2]) > SLIP * scale
    residual = solve_with_slip(solve, of_contacts, problem.members.shape[0], contacts, slides, SOLVE_TOLERANCE * scale, SLIP * scale)
    return Attempt(residual / scale, scale, u, slides)


@jit_making_arrays
def end_at_stop(problem, sub_step, of_contacts, slips, found):
    """End the sub-step where the first of the slips stops, under forces that last until then, see `stop_split`.

    found: the `Attempt` over the whole sub-step, whose bias the rows have. Returns the residual and the length that are kept.
    """
    rows, contacts, n, h = of_contacts.rows, problem.contacts, problem.members.shape[0], sub_step.length
    whole, slow = rows.impulse.copy(), SLIP * found.scale
    set_friction(of_contacts, contacts, found.slides)
    kinds = start_slides(of_contacts, slips, found.velocity, slow)
    # Among equal loads the solver takes those next to where it starts: from none on, the least.
    rows.impulse[:] = 0.0
    residual = solve_until_slip(None, of_contacts, n, contacts, SOLVE_TOLERANCE * found.scale, slow) / found.scale
    end_slides(of_contacts, kinds)
    stop = first_stop(rows, n, slips, h)
    if residual <= max(found.residual, POOR) and sub_step.shortest < stop < h:
        for i in range(whole.shape[0]):
            rows.impulse[i] *= stop / h
        return residual, stop
    copy_vector(whole, rows.impulse)
    return found.residual, h


@jit_making_arrays
def turn_friction(problem, of_contacts, slips, found):
    """Give slips that turn the friction of their middle, see `stop_split`; none of them stops.

    found: the `Attempt` whose impulses the rows have. Returns the residual of those that are kept.
    """
    rows, contacts, n = of_contacts.rows, problem.contacts, problem.members.shape[0]
    middle, turns = middle_of_slips(rows, n, slips)
    if not turns:
        return found.residual
    before, slow = rows.impulse.copy(), SLIP * found.scale
    set_friction(of_contacts, contacts, found.slides)
    kinds = start_slides(of_contacts, middle, found.velocity, np.inf)
    residual = solve_until_slip(None, of_contacts, n, contacts, SOLVE_TOLERANCE * found.scale, slow) / found.scale
    end_slides(of_contacts, kinds)
    # Along a bend friction may jam, or stop what slips: then it stays as it was.
    if residual <= max(found.residual, POOR) and not any_stops(rows, n, slips, slow):
        return residual
    copy_vector(before, rows.impulse)
    return found.residual


@jit_with_callbacks
def stick(solve, problem, of_contacts, found):
    """Stop load-bearing contacts if one of them leaves, as an `Attempt` found; returns whether one did."""
    rows, first_row, target = of_contacts.rows, of_contacts.first_row, SOLVE_TOLERANCE * found.scale
    normals, leaving = np.empty(first_row.shape[0], np.int64), np.empty(first_row.shape[0])
    loaded, leaves = 0, False
    for c in range(first_row.shape[0]):
        if rows.impulse[first_row[c]] > 0.0:
            normals[loaded], leaving[loaded] = first_row[c], found.velocity[c, 0]
            leaves = leaves or leaving[loaded] > target
            loaded += 1
    if not leaves:
        return False
    stops = take_rows(rows, normals[:loaded])
    for k in range(loaded):
        stops.kind[k], stops.lower[k], stops.bias[k], stops.impulse[k] = FREE, -np.inf, leaving[k], 0.0
    solve_rows(solve, stops, problem.members.shape[0], target)
    change_velocities(problem.bodies, problem.members, stops)
    return True


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
