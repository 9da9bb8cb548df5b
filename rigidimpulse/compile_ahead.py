"""Compile kernels on a second core while the first run compiles the others.

Numba compiles one kernel at a time in a process. On the first run on a machine a second process compiles those that the run needs last
(sweep, respond, constrain) into the cache on disk, while the run itself starts with those it needs first.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np


def start_in_second_process(with_cylinders: bool) -> subprocess.Popen:
    """Start compiling in a process of its own; it ends by itself, and nobody has to wait for it."""
    command = [sys.executable, "-m", "rigidimpulse.compile_ahead", *(["cylinders"] if with_cylinders else [])]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def compile_late_kernels(with_cylinders: bool) -> None:
    """Call the kernels that a run with contacts needs last, on a box above a floor."""
    from rigidimpulse.body import Body
    from rigidimpulse.detect.groups import empty_contacts
    from rigidimpulse.observe.events import EventLog
    from rigidimpulse.observe.recorder import Recorder
    from rigidimpulse.scene import Scene
    from rigidimpulse.shape import Shape
    from rigidimpulse.simulate import start_courses
    from rigidimpulse.state import StepContext
    from rigidimpulse.sweep import bisection
    from rigidimpulse.world import compile_scene

    scene = Scene(bodies=[Body("floor", Shape.half_space(), motion="static")])
    scene.add(Body("body", Shape.cylinder(1, 1) if with_cylinders else Shape.box((1, 1, 1)), position=(0, 0, 1)))
    world = compile_scene(scene)
    context = StepContext(world, Recorder(np.zeros(1), 2), EventLog())
    start_courses(context)
    pair, zero = (np.array([0]), np.array([1])), np.zeros(1)
    bisection.sweep(context.detector, context.state.course, *pair, zero, 1.0 / 60.0, zero, zero)
    contacts = empty_contacts(1)
    for column in contacts:
        column[...] = 0
    contacts.body_b[:] = 1
    contacts.normal[:] = (0.0, 0.0, 1.0)
    _compile_response(context, contacts)
    _compile_constraints(context, contacts)


def _compile_response(context, contacts) -> None:
    from rigidimpulse.respond.impulse import speed_scale
    from rigidimpulse.respond.simultaneous import respond_sequential

    now = context.state.now
    respond_sequential(now, contacts, np.zeros(1), 0.0, speed_scale(now, contacts), context.column, context.impact_log)


def _compile_constraints(context, contacts) -> None:
    from rigidimpulse.constrain.drift import lift_contacts, needs_lift
    from rigidimpulse.constrain.resting import hold_contacts, turning_of

    state, world, now = context.state, context.world, context.state.now
    now.inv_inertia[1] = np.eye(3)
    kinds, held = np.zeros(1, np.int64), np.ones(1, bool)
    turning = turning_of(world.geometry, world.shape_of_body, state.rotation, now, contacts, kinds)
    hold_contacts(
        now, contacts, np.arange(1), turning, context.acceleration, context.angular_acceleration, 1.0, context.column,
        np.zeros((1, 3)), context.wrench,
    )
    needs_lift(contacts, held, np.ones(1))
    lift_contacts(now, contacts, held, np.ones(1), context.column)


if __name__ == "__main__":
    compile_late_kernels("cylinders" in sys.argv[1:])
