"""New trajectories for the bodies of an island whose motion changed: parabola and free or forced rotation, or lines of varying forces."""

from __future__ import annotations

from math import isfinite

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.energy import mechanical_energy
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.pair_table import sweep_pair_again
from rigidimpulse.engine.run import Run
from rigidimpulse.model.island import Island
from rigidimpulse.motion.trajectory import FIXED, FORCED, FREE, Load, take

HALF_KEPT = 0.55
"""Held contacts nearer than this part of the contact margin have half of their gap as impact margin."""
LEAVING = TOLERANCES.events.leaving
WHOLE = 1.0 - TOLERANCES.events.whole
NOTHING = np.zeros(3)
NO_LOAD = Load(NOTHING, NOTHING, NOTHING, NOTHING)


def begin_trajectories(run: Run, pair_events: PairEvents, island: Island) -> None:
    """New trajectories for members whose velocity, pose or wrench changed, and the gaps at which pairs meet next.

    Members that varying forces act on, and nothing holds, fly under them for as long as the error of a step allows.
    """
    if island.free is not None and not island.loaded:
        members = island.members[run.forces.acts[island.members]]
        h = run.forces.fly(run, members, island.time, pair_events.end)
        pair_events.wake[members] = np.where(h < (pair_events.end - island.time) * WHOLE, island.time + h, np.inf)
    state, now = run.state, run.state.now
    trajectory = state.trajectory
    for n, i in enumerate(island.members.tolist()):
        if pair_events.inside[i] or (island.rests and trajectory.mode[i] == FIXED and not island.moved):
            continue
        if (
            island.moved
            or state.under_contact[i]
            or (now.velocity[i] != island.velocity[n]).any()
            or (now.angular_velocity[i] != island.angular_velocity[n]).any()
            or run.wrench[i].any()
            or island.free is not None
        ):
            begin_trajectory(run, pair_events, i, island.time, run.wrench[i], island.rests)
    set_margins(run, pair_events, island)


def begin_trajectory(run: Run, pair_events: PairEvents, i: int, time: float, wrench: np.ndarray, rests: bool) -> None:
    """Body i gets a new trajectory at `time`, from its present state, with a constant wrench (6,)."""
    state, world, now = run.state, run.world, run.state.now
    trajectory = state.trajectory
    if not isfinite(float(now.velocity[i].sum() + now.angular_velocity[i].sum())):
        run.quarantine(i, time)
        rests = True
    run.recorder.flush(trajectory, i, time, state.correction[i])
    state.correction[i] = 0.0
    run.contact_log.close([i], time)
    run.forces.log.end(i, time)
    account_contact_work(run, i, time)
    pressed = not rests and bool(wrench.any())
    if rests:
        now.velocity[i] = now.angular_velocity[i] = 0.0
        take(trajectory, i, time, now, NO_LOAD, FIXED)
    elif run.forces.acts[i]:
        total, rate = wrench + run.forces.value[i], run.forces.rate[i]
        acceleration, jerk = world.steady_acceleration[i] + world.inv_mass[i] * total[:3], world.inv_mass[i] * rate[:3]
        turned = total[3:].any() or rate[3:].any()
        take(trajectory, i, time, now, Load(acceleration, total[3:], jerk, rate[3:]), FORCED if turned else FREE)
    else:
        acceleration = world.steady_acceleration[i]
        if pressed:
            acceleration = acceleration + world.inv_mass[i] * wrench[:3]
        turned = pressed and wrench[3:].any()
        take(trajectory, i, time, now, Load(acceleration, wrench[3:], NOTHING, NOTHING), FORCED if turned else FREE)
    state.under_contact[i] = pressed
    if pressed:
        state.energy_at_start[i] = mechanical_energy(now, world, np.array([i])) - work_of_forces(run, i)
    pair_events.trajectory_changed(i, time)


def account_contact_work(run: Run, i: int, time: float) -> None:
    """Work that contact forces did along the trajectory that ends: what its energy changed by."""
    end_energy = run.state.end_energy.pop(i, None)
    if end_energy is not None:
        begun, ended = run.state.energy_at_start[i], end_energy - work_of_forces(run, i)
        run.log.stretches.append((run.state.trajectory.start[i], time, i, begun, ended - begun))


def work_of_forces(run: Run, i: int) -> float:
    """What varying forces did on body i until its present trajectory began, J."""
    return float(run.forces.log.work[i])


def set_margins(run: Run, pair_events: PairEvents, island: Island) -> None:
    """Gaps at which the island's pairs come to contact next."""
    if len(island.place):
        held = np.zeros(len(island.place), bool) if island.held is None else island.held
        pairs, dynamic = pair_events.pairs, run.world.dynamic
        set_impact_margins(pairs, island.place, island.contacts.gap, held, island.time, dynamic, pair_events.inside)


@jit
def set_impact_margins(pairs, place, gap, held, time, dynamic, inside):
    """Held pairs are guarded at half their gap, leaving ones where they are; place, gap, held (m,) of contacts, pair after pair."""
    first = 0
    while first < place.shape[0]:
        p, last, nearest, is_held = place[first], first, np.inf, False
        while last < place.shape[0] and place[last] == p:
            nearest, is_held = min(nearest, gap[last]), is_held or held[last]
            last += 1
        first = last
        contact_margin, impact_margin = pairs.contact_margin[p], pairs.least_impact_margin[p]
        if is_held:
            impact_margin = 0.5 * contact_margin if nearest > HALF_KEPT * contact_margin else 0.5 * nearest
        elif nearest <= impact_margin:
            impact_margin = nearest * (1.0 - LEAVING) if impact_margin > 0.0 else min(nearest, 0.0)
        if impact_margin != pairs.impact_margin[p]:
            pairs.impact_margin[p] = impact_margin
            sweep_pair_again(pairs, p, time, dynamic, inside)
