"""Impacts: restitution acts on the velocity that bodies brought in."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.joint_impact import NO_JOINTS
from rigidimpulse.dynamics.energy import kinetic_energy
from rigidimpulse.dynamics.impact.kinematic import respond_kinematic
from rigidimpulse.dynamics.impact.point import speed_scale
from rigidimpulse.dynamics.impact.restitution import LAWS, ImpactRule
from rigidimpulse.dynamics.impact.sequence import respond_sequential, respond_simultaneous
from rigidimpulse.engine.islands import classify, forces_of
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.model.contact_memory import claimed_place, place_of
from rigidimpulse.model.contacts import Contacts, select
from rigidimpulse.model.island import Island

SEQUENTIAL, SIMULTANEOUS, KINEMATIC = 0, 1, 2
RESPONSES = {"sequential": SEQUENTIAL, "simultaneous": SIMULTANEOUS, "kinematic": KINEMATIC}
"""Numbers of the responses in kernels."""
REASONS = {
    "sequential": "impacts pair after pair, fastest first; points of a pair together",
    "simultaneous": "all impacts of touching bodies at once",
    "kinematic": "normal velocity reflected, masses and spins ignored",
}
WITHOUT_REBOUND_REMEDY = "too many impacts at one instant; try response='simultaneous'"
# Approach speed that counts as none, relative to the speed of the island, and to the speed below which contacts are held.
APPROACH = TOLERANCES.contact.approach
SLOW = TOLERANCES.contact.slow_approach
# Force of a contact that bears, relative to the weight of the lighter body.
BEARING: float = 1e-4
# Calls with a full log before an island is given up.
MAX_CALLS = 1000
# Impacts in a row, without a gap worth the name between them, after which a pair no longer rebounds; after which an elastic pair does not.
COLLAPSE_REBOUNDS, COLLAPSE_ELASTIC = 8, 100


class Response(NamedTuple):
    """How an island responds to impacts."""

    kind: int  # one of RESPONSES
    together: bool  # whether its contacts are one block, see `sequence`


class LiveContacts(NamedTuple):
    """The contacts of an island that are near enough for an impact now."""

    which: np.ndarray  # (k,) their places among the contacts of the island
    contacts: Contacts
    rule: ImpactRule
    approach: bool  # whether one of them approaches
    collapse: bool  # whether one of them collapses


class Impacts(NamedTuple):
    """What impacts did."""

    log: np.ndarray  # (k, 7) see `point.log_impact`; contacts are numbered as in the island
    count: int  # rows of it that are written
    energy: float  # J, change of the kinetic energy
    capped: bool  # whether there were too many, so that the last one was inelastic


def respond(run: Run, _pair_events: PairEvents, island: Island) -> None:
    """Apply the impulses of the island's approaching contacts, by the response and the law of restitution of the run's accuracy."""
    accuracy, state, number, contacts = run.world.accuracy, run.state, run.world.num_bodies, island.contacts
    if not len(contacts.gap):
        return
    collapses = find_collapsing(state.memory, number, contacts)
    live = find_live(state.now, contacts, island.live, island.speeds, collapses, LAWS[accuracy.restitution])
    island.zero_speed, island.scale = live.rule.tolerance, live.rule.scale
    if not live.approach:
        return
    together = live.collapse or bear_each_other(contacts, run.world.constants, forces_of(run, contacts, island.touching))
    done = resolve_impacts(
        state.now, run.world.constants, island.members, live, Response(RESPONSES[accuracy.response], together), run.column,
        run.joints.impact_block(run, island) if len(island.joints) else NO_JOINTS, run.impact_log,
    )  # fmt: skip
    run.log.add_impacts(island.time, contacts, state.now.position, done.log, done.count)
    state.remember(len(contacts.gap))
    remember_rebounds(state.memory, number, island.time, contacts, island.contact_margin, done.log[: done.count])
    if done.capped:
        names = tuple(run.world.names[i] for i in island.members)
        run.log.report(
            island.time, "impacts finished without rebound", names, WITHOUT_REBOUND_REMEDY
        )
    run.log.account(island.time, "impact", done.energy)
    classify(run, island)


@jit_making_arrays
def find_live(bodies, contacts, live, speeds, collapses, law):
    """The `LiveContacts` of an island with m contacts.

    live (m,) bool: near enough for an impact; speeds (2, m) m/s: approach, and below which a rebound is none; collapses (m,) bool: from
    `find_collapsing`, they are live too, and do not rebound; law: one of LAWS.
    """
    m, count, collapse = live.shape[0], 0, False
    which = np.empty(m, np.int64)
    for c in range(m):
        if live[c] or collapses[c]:
            which[count] = c
            count += 1
        collapse = collapse or collapses[c]
    which = which[:count]
    if count < m:
        contacts = select(contacts, which)
    rest_speed, scale, fastest_rest = np.empty(count), speed_scale(bodies, contacts), 0.0
    for k in range(count):
        c = which[k]
        rest_speed[k] = inf if collapses[c] else speeds[1, c]
        fastest_rest = max(fastest_rest, speeds[1, c])
    tolerance, approach = APPROACH * scale + SLOW * fastest_rest, False
    for k in range(count):
        # A speed that is no number counts.
        approach = approach or not speeds[0, which[k]] >= -tolerance
    return LiveContacts(which, contacts, ImpactRule(law, rest_speed, tolerance, scale), approach, collapse)


@jit_making_arrays
def resolve_impacts(bodies, constants, members, live, response, number, joints, log):
    """Apply the impulses of `LiveContacts`; returns the `Impacts`.

    constants: `World.constants`; members (k,): movable bodies of the island; response: a `Response`; number (n,): working memory;
    joints: the `JointBlock` of the island; log (k, 7): working memory, the returned log where it is long enough.
    """
    before, m = kinetic_energy(bodies, constants, members), live.which.shape[0]
    # Each call gets a log of this size, and is repeated where it fills it.
    size, count, capped = max(log.shape[0], 2 * m), 0, False
    for _ in range(MAX_CALLS):
        log = _with_capacity(log, count, size)
        made, stopped = _respond(bodies, live, response, number, joints, log[count : count + size])
        count += made
        capped = capped or stopped
        if made == 0 or made + m < size:
            break
    for row in range(count):
        log[row, 0] = live.which[np.int64(log[row, 0])]
    return Impacts(log, count, kinetic_energy(bodies, constants, members) - before, capped)


@jit_making_arrays
def _respond(bodies, live, response, number, joints, log):
    """Apply impulses until the log is full or nothing approaches; returns the rows written, and whether there were too many impulses."""
    contacts, rule, together = live.contacts, live.rule, response.together
    if response.kind == KINEMATIC:
        count, _, capped = respond_kinematic(bodies, contacts, rule, together, number, joints, log)
    elif response.kind == SIMULTANEOUS:
        count, _, capped = respond_simultaneous(bodies, contacts, rule, together, number, joints, log)
    else:
        count, _, capped = respond_sequential(bodies, contacts, rule, together, number, joints, log)
    return count, capped


@jit_making_arrays
def _with_capacity(log, count, size):
    """A log of the same first rows with space for `size` more; the same one where it has the space."""
    if count + size <= log.shape[0]:
        return log
    longer = np.empty((2 * count + size, log.shape[1]))
    for row in range(count):
        for k in range(log.shape[1]):
            longer[row, k] = log[row, k]
    return longer


@jit
def bear_each_other(contacts, constants, force):
    """Whether a contact between two movable bodies carried load before; force (m, 3) N, in the contacts' frames.

    Bodies that hang side by side and just touch, as in Newton's cradle, press on each other with 1e-7 of their weight: by what holding
    joints and gaps leaves over. Impulses pass through those one after the other.
    """
    for c in range(force.shape[0]):
        a, b = contacts.body_a[c], contacts.body_b[c]
        if force[c, 0] > 0.0 and constants.dynamic[a] and constants.dynamic[b]:
            weight = min(constants.mass[a] * constants.steady_strength[a], constants.mass[b] * constants.steady_strength[b])
            if force[c, 0] > BEARING * weight:
                return True
    return False


@jit_making_arrays
def find_collapsing(memory, number, contacts):
    """Contacts (m,) of pairs that came back COLLAPSE_REBOUNDS times in a row, and were never farther apart than the contact margin.

    Bodies caught between others collapse in infinitely many ever smaller impacts (McNamara and Young 1992) wherever e < 1; like the tail of
    a bouncing ball they are replaced by one inelastic impact, of all that collapse together: pair after pair, a light body would stop
    heavy ones in as many impacts as their masses' ratio, and each impact would be followed by the next. A body between two others hits
    them in turn, so pairs on their way collapse as soon as one does.

    Elastic pairs have finitely many impacts, but 65,000 at nanometres a second were seen in one step. They collapse after COLLAPSE_ELASTIC:
    a light body with a way to go between heavy ones (Galperin 2003) has thousands of impacts, but not a hundred within the margin. What
    they approach with is lost then; the ledger has it under "impact".

    memory: the `ContactMemory`; number: of bodies.
    """
    m, least = contacts.gap.shape[0], 1.0
    part, collapses = np.zeros(m), np.empty(m, np.bool_)
    for c in range(m):
        key = contacts.body_a[c] * number + contacts.body_b[c]
        at = place_of(memory, key)
        if memory.key[at] == key:
            part[c] = memory.count[at] / (COLLAPSE_REBOUNDS if contacts.restitution[c] < 1.0 else COLLAPSE_ELASTIC)
        if part[c] >= 1.0:
            least = 0.5
    for c in range(m):
        collapses[c] = part[c] >= least
    return collapses


@jit
def remember_rebounds(memory, number, time, contacts, contact_margin, log):
    """Count for each pair how often in a row it came back after less than its contact margin.

    memory: the `ContactMemory`, which must have space; number: of bodies; contact_margin (m,) m; log (k, 7): of impacts at `time`.
    """
    for row in range(log.shape[0]):
        c = np.int64(log[row, 0])
        at = claimed_place(memory, contacts.body_a[c] * number + contacts.body_b[c])
        if time > memory.time[at]:
            is_short = memory.speed[at] * (time - memory.time[at]) < contact_margin[c]
            memory.count[at] = memory.count[at] + 1 if is_short else 0
        memory.time[at], memory.speed[at] = time, log[row, 6]
