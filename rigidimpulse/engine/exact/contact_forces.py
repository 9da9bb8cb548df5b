"""Contact forces of an exact island: which contacts last, kept at their gap, and the forces they carry until the end of the step."""

from __future__ import annotations

from functools import partial
from math import sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import turned
from rigidimpulse.dynamics.constraints.contact import ContactProblem, Held
from rigidimpulse.dynamics.constraints.contact_motion import contact_motion, no_motion
from rigidimpulse.dynamics.constraints.joint_sub_step import UNSOLVED
from rigidimpulse.dynamics.constraints.position_correction import Sunk, correct_positions, needs_correction
from rigidimpulse.dynamics.constraints.rolling_friction import NO_ROLLING, Rolling, rolling_of
from rigidimpulse.dynamics.energy import kinetic_energy, kinetic_of, mechanical_energy
from rigidimpulse.engine.exact.energy_limit import limit_correction_energy, note_hold
from rigidimpulse.engine.exact.step_size import Forces, StepLimits, Turning, estimate_error, hold_turning, sub_step, turns
from rigidimpulse.engine.islands import forces_of, look_again, near_contacts
from rigidimpulse.engine.loads import load_over
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.sleeping import may_sleep
from rigidimpulse.model.contact_memory import forget_forces, identity, keep_forces, keep_wrenches
from rigidimpulse.model.contacts import Contacts, Touching, select
from rigidimpulse.model.island import Island, empty_contacts
from rigidimpulse.motion.evaluate import refresh_pose

DEPTH = TOLERANCES.manifold.depth
PLAY = TOLERANCES.contact_forces.unsolved_energy
NOT_SOLVED_REMEDY = "residual {value:.1e}; use a smaller step"
NO_SUPPORTS, NO_MOTION = np.zeros(0, np.int64), no_motion()


def hold(run: Run, pair_events: PairEvents, island: Island) -> None:
    """Find the lasting contacts of an island and write the wrenches of its members into run.wrench."""
    state, number = run.state, run.world.num_bodies
    run.contact_log.close(island.members, island.time)
    run.wrench[island.members] = run.wrench_rate[island.members] = 0.0
    island.held = island.slow()
    if len(island.place):
        forget_forces(state.memory, number, island.contacts)
        inside = leaves_from_inside(pair_events.table.pairs, island.place, island.contacts, island.held)
        if needs_correction(island.contacts, island.held, inside, island.contact_margin):
            _correct_positions(run, pair_events, island, inside)
    subset = np.flatnonzero(island.held)
    if not len(subset) and not len(island.joints):
        pair_events.look_around(island.members, island.time, island.shift)
        return
    now, constants, lasts = state.now, run.world.constants, len(subset) > 0
    contacts = select(island.contacts, subset) if lasts else empty_contacts(0)
    turning, problem = _problem(run, island, subset, contacts)
    forces = Forces(forces_of(run, contacts, turning.touching), run.wrench)
    before = kinetic_energy(now, constants, island.members) if lasts else 0.0
    rest, held = pair_events.end - island.time, None
    if len(island.joints):
        h, residual = _hold_jointed(run, island, problem, turning, forces, rest)
    else:
        held = _hold_contacts(run, island, problem, turning, forces, rest)
        h, residual = held.length, held.residual
    if lasts:
        run.log.account(island.time, "stick", kinetic_energy(now, constants, island.members) - before)
    failed = residual > UNSOLVED or (len(island.joints) > 0 and not run.joints.are_closed)
    if failed and len(island.joints) and run.substepped.may_take(island.members):
        # Sub-steps hold them from here on: the island is looked at again at this instant.
        run.wrench[island.members] = 0.0
        run.joints.let_go(island)
        pair_events.wake[island.members] = island.time
        return
    taken_back = run.joints.memory.wrench if len(island.joints) else None
    if failed and makes_energy(problem, constants, run.wrench, taken_back, h):
        run.wrench[island.members] = 0.0
        forces.force[:] = 0.0
        held = None
        if len(island.joints):
            run.joints.let_go(island)
    supports, passive = _other_supports(run, island)
    # Without contact joints keep energy by themselves, up and down: what they gain they lose.
    passive = passive and (not len(island.joints) or bool(np.any(forces.force[:, 0] > 0.0)))
    note_hold(state.limiter, now, constants, contacts, island.members, supports, passive)
    if lasts:
        run.contact_log.replace(island.members, island.time, contacts, now.position, forces.force)
        state.remember(len(subset))
        keep_forces(state.memory, number, island.time, contacts, turning.touching, forces.force)
    if held is not None and turns(turning.motion, run.world.accuracy.step):
        keep_wrenches(state.memory, number, island.time, contacts, held.force, held.slides)
    if failed and len(island.joints):
        run.joints.report_open(run, island)
    if residual > UNSOLVED:
        names = tuple(run.world.names[i] for i in island.members)
        run.log.report(
            island.time, "contact forces not solved", names, NOT_SOLVED_REMEDY.format(value=residual)
        )
    island.rests = may_sleep(run, island, problem, h)
    if island.rests and len(island.joints):
        run.joints.log_rest(island)
    # What joints hold may have been flown past by now.
    if h < pair_events.end - island.time and not island.rests:
        pair_events.wake[island.members] = island.time + h
    pair_events.look_around(island.members, island.time, island.shift)


def _other_supports(run: Run, island: Island) -> tuple[np.ndarray, bool]:
    """What stands at the joints of an island (see `energy_limit`), and whether neither joints nor varying forces make energy."""
    if not len(island.joints):
        return NO_SUPPORTS, island.free is None
    return run.joints.supports_of(island.joints), island.free is None and run.joints.are_passive(island.joints)


def _problem(run: Run, island: Island, subset: np.ndarray, contacts: Contacts) -> tuple[Turning, ContactProblem]:
    """The lasting contacts of an island, which are the given subset of its contacts, as the kernels take them."""
    shapes, state, touching = run.world.compiled_shapes, run.state, Touching(*(column[subset] for column in island.touching))
    motion = NO_MOTION
    if len(subset):
        motion = contact_motion(shapes.geometry, shapes.of_body, state.rotation, state.now, contacts, touching.kind, touching.feature)
    problem = ContactProblem(
        state.now, contacts, island.members, run.column, motion.turning, run.acceleration, run.angular_acceleration
    )
    return Turning(motion, touching, island.contact_margin[subset]), problem


def _hold_contacts(run: Run, island: Island, problem: ContactProblem, turning: Turning, forces: Forces, rest: float) -> Held:
    """Contact forces over a sub-step of at most `rest`."""
    limits = StepLimits(rest, run.world.accuracy.step, run.state.sub_step, run.state.under_contact)
    load = None if island.free is None else partial(load_over, run, island)
    return hold_turning(run.solve_rows, load, problem, turning, run.error_estimate, limits, forces, _rolling(run, problem))


def _hold_jointed(
    run: Run, island: Island, problem: ContactProblem, turning: Turning, forces: Forces, rest: float
) -> tuple[float, float]:
    """Forces of joints and contacts over a sub-step of at most `rest`; returns its length and the residual."""
    joints, step, motion, rolling = run.joints, run.world.accuracy.step, turning.motion, _rolling(run, problem)
    contacts, moment = problem.contacts, joints.moment.copy()
    h, residual = joints.hold(run, island, contacts, motion.turning, forces.force, sub_step(motion.fastest, step, rest), rolling)
    if turns(motion, step):
        _, share = estimate_error(problem, turning, run.error_estimate, forces, h, step)
        if share < 1.0:
            joints.moment[:] = moment
            h, residual = joints.hold(run, island, contacts, motion.turning, forces.force, share * h, rolling)
    return h, residual


def _rolling(run: Run, problem: ContactProblem) -> Rolling:
    """Rolling friction of the contacts."""
    if not run.world.rolling.size:
        return NO_ROLLING
    return rolling_of(run.world.rolling, run.world.material_of_body, problem.bodies, problem.contacts)


@jit_making_arrays
def makes_energy(problem, constants, wrench, taken_back, h):
    """Whether forces that are no solution give the members more kinetic energy than they have, or would have after h without them.

    wrench (n, 6); taken_back (n, 6): half of what joints do, which is taken back before they are stopped, None without joints. Energy may
    not be made on the way, either.
    """
    members, bodies = problem.members, problem.bodies
    given, less = np.zeros((members.shape[0], 6)), np.zeros((members.shape[0], 6))
    free = _energy_after(problem, constants, given, h)
    for n in range(members.shape[0]):
        for k in range(6):
            given[n, k] = less[n, k] = wrench[members[n], k]
            if taken_back is not None:
                less[n, k] -= taken_back[members[n], k]
    now = kinetic_energy(bodies, constants, members)
    most = (1.0 + PLAY) * max(free, now)
    return not (_energy_after(problem, constants, given, h) <= most and _energy_after(problem, constants, less, h) <= most)


@jit_making_arrays
def _energy_after(problem, constants, wrench, h):
    """Kinetic energy [J] of the k members after h under wrenches (k, 6), at their present pose."""
    bodies, one, energy = problem.bodies, np.zeros(1, np.int64), 0.0
    v, w = np.empty((1, 3)), np.empty((1, 3))
    for n in range(problem.members.shape[0]):
        i = problem.members[n]
        torque = turned(bodies.inv_inertia[i], wrench[n, 3:])
        for k in range(3):
            v[0, k] = bodies.velocity[i, k] + h * (problem.acceleration[i, k] + bodies.inv_mass[i] * wrench[n, k])
            w[0, k] = bodies.angular_velocity[i, k] + h * (problem.angular_acceleration[i, k] + torque[k])
        energy += kinetic_of(v, w, bodies.orientation[i : i + 1], constants.mass[i : i + 1], constants.inertia[i : i + 1], one)
    return energy


def _correct_positions(run: Run, pair_events: PairEvents, island: Island, leaves: np.ndarray) -> None:
    """Bring sunken contacts back to their gap, and those that leave from inside, leaves (m,) bool, apart; look at all contacts again.

    A light body may turn far to get out of the way of a heavy one, so its neighbours are looked for within a larger distance. Bodies
    outside the island do not move.
    """
    state, now, members, constants = run.state, run.state.now, island.members, run.world.constants
    place, turn = now.position[members].copy(), now.orientation[members].copy()
    before = mechanical_energy(now, constants, members)
    around, contact_margin, touching = near_contacts(run, pair_events, members, island.time)
    lifted, inside = np.zeros((2, len(contact_margin)), bool)
    mark_same(island.contacts, island.touching, island.held, around, touching, lifted)
    mark_same(island.contacts, island.touching, leaves, around, touching, inside)
    correct_positions(now, around, Sunk(lifted, inside, contact_margin), members, run.column)
    refresh_pose(members, now, state.rotation, state.trajectory.inertia)
    if len(island.joints):
        run.joints.follow(run, island, near_contacts(run, pair_events, members, island.time)[0])
    run.log.account(island.time, "position correction", mechanical_energy(now, constants, members) - before)
    supports, passive = _other_supports(run, island)
    if passive:
        # Joints carry a displacement far: nothing of what it gains is left to them.
        way, depth = now.position[members] - place, 0.0 if len(island.joints) else float(contact_margin.max())
        change = limit_correction_energy(now, constants, around, members, supports, way, depth)
        run.log.account(island.time, "energy correction", change)
    island.moved = True
    island.shift = shift_of(now, run.world.bound_radius, members, place, turn)
    again = look_again(run, pair_events, island)
    for name in ("contacts", "place", "touching", "contact_margin", "speeds", "live"):
        setattr(island, name, getattr(again, name))
    island.held = island.slow()


@jit_making_arrays
def leaves_from_inside(pairs, place, contacts, held):
    """Contacts (m,) bool a little inside each other that do not last, of surfaces without a radius; held (m,) bool: those that do.

    place (m,): their pairs. Surfaces with a radius may be inside each other by round-off: they are met at no gap. What is deeper than
    DEPTH margins, as rough ways of finding impacts leave it, moves out by its own speed.
    """
    inside = np.empty(held.shape[0], np.bool_)
    for c in range(held.shape[0]):
        pair = pairs[place[c]]
        is_near = -DEPTH * pair.contact_margin < contacts.gap[c] <= 0.0
        inside[c] = is_near and not held[c] and pair.least_impact_margin > 0.0
    return inside


@jit
def mark_same(contacts, touching, which, others, others_touching, mark):
    """Mark (k,) those of other contacts that are among the given ones, which (m,) bool."""
    for c in range(mark.shape[0]):
        what = identity(others_touching.kind[c], others_touching.feature[c, 0], others_touching.feature[c, 1])
        for d in range(which.shape[0]):
            same = contacts.body_a[d] == others.body_a[c] and contacts.body_b[d] == others.body_b[c]
            if which[d] and same and what == identity(touching.kind[d], touching.feature[d, 0], touching.feature[d, 1]):
                mark[c] = True


@jit
def shift_of(bodies, radius, members, place, turn):
    """How far points of the members have moved at most since they were at place (k, 3) and orientation turn (k, 4), m; radius (n,) m."""
    shift = 0.0
    for s in range(members.shape[0]):
        i, moved, turned_by = members[s], 0.0, 0.0
        for k in range(3):
            moved += (bodies.position[i, k] - place[s, k]) ** 2
        for k in range(4):
            turned_by += (bodies.orientation[i, k] - turn[s, k]) ** 2
        shift = max(shift, sqrt(moved) + 2.0 * radius[i] * sqrt(turned_by))
    return shift
