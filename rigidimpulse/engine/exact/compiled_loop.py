"""Where the compiled order of events (`event_loop`) meets the run: which runs use it, buffers that grow, and problems in words."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.collision.manifold.dispatch import SCRATCH_ROWS
from rigidimpulse.collision.manifold.kept_features import FEW_ROWS, make_contact_scratch
from rigidimpulse.collision.time_of_impact.bisection import LOOK_AHEAD
from rigidimpulse.core.kernel_cache import note_beside
from rigidimpulse.core.memory import rows_of
from rigidimpulse.core.record import Record
from rigidimpulse.dynamics.constraints.joint_impact import NO_JOINTS
from rigidimpulse.dynamics.impact.restitution import LAWS
from rigidimpulse.engine.exact.contact_forces import NOT_SOLVED_REMEDY
from rigidimpulse.engine.exact.event_loop import (
    ASKED,
    AT_END,
    AT_EVENT,
    BODIES,
    COMES_BACK,
    FIND,
    GIVEN,
    HOLD,
    LOAD,
    MOVE,
    NEXT,
    NO_CAPACITY,
    NOT_FINITE,
    NOT_RECORDED,
    NOT_RESOLVED,
    NOT_SOLVED,
    REPORT,
    RESPOND,
    ROWS,
    SQUEEZED,
    SWEEP,
    SWEEP_STALLED,
    VERBS,
    WITHOUT_REBOUND,
    Loop,
    Reports,
    Settings,
    run_events,
)
from rigidimpulse.engine.exact.impacts import WITHOUT_REBOUND_REMEDY
from rigidimpulse.engine.exact.step_begin import Steps
from rigidimpulse.engine.impact_time import STALLED_REMEDY
from rigidimpulse.engine.narrow_phase import FCL
from rigidimpulse.engine.pair_events import INSTANT, NOT_RESOLVED_REMEDY, PairEvents, most_pairs
from rigidimpulse.engine.pair_table import pair_bodies
from rigidimpulse.engine.run import NOT_FINITE_REMEDY, Run
from rigidimpulse.model.world import World

if TYPE_CHECKING:
    from rigidimpulse.model.plan import Plan

NONE = np.zeros(0, np.int64)
FIRST_REPORTS = 256
COMPILED: set[str] = set()
"""Layouts of records for which this process has found the kernel compiled."""
EFFECTS = {
    FIND: ("contact detection",),
    SWEEP: ("impact time",),
    RESPOND: ("impulses",),
    LOAD: ("steady load", "gyroscopic term"),
    HOLD: ("contact forces",),
    MOVE: ("exact flight",),
}
"""The effects whose verbs the loop calls, by their place in `Loop.cycles`."""
PROBLEMS = {
    int(NOT_RESOLVED): ("contact not resolved", NOT_RESOLVED_REMEDY),
    int(SWEEP_STALLED): ("sweep stalled", STALLED_REMEDY),
    int(WITHOUT_REBOUND): ("impacts finished without rebound", WITHOUT_REBOUND_REMEDY),
    int(NOT_SOLVED): ("contact forces not solved", NOT_SOLVED_REMEDY),
    int(NOT_FINITE): ("not finite", NOT_FINITE_REMEDY),
    int(NOT_RECORDED): ("not recorded", "{value:.0f} contacts of one instant had no space in the record; the motion is not affected"),
}
"""Kind and remedy of the problems."""
NEEDED = ("contact detection", "impulses", "steady load", "impact time", "exact flight")


def why_not(world: World, plan: Plan) -> str:
    """Why events of a world are not dealt with by the compiled loop; empty where they are."""
    accuracy = world.accuracy
    if accuracy.response != "sequential":
        return f"the response is {accuracy.response!r}"
    if accuracy.impact_time not in ("bisection", "conservative"):
        return f"the time of impact is found by {accuracy.impact_time!r}"
    if plan.includes(FCL):
        return "contacts are FCL's"
    missing = [name for name in NEEDED if not plan.includes(name)]
    return f"without {missing[0]}" if missing else ""


def _of_python(run: Run) -> np.ndarray:
    """Bodies (n,) bool that are jointed, pushed by varying forces, or sub-stepped: what happens to them is up to the loop in Python."""
    # What a joint held until it broke: that loop accounts for the end of such a trajectory.
    was_joined = run.state.by_joints
    return (run.substepped.label >= 0) | run.joints.joined() | was_joined | run.forces.acts


TABLE, MEMORY, LIMITER, LOG, CONTACT_LOG, REPORTS = (
    Loop._fields.index(name) for name in ("table", "memory", "limiter", "log", "contact_log", "reports")
)


def _make_reports(most: int) -> Reports:
    """Space for as many problems, and as many bodies of them."""
    return Reports(rows_of(most, REPORT), np.empty(most, np.int64), np.zeros(3, np.int64))


class CompiledLoop:
    """The compiled order of events in a run."""

    def __init__(self, run: Run) -> None:
        """run: with its participants."""
        world, accuracy, n = run.world, run.world.accuracy, run.world.num_bodies
        ahead = LOOK_AHEAD if accuracy.impact_time == "bisection" else 0.0
        settings = Settings(
            accuracy.step, INSTANT * accuracy.step, LAWS[accuracy.restitution], ahead, accuracy.iterations,
            int(run.plan.includes("gyroscopic term")), int(run.plan.includes("contact forces")),
        )  # fmt: skip
        self._elsewhere = np.zeros(n, bool)
        self._cycles, self._calls = np.zeros(VERBS, np.int64), np.zeros(VERBS, np.int64)
        self._lines = {verb: [line for line in run.plan.lines if line.included and line.name in names] for verb, names in EFFECTS.items()}
        self._scratch = make_contact_scratch.py_func(SCRATCH_ROWS, 0, FEW_ROWS)
        self._reports = _make_reports(FIRST_REPORTS)
        state = run.state
        pairs = np.empty((most_pairs(n), 2), np.int32)
        self._steps = Steps(np.zeros(2), world.static_min, world.static_max, pairs)
        # Others look at the run between two steps, or take its steps, there; soft bodies may come to press on anything.
        self._goes_on = not (run.plan.observe or run.plan.includes("event kernel") or run.soft_bodies.moves)
        self._record = Record(
            Loop(
                settings, world.compiled_shapes, pair_bodies(world), world.margins, world.coefficients, world.rolling, self._elsewhere,
                run.motion, PairEvents(run, state.time).table, state.memory, state.limiter, run.log.buffers, run.contact_log.buffers,
                run.recorder.frames, run.recorder.written, self._reports, run.error_estimate, run.detector.sweep_scratch, run.wrench,
                run.column, state.sub_step, run.substepped.counts, self._steps, run.impact_log, NO_JOINTS, self._cycles,
                self._calls,
            )
        )  # fmt: skip

    def is_compiled(self) -> bool:
        """Whether the kernel is in the cache for records of this layout."""
        layout = self._record.layout_name
        if layout not in COMPILED and self._note().exists():
            COMPILED.add(layout)
        return layout in COMPILED

    def say_compiled(self) -> None:
        """Say that the kernel is in the cache."""
        self._note().touch()

    def _note(self) -> Path:
        return note_beside(run_events.py_func, self._record.layout_name)

    def advance(self, run: Run, pair_events: PairEvents, event: tuple[float, np.ndarray], until: float) -> tuple[float, np.ndarray]:
        """Go on from an event, its time [s] and bodies, to the end of the step, or to an event for the loop in Python.

        Where nothing else looks at the run between two steps, the next ones are taken, too, as far as `until` [s]. Returns the time of the
        event, and those of its bodies that are left to the loop in Python.
        """
        mark, (time, bodies), how = np.zeros(run.world.num_bodies, bool), event, NO_CAPACITY
        if not len(bodies):  # a step begins with sub-stepped islands alone
            return event
        self._elsewhere[:] = _of_python(run)
        if run.solve_rows is not None or self._elsewhere[bodies].all():
            return event
        # The loop in Python begins the sub-stepped islands of a step at its first event.
        given = GIVEN if pair_events.substepped_begun or not pair_events.inside.any() else COMES_BACK
        mark[bodies] = True
        self._steps.times[:] = pair_events.begin, pair_events.end
        last = until if self._goes_on and not self._elsewhere.any() else pair_events.end
        while how not in (AT_END, AT_EVENT):
            start, before = perf_counter(), self._cycles.copy()
            how, time, given = run_events(self._updated(run, pair_events), mark, given, time, last, self._scratch)
            pair_events.follow(*self._steps.times.tolist())
            self._account(perf_counter() - start, before)
            self._tell(run, pair_events)
            if how == NO_CAPACITY:
                self._grow(run)
            elif how != AT_END:
                pair_events.add_missing_pairs(time)
        if how == AT_EVENT and given == NEXT:
            pair_events.count_contacts(time)
        return float(time), mark.nonzero()[0] if how == AT_EVENT else NONE

    def _updated(self, run: Run, pair_events: PairEvents) -> Record:
        """What the kernel gets: the record, with what may have grown or is another in each step."""
        record, state = self._record, run.state
        record.replace(TABLE, pair_events.table)
        record.replace(MEMORY, state.memory)
        record.replace(LIMITER, state.limiter)
        record.replace(LOG, run.log.buffers)
        record.replace(CONTACT_LOG, run.contact_log.buffers)
        record.replace(REPORTS, self._reports)
        return record

    def _grow(self, run: Run) -> None:
        """Make larger what had no space for an event."""
        run.log.grow()
        run.contact_log.grow()
        run.state.remember(int(run.contact_log.buffers.counts[2]))
        if self._reports.used[ASKED] > len(self._reports.rows):
            self._reports = _make_reports(2 * int(self._reports.used[ASKED]))

    def _tell(self, run: Run, pair_events: PairEvents) -> None:
        """Report the problems that the kernel met, in words."""
        for row in self._reports.rows[: self._reports.used[ROWS]]:
            bodies = self._reports.bodies[row["first"] : row["first"] + row["count"]]
            kind, remedy = pair_events.why_again(*bodies) if row["kind"] == SQUEEZED else PROBLEMS[int(row["kind"])]
            names = tuple(run.world.names[i] for i in bodies.tolist())
            run.log.report(float(row["time"]), kind, names, remedy.format(value=float(row["value"])))
        self._reports.used[[ROWS, BODIES]] = 0

    def _account(self, seconds: float, before: np.ndarray) -> None:
        """Give the time of the kernel to the effects whose verbs it called, in proportion to the processor's cycles."""
        spent, calls = (self._cycles - before).tolist(), self._calls.tolist()
        of_cycle = seconds / max(sum(spent), 1)
        for verb, lines in self._lines.items():
            for line in lines:
                line.seconds += of_cycle * spent[verb] / len(lines)
                line.calls += calls[verb]
        self._calls[:] = 0
