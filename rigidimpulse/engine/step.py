"""One step of the loop, and what happens at an instant: detect, respond, forces, constrain, sweep, integrate, observe.

Every body has a course: its exact path since something last acted on it. A step opens a window of pairs that may meet
before its end, then goes from contact to contact: at the earliest time at which a pair touches, the group of bodies
that touch there is brought to that time and gets its impulses and contact forces; those whose course changed are
swept again. Bodies elsewhere do not notice.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.engine.exact.trajectories import take_course
from rigidimpulse.engine.islands import Group
from rigidimpulse.engine.pair_events import Window


def step(context, plan, end: float) -> None:
    """Advance all courses to `end` [s]."""
    window = Window(context, end)
    plan.run("detect", context, window)
    react(context, plan, window, context.state.time, window.active_bodies())
    _run_window(context, plan, window, may_leave=False)


def go_on(context, plan, begin: float, end: float, may_leave: bool) -> None:
    """Advance all courses to the `end` of a step from the middle of it, where the event kernel stopped; begin: of the step. Both in s.

    may_leave: whether to end earlier, at an instant from which on all bodies fly freely again.
    """
    window = Window(context, end)
    plan.run("detect", context, window)
    window.recall(begin)
    _run_window(context, plan, window, may_leave)


def _run_window(context, plan, window: Window, may_leave: bool) -> None:
    """From contact to contact, to the end of the window, or until no pair of it has a past if it may be left."""
    while True:
        plan.run("sweep", context, window)
        time = window.next_time()
        if time >= window.end:
            break
        bodies = window.bodies_at(time)
        window.count_contacts(time)
        react(context, plan, window, time, bodies)
        if may_leave and window.is_plain(time):
            context.state.time = time
            return
    context.state.time = window.end


def react(context, plan, window: Window, time: float, bodies: np.ndarray) -> None:
    """Everything that happens at `time` to the groups that the given bodies touch."""
    window.wake[bodies] = np.inf
    groups, reached = window.touching(time, bodies)
    release(context, window, time, reached, groups)
    for group in groups:
        plan.run("respond", context, group)
        plan.run("forces", context, window, group)
        plan.run("constrain", context, window, group)
        plan.run("integrate", context, window, group)
    window.settle(time)


def release(context, window: Window, time: float, bodies: np.ndarray, groups: list[Group]) -> None:
    """Let go those bodies that still carry the forces of contacts they have left."""
    state = context.state
    bodies = bodies[state.under_contact[bodies]]
    if not len(bodies):
        return
    free = np.zeros(6)
    leaves = np.zeros(len(state.under_contact), bool)
    leaves[bodies] = True
    for group in groups:
        leaves[group.members] = False
    left = leaves.nonzero()[0]
    left = left[(state.course.start[left] < time) & ~window.inside[left]]
    for i in left.tolist():
        take_course(context, window, i, time, free, rests=False)
