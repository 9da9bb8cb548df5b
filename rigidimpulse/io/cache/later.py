"""Runs of a changed scene from a frame of a cache on: the run before the change is brought to that frame once more.

It begins at its last checkpoint that is kept before the frame. Its scene is in the cache (`origin`).
"""

from __future__ import annotations

import hashlib
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
from rigidimpulse.io.cache.recall import check_writer, constants_of, path_of, recalled, thawed_run
from rigidimpulse.io.cache.signature import ORIGIN, check_signature
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
    asked = cache if isinstance(cache, Cache) else Cache(cache)
    path = path_of(asked)
    takes = _Takes(path, read_headers(path), asked.trust, f"cache {str(path)!r}")
    base = _take_at(takes, frame)
    if base.fps != fps:
        raise SceneError(f"its frames are at {base.fps:g} fps, asked for is {fps:g}", f"give fps={base.fps:g}", takes.where)
    first, earlier = _at(takes, base, scene, int(frame))
    return LaterStart(first, earlier, Change(int(frame), base.take.number, base.fingerprint))


class _Takes(NamedTuple):
    """The takes of a file, whether whoever wrote them is trusted, and how a message names the file."""

    path: Path
    headers: list[Header]
    trust: bool
    where: str


def _take_at(takes: _Takes, frame: int) -> Header:
    """The take that a frame is of: the one written last, or the one from which that went on before the frame."""
    by_number = {header.take.number: header for header in takes.headers}
    base, seen = takes.headers[0], set()
    while base.take.first_frame >= frame and base.take.base in by_number and base.take.number not in seen:
        seen.add(base.take.number)
        base = by_number[base.take.base]
    last = base.take.first_frame + len(base.times) - 1
    if int(frame) != frame or not base.take.first_frame < frame < last:
        raise SceneError(f"from_frame = {frame!r}", f"give a frame from 1 to {last - 1}: the run goes on from there", takes.where)
    return base


def _at(takes: _Takes, header: Header, scene: Scene, frame: int) -> tuple[SimulatedRecording, EarlierRun]:
    """The recording of a take until a frame, and its run there."""
    path, where, begin = takes.path, takes.where, header.take.first_frame
    data, signature = read_origin(path, header.take.number)
    if not takes.trust:
        check_signature(signature, ORIGIN, header.fingerprint, hashlib.sha256(data).hexdigest().encode(), where)
    try:
        origin = thawed(data, scene)
    except Damaged as error:
        raise SceneError(f"it cannot be read: {error}", REMEDY, where) from None
    except SceneError as error:
        raise error.within(where) from None
    content = read(path, alone=True, take=header.take.number)[1]
    here, settings = frame - begin, origin.settings
    if here >= len(content.frames["position"]):
        raise SceneError(f"it has no frame {frame} yet", "let its run go on, or give an earlier frame", where)
    times = frame_times(settings.duration, settings.fps)[begin:]
    before = _at(takes, _base_of(takes, header), scene, begin) if begin else None
    try:
        run = prepare(origin.scene, times, settings.accuracy, settings.effects, before[1] if before else None)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"the scene of its run cannot be prepared: {error}", REMEDY, where) from error
    run = _brought_to(run, _kept_before(takes, header, content, run.state.time, float(times[here])), float(times[here]), where)
    ended = thawed_run(run, freeze(run, constants_of(run)))
    ended.keep(here + 1)
    part, stored = finish_run(ended, float(times[here])), recording_of(path, header, content)
    for name in FRAMES:
        # The last step may be cut at the frame.
        getattr(part, name)[:here] = getattr(stored, name)[:here]
    frames = ended.recorder.frames
    state = Frames(*(rows[-1:] for rows in frames))
    return joined_runs(before[0], part) if before else part, EarlierRun(run, state, before[1] if before else None)


def _base_of(takes: _Takes, header: Header) -> Header:
    """The take in whose middle another one begins."""
    base = next((other for other in takes.headers if other.take.number == header.take.base), None)
    if base is None or base.take.first_frame >= header.take.first_frame:
        raise SceneError("the take before the change is not in it", REMEDY, takes.where)
    return base


def _kept_before(takes: _Takes, header: Header, content: Content, begin: float, time: float) -> Content | None:
    """What a file holds of a take as of its last kept checkpoint from `begin` to `time` [s], None where there is none."""
    kept = [each for each in content.kept if begin <= each.commit["time"] <= time]
    if not kept:
        return None
    commit, state = kept[-1].commit, unpacked_state(kept[-1])
    if state is None:
        raise SceneError("an earlier checkpoint has been changed", REMEDY, takes.where)
    frames = {name: rows[: int(commit["frames"])] for name, rows in content.frames.items()}
    then = content._replace(frames=frames, impacts=content.impacts[: int(commit["impacts"])], state=state, commit=commit)
    if not takes.trust:
        check_writer(header, then, takes.where)
    return then


def _brought_to(run: Run, kept: Content | None, time: float, where: str) -> Run:
    """A run, given at its start, at `time` [s], from a checkpoint before then, if there is one."""
    if kept is not None:
        run = recalled(run, kept, where)
    if run.plan.steps:
        run_steps(run, time, None)
    else:
        run.keyframes.start_segments(run, time)
        run.state.time = time
    return run
