"""New trajectories for the bodies of an island whose motion changed: parabola and free or forced rotation, or lines of varying forces."""

from __future__ import annotations

from math import isfinite, isnan
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.energy import mechanical_energy
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.pair_table import SHORT, PairBodies, PairTable, pair_bodies, renew_pairs, sweep_pair_again
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.touching import Motion
from rigidimpulse.model.island import Island
from rigidimpulse.model.state import EnergyLimiter
from rigidimpulse.model.world import Margins
from rigidimpulse.motion.trajectory import FIXED, FORCED, FREE, Load, take
from rigidimpulse.recording.contact_log import ContactBuffers, close_contacts
from rigidimpulse.recording.events import LogBuffers, log_stretch
from rigidimpulse.recording.recorder import Frames, flush_frames

HALF_KEPT = 0.55
"""Held contacts nearer than this part of the contact margin have half of their gap as impact margin."""
LEAVING = TOLERANCES.events.leaving
WHOLE = 1.0 - TOLERANCES.events.whole


class Passage(NamedTuple):
    """What changes where a body passes from one trajectory to the next."""

    bodies: PairBodies
    margins: Margins
    motion: Motion
    table: PairTable
    limiter: EnergyLimiter
    log: LogBuffers
    contact_log: ContactBuffers
    frames: Frames
    written: np.ndarray  # (n,) frames of each body


def begin_trajectories(run: Run, pair_events: PairEvents, island: Island) -> None:
    """New trajectories for members whose velocity, pose or wrench changed, and the gaps at which pairs meet next.

    Members that varying forces act on, and nothing holds, fly under them for as long as the error of a step allows.
    """
    if island.free is not None and not island.loaded:
        members = island.members[run.forces.acts[island.members]]
        h = run.forces.fly(run, members, island.time, pair_events.end)
        pair_events.wake[members] = np.where(h < (pair_events.end - island.time) * WHOLE, island.time + h, np.inf)
    members = island.members[_changed(run, island) & ~pair_events.inside[island.members]]
    if _are_steady(run, members):
        _begin_steady(run, pair_events, members, island.time, island.rests)
    else:
        for i in members.tolist():
            begin_trajectory(run, pair_events, i, island.time, (run.wrench[i], run.wrench_rate[i]), island.rests)
    run.state.by_joints[members] = len(island.joints) > 0 and len(island.place) == 0
    set_margins(run, pair_events, island)


def _changed(run: Run, island: Island) -> np.ndarray:
    """Which members (k,) do not go on as they did."""
    state, now, members = run.state, run.state.now, island.members
    if island.moved or island.free is not None:
        changed = np.ones(len(members), bool)
    else:
        changed = state.under_contact[members] | run.wrench[members].any(axis=1)
        changed |= (now.velocity[members] != island.velocity).any(axis=1)
        changed |= (now.angular_velocity[members] != island.angular_velocity).any(axis=1)
    return changed & (state.trajectory.mode[members] != FIXED) if island.rests and not island.moved else changed


def _are_steady(run: Run, members: np.ndarray) -> bool:
    """Whether nothing that varies acts on the members, and all their velocities are numbers."""
    if run.world.force_tables or run.wrench_rate[members].any():
        return False
    now = run.state.now
    return bool(np.isfinite(now.velocity[members]).all() and np.isfinite(now.angular_velocity[members]).all())


def _begin_steady(run: Run, pair_events: PairEvents, members: np.ndarray, time: float, rests: bool) -> None:
    """New trajectories for members on which nothing that varies acts, as `begin_trajectory` makes them, in one kernel."""
    state, world, done = run.state, run.world, 0
    run.triggers.turn(members, time)
    run.log.reserve(stretches=len(members))
    while done < len(members):
        passage = Passage(
            pair_bodies(world), world.margins, run.motion, pair_events.table, state.limiter, run.log.buffers, run.contact_log.buffers,
            run.recorder.frames, run.recorder.written,
        )  # fmt: skip
        done = begin_steady_trajectories(passage, members, done, (time, pair_events.end), run.wrench, rests, state.by_joints)
        pair_events.add_missing_pairs(time)


@jit
def begin_steady_trajectories(passage, members, first, interval, wrench, rests, by_joints):
    """Begin the trajectories of members (k,) from place `first` on, until one finds no space for a pair; returns the place behind it.

    wrench (n, 6): held constant; by_joints (n,): of the trajectories that end. See `begin_steady_trajectory`.
    """
    for s in range(first, members.shape[0]):
        i = members[s]
        begin_steady_trajectory(passage, i, interval, wrench[i], rests, by_joints[i])
        if passage.table.number[SHORT]:
            return s + 1
    return members.shape[0]


@jit_making_arrays
def begin_steady_trajectory(passage, i, interval, wrench, rests, by_joints):
    """Body i, whose velocity is finite, goes on from its present state under its steady load and a constant wrench (6,).

    passage: `Passage`, or a record that has its fields, with space for a stretch; interval: from when to the end of the step, s; by_joints:
    whether joints alone held the body on the trajectory that ends.
    """
    motion, limiter, time, one = passage.motion, passage.limiter, interval[0], np.empty(1, np.int64)
    trajectory, one[0] = motion.trajectory, i
    flush_frames(trajectory, i, time, limiter.correction[i], passage.written, passage.frames)
    for k in range(6):
        limiter.correction[i, k] = 0.0
    close_contacts(passage.contact_log, one, time)
    end_energy, begun = limiter.end_energy[i], limiter.energy_at_start[i]
    if end_energy == end_energy:
        limiter.end_energy[i] = np.nan
        log_stretch(passage.log, trajectory.start[i], time, i, begun, end_energy - begun, by_joints)
    pressed = take_steady_load(motion, passage.bodies.constants, i, time, wrench, rests)
    limiter.under_contact[i] = pressed
    if pressed:
        limiter.energy_at_start[i] = mechanical_energy(motion.now, passage.bodies.constants, one)
    renew_pairs(passage.bodies, passage.margins, passage.table, trajectory, i, interval)


def begin_trajectory(run: Run, pair_events: PairEvents, i: int, time: float, held: tuple[np.ndarray, np.ndarray], rests: bool) -> None:
    """Body i gets a new trajectory at `time`, from its present state; held: the wrench (6,) that holds it, and its change (6,) a second."""
    state, world, now = run.state, run.world, run.state.now
    trajectory = state.trajectory
    if not isfinite(float(now.velocity[i].sum() + now.angular_velocity[i].sum())):
        run.quarantine(i, time)
        rests = True
    run.triggers.turn(np.array([i]), time)
    run.recorder.flush(trajectory, i, time, state.correction[i])
    state.correction[i] = 0.0
    run.contact_log.close(np.array([i]), time)
    run.forces.log.end(i, time, now)
    account_contact_work(run, i, time)
    total, rate = held
    if run.forces.acts[i]:
        total, rate = total + run.forces.value[i], rate + run.forces.rate[i]
    if (run.forces.acts[i] or rate.any()) and not rests:
        acceleration, jerk = world.steady_acceleration[i] + world.inv_mass[i] * total[:3], world.inv_mass[i] * rate[:3]
        turned = total[3:].any() or rate[3:].any()
        take(trajectory, i, time, now, Load(acceleration, total[3:], jerk, rate[3:]), FORCED if turned else FREE)
        pressed = bool(held[0].any())
    else:
        pressed = take_steady_load(run.motion, world.constants, i, time, total, rests)
    state.under_contact[i] = pressed
    if pressed:
        state.limiter.energy_at_start[i] = mechanical_energy(now, world.constants, np.array([i])) - work_of_forces(run, i)
    pair_events.trajectory_changed(i, time)


@jit_making_arrays
def take_steady_load(motion, constants, i, time, wrench, rests):
    """Let body i go on from its present state at `time` under its steady load and a constant wrench (6,), or stay where it rests.

    Returns whether the wrench presses it.
    """
    now, zero, acceleration, torque = motion.now, np.zeros(3), np.empty(3), np.empty(3)
    pressed, turned = False, False
    for k in range(3):
        pressed = pressed or wrench[k] != 0.0 or wrench[3 + k] != 0.0
        turned = turned or wrench[3 + k] != 0.0
        torque[k] = wrench[3 + k]
        if rests:
            now.velocity[i, k] = now.angular_velocity[i, k] = 0.0
    if rests:
        take(motion.trajectory, i, time, now, Load(zero, zero, zero, zero), FIXED)
        return False
    for k in range(3):
        acceleration[k] = constants.steady_acceleration[i, k]
        if pressed:
            acceleration[k] += now.inv_mass[i] * wrench[k]
    take(motion.trajectory, i, time, now, Load(acceleration, torque, zero, zero), FORCED if turned else FREE)
    return pressed


def account_contact_work(run: Run, i: int, time: float) -> None:
    """Work that contact forces did along the trajectory that ends: what its energy changed by."""
    limiter = run.state.limiter
    begun, end_energy = limiter.energy_at_start[i], limiter.end_energy[i]
    if not isnan(end_energy):
        limiter.end_energy[i] = np.nan
        work = end_energy - work_of_forces(run, i) - begun
        run.log.add_stretch(run.state.trajectory.start[i], time, i, begun, work, bool(run.state.by_joints[i]))


def work_of_forces(run: Run, i: int) -> float:
    """What varying forces did on body i until its present trajectory began, J."""
    return float(run.forces.log.work[i])


def set_margins(run: Run, pair_events: PairEvents, island: Island) -> None:
    """Gaps at which the island's pairs come to contact next."""
    if not len(island.place):
        return
    held = np.zeros(len(island.place), bool) if island.held is None else island.held
    set_impact_margins(pair_events.table, island.place, island.contacts.gap, held, island.time, run.world.dynamic)


@jit
def set_impact_margins(table, place, gap, held, time, dynamic):
    """Held pairs are guarded at half their gap, leaving ones where they are; place, gap, held (m,) of contacts, pair after pair."""
    first = 0
    while first < place.shape[0]:
        p, last, nearest, is_held = place[first], first, np.inf, False
        while last < place.shape[0] and place[last] == p:
            nearest, is_held = min(nearest, gap[last]), is_held or held[last]
            last += 1
        first = last
        pair = table.pairs[p]
        impact_margin = pair.least_impact_margin
        if is_held:
            impact_margin = 0.5 * pair.contact_margin if nearest > HALF_KEPT * pair.contact_margin else 0.5 * nearest
        elif nearest <= impact_margin:
            impact_margin = nearest * (1.0 - LEAVING) if impact_margin > 0.0 else min(nearest, 0.0)
        if impact_margin != pair.impact_margin:
            pair.impact_margin = impact_margin
            sweep_pair_again(table, p, time, dynamic)
