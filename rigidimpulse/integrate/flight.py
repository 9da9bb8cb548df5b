"""The stage integrate: new courses for the bodies of a group whose motion changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.detect.groups import Group
from rigidimpulse.integrate.course import FIXED, FORCED, FREE, begin
from rigidimpulse.observe.energy import mechanical_energy
from rigidimpulse.plan import Bound, Skip

HALF_KEPT = 0.55
"""Held contacts nearer than this part of delta are guarded at half of their gap."""
LEAVING = 1e-6
"""Part of its gap by which a leaving pair may come nearer before it counts as contact again."""


@dataclass(frozen=True)
class ExactFlight:
    """Parabola and free rotation in closed form; constant contact forces between events."""

    stage: str = "integrate"
    name: str = "exact flight"

    def bind(self, world) -> Bound | Skip:
        """Always in: it is what moves bodies."""
        return Bound(integrate, "paths between impacts are exact")


def integrate(context, window, group: Group) -> None:
    """Give new courses to members whose velocity, pose or wrench changed, and set the gaps at which pairs meet next."""
    state, now = context.state, context.state.now
    course = state.course
    if group.heap is not None:
        context.heaps.take_courses(context, window, group)
    for n, i in enumerate(group.members):
        if window.inside[i]:
            continue
        changed = (
            group.moved
            or np.any(now.velocity[i] != group.velocity[n])
            or np.any(now.angular_velocity[i] != group.angular_velocity[n])
            or np.any(context.wrench[i])
            or state.under_contact[i]
        )
        if group.rests and course.mode[i] == FIXED:
            continue
        if changed:
            take_course(context, window, int(i), group.time, context.wrench[i], group.rests)
    set_touch(context, window, group)


def take_course(context, window, i: int, time: float, wrench: np.ndarray, rests: bool) -> None:
    """Body i leaves its course at `time` for one from its present state, with a constant wrench (6,)."""
    state, world, now = context.state, context.world, context.state.now
    course = state.course
    if not (np.all(np.isfinite(now.velocity[i])) and np.all(np.isfinite(now.angular_velocity[i]))):
        context.quarantine(i, time)
        rests = True
    context.recorder.flush(course, i, time, state.correction[i])
    state.correction[i] = 0.0
    context.contact_log.close([i], time)
    book_contact_work(context, i, time)
    if rests:
        now.velocity[i] = now.angular_velocity[i] = 0.0
    course.start[i] = time
    course.position[i], course.orientation[i] = now.position[i], now.orientation[i]
    course.velocity[i], course.angular_velocity[i] = now.velocity[i], now.angular_velocity[i]
    course.acceleration[i] = 0.0 if rests else world.steady_acceleration[i] + world.inv_mass[i] * wrench[:3]
    course.torque[i] = 0.0 if rests else wrench[3:]
    course.mode[i] = FIXED if rests else (FORCED if np.any(wrench[3:]) else FREE)
    begin(course, i)
    state.under_contact[i] = not rests and bool(np.any(wrench))
    if state.under_contact[i]:
        state.energy_at_start[i] = mechanical_energy(now, world, np.array([i]))
    if window is not None:
        window.change_course(i, time)


def book_contact_work(context, i: int, time: float) -> None:
    """Work that contact forces did along the course that ends: what its energy changed by."""
    arrival = context.state.arrival_energy.pop(i, None)
    if arrival is not None:
        begun = context.state.energy_at_start[i]
        context.log.stretches.append((context.state.course.start[i], time, i, begun, arrival - begun))


def set_touch(context, window, group: Group) -> None:
    """Gaps at which the group's pairs come to contact next: held pairs are guarded at half their gap, leaving ones where they are."""
    least = np.full(len(window.a), np.inf)
    np.minimum.at(least, group.place, group.contacts.gap)
    held = np.zeros(len(window.a), bool)
    if group.held is not None:
        held[group.place[group.held]] = True
    for p in np.unique(group.place):
        delta = window.delta[p]
        touch = context.world.least_touch(window.a[p : p + 1], window.b[p : p + 1])[0]
        if held[p]:
            touch = 0.5 * delta if least[p] > HALF_KEPT * delta else 0.5 * least[p]
        elif least[p] <= touch:
            touch = least[p] * (1.0 - LEAVING) if touch > 0.0 else min(least[p], 0.0)
        if touch != window.touch[p]:
            window.touch[p] = touch
            window.sweep_again(np.array([p]), group.time)
