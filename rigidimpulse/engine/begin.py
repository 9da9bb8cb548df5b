"""The start of a run: plan, participants and first trajectories are made, and overlap is removed."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.kernels import INTERPRETED
from rigidimpulse.dynamics.forces import KINDS
from rigidimpulse.engine.effects import EventKernel, FclNarrowPhase, SubsteppedContact, TriggerVolumes, all_effects
from rigidimpulse.engine.exact.compiled_loop import CompiledLoop
from rigidimpulse.engine.exact.compiled_loop import why_not as why_not_compiled
from rigidimpulse.engine.exact.joints import JointState
from rigidimpulse.engine.initial_overlap import resolve_overlaps
from rigidimpulse.engine.keyframe_paths import KeyframePaths
from rigidimpulse.engine.regime import only_expensive, why_not_substepped
from rigidimpulse.engine.run import Run, start_trajectories
from rigidimpulse.engine.substepped.advance import SubsteppedIslands
from rigidimpulse.engine.tight_fits import make_space
from rigidimpulse.engine.warm_up import compile_loop_in_background, prepare_kernels
from rigidimpulse.model.plan import Plan
from rigidimpulse.model.world import World
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.recorder import Recorder

if TYPE_CHECKING:
    from rigidimpulse.engine.earlier_run import EarlierRun


def make_plan(world: World, chosen: Mapping[str, bool] | None = None) -> Plan:
    """Bind all effects to the world; the plan keeps those that the scene calls for, and follows the caller's choice by name."""
    return Plan(world, all_effects(world), chosen)


def begin_run(world: World, plan: Plan, times: np.ndarray, left_out: Mapping[str, str], earlier: EarlierRun | None = None) -> Run:
    """A run at its start, the time of its first frame: kernels compiled, participants bound, bodies apart.

    Args:
        world: the compiled scene.
        plan: of its effects.
        times: (f,) s, of the frames.
        left_out: effects that the caller leaves out though the scene calls for them, and why it does.
        earlier: a run before a change of the scene, in whose middle this one begins.

    """
    with_substepped = plan.includes(SubsteppedContact.name) and not only_expensive(world)
    prepare_kernels(world, plan.includes(EventKernel.name), with_substepped)
    run = _start(world, plan, times)
    placed = make_space(run) if earlier is None else earlier.placed(make_space(run))
    run = run if placed is world else _start(placed, plan, times)
    if earlier is not None:
        earlier.follow_keyframes(run)
    run.recorder.start(run.state.trajectory)
    for name, reason in left_out.items():
        run.log.report(0.0, "effect left out", (name,), f"the scene calls for it: {reason}")
    resolve_overlaps(run)
    if earlier is None:
        run.joints.report_start(run)
    else:
        # After it: what is moved apart does not go on as it was.
        earlier.carry_on(run)
    _bind_observers(run)
    bind_compiled_loop(run)
    return run


def _start(world: World, plan: Plan, times: np.ndarray) -> Run:
    """A run whose bodies have their first trajectories; times (f,) s, of the frames."""
    run = make_run(world, plan, Recorder(times, world.num_bodies), EventLog())
    _bind_forces(run, times)
    run.keyframes = KeyframePaths(world)
    start_trajectories(run)
    return run


def make_run(world: World, plan: Plan, recorder: Recorder, log: EventLog) -> Run:
    """A run with the participants that hold contacts and joints."""
    run = Run(world, plan, recorder, log)
    if plan.includes(FclNarrowPhase.name):
        from rigidimpulse.engine.fcl_contacts import FclContacts

        run.narrow_phase = FclContacts(run)
    if world.joints_of_scene:
        run.joints = JointState(world, recorder.times)
    if not why_not_substepped(world):
        run.substepped = SubsteppedIslands(world)
    return run


def bind_compiled_loop(run: Run) -> None:
    """Give a run the compiled order of events if it is in the cache; if not, have it compiled for the runs to come."""
    if INTERPRETED or why_not_compiled(run.world, run.plan):
        return
    compiled = CompiledLoop(run)
    if compiled.is_compiled():
        run.compiled = compiled
    else:
        compile_loop_in_background()


def _bind_forces(run: Run, times: np.ndarray) -> None:
    """Give a run its varying forces and soft bodies, if the scene has any; their modules are imported here only."""
    world = run.world
    if not world.force_tables:
        return
    from rigidimpulse.engine.varying_forces import VaryingForces

    clocks = {table.kind: partial(run.plan.clock, table.kind) for table in world.force_tables}
    run.forces = VaryingForces(world, run.state.trajectory, times, clocks)
    soft_bodies = [table for table in world.force_tables if table.kind == KINDS["FlexibleBody"]]
    if soft_bodies:
        from rigidimpulse.engine.soft_bodies import RunningSoftBodies

        run.soft_bodies = RunningSoftBodies(run, soft_bodies[0], times, clocks[soft_bodies[0].kind])


def _bind_observers(run: Run) -> None:
    """Give a run its triggers and the kernel of balls, if the plan has them in."""
    if run.plan.includes(TriggerVolumes.name):
        from rigidimpulse.engine.triggers import Triggers

        with run.plan.clock(TriggerVolumes.name):
            run.triggers = Triggers(run, run.world.triggers)
    if run.plan.includes(EventKernel.name):
        from rigidimpulse.engine.spheres.run import EventRun

        run.flight = EventRun(run)
