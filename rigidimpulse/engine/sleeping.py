"""Sleeping: when bodies stand still until something touches them.

An exact island falls asleep as a whole (`may_sleep`). In a sub-stepped island each body has a sleep timer; see `substepped/advance.py`
for what wakes it.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, length, row, scaled, turned
from rigidimpulse.dynamics.constraints.contact import ContactProblem
from rigidimpulse.engine.run import Run
from rigidimpulse.model.island import Island

NO_SPEED = TOLERANCES.contact.rest
"""Part of what the load gives a body in a sub-step, below which its speed counts as none."""
SLEEP_SPEED, SLEEP_MOTION = 0.05, 0.5
"""Speed, in sqrt(g r), and motion, in skins, below which the sleep timer of a body runs."""


def may_sleep(run: Run, island: Island, problem: ContactProblem, h: float) -> bool:
    """Whether an exact island falls asleep: all members stand still and their loads are carried, on supports that do not move.

    problem: its lasting contacts and loads; h: s, length of the sub-step.
    """
    if len(island.joints) and (run.world.moving[run.joints.bodies_of(island.joints)].any() or run.joints.will_let_go(island.joints)):
        return False
    if island.loaded and not run.forces.may_rest(island.members):
        return False
    return stands_still(problem, run.world.constants, island.contacts, run.wrench, h)


@jit
def stands_still(problem, constants, contacts, wrench, h):
    """Whether members stand still and their loads are carried, and nothing moves that their contacts touch.

    problem: a `ContactProblem`; contacts: all of the island; wrench: (n, 6) of the lasting ones; h: s, length of the sub-step. The speed
    that counts as none is a part of what the load would give in it.
    """
    bodies, members = problem.bodies, problem.members
    for c in range(contacts.gap.shape[0]):
        if constants.moving[contacts.body_a[c]] or constants.moving[contacts.body_b[c]]:
            return False
    for i in members:
        limit = NO_SPEED * constants.steady_strength[i] * h
        size, inverse = min(constants.bound_radius[i], constants.size[i]), bodies.inv_mass[i]
        force, a, w = row(wrench, i), problem.acceleration[i], bodies.angular_velocity[i]
        gained = (h * (a[0] + inverse * force[0]), h * (a[1] + inverse * force[1]), h * (a[2] + inverse * force[2]))
        spin = along(problem.angular_acceleration[i], 1.0, turned(bodies.inv_inertia[i], wrench[i, 3:]))
        if not (
            length(bodies.velocity[i]) <= limit
            and length(gained) <= limit
            and length(scaled(w, size)) <= limit
            and length(scaled(spin, size * h)) <= limit
        ):
            return False
    return True


@jit_making_arrays
def wake_by_contact(first, second, member, restless, bodies, candidates):
    """Mark (n,) the members that are awake, and the sleepers that a moving member may wake over pairs (k,) that may touch.

    A moving body of mass m and speed v wakes sleepers up to k contacts away, k = max(1, m v / (m_0 u)), m_0: the least mass of a member,
    u = SLEEP_SPEED sqrt(g r). An impact that is shared by more bodies than that cannot move any of them faster than the sleep speed u.
    What has just been let go has no speed yet, and wakes all that stand on it. candidates: `Candidates`, by which u and m are known.
    """
    mass, strength, inner = candidates.mass, candidates.strength, candidates.inner
    reach, least = np.zeros(member.shape[0]), np.inf
    for i in range(member.shape[0]):
        if member[i]:
            least = min(least, mass[i])
    for i in range(member.shape[0]):
        if restless[i]:
            speed, spin = 0.0, 0.0
            for c in range(3):
                speed += bodies.velocity[i, c] ** 2
                spin += bodies.angular_velocity[i, c] ** 2
            size = np.sqrt(speed) + inner[i] * np.sqrt(spin)
            reach[i] = 1.0 + max(mass[i] * size / (least * max(SLEEP_SPEED * np.sqrt(strength[i] * inner[i]), 1e-300)), 1.0)
            if candidates.let_go[i]:
                reach[i] = 1.0 + member.shape[0]
    left = 0
    for i in range(member.shape[0]):
        left += member[i] and reach[i] < 1.0
    spreads, number, turn = True, first.shape[0], 0
    while spreads and left > 0:
        spreads, turn = False, 1 - turn
        for k in range(number):
            # To and fro: waking then goes far either way in one pass.
            p = k if turn else number - 1 - k
            a, b = first[p], second[p]
            if not (member[a] and member[b]):
                continue
            if reach[a] > reach[b]:
                a, b = b, a
            if reach[b] - 1.0 > reach[a]:
                left -= reach[a] < 1.0 <= reach[b] - 1.0
                reach[a] = reach[b] - 1.0
                spreads = spreads or reach[a] > 1.0
    return reach >= 1.0


@jit
def advance_sleep_timers(members, reached, bodies, length, stood, sleep_timer):
    """Add `length` s to the sleep timers of members (k,) that have hardly moved from where they stood (n, 7); reset those of others.

    reached: position (k, 3), orientation (k, 4) and velocity (k, 6) of the members. bodies: strength [m/s2] of what pulls them, inner
    radius and skin [m], each (n,).
    """
    position, orientation, velocity = reached
    strength, inner, skin = bodies
    for k in range(members.shape[0]):
        i = members[k]
        moved, turned, speed, spin = 0.0, 0.0, 0.0, 0.0
        for c in range(3):
            moved += (position[k, c] - stood[i, c]) ** 2
            speed += velocity[k, c] ** 2
            spin += velocity[k, 3 + c] ** 2
        for c in range(4):
            turned += (orientation[k, c] - stood[i, 3 + c]) ** 2
        play = SLEEP_MOTION * skin[i]
        if (
            np.sqrt(moved) <= play
            and 2.0 * inner[i] * np.sqrt(turned) <= play
            and np.sqrt(speed) + inner[i] * np.sqrt(spin) <= SLEEP_SPEED * np.sqrt(strength[i] * inner[i])
        ):
            sleep_timer[i] += length
            continue
        sleep_timer[i] = 0.0
        for c in range(3):
            # It has moved: the time counts from here, and from this place.
            stood[i, c] = position[k, c]
        for c in range(4):
            stood[i, 3 + c] = orientation[k, c]
