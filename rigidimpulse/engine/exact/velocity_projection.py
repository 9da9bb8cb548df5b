"""Velocity projection (RATTLE): the end of a sub-step of contacts whose arms or normals turn.

Forces f of the contacts are constant over a sub-step of length h, along the Jacobian J_0 at its start. At its end half of
them is taken back, and impulses nu along J_1, that of the end, let no contact approach:

    v_1 = v_0 + h M^-1 F + h/2 M^-1 J_0^T f + M^-1 J_1^T nu,    0 <= nu_n  _|_  J_1n v_1 >= 0,  |nu_t| <= mu nu_n

This is velocity Verlet with constraints (RATTLE: Andersen 1983), of second order where the motion is smooth. Without turning
J_1 = J_0 and nothing would change: such islands do without.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.constraints.contact import SLIP, SOLVE_TOLERANCE
from rigidimpulse.dynamics.constraints.rows import change_velocities, contact_rows, row_velocities, solve_with_slip
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.engine.run import Run
from rigidimpulse.model.contacts import Contacts, select
from rigidimpulse.model.island import Island
from rigidimpulse.model.state import PairForce, State


def remember_forces(
    state: State, time: float, keys: list[tuple[int, ...]], contacts: Contacts, force: np.ndarray, world_force: np.ndarray,
    slides: np.ndarray,
) -> None:
    """Keep the forces of m contacts from `time` on: force (m, 3) in their frames, world_force (m, 3) N on b, slides (m,) bool."""
    torque_a = cross_arrays(contacts.arm_a, world_force)
    torque_b = cross_arrays(contacts.arm_b, world_force)
    for pair in sorted(set(zip(contacts.body_a.tolist(), contacts.body_b.tolist(), strict=True))):
        at = np.flatnonzero((contacts.body_a == pair[0]) & (contacts.body_b == pair[1]))
        pull = world_force[at].sum(axis=0)
        state.pair_force[pair] = PairForce(
            time,
            -np.concatenate([pull, torque_a[at].sum(axis=0)]),
            np.concatenate([pull, torque_b[at].sum(axis=0)]),
            {keys[c]: force[c] for c in at},
            frozenset(keys[c] for c in at if slides[c]),
        )


def forget_forces(state: State, contacts: Contacts) -> None:
    """Whatever acted between the bodies of these contacts does not any more."""
    for pair in set(zip(contacts.body_a.tolist(), contacts.body_b.tolist(), strict=True)):
        state.pair_force.pop(pair, None)


def project_velocities(run: Run, island: Island) -> bool:
    """End the sub-steps of the island's pairs; returns whether there were any."""
    state, now, contacts = run.state, run.state.now, island.contacts
    start = state.trajectory.start
    ended: dict[tuple[int, int], PairForce] = {}
    held = island.slow()
    for pair in set(zip(contacts.body_a[held].tolist(), contacts.body_b[held].tolist(), strict=True)):
        entry = state.pair_force.get(pair)
        if entry is not None and max(start[pair[0]], start[pair[1]]) <= entry.start < island.time:
            ended[pair] = state.pair_force.pop(pair)
    if not ended:
        return False
    before = np.hstack([now.velocity[island.members], now.angular_velocity[island.members]])
    for pair, entry in sorted(ended.items()):
        half = 0.5 * (island.time - entry.start)
        for i, wrench in zip(pair, (entry.on_a, entry.on_b), strict=True):
            now.velocity[i] -= half * now.inv_mass[i] * wrench[:3]
            now.angular_velocity[i] -= half * now.inv_inertia[i] @ wrench[3:]
    of_pair = [ended.get(pair) for pair in zip(contacts.body_a.tolist(), contacts.body_b.tolist(), strict=True)]
    which = np.array([c for c, entry in enumerate(of_pair) if entry is not None and held[c]], np.int64)
    _stop(run, island, select(contacts, which), [(entry, island.keys[c]) for c in which if (entry := of_pair[c]) is not None])
    state.correction[island.members] = np.hstack([now.velocity[island.members], now.angular_velocity[island.members]]) - before
    return True


def _stop(run: Run, island: Island, contacts: Contacts, entries: list[tuple[PairForce, tuple[int, ...]]]) -> None:
    """The impulses nu of contacts; entries: for each the forces of its pair and its key."""
    now, members = run.state.now, island.members
    of_contacts = contact_rows(now, contacts, members, run.column, 0)
    rows, first_row, frames = of_contacts
    row_velocities(now, contacts, first_row, frames, rows.bias)
    slides = np.array([key in entry.slides or (key not in entry.force and bool(entry.slides)) for entry, key in entries])
    scale = float(np.abs(rows.bias).max(initial=np.finfo(float).tiny))
    solve_with_slip(
        solve_newton, of_contacts, len(members), contacts, slides, SOLVE_TOLERANCE * scale, SLIP * scale
    )
    change_velocities(now, members, rows)
