"""Velocity projection (RATTLE): the end of a sub-step of contacts whose arms or normals turn.

Forces f of the contacts are constant over a sub-step of length h, along the Jacobian J_0 at its start. At its end half of
them is taken back, and impulses nu along J_1, that of the end, let no contact approach:

    v_1 = v_0 + h M^-1 F + h/2 M^-1 J_0^T f + M^-1 J_1^T nu,    0 <= nu_n  _|_  J_1n v_1 >= 0,  |nu_t| <= mu nu_n

This is velocity Verlet with constraints (RATTLE: Andersen 1983), of second order where the motion is smooth. Without turning
J_1 = J_0 and nothing would change: such islands do without. A contact that has opened has nu = 0, and half of its force is taken back like
that of all others. A light disc that a load and a floor pressed with 7 MN each lost half of one of them only when the other contact had
opened, and was shot away with the energy of the load.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import row
from rigidimpulse.dynamics.constraints.contact import SLIP, SOLVE_TOLERANCE
from rigidimpulse.dynamics.constraints.rows import change_velocities, contact_rows, row_velocities
from rigidimpulse.dynamics.constraints.slip import solve_with_slip
from rigidimpulse.dynamics.energy import kinetic_energy
from rigidimpulse.engine.run import Run
from rigidimpulse.model.contact_memory import find_force, held_row
from rigidimpulse.model.contacts import select
from rigidimpulse.model.island import Island
from rigidimpulse.model.world import BodyConstants

TINY = TOLERANCES.arithmetic.least_divisor


class ProjectionScratch(NamedTuple):
    """Arrays of n bodies that a projection writes into, and what it asks of them."""

    number: np.ndarray  # (n,) working memory: the number of each member among the members
    correction: np.ndarray  # (n, 6) change of velocity and spin that a body under contact got at the end of its sub-step
    under_contact: np.ndarray  # (n,) bool, bodies whose trajectories carry contact forces
    constants: BodyConstants


@jit
def _ends(memory, at, start, a, b, time):
    """Whether the forces of a held pair, in row `at`, end at `time`, with neither body on a new trajectory since they began."""
    if at < 0:
        return False
    began = memory.held[at].start
    return max(start[a], start[b]) <= began and began < time


@jit
def take_back(memory, motion, bodies, time):
    """Take half of the forces whose sub-steps end at `time` [s] off the velocities of these bodies (k,); returns whether there were any."""
    now, any_ended = motion.now, False
    for i in bodies:
        since = memory.since[i]
        if not (motion.trajectory.start[i] <= since and since < time):
            continue
        half, wrench, inv_inertia, any_ended = 0.5 * (time - since), memory.wrench[i], now.inv_inertia[i], True
        for k in range(3):
            now.velocity[i, k] -= half * now.inv_mass[i] * wrench[k]
            turn = inv_inertia[k, 0] * wrench[3] + inv_inertia[k, 1] * wrench[4] + inv_inertia[k, 2] * wrench[5]
            now.angular_velocity[i, k] -= half * turn
        memory.since[i] = np.nan
    return any_ended


@jit_making_arrays
def _stop(bodies, contacts, members, number, slides):
    """The impulses nu of contacts; slides (m,) bool: those that slip."""
    of_contacts = contact_rows(bodies, contacts, members, number, 0)
    rows = of_contacts.rows
    row_velocities(bodies, contacts, of_contacts.first_row, of_contacts.frames, rows.bias)
    scale = TINY
    for i in range(rows.bias.shape[0]):
        scale = max(scale, abs(rows.bias[i]))
    solve_with_slip(None, of_contacts, members.shape[0], contacts, slides, SOLVE_TOLERANCE * scale, SLIP * scale)
    change_velocities(bodies, members, rows)


@jit_making_arrays
def _stop_held(memory, motion, contacts, touching, held, time, members, number):
    """The impulses nu of the contacts of an island whose sub-steps end at `time` [s].

    motion: `touching.Motion`; touching: what touches at the contacts; held (m,) bool: those that may have carried forces;
    number (n,): working memory.
    """
    bodies, start = motion.now, motion.trajectory.start
    m, n = contacts.gap.shape[0], start.shape[0]
    which, slides = np.empty(m, np.int64), np.zeros(m, np.bool_)
    count, first = np.int64(0), np.int64(0)
    while first < m:
        a, b, last, any_held = contacts.body_a[first], contacts.body_b[first], first, False
        while last < m and contacts.body_a[last] == a and contacts.body_b[last] == b:
            any_held = any_held or held[last]
            last += 1
        at = held_row(memory, a * n + b) if any_held else np.int64(-1)
        if _ends(memory, at, start, a, b, time):
            pair = memory.held[at]
            for c in range(first, last):
                if held[c]:
                    entry = find_force(memory, at, touching.kind[c], touching.feature[c, 0], touching.feature[c, 1])
                    # What has just come to touch slips if its pair does.
                    slides[count] = memory.force[entry].slips if entry >= 0 else pair.slips
                    which[count] = c
                    count += 1
            pair.start = np.nan
        first = last
    if count > 0:
        _stop(bodies, select(contacts, which[:count]), members, number, slides[:count])


@jit_making_arrays
def project(memory, motion, contacts, touching, held, time, members, scratch):
    """End the sub-steps of an island at `time` [s], with bodies that no force pressed in it; scratch: `ProjectionScratch`.

    Other arguments as for `_stop_held`. Returns whether sub-steps ended, and the energy [J] that bodies got which flew freely until now:
    the others have theirs in the work of their contacts, and their frames on the way have their share of the change.
    """
    bodies, k = motion.now, members.shape[0]
    before, free, count = np.empty((k, 6)), np.empty(k, np.int64), np.int64(0)
    for s in range(k):
        if not scratch.under_contact[members[s]]:
            free[count] = members[s]
            count += 1
        for j in range(3):
            before[s, j], before[s, 3 + j] = bodies.velocity[members[s], j], bodies.angular_velocity[members[s], j]
    flying = kinetic_energy(bodies, scratch.constants, free[:count])
    if not take_back(memory, motion, members, time):
        return False, 0.0
    _stop_held(memory, motion, contacts, touching, held, time, members, scratch.number)
    for s in range(k):
        if scratch.under_contact[members[s]]:
            for j in range(3):
                scratch.correction[members[s], j] = bodies.velocity[members[s], j] - before[s, j]
                scratch.correction[members[s], 3 + j] = bodies.angular_velocity[members[s], j] - before[s, 3 + j]
    return True, kinetic_energy(bodies, scratch.constants, free[:count]) - flying


@jit_making_arrays
def project_alone(memory, motion, bodies, time, correction):
    """End the sub-steps of those of these bodies (k,) that nothing touches any more; correction (n, 6): as in `ProjectionScratch`."""
    now = motion.now
    for s in range(bodies.shape[0]):
        i = bodies[s]
        v, w = row(now.velocity, i), row(now.angular_velocity, i)
        if take_back(memory, motion, bodies[s : s + 1], time):
            for k in range(3):
                correction[i, k], correction[i, 3 + k] = now.velocity[i, k] - v[k], now.angular_velocity[i, k] - w[k]


def project_velocities(run: Run, island: Island) -> bool:
    """End the sub-steps of the island's pairs; returns whether there were any."""
    if not len(island.place):
        return False
    state = run.state
    ended, change = project(
        state.memory, run.motion, island.contacts, island.touching, island.slow(), island.time, island.members,
        ProjectionScratch(run.column, state.correction, state.under_contact, run.world.constants),
    )  # fmt: skip
    run.log.account(island.time, "stick", change)
    return ended
