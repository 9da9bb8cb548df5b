"""The first run on a machine: compile kernels on two cores.

Numba compiles one kernel at a time in a process. So a second process compiles one half of what a run with contacts needs (sweep and
constrain) into the cache on disk, while the first one compiles the other half, and then waits for it.
"""

from __future__ import annotations

import gc
import subprocess
import sys
from contextlib import contextmanager

import numpy as np

CYLINDERS = "cylinders"


def compile_kernels(world) -> None:
    """Compile what a run of a world with contacts needs. Should the second process fail, its half is compiled when used."""
    shapes = [CYLINDERS] if world.cylinders is not None else []
    command = [sys.executable, "-m", "rigidimpulse.compile_ahead", *shapes]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet), _without_garbage_collection():
        _detect_and_respond(_box_on_floor(bool(shapes)))


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


def _group(context):
    from rigidimpulse.detect.window import Window

    window = Window(context, 1.0 / 60.0)
    window.find_pairs()
    return window, window.touching(0.0, np.array([1]))[0]


def _detect_and_respond(context) -> None:
    from rigidimpulse.respond.response import respond_to_impacts
    from rigidimpulse.respond.restitution import AUTO
    from rigidimpulse.respond.simultaneous import respond_sequential
    from rigidimpulse.simulation import start_courses

    start_courses(context)
    context.recorder.start(context.state.course)
    _, group = _group(context)
    respond_to_impacts(context, group, respond_sequential, AUTO)


def _sweep_and_constrain(context) -> None:
    from rigidimpulse.constrain.drift import lift_contacts, needs_lift
    from rigidimpulse.constrain.resting import hold_contacts, turning_of
    from rigidimpulse.detect.groups import empty_contacts
    from rigidimpulse.detect.window import Window
    from rigidimpulse.sweep import bisection

    state, world, now = context.state, context.world, context.state.now
    one, zero = np.ones(1), np.zeros(1)
    bisection.sweep(context.detector, state.course, np.array([0]), np.array([1]), zero, 1.0 / 60.0, zero, zero)
    contacts = empty_contacts(1)
    for column in contacts:
        column[...] = 0
    contacts.body_b[:] = 1
    contacts.normal[:] = (0.0, 0.0, 1.0)
    now.inv_inertia[1] = np.eye(3)
    turning = turning_of(
        world.geometry, world.shape_of_body, state.rotation, now, contacts, np.zeros(1, np.int64)
    )
    hold_contacts(
        now, contacts, np.arange(1), turning, context.acceleration, context.angular_acceleration, 1.0, context.column,
        np.zeros((1, 3)), context.wrench,
    )
    needs_lift(contacts, np.ones(1, bool), one)
    lift_contacts(now, contacts, np.ones(1, bool), one, context.column)
    context.bring(1, 0.0)
    Window(context, 1.0 / 60.0).change_course(1, 0.0)


if __name__ == "__main__":
    with _without_garbage_collection():
        _sweep_and_constrain(_box_on_floor(CYLINDERS in sys.argv[1:]))
