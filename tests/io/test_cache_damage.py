"""Damaged caches are refused with the file's name and a remedy, or give the same bits; what killed runs leave goes away."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kept_runs import pile

import rigidimpulse as ri
from rigidimpulse.io.cache.file import CacheFile
from rigidimpulse.io.cache.layout import FRAMES, Content, Header, check_words, empty
from rigidimpulse.io.cache.read import read

h5py = pytest.importorskip("h5py")
MUTATIONS = 400

MACHINE = hashlib.sha256(platform.node().encode()).hexdigest()[:8]
"""The mark of this machine in names of temporary files."""


class Stopped(Exception):
    """Raised in the middle of a run."""


def stop(now: float) -> None:
    """End a run after its first steps."""
    if now >= 0.03:
        raise Stopped


def simulate(path: Path, **more: Any) -> ri.Recording:
    return ri.simulate(pile(), 0.06, 100.0, cache=ri.Cache(path, every=0.0), **more)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The bytes of the cache of a run, with few earlier checkpoints: those are read only where a changed scene goes on."""
    path = tmp_path_factory.mktemp("finished") / "run.h5"
    ri.simulate(pile(), 0.06, 100.0, cache=ri.Cache(path, every=60.0))
    return path.read_bytes()


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The bytes of the cache of a run that was stopped on its way."""
    path = tmp_path_factory.mktemp("stopped") / "run.h5"
    with pytest.raises(Stopped):
        simulate(path, progress=stop)
    return path.read_bytes()


def mutated(content: bytes, numbers: random.Random, place: int | None = None) -> bytes:
    """The same bytes with one, or a few that follow each other, replaced: from a place on, or anywhere."""
    place, count = numbers.randrange(len(content)) if place is None else place, numbers.choice((1, 1, 1, 8, 100))
    return content[:place] + numbers.randbytes(len(content[place : place + count])) + content[place + count :]


def tables_of(path: Path) -> list[tuple[int, int]]:
    """Where the tables of a cache begin in its file, and their sizes in bytes."""
    found: list[tuple[int, int]] = []
    with h5py.File(path) as file:
        file.visititems(lambda _, it: found.append((it.id.get_offset(), it.nbytes)) if isinstance(it, h5py.Dataset) and it.nbytes else None)
    return found


def parts(path: Path) -> tuple[Any, ...]:
    """All that is read of a cache, as things that can be compared."""
    header, content = read(path)
    tables = {name: table if isinstance(table, str) else table.tobytes() for name, table in content.tables.items()}
    told = (header.fingerprint, header.version, header.duration, header.fps, header.names, content.time, content.complete, content.state)
    arrays = [header.times, header.offset, header.turn, content.impacts, *content.frames.values()]
    return *told, tables, [array.tobytes() for array in arrays]


@pytest.mark.parametrize("seed", range(2))
def test_mutations_of_a_finished_cache_are_refused_or_change_nothing(seed: int, finished: bytes, tmp_path: Path) -> None:
    path, numbers = tmp_path / "run.h5", random.Random(seed)
    path.write_bytes(finished)
    whole, refused, tables = parts(path), 0, tables_of(path)
    for k in range(MUTATIONS // 2):
        # Most bytes are earlier checkpoints, which are not read here: every second mutation is one of a table, large or small.
        offset, size = tables[k // 2 % len(tables)]
        path.write_bytes(mutated(finished, numbers, offset + numbers.randrange(size) if k % 2 else None))
        try:
            assert parts(path) == whole
        except ri.SceneError as error:
            refused += 1
            assert "run.h5" in str(error) and ("delete it" in str(error) or "another name" in str(error))
    assert refused > MUTATIONS // 8


def test_runs_from_mutated_caches_are_refused_or_end_with_the_same_bits(stopped: bytes, tmp_path: Path) -> None:
    path, numbers = tmp_path / "run.h5", random.Random(7)
    whole, refused = ri.simulate(pile(), 0.06, 100.0).state_hash(), 0
    for _ in range(30):
        path.write_bytes(mutated(stopped, numbers))
        try:
            assert simulate(path).state_hash() == whole
        except ri.SceneError as error:
            refused += 1
            assert "run.h5" in str(error)
    assert refused < 30


def test_a_changed_scene_goes_on_from_a_mutated_cache_with_the_same_bits_or_not(tmp_path: Path) -> None:
    path, numbers, outcomes = tmp_path / "run.h5", random.Random(4), []
    simulate(path)
    whole = path.read_bytes()
    expected = ri.simulate(pile(), 0.06, 100.0, cache=path, from_frame=4).state_hash()
    with h5py.File(path) as file:
        tables = [file["takes/1"][name] for name in ("kept/states", "kept/commits", "origin", "frames/position", "checkpoint/commits")]
        places = [(table.id.get_offset(), table.nbytes) for table in tables]
    whole = path.read_bytes()
    for k in range(30):
        offset, size = places[k % len(places)]
        at, changed = offset + numbers.randrange(size), bytearray(whole)
        changed[at] ^= 1 << numbers.randrange(8)
        path.write_bytes(changed)
        try:
            outcomes.append(ri.simulate(pile(), 0.06, 100.0, cache=path, from_frame=4).state_hash() == expected)
        except ri.SceneError as error:
            outcomes.append("delete it" in str(error) or "delete the cache" in str(error))
    assert all(outcomes)


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("duration", np.nan, "its duration is nan"),
        ("duration", -1.0, "its duration is -1.0"),
        ("duration", np.bytes_(b"long"), "its duration is a str"),
        ("duration", "long", "its duration is a NoneType"),
        ("fps", np.inf, "its fps is inf"),
        ("fps", np.zeros(3), "its fps is a ndarray"),
        ("fingerprint", 7, "its fingerprint is a"),
        ("version", np.bytes_(b"9" * 2000), "its version has 2000 characters"),
        ("version", np.bytes_(b"0.0.0"), "has been changed"),
        ("complete", 7, "its complete is a"),
        ("complete", False, "has been changed"),
        ("seal", np.bytes_(b"0"), "has been changed"),
        ("format", 7, "another version of the library, or none"),
        ("format", np.bytes_(b"rigidimpulse cache 2"), "another version of the library, or none"),
        ("format", "rigidimpulse cache 4", "another version of the library, or none"),
    ],
)
def test_attributes_of_wrong_values_are_refused(name: str, value: Any, told: str, finished: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(finished)
    with h5py.File(path, "r+") as file:
        file.attrs[name] = value
    with pytest.raises(ri.SceneError, match=told):
        ri.load_recording(path)


def test_a_cache_has_no_texts_of_variable_length(finished: bytes) -> None:
    """They lie in a place of their own (GCOL) without checks. HDF5 reads it for ever where the size of a text in it is 0."""
    assert b"GCOL" not in finished


BIG = 2**40
TABLES = {
    "names": (np.bytes_(b'{"a": 1}'), "its names are none"),
    "times": (np.array([0.0, np.nan]), "its times are none"),
    "body/offset": (np.full((9, 3), np.nan), "body/offset is of shape|no finite numbers"),
    "body/turn": (np.zeros((8, 4), np.float32), "numbers of type float32"),
    "frames/position": (np.zeros((7, 8, 4)), "is of shape"),
    "frames/velocity": (np.zeros((7, 8, 3), ">f8"), "numbers of type >f8"),
    "impacts": (np.zeros((0, 14)), "impacts is of shape"),
    "checkpoint/commits": (np.zeros(2), "numbers of type float64"),
    "tables/status": (np.bytes_(b"ok"), "has been changed"),
    "tables/contacts": (np.zeros(3), "numbers of type float64"),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_wrong_types_are_refused(name: str, finished: bytes, tmp_path: Path) -> None:
    path, (table, told) = tmp_path / "run.h5", TABLES[name]
    path.write_bytes(finished)
    with h5py.File(path, "r+") as file:
        del file[name]
        file[name] = table
    with pytest.raises(ri.SceneError, match=told):
        ri.load_recording(path)


def test_tables_that_do_not_lie_in_the_file_are_refused(finished: bytes, tmp_path: Path) -> None:
    path, other = tmp_path / "run.h5", tmp_path / "other.h5"
    secret = tmp_path / "secret"
    secret.write_bytes(bytes(10_000))
    other.write_bytes(finished)

    def external(file: Any) -> None:
        file.create_dataset("frames/position", (7, 8, 3), float, external=[(str(secret), 0, 10_000)])

    def huge(file: Any) -> None:
        file.create_dataset("frames/position", (7, 8, BIG), float)

    def packed(file: Any) -> None:
        file.create_dataset("frames/position", (7, 8, 3), float, compression="gzip")

    def virtual(file: Any) -> None:
        layout = h5py.VirtualLayout((7, 8, 3), float)
        layout[...] = h5py.VirtualSource(other, "frames/position", (7, 8, 3))
        file.create_virtual_dataset("frames/position", layout)

    def linked(file: Any) -> None:
        file["frames/position"] = h5py.ExternalLink(other, "frames/position")

    def folder(file: Any) -> None:
        del file["frames"]
        file["frames"] = h5py.ExternalLink(other, "frames")

    for change in (external, huge, packed, virtual, linked, folder):
        path.write_bytes(finished)
        with h5py.File(path, "r+") as file:
            del file["frames/position"]
            change(file)
        with pytest.raises(ri.SceneError, match=r"run\.h5.*frames/position.*delete it, and run again"):
            ri.load_recording(path)


def header(names: list[str], frames: int = 2) -> Header:
    n = len(names)
    return Header("0" * 16, "0.1.0", 1.0, 1.0, names, np.arange(float(frames)), np.zeros((n, 3)), np.tile([1.0, 0, 0, 0], (n, 1)))


def test_caches_of_many_names_are_written_and_read(tmp_path: Path) -> None:
    # Names that took an attribute failed above 64 kB: at some 4,000 bodies.
    names = [f"brick {k} of the wall ö" for k in range(20_000)]
    content = empty(len(names))._replace(state=b"state", frames={name: np.ones((1, 20_000, width)) for name, width in FRAMES.items()})
    file = CacheFile(tmp_path / "run.h5", header(names), None)
    file.commit(content, 0, 0)
    file.close()
    known, found = read(tmp_path / "run.h5")
    assert known.names == names and found.state == b"state"
    np.testing.assert_array_equal(found.frames["orientation"], content.frames["orientation"])


def test_a_changed_number_changes_the_check_of_its_row() -> None:
    numbers = np.random.default_rng(1)
    rows = numbers.normal(size=(20, 3, 4))
    before = check_words(rows, rows[:, :, 0])
    for row in range(20):
        changed = rows.copy()
        changed.view(np.uint8)[row, 1, numbers.integers(32)] ^= 1 << int(numbers.integers(8))
        assert np.flatnonzero(check_words(changed, rows[:, :, 0]) != before).tolist() == [row]
    assert check_words(rows[:0]).shape == (0,)


def test_files_that_killed_runs_left_are_removed(tmp_path: Path) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    left = tmp_path / f".run.{MACHINE}.{gone.pid}.0123abcd.h5"
    kept = [
        tmp_path / name
        for name in (
            f".run.{MACHINE}.{os.getppid()}.0123abcd.h5", ".run.x.h5", f".other.{MACHINE}.{gone.pid}.0123abcd.h5",
            f".run.{MACHINE}.{gone.pid}.0123abcd.npz", f".run.89abcdef.{gone.pid}.0123abcd.h5",
        )
    ]  # fmt: skip
    for path in (left, *kept):
        path.write_bytes(b"half a file")
    CacheFile(tmp_path / "run.h5", header(["a"]), None).close()
    assert not left.exists()
    assert all(path.exists() for path in kept)


def test_a_file_that_somebody_holds_is_kept(tmp_path: Path) -> None:
    fcntl = pytest.importorskip("fcntl")
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    left = tmp_path / f".run.{MACHINE}.{gone.pid}.0123abcd.h5"
    with left.open("wb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        CacheFile(tmp_path / "run.h5", header(["a"]), None).close()
        assert left.exists()


def test_a_status_that_is_none_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    from rigidimpulse.recording.contacts import CONTACT_DTYPE

    for status in ("[]", "{}", "ok", "[" * 100_000, json.dumps({"ok": True, "message": "", "events": [{"bodies": 3}]})):
        frames = {name: np.ones((2, 1, width)) for name, width in FRAMES.items()}
        tables = {"status": np.array(status), "contacts": np.zeros(0, CONTACT_DTYPE)}
        CacheFile(path, header(["a"]), None).finish(Content(frames, np.zeros((0, 15)), 1.0, b"state", True, tables))
        with pytest.raises(ri.SceneError, match=r"run\.h5.*status.*delete it"):
            ri.load_recording(path)
