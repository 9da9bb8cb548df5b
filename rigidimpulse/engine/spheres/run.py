"""The event kernel in a run: its tables, and the results that it hands to the loop in Python."""

from __future__ import annotations

import numpy as np

from rigidimpulse.dynamics.impact.restitution import LAWS
from rigidimpulse.engine.pair_table import NEAR, ROUND_OFF
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.spheres.effect import FULL, STEP, kinds
from rigidimpulse.engine.spheres.flight import fly
from rigidimpulse.engine.spheres.layout import PLANE, Fixed, Motion, SphereRecord, Table
from rigidimpulse.engine.spheres.paths import BODY, DYNAMIC, GAP, KIND, LEVEL, PATH_SIZE, PLANE_SIZE, RADIUS
from rigidimpulse.engine.spheres.queue import make_queue
from rigidimpulse.engine.spheres.tree import make_tree
from rigidimpulse.model.contact_memory import any_short_rebound, has_capacity
from rigidimpulse.model.island import empty_contacts
from rigidimpulse.model.world import World
from rigidimpulse.recording.events import ROW_LENGTH

CAPACITY = 256
"""Capacity for impacts, pairs and rebounds at first; it is doubled when it is used up."""
MOST_ROWS = 2**14
"""Impacts at most that are handed over at once."""
FIRST_INTERVAL = 16
"""Steps in the first interval."""
LIVE = 2.0
"""How much farther away contacts are left to the loop in Python than it takes them for touching."""
LONGEST_PAUSE = 16
"""Steps at most in which the kernel is not tried, after steps that were not simple."""


class EventRun:
    """The kernel's tables for one run."""

    def __init__(self, run: Run) -> None:
        """run: with the first trajectories."""
        world = run.world
        self._run, self._pause, self._waits, self._interval = run, 0, 0, FIRST_INTERVAL
        self._fixed = Fixed(
            world.dynamic, world.steady_acceleration, world.mass, world.inertia, world.material_of_body, world.coefficients,
            world.apart, world.static_min, world.static_max, LAWS[world.accuracy.restitution], world.accuracy.step,
        )  # fmt: skip
        self._paths, self._planes = _constants(world)
        state = run.state
        self._motion = Motion(state.trajectory, state.now, state.rotation)
        self._pairs, self._rows = CAPACITY + world.num_bodies, CAPACITY
        self._table, self._record = self._make_table(), self._make_record()
        self._known = 0
        self._step_begin = 0.0
        gap = world.contact_margin
        self._live = LIVE * (NEAR + ROUND_OFF + 2.0 * world.accuracy.tolerance / gap)

    def _make_table(self) -> Table:
        run, n = self._run, self._run.world.num_bodies
        capacity = n + self._pairs
        first, second = np.zeros((2, capacity), np.int64)
        return Table(
            make_queue(capacity), make_tree(n), self._paths, self._planes,
            run.box_min, run.box_max, first, second, np.full(n, -1, np.int64), np.zeros(capacity, np.int8),
            np.full(2 * capacity, -1, np.int64), np.full(n, -1, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64),
            np.zeros(2 * capacity, np.int64), np.zeros(3, np.int64),
        )  # fmt: skip

    def _make_record(self) -> SphereRecord:
        recorder = self._run.recorder
        return SphereRecord(
            recorder.times, recorder.written, recorder.position, recorder.orientation, recorder.velocity, recorder.angular_velocity,
            np.empty((self._rows, ROW_LENGTH)), np.empty(self._rows), np.zeros(1, np.int64), empty_contacts(1),
            np.empty((1, 7)), np.empty(2, np.int64),
        )  # fmt: skip

    def may_fly(self) -> bool:
        """Whether to try the kernel now: not while contacts last, and not directly after a step that it could not take."""
        waits, self._waits = self._waits > 0, max(self._waits - 1, 0)
        run = self._run
        idle = run.substepped.is_idle()
        return not waits and idle and not run.state.under_contact.any() and not run.soft_bodies.moves

    def fly(self, end: float, at_boundary: bool = True) -> tuple[int, float, float]:
        """Advance the scene from `state.time` towards `end` [s], until something happens that is not simple.

        Returns how the flight ends (see `effect`), and where the step begins and ends in which it does, s.
        """
        run = self._run
        self._learn()
        begin = now = run.state.time
        if at_boundary:
            self._step_begin = begin
        how, number, interval_end = FULL, 0, -1.0
        # A table was full: its contents are handed over, it grows, and the flight goes on where it was.
        while how == FULL:
            how, now, at_boundary, number, self._interval, interval_end = fly(
                self._fixed, self._motion, self._table, self._record, run.state.memory, now, end, at_boundary, self._interval,
                self._live, interval_end,
            )
            self._keep_impacts()
            if how == FULL and self._grow():
                interval_end = -1.0
        run.state.time = now
        if how == STEP:
            # A kernel that did not get on is tried again after twice as many steps each time.
            self._pause = 0 if now > begin else min(2 * self._pause + 1, LONGEST_PAUSE)
            self._waits = self._pause
        step = self._fixed.step
        return how, max(self._step_begin, (number - 1) * step), min(number * step, end)

    def _learn(self) -> None:
        """Take over the rebounds since the last flight, and what has become dynamic."""
        self._paths[:, DYNAMIC] = self._run.world.dynamic
        impacts, run = self._run.log.impacts, self._run
        if any_short_rebound(run.state.memory, run.world.num_bodies, impacts[self._known :]):
            self._live = np.inf  # what came back fast may be dealt with before it touches
        self._known = len(impacts)

    def _keep_impacts(self) -> None:
        """Hand impacts, their energies and rebounds to the run."""
        run, count = self._run, int(self._record.count[0])
        if not count:
            return
        rows = self._record.rows[:count]
        run.log.extend_impacts(rows, self._record.energy[:count])
        self._known = len(run.log.impacts)
        self._record.count[0] = 0

    def _grow(self) -> bool:
        """Make the table that is full larger; returns whether that is the one of events, which then has to be filled again."""
        if not has_capacity(self._run.state.memory, 1):
            self._run.state.remember(1)
        elif self._table.count[0] >= len(self._table.first):
            self._pairs *= 2
            self._table = self._make_table()
            return True
        else:
            self._rows = min(2 * self._rows, MOST_ROWS)
            self._record = self._make_record()
        return False


def _constants(world: World) -> tuple[np.ndarray, np.ndarray]:
    """Rows of paths (n, PATH_SIZE) and planes (q, PLANE_SIZE) with what never changes."""
    kind = kinds(world)
    paths, which = np.zeros((world.num_bodies, PATH_SIZE)), np.flatnonzero(kind == PLANE)
    paths[:, RADIUS], paths[:, GAP] = world.bound_radius, world.contact_margin * world.size
    paths[:, KIND], paths[:, DYNAMIC] = kind, world.dynamic
    planes = np.zeros((len(which), PLANE_SIZE))
    planes[:, : LEVEL + 1] = world.geometry.frame[world.geometry.shape_first[world.shape_of_body[which]], : LEVEL + 1]
    planes[:, BODY] = which
    return paths, planes
