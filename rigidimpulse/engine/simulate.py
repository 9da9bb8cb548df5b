"""Run a scene: compile it, plan it, step it, and return the recording."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.providers import provider
from rigidimpulse.engine.begin import begin_run, make_plan
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.effects import EventKernel
from rigidimpulse.engine.loop import run_to_end
from rigidimpulse.engine.recording_of import finish_run
from rigidimpulse.engine.run import Run
from rigidimpulse.recording.profile import Stopwatch
from rigidimpulse.recording.recording import Recording, RunSettings
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.frame_times import frame_times
from rigidimpulse.scene.scene import Scene

if TYPE_CHECKING:
    from rigidimpulse.recording.cache import Cache
    from rigidimpulse.scene.accuracy_targets import AccuracyTarget

MOST_POSES = 1_000_000_000
"""Frames times bodies that are refused as a slip of the keyboard (about 100 GB)."""


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
        accuracy: "preview", "standard", "exact" or an `Accuracy`; or an accuracy target, `Within` or `InTime`: it chooses one by measuring.
        effects: effects to enable (True) or to leave out (False), by their names in `run.plan.explain()`. The status names an effect that
            is left out although the scene calls for it.
        progress: called with the simulated time in s after every step, or once for many steps in which only impacts of balls happened.
        cache: an .h5 file that is written while the run goes on, with a checkpoint every few seconds; see `Cache`. If the file exists, the
            run continues from its last checkpoint and ends with the same bits; a finished run is read. Needs the extra `cache`.

    Returns:
        The recording, with round(duration * fps) + 1 frames; the first is the initial state.

    Raises:
        SceneError: the scene cannot be simulated as it is; names the body, the value and the remedy. Or an effect is unknown, cannot be
            enabled or cannot be left out. Or the cache is of another scene, of other settings or of another version.

    """
    if isinstance(accuracy, str | Accuracy):
        return _simulate(scene, duration, fps, accuracy, effects, progress, cache)
    if cache is not None:
        raise SceneError("a cache for an accuracy that is still to be chosen", "choose it first, and give run.choice.accuracy")
    return provider("simulate to target")(scene, duration, fps, accuracy, effects, progress)


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
    run = prepare(scene, frame_times(duration, fps), accuracy, effects)
    settings = RunSettings(float(duration), float(fps), run.world.accuracy, dict(effects or {}))
    if cache is None:
        recording = complete(run, duration, progress)
    else:
        with closing(provider("checkpoints")(cache, settings, run)) as checkpointer:
            run_to_end(checkpointer.run, duration, lambda time: checkpointer.look(time, progress))
            checkpointer.write(float(duration))
            recording = finish_run(checkpointer.run, duration)
            checkpointer.finish(recording)
    return replace(recording, profile=stopwatch.read(run.plan), settings=settings)


def prepare(
    scene: Scene, times: np.ndarray, accuracy: str | Accuracy = "standard", effects: Mapping[str, bool] | None = None
) -> Run:
    """A run of a scene at its start, with frames at times (f,) s, for `complete`."""
    left_out = chosen_out(scene, accuracy, effects)
    world = compile_scene(scene, accuracy, frozenset(left_out))
    if len(times) * world.num_bodies > MOST_POSES:
        raise SceneError(f"{len(times)} frames of {world.num_bodies} bodies", "lower the fps or the duration")
    return begin_run(world, make_plan(world, effects), times, left_out)


def complete(run: Run, duration: float, progress: Callable[[float], None] | None = None) -> Recording:
    """Step a run to its end at `duration` [s]; hand back what was recorded."""
    run_to_end(run, duration, progress)
    return finish_run(run, duration)


def chosen_out(scene: Scene, accuracy: str | Accuracy, effects: Mapping[str, bool] | None) -> dict[str, str]:
    """Names of the effects that the caller leaves out although the scene calls for them, and why it does."""
    if not effects:
        return {}
    lines = {line.name: line for line in make_plan(compile_scene(scene, accuracy)).lines}
    for name in effects:
        if name not in lines:
            raise unknown_name("effect", name, lines)
    out = {name: lines[name].reason for name, wanted in effects.items() if not wanted and lines[name].included}
    out.pop(EventKernel.name, None)  # it changes no result
    return out
