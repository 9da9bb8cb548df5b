"""The first run on a machine: compile kernels on two cores.

Numba compiles one kernel at a time in a process. So a second process compiles one half of what a run with contacts needs (motion,
sweep, the solver of rows) into the cache on disk, while the first one compiles the other half, and then waits for it. Where the plan has
the event kernel in, a third one compiles that.
"""

from __future__ import annotations

import gc
import subprocess
import sys
from contextlib import ExitStack, contextmanager

import numpy as np

CYLINDERS, EVENTS = "cylinders", "events"


def compile_kernels(world, with_events: bool) -> None:
    """Compile what a run of a world with contacts needs. Should another process fail, its part is compiled when used."""
    shapes = [CYLINDERS] if world.cylinders is not None else []
    with ExitStack() as processes:
        processes.enter_context(_process(*shapes))
        if with_events:
            processes.enter_context(_process(EVENTS))
        with _without_garbage_collection():
            _respond_and_detect(_box_on_floor(bool(shapes)))


def _process(*arguments: str) -> subprocess.Popen:
    """Start this module as a program."""
    quiet = subprocess.DEVNULL
    command = [sys.executable, "-m", "rigidimpulse.compile_ahead", *arguments]
    return subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)


@contextmanager
def _without_garbage_collection():
    """Compilers make many objects and hardly any garbage: looking for it takes a seventh of their time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _box_on_floor(with_cylinder: bool):
    """Context of a scene that has a contact from the start."""
    from rigidimpulse.body import Body
    from rigidimpulse.observe.events import EventLog
    from rigidimpulse.observe.recorder import Recorder
    from rigidimpulse.scene import Scene
    from rigidimpulse.shape import Shape
    from rigidimpulse.state import StepContext
    from rigidimpulse.world import compile_scene

    scene = Scene(bodies=[Body("floor", Shape.half_space(), motion="static")])
    shape = Shape.cylinder(1, 1) if with_cylinder else Shape.box((1, 1, 1))
    scene.add(Body("body", shape, position=(0, 0, 0.5), velocity=(0, 0, -1)))
    return StepContext(compile_scene(scene), Recorder(np.zeros(1), 2), EventLog())


def _contact():
    """One contact of the two bodies."""
    from rigidimpulse.detect.groups import empty_contacts

    contacts = empty_contacts(1)
    for column in contacts:
        column[...] = 0
    contacts.body_b[:] = 1
    contacts.normal[:] = (0.0, 0.0, 1.0)
    return contacts


def _respond_and_detect(context) -> None:
    """Impulses first: by then the other process has what moves bodies in the cache, which detection needs too."""
    from rigidimpulse.constrain.contact_motion import contact_motion
    from rigidimpulse.constrain.drift import needs_lift
    from rigidimpulse.constrain.resting import hold_contacts
    from rigidimpulse.constrain.rows import change_velocities, changes_of, contact_rows, response_to, row_velocities
    from rigidimpulse.detect.touching import bring_gyroscopic, refresh_pose
    from rigidimpulse.detect.window import Window
    from rigidimpulse.observe.contact_log import fill_contacts_and_forces
    from rigidimpulse.respond.block import log_block
    from rigidimpulse.respond.response import respond_to_impacts
    from rigidimpulse.respond.restitution import LAWS
    from rigidimpulse.respond.simultaneous import respond_sequential
    from rigidimpulse.simulation import start_courses

    state, world, now, one, contacts = context.state, context.world, context.state.now, np.ones(1), _contact()
    members = np.array([1])
    now.inv_inertia[1] = np.eye(3)
    respond_sequential(now, contacts, LAWS["auto"], False, one, 1.0, 1.0, context.column, None, context.impact_log)
    rows, first_row, frames = contact_rows(now, contacts, members, context.column, 0)
    row_velocities(now, contacts, first_row, frames, rows.bias)
    response_to(rows, 1, rows.impulse)
    log_block(now, contacts, rows, first_row, frames, np.zeros(1), context.impact_log, 0)
    change_velocities(now, members, rows)
    changes_of(now, members, rows)
    needs_lift(contacts, np.ones(1, bool), one)
    refresh_pose(members, now, state.rotation, state.course.inertia)
    bring_gyroscopic(members, now, state.rotation, state.course.inertia, context.angular_acceleration)
    fill_contacts_and_forces(contacts, now.position, np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((1, 3)))
    motion = contact_motion(
        world.geometry, world.shape_of_body, state.rotation, now, contacts, np.zeros(1, np.int64), np.zeros((1, 2), np.int64)
    )
    hold_contacts(
        _leave_unsolved, now, contacts, members, motion.turning, np.zeros(1), context.acceleration, context.angular_acceleration,
        1.0, 1.0, context.column, np.zeros((1, 3)), context.wrench,
    )
    start_courses(context)
    window = Window(context, 1.0 / 60.0)
    window.find_pairs()
    groups, _ = window.touching(0.0, members)
    group = groups[0]
    respond_to_impacts(context, group, respond_sequential, LAWS["auto"])


def _leave_unsolved(_rows, _n: int, _target: float) -> float:
    """In the place of a solver of rows, which the other process compiles."""
    return 0.0


def _move_sweep_and_solve(context) -> None:
    from rigidimpulse.constrain.newton import solve_newton
    from rigidimpulse.constrain.rows import make_rows
    from rigidimpulse.detect.touching import bring_all
    from rigidimpulse.detect.window import Window
    from rigidimpulse.integrate.course import FREE, take
    from rigidimpulse.integrate.flight import set_touch_gaps
    from rigidimpulse.simulation import start_courses
    from rigidimpulse.sweep import bisection

    state, now, world = context.state, context.state.now, context.world
    zero = np.zeros(1)
    start_courses(context)
    context.recorder.start(state.course)
    bring_all(state.course, np.array([1]), 0.0, now, state.rotation, context.acceleration, context.angular_acceleration)
    take(state.course, 1, 0.0, now, *np.zeros((4, 3)), FREE)
    window = Window(context, 1.0 / 60.0)
    window.find_pairs()
    window.change_course(1, 0.0)
    set_touch_gaps(window.pairs, np.zeros(0, np.int64), np.zeros(0), np.zeros(0, bool), 0.0, world.dynamic, window.inside)
    solve_newton(make_rows.py_func(0), 1, 1.0)
    bisection.sweep(context.detector, state.course, np.array([0]), np.array([1]), zero, 1.0 / 60.0, zero, zero)


def _fly() -> None:
    """The event kernel."""
    from rigidimpulse.body import Body
    from rigidimpulse.events.run import EventRun
    from rigidimpulse.observe.events import EventLog
    from rigidimpulse.observe.recorder import Recorder
    from rigidimpulse.scene import Scene
    from rigidimpulse.shape import Shape
    from rigidimpulse.simulation import start_courses
    from rigidimpulse.state import StepContext
    from rigidimpulse.world import compile_scene

    scene = Scene(bodies=[Body("floor", Shape.half_space(), motion="static"), Body("ball", Shape.sphere(1.0), position=(0, 0, 9))])
    context = StepContext(compile_scene(scene), Recorder(np.zeros(1), 2), EventLog())
    start_courses(context)
    EventRun(context).fly(1.0)


if __name__ == "__main__":
    with _without_garbage_collection():
        if EVENTS in sys.argv[1:]:
            _fly()
            sys.exit()
        _move_sweep_and_solve(_box_on_floor(CYLINDERS in sys.argv[1:]))
