"""The stage constrain: which contacts last, kept at their gap, and the forces they carry until the end of the step."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.contact import Held, hold_contacts
from rigidimpulse.dynamics.constraints.contact_motion import Motion, contact_motion
from rigidimpulse.dynamics.constraints.energy_limit import limit_correction_energy, note_hold
from rigidimpulse.dynamics.constraints.joint_sub_step import UNSOLVED
from rigidimpulse.dynamics.constraints.position_correction import correct_positions, needs_correction
from rigidimpulse.dynamics.constraints.rattle import forget_forces, remember_forces
from rigidimpulse.dynamics.constraints.rolling_friction import rolling_of
from rigidimpulse.dynamics.energy import kinetic_energy, mechanical_energy
from rigidimpulse.dynamics.impact.point import select
from rigidimpulse.engine.exact.step_size import ALLOWED
from rigidimpulse.engine.islands import Island, collect, make_island, near_contacts
from rigidimpulse.engine.plan import Bound, Skip
from rigidimpulse.engine.touching import refresh_pose

PLAY = 1e-3
"""Energy that forces which are no solution may make, relative."""
TURN = 0.01
"""rad, how far arms and normals of contacts may turn in a sub-step."""
MOST_SUB_STEPS = 256
"""Sub-steps in a step."""
TURN_OF_BODY = 0.1
"""rad, how far bodies may turn in a sub-step where that matters to gaps."""
GROWTH = 1.5
"""How many times longer than the one before a sub-step may be."""
SHORTEST = 1e-5
"""Part of a step that is not split."""
SHORTEST_STOP = 1e-3
"""Part of a step within which it does not matter when a contact stops."""
STEADY = 1e-9
"""rad in a step; what turns less does not."""


@dataclass(frozen=True)
class ContactForces:
    """Lasting contact and joints, solved exactly for each group of touching or joined bodies."""

    stage: str = "constrain"
    name: str = "contact forces"

    def bind(self, world) -> Bound | Skip:
        """In where something can press bodies together."""
        how = f"{world.accuracy.contact_solver}: "
        if world.joints_of_scene:
            return Bound(hold, f"{how}{len(world.joints_of_scene)} joints")
        if not world.can_collide:
            return Skip(world.why_no_impacts)
        if not world.can_press:
            return Skip("no force, no moving support and no spin presses bodies together", hold)
        return Bound(hold, f"{how}bodies may come to rest on each other")


def hold(context, pair_events, island: Island) -> None:
    """Find the lasting contacts of a group and write the wrenches of its members into context.wrench."""
    context.contact_log.close(island.members.tolist(), island.time)
    if island.substepped is not None:
        return
    context.wrench[island.members] = 0.0
    forget_forces(context.state, island.contacts)
    island.held = island.slow()
    if not island.held.any() and not len(island.joints):
        return
    if needs_correction(island.contacts, island.held, island.contact_margin):
        _correct_positions(context, pair_events, island)
    subset = np.flatnonzero(island.held)
    if not len(subset) and not len(island.joints):
        return
    state, now = context.state, context.state.now
    contacts = select(island.contacts, subset)
    motion = contact_motion(
        context.world.geometry, context.world.shape_of_body, state.rotation, now, contacts, island.kinds[subset],
        island.features[subset],
    )
    keys = [island.keys[c] for c in subset]
    force = np.array([state.force_of(key) for key in keys]).reshape(-1, 3)
    before = kinetic_energy(now, context.world, island.members)
    rest = pair_events.end - island.time
    if len(island.joints):
        h, residual = _hold_jointed(context, island, subset, contacts, motion, force, rest)
    else:
        h, residual = _hold_turning(context, island, subset, contacts, keys, motion, force, rest)
    context.log.account(island.time, "stick", kinetic_energy(now, context.world, island.members) - before)
    failed = residual > UNSOLVED or (len(island.joints) > 0 and not context.joints.are_closed)
    if failed and _makes_energy(context, island, h):
        context.wrench[island.members] = 0.0
        force[:] = 0.0
        forget_forces(state, contacts)
        if len(island.joints):
            context.joints.let_go(island)
    note_hold(context, island, contacts, force)
    context.contact_log.replace(island.members.tolist(), island.time, contacts, now.position, force)
    for key, f in zip(keys, force, strict=True):
        state.contact_force[key] = (f, island.time)
    if residual > UNSOLVED:
        names = tuple(context.world.names[i] for i in island.members)
        context.log.report(
            island.time, "contact forces not solved", names, f"residual {residual:.1e}; use a smaller step"
        )
    island.rests = _rests(context, island, h)
    if island.rests and len(island.joints):
        context.joints.log_rest(island)
    if h < rest and not island.rests:
        pair_events.wake[island.members] = island.time + h
    if island.shift > 0.0:
        pair_events.look_around(island.members, island.time, island.shift)


def _makes_energy(context, island: Island, h: float) -> bool:
    """Whether forces that are no solution give the members more kinetic energy than they have, or would have without them.

    On the way, too: half of what joints do is taken back before they are stopped.
    """
    now, i = context.state.now, island.members
    inertia = np.linalg.inv(now.inv_inertia[i])
    taken_back = context.joints.memory.wrench[i] if len(island.joints) else np.zeros((len(i), 6))
    energies = []
    for wrench in (np.zeros((len(i), 6)), context.wrench[i], context.wrench[i] - taken_back):
        v = now.velocity[i] + h * (context.acceleration[i] + now.inv_mass[i, None] * wrench[:, :3])
        spin = context.angular_acceleration[i] + np.einsum("ijk,ik->ij", now.inv_inertia[i], wrench[:, 3:])
        w = now.angular_velocity[i] + h * spin
        energies.append(0.5 * float((context.world.mass[i] * (v**2).sum(1)).sum() + np.einsum("ij,ijk,ik->", w, inertia, w)))
    most = max(energies[0], kinetic_energy(now, context.world, i))
    return not np.max(energies[1:]) <= (1.0 + PLAY) * most


def _hold_turning(
    context, island: Island, subset, contacts, keys, motion: Motion, force, rest: float
) -> tuple[float, float]:
    """Contact forces over a sub-step of at most `rest`; returns its length and the residual."""
    state, step, contact_margin = context.state, context.world.accuracy.step, island.contact_margin[subset]
    rolling = rolling_of(context.world, state.now, contacts)

    def hold_over(h: float, excess: np.ndarray) -> Held:
        h = island.load(context, h)
        context.wrench[island.members] = 0.0
        return hold_contacts(
            context.solve_rows, state.now, contacts, island.members, motion.turning, excess, context.acceleration,
            context.angular_acceleration, h, SHORTEST_STOP * step, context.column, force, context.wrench, rolling,
        )

    if motion.fastest * step <= STEADY:
        held = hold_over(sub_step(motion.fastest, step, rest), np.zeros(len(subset)))
        return held.length, held.residual
    excess = contacts.gap - contact_margin
    first = island.members[0]
    h = sub_step(motion.fastest, step, rest)
    plan = GROWTH * state.sub_step[first] if state.under_contact[first] else np.inf
    h = min(h, plan)
    held = hold_over(h, excess)
    error, share = _foresee(context, island, subset, contacts, motion, force, held.length)
    if share < 1.0:
        state.sub_step[first] = share * held.length
        held = hold_over(share * held.length, excess + share**3 * error)
    elif h >= plan or not state.under_contact[first]:
        state.sub_step[first] = max(h, step / MOST_SUB_STEPS)
    remember_forces(state, island.time, keys, contacts, force, held.force, held.slides)
    return held.length, held.residual


def _hold_jointed(context, island: Island, subset, contacts, motion: Motion, force, rest: float) -> tuple[float, float]:
    """Forces of joints and contacts over a sub-step of at most `rest`; returns its length and the residual."""
    joints, step = context.joints, context.world.accuracy.step
    rolling, moment = rolling_of(context.world, context.state.now, contacts), joints.moment.copy()
    h, residual = joints.hold(context, island, contacts, motion.turning, force, sub_step(motion.fastest, step, rest), rolling)
    if motion.fastest * step > STEADY:
        _, share = _foresee(context, island, subset, contacts, motion, force, h)
        if share < 1.0:
            joints.moment[:] = moment
            h, residual = joints.hold(context, island, contacts, motion.turning, force, share * h, rolling)
    return h, residual


def _foresee(context, island: Island, subset, contacts, motion: Motion, force, h: float) -> tuple[np.ndarray, float]:
    """Errors (m,) of gaps after h [m] under the forces found, and the share of h after which they would be allowed."""
    error = context.error_estimate.gap_errors(context, island, contacts, subset, motion, context.wrench, h)
    error[force[:, 0] == 0.0] = 0.0
    worst = float(np.max(np.abs(error) / (ALLOWED * island.contact_margin[subset])))
    if worst <= 1.0:
        return error, 1.0
    spin = float(np.linalg.norm(context.state.now.angular_velocity[island.members], axis=1).max())
    share = worst ** (-1.0 / 3.0)
    if spin > 0.0:
        share = min(share, TURN_OF_BODY / (spin * h))
    return error, min(max(share, context.world.accuracy.step / (MOST_SUB_STEPS * h)), 1.0)


def sub_step(rate: float, step: float, rest: float) -> float:
    """Length of the next sub-step [s], where arms turn at `rate` [rad/s] and the rest of the step is left."""
    piece = step / min(max(math.ceil(rate * step / TURN), 1), MOST_SUB_STEPS)
    return piece if rest > piece * (1.0 + SHORTEST) else max(rest, SHORTEST * step)


def _correct_positions(context, pair_events, island: Island) -> None:
    """Bring sunken contacts back to their gap and look at the group's contacts again.

    A light body turns far to make room for a heavy one: what it may come near is looked for farther away, and what does not belong to the
    group stands meanwhile.
    """
    state, now = context.state, context.state.now
    place, turn = now.position[island.members].copy(), now.orientation[island.members].copy()
    before = mechanical_energy(now, context.world, island.members)
    held = dict(zip(island.keys, island.slow().tolist(), strict=True))
    around, contact_margin, keys = near_contacts(context, pair_events, island.members, island.time)
    lifted = np.array([held.get(key, False) for key in keys], bool)
    correct_positions(now, around, lifted, contact_margin, island.members, context.column)
    refresh_pose(island.members, now, state.rotation, state.trajectory.inertia)
    context.log.account(island.time, "position correction", mechanical_energy(now, context.world, island.members) - before)
    limit_correction_energy(context, island, around, now.position[island.members] - place, float(contact_margin.max()))
    island.moved = True
    reach = 2.0 * context.world.bound_radius[island.members] * np.linalg.norm(now.orientation[island.members] - turn, axis=1)
    island.shift = float((np.linalg.norm(now.position[island.members] - place, axis=1) + reach).max())
    real, integer = collect(context, pair_events, island.pairs, island.time)
    again = make_island(context, pair_events, island.time, real, integer, np.ones(len(real), bool), island.joints, island.members)
    for name in ("contacts", "place", "kinds", "features", "keys", "contact_margin", "approach", "rest_speed", "live"):
        setattr(island, name, getattr(again, name))
    island.held = island.slow()


def _rests(context, island: Island, h: float) -> bool:
    """Whether all members stand still and their loads are carried, on supports that do not move."""
    world, now = context.world, context.state.now
    i = island.members
    moves = world.moving[island.contacts.body_a].any() or world.moving[island.contacts.body_b].any()
    if len(island.joints):
        moves = moves or world.moving[context.joints.bodies_of(island.joints)].any()
    if moves or (island.loaded and not context.forces.may_rest(i)):
        return False
    limit = TOLERANCES.contact.rest * world.steady_strength[i] * h
    force, torque = context.wrench[i, :3], context.wrench[i, 3:]
    spin = context.angular_acceleration[i] + np.einsum("ijk,ik->ij", now.inv_inertia[i], torque)
    gained = h * (context.acceleration[i] + world.inv_mass[i, None] * force)
    size = np.minimum(world.bound_radius[i], world.size[i])[:, None]
    slow = (
        (np.linalg.norm(now.velocity[i], axis=1) <= limit)
        & (np.linalg.norm(gained, axis=1) <= limit)
        & (np.linalg.norm(size * now.angular_velocity[i], axis=1) <= limit)
        & (np.linalg.norm(size * h * spin, axis=1) <= limit)
    )
    return bool(np.all(slow))
