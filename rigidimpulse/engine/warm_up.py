"""The first run on a machine: compile kernels on all cores.

Numba compiles one kernel at a time in a process. So the kernels of each kind that a run needs and that are not in the cache on disk are
compiled in parts (`PARTS`): the first in this process, each of the others in one of its own, which puts them into the cache. Parts of
one kind take about as long, and share little that would be compiled twice.
"""

from __future__ import annotations

import gc
import logging
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from importlib import import_module

import numpy as np

from rigidimpulse.core.kernels import is_cached

logger = logging.getLogger("rigidimpulse")
SECONDS_OF_A_KIND = 20
"""s that compiling one kind of kernels takes, about."""
CYLINDERS, CONTACTS, EVENTS, SUBSTEPPED, JOINTS = "cylinders", "contacts", "impacts of balls", "sub-stepped islands", "joints"
LAST = {
    CONTACTS: ("engine.touching", "contacts_of_pairs"),
    EVENTS: ("engine.spheres.flight", "fly"),
    SUBSTEPPED: ("dynamics.solvers.tgs_soft.solver", "advance"),
    JOINTS: ("dynamics.constraints.joint_sub_step", "close_at_end"),
}
"""The kernel of each kind that is compiled last."""
STEP = 1.0 / 60.0


def prepare_kernels(world, with_events: bool, with_substepped: bool) -> None:
    """Say so and compile on several cores what a run needs, where this machine has never run these sources."""
    missing = kernels_to_compile(world, with_events, with_substepped)
    if missing:
        kinds, seconds = ", ".join(missing), SECONDS_OF_A_KIND * len(missing)
        logger.warning(f"compiling kernels ({kinds}) for the first run on this machine, once: this takes about {seconds} s")
        compile_kernels(world, missing)


def kernels_to_compile(world, with_events: bool, with_substepped: bool) -> list[str]:
    """Kinds of kernels that a run of a world needs and that do not lie in the cache: what is compiled last of each tells."""
    needed = {CONTACTS: world.can_collide, EVENTS: with_events, SUBSTEPPED: with_substepped, JOINTS: bool(world.joints_of_scene)}
    missing = []
    for kind, (module, name) in LAST.items():
        if needed[kind] and not is_cached(getattr(import_module(f"rigidimpulse.{module}"), name)):
            missing.append(kind)
    return missing


def compile_kernels(world, kinds: list[str]) -> None:
    """Compile kernels of these kinds for a world. Should another process fail, its part is compiled when used."""
    cylinders = [CYLINDERS] if world.cylinders is not None else []
    mine, *others = [(kind, part) for kind in kinds for part in range(len(PARTS[kind]))]
    with ExitStack() as processes:
        for kind, part in others:
            processes.enter_context(_process(kind, str(part), *cylinders))
        _compile(*mine, bool(cylinders))


def _process(*arguments: str) -> subprocess.Popen:
    """Start this module as a program."""
    quiet = subprocess.DEVNULL
    command = [sys.executable, "-m", "rigidimpulse.engine.warm_up", *arguments]
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


def _box_on_floor(with_cylinder: bool, jointed: bool = False):
    """Context of a scene that has a contact from the start, and a joint if it is to."""
    from rigidimpulse.model.state import StepContext
    from rigidimpulse.model.world import compile_scene
    from rigidimpulse.recording.events import EventLog
    from rigidimpulse.recording.recorder import Recorder
    from rigidimpulse.scene.body import Body
    from rigidimpulse.scene.joint import HingeJoint
    from rigidimpulse.scene.scene import Scene
    from rigidimpulse.scene.shape import Shape

    scene = Scene(bodies=[Body("floor", Shape.half_space(), motion="static")])
    shape = Shape.cylinder(1, 1) if with_cylinder else Shape.box((1, 1, 1))
    scene.add(Body("body", shape, position=(0, 0, 0.5), velocity=(0, 0, -1)))
    if jointed:
        scene.add(HingeJoint("body", None, (0, 0, 1), (1, 0, 0)))
    return StepContext(compile_scene(scene), Recorder(np.zeros(1), 2), EventLog())


def _contact():
    """One contact of the two bodies."""
    from rigidimpulse.engine.islands import empty_contacts

    contacts = empty_contacts(1)
    for column in contacts:
        column[...] = 0
    contacts.body_b[:] = 1
    contacts.normal[:] = (0.0, 0.0, 1.0)
    return contacts


def _respond_and_detect(context) -> None:
    """Impulses first: by then the other process has rows and what moves bodies in the cache, which these need too."""
    from rigidimpulse.dynamics.constraints.contact import hold_contacts
    from rigidimpulse.dynamics.constraints.contact_motion import contact_motion
    from rigidimpulse.dynamics.constraints.position_correction import needs_correction
    from rigidimpulse.dynamics.constraints.rows import make_rows
    from rigidimpulse.dynamics.impact.restitution import LAWS
    from rigidimpulse.dynamics.impact.sequence import respond_sequential
    from rigidimpulse.dynamics.solvers.newton import solve_newton
    from rigidimpulse.engine.exact.impacts import respond_to_impacts
    from rigidimpulse.engine.pair_events import PairEvents
    from rigidimpulse.engine.simulate import start_trajectories
    from rigidimpulse.engine.touching import bring_gyroscopic, refresh_pose
    from rigidimpulse.recording.contact_log import fill_contacts_and_forces

    state, world, now, one, contacts = context.state, context.world, context.state.now, np.ones(1), _contact()
    members = np.array([1])
    now.inv_inertia[1] = np.eye(3)
    respond_sequential(now, contacts, LAWS["auto"], False, one, 1.0, 1.0, context.column, None, context.impact_log)
    needs_correction(contacts, np.ones(1, bool), one)
    refresh_pose(members, now, state.rotation, state.trajectory.inertia)
    bring_gyroscopic(members, now, state.rotation, state.trajectory.inertia, context.angular_acceleration)
    fill_contacts_and_forces(contacts, now.position, np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((1, 3)))
    motion = contact_motion(
        world.geometry, world.shape_of_body, state.rotation, now, contacts, np.zeros(1, np.int64), np.zeros((1, 2), np.int64)
    )
    solve_newton(make_rows.py_func(0), 1, 1.0)
    hold_contacts(
        _leave_unsolved, now, contacts, members, motion.turning, np.zeros(1), context.acceleration, context.angular_acceleration,
        1.0, 1.0, context.column, np.zeros((1, 3)), context.wrench,
    )
    start_trajectories(context)
    pair_events = PairEvents(context, 1.0 / 60.0)
    pair_events.find_pairs()
    islands, _ = pair_events.touching(0.0, members)
    island = islands[0]
    respond_to_impacts(context, island, respond_sequential, LAWS["auto"])


def _leave_unsolved(_rows, _n: int, _target: float) -> float:
    """In the place of a solver of rows."""
    return 0.0


def _move_and_sweep(context) -> None:
    """Rows of contacts, courses, frames and the sweep."""
    _fill_rows(context)
    _move(context)


def _fill_rows(context) -> None:
    from rigidimpulse.dynamics.constraints.rows import change_velocities, changes_of, contact_rows, response_to, row_velocities
    from rigidimpulse.dynamics.impact.block import log_block

    now, contacts, members = context.state.now, _contact(), np.array([1])
    now.inv_inertia[1] = np.eye(3)
    rows, first_row, frames = contact_rows(now, contacts, members, context.column, 0)
    row_velocities(now, contacts, first_row, frames, rows.bias)
    response_to(rows, 1, rows.impulse)
    log_block(now, contacts, rows, first_row, frames, np.zeros(1), context.impact_log, 0)
    change_velocities(now, members, rows)
    changes_of(now, members, rows)


def _move(context) -> None:
    from rigidimpulse.collision.time_of_impact import bisection
    from rigidimpulse.engine.exact.trajectories import set_impact_margins
    from rigidimpulse.engine.pair_events import PairEvents
    from rigidimpulse.engine.simulate import start_trajectories
    from rigidimpulse.engine.touching import bring_all
    from rigidimpulse.motion.trajectory import FREE, Load, take

    state, now, world = context.state, context.state.now, context.world
    zero = np.zeros(1)
    start_trajectories(context)
    context.recorder.start(state.trajectory)
    bring_all(state.trajectory, np.array([1]), 0.0, now, state.rotation, context.acceleration, context.angular_acceleration)
    take(state.trajectory, 1, 0.0, now, Load(*np.zeros((4, 3))), FREE)
    pair_events = PairEvents(context, 1.0 / 60.0)
    pair_events.find_pairs()
    pair_events.trajectory_changed(1, 0.0)
    set_impact_margins(pair_events.pairs, np.zeros(0, np.int64), np.zeros(0), np.zeros(0, bool), 0.0, world.dynamic, pair_events.inside)
    bisection.sweep(context.detector, state.trajectory, np.array([0]), np.array([1]), zero, 1.0 / 60.0, zero, zero)


def _find_substepped_contacts(context) -> None:
    """What comes before the solver of heaps: pairs and their contacts."""
    from rigidimpulse.engine.regime import island_roots, refusals
    from rigidimpulse.engine.substepped.contact_forces import ContactStepper

    world, state, member = context.world, context.state, np.array([False, True])
    state.now.inv_inertia[1] = np.eye(3)
    stepper = ContactStepper(world, world.dynamic, finer=False)
    for _ in range(2):  # The second time there is a cover.
        stepper.set_up(context, np.array([1]), np.array([0]), STEP)
    stepper.near(context, member, ~member, STEP)
    # Columns of one row only would be another type.
    a, b = np.array([[0, 1], [0, 1]]).T
    refusals(world, island_roots(world.num_bodies, a, b, member), member, ~member, member, np.zeros(world.num_bodies), a, b, True)


def _step_substepped(context) -> None:
    """The solver of heaps, and what brings bodies from step to step."""
    from rigidimpulse.dynamics.solvers.tgs_soft.body_motion import mark_quick
    from rigidimpulse.engine.regime import TALL, support_levels
    from rigidimpulse.engine.substepped.contact_forces import ContactStepper
    from rigidimpulse.engine.substepped.trajectories import advance_sleep_timers, depart, end_trajectories, let_fly, mark_slow, most_stray

    state, now, members = context.state, context.state.now, np.array([1])
    stepper = ContactStepper(context.world, context.world.dynamic, finer=False)
    stepper.members = members
    support_levels(stepper.bodies, stepper.table.pairs, stepper.table.rows, TALL)
    mark_quick(stepper.bodies, STEP, 1.0)
    out = stepper.step(context, 0.0, STEP)
    steady = context.world.steady_acceleration
    end_trajectories(state.trajectory, members, 0.0, steady, now, state.rotation, context.acceleration, context.angular_acceleration)
    depart(state.trajectory, members, 0.0, STEP, now, out.position, out.orientation, out.velocity)
    let_fly(state.trajectory, members, steady)
    mark_slow(now, stepper.inner, 1.0, 1.0, np.array([False, True]))
    most_stray(now, members, stepper.pressed, stepper.reach, stepper.skin, 0.5)
    advance_sleep_timers(
        members, out.position, out.orientation, out.velocity, context.world.steady_strength, stepper.inner, stepper.skin, STEP,
        np.zeros((2, 7)), np.zeros(2),
    )  # fmt: skip


def _start_joints(context) -> None:
    """Rows of joints at the start of a sub-step and at impacts, and those that close them."""
    from rigidimpulse.dynamics.constraints.joint_impact import fill_rates, impact_rows
    from rigidimpulse.dynamics.constraints.joint_sub_step import count_joint_rows, fill_closing_rows, start_joint_rows
    from rigidimpulse.dynamics.constraints.rows import make_rows

    state, joints, which, members = context.state, context.joints, np.array([0]), np.array([1])
    now, table, memory = state.now, joints.table, joints.memory
    rows = make_rows.py_func(int(count_joint_rows(table, which)))
    fill_closing_rows(table, which, now, state.rotation, context.column, memory.angle, rows, 0)
    start_joint_rows(table, which, now, state.rotation, context.column, memory, STEP, 1.0, rows, 0)
    impact_rows(table, which, now, state.rotation, members, context.column, memory, 1.0, joints.moment)
    fill_rates(table, which, now, state.rotation, context.column, memory, 1.0, rows)


def _close_and_stop_joints(context) -> None:
    """Rows of joints at the end of a sub-step."""
    from rigidimpulse.dynamics.constraints.joint_sub_step import close_at_end, count_joint_rows, stop_rows
    from rigidimpulse.dynamics.constraints.rows import make_rows

    state, joints, which, members = context.state, context.joints, np.array([0]), np.array([1])
    count = int(count_joint_rows.py_func(joints.table, which))
    rows = make_rows.py_func(count)
    close_at_end(
        joints.table, which, state.now, context.acceleration, members, STEP, joints.memory, rows, 0, np.zeros(count), context.wrench
    )
    stop_rows(joints.table, which, state.now, state.rotation, members, context.column, joints.memory, np.zeros(1))


def _fly(_context) -> None:
    """The event kernel; it knows balls only."""
    from rigidimpulse.engine.simulate import start_trajectories
    from rigidimpulse.engine.spheres.run import EventRun
    from rigidimpulse.model.state import StepContext
    from rigidimpulse.model.world import compile_scene
    from rigidimpulse.recording.events import EventLog
    from rigidimpulse.recording.recorder import Recorder
    from rigidimpulse.scene.body import Body
    from rigidimpulse.scene.scene import Scene
    from rigidimpulse.scene.shape import Shape

    scene = Scene(bodies=[Body("floor", Shape.half_space(), motion="static"), Body("ball", Shape.sphere(1.0), position=(0, 0, 9))])
    context = StepContext(compile_scene(scene), Recorder(np.zeros(1), 2), EventLog())
    start_trajectories(context)
    EventRun(context).fly(1.0)


PARTS = {
    CONTACTS: (_respond_and_detect, _move_and_sweep),
    EVENTS: (_fly,),
    SUBSTEPPED: (_find_substepped_contacts, _step_substepped),
    JOINTS: (_start_joints, _close_and_stop_joints),
}
"""What is compiled at once, by kind; each gets a context."""


def _compile(kind: str, part: int, with_cylinder: bool) -> None:
    """Compile one part."""
    with _without_garbage_collection():
        PARTS[kind][part](_box_on_floor(with_cylinder, kind == JOINTS))


if __name__ == "__main__":
    _compile(sys.argv[1], int(sys.argv[2]), CYLINDERS in sys.argv[3:])
