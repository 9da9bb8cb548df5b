"""Time stepping of a jointed island: contacts and joints are solved together, exactly, once in a sub-step (kernels).

A sub-step of length h, with J_0 the rows of contacts and joints at its start and the biases of `biases`:

    v <- v + h/2 g,   w <- w + h/2 I^-1 tau
    p:  u' = b + J_0 v + W p  obeys the laws of all rows (`newton`),   v <- v + M^-1 J_0^T p
    fly, and close the joints (`flight`)
    v <- v + h/2 g,   w <- w + h/2 I^-1 tau

Where no contact acts this is the method of Verlet with constraints: of second order, and symplectic. Half of a step's gravity at each of
its ends makes a free body's path the parabola. At the end of all sub-steps impulses nu make the rates of joints and closed contacts vanish:

    J_1 (v + M^-1 J_1^T nu) = 0

A sub-step whose joints stay open by more than GIVE_UP of what is allowed is taken back and halved, down to 1 / MOST_HALVED of its length.
Contacts and joints feel each other in one solve, which starts from what sweeps over contacts find with the joints eliminated (`reduced`).
So loads of any mass ratio are carried: sweeps over contacts and joints in turn would need to be the more, the heavier the load.

Source: Stewart and Trinkle 1996, Anitescu and Potra 1997 (time stepping with contact and friction at velocity level).
"""

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_records import SKIN, SUPPORT
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.union_find import unite
from rigidimpulse.dynamics.constraints.joint import add_forces
from rigidimpulse.dynamics.constraints.jointed_island import count_joint_rows
from rigidimpulse.dynamics.constraints.rows import change_velocities, contact_rows
from rigidimpulse.dynamics.constraints.slip import solve_until_slip
from rigidimpulse.dynamics.solvers.free_rows import factor_free
from rigidimpulse.dynamics.solvers.reduced import start_without_joints
from rigidimpulse.dynamics.solvers.time_stepping.biases import fill_contact_biases, fill_joint_biases, fill_still_biases
from rigidimpulse.dynamics.solvers.time_stepping.contact_points import (
    contact_points,
    forget_given,
    keep_for_next,
    start_from_kept,
    sum_given,
)
from rigidimpulse.dynamics.solvers.time_stepping.flight import carry_supports, fly_and_close, kick, set_inertia, stiffen
from rigidimpulse.motion.waypoints import Waypoints, add_waypoint

GIVE_UP, MOST_HALVED = 100.0, 32.0
ACCURATE, SLIP, LAST = TOLERANCES.sub_stepping.joint_residual, TOLERANCES.sub_stepping.joint_no_slip, TOLERANCES.sub_stepping.last_sub_step
TINY = TOLERANCES.arithmetic.least_divisor
TIME, HALVED, GAP = range(3)
"""Places in `Kept.reached`."""


class Kept(NamedTuple):
    """What is kept from sub-step to sub-step of a step, and brought up to date."""

    stiffening: np.ndarray  # (n,) kg m2, kept from step to step
    moment: np.ndarray  # (j, 3) N s, impulses of the joints on their b
    driven: np.ndarray  # (n,) bool, members that drives, springs or moving supports may give energy to
    before: np.ndarray  # (1,) s, length of the last sub-step, 0 at the start
    given: np.ndarray  # (p, 10) of the pairs in the table of contacts, see `sum_given`
    reached: np.ndarray  # (3,) s since the start; how many sub-steps were halved; worst gap of a joint at their ends, m or rad
    waypoints: Waypoints  # sub-steps are written to it as far as there is space


@jit_making_arrays
def step_island(island, bodies, table, coefficients, balance, kept, sub_steps, h):
    """Step an island by `sub_steps` sub-steps of h s.

    island: its joints and members by rank, with the velocities; bodies: the solver's bodies, with the poses. table: of contacts. balance:
    its clusters are joined, and it is given the work of drives and moving supports. kept: `Kept`.
    """
    members, now, stiffening, reached, waypoints = island.members, island.bodies, kept.stiffening, kept.reached, kept.waypoints
    forget_given(bodies, table.pairs, table.points)
    supports = _supports(bodies)
    left, step = sub_steps * h, h
    begin, spin = np.empty((bodies.part.shape[0], 7)), np.empty((bodies.part.shape[0], 3))
    before = np.empty((bodies.part.shape[0], 7))
    set_inertia(bodies, now, members, stiffening)
    while left > LAST * h:
        step = min(step, left)
        _remember(bodies, now, members, begin, before)
        _remember(bodies, now, supports, begin, before)
        kick(bodies, now, members, 0.5 * step)
        most = GIVE_UP * island.allowed if step > h / MOST_HALVED else np.inf
        gap = _sub_step(island, bodies, table, coefficients, balance, kept, (begin, spin, supports, most), step)
        if gap > most:
            _take_back(bodies, now, members, begin, before)
            _take_back(bodies, now, supports, begin, before)
            step *= 0.5
            reached[HALVED] += 1.0
            continue
        for i in members:
            for k in range(3):
                now.angular_velocity[i, k] = spin[i, k]
        set_inertia(bodies, now, members, stiffening)
        kick(bodies, now, members, 0.5 * step)
        # What is no number stays.
        if gap > reached[GAP] or np.isnan(gap):
            reached[GAP] = gap
        left -= step
        kept.before[0] = step
        reached[TIME] += step
        if waypoints.number[0] < waypoints.time.shape[0]:
            _add_waypoint(bodies, now, members, waypoints, reached[TIME])
        # After a halved sub-step the next ones may be whole again.
        step = min(2.0 * step, h)
    sum_given(bodies, table.pairs, table.points, kept.given)
    _hand_over(bodies, now, members)


@jit
def _add_waypoint(bodies, now, members, waypoints, time):
    """Write where the members are at `time` [s]."""
    number = add_waypoint(waypoints, time, bodies)
    for i in members:
        for k in range(3):
            waypoints.state[number, i, 7 + k], waypoints.state[number, i, 10 + k] = now.velocity[i, k], now.angular_velocity[i, k]


@jit
def _hand_over(bodies, now, members):
    """Give the solver's bodies the velocities of the members."""
    for i in members:
        for k in range(3):
            bodies.velocity[8 * i + k], bodies.velocity[8 * i + 3 + k] = now.velocity[i, k], now.angular_velocity[i, k]


@jit_making_arrays
def _supports(bodies):
    """Bodies that are no members and move on a path of their own."""
    found, m = np.empty(bodies.part.shape[0], np.int64), 0
    for i in range(bodies.part.shape[0]):
        if bodies.part[i] == SUPPORT and np.any(bodies.velocity[8 * i : 8 * i + 6] != 0.0):
            found[m] = i
            m += 1
    return found[:m]


@jit
def _remember(bodies, now, members, begin, before):
    for i in members:
        for k in range(3):
            begin[i, k], before[i, k], before[i, 3 + k] = bodies.position[i, k], now.velocity[i, k], now.angular_velocity[i, k]
        for k in range(4):
            begin[i, 3 + k] = bodies.orientation[i, k]
        before[i, 6] = bodies.work[i]


@jit
def _take_back(bodies, now, members, begin, before):
    for i in members:
        for k in range(3):
            bodies.position[i, k], now.velocity[i, k], now.angular_velocity[i, k] = begin[i, k], before[i, k], before[i, 3 + k]
        for k in range(4):
            bodies.orientation[i, k] = begin[i, 3 + k]
        bodies.work[i] = before[i, 6]
        quaternion_to_matrix(bodies.orientation[i], bodies.rotation[i])


@jit_making_arrays
def _turned(bodies, members):
    """The orientations (k, 3, 3) of the members."""
    r = np.empty((members.shape[0], 3, 3))
    for n in range(members.shape[0]):
        for k in range(3):
            for j in range(3):
                r[n, k, j] = bodies.rotation[members[n], k, j]
    return r


@jit_making_arrays
def _falling(bodies, now, members):
    """Power (k,) of gravity at the members, W."""
    power = np.empty(members.shape[0])
    for n in range(members.shape[0]):
        i = members[n]
        g, v = bodies.gravity[i], now.velocity[i]
        power[n] = (g[0] * v[0] + g[1] * v[1] + g[2] * v[2]) / now.inv_mass[i]
    return power


@jit_making_arrays
def _energies(bodies, now, members, rotation):
    """Kinetic energies (k,) of the members, with their true inertia, at the orientations (k, 3, 3), J."""
    energy = np.empty(members.shape[0])
    for n in range(members.shape[0]):
        i, r = members[n], rotation[n]
        w, v = now.angular_velocity[i], now.velocity[i]
        total = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) / now.inv_mass[i]
        for k in range(3):
            along = r[0, k] * w[0] + r[1, k] * w[1] + r[2, k] * w[2]
            total += bodies.inertia[i, k] * along * along
        energy[n] = 0.5 * total
    return energy


@jit_making_arrays
def _sub_step(island, bodies, table, coefficients, balance, kept, flight, h):
    """Solve the rows at the present pose, fly, and close; returns the gap that is left of joints, m or rad.

    flight: see `flight.fly`; the supports that move; and the gap up to which things are counted and kept for later: else the caller takes
    the sub-step back.
    """
    members, now, driven, moment = island.members, island.bodies, kept.driven, kept.moment
    contacts, place = contact_points(bodies, now, table.pairs, table.points, coefficients, h)
    start_of = contact_rows(now, contacts, members, island.number, count_joint_rows(island.joints, island.which))
    rows, start = start_of.rows, start_of.rows.bias.shape[0] - count_joint_rows(island.joints, island.which)
    start_from_kept(rows, start_of, table.points, place)
    pull = 0.0
    for i in members:
        pull = max(pull, np.sqrt(bodies.gravity[i, 0] ** 2 + bodies.gravity[i, 1] ** 2 + bodies.gravity[i, 2] ** 2))
    u = fill_contact_biases(now, contacts, start_of, table.points[place, SKIN], pull, h)
    direction = fill_joint_biases(island, rows, start, h, kept.before[0])
    scale = max(_fastest(rows), h * pull) + TINY
    _set_friction(start_of, contacts, u, SLIP * scale)
    turned, fell = _turned(bodies, members), _falling(bodies, now, members)
    given = _energies(bodies, now, members, turned)
    free = factor_free(rows, members.shape[0])
    start_without_joints(rows, free, ACCURATE * scale)
    solve_until_slip(None, start_of, members.shape[0], contacts, ACCURATE * scale, SLIP * scale)
    change_velocities(now, members, rows)
    begin, spin, supports, most = flight
    # Joints close where their supports will be: before, what hung from a moving body was a sub-step behind it.
    carry_supports(bodies, now, supports, h)
    gap = fly_and_close(island, bodies, rows, free, (begin, spin), h)
    # All that impulses did, those that close joints included: they act at the start. Half of the pull of gravity is in the velocities there
    # that acts after the flight: its share of the work is not theirs.
    given = _energies(bodies, now, members, turned) - given - 0.5 * h * (_falling(bodies, now, members) - fell)
    if gap > most:
        return gap
    for k in range(members.shape[0]):
        if driven[members[k]]:
            balance.given[members[k]] += given[k]
    keep_for_next(start_of, contacts, table.points, place)
    _connect(balance, island, contacts, start_of)
    own = np.zeros(moment.shape)
    add_forces(island.joints, island.which, rows.impulse[start:], direction, 1.0, own)
    _remember_forces(island, rows, start, h)
    stiffen(island, kept.stiffening, own, h)
    for j in island.which:
        for k in range(3):
            moment[j, k] += own[j, k]
    return gap


@jit
def _fastest(rows):
    fastest = 0.0
    for i in range(rows.bias.shape[0]):
        if rows.lower[i] < rows.upper[i]:
            fastest = max(fastest, abs(rows.bias[i]))
    return fastest


@jit
def _set_friction(of_contacts, contacts, u, slow):
    """Contacts that slip faster than `slow` m/s have dynamic friction, all others the static one; u (m, 3) m/s."""
    rows = of_contacts.rows
    for c in range(u.shape[0]):
        if contacts.static_friction[c] > 0.0:
            i = of_contacts.first_row[c] + 1
            slips = abs(u[c, 1]) + abs(u[c, 2]) > slow
            rows.coefficient[i] = rows.coefficient[i + 1] = contacts.dynamic_friction[c] if slips else contacts.static_friction[c]


@jit
def _connect_pair(balance, inv_mass, a, b):
    """Make one cluster of a and b, if both give way; -1 is the world."""
    gives_a, gives_b = a >= 0 and inv_mass[a] > 0.0, b >= 0 and inv_mass[b] > 0.0
    if gives_a and gives_b:
        unite(balance.parent, a, b)
    elif gives_a or gives_b:
        balance.held[a if gives_a else b] = True


@jit
def _connect(balance, island, contacts, of_contacts):
    """Join the clusters of members that joints and bearing contacts connect."""
    joints, inv_mass, touched = island.joints, island.bodies.inv_mass, False
    for c in range(contacts.gap.shape[0]):
        if of_contacts.rows.impulse[of_contacts.first_row[c]] > 0.0:
            a, b, touched = contacts.body_a[c], contacts.body_b[c], True
            _connect_pair(balance, inv_mass, a, b)
    if not touched:
        # What only joints hold keeps its energy by the method: nothing is taken off it.
        return
    for j in island.which:
        _connect_pair(balance, inv_mass, joints.body_a[j], joints.body_b[j])
    for i in island.members:
        balance.touched[i] = True


@jit
def _remember_forces(island, rows, start, h):
    """Remember the forces of the rows of joints, from which the next sub-step starts."""
    joints, i = island.joints, start
    for j in island.which:
        for k in range(joints.first[j], joints.first[j + 1]):
            island.memory.force[k] = rows.impulse[i] / h
            i += 1


@jit_making_arrays
def stop_island(island, bodies, table, coefficients, balance, kept):
    """Make the rates of joints and closed contacts vanish at the end of the sub-steps of a step; arguments as of `step_island`."""
    members, now, driven = island.members, island.bodies, kept.driven
    set_inertia(bodies, now, members, kept.stiffening)
    contacts, _ = contact_points(bodies, now, table.pairs, table.points, coefficients, 0.0)
    of_contacts = contact_rows(now, contacts, members, island.number, count_joint_rows(island.joints, island.which))
    rows = of_contacts.rows
    start = rows.bias.shape[0] - count_joint_rows(island.joints, island.which)
    direction = fill_still_biases(island, contacts, of_contacts, start, kept.before[0])
    scale = _fastest(rows) + TINY
    turned = _turned(bodies, members)
    given = _energies(bodies, now, members, turned)
    start_without_joints(rows, factor_free(rows, members.shape[0]), ACCURATE * scale)
    solve_until_slip(None, of_contacts, members.shape[0], contacts, ACCURATE * scale, SLIP * scale)
    change_velocities(now, members, rows)
    given = _energies(bodies, now, members, turned) - given
    for k in range(members.shape[0]):
        if driven[members[k]]:
            balance.given[members[k]] += given[k]
    add_forces(island.joints, island.which, rows.impulse[start:], direction, 1.0, kept.moment)
    _hand_over(bodies, now, members)
