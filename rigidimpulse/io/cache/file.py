"""The HDF5 file of a run, written to while the run goes on and readable at any time; see `layout` for what lies where.

All tables lie in the file from its beginning, with spare capacity (holes, on most disks), so that nothing that says where they are is
ever written again: a process may be killed at any moment. A checkpoint is written into the slot of the older one, then its commit; each is
on disk before the next thing is written. Whatever is cut off, one slot agrees with its digest, and frames and impacts that it counts are as
it left them: they are only ever written again with the same numbers. Where the capacity is too small, a file with twice as much replaces
this one.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import numpy as np

from rigidimpulse.core.files import unwritable, write_renamed
from rigidimpulse.io.cache.disk import Disk
from rigidimpulse.io.cache.layout import (
    ATTRIBUTES,
    CHECK,
    COMMIT,
    FORMAT,
    FRAMES,
    Content,
    Header,
    Kept,
    attribute_of,
    check_words,
    digest_of,
    empty,
    library,
    seal_of,
    set_attributes,
)
from rigidimpulse.io.cache.signature import CHECKPOINT, ORIGIN, signature
from rigidimpulse.recording.events import ROW_LENGTH

MOST_KEPT, MOST_KEPT_BYTES = 32, 2**26
"""Earlier checkpoints that are kept: every second one is dropped where there are more."""
SPARE = 2
"""Capacity over what is stored, for impacts and for bytes of a state."""
LEAST_IMPACTS = 256
VERSION_OF_HDF5 = "v108"
"""The first whose files check their own tables; those from 1.10 on cannot be opened after a kill."""


class CacheFile:
    """A file that is written."""

    def __init__(self, path: Path, header: Header, content: Content | None, origin: bytes = b"") -> None:
        """Begin the file with what there is already, and with the other takes of a file of this name; origin: see `origin.frozen`."""
        self._path, self._header, self._number, self._origin = path, header, 0, origin
        self._kept = _KeptCheckpoints(content.kept if content else ())
        self._file = self._make(content or empty(len(header.names)))

    def _make(self, content: Content) -> _Open:
        """Make the file with this content and capacity for more; return it open."""
        data = b"" if content.state is None else zlib.compress(content.state, 1)

        def create(target: Path) -> None:
            with _Open(target, new=True) as made:
                _lay_out(made.file, self._header, max(SPARE * len(content.impacts), LEAST_IMPACTS), SPARE * len(data))
                set_attributes(made.file, seal=seal_of(self._header, False, {}))
                self._commit(made, content, 0, 0, data)
                self._write_rest(made.file)

        with _told(self._path):
            write_renamed(self._path, create)
            return _Open(self._path, new=False)

    def commit(self, content: Content, first_frame: int, first_impact: int) -> None:
        """Write frames and impacts of a content, from the first ones on, and its state.

        Raises:
            SceneError: the disk does not take it.

        """
        assert content.state is not None
        data = zlib.compress(content.state, 1)
        file = self._file.file
        if len(data) > len(file["checkpoint/0"]) or len(content.impacts) > len(file["impacts"]):
            self.close()
            self._file = self._make(content)
        else:
            with _told(self._path):
                self._commit(self._file, content, first_frame, first_impact, data)

    def _write_rest(self, file: Any) -> None:
        """Write what does not change while the file is there: the origin, earlier checkpoints and the other takes."""
        file["origin"] = np.frombuffer(self._origin, np.uint8)
        signed = signature(ORIGIN, self._header.fingerprint, self._header.take.origin.encode())
        set_attributes(file, origin_signature=signed.decode())
        file["kept/commits"] = np.array([kept.commit for kept in self._kept.rows], COMMIT)
        file["kept/states"] = np.frombuffer(b"".join(kept.data for kept in self._kept.rows), np.uint8)
        file.create_group("takes")
        if self._path.exists():
            with library().File(self._path, "r", locking=False) as before:
                copy_takes(before, file, self._header.take.number)

    def _commit(self, opened: _Open, content: Content, first_frame: int, first_impact: int, data: bytes) -> None:
        file = opened.file
        count = len(content.frames["position"])
        for name, rows in content.frames.items():
            file[f"frames/{name}"][first_frame:count] = rows[first_frame:]
        file["checks/frames"][first_frame:count] = check_words(*(content.frames[name][first_frame:] for name in FRAMES))
        file["impacts"][first_impact : len(content.impacts)] = content.impacts[first_impact:]
        file["checks/impacts"][first_impact : len(content.impacts)] = check_words(content.impacts[first_impact:])
        if content.state is None:
            return
        self._number += 1
        slot = self._number % 2
        file[f"checkpoint/{slot}"][: len(data)] = np.frombuffer(data, np.uint8)
        opened.sync()
        told = (self._number, content.time, count, len(content.impacts), len(data), len(content.state), b"", b"")
        commit = np.array(told, COMMIT)
        commit["digest"] = digest = digest_of(commit, data)
        commit["signature"] = signature(CHECKPOINT, self._header.fingerprint, digest)
        file["checkpoint/commits"][slot] = commit
        opened.sync()
        self._kept.add(Kept(commit, data))

    def close(self) -> None:
        """End writing."""
        with _told(self._path):
            self._file.close()

    def finish(self, content: Content) -> None:
        """Put the file of the finished run in the place of this one."""
        data = zlib.compress(content.state or b"", 1)
        tables = {name: np.bytes_(str(table).encode()) if table.dtype.kind == "U" else table for name, table in content.tables.items()}

        def create(target: Path) -> None:
            with _Open(target, new=True) as made:
                file = made.file
                _lay_out(file, self._header, len(content.impacts), len(data))
                self._commit(made, content, 0, 0, data)
                for name, table in tables.items():
                    file[f"tables/{name}"] = table
                self._write_rest(file)
                set_attributes(file, complete=True, seal=seal_of(self._header, True, tables))

        with _told(self._path):
            write_renamed(self._path, create)
        self.close()


class _KeptCheckpoints:
    """The checkpoints of a run, spread over it: the more there are, the fewer of them are kept."""

    def __init__(self, rows: Sequence[Kept]) -> None:
        """Begin with some."""
        self.rows = list(rows)
        self._stride, self._seen = 1, 0

    def add(self, kept: Kept) -> None:
        """Keep a checkpoint that is later than all others, or leave it out."""
        if self.rows and kept.commit["time"] <= self.rows[-1].commit["time"]:
            return
        self._seen += 1
        if self._seen % self._stride:
            return
        self.rows.append(kept)
        while len(self.rows) > MOST_KEPT or (len(self.rows) > 1 and sum(len(row.data) for row in self.rows) > MOST_KEPT_BYTES):
            self.rows, self._stride = self.rows[::2], 2 * self._stride


def copy_takes(source: Any, target: Any, number: int) -> None:
    """Copy all takes of a file but that of a number into the group `takes` of another file."""
    for group in (source, *source["takes"].values()):
        take = int(attribute_of(group, "take"))
        if take != number:
            copied = target.create_group(f"takes/{take}")
            found = {name: attribute_of(group, name) for name in ATTRIBUTES}
            set_attributes(copied, **{name: value for name, value in found.items() if value is not None})
            for name in group:
                if name != "takes":
                    group.copy(name, copied)


def _lay_out(file: Any, header: Header, impacts: int, size: int) -> None:
    """Give a new file its tables, with the capacity for `impacts` impacts and for states of `size` bytes."""
    h5py = library()
    number, base, first_frame, origin = header.take
    set_attributes(
        file, format=FORMAT, fingerprint=header.fingerprint, version=header.version, complete=False, duration=header.duration,
        fps=header.fps, take=number, base=base, first_frame=first_frame, origin=origin,
    )  # fmt: skip
    file["names"] = np.bytes_(json.dumps(header.names).encode())
    file["times"], file["body/offset"], file["body/turn"] = header.times, header.offset, header.turn
    file["checkpoint/commits"] = np.zeros(2, COMMIT)
    now = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    now.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    now.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    for name, width in FRAMES.items():
        file.create_dataset(f"frames/{name}", (len(header.times), len(header.names), width), float, dcpl=now)
    file.create_dataset("impacts", (impacts, ROW_LENGTH), float, dcpl=now)
    for name, count in (("frames", len(header.times)), ("impacts", impacts)):
        file.create_dataset(f"checks/{name}", (count,), CHECK, dcpl=now)
    for slot in range(2):
        file.create_dataset(f"checkpoint/{slot}", (size,), np.uint8, dcpl=now)


class _Open:
    """An HDF5 file that is open for writing, and the file below it."""

    def __init__(self, path: Path, *, new: bool) -> None:
        """Open it; new: an empty one."""
        self._disk = Disk(path, new=new)
        try:
            self.file: Any = library().File(self._disk, "w" if new else "r+", libver=(VERSION_OF_HDF5, VERSION_OF_HDF5))
        except BaseException:
            self._disk.close()
            raise

    def __enter__(self) -> Self:
        """Return this."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close both."""
        self.close()

    def sync(self) -> None:
        """Have all that was written on disk; raises OSError where it does not take it."""
        self.file.flush()
        self._disk.sync()

    def close(self) -> None:
        """Close both; raises OSError where the disk has not taken all of it."""
        try:
            self.file.close()
            self._disk.check()
        finally:
            self._disk.close()


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn what the disk does not take into a `SceneError` that names the cache."""
    try:
        yield
    except OSError as error:
        raise unwritable(error, f"cache {str(path)!r}", "make space, and run again: the run goes on from its last checkpoint") from error
