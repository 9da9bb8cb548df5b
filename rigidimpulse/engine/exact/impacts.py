"""Impacts: restitution acts on the velocity that bodies brought in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.energy import kinetic_energy
from rigidimpulse.dynamics.impact.kinematic import respond_kinematic
from rigidimpulse.dynamics.impact.point import speed_scale
from rigidimpulse.dynamics.impact.restitution import LAWS, ImpactRule
from rigidimpulse.dynamics.impact.sequence import respond_sequential, respond_simultaneous
from rigidimpulse.engine.islands import classify
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.model.contacts import Contacts, select
from rigidimpulse.model.island import Island

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
SLOW = TOLERANCES.contact.slow_approach
# Calls with a full log before an island is given up.
MAX_CALLS = 1000
# Impacts in a row, without a gap worth the name between them, after which a pair no longer rebounds.
COLLAPSE_REBOUNDS = 8
NEVER = (-np.inf, np.inf, 0)


def respond(run: Run, _pair_events: PairEvents, island: Island) -> None:
    """Apply the impulses of the island's approaching contacts, by the response and the law of restitution of the run's accuracy."""
    accuracy = run.world.accuracy
    respond_to_impacts(run, island, KERNELS[accuracy.response], LAWS[accuracy.restitution])


def respond_to_impacts(run: Run, island: Island, kernel: Callable[..., tuple[int, int, bool]], law: int) -> None:
    """Apply the impulses of the island's approaching contacts and log them."""
    collapses = _collapsing(run, island)
    live = (island.live | collapses).nonzero()[0]
    if not len(live):
        return
    contacts = island.contacts if len(live) == len(island.live) else select(island.contacts, live)
    rest_speed = np.where(collapses, np.inf, island.rest_speed)[live]
    scale = speed_scale(run.state.now, contacts)
    tolerance = TOLERANCES.contact.approach * scale + SLOW * float(island.rest_speed[live].max())
    island.zero_speed, island.scale = tolerance, scale
    if island.approach[live].min() >= -tolerance:
        return
    now = run.state.now
    before = kinetic_energy(now, run.world, island.members)
    joints = run.joints.impact_block(run, island) if len(island.joints) else None
    together = len(live) > 1 and (bool(collapses.any()) or _bear_each_other(run, island))
    rule = ImpactRule(law, rest_speed, tolerance, scale)
    for _ in range(MAX_CALLS):
        count, _, capped = kernel(
            now, contacts, rule, together, run.column, joints, run.impact_log
        )
        run.log.impacts.add(island.time, contacts, now.position, run.impact_log, count)
        _remember_rebounds(run, island, contacts, run.impact_log[:count])
        if capped:
            names = tuple(run.world.names[i] for i in island.members)
            run.log.report(
                island.time, "impacts finished without rebound", names,
                "too many impacts at one instant; try response='simultaneous'",
            )
        if not count or count + len(contacts.gap) < len(run.impact_log):
            break
    run.log.account(island.time, "impact", kinetic_energy(now, run.world, island.members) - before)
    classify(run, island)


def _bear_each_other(run: Run, island: Island) -> bool:
    """Whether a contact between two movable bodies of the island carried load before."""
    state, dynamic = run.state, run.world.dynamic
    between = dynamic[island.contacts.body_a] & dynamic[island.contacts.body_b]
    return any(state.force_of(island.keys[c])[0] > 0.0 for c in np.flatnonzero(between).tolist())


def _collapsing(run: Run, island: Island) -> np.ndarray:
    """Contacts (m,) of pairs that rebounded COLLAPSE_REBOUNDS times in a row and never came farther apart than the contact margin.

    A body caught between others has infinitely many impacts, each smaller than the one before, wherever e < 1: inelastic collapse
    (McNamara and Young 1992). Like the last bounces of a ball they are replaced by one inelastic impact, of all collapsing pairs at once.
    Taken one pair at a time, a light body would need as many impacts as the ratio of the masses to stop a heavy one. A body between two
    others hits them in turn. Therefore pairs with half that number of rebounds collapse, too, as soon as one pair does.
    """
    contacts, rebounds = island.contacts, run.state.rebounds
    pairs = zip(contacts.body_a.tolist(), contacts.body_b.tolist(), strict=True)
    count = np.array([rebounds.get(pair, NEVER)[2] for pair in pairs], np.int64)
    count[contacts.restitution >= 1.0] = 0
    return count >= (COLLAPSE_REBOUNDS // 2 if (count >= COLLAPSE_REBOUNDS).any() else COLLAPSE_REBOUNDS)


def _remember_rebounds(run: Run, island: Island, contacts: Contacts, rows: np.ndarray) -> None:
    """Count for each pair how often in a row it came back before its gap exceeded the contact margin."""
    pairs = zip(island.contacts.body_a.tolist(), island.contacts.body_b.tolist())
    contact_margin = dict(zip(pairs, island.contact_margin))
    for row in rows:
        c = int(row[0])
        pair = (int(contacts.body_a[c]), int(contacts.body_b[c]))
        last, speed, count = run.state.rebounds.get(pair, NEVER)
        if island.time > last:
            count = count + 1 if speed * (island.time - last) < contact_margin[pair] else 0
        run.state.rebounds[pair] = (island.time, float(row[6]), count)
