"""The end of a run: sub-steps and trajectories end, and frames, impacts and ledger become a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.engine.measure.measure import record_of, report_measured
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.step import react
from rigidimpulse.model.contact_memory import bodies_in_sub_steps
from rigidimpulse.model.world import World
from rigidimpulse.recording.events import impact_table
from rigidimpulse.recording.impulses import Impulses
from rigidimpulse.recording.ledger import Masses, make_ledger
from rigidimpulse.recording.recording import SimulatedRecording
from rigidimpulse.recording.status import STOPPED, Status
from rigidimpulse.scene.frames import own_frames

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.force_log import ForceWork


def finish_run(run: Run, duration: float) -> SimulatedRecording:
    """End the sub-steps and trajectories that last beyond the end, and return the recording."""
    finish_sub_steps(run, run.state.time)
    run.substepped.finish(run)
    run.recorder.finish(run.state.trajectory)
    return make_recording(run, duration)


def finish_early(run: Run, duration: float) -> SimulatedRecording:
    """Return the recording of a run that was stopped between two steps, before its end at `duration` [s]: the frames until then."""
    time = run.state.time
    run.keep(int(np.searchsorted(run.recorder.times, time, side="right")))
    run.log.report(
        time, STOPPED, (),
        f"the recording is partial: it ends at {time:.6g} s of {duration:g} s; simulate with a cache to go on from there next time",
    )
    return finish_run(run, time)


def finish_sub_steps(run: Run, end: float) -> None:
    """End the sub-steps of joints and contacts at the end of the run, so that the last frame has the velocities of its instant."""
    state = run.state
    bodies = {i for i in bodies_in_sub_steps(state.memory, len(state.under_contact)).tolist() if state.under_contact[i]}
    bodies.update(run.joints.moving_bodies(run).tolist())
    if bodies:
        pair_events = PairEvents(run, end)
        run.plan.perform(run.plan.pairs, run, pair_events)
        react(run, pair_events, end, np.array(sorted(bodies)))


def close_stretches(run: Run) -> None:
    """Account for the trajectories under contact forces that are still under way."""
    state = run.state
    for i in np.flatnonzero(state.under_contact).tolist():
        run.log.add_stretch(state.trajectory.start[i], np.inf, i, state.limiter.energy_at_start[i], 0.0, bool(state.by_joints[i]))


def release_times(world: World) -> np.ndarray:
    """When bodies that are carried first are let go, (n,) s; 0 for others."""
    return np.array([0.0 if body.release_time is None else body.release_time for body in world.scene.bodies])


def impulses_by_cause(run: Run, times: np.ndarray, impacts: np.ndarray, work: ForceWork | None) -> Impulses:
    """What bodies gained, to be split by cause."""
    world = run.world
    mass = np.where(world.dynamic, world.mass, 0.0)
    return Impulses(
        names=list(world.names),
        times=times,
        pull=mass[:, None, None] * np.stack([world.gravity, world.push], axis=1),
        mass=mass,
        release=release_times(world),
        velocity=run.recorder.velocity,
        accounts=run.impulses,
        forces=work,
        impacts=impacts,
    )


def make_recording(run: Run, duration: float) -> SimulatedRecording:
    """Body-frame poses, impacts and ledger from what the recorder holds."""
    world, recorder, times = run.world, run.recorder, run.recorder.times
    position, orientation = own_frames(recorder.position, recorder.orientation, world.offset, world.turn)
    impacts = impact_table(run.log.impacts)
    close_stretches(run)
    work = run.forces.finish(world, times, recorder)
    mass = np.where(world.dynamic & (times[:, None] >= release_times(world)), world.mass, 0.0)
    ledger = make_ledger(recorder.frames._replace(times=times), Masses(mass, world.inertia, world.steady_acceleration), run.log, work)
    run.soft_bodies.add_to(ledger)
    contacts = run.contact_log.table()
    run.joints.log.add_to(run.impulses)
    by_cause = impulses_by_cause(run, times, impacts, work)
    report_measured(record_of(world, recorder.frames._replace(times=times), ledger, by_cause), run.log)
    return SimulatedRecording(
        times=times,
        names=list(world.names),
        positions=position,
        orientations=orientation,
        velocities=recorder.velocity,
        angular_velocities=recorder.angular_velocity,
        centers=recorder.position,
        impacts=impacts[impacts["time"] <= duration],
        ledger=ledger,
        status=Status.of(run.log.events),
        plan=run.plan,
        scene=world.scene,
        reactions=run.joints.log.reactions(times),
        contacts=contacts,
        by_cause=by_cause,
        soft_bodies=run.soft_bodies.tracks(),
    )
