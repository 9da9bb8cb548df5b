"""Runs of a changed scene from a frame of a cache on: the run before the change is brought to that frame once more.

It begins at its last checkpoint that is kept before the frame. Its scene is in the cache (`origin`).
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from rigidimpulse.core.errors import SceneError
from rigidimpulse.engine.earlier_run import EarlierRun
from rigidimpulse.engine.loop import run_steps
from rigidimpulse.engine.recording_of import finish_run
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.simulate import prepare
from rigidimpulse.io.cache.arrays import Damaged
from rigidimpulse.io.cache.checkpointer import Change
from rigidimpulse.io.cache.decode import REMEDY
from rigidimpulse.io.cache.encode import freeze
from rigidimpulse.io.cache.layout import Content, Header
from rigidimpulse.io.cache.load import recording_of
from rigidimpulse.io.cache.origin import thawed
from rigidimpulse.io.cache.read import read, read_headers, read_origin, unpacked_state
from rigidimpulse.io.cache.recall import constants_of, path_of, recalled, thawed_run
from rigidimpulse.recording.cache import Cache
from rigidimpulse.recording.joined import FRAMES, joined_runs
from rigidimpulse.recording.recorder import Frames
from rigidimpulse.recording.recording import SimulatedRecording
from rigidimpulse.scene.frame_times import frame_times
from rigidimpulse.scene.scene import Scene


class LaterStart(NamedTuple):
    """Where a run of a changed scene begins: the recording until then, the run that it goes on from, and which take that is."""

    first: SimulatedRecording
    earlier: EarlierRun
    change: Change


def later_start(cache: Cache | str | os.PathLike[str], scene: Scene, fps: float, frame: int) -> LaterStart:
    """Return where a run of a changed scene begins that goes on from a frame of the take of a cache that was written last.

    Raises:
        SceneError: no cache, one with other frames, one that does not have this frame, or a function of its scene that is gone.

    """
    path = path_of(cache if isinstance(cache, Cache) else Cache(cache))
    where = f"cache {str(path)!r}"
    headers = read_headers(path)
    base = _take_at(headers, frame, where)
    if base.fps != fps:
        raise SceneError(f"its frames are at {base.fps:g} fps, asked for is {fps:g}", f"give fps={base.fps:g}", where)
    first, earlier = _at(path, headers, base, scene, int(frame))
    return LaterStart(first, earlier, Change(int(frame), base.take.number, base.fingerprint))


def _take_at(headers: list[Header], frame: int, where: str) -> Header:
    """The take that a frame is of: the one written last, or the one from which that went on before the frame."""
    by_number = {header.take.number: header for header in headers}
    base, seen = headers[0], set()
    while base.take.first_frame >= frame and base.take.base in by_number and base.take.number not in seen:
        seen.add(base.take.number)
        base = by_number[base.take.base]
    last = base.take.first_frame + len(base.times) - 1
    if int(frame) != frame or not base.take.first_frame < frame < last:
        raise SceneError(f"from_frame = {frame!r}", f"give a frame from 1 to {last - 1}: the run goes on from there", where)
    return base


def _at(path: Path, headers: list[Header], header: Header, scene: Scene, frame: int) -> tuple[SimulatedRecording, EarlierRun]:
    """The recording of a take until a frame, and its run there."""
    where, begin = f"cache {str(path)!r}", header.take.first_frame
    try:
        origin = thawed(read_origin(path, header.take.number), scene)
    except Damaged as error:
        raise SceneError(f"it cannot be read: {error}", REMEDY, where) from None
    except SceneError as error:
        raise error.within(where) from None
    content = read(path, alone=True, take=header.take.number)[1]
    here, settings = frame - begin, origin.settings
    if here >= len(content.frames["position"]):
        raise SceneError(f"it has no frame {frame} yet", "let its run go on, or give an earlier frame", where)
    times = frame_times(settings.duration, settings.fps)[begin:]
    before = _at(path, headers, _base_of(headers, header, where), scene, begin) if begin else None
    try:
        run = prepare(origin.scene, times, settings.accuracy, settings.effects, before[1] if before else None)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"the scene of its run cannot be prepared: {error}", REMEDY, where) from error
    run = _brought_to(run, content, float(times[here]), where)
    ended = thawed_run(run, freeze(run, constants_of(run)))
    ended.keep(here + 1)
    part, stored = finish_run(ended, float(times[here])), recording_of(path, header, content)
    for name in FRAMES:
        # The last step may be cut at the frame.
        getattr(part, name)[:here] = getattr(stored, name)[:here]
    frames = ended.recorder.frames
    state = Frames(*(rows[-1:] for rows in frames))
    return joined_runs(before[0], part) if before else part, EarlierRun(run, state, before[1] if before else None)


def _base_of(headers: list[Header], header: Header, where: str) -> Header:
    """The take in whose middle another one begins."""
    base = next((other for other in headers if other.take.number == header.take.base), None)
    if base is None or base.take.first_frame >= header.take.first_frame:
        raise SceneError("the take before the change is not in it", REMEDY, where)
    return base


def _brought_to(run: Run, content: Content, time: float, where: str) -> Run:
    """A run, given at its start, at `time` [s], from its last checkpoint that is kept before then."""
    begin = run.state.time
    kept = [each for each in content.kept if begin <= each.commit["time"] <= time]
    if kept:
        commit, state = kept[-1].commit, unpacked_state(kept[-1])
        if state is None:
            raise SceneError("an earlier checkpoint has been changed", REMEDY, where)
        frames = {name: rows[: int(commit["frames"])] for name, rows in content.frames.items()}
        run = recalled(run, content._replace(frames=frames, impacts=content.impacts[: int(commit["impacts"])], state=state), where)
    if run.plan.steps:
        run_steps(run, time, None)
    else:
        run.keyframes.start_segments(run, time)
        run.state.time = time
    return run
