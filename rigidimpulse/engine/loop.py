"""From step to step: steps end on the grid of the accuracy's step, at keyframes, and where soft bodies ask for it.

The kernel of balls (`spheres/`) takes many steps at once, as long as only simple impacts of balls happen in them. So does the compiled
order of events (`exact/event_loop.py`), as long as they need nothing but exact contact and nobody watches the run, and so do sub-stepped
islands (`substepped/undisturbed_steps.py`) as long as nothing else moves.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rigidimpulse.engine.effects import EventKernel
from rigidimpulse.engine.exact.step_begin import GRID, step_end
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.spheres.effect import ARRIVED, GO_ON, STEP
from rigidimpulse.engine.step import finish_step, go_on, step
from rigidimpulse.motion.trajectory import FIXED

WATCHED = 64
"""Steps at most between two looks at a run that somebody watches."""


def run_to_end(run: Run, duration: float, progress: Callable[[float], None] | None, every_step: bool = True) -> None:
    """Step to the end; a run that is under way goes on from where it is. Arguments as of `run_steps`."""
    # The last frame may lie after the end by rounding; what happens until the end does not depend on that.
    for end in (float(duration), max(float(duration), float(run.recorder.times[-1]))):
        if run.plan.steps:
            run_steps(run, end, progress, every_step)
        else:
            run.keyframes.start_segments(run, end)


def run_steps(run: Run, end: float, progress: Callable[[float], None] | None, every_step: bool = True) -> None:
    """Step to the end [s].

    progress: called with the time of the run after each step, or after WATCHED at most: in which only impacts of balls happened, or, where
    not `every_step` is asked for, that needed nothing but exact contact.

    There is no step of the length of a rounding error: in one of 4e-16 s springs pushed dominoes at 2e9 m/s.
    """
    size, state = run.world.accuracy.step, run.state
    while end - state.time > GRID * size:
        begin = state.time
        run.keyframes.start_segments(run, begin)
        stop = min(run.keyframes.next_key(begin), end)
        if not run.soft_bodies.moves and not np.any(state.trajectory.mode != FIXED):
            state.time = stop
            continue
        if progress is not None:
            stop = min(stop, (math.floor(begin / size + GRID) + WATCHED) * size)
        how = fly(run, stop) if run.flight.may_fly() else STEP
        if how == STEP:
            boundary = run.soft_bodies.advance(run, step_end.py_func(state.time, stop, size))
            take_steps(run, boundary, until=boundary if progress is not None and every_step else stop)
        if progress is not None:
            progress(state.time)


def take_steps(run: Run, end: float, until: float) -> None:
    """Step to `end` [s], or by whole steps as far as `until` [s] where they need nothing but exact contact, or nothing but sub-steps."""
    begin = run.state.time
    left = run.substepped.take_undisturbed_steps(run, end, until)
    if left is not None:
        finish_step(run, left, until)
    elif run.state.time == begin:
        step(run, end, until)


def fly(run: Run, stop: float) -> int:
    """Let the kernel of balls take the scene towards `stop` [s], and steps take over where it cannot; returns how that ends."""
    begin = run.state.time
    with run.plan.clock(EventKernel.name):
        how, step_begin, until = run.flight.fly(stop)
    while how == GO_ON:
        go_on(run, step_begin, until, may_leave=run.state.time > begin)
        if run.state.time >= until:
            return ARRIVED
        begin = run.state.time
        with run.plan.clock(EventKernel.name):
            how, step_begin, until = run.flight.fly(stop, at_boundary=False)
    return how
