"""Run a scene: compile it, plan it, step it, and return the recording."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.kernels import forget_calls
from rigidimpulse.core.providers import provider
from rigidimpulse.engine.begin import begin_run, make_plan
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.early_end import Stopped, interruptible, memory_told
from rigidimpulse.engine.effects import EventKernel
from rigidimpulse.engine.loop import run_to_end
from rigidimpulse.engine.recording_of import finish_early, finish_run
from rigidimpulse.engine.run import Run
from rigidimpulse.recording.joined import joined_runs
from rigidimpulse.recording.profile import Stopwatch
from rigidimpulse.recording.recording import RunSettings, SimulatedRecording
from rigidimpulse.scene.accuracy import Accuracy, Preset
from rigidimpulse.scene.frame_times import frame_times
from rigidimpulse.scene.scene import Scene

if TYPE_CHECKING:
    from rigidimpulse.engine.earlier_run import EarlierRun
    from rigidimpulse.recording.cache import Cache
    from rigidimpulse.scene.accuracy_targets import AccuracyTarget

Progress: TypeAlias = Callable[[float], None]
Listening: TypeAlias = Callable[[Progress | None], AbstractContextManager[Progress | None]]
MOST_POSES = 1_000_000_000
"""Frames times bodies that are refused as a slip of the keyboard (about 100 GB)."""


def simulate(
    scene: Scene,
    duration: float,
    fps: float = 60.0,
    *,
    accuracy: Preset | Accuracy | AccuracyTarget = "standard",
    effects: Mapping[str, bool] | None = None,
    progress: Callable[[float], None] | None = None,
    cache: str | os.PathLike[str] | Cache | None = None,
    from_frame: int | None = None,
) -> SimulatedRecording:
    """Simulate a scene and record it. Deterministic: the same scene gives the same bits, at any frame rate.

    With joints the frame rate changes round-off, because what is recorded of them is integrated to the frames.

    Args:
        scene: what to simulate; it is not changed.
        duration: s, >= 0.
        fps: frames per second; changes what is recorded, never what happens.
        accuracy: "preview", "standard", "exact" or an `Accuracy`; or an accuracy target, `Within` or `InTime`: it chooses one by measuring.
        effects: effects to enable (True) or to leave out (False), by their names in `run.plan.explain()`. The status names an effect that
            is left out although the scene calls for it.
        progress: called with the simulated time in s after every step, or once for many steps in which only impacts of balls happened.
            It may raise KeyboardInterrupt to stop the run there.
        cache: an .h5 file that is written while the run goes on, with a checkpoint every few seconds; see `Cache`. If the file exists, the
            run continues from its last checkpoint and ends with the same bits; a finished run is read. Needs the extra `cache`.
        from_frame: go on from this frame of the run that the cache has, with this scene, which may be another one from there on: frames
            before are those of the cache. The cache keeps both takes. Bodies that the change does not reach go on with the same bits,
            where they are free or in exact contact; see docs/guide/caches.md.

    Returns:
        The recording, with round(duration * fps) + 1 frames at multiples of 1 / fps; the first is the initial state. A duration of less
        than half of 1 / fps gives that one alone. Ctrl-C stops the run after the step that it is in, or the steps that are taken at once:
        the recording has the frames until then, and its status is not ok and says "partial". A second Ctrl-C raises KeyboardInterrupt.

    Raises:
        SceneError: the scene cannot be simulated as it is; names the body, the value and the remedy. Or an effect is unknown, cannot be
            enabled or cannot be left out. Or the cache is of another scene, of other settings, of another version or of another user.

    """
    if isinstance(accuracy, str | Accuracy):
        return _simulate(_Asked(scene, duration, fps, accuracy, effects, from_frame), progress, cache, interruptible)
    if cache is not None or from_frame is not None:
        raise SceneError("a cache for an accuracy that is still to be chosen", "choose it first, and give run.choice.accuracy")
    return provider("simulate to target")(scene, duration, fps, accuracy, effects, progress)


def simulate_whole(
    scene: Scene,
    duration: float,
    fps: float = 60.0,
    *,
    accuracy: str | Accuracy = "standard",
    effects: Mapping[str, bool] | None = None,
    progress: Callable[[float], None] | None = None,
    cache: str | os.PathLike[str] | Cache | None = None,
) -> SimulatedRecording:
    """Simulate a scene to its end, as `simulate` does: Ctrl-C raises KeyboardInterrupt, for those who have no use for a part of a run."""
    return _simulate(_Asked(scene, duration, fps, accuracy, effects), progress, cache, nullcontext)


class _Asked(NamedTuple):
    """What `simulate` is asked for."""

    scene: Scene
    duration: float
    fps: float
    accuracy: str | Accuracy
    effects: Mapping[str, bool] | None
    from_frame: int | None = None


def _simulate(
    asked: _Asked,
    progress: Progress | None,
    cache: str | os.PathLike[str] | Cache | None,
    listening: Listening,
) -> SimulatedRecording:
    """See `simulate`; listening: to Ctrl-C, or not."""
    stopwatch, times = Stopwatch(), frame_times(asked.duration, asked.fps)
    duration = float(asked.duration)
    with memory_told(len(times), len(asked.scene.bodies)):
        if asked.from_frame is not None:
            recording = _go_on(asked, progress, cache, listening)
            return replace(recording, profile=stopwatch.read(recording.plan))
        run = prepare(asked.scene, times, asked.accuracy, asked.effects)
        settings = _settings(asked, run)
        with listening(progress) as look:
            if cache is None:
                # Who listens to Ctrl-C alone need not be asked at every step: a die took a quarter longer.
                recording = complete(run, duration, look, every_step=progress is not None)
            else:
                with closing(provider("checkpoints")(cache, settings, run)) as checkpointer:
                    recording = _complete_in_cache(checkpointer, duration, look)
    return replace(recording, profile=stopwatch.read(run.plan), settings=settings)


def _settings(asked: _Asked, run: Run) -> RunSettings:
    """The settings of a run that was asked for."""
    return RunSettings(float(asked.duration), float(asked.fps), run.world.accuracy, dict(asked.effects or {}))


def _go_on(
    asked: _Asked, progress: Progress | None, cache: str | os.PathLike[str] | Cache | None, listening: Listening
) -> SimulatedRecording:
    """A run from a frame of a cache on; its recording has the frames before, too."""
    if cache is None:
        raise SceneError("from_frame without a cache", "give the cache of the run that is to go on")
    start = provider("later start")(cache, asked.scene, float(asked.fps), asked.from_frame)
    times = frame_times(asked.duration, asked.fps)[start.change.frame :]
    if len(times) < 2:
        raise SceneError(f"from_frame = {asked.from_frame!r} of {asked.duration:g} s", "give an earlier frame, or a longer duration")
    run = prepare(asked.scene, times, asked.accuracy, asked.effects, start.earlier)
    with listening(progress) as look, closing(provider("checkpoints")(cache, _settings(asked, run), run, start.change)) as checkpointer:
        then = _complete_in_cache(checkpointer, float(asked.duration), look)
    return joined_runs(start.first, then)


def _complete_in_cache(checkpointer: Any, duration: float, progress: Callable[[float], None] | None) -> SimulatedRecording:
    """As `complete`, from the last checkpoint on."""
    run = checkpointer.run
    try:
        run_to_end(run, duration, lambda time: checkpointer.look(time, progress))
    except Stopped:
        checkpointer.write(run.state.time)
        return finish_early(run, duration)
    checkpointer.write(duration)
    recording = finish_run(run, duration)
    checkpointer.finish(recording)
    return recording


def prepare(
    scene: Scene,
    times: np.ndarray,
    accuracy: str | Accuracy = "standard",
    effects: Mapping[str, bool] | None = None,
    earlier: EarlierRun | None = None,
) -> Run:
    """A run of a scene at its start, with frames at times (f,) s, for `complete`; earlier: the run in whose middle it begins, if any."""
    left_out = chosen_out(scene, accuracy, effects)
    world = compile_scene(scene, accuracy, frozenset(left_out))
    if len(times) * world.num_bodies > MOST_POSES:
        raise SceneError(f"{len(times)} frames of {world.num_bodies} bodies", "lower the fps or the duration")
    return begin_run(world, make_plan(world, effects), times, left_out, earlier)


def complete(
    run: Run, duration: float, progress: Callable[[float], None] | None = None, every_step: bool = True
) -> SimulatedRecording:
    """Step a run to its end at `duration` [s], or until `progress` raises `Stopped`; hand back what was recorded.

    every_step: see `run_steps`.
    """
    try:
        run_to_end(run, duration, progress, every_step)
        return finish_run(run, duration)
    except Stopped:
        return finish_early(run, duration)
    finally:
        forget_calls()


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
