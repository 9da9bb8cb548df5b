"""The stage respond: restitution acts on the velocity that bodies brought in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.core.conventions import TOLERANCES
from rigidimpulse.dynamics.energy import kinetic_energy
from rigidimpulse.dynamics.impact.kinematic import respond_kinematic
from rigidimpulse.dynamics.impact.point import Contacts, select, speed_scale
from rigidimpulse.dynamics.impact.restitution import LAWS
from rigidimpulse.dynamics.impact.sequence import respond_sequential, respond_simultaneous
from rigidimpulse.engine.islands import Group, classify
from rigidimpulse.engine.plan import Bound, Skip

KERNELS = {
    "sequential": respond_sequential,
    "simultaneous": respond_simultaneous,
    "kinematic": respond_kinematic,
}
REASONS = {
    "sequential": "impacts pair after pair, fastest first; points of a pair together",
    "simultaneous": "all impacts of touching bodies at once",
    "kinematic": "normal velocity reflected, masses and spins ignored",
}
# Approach speed that counts as none, relative to the speed below which contacts are held.
SLOW = 1e-9
# Calls with a full log before a group is given up.
MAX_CALLS = 1000
# Impacts in a row, without a gap worth the name between them, after which a pair no longer rebounds.
RATTLES = 8
NEVER = (-np.inf, np.inf, 0)


@dataclass(frozen=True)
class ImpactResponse:
    """Impulses at impacts by one of KERNELS and a law of restitution, one of LAWS."""

    method: str
    restitution: str
    stage: str = "respond"

    name: str = "impulses"

    def bind(self, world) -> Bound | Skip:
        """In where something can collide."""
        if not world.can_collide:
            return Skip(world.why_no_impacts)
        kernel, law = KERNELS[self.method], LAWS[self.restitution]

        def respond(context, group: Group) -> None:
            respond_to_impacts(context, group, kernel, law)

        return Bound(respond, f"{self.method}: {REASONS[self.method]}")


def respond_to_impacts(context, group: Group, kernel, law: int) -> None:
    """Apply the impulses of the group's approaching contacts and log them."""
    rattles = _rattles(context, group)
    live = (group.live | rattles).nonzero()[0]
    if not len(live):
        return
    contacts = group.contacts if len(live) == len(group.live) else select(group.contacts, live)
    rest_speed = np.where(rattles, np.inf, group.rest_speed)[live]
    scale = speed_scale(context.state.now, contacts)
    tolerance = TOLERANCES.approach * scale + SLOW * float(group.rest_speed[live].max())
    group.still, group.scale = tolerance, scale
    if group.approach[live].min() >= -tolerance:
        return
    now = context.state.now
    before = kinetic_energy(now, context.world, group.members)
    joints = context.joints.impact_block(context, group) if len(group.joints) else None
    together = len(live) > 1 and (bool(rattles.any()) or _bear_each_other(context, group))
    for _ in range(MAX_CALLS):
        count, _, capped = kernel(
            now, contacts, law, together, rest_speed, tolerance, scale, context.column, joints, context.impact_log
        )
        context.log.impacts.add(group.time, contacts, now.position, context.impact_log, count)
        _remember_rebounds(context, group, contacts, context.impact_log[:count])
        if capped:
            names = tuple(context.world.names[i] for i in group.members)
            context.log.report(
                group.time, "impacts finished without rebound", names,
                "too many impacts at one instant; try response='simultaneous'",
            )
        if not count or count + len(contacts.gap) < len(context.impact_log):
            break
    context.log.book(group.time, "impact", kinetic_energy(now, context.world, group.members) - before)
    classify(context, group)


def _bear_each_other(context, group: Group) -> bool:
    """Whether a contact between two movable bodies of the group carried load before."""
    state, dynamic = context.state, context.world.dynamic
    between = dynamic[group.contacts.body_a] & dynamic[group.contacts.body_b]
    return any(state.force_of(group.keys[c])[0] > 0.0 for c in np.flatnonzero(between).tolist())


def _rattles(context, group: Group) -> np.ndarray:
    """Contacts (m,) of pairs that came back RATTLES times in a row without ever having been farther apart than the held gap.

    Bodies caught between others collapse in infinitely many ever smaller impacts (McNamara and Young 1992) wherever e < 1; like the tail of
    a bouncing ball they are replaced by one inelastic impact, of all that rattle together: pair after pair, a light body would stop
    heavy ones in as many impacts as their masses' ratio, and each impact would be followed by the next. A body between two others hits
    them in turn, so pairs on their way rattle as soon as one does.
    """
    contacts, rebounds = group.contacts, context.state.rebounds
    pairs = zip(contacts.body_a.tolist(), contacts.body_b.tolist(), strict=True)
    count = np.array([rebounds.get(pair, NEVER)[2] for pair in pairs], np.int64)
    count[contacts.restitution >= 1.0] = 0
    return count >= (RATTLES // 2 if (count >= RATTLES).any() else RATTLES)


def _remember_rebounds(context, group: Group, contacts: Contacts, rows: np.ndarray) -> None:
    """Count for each pair how often in a row it came back after less than its held gap."""
    delta = {pair: d for pair, d in zip(zip(group.contacts.body_a.tolist(), group.contacts.body_b.tolist()), group.delta)}
    for row in rows:
        c = int(row[0])
        pair = (int(contacts.body_a[c]), int(contacts.body_b[c]))
        last, speed, count = context.state.rebounds.get(pair, NEVER)
        if group.time > last:
            count = count + 1 if speed * (group.time - last) < delta[pair] else 0
        context.state.rebounds[pair] = (group.time, float(row[6]), count)
