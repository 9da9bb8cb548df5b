"""The pairs of one step: which bodies may meet in it, at which gap a contact is declared, and when each pair comes to it.

Boxes enclose each body's bounding sphere along its path to the end of the step. When a body gets a new trajectory its box is
renewed and pairs that it may now reach are added. Pairs of which a body has a new trajectory are swept again; all others keep their time.
The table and its kernels are in `pair_table`.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.broad_phase import find_overlapping
from rigidimpulse.collision.time_of_impact.spheres import is_closed_form
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.union_find import roots
from rigidimpulse.engine.pair_table import (
    FIRST_ROWS,
    MARGIN,
    SHORT,
    USED,
    PairTable,
    add_missing,
    append_pairs,
    count_contacts,
    look_around,
    make_pairs,
    mark_met,
    next_time,
    pair_bodies,
    path_boxes,
    renew_pairs,
    settle_pairs,
    sweep_pairs_again,
)
from rigidimpulse.engine.run import Run
from rigidimpulse.model.contact_memory import place_of
from rigidimpulse.model.island import Island
from rigidimpulse.motion.trajectory import FIXED, PRESCRIBED

INSTANT = TOLERANCES.events.instant
SQUEEZED = "squeezed"
SQUEEZED_REMEDY = "no motion keeps the body apart from all that presses on it; give it space, or let the pressing bodies move freely"
NOT_RESOLVED_REMEDY = "the pair is left alone until the end of the step; use a smaller step"


def most_pairs(number: int) -> int:
    """How many pairs of a number of bodies are expected to have boxes that overlap."""
    return max(64, 8 * number)


class PairEvents:
    """Pairs of the step [begin, end], growing as bodies get new trajectories.

    Attributes:
        table: of pairs, with free rows at its end; `pairs` are the rows in use.
        wake: (n,) s, when bodies must be looked at again though nothing meets them.
        inside: (n,) bool, members of sub-stepped islands: their pairs with each other and with immovable bodies are not swept.
        asleep: (n,) bool, sleeping members of such islands, and bodies that never move: nor are their pairs with each other.
        substepped_begun: whether the sub-stepped islands have been stepped from the start of the step.
    """

    def __init__(self, run: Run, end: float) -> None:
        """No pairs yet, of the step from the time of the run to `end` [s]."""
        world, n = run.world, run.world.num_bodies
        self.run = run
        self.begin, self.end = run.state.time, end
        self.substepped_begun = False
        self._bodies, self._dynamic = pair_bodies(world), world.dynamic
        movable = (run.state.trajectory.mode != FIXED) | world.dynamic
        self.table = PairTable(
            make_pairs(FIRST_ROWS), np.zeros(2, np.int64), run.box_min, run.box_max, movable, np.full(n, np.inf), np.zeros(n, bool),
            ~(world.dynamic | world.moving), np.zeros(n, bool), np.full(n, -np.inf),
        )  # fmt: skip
        self.wake, self.inside, self.asleep = self.table.wake, self.table.inside, self.table.asleep

    @property
    def pairs(self) -> np.ndarray:
        """The pairs (k,) `PAIR`, a view."""
        return self.table.pairs[: self.table.number[USED]]

    def follow(self, begin: float, end: float) -> None:
        """Be those of the step [begin, end], which the compiled order of events took, and whose pairs are in the table."""
        self.run.state.time = self.begin = begin
        self.end = end

    def find_pairs(self) -> None:
        """Broad phase: the pairs whose boxes overlap in the step."""
        run, movable = self.run, self.table.movable
        world, trajectory = run.world, run.state.trajectory
        if self.inside.any() and not np.any(world.dynamic & ~self.inside):
            return
        box_min, box_max = run.box_min, run.box_max
        box_min[:], box_max[:] = world.static_min, world.static_max
        members = np.flatnonzero(movable)
        path_boxes(trajectory, members, self.begin, self.end, world.bound_radius, box_min, box_max)
        box_min[members] -= MARGIN * world.largest_contact_margin
        box_max[members] += MARGIN * world.largest_contact_margin
        first, second = find_overlapping(box_min, box_max, movable, most_pairs(world.num_bodies)).T.astype(np.int64)
        self._append(first, second, self.begin)

    def recall(self, begin: float) -> None:
        """Let pairs be as if the step had begun at `begin`, where the step did [s], all bodies having flown freely since.

        A pair is swept from the last change of trajectory of its bodies; when it was last in contact is known from its rebound.
        """
        start, memory, pairs = self.run.state.trajectory.start, self.run.state.memory, self.pairs
        a, b = pairs["a"], pairs["b"]
        pairs["start"] = np.maximum(np.maximum(start[a], start[b]), begin)
        for p, key in enumerate((a * self.run.world.num_bodies + b).tolist()):
            at = place_of(memory, key)
            if memory.key[at] == key and memory.time[at] >= begin:
                pairs["since"][p] = memory.time[at]

    def is_plain(self, time: float) -> bool:
        """Whether nothing in the step asks to be remembered: no body held or called, no pair met more than once or without an impulse."""
        state, pairs = self.run.state, self.pairs
        lowered = np.flatnonzero(pairs["impact_margin"] != pairs["least_impact_margin"])
        if len(lowered) and not self._is_closed_form(lowered):
            return False
        return not (
            state.under_contact.any()
            or self.wake.min() < np.inf
            or self.inside.any()
            or pairs["tries"].any()
            or pairs["repeats"].any()
            or (pairs["time"] <= time).any()
        )

    def _is_closed_form(self, places: np.ndarray) -> bool:
        """Whether pairs are balls, or balls and planes that stand, that were in contact at gap 0: that leaves no trace in their times."""
        scratch, shape, pairs = self.run.detector.sweep_scratch, self.run.detector.shape_of_body, self.pairs
        return all(
            is_closed_form(self.run.state.trajectory, scratch, a, b, shape[a], shape[b], margin)
            for a, b, margin in zip(pairs["a"][places], pairs["b"][places], pairs["impact_margin"][places], strict=True)
        )

    def _append(self, first: np.ndarray, second: np.ndarray, start: float) -> None:
        """Add pairs whose bodies may meet and that are not there yet."""
        self._grow(len(first))
        # Rows of a transposed array are another type to kernels.
        first, second = np.ascontiguousarray(first), np.ascontiguousarray(second)
        append_pairs(self._bodies, self.run.world.margins, self.table, first, second, start)

    def _grow(self, needed: int) -> None:
        """Make space for `needed` more pairs."""
        used, capacity = int(self.table.number[USED]), len(self.table.pairs)
        if used + needed > capacity:
            larger = make_pairs(max(used + needed, 2 * capacity))
            larger[:used] = self.table.pairs[:used]
            self.table = self.table._replace(pairs=larger)

    def add_missing_pairs(self, time: float) -> None:
        """Make the table larger if a body has found no space for a pair since `time`, and add those pairs."""
        table = self.table
        while table.number[SHORT]:
            bodies = np.flatnonzero(table.without_space)
            table.number[SHORT], table.without_space[:] = 0, False
            self._grow(len(table.pairs))
            table = self.table
            for body in bodies.tolist():
                add_missing(self._bodies, self.run.world.margins, table, body, time)

    def trajectory_changed(self, body: int, time: float) -> None:
        """The body has a new trajectory from `time` on: sweep its pairs again, and add those it may now reach."""
        renew_pairs(self._bodies, self.run.world.margins, self.table, self.run.state.trajectory, body, (time, self.end))
        self.add_missing_pairs(time)

    def trajectories_changed(self, bodies: np.ndarray, time: float) -> None:
        """The same for the members of sub-stepped islands, all at once."""
        run, pairs = self.run, self.pairs
        free = run.world.dynamic & ~self.inside
        if not (len(pairs) or free.any()):
            return
        moved = np.zeros(run.world.num_bodies, bool)
        moved[bodies] = True
        known = np.flatnonzero(moved[pairs["a"]] | moved[pairs["b"]])
        sweep_pairs_again(self.table, known, time, self._dynamic)
        if not free.any():
            return
        pairs["impact_margin"][known] = pairs["least_impact_margin"][known]
        pairs["tries"][known] = 0
        path_boxes(
            run.state.trajectory, bodies, time, self.end, run.world.bound_radius, run.box_min, run.box_max
        )
        run.box_min[bodies] -= MARGIN * run.world.largest_contact_margin
        run.box_max[bodies] += MARGIN * run.world.largest_contact_margin
        low, high = run.box_min.copy(), run.box_max.copy()
        low[~(moved | free)], high[~(moved | free)] = np.inf, -np.inf
        n = run.world.num_bodies
        first, second = find_overlapping(low, high, free, len(bodies) + 64).T.astype(np.int64)
        fresh = ~np.isin(first * n + second, pairs["a"] * n + pairs["b"])
        self._append(first[fresh], second[fresh], time)

    def active_bodies(self) -> np.ndarray:
        """Bodies that move or that a soft body presses, without those of sub-stepped islands."""
        moves = (self.run.state.trajectory.mode != FIXED) | self.run.soft_bodies.pressed
        return np.flatnonzero(moves & ~self.inside)

    def may_meet(self) -> np.ndarray:
        """Bodies (n,) bool of pairs that are swept."""
        mark, pairs = np.zeros(len(self.wake), bool), self.pairs
        mark[pairs["a"]] = mark[pairs["b"]] = True
        return mark

    def bodies_at(self, time: float) -> np.ndarray:
        """Movable bodies that come to contact, and bodies that are called, at `time`."""
        mark = np.empty(len(self.wake), bool)
        mark_met(self.table, self._dynamic, time, mark)
        return mark.nonzero()[0]

    def look_around(self, bodies: np.ndarray, time: float, shift: float) -> None:
        """Call bodies that a position correction moved by `shift` [m] once more: others may be near now."""
        look_around(self.table, bodies, time, shift)

    def count_contacts(self, time: float) -> None:
        """Count contacts at one instant; a pair with too many is handed to sub-steps, or left alone until the step ends, and reported."""
        if not len(self.pairs):
            return
        given_up = np.empty(len(self.pairs), np.int64)
        count = count_contacts(self.table, time, INSTANT * self.run.world.accuracy.step, given_up)
        for place in self._left_alone(given_up[:count], time).tolist():
            kind, remedy = self.why_again(int(self.pairs[place]["a"]), int(self.pairs[place]["b"]))
            self.report(time, kind, np.array([place]), remedy)

    def _left_alone(self, given_up: np.ndarray, time: float) -> np.ndarray:
        """Those of the pairs given up at `time` that the sub-stepped regime does not take; bodies of the others are looked at again."""
        stays = []
        for place in given_up.tolist():
            bodies = np.array([self.pairs[place]["a"], self.pairs[place]["b"]], np.int64)
            if self.run.substepped.may_take(bodies):
                mine = bodies[self._dynamic[bodies]]
                self.wake[mine] = np.minimum(self.wake[mine], time)
            else:
                stays.append(place)
        return np.array(stays, np.int64)

    def why_again(self, a: int, b: int) -> tuple[str, str]:
        """Kind of problem, and remedy, of two bodies that come to contact again and again at one instant.

        They are squeezed only if a body with a path of its own presses on one of them.
        """
        return (SQUEEZED, SQUEEZED_REMEDY) if np.any(self.pressed()[[a, b]]) else ("contact not resolved", NOT_RESOLVED_REMEDY)

    def pressed(self) -> np.ndarray:
        """Bodies (n,) bool that bodies with paths of their own press on, themselves or through others that may touch in the step."""
        pairs, prescribed = self.pairs, self.run.state.trajectory.mode == PRESCRIBED
        free, first, second = self._dynamic & ~prescribed, pairs["a"], pairs["b"]
        joins, presses = free[first] & free[second], prescribed[first] | prescribed[second]
        root = roots(len(free), first[joins], second[joins])
        return free & np.isin(root, root[np.concatenate([first[presses], second[presses]])])

    def report_squeezed(self, island: Island) -> None:
        """Report the pairs of an island that no motion keeps apart, since bodies with paths of their own press on it."""
        self.report(island.time, SQUEEZED, np.unique(island.place), SQUEEZED_REMEDY)

    def settle(self, time: float) -> None:
        """Pairs that came to contact without consequence are swept again from here with a smaller gap."""
        if not len(self.pairs):
            return
        given_up = np.empty(len(self.pairs), np.int64)
        count = settle_pairs(self.table, time, self._dynamic, given_up)
        self.report(time, "contact not resolved", self._left_alone(given_up[:count], time), NOT_RESOLVED_REMEDY)

    def report(self, time: float, kind: str, places: np.ndarray, remedy: str) -> None:
        """Report a problem of the pairs at these places."""
        names = self.run.world.names
        for pair in self.pairs[places]:
            self.run.log.report(time, kind, (names[pair["a"]], names[pair["b"]]), remedy)

    def next_time(self) -> float:
        """Time of the earliest contact or call, inf if there is none."""
        return float(next_time(self.table) if len(self.pairs) else self.wake.min(initial=np.inf))
