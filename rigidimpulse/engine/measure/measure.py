"""Measures a run at its recorded frames and reports what a sound run does not show."""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import multiply
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.measure.energy import energy_faults
from rigidimpulse.engine.measure.energy_taken import energy_taken_faults
from rigidimpulse.engine.measure.momentum import momentum_faults
from rigidimpulse.engine.measure.overlap import overlap_faults
from rigidimpulse.engine.measure.record import Fault, RunRecord
from rigidimpulse.engine.measure.tunnelling import tunnelling_faults
from rigidimpulse.engine.regime import jointed
from rigidimpulse.model.world import World
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.impulses import Impulses
from rigidimpulse.recording.ledger import Ledger
from rigidimpulse.recording.recorder import Frames
from rigidimpulse.recording.recording import Recording


def record_of(world: World, frames: Frames, ledger: Ledger, by_cause: Impulses) -> RunRecord:
    """The record of a run; frames: of principal frames, by_cause: what bodies exchanged."""
    exchanged = [(i, other) for i in np.flatnonzero(world.dynamic).tolist() for _, other in by_cause.accounts.of(i)]
    touched = [np.array(exchanged, np.int64).reshape(-1, 2), np.column_stack([by_cause.impacts["body_a"], by_cause.impacts["body_b"]])]
    forced = np.zeros(world.num_bodies, bool)
    if by_cause.forces is not None:
        forced[by_cause.forces.body] = True
    if world.joints_of_scene:
        touched.append(np.column_stack([world.joints.body_a, world.joints.body_b]))
    # As one number each: numpy takes ten times as long to sort rows.
    base, ends = world.num_bodies + 1, np.concatenate(touched) + 1
    pairs = np.column_stack(np.divmod(np.unique(ends[:, 0] * base + ends[:, 1]), base)) - 1
    return RunRecord(world, frames, ledger, by_cause.release, pairs, forced, jointed(world))


def record_of_recording(run: Recording) -> RunRecord:
    """The record of a recording that `simulate` returned.

    Raises:
        SceneError: for a recording that was loaded from a file.

    """
    if run.scene is None or run.settings is None or run.ledger is None or run.by_cause is None:
        raise SceneError("a loaded recording cannot be measured", "ask the run that simulate() returned")
    world = compile_scene(run.scene, run.settings.accuracy)
    orientation = multiply(run.orientations, world.turn)
    frames = Frames(run.times, run.centers, orientation, run.velocities, run.angular_velocities)
    return record_of(world, frames, run.ledger, run.by_cause)


def measured_faults(record: RunRecord) -> list[Fault]:
    """All that is wrong with a run, in order of time; nothing is looked for in states that are not finite."""
    frames = record.frames
    if len(frames.times) < 2 or not all(np.isfinite(part).all() for part in frames):
        return []
    measures = (energy_faults, energy_taken_faults, momentum_faults, overlap_faults, tunnelling_faults)
    return sorted((fault for measure in measures for fault in measure(record)), key=lambda fault: fault.time)


def report_measured(record: RunRecord, log: EventLog) -> None:
    """Report the faults as problems."""
    for fault in measured_faults(record):
        log.report(fault.time, fault.kind, fault.bodies, fault.message)
