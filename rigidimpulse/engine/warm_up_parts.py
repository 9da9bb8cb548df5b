"""Kernels of each kind that are compiled ahead, in parts; see `warm_up.py`.

As a program it compiles parts, in a process of its own: `python -m rigidimpulse.engine.warm_up_parts KIND NUMBER [KIND NUMBER ...]`.
"""

from __future__ import annotations

import gc
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from rigidimpulse.collision.containment import points_inside
from rigidimpulse.collision.manifold.dispatch import Posed, pair_gap
from rigidimpulse.collision.segment_crossings import crossings
from rigidimpulse.collision.time_of_impact import bisection
from rigidimpulse.collision.time_of_impact.result import PairsToSweep
from rigidimpulse.core.union_find import roots
from rigidimpulse.dynamics.constraints.contact import ContactProblem
from rigidimpulse.dynamics.constraints.contact_motion import contact_motion
from rigidimpulse.dynamics.constraints.joint_flight import BEGIN, fly, make_stages, next_length, take_stage
from rigidimpulse.dynamics.constraints.joint_impact import fill_rates, impact_rows
from rigidimpulse.dynamics.constraints.joint_limits import next_switch
from rigidimpulse.dynamics.constraints.joint_sub_step import close_at_end, fill_closing_rows, start_joint_rows, stop_rows
from rigidimpulse.dynamics.constraints.jointed_island import JointedIsland, count_joint_rows
from rigidimpulse.dynamics.constraints.position_correction import Sunk, correct_positions, needs_correction
from rigidimpulse.dynamics.constraints.rolling_friction import NO_ROLLING, rolling_of
from rigidimpulse.dynamics.constraints.rows import change_velocities, changes_of, contact_rows, make_rows, response_to, row_velocities
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.engine.begin import make_plan, make_run
from rigidimpulse.engine.cheapest import CheapestRegime, Near
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.exact.compiled_loop import CompiledLoop
from rigidimpulse.engine.exact.energy_limit import limit_energy, note_end_energy
from rigidimpulse.engine.exact.impacts import respond
from rigidimpulse.engine.exact.joint_flights import WHOLE
from rigidimpulse.engine.exact.joints import JointState
from rigidimpulse.engine.exact.step_size import Forces, StepLimits, Turning, estimate_error, hold_turning, turns
from rigidimpulse.engine.exact.trajectories import set_impact_margins, take_steady_load
from rigidimpulse.engine.islands import touching_islands
from rigidimpulse.engine.measure.edges_in_parts import enter_with_edges, parts_of
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.regime import TALL, Judged, refusals, support_levels
from rigidimpulse.engine.run import Run, start_trajectories
from rigidimpulse.engine.sleeping import advance_sleep_timers, stands_still
from rigidimpulse.engine.spheres.run import EventRun
from rigidimpulse.engine.step import step
from rigidimpulse.engine.substepped.contact_forces import COARSE, ContactStepper
from rigidimpulse.engine.substepped.island_step import energies_of_islands
from rigidimpulse.engine.substepped.jointed import JointedStepper
from rigidimpulse.engine.substepped.member_paths import MemberPaths
from rigidimpulse.engine.substepped.membership import Candidates, connect_members, gather_members, settle_islands
from rigidimpulse.engine.substepped.sharing import Sharing
from rigidimpulse.engine.substepped.trajectories import depart, let_fly, mark_slow
from rigidimpulse.engine.substepped.undisturbed_step import (
    KEEPS_CHEAP,
    Choice,
    Landing,
    begin_undisturbed_step,
    is_undisturbed,
    land_members,
)
from rigidimpulse.engine.warm_up import (
    ANY_SHAPES,
    CONTACTS,
    EVENTS,
    JOINED_UNDER_FORCES,
    JOINTS,
    LONGEST_WAIT,
    LOOK_AGAIN,
    LOOP,
    POLYHEDRA,
    SHARED,
    STEPPED_JOINTS,
    SUBSTEPPED,
    UNDER_FORCES,
    KernelPart,
)
from rigidimpulse.model.contact_memory import grown, keep_wrenches, make_memory
from rigidimpulse.model.contacts import Contacts, Touching
from rigidimpulse.model.island import empty_contacts
from rigidimpulse.motion.evaluate import bring_all, bring_gyroscopic, refresh_pose
from rigidimpulse.motion.trajectory import FREE, Load, take
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.recorder import Recorder
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import HingeJoint
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

STEP = 1.0 / 60.0
RARELY = 100_000
"""Objects between two looks for garbage."""


def _run_of(scene: Scene) -> Run:
    """A run of a scene that nothing has happened in yet."""
    world = compile_scene(scene)
    return make_run(world, make_plan(world), Recorder(np.array([0.0, 1.0]), 2), EventLog())


def _on_floor(kind: str) -> Run:
    """A run of a scene that has a contact from the start, and what kernels of a kind are for."""
    scene = Scene(bodies=[Body("floor", Shape.half_space(), motion="static")])
    shape = Shape.capsule(0.5, 1.0) if kind == ANY_SHAPES else Shape.box((1, 1, 1))
    scene.add(Body("body", shape, position=(0, 0, 0.5), velocity=(0, 0, -1)))
    if kind in (JOINTS, STEPPED_JOINTS, JOINED_UNDER_FORCES):
        scene.add(HingeJoint("body", None, (0, 0, 1), (1, 0, 0)))
    return _run_of(scene)


def _contact() -> Contacts:
    """One contact of the two bodies."""
    contacts = empty_contacts(1)
    for column in contacts:
        column[...] = 0
    contacts.body_b[:] = 1
    contacts.normal[:] = (0.0, 0.0, 1.0)
    return contacts


def _hold(run: Run) -> None:
    """Lasting contacts."""
    state, world, now, one, contacts = run.state, run.world, run.state.now, np.ones(1), _contact()
    members = np.array([1])
    problem, turning = _held(run, contacts)
    needs_correction(contacts, np.ones(1, bool), np.ones(1, bool), one)
    which = np.zeros(1, bool)
    correct_positions(now, contacts, Sunk(which, which, np.zeros(1)), members, run.column)
    refresh_pose(members, now, state.rotation, state.trajectory.inertia)
    bring_gyroscopic(members, now, state.rotation, state.trajectory.inertia, run.angular_acceleration)
    _record(run, contacts, members)
    solve_newton(make_rows.py_func(0), 1, 1.0)
    limits = StepLimits(1.0, 1.0, state.sub_step, state.under_contact)
    rolling = rolling_of(world.rolling, world.material_of_body, now, contacts)
    turns(turning.motion, 1.0)
    held = hold_turning(None, None, problem, turning, run.error_estimate, limits, Forces(np.zeros((1, 3)), run.wrench), rolling)
    state.remember(1)
    keep_wrenches(state.memory, world.num_bodies, 0.0, contacts, held.force, held.slides)
    note_end_energy(state.limiter, now, world.constants, members)
    limit_energy(state.limiter, now, world.constants, state.trajectory, members, 0.0, which, np.empty(1))
    stands_still(problem, world.constants, contacts, run.wrench, 1.0)


def _respond_and_detect(run: Run) -> None:
    """Impulses, and what the steps of a body that falls and rests call besides."""
    start_trajectories(run)
    pair_events = PairEvents(run, 1.0 / 60.0)
    pair_events.find_pairs()
    islands, _ = touching_islands(run, pair_events, 0.0, np.array([1]))
    island = islands[0]
    respond(run, pair_events, island)
    pair_events.bodies_at(0.0)
    pair_events.count_contacts(0.0)
    _take_steps(run)
    points_inside(run.world.geometry, 1, np.zeros((1, 3)))
    crossings(run.world.geometry, 1, np.zeros((1, 3)), np.ones((1, 3)))
    enter_with_edges(parts_of([], []), np.zeros((1, 2, 3)), np.eye(3)[None], np.zeros((1, 3)), np.zeros(1))


def _held(run: Run, contacts: Contacts) -> tuple[ContactProblem, Turning]:
    """The contact as a lasting one."""
    state, world, members = run.state, run.world, np.array([1])
    state.now.inv_inertia[1] = np.eye(3)
    touching = Touching(np.zeros(1, np.int64), np.zeros((1, 2), np.int64))
    motion = contact_motion(
        world.geometry, world.shape_of_body, state.rotation, state.now, contacts, touching.kind, touching.feature
    )
    problem = ContactProblem(
        state.now, contacts, members, run.column, motion.turning, run.acceleration, run.angular_acceleration
    )
    return problem, Turning(motion, touching, np.ones(1))


def _take_steps(run: Run) -> None:
    """Some steps of the loop in Python."""
    run.recorder.start(run.state.trajectory)
    for number in range(1, 4):
        step(run, number * STEP, number * STEP)


def _record(run: Run, contacts: Contacts, members: np.ndarray) -> None:
    """Lasting contacts and their work."""
    run.contact_log.replace(members, 0.0, contacts, run.state.now.position, np.ones((1, 3)))
    run.contact_log.close(members, 1.0)
    run.contact_log.table()
    run.log.add_stretch(0.0, 1.0, 1, 0.0, 0.0, False)
    # At the end a run looks which bodies belong together.
    roots(1, members[:0], members[:0])


def _move_and_sweep(run: Run) -> None:
    """Rows of contacts, trajectories, frames and the sweep."""
    _fill_rows(run)
    _move(run)


def _fill_rows(run: Run) -> None:
    now, contacts, members = run.state.now, _contact(), np.array([1])
    now.inv_inertia[1] = np.eye(3)
    rows, first_row, frames = contact_rows(now, contacts, members, run.column, 0)
    row_velocities(now, contacts, first_row, frames, rows.bias)
    response_to(rows, 1, rows.impulse)
    change_velocities(now, members, rows)
    changes_of(now, members, rows)


def _move(run: Run) -> None:
    state, now, world = run.state, run.state.now, run.world
    zero = np.zeros(1)
    start_trajectories(run)
    run.recorder.start(state.trajectory)
    run.recorder.flush(state.trajectory, 1, 2.0, np.zeros(6))
    bring_all(state.trajectory, np.array([1]), 0.0, now, state.rotation, run.acceleration, run.angular_acceleration)
    take(state.trajectory, 1, 0.0, now, Load(*np.zeros((4, 3))), FREE)
    take_steady_load(run.motion, world.constants, 1, 0.0, np.zeros(6), False)
    pair_events = PairEvents(run, 1.0 / 60.0)
    pair_events.find_pairs()
    pair_events.trajectory_changed(1, 0.0)
    grown(make_memory(world.num_bodies), 1)
    set_impact_margins(pair_events.table, np.zeros(0, np.int64), np.zeros(0), np.zeros(0, bool), 0.0, world.dynamic)
    pair = PairsToSweep(np.array([0]), np.array([1]), zero, zero, zero, zero + 1.0 / 60.0)
    bisection.sweep(run.detector, state.trajectory, pair, 1.0 / 60.0)


def _stand_beside_sub_steps(run: Run) -> None:
    """What sub-stepped islands call beside their steps: pairs, which of them are stepped, trajectories between the steps."""
    world, state, members, member = run.world, run.state, np.array([1]), np.array([False, True])
    stepper = ContactStepper(world, world.dynamic, COARSE)
    near = stepper.near(run, member, STEP)
    stepper.table.free[:, 0] = stepper.table.free[:, 1]
    stepper.table.pack()
    label, none, links = np.array([-1, 1]), np.zeros(world.num_bodies), np.zeros((0, 2), np.int64)
    root, steady = np.zeros(world.num_bodies, np.int64), world.steady_acceleration
    candidates = Candidates(
        world.dynamic, world.moving, ~member, world.mass, stepper.inner, steady, world.steady_strength, label, none, ~member,
        ~member,
    )  # fmt: skip
    _take_undisturbed_step(run, stepper, candidates)
    gather_members(run.motion, candidates, 0.0, (1.0, 1.0), member)
    connect_members(near, links, candidates, member, root, Near(~member, ~member))
    settle_islands(state.now, candidates, near, links, member, root, ~member, 1.0)
    CheapestRegime(~member).refusals(root, label, ~member, Near(member, ~member), none)
    energies_of_islands(state.now, world.constants, members, label, np.zeros((3, 1)), np.zeros((4, world.num_bodies)))
    MemberPaths(world, label).end(run, members, 0.0)
    stepper.end_of(state.now, members, stepper.at_once, (0.0, STEP))
    refusals(world, Judged(root, member, ~member, member, member, none), (near[0], near[1]), True)
    support_levels(stepper.bodies, stepper.table.pairs, stepper.table.points, TALL)
    poses, now = (np.zeros((1, 3)), np.zeros((1, 4)), np.zeros((1, 6))), state.now
    depart(state.trajectory, members, 0.0, STEP, now, *poses)
    let_fly(state.trajectory, members, steady)
    mark_slow(now, stepper.inner, (1.0, 1.0), np.array([False, True]))
    of_sleep = world.steady_strength, stepper.inner, stepper.skin
    advance_sleep_timers(members, poses, of_sleep, STEP, np.zeros((2, 7)), np.zeros(2))


def _take_undisturbed_step(run: Run, stepper: ContactStepper, candidates: Candidates) -> None:
    """What a step calls in which nothing moves but members, beside its sub-steps."""
    world, state, n, member = run.world, run.state, run.world.num_bodies, np.array([False, True])
    choice = Choice(
        KEEPS_CHEAP, (1.0, 1.0), 1.0, run.substepped.counts, CheapestRegime(~member).costs, member.copy(), member.copy(),
        np.zeros(n, np.int64), Near(~member, ~member), np.zeros((0, 2), np.int64), ~member,
    )  # fmt: skip
    landing = Landing(
        world.constants, candidates.label, np.zeros((4, n)), np.zeros((n, 7)), np.zeros(n), stepper.inner, stepper.skin,
    )  # fmt: skip
    is_undisturbed(state.trajectory, world.constants)
    pairs = stepper.table.pairs
    begin_undisturbed_step(choice, candidates, stepper.around, run.motion, pairs, stepper.fat_boxes.space_for(pairs), (0.0, STEP))
    stepper.load(run, np.array([1]), np.array([0]), STEP)
    reached = np.zeros((1, 3)), np.zeros((1, 4)), np.zeros((1, 6)), np.zeros((3, 1))
    recorded = run.recorder.frames, run.recorder.written
    land_members(landing, run.motion, state.correction, recorded, np.array([1]), reached, (0.0, STEP))


def _step_island(run: Run, sharing: Sharing | None = None) -> None:
    """Steps of a sub-stepped island."""
    run.state.now.inv_inertia[1] = np.eye(3)
    stepper = ContactStepper(run.world, run.world.dynamic, COARSE, sharing)
    stepper.set_up(run, np.array([1]), np.array([0]), STEP)
    stepper.move_apart(run, np.array([1]), 0.0)
    stepper.step(run, 0.0, STEP)


def _share_island(run: Run) -> None:
    """The same of any, however little there is to do."""
    _step_island(run, Sharing(most_cores=2, pairs=-1, general_pairs=-1, batches=-1))


def _jointed_box(run: Run) -> JointedIsland:
    """The joint of the box, and the box."""
    state, joints = run.state, run.joints
    assert isinstance(joints, JointState)
    return JointedIsland(
        joints.table, np.array([0]), state.now, state.rotation, np.array([1]), run.column, joints.memory, 1.0
    )


def _start_joints(run: Run) -> None:
    """Rows of joints at the start of a sub-step and at impacts, and those that close them."""
    island = _jointed_box(run)
    rows = make_rows.py_func(int(count_joint_rows(island.joints, island.which)))
    fill_closing_rows(island, rows, 0)
    start_joint_rows(island, STEP, rows, 0)
    impact_rows(island, run.joints.moment)
    fill_rates(island, rows)


def _close_and_stop_joints(run: Run) -> None:
    """Rows of joints at the end of a sub-step."""
    island = _jointed_box(run)
    count = int(count_joint_rows.py_func(island.joints, island.which))
    rows = make_rows.py_func(count)
    close_at_end(island, run.acceleration, STEP, rows, 0, np.zeros(count), run.wrench)
    stop_rows(island, np.zeros(1))


def _fly_on_joints(run: Run) -> None:
    """Flights of bodies that joints hold, and the switches of limits on the way."""
    island, joints = _jointed_box(run), run.joints
    assert isinstance(joints, JointState)
    fly(island, joints.flights.flight, run.acceleration, STEP, WHOLE)
    next_switch(joints.table, island.which, joints.memory, (STEP, STEP), 1.0)


def _fly_under_forces(run: Run) -> None:
    """Flights of bodies that joints hold, under forces that vary."""
    island, joints = _jointed_box(run), run.joints
    assert isinstance(joints, JointState)
    stages = make_stages.py_func(1, make_rows.py_func(int(count_joint_rows.py_func(island.joints, island.which))))
    take_stage(island, joints.flights.flight, stages, run.world.steady_acceleration, STEP, BEGIN)
    next_length(STEP, STEP, 1.0)


def _touch_with_joints(run: Run) -> None:
    """Contacts of bodies with joints, and what the steps of such bodies call besides: by then others have compiled their parts."""
    problem, turning = _held(run, _contact())
    estimate_error(problem, turning, run.error_estimate, Forces(np.zeros((1, 3)), run.wrench), STEP, STEP)
    start_trajectories(run)
    run.pose_matrix(1, 0.0)
    _take_steps(run)


def _step_jointed(run: Run) -> None:
    """Joints and contacts of sub-stepped islands, solved together."""
    stepper = ContactStepper(run.world, run.world.dynamic, COARSE)
    joints = JointedStepper(run, stepper)
    run.state.now.inv_inertia[1] = np.eye(3)
    member, support = np.array([[1], [0]])
    joints.step(run, member, (0.0, STEP), lambda fineness: stepper.load(run, member, support, STEP, fineness=fineness))


def _step_any_shapes(run: Run) -> None:
    """Steps of a capsule in a sub-stepped island, and gaps of pairs, which tell what is inside others."""
    posed = Posed(0, np.zeros(3), np.eye(3)), Posed(1, np.zeros(3), np.eye(3))
    pair_gap(run.world.geometry, *posed, 1.0, np.zeros(7))
    _step_island(run)
    _share_island(run)


def _hold_under_forces(run: Run) -> None:
    """Contact forces beside forces that vary: then the loop in Python calls their kernel."""
    problem, turning = _held(run, _contact())
    limits, forces = StepLimits(1.0, 1.0, run.state.sub_step, run.state.under_contact), Forces(np.zeros((1, 3)), run.wrench)
    hold_turning(None, lambda h: h, problem, turning, run.error_estimate, limits, forces, NO_ROLLING)


def _fly_balls(_run: Run) -> None:
    """The event kernel; it knows balls only."""
    scene = Scene(bodies=[Body("floor", Shape.half_space(), motion="static"), Body("ball", Shape.sphere(1.0), position=(0, 0, 9))])
    run = _run_of(scene)
    start_trajectories(run)
    EventRun(run).fly(1.0)


def _go_from_event_to_event(run: Run) -> None:
    """The compiled order of events."""
    start_trajectories(run)
    loop, pair_events = CompiledLoop(run), PairEvents(run, STEP)
    pair_events.find_pairs()
    loop.advance(run, pair_events, (0.0, pair_events.active_bodies()), STEP)
    loop.say_compiled()


PARTS = {
    CONTACTS: (_respond_and_detect, _hold, _move_and_sweep),
    EVENTS: (_fly_balls,),
    SUBSTEPPED: (_stand_beside_sub_steps,),
    POLYHEDRA: (_step_island,),
    SHARED: (_share_island,),
    JOINTS: (_start_joints, _close_and_stop_joints, _fly_on_joints, _touch_with_joints),
    STEPPED_JOINTS: (_step_jointed,),
    ANY_SHAPES: (_step_any_shapes,),
    UNDER_FORCES: (_hold_under_forces,),
    JOINED_UNDER_FORCES: (_fly_under_forces,),
    LOOP: (_go_from_event_to_event,),
}
"""What is compiled at once, by kind; each gets a run."""


def compile_part(kind: str, part: int) -> None:
    """Compile one part."""
    PARTS[kind][part](_on_floor(kind))


def compile_in_turn(parts: Sequence[KernelPart], patience: float = LONGEST_WAIT) -> list[str]:
    """Compile parts that no other process compiles, one after the other, then wait for those that others do.

    A part that another process leaves undone is compiled here, and so is one that is not done in `patience` times the seconds that it
    takes. What could not be compiled is returned in words, with the part first.

    Raises:
        OSError: no file can be made to claim a part with.

    """
    left, failed, idle_since = list(parts), [], time.monotonic()
    while left:
        number = len(left)
        for part in tuple(left):
            is_late = time.monotonic() - idle_since > patience * part.seconds
            with _claimed(part) as is_mine:
                if is_mine or is_late:
                    failed += _compiled(part)
                    left.remove(part)
                    idle_since = time.monotonic()
        if len(left) == number:
            time.sleep(LOOK_AGAIN)
    return failed


@contextmanager
def _claimed(part: KernelPart) -> Iterator[bool]:
    """Claim a part; gives whether that worked."""
    held = part.claim()
    try:
        yield held is not None
    finally:
        if held is not None:
            held.close()


def _compiled(part: KernelPart) -> list[str]:
    """Compile a part, unless that was done; returns what went wrong."""
    if part.note().exists():
        return []
    try:
        with _with_rare_garbage_collection():
            compile_part(part.kind, part.number)
    except Exception as error:
        return [f"{part}: {type(error).__name__}: {error}"]
    part.note().touch()
    return []


@contextmanager
def _with_rare_garbage_collection() -> Iterator[None]:
    """Compilers make many objects and hardly any garbage: looking for it as often as usual takes a sixth of their time.

    Without looking at all, a process needs 1.5 GB where 0.7 GB are enough.
    """
    usual = gc.get_threshold()
    gc.set_threshold(RARELY, *usual[1:])
    try:
        yield
    finally:
        gc.set_threshold(*usual)


if __name__ == "__main__":
    asked = [KernelPart(kind, int(number)) for kind, number in zip(sys.argv[1::2], sys.argv[2::2], strict=True)]
    if asked == [KernelPart(LOOP)] and hasattr(os, "nice"):
        os.nice(10)  # Nobody waits for it.
    for line in compile_in_turn(asked):
        sys.stderr.write(f"{line}\n")
