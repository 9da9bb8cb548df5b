"""A step of sub-stepped islands, stage by stage, compiled: looks at contacts, and sub-steps between them.

    FIND     contacts of the pairs that have moved (`contact_cache`); general pairs wait
    ASK      what the kernels of `collision.manifold` are asked about these
    MARK     meshes that are too far apart for a contact are left out
    SEARCH   contacts of the others
    STORE    in the table
    PLAN     how many sub-steps are made until the next look: at the end of the step, or again
    LIST     patches, colours and records of the contacts that are not in the batches yet (`tgs_soft`)
    SOLVE    the sub-steps
    KEEP     impulses go back to the table
    NEXT     the next part of the step, if this one is at its end
    LOOK     which bodies are quick: they are looked at again, from FIND on; those of all others stay in their batches

Where a stage has no space for its results, or is worth several cores, Python makes the space or does the stage (`ContactStepper`), and this
goes on from there. A step of thirty bodies has five looks and more, each of which called twenty kernels from Python: that took three times
as long as all that they did.
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_cache import (
    TOO_FEW_PLACES,
    Convex,
    Limits,
    Share,
    Workspace,
    find_contacts,
    most_motion,
    most_turn,
    note_changes,
)
from rigidimpulse.collision.contact_table import Table
from rigidimpulse.collision.contact_update import Asked, Deep, Searched, ask_general, mark_apart, store_contacts
from rigidimpulse.collision.geometry import Shapes
from rigidimpulse.collision.manifold.contact_points import TILT, Contacts
from rigidimpulse.collision.manifold.dispatch import ALL, PairQuery, contacts_of_pairs
from rigidimpulse.collision.manifold.smaller_shapes import SmallerShapes
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.simd import width_of
from rigidimpulse.dynamics.solvers.tgs_soft.bodies import SolverBodies
from rigidimpulse.dynamics.solvers.tgs_soft.body_motion import mark_quick
from rigidimpulse.dynamics.solvers.tgs_soft.energy_balance import Balance, Weights, begin_part, connect, end_balance
from rigidimpulse.dynamics.solvers.tgs_soft.fill import fill, keep_impulses, place_bodies
from rigidimpulse.dynamics.solvers.tgs_soft.records import (
    POINTS,
    Batches,
    Patches,
    colour_patches,
    leave_out_quick,
    list_patches,
    place_patches,
)
from rigidimpulse.dynamics.solvers.tgs_soft.solver import Solve, SpecialPatches, advance, special_patches
from rigidimpulse.motion.waypoints import Waypoints, add_waypoint

FIND, ASK, MARK, SEARCH, STORE, PLAN, LIST, SOLVE, KEEP, NEXT, LOOK, END = range(12)
"""Stages."""
GOES_ON, AT_STAGE, SHARE, NEEDS_GENERAL = map(np.int64, range(4))
"""Why the stages stopped: at the one that was asked for, before one that several cores share, before the first general pair."""
(
    MORE_PLACES, MORE_POINTS, MORE_ASKED, MORE_CONTACTS, MORE_PATCHES, MORE_COLOURS, MORE_BATCHES, MORE_WAYPOINTS,
) = map(np.int64, range(4, 12))  # fmt: skip
"""The same, for space, of which progress[NEEDED] is wanted."""
(
    STAGE, IS_AGAIN, PART, LENGTH, LEFT, SOME, LOOKED_AT, WAITING, FOUND, BEGUN, COLOURS_BEGUN, BATCHES_BEGUN, COUNT, COLOURS, BATCHES,
    BALLS, REBOUNDS, SUPPORTS, NEEDED, MADE, COLUMNS,
) = range(21)  # fmt: skip
"""Columns of progress: stage; 1 after the first look; part of the step, its sub-steps, those left, and those until the next look; pairs
that were looked at, general ones that wait, their contacts; patches, colours and batches that were made at earlier looks, and all of them;
special patches; what is needed; sub-steps that were made."""
COARSEST = 0.3
"""Inner radii by which bodies with inset surfaces may pass each other from look to look: sub-steps are made shorter for it."""
TURNED = 2.0 * TILT
"""Angle by which meshes may turn against each other from look to look, rad: of their corners those that come down by less are found. A die
that turned by twice that over an edge, in a cup, was 3.5 mm inside of it."""
LEAST_SUB_STEPS_BETWEEN = 2
"""Sub-steps from look to look."""
QUICK = 0.4
"""Part of `Step.kept` beyond which a body is quick: its contacts are looked for, and their records made, again in the middle of a step."""
MOSTLY = 0.3
"""Part of the bodies that are quick beyond which all count as such."""


class Island(NamedTuple):
    """Bodies by rank."""

    convex: Convex
    bodies: SolverBodies
    balance: Balance
    weights: Weights
    order: np.ndarray  # (n,) index of each
    cornered: np.ndarray  # (n,) bool, see `most_turn`
    coefficients: np.ndarray  # (k, k, 4), see material.combine


class General(NamedTuple):
    """What general pairs need."""

    smaller: SmallerShapes
    deep: Deep
    asked: Asked
    contacts: Contacts


class Memory(NamedTuple):
    """Contacts, their records, and scratch memory; it may grow between two stages."""

    table: Table
    lines: np.ndarray  # (8 m,) the points of the table as lines of 8
    places: np.ndarray  # (p,) pairs that are looked at
    margins: np.ndarray  # (p,) m
    workspace: Workspace
    patches: Patches
    lists: np.ndarray  # (3, 2 m) special patches
    target: np.ndarray  # (m, 4), see `SpecialPatches`
    batches: Batches
    begins: np.ndarray  # (c+1,) where the batches of colours begin
    places_of_bodies: np.ndarray  # (8 (n+1),) of `place_bodies`
    work_queue: np.ndarray  # of several cores that solve
    waypoints: Waypoints  # by rank


class Step(NamedTuple):
    """How a step is made."""

    h: float  # s, a sub-step
    ahead: float  # s, a part of the step
    same: float  # inner radii, see `contact_cache.Limits`
    first_kept: float  # of the first look
    kept: float  # of later ones
    motion: float  # inner radii that what comes to contact in the middle of the step moves until it is looked at again
    fall: float  # m/s, see `contact_cache.Limits`
    strength: float  # m/s2, of steady forces
    soft: np.ndarray  # (2, 3), see `softness`
    sub_steps: int
    parts: int
    law: int  # of restitution
    all_quick: bool  # all contacts are found again in the middle of the step
    is_special: bool  # whether there may be special patches
    has_frames: bool  # whether frames fall into the step: looks are waypoints
    balances: bool  # whether the energy is balanced at the end of each part of the step
    most_cores: int
    many_pairs: int  # beyond which several cores look at them
    many_general: int  # the same of general pairs
    many_batches: int  # the same of batches, counted in every sub-step


@jit
def pieces_of(bodies, pairs, cornered, motion, ahead):
    """Pieces into which `ahead` s is cut, so that pairs that have contacts are looked at often enough; motion: see `most_motion`."""
    pieces, turns = motion / COARSEST, most_turn(bodies, pairs, cornered, ahead) / TURNED
    return turns if turns > pieces else pieces


@jit
def length_of_part(sub_steps, parts, part):
    """Sub-steps in a part of the step."""
    return (part + 1) * sub_steps // parts - part * sub_steps // parts


@jit
def _look_again(width, island, memory, step, progress):
    """Say whose contacts are found again."""
    bodies, pairs = island.bodies, memory.table.pairs
    if step.all_quick or mark_quick(bodies, step.ahead, QUICK * step.kept) > MOSTLY:
        # All batches are made again: what has drifted counts from here.
        for i in range(bodies.quick.shape[0]):
            bodies.quick[i] = True
        for k in range(bodies.drift.shape[0]):
            bodies.drift[k] = 0.0
        progress[BEGUN] = progress[COLOURS_BEGUN] = progress[BATCHES_BEGUN] = 0
    note_changes(bodies, pairs, step.ahead, step.fall, island.coefficients)
    leave_out_quick(width, bodies, pairs, memory.patches, progress[BEGUN], memory.batches)
    progress[IS_AGAIN], progress[STAGE] = 1, FIND
    return GOES_ON


@jit
def limits_of(step, progress):
    """How far pairs may move with the contacts they have."""
    return Limits(step.ahead, step.same, step.kept if progress[IS_AGAIN] else step.first_kept, step.fall)


@jit
def _find(island, memory, step, progress):
    """Find the contacts of pairs that are not general."""
    share = Share(np.int64(0), np.int64(1), memory.places, memory.margins)
    looked_at, waiting = find_contacts(
        island.convex, island.bodies, memory.table, share, limits_of(step, progress), island.coefficients, memory.workspace
    )
    if waiting < 0:
        progress[NEEDED] = memory.workspace.parts.real.shape[0]
        return MORE_PLACES if waiting == TOO_FEW_PLACES else MORE_POINTS
    progress[LOOKED_AT], progress[WAITING] = looked_at, waiting
    progress[STAGE] = ASK if waiting > 0 else PLAN
    return GOES_ON


@jit
def _ask(island, memory, general, progress):
    """Write what is asked about general pairs."""
    waiting = progress[WAITING]
    if waiting > general.asked.a.shape[0]:
        progress[NEEDED] = waiting
        return MORE_ASKED
    places, margins = memory.places[:waiting], memory.margins[:waiting]
    ask_general(general.smaller, island.bodies, memory.table, places, margins, island.order, general.asked)
    progress[STAGE] = MARK
    return GOES_ON


@jit
def _mark(island, memory, general, progress):
    """Leave out meshes that are too far apart."""
    asked, places, margins, waiting, left = general.asked, memory.places, memory.margins, progress[WAITING], np.int64(0)
    span = (np.int64(0), waiting)
    mark_apart(general.smaller, island.bodies, asked, memory.table.pairs, places, span)
    for k in range(waiting):
        if not asked.is_apart[k]:
            places[left], margins[left] = places[k], margins[k]
            asked.a[left], asked.b[left], asked.shown[left], asked.far[left] = asked.a[k], asked.b[k], asked.shown[k], asked.far[k]
            left += 1
    progress[WAITING] = left
    progress[STAGE] = SEARCH if left > 0 else PLAN
    return GOES_ON


@jit
def _search(general, progress):
    """Find the contacts of general pairs."""
    asked, count, shapes = general.asked, progress[WAITING], Shapes(general.smaller.geometry, general.smaller.of_body)
    query = PairQuery(asked.a[:count], asked.b[:count], asked.shown[:count])
    found = contacts_of_pairs(shapes, asked, asked.rotation, query, general.contacts, ALL)
    if found < 0:
        progress[NEEDED] = -found
        return MORE_CONTACTS
    progress[FOUND], progress[STAGE] = found, STORE
    return GOES_ON


@jit
def _store(island, memory, general, progress):
    """Put them into the table."""
    count, found, free = progress[WAITING], progress[FOUND], memory.table.free
    # Beside what was found, bodies that sank get contacts of their own, and each row is written before it is known to be kept.
    needed = found + POINTS * count + 1
    if free[0, 1] - free[0, 0] < needed:
        progress[NEEDED] = needed
        return MORE_POINTS
    searched = Searched(memory.places[:count], memory.margins[:count], general.asked.far[:count])
    shapes, contacts = (general.smaller, general.deep), general.contacts
    store_contacts(
        shapes, island.bodies, memory.table, searched, (contacts.real, contacts.integer), found, island.order, island.coefficients
    )
    progress[STAGE] = PLAN
    return GOES_ON


@jit
def _plan(island, memory, step, progress):
    """Find how many sub-steps are made until the next look.

    What a look has found may be faster than what was known when the parts of the step were made: then a part is cut into more.
    """
    bodies, pairs, left = island.bodies, memory.table.pairs, progress[LEFT]
    ahead = step.ahead * left / progress[LENGTH]
    motion = most_motion(bodies, pairs, ahead)
    pieces = max(pieces_of(bodies, pairs, island.cornered, motion, ahead), motion / step.motion)
    # Speeds may be no numbers by now: the end of the step finds them.
    number = np.int64(ceil(pieces)) if pieces < left else left
    progress[SOME] = min(max(left // max(number, 1), LEAST_SUB_STEPS_BETWEEN), left)
    progress[STAGE] = LIST
    return GOES_ON


@jit
def _list(simd, island, memory, step, progress):
    """Make patches, colours and records of quick bodies after those that are kept."""
    width, bodies, pairs, patches, batches = width_of(simd), island.bodies, memory.table.pairs, memory.patches, memory.batches
    begin, first = progress[BEGUN], progress[BATCHES_BEGUN]
    count = list_patches(bodies, pairs, memory.table.points, patches, begin)
    if count < 0:
        progress[NEEDED] = -2 * count
        return MORE_PATCHES
    begins = memory.begins[progress[COLOURS_BEGUN] :]
    number, colours = colour_patches(width, bodies, pairs, patches, begin, count, first, begins)
    if colours < 0:
        progress[NEEDED] = progress[COLOURS_BEGUN] + 1 - 2 * colours
        return MORE_COLOURS
    if number > batches.points.shape[0]:
        progress[NEEDED] = 2 * number
        return MORE_BATCHES
    place_patches(width, bodies, pairs, patches, (begin, count), batches, (first, number))
    place_bodies(bodies, memory.places_of_bodies)
    fill(simd, batches, first, number, memory.places_of_bodies, bodies.mass, memory.lines, step.soft)
    connect(island.balance, bodies, pairs, patches, count)
    progress[COUNT], progress[BATCHES], progress[COLOURS] = count, number, progress[COLOURS_BEGUN] + colours
    progress[BALLS] = progress[REBOUNDS] = progress[SUPPORTS] = 0
    if step.is_special:
        table, edges = memory.table, memory.begins[: progress[COLOURS] + 1]
        solve = Solve(bodies, pairs, patches, batches, table.points, edges, progress[COLOURS_BEGUN])
        balls, rebounds, supports = special_patches(
            width, solve, begin, count, island.coefficients, step.strength, memory.lists, memory.target
        )
        progress[BALLS], progress[REBOUNDS], progress[SUPPORTS] = balls, rebounds, supports
    progress[STAGE] = SOLVE
    return GOES_ON


@jit
def work_on(simd, island, memory, step, progress, share, shares):
    """Make the sub-steps until the next look; share, shares: see `advance`."""
    table, lists, edges = memory.table, memory.lists, memory.begins[: progress[COLOURS] + 1]
    solve = Solve(island.bodies, table.pairs, memory.patches, memory.batches, table.points, edges, progress[COLOURS_BEGUN])
    special = SpecialPatches(
        lists[0, : progress[BALLS]], lists[1, : progress[REBOUNDS]], lists[2, : progress[SUPPORTS]], memory.target, island.coefficients,
        step.law, island.balance.given,
    )  # fmt: skip
    advance(simd, solve, special, progress[SOME], step.h, memory.work_queue, share, shares)


@jit
def _solve(simd, island, memory, step, progress):
    """Make the sub-steps until the next look."""
    work_on(simd, island, memory, step, progress, np.int64(0), np.int64(1))
    progress[STAGE] = KEEP
    return GOES_ON


@jit
def _keep(simd, island, memory, progress):
    """Put the impulses back to the table; the batches that have all contacts in them are kept."""
    keep_impulses(simd, memory.batches, progress[BATCHES], memory.lines)
    if progress[COLOURS_BEGUN] == 0:
        quick = island.bodies.quick
        for i in range(quick.shape[0]):
            quick[i] = False
        progress[BEGUN], progress[COLOURS_BEGUN], progress[BATCHES_BEGUN] = progress[COUNT], progress[COLOURS], progress[BATCHES]
    progress[STAGE] = NEXT
    return GOES_ON


@jit
def _next(island, memory, step, progress):
    """Sub-steps have been made: look again, unless that was the end of the step."""
    waypoints, velocity = memory.waypoints, island.bodies.velocity
    if step.has_frames and waypoints.number[0] == waypoints.time.shape[0]:
        progress[NEEDED] = 2 * waypoints.time.shape[0] + 1
        return MORE_WAYPOINTS
    progress[MADE] += progress[SOME]
    progress[LEFT] -= progress[SOME]
    progress[STAGE] = LOOK
    if progress[LEFT] == 0:
        progress[PART] += 1
        progress[LENGTH] = progress[LEFT] = length_of_part(step.sub_steps, step.parts, progress[PART])
        if progress[PART] == step.parts:
            progress[STAGE] = END
        elif step.balances:
            end_balance(island.balance, island.bodies, island.weights)
            begin_part(island.balance, island.bodies, island.weights)
    if step.has_frames:
        number = add_waypoint(waypoints, step.h * progress[MADE], island.bodies)
        for i in range(waypoints.state.shape[1]):
            for k in range(6):
                waypoints.state[number, i, 7 + k] = velocity[8 * i + k]
    return GOES_ON


@jit
def _is_shared(step, progress):
    """Whether the stage is worth several cores."""
    stage = progress[STAGE]
    if step.most_cores == 1:
        return False
    return (
        (stage == FIND and progress[LOOKED_AT] > step.many_pairs)
        or (stage == MARK and progress[WAITING] > step.many_general)
        or (stage == SOLVE and progress[BATCHES] * progress[SOME] > step.many_batches)
    )


@jit
def _general_stage(island, memory, general, progress):
    """Go on with a stage of general pairs."""
    stage = progress[STAGE]
    if stage == ASK:
        return _ask(island, memory, general, progress)
    if stage == MARK:
        return _mark(island, memory, general, progress)
    if stage == SEARCH:
        return _search(general, progress)
    return _store(island, memory, general, progress)


@jit
def go_on(simd, island, memory, general, step, progress, last):
    """Go on with a step from its present stage; returns why it stops: at the stage `last` or at the end, or for Python to do something.

    general: `General`, or None: nothing is compiled for general pairs then, see `go_on_with_polyhedra`.
    """
    how = GOES_ON
    while how == GOES_ON:
        stage = progress[STAGE]
        if stage == last or stage == END:
            return AT_STAGE
        if _is_shared(step, progress):
            return SHARE
        if stage == LOOK:
            how = _look_again(width_of(simd), island, memory, step, progress)
        elif stage == FIND:
            how = _find(island, memory, step, progress)
        elif stage == PLAN:
            how = _plan(island, memory, step, progress)
        elif stage == LIST:
            how = _list(simd, island, memory, step, progress)
        elif stage == SOLVE:
            how = _solve(simd, island, memory, step, progress)
        elif stage == KEEP:
            how = _keep(simd, island, memory, progress)
        elif stage == NEXT:
            how = _next(island, memory, step, progress)
        elif general is None:
            how = NEEDS_GENERAL
        else:
            how = _general_stage(island, memory, general, progress)
    return how


@jit
def go_on_with_polyhedra(simd, island, memory, step, progress, last):
    """The same as long as there are no general pairs."""
    return go_on(simd, island, memory, None, step, progress, last)
