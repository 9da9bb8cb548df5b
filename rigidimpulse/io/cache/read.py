"""The HDF5 file of a run, read. It may come from anywhere: every table is checked for its type, its shape and its bytes before it is used.

Only tables whose bytes lie in the file in one piece are read: no links to other files, no tables put together from others, no filters.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.files import LEAST_UNPACKED, MOST_UNPACKED
from rigidimpulse.io.cache.arrays import Damaged
from rigidimpulse.io.cache.layout import (
    CHECK,
    COMMIT,
    FORMAT,
    FRAMES,
    Content,
    Header,
    Kept,
    Take,
    attribute_of,
    check_words,
    digest_of,
    empty,
    library,
    seal_of,
)
from rigidimpulse.recording.contacts import CONTACT_DTYPE
from rigidimpulse.recording.events import ROW_LENGTH

REMEDY = "delete it, and run again"
LONGEST_TEXT = 1000
Answer = TypeVar("Answer")
TRIES = 3
"""A run that goes on may write both checkpoints while one of them is read."""


def read(path: Path, alone: bool = False, take: int | None = None) -> tuple[Header, Content]:
    """Return what the file holds of a take as of its last commit.

    Args:
        path: of the file.
        alone: refuse a file that somebody writes to.
        take: its number; None: the one that was written last.

    Raises:
        SceneError: no such file, no cache, one that is damaged, or one that is written to.

    """
    return _tried(path, alone, lambda file, size: _whole(_take(file, take), size))


def read_headers(path: Path) -> list[Header]:
    """Return what the file says of its takes, the one that was written last first; see `read` for what it raises."""

    def headers(file: Any, size: int) -> list[Header]:
        groups = [file, *(_take(file, number) for number in _numbers(file))]
        return [_Reader(group, size).header() for group in groups]

    return _tried(path, True, headers)


def read_origin(path: Path, take: int) -> tuple[bytes, bytes]:
    """Return the bytes of the scene and the settings of a take, and their signature; see `read` for what it raises."""

    def origin(file: Any, size: int) -> tuple[bytes, bytes]:
        reader = _Reader(_take(file, take), size)
        data = reader.table("origin", np.uint8, (None,))[()].tobytes()
        if hashlib.sha256(data).hexdigest() != reader.header().take.origin:
            raise Damaged("the scene of its run has been changed")
        return data, reader.text("origin_signature").encode()

    return _tried(path, True, origin)


def _tried(path: Path, alone: bool, ask: Callable[[Any, int], Answer]) -> Answer:
    """What the file, of a size in bytes, says; see `read` for what it raises."""
    where = f"cache {str(path)!r}"
    if not path.is_file():
        raise SceneError("there is no such file", "check the path", where)
    try:
        for _ in range(TRIES - 1):
            with suppress(Damaged):
                return _read(path, alone, where, ask)
        return _read(path, alone, where, ask)
    except BlockingIOError:
        raise SceneError("another run writes to it", "wait until that ends, or give another name", where) from None
    except SceneError:
        raise
    except Exception as error:  # h5py raises anything on damaged files
        raise SceneError(f"it cannot be read: {str(error) or type(error).__name__}", REMEDY, where) from None


def _read(path: Path, alone: bool, where: str, ask: Callable[[Any, int], Answer]) -> Answer:
    """What the file says at this moment."""
    with _opened(path, alone) as file:
        kind = attribute_of(file, "format")
        if not isinstance(kind, str) or kind != FORMAT:
            remedy = "give another name, or delete it, and run again"
            raise SceneError("it is a cache of another version of the library, or none", remedy, where)
        return ask(file, os.fstat(file.id.get_vfd_handle()).st_size)


def _opened(path: Path, alone: bool) -> Any:
    """The file, open for reading."""
    h5py = library()
    try:
        return h5py.File(path, "r")
    except BlockingIOError:
        if alone:
            raise
        return h5py.File(path, "r", locking=False)


def _numbers(file: Any) -> list[int]:
    """Numbers of the takes that were not written last."""
    takes: Any = file.get("takes") if isinstance(file.get("takes", getlink=True), library().HardLink) else None
    names = list(takes) if isinstance(takes, library().Group) else [""]
    if not all(re.fullmatch("[1-9][0-9]{0,8}", name) for name in names):
        raise Damaged("its takes are none")
    return sorted(map(int, names))


def _take(file: Any, number: int | None) -> Any:
    """The file itself, or the group of a take."""
    if number is None or attribute_of(file, "take") == number:
        return file
    if number not in _numbers(file):
        raise Damaged(f"it has no take {number}")
    name = f"takes/{number}"
    if not isinstance(file.get(name, getlink=True), library().HardLink) or attribute_of(file[name], "take") != number:
        raise Damaged(f"its take {number} is another one")
    return file[name]


def _whole(group: Any, size: int) -> tuple[Header, Content]:
    """What a take in a file of `size` bytes holds."""
    reader = _Reader(group, size)
    header, complete = reader.header(), bool(reader.attribute("complete", np.bool_))
    tables = reader.tables(len(header.names)) if complete else {}
    if seal_of(header, complete, tables) != reader.text("seal"):
        raise Damaged("what it says of its run has been changed")
    content = reader.content(header, complete)
    return header, content._replace(tables={name: _plain(table) for name, table in tables.items()})


def _plain(table: Any) -> Any:
    return table.decode() if isinstance(table, bytes) else table


def unpacked_state(kept: Kept) -> bytes | None:
    """Return the bytes of the state of a checkpoint, None where it does not agree with its commit."""
    commit, data = kept
    size, length = len(data), int(commit["length"])
    if digest_of(commit, data) != commit["digest"]:
        return None
    if length > MOST_UNPACKED * size + LEAST_UNPACKED:
        raise Damaged(f"a state of {length} bytes in {size}")
    unpacked = zlib.decompressobj().decompress(data, length + 1)
    if len(unpacked) != length:
        raise Damaged(f"a state of another length than {length} bytes")
    return unpacked


class _Reader:
    """A take in an open file of `size` bytes."""

    def __init__(self, file: Any, size: int) -> None:
        self._file, self._size = file, size

    def attribute(self, name: str, kind: type) -> Any:
        """An attribute of just this type."""
        value = attribute_of(self._file, name)
        if not isinstance(value, kind):
            raise Damaged(f"its {name} is a {type(value).__name__}")
        return value

    def text(self, name: str) -> str:
        """A short text among the attributes."""
        text = self.attribute(name, str)
        if len(text) > LONGEST_TEXT:
            raise Damaged(f"its {name} has {len(text)} characters")
        return text

    def number(self, name: str) -> float:
        """A number > 0 among the attributes."""
        value = float(self.attribute(name, np.floating))
        if not 0.0 < value < np.inf:
            raise Damaged(f"its {name} is {value}")
        return value

    def count(self, name: str) -> int:
        """A whole number >= 0 among the attributes."""
        value = int(self.attribute(name, np.integer))
        if value < 0:
            raise Damaged(f"its {name} is {value}")
        return value

    def table(self, name: str, dtype: Any, shape: tuple[int | None, ...]) -> Any:
        """A table whose bytes lie in the file, of this type and shape; None: any length. dtype None: a text."""
        h5py = library()
        parts = name.split("/")
        for end in range(1, len(parts) + 1):
            if not isinstance(self._file.get("/".join(parts[:end]), getlink=True), h5py.HardLink):
                raise Damaged(f"there is no table {name} in it")
        table = self._file[name]
        if not isinstance(table, h5py.Dataset) or table.shape is None or table.is_virtual or table.external or table.chunks is not None:
            raise Damaged(f"{name} is no table in one piece")
        if (table.dtype.kind != "S") if dtype is None else (table.dtype != dtype):
            raise Damaged(f"{name} holds numbers of type {table.dtype}")
        if len(table.shape) != len(shape) or any(want not in (None, have) for want, have in zip(shape, table.shape, strict=True)):
            raise Damaged(f"{name} is of shape {table.shape}")
        size, offset = table.id.get_storage_size(), table.id.get_offset() or 0
        if size != table.nbytes or offset + size > self._size:
            raise Damaged(f"{name} has {table.nbytes} bytes, in the file are {min(size, max(self._size - offset, 0))}")
        return table

    def header(self) -> Header:
        """What the file says of its run."""
        names = json.loads(bytes(self.table("names", None, ())[()]))
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise Damaged("its names are none")
        times = self.table("times", np.float64, (None,))[()]
        if not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0.0) or np.any(times < 0.0):
            raise Damaged("its times are none that follow each other")
        offset, turn = (self.table(f"body/{name}", np.float64, (len(names), width))[()] for name, width in (("offset", 3), ("turn", 4)))
        if not np.all(np.isfinite(offset)) or not np.all(np.isfinite(turn)):
            raise Damaged("the frames of its bodies are no finite numbers")
        known = self.text("fingerprint"), self.text("version"), self.number("duration"), self.number("fps")
        take = Take(self.count("take"), self.count("base"), self.count("first_frame"), self.text("origin"))
        if take.number < 1 or take.base == take.number or (take.base > 0) != (take.first_frame > 0):
            raise Damaged("its takes are none")
        return Header(*known, names, times, offset, turn, take)

    def content(self, header: Header, complete: bool) -> Content:
        """What the last commit counts that agrees with its digest."""
        commits = self.table("checkpoint/commits", COMMIT, (2,))[()]
        for slot in np.argsort(commits["number"])[::-1].tolist():
            state = self._state(slot, commits[slot])
            if state is None:
                continue
            time, counts = float(commits["time"][slot]), {name: int(commits[name][slot]) for name in ("frames", "impacts")}
            if not 0.0 <= time < np.inf:
                raise Damaged(f"its last checkpoint is at {time} s")
            frames = {
                name: self._rows(f"frames/{name}", (len(header.times), len(header.names), width), counts["frames"])
                for name, width in FRAMES.items()
            }
            self._check("frames", *frames.values())
            impacts = self._rows("impacts", (None, ROW_LENGTH), counts["impacts"])
            self._check("impacts", impacts)
            bodies = impacts[:, 1:3]
            if not np.all((bodies >= 0.0) & (bodies < len(header.names))):
                raise Damaged("its impacts are of bodies that it does not have")
            return Content(frames, impacts, time, state, complete, {}, self.kept(counts), commits[slot])
        if complete or np.all(commits["number"] > 0):
            raise Damaged("no checkpoint agrees with its digest")
        return empty(len(header.names))

    def _state(self, slot: int, commit: np.void) -> bytes | None:
        """The state in a slot, None where it does not agree with its commit."""
        stored, size = self.table(f"checkpoint/{slot}", np.uint8, (None,)), int(commit["size"])
        if commit["number"] == 0 or size > len(stored):
            return None
        return unpacked_state(Kept(commit, stored[:size].tobytes()))

    def kept(self, counts: dict[str, int]) -> list[Kept]:
        """Earlier checkpoints, in order of time, none beyond what is counted."""
        commits, states = self.table("kept/commits", COMMIT, (None,))[()], self.table("kept/states", np.uint8, (None,))
        ends = np.cumsum(commits["size"].astype(float))
        in_order = np.all(np.isfinite(commits["time"])) and np.all(np.diff(commits["time"]) > 0.0)
        if not in_order or np.append(0.0, ends)[-1] != len(states):
            raise Damaged("its earlier checkpoints are none")
        if any(np.any(commits[name] > count) for name, count in counts.items()):
            raise Damaged("an earlier checkpoint counts more than the last one")
        places = [(int(end) - int(commit["size"]), int(end)) for commit, end in zip(commits, ends, strict=True)]
        return [Kept(commit, states[first:end].tobytes()) for commit, (first, end) in zip(commits, places, strict=True)]

    def _rows(self, name: str, shape: tuple[int | None, ...], count: int) -> np.ndarray:
        """The first rows of a table of numbers."""
        table = self.table(name, np.float64, shape)
        if count > len(table):
            raise Damaged(f"{name} has {len(table)} rows, and counts {count}")
        return table[:count]

    def _check(self, name: str, *tables: np.ndarray) -> None:
        """Compare rows with what was noted of them when they were written."""
        noted = self.table(f"checks/{name}", CHECK, (None,))
        if not np.array_equal(noted[: len(tables[0])], check_words(*tables)):
            raise Damaged(f"its {name} have been changed")

    def tables(self, n: int) -> dict[str, Any]:
        """What only a finished run of n bodies has, as it is stored."""
        known: dict[str, Any] = {"status": self.table("tables/status", None, ())[()]}
        known["contacts"] = self.table("tables/contacts", CONTACT_DTYPE, (None,))[()]
        for name in ("body_a", "body_b"):
            if not np.all((known["contacts"][name] >= 0) & (known["contacts"][name] < n)):
                raise Damaged("its contacts are of bodies that it does not have")
        while (name := f"soft_body{len(known) // 3}") + "_name" in self._file["tables"]:
            known[f"{name}_name"] = self.table(f"tables/{name}_name", None, ())[()]
            vertices = known[f"{name}_vertices"] = self.table(f"tables/{name}_vertices", np.float64, (None, None, 3))[()]
            faces = known[f"{name}_faces"] = self.table(f"tables/{name}_faces", np.int64, (None, 3))[()]
            if not np.all((faces >= 0) & (faces < vertices.shape[1])):
                raise Damaged("its flexible bodies have faces without corners")
        return known
