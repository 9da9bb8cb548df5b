"""The table of pairs that may meet in a step, and the kernels that keep it.

A pair is swept again when a body of it takes a new trajectory. The gap at which it comes to contact is `least_impact_margin`
for a pair without a past; it is lowered where a pair has just been in contact, so that leaving pairs are not in contact again, and
raised where a contact is held, so that the other features of the pair stay guarded.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.broad_phase import overlapping_with
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import FIXED, FREE, JERK, place_at, rate_of, row_at, turning_points

NEAR = TOLERANCES.events.near
ROUND_OFF = TOLERANCES.events.contact_margin_round_off
MARGIN = 2.0
"""Contacts are looked for within this many contact margins."""
MAX_REPEATS = 100
"""Contacts of a pair at one instant after which there is no motion that its neighbours allow: bodies are squeezed."""


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
        a, jerk = pull[k] if mode >= FREE else 0.0, 0.0 if mode == FIXED else growth[k]
        v = 0.0 if mode == FIXED else trajectory.velocity[i, k] + (a - 0.5 * jerk * s) * s
        last = x[k] + v * h + 0.5 * a * h * h + jerk * h * h * h / 6.0
        low, high = min(x[k], last), max(x[k], last)
        if jerk != 0.0:
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
    for i in members:
        path_box(trajectory, i, begin, end, radius[i], box_min, box_max)


class Pairs(NamedTuple):
    """Columns of k pairs of bodies, a < b."""

    a: np.ndarray  # (k,) body indices
    b: np.ndarray
    time: np.ndarray  # (k,) s, when the pair reaches its impact margin; inf if it does not before the end of the step
    start: np.ndarray  # (k,) s, from when the pair must be swept again; nan if its time stands
    impact_margin: np.ndarray  # (k,) m, gap at which contact is declared now
    least_impact_margin: np.ndarray  # (k,) m, the same for a pair without a past
    contact_margin: np.ndarray  # (k,) m, gap at which lasting contacts are held
    tolerance: np.ndarray  # (k,) m, gap error of an impact
    tries: np.ndarray  # (k,) how often the pair came to contact at one instant without an impulse
    since: np.ndarray  # (k,) s, instant of contact
    repeats: np.ndarray  # (k,) how often the pair came to contact at it
    witness: np.ndarray  # (k, 10) points on a and b, normal and gap where the pair comes to contact


def new_pairs(world: World, a: np.ndarray, b: np.ndarray, start: float) -> Pairs:
    """Pairs (k,) without a past, to be swept from `start` [s] on."""
    k = len(a)
    size = np.minimum(world.size[a], world.size[b])
    least = world.least_impact_margin(a, b)
    return Pairs(
        a=a,
        b=b,
        time=np.full(k, np.inf),
        start=np.full(k, start),
        impact_margin=least.copy(),
        least_impact_margin=least,
        contact_margin=world.contact_margin * size,
        tolerance=world.accuracy.tolerance * size,
        tries=np.zeros(k, np.int64),
        since=np.full(k, -np.inf),
        repeats=np.zeros(k, np.int64),
        witness=np.zeros((k, 10)),
    )


@jit
def sweep_pair_again(pairs, p, time, dynamic, inside):
    """Let pair p be swept from `time` on, unless it is given up or the sub-stepped solver looks after it; dynamic, inside (n,) bool."""
    a, b = pairs.a[p], pairs.b[p]
    swept = (dynamic[a] and not inside[a]) or (dynamic[b] and not inside[b])
    pairs.time[p] = np.inf
    pairs.start[p] = time if swept and pairs.repeats[p] <= MAX_REPEATS else np.nan


@jit_making_arrays
def live_contacts(pairs, place, gap, time):
    """Which contacts (m,) are at the gap at which contact is declared; of a pair that just came to it at least its nearest.

    place (m,): their pairs, pair after pair; gap (m,) m.
    """
    live = np.empty(place.shape[0], np.bool_)
    first = 0
    while first < place.shape[0]:
        p, last, nearest = place[first], first, np.inf
        while last < place.shape[0] and place[last] == p:
            nearest = min(nearest, gap[last])
            last += 1
        zone = pairs.impact_margin[p] * (1.0 + NEAR) + 2.0 * pairs.tolerance[p]
        if pairs.time[p] <= time:
            zone = max(zone, nearest * (1.0 + NEAR))
        for c in range(first, last):
            live[c] = gap[c] <= zone + ROUND_OFF * pairs.contact_margin[p]
        first = last
    return live


@jit_making_arrays
def renew_pairs(trajectory, body, span, reach, bodies, pairs, boxes, fresh):
    """Let the pairs of a body that took a new trajectory be swept again, and look whom it may reach within `span`, (from, until) [s].

    reach: radius of the body about its centre, and margin, m. bodies: which are movable, dynamic, and inside sub-stepped islands, each
    (n,) bool. boxes: their lows and highs, both (n, 3) m; the body's row is made anew.
    Writes the bodies whose boxes overlap its own and that it has no pair with into fresh (n,), in ascending order; returns their number.
    """
    time, end = span
    radius, margin = reach
    movable, dynamic, inside = bodies
    box_min, box_max = boxes
    path_box(trajectory, body, time, end, radius, box_min, box_max)
    for k in range(3):
        box_min[body, k] -= margin
        box_max[body, k] += margin
    known = np.zeros(movable.shape[0], np.bool_)
    known[body] = True
    for p in range(pairs.a.shape[0]):
        a, b = pairs.a[p], pairs.b[p]
        if a != body and b != body:
            continue
        known[a] = known[b] = True
        sweep_pair_again(pairs, p, time, dynamic, inside)
        pairs.impact_margin[p] = pairs.least_impact_margin[p]
        pairs.tries[p] = 0
    reached = overlapping_with(body, box_min, box_max, movable, fresh)
    count = 0
    for k in range(reached):
        if not known[fresh[k]]:
            fresh[count] = fresh[k]
            count += 1
    return count
