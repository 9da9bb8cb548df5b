"""Run a scene: compile it, plan it, step it, and hand back what was recorded."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.dynamics.forces.constant import ConstantForces
from rigidimpulse.dynamics.forces.gravity import FreeRotation, Gravity, SteadyLoad
from rigidimpulse.dynamics.forces.kinds import bind_forces, force_kinds
from rigidimpulse.engine.broad_phase_effect import BroadPhase
from rigidimpulse.engine.constraint_effects import Friction, JointRows, RollingFriction, SubsteppedContact
from rigidimpulse.engine.exact.contact_forces import ContactForces
from rigidimpulse.engine.exact.forced_trajectories import ForcedFlight, VaryingLoad
from rigidimpulse.engine.exact.impacts import ImpactResponse
from rigidimpulse.engine.exact.joints import reaction_table
from rigidimpulse.engine.exact.trajectories import ExactFlight
from rigidimpulse.engine.impact_time import ImpactTime
from rigidimpulse.engine.initial_overlap import resolve_overlaps
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.plan import Plan
from rigidimpulse.engine.regime import only_expensive
from rigidimpulse.engine.spheres.effect import ARRIVED, GO_ON, STEP, EventKernel
from rigidimpulse.engine.step import go_on, react, step
from rigidimpulse.engine.trigger_effect import TriggerVolumes, bind_triggers
from rigidimpulse.engine.warm_up import prepare_kernels
from rigidimpulse.model.state import StepContext
from rigidimpulse.model.world import World, compile_scene
from rigidimpulse.motion.kinematic import KeyframePaths
from rigidimpulse.motion.trajectory import FIXED, FREE, PRESCRIBED, begin
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.impulses import Impulses
from rigidimpulse.recording.ledger import Masses, make_ledger
from rigidimpulse.recording.profile import Stopwatch
from rigidimpulse.recording.recorder import Recorder
from rigidimpulse.recording.recording import Recording, RunSettings, Status
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.frames import own_frames
from rigidimpulse.scene.scene import Scene

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.force_log import ForceWork
    from rigidimpulse.engine.spheres.run import EventRun
    from rigidimpulse.io.cache.checkpointer import Cache
    from rigidimpulse.studies.accuracy_targets import AccuracyTarget

# Frames whose product with the number of bodies is refused as a slip of the keyboard (about 1e9 poses, 100 GB).
MOST_POSES = 1_000_000_000
# Steps at most between two looks at a run that somebody watches.
WATCHED = 64


def simulate(
    scene: Scene,
    duration: float,
    fps: float = 60.0,
    *,
    accuracy: str | Accuracy | AccuracyTarget = "standard",
    effects: Mapping[str, bool] | None = None,
    progress: Callable[[float], None] | None = None,
    cache: str | os.PathLike[str] | Cache | None = None,
) -> Recording:
    """Simulate a scene and record it. Deterministic: the same scene gives the same bits, at any frame rate.

    Args:
        scene: what to simulate; it is not changed.
        duration: s, >= 0.
        fps: frames per second; changes what is recorded, never what happens.
        accuracy: "preview", "standard", "exact" or an `Accuracy`; or a wish, `Within` or `InTime`, that chooses one by measuring the scene.
        effects: effects, by their names in `run.plan.explain()`, that are to be in (True) or out (False) whatever the scene calls for. The
            status says where one is out that the scene calls for.
        progress: called with the simulated time in s after every step, or after many in which nothing but impacts of balls happened.
        cache: an .h5 file that is written while the run goes on, with a checkpoint every few seconds; see `Cache`. Where the file is there
            already the run goes on from its last checkpoint, and ends with the same bits; a finished one is read. Needs the extra `cache`.

    Returns:
        The recording, with round(duration * fps) + 1 frames; the first is the initial state.

    Raises:
        SceneError: the scene cannot be simulated as it is; names the body, the value and the remedy. Or an effect is unknown, cannot be in
            or cannot be out. Or the cache is of another scene, of other settings or of another version.

    """
    if isinstance(accuracy, str | Accuracy):
        return _simulate(scene, duration, fps, accuracy, effects, progress, cache)
    if cache is not None:
        raise SceneError("a cache for an accuracy that is still to be chosen", "choose it first, and give run.choice.accuracy")
    from rigidimpulse.studies.accuracy_targets import simulate_to_target

    return simulate_to_target(scene, duration, fps, accuracy, effects, progress)


def _simulate(
    scene: Scene,
    duration: float,
    fps: float,
    accuracy: str | Accuracy,
    effects: Mapping[str, bool] | None,
    progress: Callable[[float], None] | None,
    cache: str | os.PathLike[str] | Cache | None = None,
) -> Recording:
    """See `simulate`."""
    stopwatch = Stopwatch()
    times = frame_times(duration, fps)
    left_out = chosen_out(scene, accuracy, effects)
    world = compile_scene(scene, accuracy, frozenset(left_out))
    if len(times) * world.num_bodies > MOST_POSES:
        raise SceneError(f"{len(times)} frames of {world.num_bodies} bodies", "lower the fps or the duration")
    plan = make_plan(world, effects)
    prepare_kernels(world, has_effect(plan, EventKernel.name), has_effect(plan, SubsteppedContact.name) and not only_expensive(world))
    recorder = Recorder(times, world.num_bodies)
    log = EventLog()
    for name, reason in left_out.items():
        log.report(0.0, "effect left out", (name,), f"the scene calls for it: {reason}")
    context = StepContext(world, recorder, log)
    bind_forces(context, plan, times)
    paths = KeyframePaths(world)
    start_trajectories(context)
    recorder.start(context.state.trajectory)
    resolve_overlaps(context)
    bind_triggers(context, plan)
    running = Running(context, paths, make_flight(context, plan))
    settings = RunSettings(float(duration), float(fps), world.accuracy, dict(effects or {}))
    if cache is None:
        run_to_end(running, plan, duration, progress)
        run = finish_run(running, plan, duration)
    else:
        from rigidimpulse.io.cache.checkpointer import Checkpointer

        with closing(Checkpointer(cache, settings, running, plan)) as checkpointer:
            run_to_end(checkpointer.running, plan, duration, lambda time: checkpointer.look(time, progress))
            checkpointer.write(float(duration))
            run = finish_run(checkpointer.running, plan, duration)
            checkpointer.finish(run)
    return replace(run, profile=stopwatch.read(plan), settings=settings)


class Running(NamedTuple):
    """A run under way: all that it changes, and what keeps its place in the keyframes and in the event kernel."""

    context: StepContext
    paths: KeyframePaths
    flight: EventRun | None


def run_to_end(running: Running, plan: Plan, duration: float, progress: Callable[[float], None] | None) -> None:
    """Step to the end; a run that is under way goes on from where it is."""
    context, paths, flight = running
    # The last frame may lie after the end by rounding; what happens until the end does not depend on that.
    for end in (float(duration), max(float(duration), float(context.recorder.times[-1]))):
        if plan.steps or context.forces is not None or context.triggers is not None:
            run_steps(context, plan, paths, flight, end, progress)
        else:
            paths.start_segments(context, end)


def finish_run(running: Running, plan: Plan, duration: float) -> Recording:
    """End what is under way at the end, and return the recording."""
    context = running.context
    finish_sub_steps(context, plan, context.state.time)
    if context.substepped is not None:
        context.substepped.close(context, context.state.time)
        plan.tell(SubsteppedContact.name, context.substepped.summary())
    context.recorder.finish(context.state.trajectory)
    return make_recording(context, plan, context.recorder.times, duration)


def frame_times(duration: float, fps: float) -> np.ndarray:
    """Times of round(duration * fps) + 1 frames [s].

    Raises:
        SceneError: duration or fps is not a positive finite number.

    """
    if not (math.isfinite(duration) and duration >= 0.0):
        raise SceneError(f"duration = {duration!r}", "give a finite time in seconds, >= 0")
    if not (math.isfinite(fps) and fps > 0.0):
        raise SceneError(f"fps = {fps!r}", "give a positive number of frames per second")
    return np.arange(round(duration * fps) + 1) / fps


def chosen_out(scene: Scene, accuracy: str | Accuracy, effects: Mapping[str, bool] | None) -> dict[str, str]:
    """Names of effects that are to be out though the scene calls for them, and why it does."""
    if not effects:
        return {}
    lines = {line.name: line for line in make_plan(compile_scene(scene, accuracy)).lines}
    for name in effects:
        if name not in lines:
            raise unknown_name("effect", name, lines)
    out = {name: lines[name].reason for name, wanted in effects.items() if not wanted and lines[name].included}
    out.pop(EventKernel.name, None)  # it changes no result
    return out


def make_plan(world: World, chosen: Mapping[str, bool] | None = None) -> Plan:
    """Bind every effect there is to the world; the plan keeps those that the scene calls for, and obeys what was chosen by name."""
    accuracy = world.accuracy
    effects = [
        BroadPhase(),
        ImpactResponse(accuracy.response, accuracy.restitution),
        Gravity(),
        ConstantForces(),
        *force_kinds(world),
        SteadyLoad(),
        FreeRotation(),
        VaryingLoad(),
        JointRows(),
        Friction(),
        RollingFriction(),
        ContactForces(),
        SubsteppedContact(),
        ImpactTime(accuracy.impact_time),
        EventKernel(),
        ExactFlight(),
        ForcedFlight(),
        TriggerVolumes(),
    ]
    return Plan(world, effects, chosen)


def start_trajectories(context: StepContext) -> None:
    """Give every body its first course."""
    world, trajectory = context.world, context.state.trajectory
    trajectory.position[:], trajectory.orientation[:] = world.position, world.orientation
    trajectory.velocity[:], trajectory.angular_velocity[:] = world.velocity, world.angular_velocity
    trajectory.acceleration[:] = np.where(world.dynamic[:, None], world.steady_acceleration, 0.0)
    trajectory.inertia[:] = world.inertia
    trajectory.mode[:] = np.where(world.dynamic, FREE, np.where(world.moving, PRESCRIBED, FIXED))
    for i in range(world.num_bodies):
        begin(trajectory, i)


def has_effect(plan: Plan, name: str) -> bool:
    """Whether the plan has the effect in."""
    return any(line.included for line in plan.lines if line.name == name)


def make_flight(context: StepContext, plan: Plan) -> EventRun | None:
    """The event kernel, made ready, where the plan has it in."""
    if not has_effect(plan, EventKernel.name):
        return None
    from rigidimpulse.engine.spheres.run import EventRun

    return EventRun(context)


def run_steps(context: StepContext, plan: Plan, paths: KeyframePaths, flight: EventRun | None, end: float, progress) -> None:
    """Step to the end; steps end on the grid of the accuracy's step and at keyframes.

    The event kernel, if there is one, takes all steps in one in which nothing but simple impacts happens.
    """
    size = context.world.accuracy.step
    while context.state.time < end:
        begin = context.state.time
        paths.start_segments(context, begin)
        if context.soft_bodies is None and not np.any(context.state.trajectory.mode != FIXED):
            context.state.time = min(paths.next_key(begin), end)
            continue
        stop = min(paths.next_key(begin), end)
        if progress is not None:
            stop = min(stop, (math.floor(begin / size + 1e-9) + WATCHED) * size)
        how = STEP
        if flight is not None and flight.may_fly():
            how = fly(context, plan, flight, stop)
        if how == STEP:
            index = math.floor(context.state.time / size + 1e-9) + 1
            until = min(index * size, stop)
            step(context, plan, until if context.soft_bodies is None else context.soft_bodies.advance(context, until))
        if context.triggers is not None:
            with plan.clock(TriggerVolumes.name):
                context.triggers.look(begin, context.state.time)
        if progress is not None:
            progress(context.state.time)


def fly(context: StepContext, plan: Plan, flight: EventRun, stop: float) -> int:
    """Let the event kernel take the scene towards `stop` [s], and the loop in Python take over where it cannot; returns how that ends."""
    begin = context.state.time
    with plan.clock(EventKernel.name):
        how, step_begin, until = flight.fly(stop)
    while how == GO_ON:
        go_on(context, plan, step_begin, until, may_leave=context.state.time > begin)
        if context.state.time >= until:
            return ARRIVED
        begin = context.state.time
        with plan.clock(EventKernel.name):
            how, step_begin, until = flight.fly(stop, at_boundary=False)
    return how


def finish_sub_steps(context: StepContext, plan: Plan, end: float) -> None:
    """End the sub-steps of joints and contacts at the end of the run, so that the last frame has the velocities of its instant."""
    state = context.state
    bodies = {i for pair in state.pair_force for i in pair if state.under_contact[i]}
    if context.joints is not None:
        bodies.update(context.joints.moving_bodies(context).tolist())
    if bodies:
        pair_events = PairEvents(context, end)
        plan.run("detect", context, pair_events)
        react(context, plan, pair_events, end, np.array(sorted(bodies)))


def close_stretches(context: StepContext) -> None:
    """Book the courses under contact forces that are still under way."""
    state = context.state
    for i in np.flatnonzero(state.under_contact).tolist():
        context.log.stretches.append((state.trajectory.start[i], np.inf, i, state.energy_at_start[i], 0.0))


def release_times(world: World) -> np.ndarray:
    """When bodies that are carried first are let go, (n,) s; 0 for others."""
    return np.array([0.0 if body.release_time is None else body.release_time for body in world.scene.bodies])


def impulses_by_cause(context: StepContext, times: np.ndarray, impacts: np.ndarray, work: ForceWork | None) -> Impulses:
    """What bodies gained, to be split by cause."""
    world = context.world
    mass = np.where(world.dynamic, world.mass, 0.0)
    return Impulses(
        names=list(world.names),
        times=times,
        pull=mass[:, None, None] * np.stack([world.gravity, world.push], axis=1),
        mass=mass,
        release=release_times(world),
        velocity=context.recorder.velocity,
        accounts=context.impulses,
        forces=work,
        impacts=impacts,
    )


def make_recording(context: StepContext, plan: Plan, times: np.ndarray, duration: float) -> Recording:
    """Body-frame poses, impacts and ledger from what the recorder holds."""
    world, recorder = context.world, context.recorder
    position, orientation = own_frames(recorder.position, recorder.orientation, world.offset, world.turn)
    impacts = context.log.impacts.table()
    close_stretches(context)
    work = None if context.forces is None else context.forces.finish(world, times, recorder)
    mass = np.where(world.dynamic & (times[:, None] >= release_times(world)), world.mass, 0.0)
    ledger = make_ledger(
        recorder.frames._replace(times=times), Masses(mass, world.inertia, world.steady_acceleration), context.log, work
    )
    if context.soft_bodies is not None:
        context.soft_bodies.add_to(ledger)
    contacts = context.contact_log.table()
    return Recording(
        times=times,
        names=list(world.names),
        positions=position,
        orientations=orientation,
        velocities=recorder.velocity,
        angular_velocities=recorder.angular_velocity,
        centers=recorder.position,
        impacts=impacts[impacts["time"] <= duration],
        ledger=ledger,
        status=Status.of(context.log.events),
        plan=plan,
        scene=world.scene,
        reactions=reaction_table(context.joints, times),
        contacts=contacts,
        by_cause=impulses_by_cause(context, times, impacts, work),
        soft_bodies=[] if context.soft_bodies is None else context.soft_bodies.tracks(),
    )
