"""Keeps a run in its cache while it goes on, and finds where to go on with one that was stopped.

What is written at a checkpoint, between two steps: frames until then, those of bodies whose courses go on beyond it included (they lie on
them; whatever changes a course on the way writes them once more); impacts; and everything that the run changes (`freeze`). A run that goes
on is made ready anew like any other, then takes the state of the checkpoint in the place of its own.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

import rigidimpulse
from rigidimpulse.core.errors import SceneError
from rigidimpulse.engine.fingerprint import fingerprint
from rigidimpulse.io.cache.file import FRAMES, SUFFIXES, CacheFile, Content, Header, read
from rigidimpulse.io.cache.freeze import Constants, freeze, thaw
from rigidimpulse.recording.recorder import sample_paths
from rigidimpulse.recording.recording import Recording, RunSettings

if TYPE_CHECKING:
    from rigidimpulse.engine.plan import Plan
    from rigidimpulse.engine.simulate import Running

EXPENSIVE = 20.0
"""How many times longer than the last checkpoint took the run goes on before the next."""


@dataclass(frozen=True)
class Cache:
    """Where a run is kept on disk while it goes on, see `simulate`.

    Attributes:
        path: a file that ends in .h5 or .hdf5.
        every: s of computing between checkpoints, at least; 20 times what one takes if that is longer.

    """

    path: str | os.PathLike[str]
    every: float = 5.0


class Checkpointer:
    """The cache of one run.

    Attributes:
        running: the run, where its last checkpoint left it if there is one.

    """

    def __init__(self, cache: Cache | str | os.PathLike[str], settings: RunSettings, running: Running, plan: Plan) -> None:
        """Take the state of a run's last checkpoint, if there is one, and begin to write; running: the same run at its start.

        Raises:
            SceneError: another suffix, a file that is no cache, or one of another scene, of other settings or of another version.

        """
        self._cache = cache if isinstance(cache, Cache) else Cache(cache)
        self._path, self._plan = Path(self._cache.path), plan
        where = f"cache {self._path.name!r}"
        if self._path.suffix not in SUFFIXES:
            raise SceneError("it has another suffix", f"use a name that ends in {' or '.join(SUFFIXES)}", where)
        if not self._cache.every >= 0.0:
            raise SceneError(f"every = {self._cache.every!r}", "give the seconds between checkpoints, >= 0", where)
        world, recorder = running.context.world, running.context.recorder
        duration, fps, accuracy, effects = settings
        mark = fingerprint(world.scene, duration, fps, accuracy, effects)
        header = Header(mark, rigidimpulse.__version__, duration, fps, list(world.names), recorder.times, world.offset, world.turn)
        kept = self._look_up(header)
        self._frames = self._impacts = 0
        self._state = b""
        self.running = running if kept is None or kept.state is None else self._recall(running, kept)
        self._written = self.running.context.recorder.written.copy()
        complete = kept is not None and kept.complete
        self._file = None if complete else CacheFile(self._path, header, kept)
        self._last, self._cost = perf_counter(), 0.0
        if kept is None or kept.state is None:
            self.write(0.0)  # a state that cannot be written is better known at once

    def _look_up(self, header: Header) -> Content | None:
        """What there is of this run."""
        if not self._path.exists():
            return None
        known, content = read(self._path, alone=True)
        if known.fingerprint != header.fingerprint:
            raise SceneError(_difference(known, header), "delete it, or give another name", f"cache {str(self._path)!r}")
        return content

    def _recall(self, running: Running, kept: Content) -> Running:
        """The run as its checkpoint left it."""
        recorder, rows = running.context.recorder, running.context.log.impacts
        for name, frames in kept.frames.items():
            getattr(recorder, name)[: len(frames)] = frames
        rows.rows = np.concatenate([kept.impacts, rows.rows])
        self._frames, self._impacts = len(kept.frames["position"]), len(kept.impacts)
        return thaw(kept.state or b"", _constants(running.context, self._plan))

    def look(self, time: float, more: Callable[[float], None] | None = None) -> None:
        """Write a checkpoint if it is time to; call `more` with the time of the run [s]."""
        if self._file is not None and perf_counter() - self._last >= max(self._cache.every, EXPENSIVE * self._cost):
            self.write(time)
        if more is not None:
            more(time)

    def write(self, time: float) -> None:
        """Write a checkpoint at the time of the run [s]."""
        if self._file is None:
            return
        start, context = perf_counter(), self.running.context
        recorder = context.recorder
        changed = recorder.written > self._written
        first = min(int(self._written[changed].min(initial=self._frames)), self._frames)
        last = max(int(np.searchsorted(recorder.times, time, side="left")), self._frames)
        self._fill_in(first, last)
        state = freeze(self.running, _constants(context, self._plan))
        content = self._content(last, time, state)
        self._file.commit(content, first, self._impacts)
        self._state, self._frames, self._impacts = state, last, len(content.impacts)
        self._written[:] = recorder.written
        self._last = perf_counter()
        self._cost = self._last - start

    def _fill_in(self, first: int, last: int) -> None:
        """Write frames until the last one that are not written yet, from the present courses; what writes them comes again."""
        recorder, trajectory = self.running.context.recorder, self.running.context.state.trajectory
        behind = np.flatnonzero(recorder.written < last)
        sample_paths(trajectory, behind, last, np.maximum(recorder.written, first), recorder.frames)

    def _content(self, frames: int, time: float, state: bytes, tables: dict[str, Any] | None = None) -> Content:
        context = self.running.context
        rows = context.log.impacts
        recorded = {name: getattr(context.recorder, name)[:frames] for name in FRAMES}
        return Content(recorded, rows.rows[: rows.count], time, state, tables is not None, tables or {})

    def finish(self, recording: Recording) -> None:
        """Add what only a finished run has, and say that it is complete."""
        if self._file is None:
            return
        tables: dict[str, Any] = {"contacts": recording.contacts}
        for number, track in enumerate(recording.soft_bodies):
            tables.update(track.arrays(number))
        self._file.finish(self._content(len(recording.times), float(recording.times[-1]), self._state, tables))

    def close(self) -> None:
        """End writing, however the run ended."""
        if self._file is not None:
            self._file.close()


def _constants(context: Any, plan: Any) -> Constants:
    """What of a run its checkpoints do not hold."""
    world, recorder = context.world, context.recorder
    own = [plan, recorder.times, *(getattr(recorder, name) for name in FRAMES), context.log.impacts.rows]
    return Constants([world.scene, world.scene.bodies, world.scene.effects, world.shapes, world.geometry, *own])


def _difference(known: Header, header: Header) -> str:
    """What a cache is of that the run is not: as much as both say."""
    if known.version != header.version:
        return f"it is of version {known.version} of the library, this is {header.version}"
    if known.names != header.names:
        return "it is of another scene: its bodies have other names"
    for what, unit, kept, asked in (("duration", " s", known.duration, header.duration), ("fps", "", known.fps, header.fps)):
        if kept != asked:
            return f"it is of other settings: {what} {kept:g}{unit}, asked for is {asked:g}{unit}"
    return "it is of another scene, of another accuracy or of other effects"
