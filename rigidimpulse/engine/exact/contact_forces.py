"""Contact forces of an exact island: which contacts last, kept at their gap, and the forces they carry until the end of the step."""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.contact import ContactProblem, Held, hold_contacts
from rigidimpulse.dynamics.constraints.contact_motion import Motion, contact_motion
from rigidimpulse.dynamics.constraints.joint_sub_step import UNSOLVED
from rigidimpulse.dynamics.constraints.position_correction import correct_positions, needs_correction
from rigidimpulse.dynamics.constraints.rolling_friction import rolling_of
from rigidimpulse.dynamics.energy import kinetic_energy, mechanical_energy
from rigidimpulse.engine.exact.energy_limit import limit_correction_energy, note_hold
from rigidimpulse.engine.exact.step_size import ALLOWED
from rigidimpulse.engine.exact.velocity_projection import forget_forces, remember_forces
from rigidimpulse.engine.islands import collect, make_island, near_contacts
from rigidimpulse.engine.loads import load_over
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.sleeping import may_sleep
from rigidimpulse.model.contacts import Contacts, select
from rigidimpulse.model.island import Island
from rigidimpulse.motion.evaluate import refresh_pose

PLAY = TOLERANCES.contact_forces.unsolved_energy
TURN = 0.01
"""rad, how far arms and normals of contacts may turn in a sub-step."""
MOST_SUB_STEPS = 256
"""Sub-steps in a step."""
TURN_OF_BODY = 0.1
"""rad, how far bodies may turn in a sub-step where that matters to gaps."""
GROWTH = 1.5
"""How many times longer than the one before a sub-step may be."""
SHORTEST = TOLERANCES.contact_forces.shortest
SHORTEST_STOP = TOLERANCES.contact_forces.shortest_stop
STEADY = TOLERANCES.contact_forces.steady_turn


def hold(run: Run, pair_events: PairEvents, island: Island) -> None:
    """Find the lasting contacts of an island and write the wrenches of its members into run.wrench."""
    run.contact_log.close(island.members.tolist(), island.time)
    run.wrench[island.members] = 0.0
    forget_forces(run.state, island.contacts)
    island.held = island.slow()
    if not island.held.any() and not len(island.joints):
        return
    if needs_correction(island.contacts, island.held, island.contact_margin):
        _correct_positions(run, pair_events, island)
    subset = np.flatnonzero(island.held)
    if not len(subset) and not len(island.joints):
        return
    state, now = run.state, run.state.now
    contacts = select(island.contacts, subset)
    motion = contact_motion(
        run.world.geometry, run.world.shape_of_body, state.rotation, now, contacts, island.kinds[subset],
        island.features[subset],
    )
    keys = [island.keys[c] for c in subset]
    force = np.array([state.force_of(key) for key in keys]).reshape(-1, 3)
    before = kinetic_energy(now, run.world, island.members)
    rest = pair_events.end - island.time
    if len(island.joints):
        h, residual = _hold_jointed(run, island, subset, contacts, motion, force, rest)
    else:
        h, residual = _hold_turning(run, island, subset, contacts, motion, force, rest)
    run.log.account(island.time, "stick", kinetic_energy(now, run.world, island.members) - before)
    failed = residual > UNSOLVED or (len(island.joints) > 0 and not run.joints.are_closed)
    if failed and _makes_energy(run, island, h):
        run.wrench[island.members] = 0.0
        force[:] = 0.0
        forget_forces(state, contacts)
        if len(island.joints):
            run.joints.let_go(island)
    note_hold(run, island, contacts, force)
    run.contact_log.replace(island.members.tolist(), island.time, contacts, now.position, force)
    for key, f in zip(keys, force, strict=True):
        state.contact_force[key] = (f, island.time)
    if residual > UNSOLVED:
        names = tuple(run.world.names[i] for i in island.members)
        run.log.report(
            island.time, "contact forces not solved", names, f"residual {residual:.1e}; use a smaller step"
        )
    island.rests = may_sleep(run, island, h)
    if island.rests and len(island.joints):
        run.joints.log_rest(island)
    if h < rest and not island.rests:
        pair_events.wake[island.members] = island.time + h
    if island.shift > 0.0:
        pair_events.look_around(island.members, island.time, island.shift)


def _makes_energy(run: Run, island: Island, h: float) -> bool:
    """Whether forces that are no solution give the members more kinetic energy than they have, or would have without them.

    On the way, too: half of what joints do is taken back before they are stopped.
    """
    now, i = run.state.now, island.members
    inertia = np.linalg.inv(now.inv_inertia[i])
    taken_back = run.joints.memory.wrench[i] if len(island.joints) else np.zeros((len(i), 6))
    energies = []
    for wrench in (np.zeros((len(i), 6)), run.wrench[i], run.wrench[i] - taken_back):
        v = now.velocity[i] + h * (run.acceleration[i] + now.inv_mass[i, None] * wrench[:, :3])
        spin = run.angular_acceleration[i] + np.einsum("ijk,ik->ij", now.inv_inertia[i], wrench[:, 3:])
        w = now.angular_velocity[i] + h * spin
        energies.append(0.5 * float((run.world.mass[i] * (v**2).sum(1)).sum() + np.einsum("ij,ijk,ik->", w, inertia, w)))
    most = max(energies[0], kinetic_energy(now, run.world, i))
    return not np.max(energies[1:]) <= (1.0 + PLAY) * most


def _hold_turning(
    run: Run, island: Island, subset: np.ndarray, contacts: Contacts, motion: Motion, force: np.ndarray, rest: float
) -> tuple[float, float]:
    """Contact forces over a sub-step of at most `rest`; returns its length and the residual."""
    state, step, contact_margin = run.state, run.world.accuracy.step, island.contact_margin[subset]
    rolling = rolling_of(run.world, state.now, contacts)

    def hold_over(h: float, excess: np.ndarray) -> Held:
        h = load_over(run, island, h)
        run.wrench[island.members] = 0.0
        problem = ContactProblem(
            state.now, contacts, island.members, run.column, motion.turning, run.acceleration, run.angular_acceleration
        )
        return hold_contacts(run.solve_rows, problem, excess, h, SHORTEST_STOP * step, force, run.wrench, rolling)

    if motion.fastest * step <= STEADY:
        held = hold_over(sub_step(motion.fastest, step, rest), np.zeros(len(subset)))
        return held.length, held.residual
    excess = contacts.gap - contact_margin
    first = island.members[0]
    h = sub_step(motion.fastest, step, rest)
    plan = GROWTH * state.sub_step[first] if state.under_contact[first] else np.inf
    h = min(h, float(plan))
    held = hold_over(h, excess)
    error, share = _estimate_error(run, island, subset, contacts, motion, force, held.length)
    if share < 1.0:
        state.sub_step[first] = share * held.length
        held = hold_over(share * held.length, excess + share**3 * error)
    elif h >= plan or not state.under_contact[first]:
        state.sub_step[first] = max(h, step / MOST_SUB_STEPS)
    keys = [island.keys[c] for c in subset]
    remember_forces(state, island.time, keys, contacts, force, held.force, held.slides)
    return held.length, held.residual


def _hold_jointed(
    run: Run, island: Island, subset: np.ndarray, contacts: Contacts, motion: Motion, force: np.ndarray, rest: float
) -> tuple[float, float]:
    """Forces of joints and contacts over a sub-step of at most `rest`; returns its length and the residual."""
    joints, step = run.joints, run.world.accuracy.step
    rolling, moment = rolling_of(run.world, run.state.now, contacts), joints.moment.copy()
    h, residual = joints.hold(run, island, contacts, motion.turning, force, sub_step(motion.fastest, step, rest), rolling)
    if motion.fastest * step > STEADY:
        _, share = _estimate_error(run, island, subset, contacts, motion, force, h)
        if share < 1.0:
            joints.moment[:] = moment
            h, residual = joints.hold(run, island, contacts, motion.turning, force, share * h, rolling)
    return h, residual


def _estimate_error(
    run: Run, island: Island, subset: np.ndarray, contacts: Contacts, motion: Motion, force: np.ndarray, h: float
) -> tuple[np.ndarray, float]:
    """Errors (m,) of gaps after h [m] under the forces found, and the share of h after which they would be allowed."""
    error = run.error_estimate.gap_errors(run, island, contacts, subset, motion, h)
    error[force[:, 0] == 0.0] = 0.0
    worst = float(np.max(np.abs(error) / (ALLOWED * island.contact_margin[subset])))
    if worst <= 1.0:
        return error, 1.0
    spin = float(np.linalg.norm(run.state.now.angular_velocity[island.members], axis=1).max())
    share = worst ** (-1.0 / 3.0)
    if spin > 0.0:
        share = min(share, TURN_OF_BODY / (spin * h))
    return error, min(max(share, run.world.accuracy.step / (MOST_SUB_STEPS * h)), 1.0)


def sub_step(rate: float, step: float, rest: float) -> float:
    """Length of the next sub-step [s], where arms turn at `rate` [rad/s] and the rest of the step is left."""
    piece = step / min(max(math.ceil(rate * step / TURN), 1), MOST_SUB_STEPS)
    return piece if rest > piece * (1.0 + SHORTEST) else max(rest, SHORTEST * step)


def _correct_positions(run: Run, pair_events: PairEvents, island: Island) -> None:
    """Bring sunken contacts back to their gap and look at the island's contacts again.

    A light body may turn far to get out of the way of a heavy one, so its neighbours are looked for within a larger distance. Bodies
    outside the island do not move.
    """
    state, now = run.state, run.state.now
    place, turn = now.position[island.members].copy(), now.orientation[island.members].copy()
    before = mechanical_energy(now, run.world, island.members)
    held = dict(zip(island.keys, island.slow().tolist(), strict=True))
    around, contact_margin, keys = near_contacts(run, pair_events, island.members, island.time)
    lifted = np.array([held.get(key, False) for key in keys], bool)
    correct_positions(now, around, lifted, contact_margin, island.members, run.column)
    refresh_pose(island.members, now, state.rotation, state.trajectory.inertia)
    run.log.account(island.time, "position correction", mechanical_energy(now, run.world, island.members) - before)
    limit_correction_energy(run, island, around, now.position[island.members] - place, float(contact_margin.max()))
    island.moved = True
    reach = 2.0 * run.world.bound_radius[island.members] * np.linalg.norm(now.orientation[island.members] - turn, axis=1)
    island.shift = float((np.linalg.norm(now.position[island.members] - place, axis=1) + reach).max())
    found = collect(run, pair_events, island.pairs, island.time)
    again = make_island(run, pair_events, island.time, found, np.ones(len(found[0]), bool), island.joints, island.members)
    for name in ("contacts", "place", "kinds", "features", "keys", "contact_margin", "approach", "rest_speed", "live"):
        setattr(island, name, getattr(again, name))
    island.held = island.slow()
