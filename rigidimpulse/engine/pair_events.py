"""The pairs of one step: which bodies may meet in it, at which gap a contact is declared, and when each pair comes to it.

Boxes enclose each body's bounding sphere along its path to the end of the step. When a body gets a new trajectory its box is
renewed and pairs that it may now reach are added. Pairs of which a body has a new trajectory are swept again; all others keep their time.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.broad_phase import find_overlapping
from rigidimpulse.collision.time_of_impact.spheres import is_closed_form
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.engine.pair_table import MARGIN, MAX_REPEATS, Pairs, new_pairs, path_boxes, renew_pairs
from rigidimpulse.engine.run import Run
from rigidimpulse.motion.trajectory import FIXED

STUCK_STEP = TOLERANCES.events.stuck_step
MAX_TRIES = 30
INSTANT = TOLERANCES.events.instant


class PairEvents:
    """Pairs of the step [begin, end], growing as bodies get new trajectories.

    Attributes:
        pairs: the table; its columns are attributes of their own, too.
        wake: (n,) s, when bodies must be looked at again though nothing meets them.
        inside: (n,) bool, members of sub-stepped islands: their pairs with each other and with immovable bodies are not swept.
        asleep: (n,) bool, sleeping members of such islands, and bodies that never move: nor are their pairs with each other.
        substepped_begun: whether the sub-stepped islands have been stepped from the start of the step.
    """

    def __init__(self, run: Run, end: float) -> None:
        """No pairs yet, of the step from the time of the run to `end` [s]."""
        self.run = run
        self.begin, self.end = run.state.time, end
        self._take(new_pairs(run.world, np.zeros(0, np.int64), np.zeros(0, np.int64), self.begin))
        self.wake = np.full(run.world.num_bodies, np.inf)
        self.inside = np.zeros(run.world.num_bodies, bool)
        self.asleep = ~(run.world.dynamic | run.world.moving)
        self._looked_around = np.full(run.world.num_bodies, -np.inf)
        self.substepped_begun = False
        self._moves = (run.state.trajectory.mode != FIXED) | run.world.dynamic

    def _take(self, pairs: Pairs) -> None:
        """Let `pairs` be the table."""
        self.pairs = pairs
        (
            self.a, self.b, self.time, self.start, self.impact_margin, self.least_impact_margin, self.contact_margin, self.tolerance,
            self.tries, self.since,
            self.repeats, self.witness,
        ) = pairs  # fmt: skip
        key = self.a * self.run.world.num_bodies + self.b
        self._order = np.argsort(key, kind="stable")
        self._sorted_key = key[self._order]

    def find_pairs(self) -> None:
        """Broad phase: the pairs whose boxes overlap in the step."""
        run = self.run
        world, trajectory = run.world, run.state.trajectory
        if self.inside.any() and not np.any(world.dynamic & ~self.inside):
            return
        box_min, box_max = run.box_min, run.box_max
        box_min[:], box_max[:] = world.static_min, world.static_max
        members = np.flatnonzero(self._moves)
        path_boxes(trajectory, members, self.begin, self.end, world.bound_radius, box_min, box_max)
        box_min[members] -= MARGIN * world.largest_contact_margin
        box_max[members] += MARGIN * world.largest_contact_margin
        first, second = find_overlapping(box_min, box_max, self._moves, max(64, 8 * world.num_bodies)).T.astype(np.int64)
        self._append(first, second, self.begin)

    def recall(self, begin: float) -> None:
        """Let pairs be as if the step had begun at `begin`, where the step did [s], all bodies having flown freely since.

        A pair is swept from the last change of trajectory of its bodies; when it was last in contact is known from its rebound.
        """
        trajectory = self.run.state.trajectory
        self.start[:] = np.maximum(np.maximum(trajectory.start[self.a], trajectory.start[self.b]), begin)
        for p, pair in enumerate(zip(self.a.tolist(), self.b.tolist(), strict=True)):
            last = self.run.state.rebounds.get(pair)
            if last is not None and last[0] >= begin:
                self.since[p] = last[0]

    def is_plain(self, time: float) -> bool:
        """Whether nothing in the step asks to be remembered: no body held or called, no pair met more than once or without an impulse."""
        state = self.run.state
        lowered = np.flatnonzero(self.impact_margin != self.least_impact_margin)
        if len(lowered) and not self._is_closed_form(lowered):
            return False
        return not (
            state.under_contact.any()
            or self.wake.min() < np.inf
            or self.inside.any()
            or self.tries.any()
            or self.repeats.any()
            or (self.time <= time).any()
        )

    def _is_closed_form(self, places: np.ndarray) -> bool:
        """Whether pairs are balls, or balls and planes that stand, that were in contact at gap 0: that leaves no trace in their times."""
        detector, trajectory = self.run.detector, self.run.state.trajectory
        return all(
            is_closed_form(
                trajectory, detector.sweep_scratch, a, b, detector.shape_of_body[a], detector.shape_of_body[b], self.impact_margin[p]
            )
            for p, a, b in zip(places, self.a[places], self.b[places], strict=True)
        )

    def _is_shut(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Which pairs are not swept, since the sub-stepped solver looks after them."""
        free = self.run.world.dynamic & ~self.inside
        return ~(free[a] | free[b]) | (self.asleep[a] & self.asleep[b])

    def _append(self, a: np.ndarray, b: np.ndarray, start: float) -> None:
        """Add pairs whose bodies may meet and that are not there yet."""
        world = self.run.world
        keep = world.may_collide(a, b) & ~self._is_shut(a, b)
        if keep.any():
            fresh = new_pairs(world, a[keep], b[keep], start)
            both = zip(self.pairs, fresh, strict=True)
            self._take(Pairs(*map(np.concatenate, both)) if len(self.a) else fresh)

    def trajectory_changed(self, body: int, time: float) -> None:
        """The body has a new trajectory from `time` on: sweep its pairs again, and add those it may now reach."""
        run, world = self.run, self.run.world
        partners = np.empty(world.num_bodies, np.int64)
        reach = (world.bound_radius[body], MARGIN * world.largest_contact_margin)
        bodies = (self._moves, world.dynamic, self.inside)
        boxes = (run.box_min, run.box_max)
        count = renew_pairs(run.state.trajectory, body, (time, self.end), reach, bodies, self.pairs, boxes, partners)
        if count:
            fresh = partners[:count]
            self._append(np.minimum(fresh, body), np.maximum(fresh, body), time)

    def trajectories_changed(self, bodies: np.ndarray, time: float) -> None:
        """The same for the members of sub-stepped islands, all at once."""
        run = self.run
        free = run.world.dynamic & ~self.inside
        moved = np.zeros(run.world.num_bodies, bool)
        moved[bodies] = True
        known = np.flatnonzero(moved[self.a] | moved[self.b])
        self.sweep_again(known, time)
        if not free.any():
            return
        self.impact_margin[known] = self.least_impact_margin[known]
        self.tries[known] = 0
        path_boxes(
            run.state.trajectory, bodies, time, self.end, run.world.bound_radius, run.box_min, run.box_max
        )
        run.box_min[bodies] -= MARGIN * run.world.largest_contact_margin
        run.box_max[bodies] += MARGIN * run.world.largest_contact_margin
        low, high = run.box_min.copy(), run.box_max.copy()
        low[~(moved | free)], high[~(moved | free)] = np.inf, -np.inf
        n = run.world.num_bodies
        first, second = find_overlapping(low, high, free, len(bodies) + 64).T.astype(np.int64)
        fresh = ~np.isin(first * n + second, self.a * n + self.b)
        self._append(first[fresh], second[fresh], time)

    def active_bodies(self) -> np.ndarray:
        """Bodies that move or that a soft body presses, without those of sub-stepped islands."""
        moves = (self.run.state.trajectory.mode != FIXED) | self.run.soft_bodies.pressed
        return np.flatnonzero(moves & ~self.inside)

    def bodies_at(self, time: float) -> np.ndarray:
        """Movable bodies that come to contact, and bodies that are called, at `time`.

        Not what they come to contact with, if it does not move: whoever else touches a floor has nothing to do with them.
        """
        hit = self.time <= time
        mark = np.zeros(len(self.wake), bool)
        mark[self.a[hit]] = mark[self.b[hit]] = True
        mark &= self.run.world.dynamic
        mark |= self.wake <= time
        return mark.nonzero()[0]

    def look_around(self, bodies: np.ndarray, time: float, shift: float) -> None:
        """Call bodies that a position correction moved by `shift` [m] once more: others may be near now."""
        fresh = bodies[self._looked_around[bodies] < time]
        mark = np.zeros(len(self.wake), bool)
        mark[fresh] = True
        if shift > self.contact_margin[mark[self.a] | mark[self.b]].min(initial=np.inf):
            self._looked_around[fresh] = self.wake[fresh] = time

    def find(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Places of the pairs (a, b)."""
        return self._order[self._sorted_key.searchsorted(a * self.run.world.num_bodies + b)]

    def sweep_again(self, places: np.ndarray, time: float) -> None:
        """Let pairs be swept from `time` on, but for those that are given up."""
        self.time[places] = np.inf
        again = (self.repeats[places] <= MAX_REPEATS) & ~self._is_shut(self.a[places], self.b[places])
        self.start[places[again]] = time
        self.start[places[~again]] = np.nan

    def count_contacts(self, time: float) -> None:
        """Count contacts at one instant; a pair with too many is left alone until the end of the step, and reported."""
        hit = (self.time <= time).nonzero()[0]
        again = time - self.since[hit] <= INSTANT * self.run.world.accuracy.step
        self.repeats[hit] = np.where(again, self.repeats[hit] + 1, 0)
        self.since[hit[~again]] = time
        names = self.run.world.names
        for p in hit[self.repeats[hit] > MAX_REPEATS]:
            self.start[p], self.time[p] = np.nan, np.inf
            self.run.log.report(
                time, "squeezed", (names[self.a[p]], names[self.b[p]]),
                "no motion keeps the body apart from all that presses on it; make room, or let the pressing bodies move freely",
            )

    def settle(self, time: float) -> None:
        """Pairs that came to contact without consequence are swept again from here with a smaller gap."""
        stuck = (self.time <= time).nonzero()[0]
        if not len(stuck):
            return
        self.tries[stuck] += 1
        step = self.tries[stuck] * STUCK_STEP * self.contact_margin[stuck]
        self.impact_margin[stuck] = np.where(self.least_impact_margin[stuck] > 0.0, 0.5 * self.impact_margin[stuck], -step)
        self.sweep_again(stuck, time)
        for p in stuck[self.tries[stuck] > MAX_TRIES]:
            self.start[p] = np.nan
            names = self.run.world.names
            self.run.log.report(
                time, "contact not resolved", (names[self.a[p]], names[self.b[p]]),
                "the pair is left alone until the end of the step; use a smaller step",
            )

    def next_time(self) -> float:
        """Time of the earliest contact or call, inf if there is none."""
        return float(min(self.time.min(initial=np.inf), self.wake.min()))
