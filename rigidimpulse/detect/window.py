"""The pairs of one step: which bodies may meet in it, at which gap a contact is declared, and when each pair comes to it.

Boxes enclose each body's bounding sphere along its path to the end of the step. When a body changes course its box is
made anew and pairs that it may now reach are added; pairs of which a body changed course are swept again, all others
keep their time.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.detect.broadphase import overlapping_pairs, overlapping_with
from rigidimpulse.detect.groups import MARGIN, Group, touching_groups
from rigidimpulse.integrate.course import FIXED, FREE, JERK, pose_at, rate_of, row_at, turning_points

NEAR = 1e-6
"""Contacts that much farther away than the declared gap, relative to it, are in contact too."""
ROUND_OFF = 1e-6
"""The same, relative to delta."""
STUCK_STEP = 1e-3
"""Part of delta by which the gap of contact is lowered after a contact without consequence."""
MAX_TRIES = 30
INSTANT = 1e-6
"""Part of a step within which a pair that comes to contact again does so at the same instant."""
MAX_REPEATS = 100
"""Contacts of a pair at one instant after which there is no motion that its neighbours allow: bodies are squeezed."""


@jit
def path_box(course, i, begin, end, radius, box_min, box_max):
    """Box of the sphere of `radius` about the centre of body i along its parabola or cubic from begin to end."""
    x, q = np.empty(3), np.empty(4)
    pose_at(course, i, begin, x, q)
    h = end - begin
    s = begin - course.start[i]
    mode = course.mode[i]
    growth = rate_of(course, i, JERK)
    pull = row_at(course.acceleration, i, growth, s)
    for k in range(3):
        a, jerk = pull[k] if mode >= FREE else 0.0, 0.0 if mode == FIXED else growth[k]
        v = 0.0 if mode == FIXED else course.velocity[i, k] + (a - 0.5 * jerk * s) * s
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
def path_boxes(course, members, begin, end, radius, box_min, box_max):
    for i in members:
        path_box(course, i, begin, end, radius[i], box_min, box_max)


class Window:
    """Pairs (a < b) of the step [begin, end], growing as bodies change course.

    Attributes, one entry a pair:
        a, b: body indices.
        time: s, when the pair reaches `touch`; inf if it does not before `end`.
        start: s, from when the pair must be swept again; nan if its time stands.
        touch: m, gap at which contact is declared now.
        delta: m, gap at which lasting contacts are held.
        tolerance: m, gap error of an impact.
        since, repeats: s, instant of contact, and how often the pair came to contact at it.
        wake: (n,) s, when bodies must be looked at again though nothing meets them.
        inside: (n,) bool, members of heaps: their pairs with each other and with immovable bodies are not swept.
        heaps_begun: whether the heaps of the step have been stepped from its start.
        witness: (10,) points on a and b, normal and gap where the pair comes to contact.
        tries: how often the pair came to contact at one instant without an impulse.
    """

    def __init__(self, context, end: float) -> None:
        self.context = context
        self.begin, self.end = context.state.time, end
        self.a = np.zeros(0, np.int64)
        self.b = np.zeros(0, np.int64)
        self.time = np.zeros(0)
        self.start = np.zeros(0)
        self.touch = np.zeros(0)
        self.delta = np.zeros(0)
        self.tolerance = np.zeros(0)
        self.tries = np.zeros(0, np.int64)
        self.witness = np.zeros((0, 10))
        self.since = np.zeros(0)
        self.repeats = np.zeros(0, np.int64)
        self.wake = np.full(context.world.num_bodies, np.inf)
        self.inside = np.zeros(context.world.num_bodies, bool)
        self.heaps_begun = False
        self._moves = (context.state.course.mode != FIXED) | context.world.dynamic

    def find_pairs(self) -> None:
        """Broad phase: the pairs whose boxes overlap in the step."""
        context = self.context
        world, course = context.world, context.state.course
        box_min, box_max = context.box_min, context.box_max
        box_min[:], box_max[:] = world.static_min, world.static_max
        members = np.flatnonzero(self._moves)
        path_boxes(course, members, self.begin, self.end, world.bound_radius, box_min, box_max)
        box_min[members] -= MARGIN * world.largest_delta
        box_max[members] += MARGIN * world.largest_delta
        pairs = np.empty((max(64, 8 * world.num_bodies), 2), np.int64)
        count = overlapping_pairs(box_min, box_max, self._moves, pairs)
        if count < 0:
            pairs = np.empty((-count, 2), np.int64)
            count = overlapping_pairs(box_min, box_max, self._moves, pairs)
        self._append(pairs[:count, 0], pairs[:count, 1], self.begin)

    def touching(self, time: float, bodies: np.ndarray) -> list[Group]:
        """Groups of touching bodies that the given ones belong to at `time`."""
        groups = touching_groups(self.context, self, time, bodies)
        return groups if self.context.heaps is None else self.context.heaps.join(self.context, self, time, groups)

    def _is_shut(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Which pairs are not swept, since a heap's solver looks after them."""
        free = self.context.world.dynamic & ~self.inside
        return ~(free[a] | free[b])

    def _append(self, a: np.ndarray, b: np.ndarray, start: float) -> np.ndarray:
        """Add pairs whose bodies may meet and that are not there yet; returns their places."""
        world = self.context.world
        keep = world.may_collide(a, b) & ~self._is_shut(a, b)
        a, b = a[keep], b[keep]
        first = len(self.a)
        size = np.minimum(world.size[a], world.size[b])
        self.a = np.concatenate([self.a, a])
        self.b = np.concatenate([self.b, b])
        self.time = np.concatenate([self.time, np.full(len(a), np.inf)])
        self.start = np.concatenate([self.start, np.full(len(a), start)])
        self.touch = np.concatenate([self.touch, world.least_touch(a, b)])
        self.delta = np.concatenate([self.delta, world.contact_gap * size])
        self.tolerance = np.concatenate([self.tolerance, world.accuracy.tolerance * size])
        self.tries = np.concatenate([self.tries, np.zeros(len(a), np.int64)])
        self.since = np.concatenate([self.since, np.full(len(a), -np.inf)])
        self.repeats = np.concatenate([self.repeats, np.zeros(len(a), np.int64)])
        self.witness = np.concatenate([self.witness, np.zeros((len(a), 10))])
        return np.arange(first, len(self.a))

    def pairs_of(self, body: int) -> np.ndarray:
        """Places of the pairs of a body."""
        return np.flatnonzero((self.a == body) | (self.b == body))

    def change_course(self, body: int, time: float) -> None:
        """The body took a new course at `time`: sweep its pairs again, and add those it may now reach."""
        context = self.context
        path_box(
            context.state.course, body, time, self.end, context.world.bound_radius[body], context.box_min, context.box_max
        )
        context.box_min[body] -= MARGIN * context.world.largest_delta
        context.box_max[body] += MARGIN * context.world.largest_delta
        known = self.pairs_of(body)
        self.sweep_again(known, time)
        self.touch[known] = context.world.least_touch(self.a[known], self.b[known])
        self.tries[known] = 0
        partners = np.empty(context.world.num_bodies, np.int64)
        count = overlapping_with(body, context.box_min, context.box_max, self._moves, partners)
        other = np.where(self.a[known] == body, self.b[known], self.a[known])
        fresh = np.setdiff1d(partners[:count], other)
        if len(fresh):
            self._append(np.minimum(fresh, body), np.maximum(fresh, body), time)

    def change_courses(self, bodies: np.ndarray, time: float) -> None:
        """The same for the members of heaps, all at once."""
        context = self.context
        free = context.world.dynamic & ~self.inside
        moved = np.zeros(context.world.num_bodies, bool)
        moved[bodies] = True
        known = np.flatnonzero(moved[self.a] | moved[self.b])
        self.sweep_again(known, time)
        if not free.any():
            return
        self.touch[known] = context.world.least_touch(self.a[known], self.b[known])
        self.tries[known] = 0
        path_boxes(
            context.state.course, bodies, time, self.end, context.world.bound_radius, context.box_min, context.box_max
        )
        context.box_min[bodies] -= MARGIN * context.world.largest_delta
        context.box_max[bodies] += MARGIN * context.world.largest_delta
        pairs = np.empty((len(bodies) + 64, 2), np.int64)
        low, high = context.box_min.copy(), context.box_max.copy()
        low[~(moved | free)], high[~(moved | free)] = np.inf, -np.inf
        count = overlapping_pairs(low, high, free, pairs)
        if count < 0:
            pairs = np.empty((-count, 2), np.int64)
            count = overlapping_pairs(low, high, free, pairs)
        n = context.world.num_bodies
        fresh = ~np.isin(pairs[:count, 0] * n + pairs[:count, 1], self.a * n + self.b)
        self._append(pairs[:count, 0][fresh], pairs[:count, 1][fresh], time)

    def active_bodies(self) -> np.ndarray:
        """Bodies that move, but for those in heaps."""
        return np.flatnonzero((self.context.state.course.mode != FIXED) & ~self.inside)

    def bodies_at(self, time: float) -> np.ndarray:
        """Bodies that come to contact or are called at `time`."""
        hit = self.time <= time
        return np.unique(np.concatenate([self.a[hit], self.b[hit], np.flatnonzero(self.wake <= time)]))

    def find(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Places of the pairs (a, b)."""
        n = self.context.world.num_bodies
        key = self.a * n + self.b
        order = np.argsort(key, kind="stable")
        return order[np.searchsorted(key[order], a * n + b)]

    def is_live(self, time: float, place: np.ndarray, gap: np.ndarray) -> np.ndarray:
        """Which contacts are at the gap at which contact is declared; of a pair that just came to it at least its nearest."""
        zone = self.touch[place] * (1.0 + NEAR) + 2.0 * self.tolerance[place]
        least = np.full(len(self.a), np.inf)
        np.minimum.at(least, place, gap)
        zone = np.where(self.time[place] <= time, np.maximum(zone, least[place] * (1.0 + NEAR)), zone)
        return gap <= zone + ROUND_OFF * self.delta[place]

    def sweep_again(self, places: np.ndarray, time: float) -> None:
        """Let pairs be swept from `time` on, but for those that are given up."""
        self.time[places] = np.inf
        again = (self.repeats[places] <= MAX_REPEATS) & ~self._is_shut(self.a[places], self.b[places])
        self.start[places[again]] = time
        self.start[places[~again]] = np.nan

    def count_contacts(self, time: float) -> None:
        """Count contacts at one instant; a pair with too many is left alone until the end of the step, and reported."""
        hit = np.flatnonzero(self.time <= time)
        again = time - self.since[hit] <= INSTANT * self.context.world.accuracy.step
        self.repeats[hit] = np.where(again, self.repeats[hit] + 1, 0)
        self.since[hit[~again]] = time
        names = self.context.world.names
        for p in hit[self.repeats[hit] > MAX_REPEATS]:
            self.start[p], self.time[p] = np.nan, np.inf
            self.context.log.report(
                time, "squeezed", (names[self.a[p]], names[self.b[p]]),
                "no motion keeps the body apart from all that presses on it; make room, or let the pressing bodies move freely",
            )

    def settle(self, time: float) -> None:
        """Pairs that came to contact without consequence are swept again from here with a smaller gap."""
        stuck = np.flatnonzero(self.time <= time)
        if not len(stuck):
            return
        self.tries[stuck] += 1
        step = self.tries[stuck] * STUCK_STEP * self.delta[stuck]
        least = self.context.world.least_touch(self.a[stuck], self.b[stuck])
        self.touch[stuck] = np.where(least > 0.0, 0.5 * self.touch[stuck], -step)
        self.sweep_again(stuck, time)
        for p in stuck[self.tries[stuck] > MAX_TRIES]:
            self.start[p] = np.nan
            names = self.context.world.names
            self.context.log.report(
                time, "contact not resolved", (names[self.a[p]], names[self.b[p]]),
                "the pair is left alone until the end of the step; use a smaller step",
            )

    def next_time(self) -> float:
        """Time of the earliest contact or call, inf if there is none."""
        return float(min(self.time.min(initial=np.inf), self.wake.min()))
