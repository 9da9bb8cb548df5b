"""Checkpoints: they store a run in its cache while it goes on, and let a stopped run go on from there.

A checkpoint is written between two steps. It holds the frames until then; the impacts; and everything that the run changes (`freeze`). A
body's trajectory may go on beyond the checkpoint. Its frames until then are sampled from that trajectory; if it changes later, they are
written again. A run that goes on is prepared like any other, and then takes the state of the checkpoint in place of its own.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.version import VERSION
from rigidimpulse.engine.fingerprint import fingerprint
from rigidimpulse.io.cache.encode import freeze
from rigidimpulse.io.cache.file import CacheFile
from rigidimpulse.io.cache.layout import FRAMES, Content, Header, Take
from rigidimpulse.io.cache.origin import Origin, frozen
from rigidimpulse.io.cache.read import read, read_headers
from rigidimpulse.io.cache.recall import check_writer, constants_of, path_of, recalled
from rigidimpulse.recording.cache import Cache
from rigidimpulse.recording.recorder import sample_paths
from rigidimpulse.recording.recording import Recording, RunSettings

if TYPE_CHECKING:
    from rigidimpulse.engine.run import Run


class Change(NamedTuple):
    """Where a run of a changed scene begins: frame of another take, and the number and the fingerprint of that."""

    frame: int
    base: int
    fingerprint: str


EXPENSIVE = 20.0
"""How many times longer than the last checkpoint took the run goes on before the next, unless one is wanted after every step."""


class Checkpointer:
    """The cache of one run.

    Attributes:
        run: the run, where its last checkpoint left it if there is one.

    """

    def __init__(
        self, cache: Cache | str | os.PathLike[str], settings: RunSettings, run: Run, change: Change | None = None
    ) -> None:
        """Take the state of a run's last checkpoint, if there is one, and begin to write.

        Args:
            cache: where.
            settings: of the run.
            run: the same run at its start.
            change: of the scene of another take, in whose middle the run begins.

        Raises:
            SceneError: another suffix, a file that is no cache, or one of another scene, of other settings, of another version or of
                another user.

        """
        self._cache = cache if isinstance(cache, Cache) else Cache(cache)
        self._path = path_of(self._cache)
        if not self._cache.every >= 0.0:
            remedy = "give the seconds between checkpoints, >= 0"
            raise SceneError(f"every = {self._cache.every!r}", remedy, f"cache {self._path.name!r}")
        origin = frozen(Origin(run.world.scene, settings))
        header, stored = self._look_up(_header(run, settings, change), change)
        header = replace(header, take=header.take._replace(origin=hashlib.sha256(origin).hexdigest()))
        self._frames = self._impacts = 0
        self._state = b""
        self.run = run if stored is None or stored.state is None else self._recall(run, header, stored)
        self._written = self.run.recorder.written.copy()
        complete = stored is not None and stored.complete
        self._file = None if complete else CacheFile(self._path, header, stored, origin)
        self._last, self._cost = perf_counter(), 0.0
        if stored is None or stored.state is None:
            try:
                self.write(run.state.time)  # a state that cannot be written is better known at once
            except BaseException:
                self.close()
                raise

    def _look_up(self, header: Header, change: Change | None) -> tuple[Header, Content | None]:
        """Say which take of the file the run is, and return what the file has of it, None where it is a new one."""
        if not self._path.exists():
            return header, None
        known = read_headers(self._path)
        for other in known:
            same = (other.fingerprint, other.names) == (header.fingerprint, header.names)
            if same and np.array_equal(other.times, header.times):
                return replace(header, take=other.take), read(self._path, alone=True, take=other.take.number)[1]
        if change is None:
            raise SceneError(_difference(known[0], header), "delete it, or give another name", f"cache {str(self._path)!r}")
        return replace(header, take=Take(1 + max(other.take.number for other in known), change.base, change.frame)), None

    def _recall(self, run: Run, header: Header, stored: Content) -> Run:
        """The run as its checkpoint left it."""
        where = f"cache {str(self._path)!r}"
        if not self._cache.trust:
            check_writer(header, stored, where)
        self._frames, self._impacts = len(stored.frames["position"]), len(stored.impacts)
        return recalled(run, stored, where)

    def look(self, time: float, more: Callable[[float], None] | None = None) -> None:
        """Write a checkpoint if it is time to; call `more` with the time of the run [s]."""
        every = self._cache.every
        pause = max(every, EXPENSIVE * self._cost) if every > 0.0 else 0.0
        if self._file is not None and perf_counter() - self._last >= pause:
            self.write(time)
        if more is not None:
            more(time)

    def write(self, time: float) -> None:
        """Write a checkpoint at the time of the run [s]."""
        if self._file is None:
            return
        start, run = perf_counter(), self.run
        recorder = run.recorder
        changed = recorder.written > self._written
        first = min(int(self._written[changed].min(initial=self._frames)), self._frames)
        last = max(int(np.searchsorted(recorder.times, time, side="left")), self._frames)
        self._fill_in(first, last)
        state = freeze(self.run, constants_of(run))
        content = self._content(last, time, state)
        self._file.commit(content, first, self._impacts)
        self._state, self._frames, self._impacts = state, last, len(content.impacts)
        self._written[:] = recorder.written
        self._last = perf_counter()
        self._cost = self._last - start

    def _fill_in(self, first: int, last: int) -> None:
        """Write the frames before `last` that are not written yet, from the present trajectories; the recorder writes them again later."""
        recorder, trajectory = self.run.recorder, self.run.state.trajectory
        behind = np.flatnonzero(recorder.written < last)
        sample_paths(trajectory, behind, last, np.maximum(recorder.written, first), recorder.frames)

    def _content(self, frames: int, time: float, state: bytes, tables: dict[str, Any] | None = None) -> Content:
        run = self.run
        recorded = {name: getattr(run.recorder, name)[:frames] for name in FRAMES}
        return Content(recorded, run.log.impacts, time, state, tables is not None, tables or {})

    def finish(self, recording: Recording) -> None:
        """Add what only a finished run has, and say that it is complete."""
        if self._file is None:
            return
        tables: dict[str, Any] = {"contacts": recording.contacts, "status": np.array(recording.status.stored())}
        for number, track in enumerate(recording.soft_bodies):
            tables.update(track.arrays(number))
        self._file.finish(self._content(len(recording.times), float(recording.times[-1]), self._state, tables))

    def close(self) -> None:
        """End writing, however the run ended."""
        if self._file is not None:
            self._file.close()


def _header(run: Run, settings: RunSettings, change: Change | None) -> Header:
    """What a file says of a run; the number of its take is still to be found."""
    world, (duration, fps, accuracy, effects) = run.world, settings
    since = () if change is None else (change.frame, change.fingerprint)
    mark = fingerprint(world.scene, duration, fps, accuracy, effects, *since)
    return Header(mark, VERSION, duration, fps, list(world.names), run.recorder.times, world.offset, world.turn)


def _difference(known: Header, header: Header) -> str:
    """Say how a cache differs from the run."""
    if known.version != header.version:
        return f"it is of version {known.version} of the library, this is {header.version}"
    if known.names != header.names:
        return "it is of another scene: its bodies have other names"
    for what, unit, stored, asked in (("duration", " s", known.duration, header.duration), ("fps", "", known.fps, header.fps)):
        if stored != asked:
            return f"it is of other settings: {what} {stored:g}{unit}, asked for is {asked:g}{unit}"
    return "it is of another scene, of another accuracy or of other effects"
