"""The order of a step, compiled: that of `engine/step.py`, for what is neither jointed nor pushed by varying forces nor sub-stepped.

From event to event it calls the kernels that the loop in Python calls, in the same order, so the results are the same bits. It takes one
step after the other, see `step_begin`, and returns to Python at the end of a step where it may not begin the next one, and before an event

    with a body that runs away,
    for which there is no space in the memory of contacts or in what is recorded.

Bodies that are jointed, pushed or sub-stepped are Python's (`Loop.elsewhere`), and so is whatever hangs together with one of them at an
instant. All else that happens at that instant is dealt with first, here. Then the loop ends with the bodies that are left to Python. So a
position correction near one of these sees its joints before they are closed, which is round-off.

`compiled_loop` calls it.
"""

from math import isfinite
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.geometry import Shapes
from rigidimpulse.collision.manifold.contact_points import Contacts as ContactBuffers
from rigidimpulse.collision.manifold.dispatch import SCRATCH_ROWS
from rigidimpulse.collision.manifold.kept_features import FEW_ROWS, make_contact_scratch
from rigidimpulse.collision.time_of_impact.result import STALLED, ImpactTimes, SearchEffort
from rigidimpulse.collision.time_of_impact.safe_step import SweepScratch
from rigidimpulse.collision.time_of_impact.search import first_contacts
from rigidimpulse.core.cycles import cycles
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.union_find import root_of, unite
from rigidimpulse.dynamics.constraints.contact import ContactProblem
from rigidimpulse.dynamics.constraints.contact_motion import contact_motion
from rigidimpulse.dynamics.constraints.joint_impact import JointBlock
from rigidimpulse.dynamics.constraints.joint_sub_step import UNSOLVED
from rigidimpulse.dynamics.constraints.position_correction import Sunk, correct_positions, needs_correction
from rigidimpulse.dynamics.constraints.rolling_friction import rolling_of
from rigidimpulse.dynamics.energy import kinetic_energy, mechanical_energy
from rigidimpulse.engine.exact.contact_forces import leaves_from_inside, makes_energy, mark_same, shift_of
from rigidimpulse.engine.exact.energy_limit import limit_correction_energy, limit_energy, note_end_energy, note_hold
from rigidimpulse.engine.exact.impacts import (
    SEQUENTIAL,
    Response,
    bear_each_other,
    find_collapsing,
    find_live,
    remember_rebounds,
    resolve_impacts,
)
from rigidimpulse.engine.exact.step_begin import BEGIN, END, SolveCounts, Steps, begin_step
from rigidimpulse.engine.exact.step_size import ErrorEstimate, Forces, StepLimits, Turning, hold_turning, turns
from rigidimpulse.engine.exact.trajectories import begin_steady_trajectory, set_impact_margins
from rigidimpulse.engine.exact.velocity_projection import ProjectionScratch, project, project_alone
from rigidimpulse.engine.pair_table import (
    MARGIN,
    NEVER,
    SHORT,
    USED,
    PairBodies,
    PairTable,
    count_contacts,
    look_around,
    mark_live,
    mark_met,
    most_solves,
    next_time,
    note_sweep,
    pairs_to_sweep,
    settle_pairs,
)
from rigidimpulse.engine.sleeping import stands_still
from rigidimpulse.engine.touching import (
    FAR_MARGIN,
    Found,
    Motion,
    Pressing,
    Shared,
    contacts_at,
    fill_contacts,
    find_touching,
    make_contacts,
    near_pairs,
    press,
    sort_contacts,
    split_islands,
    witness_contacts,
)
from rigidimpulse.model.contact_memory import ContactMemory, forget_forces, has_capacity, keep_forces, keep_wrenches, read_forces
from rigidimpulse.model.contacts import Contacts, Touching, select
from rigidimpulse.model.island import slow_speed
from rigidimpulse.model.state import EnergyLimiter
from rigidimpulse.model.world import Margins
from rigidimpulse.motion.evaluate import bring_gyroscopic, refresh_pose
from rigidimpulse.motion.trajectory import FIXED, pose_at
from rigidimpulse.recording.contact_log import ContactBuffers as ContactLogBuffers
from rigidimpulse.recording.contact_log import close_contacts, has_contact_capacity, replace_contacts
from rigidimpulse.recording.events import (
    ENERGY_CORRECTION,
    IMPACT,
    POSITION_CORRECTION,
    STICK,
    LogBuffers,
    log_energy,
    log_impacts,
)
from rigidimpulse.recording.events import has_capacity as has_log_capacity
from rigidimpulse.recording.recorder import Frames

AT_END, AT_EVENT, NO_CAPACITY, SHORT_OF_PAIRS = np.arange(4)
"""How the loop ends: at the end of a step; before an event, or the part of one, that Python looks after; before one for which there is no
space; after one that found no space for a pair."""
NEXT, GIVEN, COMES_BACK = np.arange(3)
"""Whether an event is given: no, it is the next one; yes; yes, and the loop ends behind it, whoever is left to Python."""
FIND, SWEEP, RESPOND, LOAD, HOLD, MOVE, VERBS = np.arange(7)
"""Places in `Loop.cycles` and `Loop.calls`."""
ENERGIES = 6
"""Changes of energy, or problems, at an instant of a body, at most."""
FIRST_CONTACTS, NONE, NO_ROWS = np.int64(256), np.int64(-1), np.int64(0)
MORE_CONTACTS, MOST_NEW = 4, 256
"""How many times more contacts an island may have after a position correction, and how many more on top."""
MOST_EVENTS = 256
"""Events after which it returns at the end of a step: somebody may wait for a word, or want to stop the run."""
IMPULSES = 256
"""Impulses of a contact at an instant that there is space for."""

REPORT = np.dtype([("kind", np.int64), ("time", np.float64), ("value", np.float64), ("first", np.int64), ("count", np.int64)])
"""A problem: what it is, when [s], a number that goes with it, and its stretch of `Reports.bodies`."""
SQUEEZED, NOT_RESOLVED, SWEEP_STALLED, WITHOUT_REBOUND, NOT_SOLVED, NOT_FINITE, NOT_RECORDED = np.arange(7)
ROWS, BODIES, ASKED = np.arange(3)
"""Places in `Reports.used`."""


class Settings(NamedTuple):
    """The accuracy of a run."""

    step: float  # s
    instant: float  # s, two contacts of a pair nearer in time than that count as one
    law: int  # one of `restitution.LAWS`
    ahead: float  # see `SearchEffort`
    queries: int  # gap evaluations a pair may use
    gyroscopic: int  # 1 if the gyroscopic term is in, else 0
    holds: int  # 1 if contact forces are in: something may press bodies together


class Reports(NamedTuple):
    """Problems, to be told in words when the loop has ended."""

    rows: np.ndarray  # (r,) REPORT
    bodies: np.ndarray  # (b,) of the reports
    used: np.ndarray  # (3,) of both, and how many more were last asked for


class Loop(NamedTuple):
    """Everything the loop needs; kernels get it as a `Record`."""

    settings: Settings
    shapes: Shapes
    bodies: PairBodies
    margins: Margins
    coefficients: np.ndarray  # (k, k, 4), see material.combine
    rolling: np.ndarray  # (k, k, 2) m, k = 0 where no material asks for it
    elsewhere: np.ndarray  # (n,) bool, bodies that the loop in Python looks after
    motion: Motion
    table: PairTable
    memory: ContactMemory
    limiter: EnergyLimiter
    log: LogBuffers
    contact_log: ContactLogBuffers
    frames: Frames
    written: np.ndarray  # (n,) frames of each body
    reports: Reports
    estimate: ErrorEstimate
    sweep: SweepScratch
    wrench: np.ndarray  # (n, 6) N, N m by contacts
    number: np.ndarray  # (n,) working memory
    sub_step: np.ndarray  # (n,) s, see `State`
    counts: SolveCounts
    steps: Steps
    impacts: np.ndarray  # (k, 7) working memory, see `point.log_impact`
    no_joints: JointBlock
    cycles: np.ndarray  # (VERBS,) processor cycles of each verb
    calls: np.ndarray  # (VERBS,)


ISLAND = np.dtype(
    [
        ("time", np.float64),
        ("end", np.float64),
        ("zero_speed", np.float64),
        ("scale", np.float64),
        ("shift", np.float64),
        ("moved", np.bool_),
        ("rests", np.bool_),
    ]
)
"""An island at an instant: see `model.island.Island`; end: of the step, s."""


class Islands(NamedTuple):
    """The islands of an instant: k of them, with m contacts and n movable bodies in all."""

    record: np.ndarray  # (k,) ISLAND
    contact_first: np.ndarray  # (k + 1,) where the contacts of each begin
    member_first: np.ndarray  # (k + 1,) where the members of each begin
    member: np.ndarray  # (n,) bodies, island after island
    velocity: np.ndarray  # (n, 6) m/s, rad/s, of the members before anything happened


class Touch(NamedTuple):
    """The m contacts of an island."""

    contacts: Contacts
    touching: Touching
    place: np.ndarray  # (m,) pairs
    contact_margin: np.ndarray  # (m,) m
    speeds: np.ndarray  # (2, m) m/s, approach and rest speed
    live: np.ndarray  # (m,) bool


@jit
def report(reports, kind, time, value, bodies):
    """Keep a problem of some bodies; there is space."""
    used = reports.used
    row = reports.rows[used[ROWS]]
    row.kind, row.time, row.value, row.first, row.count = kind, time, value, used[BODIES], bodies.shape[0]
    for i in bodies:
        reports.bodies[used[BODIES]] = i
        used[BODIES] += 1
    used[ROWS] += 1


@jit_making_arrays
def _report_pairs(reports, kind, time, table, places):
    """Keep a problem of each of the pairs; there is space."""
    both = np.empty(2, np.int64)
    for p in places:
        both[0], both[1] = table.pairs[p].a, table.pairs[p].b
        report(reports, kind, time, 0.0, both)


@jit_making_arrays
def _sweep_stale(loop, end):
    """Sweep the pairs that ask for it, until the next event before `end` [s] is known; see `impact_time.sweep_stale_pairs`."""
    table, shapes, settings = loop.table, loop.shapes, loop.settings
    effort = SearchEffort(settings.ahead, settings.queries)
    places, asked = pairs_to_sweep(table, settings.step, end)
    while places.shape[0]:
        count = places.shape[0]
        found = ImpactTimes(
            np.full(count, np.inf), np.zeros(count, np.int64), np.zeros(count, np.int64), np.zeros((count, 10)), np.full(count, np.nan)
        )
        first_contacts(shapes.geometry, loop.motion.trajectory, loop.sweep, shapes.of_body, asked, end, effort, found)
        note_sweep(table, places, found)
        for k in range(count):
            if found.status[k] == STALLED:
                _report_pairs(loop.reports, SWEEP_STALLED, found.time[k], table, places[k : k + 1])
        places, asked = pairs_to_sweep(table, settings.step, end)


@jit_making_arrays
def make_found(capacity, number, scratch):
    """Buffers for `capacity` contacts, and marks of `number` bodies."""
    buffers = ContactBuffers(np.empty((capacity, 10)), np.empty((capacity, 5), np.int64), scratch)
    return Found(buffers, np.empty(capacity, np.int64), np.zeros(number, np.bool_), np.zeros(number, np.bool_))


@jit_making_arrays
def run_events(loop, bodies, given, time, until, scratch):
    """Go from event to event, from `time` to the end of the step, and of further steps that end at `until` [s] or before.

    bodies (n,) bool: of the event at `time` if it is `given`; and then those of the last event that are left to Python. scratch: see
    `manifold.contact_points`. Returns how it ends, when, and NEXT where the contacts of the last event are still to be counted;
    `loop.steps` tells in which step.
    """
    motion, table, shapes, constants = loop.motion, loop.table, loop.shapes, loop.bodies.constants
    number, limiter, used_cycles, calls = len(bodies), loop.limiter, loop.cycles, loop.calls
    shared = Shared(limiter.under_contact, limiter.sharing, np.empty((0, 2), np.int64))
    found, end, events = make_found(FIRST_CONTACTS, number, scratch), loop.steps.times[END], 0
    aside = np.zeros(number, np.bool_)
    while True:
        if not _can_report(loop.reports, number, table.number[USED]):
            return NO_CAPACITY, time, given
        if given == NEXT:
            start = cycles()
            _sweep_stale(loop, end)
            used_cycles[SWEEP] += cycles() - start
            calls[SWEEP] += 1
            time = next_time(table)
            if time >= end:
                start = cycles()
                # Of a problem Python tells why, which it sees from the pairs of that step.
                begins = events < MOST_EVENTS and loop.reports.used[ROWS] == 0 and begin_step(loop, until, bodies)
                used_cycles[FIND] += cycles() - start
                if not begins:
                    return AT_END, end, given
                calls[FIND] += 1
                time, end, given = loop.steps.times[BEGIN], loop.steps.times[END], GIVEN
                continue
            mark_met(table, constants.dynamic, time, bodies)
        if not _any_other(bodies, loop.elsewhere):
            return AT_EVENT, time, given
        count = NONE
        while count < 0:
            for i in range(number):
                found.reached[i] = bodies[i] and not loop.elsewhere[i]
            count = find_touching(shapes, constants, motion, table, shared, found, time)
            if count < 0:
                found = make_found(-2 * count, number, scratch)
        if not _has_capacity(loop, count):
            return NO_CAPACITY, time, given
        if given == NEXT:
            _count_contacts(loop, time)
        count = _set_aside(loop, found, count, aside)
        for i in range(number):
            if bodies[i] and not (loop.elsewhere[i] or aside[i]):
                table.wake[i] = np.inf
        if not _react(loop, found, count, time, end):
            return AT_EVENT, time, GIVEN
        if _keep_aside(bodies, loop.elsewhere, aside) or given == COMES_BACK:
            return AT_EVENT, time, GIVEN
        _settle(loop, time)
        given = NEXT
        events += 1
        if table.number[SHORT]:
            return SHORT_OF_PAIRS, time, given


@jit
def _any_other(bodies, elsewhere):
    """Whether there are bodies (n,) bool, or none at all, that are not all Python's."""
    none = True
    for i in range(bodies.shape[0]):
        if bodies[i] and not elsewhere[i]:
            return True
        none = none and not bodies[i]
    return none


@jit_making_arrays
def _set_aside(loop, found, count, aside):
    """Take out of what was found all that hangs together with a body that is Python's; returns how many contacts are left.

    aside (n,) bool: these bodies, marked here.
    """
    elsewhere, limiter, dynamic = loop.elsewhere, loop.limiter, loop.bodies.constants.dynamic
    reached, real, integer, number, touches = found.reached, found.buffers.real, found.buffers.integer, len(loop.elsewhere), False
    for i in range(number):
        aside[i] = False
        touches = touches or (reached[i] and elsewhere[i])
    if not touches:
        return count
    root, first = np.empty(number, np.int64), np.full(number, NONE)
    for i in range(number):
        root[i] = i
    for c in range(count):
        if dynamic[integer[c, 0]] and dynamic[integer[c, 1]]:
            unite(root, integer[c, 0], integer[c, 1])
    for i in range(number):
        if reached[i] and limiter.under_contact[i]:
            owner = limiter.sharing[i]
            if first[owner] == NONE:
                first[owner] = i
            unite(root, first[owner], i)
    is_python = np.zeros(number, np.bool_)
    for i in range(number):
        if reached[i] and elsewhere[i]:
            is_python[root_of(root, i)] = True
    for i in range(number):
        if reached[i] and is_python[root_of(root, i)]:
            aside[i], reached[i] = True, False
    kept = np.int64(0)
    for c in range(count):
        if aside[integer[c, 0]] or aside[integer[c, 1]]:
            continue
        for k in range(real.shape[1]):
            real[kept, k] = real[c, k]
        for k in range(integer.shape[1]):
            integer[kept, k] = integer[c, k]
        found.place[kept] = found.place[c]
        kept += 1
    return kept


@jit
def _keep_aside(bodies, elsewhere, aside):
    """Unmark the bodies (n,) bool of an event that were dealt with; returns whether some are left to Python."""
    left = False
    for i in range(bodies.shape[0]):
        if bodies[i] and not (elsewhere[i] or aside[i]):
            bodies[i] = False
        left = left or bodies[i]
    return left


@jit
def _can_report(reports, number, pairs):
    """Whether all problems can be kept that an event of `number` bodies may have; a pair, of `pairs`, is swept, counted and settled."""
    rows, bodies = ENERGIES * number + 3 * pairs, ENERGIES * number + 6 * pairs
    reports.used[ASKED] = max(rows, bodies)
    return reports.used[ROWS] + rows <= len(reports.rows) and reports.used[BODIES] + bodies <= len(reports.bodies)


@jit
def _has_capacity(loop, count):
    """Whether an event of `count` contacts can be remembered and recorded, whatever it does."""
    number, contacts = len(loop.elsewhere), MORE_CONTACTS * count + MOST_NEW
    fits = has_log_capacity(loop.log, ENERGIES * number, number, len(loop.impacts) + IMPULSES * count)
    fits = has_contact_capacity(loop.contact_log, contacts) and fits
    return fits and has_capacity(loop.memory, contacts)


@jit_making_arrays
def _count_contacts(loop, time):
    """Count contacts at one instant [s]; pairs with too many are handed over, or left alone until the end of the step, and reported."""
    given_up = np.empty(loop.table.number[USED], np.int64)
    count = count_contacts(loop.table, time, loop.settings.instant, given_up)
    _give_up(loop, SQUEEZED, time, given_up[:count])


@jit
def _give_up(loop, kind, time, places):
    """Mark the bodies of pairs as those that run away, and call them, or report the pairs where nothing is handed over."""
    dynamic, solve_count, table = loop.bodies.constants.dynamic, loop.counts.solves, loop.table
    for k in range(places.shape[0]):
        pair, handed = table.pairs[places[k]], False
        for i in (pair.a, pair.b):
            if dynamic[i] and solve_count[i] > NEVER:
                solve_count[i], table.wake[i], handed = np.inf, min(table.wake[i], time), True
        if not handed:
            _report_pairs(loop.reports, kind, time, table, places[k : k + 1])


@jit
def _runs_away(solve_count, islands):
    """Whether a body was dealt with so often, this event counted, that it or its island is handed over (see `SubsteppedIslands.join`)."""
    for i in range(len(solve_count)):
        if solve_count[i] == np.inf:
            return True
    for k in range(len(islands.record)):
        first, last = islands.member_first[k], islands.member_first[k + 1]
        often = most_solves(last - first)
        for i in islands.member[first:last]:
            if solve_count[i] + 1.0 > often:
                return True
    return False


@jit_making_arrays
def _react(loop, found, count, time, end):
    """Everything that happens at `time` to the islands of the contacts found, and to the bodies reached.

    Nothing does, and it returns False, where a body runs away: the loop in Python deals with that event.
    """
    motion, dynamic, number = loop.motion, loop.bodies.constants.dynamic, len(found.reached)
    root, order = np.empty(number, np.int64), np.empty(count, np.int64)
    split_islands(dynamic, np.empty((0, 2), np.int64), found, count, root, order)
    touch = _touch(loop, found, order, time)
    islands, solve_count = _islands(motion.now, root, touch.contacts, dynamic, time, end), loop.counts.solves
    if _runs_away(solve_count, islands):
        return False
    _arrive(loop, islands, touch, found.reached, time)
    for i in islands.member:
        solve_count[i] += 1.0
    _let_go(loop, islands.member, found.reached, time, end)
    for k in range(len(islands.record)):
        first, last = islands.member_first[k], islands.member_first[k + 1]
        _advance(
            loop, islands.record[k : k + 1], _part(touch, islands.contact_first[k], islands.contact_first[k + 1]),
            islands.member[first:last], islands.velocity[first:last],
        )  # fmt: skip
    return True


@jit_making_arrays
def _settle(loop, time):
    """Let pairs that came to contact without consequence be swept again; those that do so too often are handed over or left alone."""
    given_up = np.empty(loop.table.number[USED], np.int64)
    count = settle_pairs(loop.table, time, loop.bodies.constants.dynamic, given_up)
    _give_up(loop, NOT_RESOLVED, time, given_up[:count])


@jit_making_arrays
def _touch(loop, found, order, time):
    """The contacts found, in this order (m,)."""
    m, buffers, table, material = len(order), found.buffers, loop.table, loop.bodies.constants.material
    contacts = make_contacts(m)
    fill_contacts(loop.motion.now, buffers.real, buffers.integer, order, material, loop.coefficients, contacts)
    touching = Touching(np.empty(m, np.int64), np.empty((m, 2), np.int64))
    place, contact_margin, live = np.empty(m, np.int64), np.empty(m), np.empty(m, np.bool_)
    for c in range(m):
        row = order[c]
        place[c] = found.place[row]
        contact_margin[c] = table.pairs[place[c]].contact_margin
        touching.kind[c] = buffers.integer[row, 2]
        touching.feature[c, 0], touching.feature[c, 1] = buffers.integer[row, 3], buffers.integer[row, 4]
    mark_live(table.pairs, place, contacts.gap, time, live)
    return Touch(contacts, touching, place, contact_margin, np.empty((2, m)), live)


@jit_making_arrays
def _part(touch, first, last):
    """The contacts from `first` to `last` - 1; all of them themselves, else copies."""
    if last - first == len(touch.live):
        return touch
    which = np.empty(last - first, np.int64)
    for c in range(first, last):
        which[c - first] = c
    return _chosen(touch, which)


@jit_making_arrays
def _chosen(touch, which):
    """Some contacts (k,), in ascending order: all of them themselves, else copies."""
    m = len(which)
    if m == len(touch.live):
        return touch
    kind, feature, place, margin = np.empty(m, np.int64), np.empty((m, 2), np.int64), np.empty(m, np.int64), np.empty(m)
    speeds, live = np.empty((2, m)), np.empty(m, np.bool_)
    for s in range(m):
        c = which[s]
        kind[s], place[s], margin[s], live[s] = touch.touching.kind[c], touch.place[c], touch.contact_margin[c], touch.live[c]
        for k in range(2):
            feature[s, k], speeds[k, s] = touch.touching.feature[c, k], touch.speeds[k, c]
    return Touch(select(touch.contacts, which), Touching(kind, feature), place, margin, speeds, live)


@jit_making_arrays
def _islands(bodies, root, contacts, dynamic, time, end):
    """The islands of contacts that are sorted by island."""
    m, number = contacts.gap.shape[0], len(root)
    contact_first, count, last = np.empty(m + 1, np.int64), np.int64(0), NONE
    for c in range(m):
        a = contacts.body_a[c]
        owner = root[a] if dynamic[a] else root[contacts.body_b[c]]
        if owner != last:
            contact_first[count] = c
            count += 1
        last = owner
    contact_first[count] = m
    member_first, member, used = np.zeros(count + 1, np.int64), np.empty(min(2 * m, number), np.int64), np.int64(0)
    mark = np.full(number, NONE)
    for k in range(count):
        low, high = number, NONE
        for c in range(contact_first[k], contact_first[k + 1]):
            a, b = contacts.body_a[c], contacts.body_b[c]
            mark[a] = mark[b] = k
            low, high = min(low, min(a, b)), max(high, max(a, b))
        for i in range(low, high + 1):
            if mark[i] == k and dynamic[i]:
                member[used] = i
                used += 1
        member_first[k + 1] = used
    velocity, record = np.empty((used, 6)), np.zeros(count, ISLAND)
    for s in range(used):
        for k in range(3):
            velocity[s, k], velocity[s, 3 + k] = bodies.velocity[member[s], k], bodies.angular_velocity[member[s], k]
    for k in range(count):
        record[k].time, record[k].end = time, end
    return Islands(record, contact_first[: count + 1], member_first, member[:used], velocity)


@jit_making_arrays
def _classify(loop, touch, members):
    """Measure approach speeds and what presses each contact; slow approaches within the margin are live (see `islands.classify`)."""
    constants, contacts = loop.bodies.constants, touch.contacts
    m, least, supported = contacts.gap.shape[0], 0.0, False
    for c in range(m):
        supported = supported or not (constants.dynamic[contacts.body_a[c]] and constants.dynamic[contacts.body_b[c]])
    if supported:
        for i in members:
            least = max(least, constants.steady_strength[i])
    force, normal_force = np.empty((m, 3)), np.empty(m)
    read_forces(loop.memory, loop.motion.trajectory.start, contacts, touch.touching, force)
    for c in range(m):
        normal_force[c] = force[c, 0]
    pressing = Pressing(least, loop.settings.step)
    press(loop.shapes, loop.motion, contacts, touch.touching, normal_force, pressing, touch.contact_margin, touch.speeds)
    for c in range(m):
        touch.live[c] = touch.live[c] or abs(touch.speeds[0, c]) <= touch.speeds[1, c]


@jit_making_arrays
def _slow(island, speeds):
    """Contacts (m,) that neither bounce nor come in fast (see `Island.slow`); island: `ISLAND`, speeds (2, m)."""
    slow = np.empty(speeds.shape[1], np.bool_)
    for c in range(speeds.shape[1]):
        slow[c] = abs(speeds[0, c]) <= slow_speed(speeds[1, c], island.zero_speed, island.moved, island.scale)
    return slow


@jit_making_arrays
def _arrive(loop, islands, touch, reached, time):
    """End the sub-steps of all bodies reached (n,) bool, and measure the islands' contacts (see `exact.advance.arrive`)."""
    motion, memory, limiter, constants = loop.motion, loop.memory, loop.limiter, loop.bodies.constants
    scratch = ProjectionScratch(loop.number, limiter.correction, limiter.under_contact, constants)
    for k in range(len(islands.record)):
        members = islands.member[islands.member_first[k] : islands.member_first[k + 1]]
        mine = _part(touch, islands.contact_first[k], islands.contact_first[k + 1])
        _classify(loop, mine, members)
        slow = _slow(islands.record[k], mine.speeds)
        ended, change = project(memory, motion, mine.contacts, mine.touching, slow, time, members, scratch)
        if ended:
            log_energy(loop.log, time, STICK, change)
            _classify(loop, mine, members)
        _keep_speeds(touch, mine, islands.contact_first[k])
    bodies = np.empty(len(reached), np.int64)
    count = np.int64(0)
    for i in range(len(reached)):
        if reached[i]:
            bodies[count] = i
            count += 1
    bodies = bodies[:count]
    project_alone(memory, motion, bodies, time, limiter.correction)
    note_end_energy(limiter, motion.now, constants, bodies)
    slowed, changes = np.zeros(len(reached), np.bool_), np.empty(count)
    done = limit_energy(limiter, motion.now, constants, motion.trajectory, bodies, time, slowed, changes)
    for s in range(done):
        log_energy(loop.log, time, ENERGY_CORRECTION, changes[s])
    if done == 0:
        return
    for k in range(len(islands.record)):
        members = islands.member[islands.member_first[k] : islands.member_first[k + 1]]
        if _any_marked(slowed, members):
            mine = _part(touch, islands.contact_first[k], islands.contact_first[k + 1])
            _classify(loop, mine, members)
            _keep_speeds(touch, mine, islands.contact_first[k])


@jit
def _any_marked(mark, members):
    for i in members:
        if mark[i]:
            return True
    return False


@jit
def _keep_speeds(touch, mine, first):
    """Write what was measured of an island's contacts back to where those of all islands stand."""
    for c in range(mine.live.shape[0]):
        touch.live[first + c] = mine.live[c]
        for k in range(2):
            touch.speeds[k, first + c] = mine.speeds[k, c]


@jit_making_arrays
def _let_go(loop, member, reached, time, end):
    """Let those of the bodies reached fly freely that still carry forces of contacts they have left (see `exact.advance.let_go`)."""
    in_island, no_wrench = np.zeros(len(reached), np.bool_), np.zeros(6)
    for i in member:
        in_island[i] = True
    for i in range(len(reached)):
        left = reached[i] and not in_island[i] and loop.limiter.under_contact[i]
        if left and loop.motion.trajectory.start[i] < time:
            _begin_trajectory(loop, i, (time, end), no_wrench, False)


@jit_making_arrays
def _advance(loop, island, touch, members, velocity):
    """Advance an island from its instant: impacts, loads, contact forces, trajectories; island (1,) ISLAND."""
    motion, constants, used_cycles, calls = loop.motion, loop.bodies.constants, loop.cycles, loop.calls
    start = cycles()
    _respond(loop, island[0], touch, members)
    responded = cycles()
    for i in members:
        for k in range(3):
            motion.acceleration[i, k] = constants.steady_acceleration[i, k]
            motion.angular_acceleration[i, k] = 0.0
    if loop.settings.gyroscopic == 1:
        bring_gyroscopic(members, motion.now, motion.rotation, motion.trajectory.inertia, motion.angular_acceleration)
    loaded, held = cycles(), np.zeros(len(touch.live), np.bool_)
    if loop.settings.holds == 1:
        touch, held = _hold(loop, island[0], touch, members)
    holding = cycles()
    _begin_trajectories(loop, island[0], members, velocity)
    set_impact_margins(loop.table, touch.place, touch.contacts.gap, held, island[0].time, constants.dynamic)
    used_cycles[RESPOND] += responded - start
    used_cycles[LOAD] += loaded - responded
    used_cycles[HOLD] += holding - loaded
    used_cycles[MOVE] += cycles() - holding
    for verb in range(RESPOND, VERBS):
        calls[verb] += 1


@jit_making_arrays
def _respond(loop, island, touch, members):
    """Impulses at the contacts that approach (see `exact.impacts`)."""
    motion, memory, log, contacts, number = loop.motion, loop.memory, loop.log, touch.contacts, len(loop.elsewhere)
    now, collapses = motion.now, find_collapsing(memory, number, contacts)
    live = find_live(now, contacts, touch.live, touch.speeds, collapses, loop.settings.law)
    island.zero_speed, island.scale = live.rule.tolerance, live.rule.scale
    if not live.approach:
        return
    force, constants = np.empty((contacts.gap.shape[0], 3)), loop.bodies.constants
    read_forces(memory, motion.trajectory.start, contacts, touch.touching, force)
    response = Response(SEQUENTIAL, live.collapse or bear_each_other(contacts, constants, force))
    done = resolve_impacts(now, constants, members, live, response, loop.number, loop.no_joints, loop.impacts)
    if has_log_capacity(log, ENERGIES, NO_ROWS, done.count):
        log_impacts(log, island.time, contacts, now.position, done.log, done.count)
    else:
        report(loop.reports, NOT_RECORDED, island.time, float(done.count), members)
    remember_rebounds(memory, number, island.time, contacts, touch.contact_margin, done.log[: done.count])
    if done.capped:
        report(loop.reports, WITHOUT_REBOUND, island.time, 0.0, members)
    log_energy(log, island.time, IMPACT, done.energy)
    _classify(loop, touch, members)


@jit_making_arrays
def _hold(loop, island, touch, members):
    """Find the lasting contacts of an island, and their forces; returns the contacts and which of them last (see `contact_forces.hold`)."""
    motion, wrench, memory, constants = loop.motion, loop.wrench, loop.memory, loop.bodies.constants
    time, number, now, contact_log = island.time, len(constants.dynamic), motion.now, loop.contact_log
    close_contacts(contact_log, members, time)
    for i in members:
        for k in range(6):
            wrench[i, k] = 0.0
    forget_forces(memory, number, touch.contacts)
    held = _slow(island, touch.speeds)
    inside = leaves_from_inside(loop.table.pairs, touch.place, touch.contacts, held)
    if needs_correction(touch.contacts, held, inside, touch.contact_margin):
        touch = _correct_positions(loop, island, touch, (held, inside), members)
        held = _slow(island, touch.speeds)
    if not _any(held):
        look_around(loop.table, members, time, island.shift)
        return touch, held
    lasting = _chosen(touch, _places(held))
    contacts, touching = lasting.contacts, lasting.touching
    shapes = loop.shapes
    moves = contact_motion(shapes.geometry, shapes.of_body, motion.rotation, now, contacts, touching.kind, touching.feature)
    turning = Turning(moves, touching, lasting.contact_margin)
    problem = ContactProblem(now, contacts, members, loop.number, moves.turning, motion.acceleration, motion.angular_acceleration)
    forces = Forces(np.empty((contacts.gap.shape[0], 3)), wrench)
    read_forces(memory, motion.trajectory.start, contacts, touching, forces.force)
    before, rest, step = kinetic_energy(now, constants, members), island.end - time, loop.settings.step
    limits = StepLimits(rest, step, loop.sub_step, loop.limiter.under_contact)
    rolling = rolling_of(loop.rolling, constants.material, now, contacts)
    solution = hold_turning(None, None, problem, turning, loop.estimate, limits, forces, rolling)
    log_energy(loop.log, time, STICK, kinetic_energy(now, constants, members) - before)
    failed = solution.residual > UNSOLVED and makes_energy(problem, constants, wrench, None, solution.length)
    if failed:
        for i in members:
            for k in range(6):
                wrench[i, k] = 0.0
        for c in range(contacts.gap.shape[0]):
            for k in range(3):
                forces.force[c, k] = 0.0
    note_hold(loop.limiter, now, constants, contacts, members, np.empty(0, np.int64), True)
    lasts = contacts.gap.shape[0]
    if has_contact_capacity(contact_log, lasts) and has_capacity(memory, lasts):
        replace_contacts(contact_log, members, time, contacts, now.position, forces.force)
        keep_forces(memory, number, time, contacts, touching, forces.force)
        if turns(moves, step) and not failed:
            keep_wrenches(memory, number, time, contacts, solution.force, solution.slides)
    else:
        report(loop.reports, NOT_RECORDED, time, float(lasts), members)
    if solution.residual > UNSOLVED:
        report(loop.reports, NOT_SOLVED, time, solution.residual, members)
    island.rests = stands_still(problem, constants, touch.contacts, wrench, solution.length)
    if solution.length < rest and not island.rests:
        wake = loop.table.wake
        for i in members:
            wake[i] = time + solution.length
    look_around(loop.table, members, time, island.shift)
    return touch, held


@jit
def _any(which):
    for c in range(which.shape[0]):
        if which[c]:
            return True
    return False


@jit_making_arrays
def _places(which):
    """Places (k,) of what is marked."""
    places, count = np.empty(which.shape[0], np.int64), np.int64(0)
    for c in range(which.shape[0]):
        if which[c]:
            places[count] = c
            count += 1
    return places[:count]


@jit_making_arrays
def _correct_positions(loop, island, touch, which, members):
    """Bring contacts apart, which (2, m) bool have sunk or leave from inside, and look at all again (see `contact_forces`)."""
    motion, constants, time = loop.motion, loop.bodies.constants, island.time
    now, k = motion.now, len(members)
    place, turn, way = np.empty((k, 3)), np.empty((k, 4)), np.empty((k, 3))
    for s in range(k):
        for j in range(3):
            place[s, j] = now.position[members[s], j]
        for j in range(4):
            turn[s, j] = now.orientation[members[s], j]
    before = mechanical_energy(now, constants, members)
    around = _contacts_near(loop, members, time)
    lifted, inside, depth = np.zeros(len(around.live), np.bool_), np.zeros(len(around.live), np.bool_), 0.0
    mark_same(touch.contacts, touch.touching, which[0], around.contacts, around.touching, lifted)
    mark_same(touch.contacts, touch.touching, which[1], around.contacts, around.touching, inside)
    correct_positions(now, around.contacts, Sunk(lifted, inside, around.contact_margin), members, loop.number)
    refresh_pose(members, now, motion.rotation, motion.trajectory.inertia)
    log_energy(loop.log, time, POSITION_CORRECTION, mechanical_energy(now, constants, members) - before)
    for s in range(k):
        for j in range(3):
            way[s, j] = now.position[members[s], j] - place[s, j]
    for c in range(len(around.live)):
        depth = max(depth, around.contact_margin[c])
    change = limit_correction_energy(now, constants, around.contacts, members, np.empty(0, np.int64), way, depth)
    log_energy(loop.log, time, ENERGY_CORRECTION, change)
    island.moved = True
    island.shift = shift_of(now, constants.bound_radius, members, place, turn)
    pairs = np.empty(len(touch.place), np.int64)
    count = np.int64(0)
    for c in range(len(touch.place)):
        if c == 0 or touch.place[c] != touch.place[c - 1]:
            pairs[count] = touch.place[c]
            count += 1
    again = _contacts_of(loop, pairs[:count], MARGIN, time)
    _classify(loop, again, members)
    return again


@jit_making_arrays
def _contacts_near(loop, members, time):
    """What a position correction of the members may close: contacts with all that is near."""
    used, asked = loop.table.number[USED], np.zeros(loop.motion.rotation.shape[0], np.bool_)
    for i in members:
        asked[i] = True
    near = np.empty(used, np.int64)
    radius = loop.bodies.constants.bound_radius
    count = near_pairs(loop.motion.trajectory, time, loop.table, radius, asked, np.zeros(used, np.bool_), near)
    return _contacts_of(loop, near[:count], FAR_MARGIN, time)


@jit_making_arrays
def _contacts_of(loop, places, margin, time):
    """The contacts of the pairs at these places within `margin` contact margins, at the present poses, sorted by pair."""
    table, motion, shapes, count = loop.table, loop.motion, loop.shapes, NONE
    found = make_found(FIRST_CONTACTS, np.int64(0), make_contact_scratch(SCRATCH_ROWS, np.int64(0), FEW_ROWS))
    while count < 0:
        count = contacts_at(shapes, motion, table, places, margin, found, np.int64(0))
        if count >= 0:
            count = witness_contacts(table, places, time, found, np.int64(0), count)
        if count < 0:
            found = make_found(-2 * count, np.int64(0), make_contact_scratch(-8 * count, np.int64(0), FEW_ROWS))
    order, owner = np.empty(count, np.int64), np.zeros(count, np.int64)
    for c in range(count):
        order[c] = c
    sort_contacts(owner, found.buffers.integer, order)
    return _touch(loop, found, order, time)


@jit
def _begin_trajectories(loop, island, members, velocity):
    """New trajectories for members whose velocity, pose or wrench changed (see `exact.trajectories`); velocity (k, 6): before."""
    now, mode, wrench, under_contact = loop.motion.now, loop.motion.trajectory.mode, loop.wrench, loop.limiter.under_contact
    for s in range(members.shape[0]):
        i = members[s]
        if island.rests and mode[i] == FIXED and not island.moved:
            continue
        changed = island.moved or under_contact[i]
        for k in range(3):
            changed = changed or now.velocity[i, k] != velocity[s, k] or now.angular_velocity[i, k] != velocity[s, 3 + k]
        for k in range(6):
            changed = changed or wrench[i, k] != 0.0
        if changed:
            _begin_trajectory(loop, i, (island.time, island.end), wrench[i], island.rests)


@jit_making_arrays
def _begin_trajectory(loop, i, interval, wrench, rests):
    """Body i gets a new trajectory, from its present state, with a constant wrench (6,); interval: from when to the end of the step, s."""
    now, trajectory, time, total = loop.motion.now, loop.motion.trajectory, interval[0], 0.0
    for k in range(3):
        total += now.velocity[i, k] + now.angular_velocity[i, k]
    if not isfinite(total):
        one = np.empty(1, np.int64)
        one[0] = i
        pose_at(trajectory, i, time, now.position[i], now.orientation[i])
        report(loop.reports, NOT_FINITE, time, 0.0, one)
        rests = True
    begin_steady_trajectory(loop, i, interval, wrench, rests, False)
