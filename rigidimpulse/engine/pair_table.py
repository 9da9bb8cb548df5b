"""The table of pairs that may meet in a step, and the kernels that keep it.

A pair is swept again when a body of it takes a new trajectory. The gap at which it comes to contact is `least_impact_margin`
for a pair without a past; it is lowered where a pair has just been in contact, so that leaving pairs are not in contact again, and
raised where a contact is held, so that the other features of the pair stay guarded.

The table has free rows at its end. A kernel that finds no space for a pair of a body says so, and
`PairEvents.add_missing_pairs` makes the table larger and looks again whom the body may reach.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.broad_phase import overlapping_with
from rigidimpulse.collision.time_of_impact.result import PairsToSweep
from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.memory import rows_of
from rigidimpulse.core.sorted_values import is_among
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.model.world import BodyConstants, World
from rigidimpulse.motion.trajectory import FIXED, JERK, place_at, rate_of, row_at, turning_points

NEAR = TOLERANCES.events.near
ROUND_OFF = TOLERANCES.events.contact_margin_round_off
STUCK_STEP = TOLERANCES.events.stuck_step
MARGIN = 2.0
"""Contacts are looked for within this many contact margins."""
MAX_REPEATS = 100
"""Contacts of a pair at one instant after which there is no motion that its neighbours allow: bodies are squeezed."""
MAX_TRIES = 30
"""Contacts of a pair at one instant without an impulse after which the pair is left alone."""
RUNAWAY, NEVER = 300.0, -np.inf
"""Times in a step that a body is dealt with, from which its island costs more than it advances and is handed to sub-steps; the count of a
body that is not handed over, however often that is."""
LARGE = 64
"""Bodies of an island from which that is the case the earlier, the more bodies it has: each event deals with all of them."""
MANY_SWEEPS = 8
"""New trajectories of a pair in a step from which it is swept only as far as its trajectories are likely to last."""
AHEAD = 4.0
"""How far that is, in lives of its last trajectories."""
SHORTEST = 2.0**-14
"""Shortest life that counts, in steps."""
FIRST_ROWS = 64
USED, SHORT = np.arange(2)
"""Places in `PairTable.number`."""

PAIR = np.dtype(
    [
        ("a", np.int64),
        ("b", np.int64),
        ("time", np.float64),
        ("start", np.float64),
        ("impact_margin", np.float64),
        ("least_impact_margin", np.float64),
        ("contact_margin", np.float64),
        ("tolerance", np.float64),
        ("tries", np.int64),
        ("sweeps", np.int64),
        ("began", np.float64),
        ("life", np.float64),
        ("since", np.float64),
        ("repeats", np.int64),
        ("witness", np.float64, (10,)),
    ]
)
"""A pair of bodies a < b that may meet in the step:

time: s, when the pair reaches its impact margin; inf if it does not before the end of the step, or not before `start`.
start: s, from when the pair must be swept on; nan if its time stands.
impact_margin: m, gap at which contact is declared now. least_impact_margin: m, the same for a pair without a past.
contact_margin: m, gap at which lasting contacts are held. tolerance: m, gap error of an impact.
tries: how often the pair came to contact at one instant without an impulse.
sweeps: how often its bodies took new trajectories in the step. began: s, when they took the present ones.
life: s, how long these are likely to last, see `pairs_to_sweep`.
since: s, instant of contact. repeats: how often the pair came to contact at it.
witness: points on a and b, normal and gap where the pair comes to contact.
"""


class PairTable(NamedTuple):
    """The pairs of a step, and what is known of n bodies in it."""

    pairs: np.ndarray  # (c,) PAIR
    number: np.ndarray  # (2,) rows in use; whether a body has found no space for a pair
    box_min: np.ndarray  # (n, 3) m, box of the path of each body until the end of the step
    box_max: np.ndarray  # (n, 3) m
    movable: np.ndarray  # (n,) bool, bodies that move or may begin to
    wake: np.ndarray  # (n,) s, when bodies must be looked at again though nothing meets them
    inside: np.ndarray  # (n,) bool, members of sub-stepped islands
    asleep: np.ndarray  # (n,) bool, sleeping members of such islands, and bodies that never move
    without_space: np.ndarray  # (n,) bool, bodies that found no space for a pair
    looked_around: np.ndarray  # (n,) s, when a position correction called each body last


def make_pairs(capacity: int) -> np.ndarray:
    """Rows (c,) PAIR of a table."""
    return rows_of(capacity, PAIR)


@inlined
def most_solves(number):
    """Times in a step that the bodies of an island of a number of bodies may be dealt with; more often they run away."""
    return RUNAWAY / max(number / LARGE, 1.0)


@jit_making_arrays
def path_box(trajectory, i, begin, end, radius, box_min, box_max):
    """Box of the sphere of `radius` about the centre of body i along its parabola or cubic from begin to end."""
    x = np.empty(3)
    place_at(trajectory, i, begin, x)
    h = end - begin
    s = begin - trajectory.start[i]
    mode = trajectory.mode[i]
    growth = rate_of(trajectory, i, JERK)
    pull = row_at(trajectory.acceleration, i, growth, s)
    for k in range(3):
        a, jerk = pull[k] if mode != FIXED else 0.0, 0.0 if mode == FIXED else growth[k]
        v = 0.0 if mode == FIXED else trajectory.velocity[i, k] + (a - 0.5 * jerk * s) * s
        last = x[k] + v * h + 0.5 * a * h * h + jerk * h * h * h / 6.0
        low, high = min(x[k], last), max(x[k], last)
        if jerk != 0.0:
            # Where a coordinate of the path turns between begin and end, it is farthest.
            for turn in turning_points(v, a, jerk):
                if 0.0 < turn < h:
                    apex = x[k] + turn * (v + turn * (0.5 * a + turn * jerk / 6.0))
                    low, high = min(low, apex), max(high, apex)
        elif a != 0.0 and 0.0 < -v / a < h:
            apex = x[k] - 0.5 * v * v / a
            low, high = min(low, apex), max(high, apex)
        box_min[i, k] = low - radius
        box_max[i, k] = high + radius


@jit
def path_boxes(trajectory, members, begin, end, radius, box_min, box_max):
    """Boxes of the members' paths from begin to end [s]; radius (n,) m."""
    for i in members:
        path_box(trajectory, i, begin, end, radius[i], box_min, box_max)


@jit
def clear_pairs(table, trajectory, constants):
    """Forget the pairs of the step before, and what was known of its bodies; none belongs to a sub-stepped island."""
    dynamic, moving = constants.dynamic, constants.moving
    table.number[USED] = table.number[SHORT] = 0
    for i in range(dynamic.shape[0]):
        table.movable[i] = dynamic[i] or trajectory.mode[i] != FIXED
        table.wake[i], table.looked_around[i] = np.inf, -np.inf
        table.inside[i], table.asleep[i], table.without_space[i] = False, not (dynamic[i] or moving[i]), False


@jit
def is_swept(table, dynamic, a, b):
    """Whether a pair is swept: the sub-stepped regime looks after those of its members, and nothing moves those that sleep."""
    free = (dynamic[a] and not table.inside[a]) or (dynamic[b] and not table.inside[b])
    return free and not (table.asleep[a] and table.asleep[b])


@jit
def append_pairs(bodies, margins, table, first, second, start):
    """Add pairs (k,) that may meet, without a past, to be swept from `start` [s] on; bodies: `PairBodies`, margins: `Margins`.

    A pair for which there is no space is left out, and its second body marked.
    """
    constants, dynamic = bodies.constants, bodies.constants.dynamic
    for k in range(first.shape[0]):
        a, b = min(first[k], second[k]), max(first[k], second[k])
        collides = bodies.can_collide == 1 and (dynamic[a] or dynamic[b])
        if not (collides and is_swept(table, dynamic, a, b)) or is_among(bodies.apart, a * len(dynamic) + b):
            continue
        if table.number[USED] == len(table.pairs):
            table.number[SHORT] = 1
            table.without_space[first[k]] = True
            continue
        pair = table.pairs[table.number[USED]]
        table.number[USED] += 1
        size = min(constants.size[a], constants.size[b])
        pair.a, pair.b, pair.time, pair.start = a, b, np.inf, start
        pair.least_impact_margin = margins.impact * size if constants.flat[a] and constants.flat[b] else 0.0
        pair.impact_margin = pair.least_impact_margin
        pair.contact_margin, pair.tolerance = margins.contact * size, margins.tolerance * size
        pair.tries, pair.since, pair.repeats = 0, -np.inf, 0
        pair.sweeps, pair.began, pair.life = 0, start, np.inf
        for i in range(10):
            pair.witness[i] = 0.0


class PairBodies(NamedTuple):
    """What the table asks of the bodies."""

    constants: BodyConstants
    apart: np.ndarray  # (p,) pairs a n + b, ascending, that do not touch each other by order
    can_collide: int  # 1 if any two bodies may meet, else 0


def pair_bodies(world: World) -> PairBodies:
    """What the table asks of the bodies of a world."""
    return PairBodies(world.constants, world.apart, int(world.can_collide))


@jit
def sweep_pair_again(table, p, time, dynamic):
    """Let pair p be swept from `time` on, unless it is given up or the sub-stepped regime looks after it; dynamic (n,) bool."""
    pair = table.pairs[p]
    pair.time = np.inf
    lasted = time - pair.began
    pair.sweeps, pair.began, pair.life = pair.sweeps + 1, time, lasted if pair.life == np.inf else 0.5 * (pair.life + lasted)
    again = pair.repeats <= MAX_REPEATS and is_swept(table, dynamic, pair.a, pair.b)
    pair.start = time if again else np.nan


@jit
def sweep_pairs_again(table, places, time, dynamic):
    """The same for the pairs at all these places."""
    for p in places:
        sweep_pair_again(table, p, time, dynamic)


@jit
def zone_of(pair, nearest, time):
    """Gap up to which contacts of a pair are live at `time`; nearest: m, the least of them."""
    zone = pair.impact_margin * (1.0 + NEAR) + 2.0 * pair.tolerance
    if pair.time <= time:
        zone = max(zone, nearest * (1.0 + NEAR))
    return zone + ROUND_OFF * pair.contact_margin


@jit
def mark_live(pairs, place, gap, time, live):
    """Mark (m,) the contacts at the gap at which contact is declared; of a pair that just came to it at least its nearest.

    place (m,): their pairs, pair after pair; gap (m,) m.
    """
    first = 0
    while first < place.shape[0]:
        last, nearest = first, np.inf
        while last < place.shape[0] and place[last] == place[first]:
            nearest = min(nearest, gap[last])
            last += 1
        zone = zone_of(pairs[place[first]], nearest, time)
        for c in range(first, last):
            live[c] = gap[c] <= zone
        first = last


@jit_making_arrays
def renew_pairs(bodies, margins, table, trajectory, body, interval):
    """Let the pairs of a body that took a new trajectory be swept again, and add those whom it may now reach.

    interval: when it took it and the end of the step, s.
    """
    time, end = interval
    dynamic = bodies.constants.dynamic
    path_box(trajectory, body, time, end, bodies.constants.bound_radius[body], table.box_min, table.box_max)
    for k in range(3):
        table.box_min[body, k] -= MARGIN * margins.largest
        table.box_max[body, k] += MARGIN * margins.largest
    known = np.zeros(dynamic.shape[0], np.bool_)
    known[body] = True
    for p in range(table.number[USED]):
        pair = table.pairs[p]
        if pair.a != body and pair.b != body:
            continue
        known[pair.a] = known[pair.b] = True
        sweep_pair_again(table, p, time, dynamic)
        pair.impact_margin = pair.least_impact_margin
        pair.tries = 0
    add_reached(bodies, margins, table, body, known, time)


@jit_making_arrays
def add_reached(bodies, margins, table, body, known, time):
    """Add the pairs of a body with those whose boxes overlap its own; known (n,) bool are left out."""
    fresh = np.empty(known.shape[0], np.int64)
    reached = overlapping_with(body, table.box_min, table.box_max, table.movable, fresh)
    count = 0
    for k in range(reached):
        if not known[fresh[k]]:
            fresh[count] = fresh[k]
            count += 1
    one = np.empty(count, np.int64)
    for k in range(count):
        one[k] = body
    append_pairs(bodies, margins, table, one, fresh[:count], time)


@jit_making_arrays
def add_missing(bodies, margins, table, body, time):
    """Add those pairs of a body that it found no space for; nothing else changes."""
    known = np.zeros(bodies.constants.dynamic.shape[0], np.bool_)
    known[body] = True
    for p in range(table.number[USED]):
        pair = table.pairs[p]
        if pair.a == body or pair.b == body:
            known[pair.a] = known[pair.b] = True
    add_reached(bodies, margins, table, body, known, time)


@jit
def next_time(table):
    """Time of the earliest contact or call, inf if there is none."""
    time = np.inf
    for p in range(table.number[USED]):
        time = min(time, table.pairs[p].time)
    for i in range(table.wake.shape[0]):
        time = min(time, table.wake[i])
    return time


@inlined
def _until(pair, step, end):
    """Until when a pair that is swept from its start is looked at, s; step: s, that ends at `end`."""
    if pair.sweeps < MANY_SWEEPS:
        return end
    # Never so short that it takes more than a dozen doublings to the end: at one instant a pair may be swept again and again.
    pair.life = max(pair.life, SHORTEST * step)
    return min(end, pair.start + AHEAD * pair.life)


@jit_making_arrays
def pairs_to_sweep(table, step, end):
    """The pairs that must be swept before the next event is known; returns their places (k,) and `PairsToSweep`.

    To sweep a pair to the end of the step is wasted where its bodies meet something long before: a light body between two heavy ones does
    so a thousand times in a step. So a pair that was swept often is looked at only a few lives of its last trajectories ahead (each counts
    half as much as the next one). If nothing came to pass until then, it is swept on from there, twice as far. Without such pairs
    all is swept at once.
    """
    least, count = np.inf, np.int64(0)
    for p in range(table.number[USED]):
        start = table.pairs[p].start
        if start < least:
            least = start
    known = min(next_time(table), end)
    # Few arrays: to make one for each field took as long as all else.
    whole = np.empty((3, table.number[USED]), np.int64)
    places = whole[0]
    for p in range(table.number[USED]):
        pair = table.pairs[p]
        if least <= known and (pair.start <= least or (pair.sweeps < MANY_SWEEPS and pair.start == pair.start)):
            places[count] = p
            count += 1
    real = np.empty((4, count))
    asked = PairsToSweep(whole[1, :count], whole[2, :count], real[0], real[1], real[2], real[3])
    for k in range(count):
        pair = table.pairs[places[k]]
        asked.a[k], asked.b[k], asked.start[k], asked.until[k] = pair.a, pair.b, pair.start, _until(pair, step, end)
        asked.impact_margin[k], asked.tolerance[k] = pair.impact_margin, pair.tolerance
    return places[:count], asked


@jit
def note_sweep(table, places, found):
    """Keep what was found (`ImpactTimes`) of the pairs at these places (k,)."""
    for k in range(places.shape[0]):
        pair = table.pairs[places[k]]
        pair.time, pair.start = found.time[k], found.clear[k]
        if pair.start == pair.start:
            pair.life *= 2.0
        for j in range(10):
            pair.witness[j] = found.witness[k, j]


@jit
def mark_met(table, dynamic, time, mark):
    """Mark (n,) movable bodies that come to contact, and bodies that are called, at `time`.

    Not what they come to contact with, if it does not move: whoever else touches a floor has nothing to do with them.
    """
    for i in range(mark.shape[0]):
        mark[i] = table.wake[i] <= time
    for p in range(table.number[USED]):
        pair = table.pairs[p]
        if pair.time <= time:
            mark[pair.a] = mark[pair.a] or dynamic[pair.a]
            mark[pair.b] = mark[pair.b] or dynamic[pair.b]


@jit
def count_contacts(table, time, instant, given_up):
    """Count contacts at one instant [s]; writes the pairs with too many, which are left alone, into given_up (k,); returns their number."""
    count = 0
    for p in range(table.number[USED]):
        pair = table.pairs[p]
        if pair.time > time:
            continue
        if time - pair.since <= instant:
            pair.repeats += 1
        else:
            pair.repeats, pair.since = 0, time
        if pair.repeats > MAX_REPEATS and count < given_up.shape[0]:
            pair.start, pair.time = np.nan, np.inf
            given_up[count] = p
            count += 1
    return count


@jit
def settle_pairs(table, time, dynamic, given_up):
    """Let pairs that came to contact without consequence be swept again from here with a smaller gap.

    Writes the pairs that did so too often, which are left alone, into given_up (k,); returns their number.
    """
    count = 0
    for p in range(table.number[USED]):
        pair = table.pairs[p]
        if pair.time > time:
            continue
        pair.tries += 1
        step = pair.tries * STUCK_STEP * pair.contact_margin
        pair.impact_margin = 0.5 * pair.impact_margin if pair.least_impact_margin > 0.0 else -step
        sweep_pair_again(table, p, time, dynamic)
        if pair.tries > MAX_TRIES and count < given_up.shape[0]:
            pair.start = np.nan
            given_up[count] = p
            count += 1
    return count


@jit
def look_around(table, members, time, shift):
    """Call members that a position correction moved by `shift` [m], 0 if it did not, once more: others may be near now."""
    if not shift > 0.0:
        return
    least = np.inf
    for p in range(table.number[USED]):
        pair = table.pairs[p]
        for i in members:
            if (pair.a == i or pair.b == i) and table.looked_around[i] < time:
                least = min(least, pair.contact_margin)
    if not shift > least:
        return
    for i in members:
        if table.looked_around[i] < time:
            table.looked_around[i] = table.wake[i] = time
