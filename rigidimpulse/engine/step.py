"""One step of the loop, and what happens at an instant: detect, respond, forces, constrain, sweep, integrate, observe.

Every body has a course: its exact path since something last acted on it. A step opens a window of pairs that may meet
before its end, then goes from contact to contact: at the earliest time at which a pair touches, the group of bodies
that touch there is brought to that time and gets its impulses and contact forces; those whose course changed are
swept again. Bodies elsewhere do not notice.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.engine.exact.trajectories import begin_trajectory
from rigidimpulse.engine.islands import Island
from rigidimpulse.engine.pair_events import PairEvents


def step(run, plan, end: float) -> None:
    """Advance all courses to `end` [s]."""
    pair_events = PairEvents(run, end)
    plan.run("detect", run, pair_events)
    react(run, plan, pair_events, run.state.time, pair_events.active_bodies())
    _run_pair_events(run, plan, pair_events, may_leave=False)


def go_on(run, plan, begin: float, end: float, may_leave: bool) -> None:
    """Advance all courses to the `end` of a step from the middle of it, where the event kernel stopped; begin: of the step. Both in s.

    may_leave: whether to end earlier, at an instant from which on all bodies fly freely again.
    """
    pair_events = PairEvents(run, end)
    plan.run("detect", run, pair_events)
    pair_events.recall(begin)
    _run_pair_events(run, plan, pair_events, may_leave)


def _run_pair_events(run, plan, pair_events: PairEvents, may_leave: bool) -> None:
    """From contact to contact, to the end of the window, or until no pair of it has a past if it may be left."""
    while True:
        plan.run("sweep", run, pair_events)
        time = pair_events.next_time()
        if time >= pair_events.end:
            break
        bodies = pair_events.bodies_at(time)
        pair_events.count_contacts(time)
        react(run, plan, pair_events, time, bodies)
        if may_leave and pair_events.is_plain(time):
            run.state.time = time
            return
    run.state.time = pair_events.end


def react(run, plan, pair_events: PairEvents, time: float, bodies: np.ndarray) -> None:
    """Everything that happens at `time` to the groups that the given bodies touch."""
    pair_events.wake[bodies] = np.inf
    islands, reached = pair_events.touching(time, bodies)
    release(run, pair_events, time, reached, islands)
    for island in islands:
        plan.run("respond", run, island)
        plan.run("forces", run, pair_events, island)
        plan.run("constrain", run, pair_events, island)
        plan.run("integrate", run, pair_events, island)
    pair_events.settle(time)


def release(run, pair_events: PairEvents, time: float, bodies: np.ndarray, islands: list[Island]) -> None:
    """Let go those bodies that still carry the forces of contacts they have left."""
    state = run.state
    bodies = bodies[state.under_contact[bodies]]
    if not len(bodies):
        return
    free = np.zeros(6)
    leaves = np.zeros(len(state.under_contact), bool)
    leaves[bodies] = True
    for island in islands:
        leaves[island.members] = False
    left = leaves.nonzero()[0]
    left = left[(state.trajectory.start[left] < time) & ~pair_events.inside[left]]
    for i in left.tolist():
        begin_trajectory(run, pair_events, i, time, free, rests=False)
