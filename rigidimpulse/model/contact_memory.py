"""What contacts leave behind from one instant to the next: rebounds of pairs, and the forces that held contacts carry.

One open-addressing table holds every pair of bodies that ever rebounded or was held, by its key a n + b, a < b, in a power of two of
places. A pair that was held has a row of `held`, and that row a stretch of `force`, one entry for each contact of the last solution.
A solution replaces all entries of its pairs, so what is remembered is always one whole solution.

A contact is recognised by what touches: a vertex that slides over a tiled face stays the same contact, so the face does not count.
An entry counts as long as neither body has taken a new trajectory since: the forces ended there.

Kernels need free places: `has_capacity` says whether there are some, `ContactMemory.grow` makes them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.simplices import FACE_VERTEX, VERTEX_FACE
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.memory import rows_of

HELD = np.dtype(
    [
        ("start", np.float64),
        ("slips", np.bool_),
        ("first", np.int64),
        ("count", np.int64),
        ("capacity", np.int64),
    ]
)
"""A held pair: since when its forces are constant while contacts turn [s], nan where they do not turn; whether a contact slipped; its
stretch of `ContactMemory.force`."""
FORCE = np.dtype(
    [
        ("kind", np.int64),
        ("feature_a", np.int64),
        ("feature_b", np.int64),
        ("force", np.float64, (3,)),
        ("time", np.float64),
        ("slips", np.bool_),
    ]
)
"""A held contact: what touches, its force in (n, t1, t2) [N], since when [s], and whether it slipped then."""
FIRST_PAIRS, FIRST_HELD, FIRST_FORCES = 1024, 512, 4096
"""Space at first: for more than the compiled loop asks to have free before the first event of a small scene."""
LEAST_STRETCH = 4
"""Entries that a held pair has space for at first."""
PAIRS, HELD_PAIRS, FORCES = np.arange(3)
"""Places in `ContactMemory.used`."""


class ContactMemory(NamedTuple):
    """The memory of a run; see the head of the file."""

    key: np.ndarray  # (k,) a n + b, -1 for a free place
    time: np.ndarray  # (k,) s, of the last rebound
    speed: np.ndarray  # (k,) m/s, of the last rebound
    count: np.ndarray  # (k,) how many rebounds in a row were short
    row: np.ndarray  # (k,) row of `held`, -1 for a pair that was never held
    held: np.ndarray  # (h,) HELD
    force: np.ndarray  # (f,) FORCE
    used: np.ndarray  # (3,) pairs, rows of held and entries of force in use
    since: np.ndarray  # (n,) s, since when the wrench of a body's turning contacts is constant, nan where none is
    wrench: np.ndarray  # (n, 6) N, N m, that wrench


def make_memory(number: int, pairs: int = FIRST_PAIRS, held: int = FIRST_HELD, forces: int = FIRST_FORCES) -> ContactMemory:
    """An empty memory of `number` bodies with these numbers of places; pairs: a power of two."""
    integers = np.full((2, pairs), -1, np.int64)
    return ContactMemory(
        integers[0], np.full(pairs, -np.inf), np.zeros(pairs), np.zeros(pairs, np.int64), integers[1], rows_of(held, HELD),
        rows_of(forces, FORCE), np.zeros(3, np.int64), np.full(number, np.nan), np.zeros((number, 6)),
    )  # fmt: skip


@jit
def place_of(memory, key):
    """Place of a pair's key, or the free place where it belongs."""
    last = len(memory.key) - 1
    at = (key * np.int64(0x9E3779B97F4A7C1) >> 7) & last
    while memory.key[at] >= 0 and memory.key[at] != key:
        at = (at + 1) & last
    return at


@jit
def claimed_place(memory, key):
    """Place of a pair's key, which is put there if it is new; there must be a free place."""
    at = place_of(memory, key)
    if memory.key[at] < 0:
        memory.key[at] = key
        memory.used[PAIRS] += 1
    return at


@jit
def remember_rebound(memory, key, time, speed, count):
    """Keep the last rebound of a pair."""
    at = claimed_place(memory, key)
    memory.time[at], memory.speed[at], memory.count[at] = time, speed, count


@jit
def has_capacity(memory, contacts):
    """Whether a number of contacts, each of a new pair, can be remembered."""
    used = memory.used
    return (
        2 * (used[PAIRS] + contacts) < len(memory.key)
        and used[HELD_PAIRS] + contacts <= len(memory.held)
        and used[FORCES] + LEAST_STRETCH * contacts <= len(memory.force)
    )


@jit
def held_row(memory, key):
    """Row of `held` of a pair, -1 where it was never held."""
    at = place_of(memory, key)
    return memory.row[at] if memory.key[at] == key else np.int64(-1)


@jit
def identity(kind, feature_a, feature_b):
    """What a contact is recognised by: its kind and the features that count."""
    if kind == VERTEX_FACE:
        return kind, feature_a, np.int64(-1)
    if kind == FACE_VERTEX:
        return kind, np.int64(-1), feature_b
    return kind, feature_a, feature_b


@jit
def find_force(memory, row, kind, feature_a, feature_b):
    """Entry of `force` of a contact of a held pair, -1 where it was not held."""
    kind, feature_a, feature_b = identity(kind, feature_a, feature_b)
    first = memory.held[row].first
    for entry in range(first, first + memory.held[row].count):
        known = memory.force[entry]
        if known.kind == kind and known.feature_a == feature_a and known.feature_b == feature_b:
            return np.int64(entry)
    return np.int64(-1)


@jit
def read_forces(memory, start, contacts, touching, out):
    """Forces (m, 3) N that contacts carry until now, in their frames, into out; zeros for those whose bodies have parted since.

    start: (n,) s, of the trajectories; touching: the `Touching` of the contacts.
    """
    number = start.shape[0]
    for c in range(contacts.gap.shape[0]):
        a, b = contacts.body_a[c], contacts.body_b[c]
        for k in range(3):
            out[c, k] = 0.0
        row = held_row(memory, a * number + b)
        if row < 0:
            continue
        entry = find_force(memory, row, touching.kind[c], touching.feature[c, 0], touching.feature[c, 1])
        if entry >= 0 and memory.force[entry].time >= max(start[a], start[b]):
            for k in range(3):
                out[c, k] = memory.force[entry].force[k]


@jit
def forget_forces(memory, number, contacts):
    """Whatever acted between the bodies of these contacts over a sub-step does not any more; number: of bodies."""
    for c in range(contacts.gap.shape[0]):
        a, b = contacts.body_a[c], contacts.body_b[c]
        memory.since[a] = memory.since[b] = np.nan
        row = held_row(memory, a * number + b)
        if row >= 0:
            memory.held[row].start = np.nan


@jit
def _empty_stretch(memory, at, size):
    """Give the pair at a place a row of `held` with an empty stretch of at least `size` entries; returns the row."""
    row = memory.row[at]
    if row < 0:
        row = memory.used[HELD_PAIRS]
        memory.row[at] = row
        memory.used[HELD_PAIRS] += 1
        memory.held[row].capacity = 0
    held = memory.held[row]
    if held.capacity < size:
        held.first, held.capacity = memory.used[FORCES], max(size, LEAST_STRETCH)
        memory.used[FORCES] += held.capacity
    held.start, held.count, held.slips = np.nan, 0, False
    return row


@jit
def keep_forces(memory, number, time, contacts, touching, force):
    """Keep the forces (m, 3) N that contacts carry from `time` on, in their frames, in the place of all that their pairs carried.

    number: of bodies; touching: the `Touching` of the contacts. Contacts of a pair come one after the other.
    """
    first = np.int64(0)
    while first < contacts.gap.shape[0]:
        a, b, last = contacts.body_a[first], contacts.body_b[first], first
        while last < contacts.gap.shape[0] and contacts.body_a[last] == a and contacts.body_b[last] == b:
            last += 1
        row = _empty_stretch(memory, claimed_place(memory, a * number + b), last - first)
        held = memory.held[row]
        for c in range(first, last):
            entry = memory.force[held.first + c - first]
            entry.kind, entry.feature_a, entry.feature_b = identity(touching.kind[c], touching.feature[c, 0], touching.feature[c, 1])
            entry.time, entry.slips = time, False
            for k in range(3):
                entry.force[k] = force[c, k]
        held.count = last - first
        first = last


@jit
def keep_wrenches(memory, number, time, contacts, world_force, slides):
    """Let the forces kept of these contacts act until they are taken back in part, where contacts turn (velocity projection).

    world_force (m, 3) N on b; slides (m,) bool. Contacts of a pair come one after the other, as `keep_forces` got them; all contacts that
    act on a movable body come at once.
    """
    row, at = np.int64(-1), np.int64(0)
    for c in range(contacts.gap.shape[0]):
        for i in (contacts.body_a[c], contacts.body_b[c]):
            memory.since[i] = time
            for k in range(6):
                memory.wrench[i, k] = 0.0
    for c in range(contacts.gap.shape[0]):
        a, b = contacts.body_a[c], contacts.body_b[c]
        if c == 0 or a != contacts.body_a[c - 1] or b != contacts.body_b[c - 1]:
            row, at = held_row(memory, a * number + b), 0
            memory.held[row].start = time
        held = memory.held[row]
        memory.force[held.first + at].slips = slides[c]
        held.slips = held.slips or slides[c]
        at += 1
        ra, rb, f = contacts.arm_a[c], contacts.arm_b[c], world_force[c]
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            memory.wrench[a, k] -= f[k]
            memory.wrench[b, k] += f[k]
            memory.wrench[a, 3 + k] -= ra[i] * f[j] - ra[j] * f[i]
            memory.wrench[b, 3 + k] += rb[i] * f[j] - rb[j] * f[i]


@jit
def _copy_pairs(source, target):
    """Put all pairs into a larger, empty table."""
    for at in range(len(source.key)):
        if source.key[at] >= 0:
            to = claimed_place(target, source.key[at])
            target.time[to], target.speed[to], target.count[to] = source.time[at], source.speed[at], source.count[at]
            target.row[to] = source.row[at]


def bodies_in_sub_steps(memory: ContactMemory, number: int) -> np.ndarray:
    """Bodies (k,) of held pairs whose forces are constant while contacts turn; number: of all bodies."""
    places = np.flatnonzero(memory.row >= 0)
    places = places[~np.isnan(memory.held["start"][memory.row[places]])]
    return np.unique(np.concatenate([memory.key[places] // number, memory.key[places] % number]))


@jit
def any_short_rebound(memory, number, rows):
    """Whether the last rebound of a pair in these rows (k, 15) of the table of impacts was a short one; number: of bodies."""
    for row in rows:
        at = place_of(memory, np.int64(row[1]) * number + np.int64(row[2]))
        if memory.count[at] > 0:
            return True
    return False


def held_pairs(memory: ContactMemory, start: np.ndarray) -> np.ndarray:
    """Pairs (k, 2) whose contacts carry forces; start: (n,) s, of the trajectories."""
    places = np.flatnonzero(memory.row >= 0)
    pairs = np.column_stack(np.divmod(memory.key[places], len(start)))
    held = memory.held[memory.row[places]]
    since = memory.force["time"][np.where(held["count"] > 0, held["first"], 0)]
    return pairs[(held["count"] > 0) & (since >= start[pairs].max(axis=1, initial=-np.inf))]


def rebounded_pairs(memory: ContactMemory, since: float, number: int) -> np.ndarray:
    """Pairs (k, 2) that rebounded at the time `since` [s] or later; number: of all bodies."""
    return np.column_stack(np.divmod(memory.key[(memory.key >= 0) & (memory.time >= since)], number))


def carried_memory(memory: ContactMemory, index: np.ndarray, carried: np.ndarray, number: int) -> ContactMemory:
    """The memory of the same pairs among other bodies, `number` of them.

    index: (n,) of each body there, -1 for those that are not there. carried: (n,) bool, bodies whose contacts still carry their forces.
    """
    copied = make_memory(number, len(memory.key), len(memory.held), len(memory.force))
    old = np.flatnonzero((index >= 0) & carried)
    copied.since[index[old]], copied.wrench[index[old]] = memory.since[old], memory.wrench[old]
    for place in np.flatnonzero(memory.key >= 0).tolist():
        pair = np.array(divmod(int(memory.key[place]), len(index)))
        a, b = index[pair].tolist()
        if min(a, b) < 0 or a > b:
            continue
        at = claimed_place(copied, a * number + b)
        copied.time[at], copied.speed[at], copied.count[at] = memory.time[place], memory.speed[place], memory.count[place]
        if memory.row[place] >= 0 and carried[pair].all():
            held = memory.held[memory.row[place]]
            first, row, entry = int(held["first"]), int(copied.used[HELD_PAIRS]), int(copied.used[FORCES])
            copied.held[row], copied.row[at] = held, row
            copied.held[row]["first"] = entry
            copied.force[entry : entry + held["count"]] = memory.force[first : first + held["count"]]
            copied.used[HELD_PAIRS], copied.used[FORCES] = row + 1, entry + held["capacity"]
    return copied


def grown(memory: ContactMemory, contacts: int) -> ContactMemory:
    """A memory of the same contents with space for `contacts` more; stretches that were given up are dropped."""
    pairs, held, forces = len(memory.key), len(memory.held), len(memory.force)
    while 2 * (int(memory.used[PAIRS]) + contacts) >= pairs:
        pairs *= 2
    while int(memory.used[HELD_PAIRS]) + contacts > held:
        held *= 2
    rows = memory.held[: memory.used[HELD_PAIRS]]
    live = int(rows["capacity"].sum())
    while live + LEAST_STRETCH * contacts > forces // 2:
        forces *= 2
    larger = make_memory(0, pairs, held, forces)._replace(since=memory.since, wrench=memory.wrench)
    _copy_pairs(memory, larger)
    larger.held[: len(rows)] = rows
    place = 0
    for row in range(len(rows)):
        first, count, capacity = (int(rows[name][row]) for name in ("first", "count", "capacity"))
        larger.force[place : place + count] = memory.force[first : first + count]
        larger.held[row]["first"] = place
        place += capacity
    larger.used[HELD_PAIRS], larger.used[FORCES] = len(rows), place
    return larger
