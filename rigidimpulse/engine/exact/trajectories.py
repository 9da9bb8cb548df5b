"""The stage integrate: new courses for the bodies of a group whose motion changed."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.dynamics.energy import mechanical_energy
from rigidimpulse.engine.islands import Island
from rigidimpulse.engine.pair_table import sweep_pair_again
from rigidimpulse.engine.plan import Bound, Skip
from rigidimpulse.motion.trajectory import FIXED, FORCED, FREE, Load, take

HALF_KEPT = 0.55
"""Held contacts nearer than this part of delta are guarded at half of their gap."""
LEAVING = 1e-6
"""Part of its gap by which a leaving pair may come nearer before it counts as contact again."""
NOTHING = np.zeros(3)
NO_LOAD = Load(NOTHING, NOTHING, NOTHING, NOTHING)


@dataclass(frozen=True)
class ExactFlight:
    """Parabola and free rotation in closed form; constant contact forces between events."""

    stage: str = "integrate"
    name: str = "exact flight"

    def bind(self, world) -> Bound | Skip:
        """In where no force varies: it is what moves bodies."""
        if world.force_tables:
            return Skip("forces vary")
        return Bound(integrate, "paths between impacts are exact")


def integrate(context, pair_events, island: Island) -> None:
    """Give new courses to members whose velocity, pose or wrench changed, and set the gaps at which pairs meet next."""
    state, now = context.state, context.state.now
    trajectory = state.trajectory
    if island.substepped is not None:
        context.substepped.begin_trajectories(context, pair_events, island)
    for n, i in enumerate(island.members.tolist()):
        if pair_events.inside[i] or (island.rests and trajectory.mode[i] == FIXED and not island.moved):
            continue
        if (
            island.moved
            or state.under_contact[i]
            or (now.velocity[i] != island.velocity[n]).any()
            or (now.angular_velocity[i] != island.angular_velocity[n]).any()
            or context.wrench[i].any()
            or island.free is not None
        ):
            begin_trajectory(context, pair_events, i, island.time, context.wrench[i], island.rests)
    set_margins(context, pair_events, island)


def begin_trajectory(context, pair_events, i: int, time: float, wrench: np.ndarray, rests: bool) -> None:
    """Body i leaves its course at `time` for one from its present state, with a constant wrench (6,)."""
    state, world, now = context.state, context.world, context.state.now
    trajectory = state.trajectory
    if not isfinite(float(now.velocity[i].sum() + now.angular_velocity[i].sum())):
        context.quarantine(i, time)
        rests = True
    context.recorder.flush(trajectory, i, time, state.correction[i])
    state.correction[i] = 0.0
    context.contact_log.close([i], time)
    if context.forces is not None:
        context.forces.log.end(i, time)
    account_contact_work(context, i, time)
    pressed = not rests and bool(wrench.any())
    if rests:
        now.velocity[i] = now.angular_velocity[i] = 0.0
        take(trajectory, i, time, now, NO_LOAD, FIXED)
    elif context.forces is not None and context.forces.acts[i]:
        total, rate = wrench + context.forces.value[i], context.forces.rate[i]
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
        state.energy_at_start[i] = mechanical_energy(now, world, np.array([i])) - work_of_forces(context, i)
    if pair_events is not None:
        pair_events.trajectory_changed(i, time)


def account_contact_work(context, i: int, time: float) -> None:
    """Work that contact forces did along the course that ends: what its energy changed by."""
    arrival = context.state.end_energy.pop(i, None)
    if arrival is not None:
        begun, arrival = context.state.energy_at_start[i], arrival - work_of_forces(context, i)
        context.log.stretches.append((context.state.trajectory.start[i], time, i, begun, arrival - begun))


def work_of_forces(context, i: int) -> float:
    """What varying forces did on body i until its present course began, J."""
    return 0.0 if context.forces is None else float(context.forces.log.work[i])


def set_margins(context, pair_events, island: Island) -> None:
    """Gaps at which the group's pairs come to contact next."""
    if len(island.place):
        held = np.zeros(len(island.place), bool) if island.held is None else island.held
        pairs, dynamic = pair_events.pairs, context.world.dynamic
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
