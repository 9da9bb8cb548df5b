"""The HDF5 file of a run, written to while the run goes on and readable at any time.

    attributes      format, fingerprint, version, duration [s], fps, names, complete
    times           (f,) s, of all frames of the run
    body            offset (n, 3) m and turn (n, 4): centre of mass and principal axes in body frames
    frames          position (f, n, 3) m of centres of mass, orientation (f, n, 4) wxyz of principal axes, velocity and
                    angular_velocity (f, n, 3)
    impacts         (m, 15), columns as in `recording.events.IMPACT_DTYPE`
    checkpoint      two slots of bytes, and commits (2,): number, time, frames, impacts, size and digest of each
    tables          of a finished run: contacts, status (JSON), and vertices and faces of flexible bodies

All tables lie in the file from its beginning, with spare capacity (holes, on most disks), so that nothing that says where they are is
ever written again: a process may be killed at any moment. A checkpoint is written into the slot of the older one, then its commit; each is
on disk before the next thing is written. Whatever is cut off, one slot agrees with its digest, and frames and impacts that it counts are as
it left them: they are only ever written again with the same numbers. Where the capacity is too small, a file with twice as much replaces
this one.
"""

from __future__ import annotations

import hashlib
import os
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.files import write_renamed
from rigidimpulse.recording.events import ROW_LENGTH

FORMAT = "rigidimpulse cache 1"
SUFFIXES = (".h5", ".hdf5")
FRAMES = {"position": 3, "orientation": 4, "velocity": 3, "angular_velocity": 3}
COMMIT = np.dtype(
    [("number", "<u8"), ("time", "<f8"), ("frames", "<u8"), ("impacts", "<u8"), ("size", "<u8"), ("digest", "S64")]
)
SPARE = 2
"""Capacity over what is stored, for impacts and for bytes of a state."""
LEAST_IMPACTS = 256


def library() -> Any:
    """The module h5py.

    Raises:
        SceneError: it is not installed.

    """
    try:
        import h5py
    except ImportError:
        raise SceneError("a cache needs the library h5py", "pip install rigidimpulse[cache]") from None
    return h5py


@dataclass(frozen=True)
class Header:
    """What a file says of its run: fingerprint, version, duration [s], fps, names (n,), frame times (f,) s, frames of the bodies."""

    fingerprint: str
    version: str
    duration: float
    fps: float
    names: list[str]
    times: np.ndarray
    offset: np.ndarray
    turn: np.ndarray


class Content(NamedTuple):
    """What a file holds: frames by name (k, n, ...), impacts (m, 15), until when they go [s], the state there, whether that is all.

    tables: what only a finished run has, by name.
    """

    frames: dict[str, np.ndarray]
    impacts: np.ndarray
    time: float
    state: bytes | None
    complete: bool
    tables: dict[str, Any]


def read(path: Path, alone: bool = False) -> tuple[Header, Content]:
    """Return what the file holds as of its last commit; alone: refuse a file that somebody writes to.

    Raises:
        SceneError: no such file, no cache, or one that is written to.

    """
    where = f"cache {str(path)!r}"
    if not path.is_file():
        raise SceneError("there is no such file", "check the path", where)
    try:
        with _opened(path, alone) as file:
            if file.attrs.get("format") != FORMAT:
                raise SceneError("it is no cache of this version", "give another name, or delete it", where)
            return _header(file), _content(file)
    except BlockingIOError:
        raise SceneError("another run writes to it", "wait until that ends, or give another name", where) from None
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"it cannot be read: {error}", "delete it, and run again", where) from None


def _opened(path: Path, alone: bool) -> Any:
    """The file, open for reading."""
    h5py = library()
    try:
        return h5py.File(path, "r")
    except BlockingIOError:
        if alone:
            raise
        return h5py.File(path, "r", locking=False)


def _header(file: Any) -> Header:
    own = file.attrs
    return Header(
        own["fingerprint"], own["version"], float(own["duration"]), float(own["fps"]), [str(name) for name in own["names"]],
        file["times"][()], file["body/offset"][()], file["body/turn"][()],
    )  # fmt: skip


def _content(file: Any) -> Content:
    commits = file["checkpoint/commits"][()]
    for slot in np.argsort(commits["number"])[::-1].tolist():
        commit = commits[slot]
        data = file[f"checkpoint/{slot}"][: int(commit["size"])].tobytes()
        if commit["number"] > 0 and _digest(data) == commit["digest"]:
            complete = bool(file.attrs["complete"])
            last, count = (None, None) if complete else (int(commit["frames"]), int(commit["impacts"]))
            frames = {name: file[f"frames/{name}"][:last] for name in FRAMES}
            tables = {name: _plain(file[f"tables/{name}"][()]) for name in file.get("tables", ())}
            return Content(frames, file["impacts"][:count], float(commit["time"]), zlib.decompress(data), complete, tables)
    return empty(len(file.attrs["names"]))


def _plain(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).hexdigest().encode()


class CacheFile:
    """A file that is written."""

    def __init__(self, path: Path, header: Header, content: Content | None) -> None:
        """Begin the file, in the place of any of its name, with what there is already."""
        self._path, self._header, self._number = path, header, 0
        self._file = self._make(content or empty(len(header.names)))

    def _make(self, content: Content) -> Any:
        """Make the file with this content and capacity for more; return it open."""
        data = b"" if content.state is None else zlib.compress(content.state, 1)

        def create(target: Path) -> None:
            with library().File(target, "w") as file:
                _lay_out(file, self._header, max(SPARE * len(content.impacts), LEAST_IMPACTS), SPARE * len(data))
                self._commit(file, content, 0, 0, data)

        write_renamed(self._path, create)
        return library().File(self._path, "r+")

    def commit(self, content: Content, first_frame: int, first_impact: int) -> None:
        """Write frames and impacts of a content, from the first ones on, and its state."""
        assert content.state is not None
        data = zlib.compress(content.state, 1)
        if len(data) > len(self._file["checkpoint/0"]) or len(content.impacts) > len(self._file["impacts"]):
            self._file.close()
            self._file = self._make(content)
        else:
            self._commit(self._file, content, first_frame, first_impact, data)

    def _commit(self, file: Any, content: Content, first_frame: int, first_impact: int, data: bytes) -> None:
        for name, rows in content.frames.items():
            file[f"frames/{name}"][first_frame : len(rows)] = rows[first_frame:]
        file["impacts"][first_impact : len(content.impacts)] = content.impacts[first_impact:]
        if content.state is None:
            return
        self._number += 1
        slot = self._number % 2
        file[f"checkpoint/{slot}"][: len(data)] = np.frombuffer(data, np.uint8)
        _sync(file)
        commit = (self._number, content.time, len(content.frames["position"]), len(content.impacts), len(data), _digest(data))
        file["checkpoint/commits"][slot] = np.array(commit, COMMIT)
        _sync(file)

    def close(self) -> None:
        """End writing."""
        self._file.close()

    def finish(self, content: Content) -> None:
        """Put the file of the finished run in the place of this one."""
        data = zlib.compress(content.state or b"", 1)

        def create(target: Path) -> None:
            with library().File(target, "w") as file:
                _lay_out(file, self._header, len(content.impacts), len(data))
                self._commit(file, content, 0, 0, data)
                for name, table in content.tables.items():
                    file[f"tables/{name}"] = str(table) if table.dtype.kind == "U" else table
                file.attrs["complete"] = True

        write_renamed(self._path, create)
        self.close()


def empty(n: int) -> Content:
    """Return the content of a run of n bodies before its first checkpoint."""
    return Content({name: np.zeros((0, n, width)) for name, width in FRAMES.items()}, np.zeros((0, ROW_LENGTH)), 0.0, None, False, {})


def _lay_out(file: Any, header: Header, impacts: int, size: int) -> None:
    """Give a new file its tables, with the capacity for `impacts` impacts and for states of `size` bytes."""
    h5py = library()
    told = {"format": FORMAT, "fingerprint": header.fingerprint, "version": header.version, "complete": False}
    file.attrs.update(told | {"duration": header.duration, "fps": header.fps, "names": np.array(header.names, dtype=object)})
    file["times"], file["body/offset"], file["body/turn"] = header.times, header.offset, header.turn
    file["checkpoint/commits"] = np.zeros(2, COMMIT)
    now = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    now.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    now.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    for name, width in FRAMES.items():
        file.create_dataset(f"frames/{name}", (len(header.times), len(header.names), width), float, dcpl=now)
    file.create_dataset("impacts", (impacts, ROW_LENGTH), float, dcpl=now)
    for slot in range(2):
        file.create_dataset(f"checkpoint/{slot}", (size,), np.uint8, dcpl=now)


def _sync(file: Any) -> None:
    """Have all that was written on disk."""
    file.flush()
    os.fsync(file.id.get_vfd_handle())
