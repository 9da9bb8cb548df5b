"""Damaged .npz recordings, names that files cannot hold, disks that are full: all end in a `SceneError` that names the file."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri


def scene(name: str = "ball") -> ri.Scene:
    """A ball above a floor."""
    floor = ri.Body("floor", ri.Shape.box((2, 2, 1)), position=(0, 0, -0.5), motion="static")
    return ri.Scene(bodies=[floor, ri.Body(name, ri.Shape.sphere(0.1), position=(0, 0, 0.5))])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The bytes of an .npz recording with an impact."""
    return ri.simulate(scene(), 0.5, 30).export(tmp_path_factory.mktemp("run") / "run.npz").read_bytes()


def with_array(data: bytes, name: str, content: bytes, packing: int = zipfile.ZIP_DEFLATED) -> bytes:
    """The same recording with other bytes as one of its arrays."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w", packing) as new:
        for member in old.namelist():
            new.writestr(member, content if member == f"{name}.npy" else old.read(member))
    return out.getvalue()


def array_bytes(array: np.ndarray) -> bytes:
    """An array as the bytes of an .npy file."""
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def claimed(shape: str, dtype: str = "<f8") -> bytes:
    """The head of an .npy file of any shape, with nothing behind it."""
    head = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode()


def refusal(path: Path, data: bytes) -> str:
    """What is said of a file with these bytes."""
    path.write_bytes(data)
    with pytest.raises(ri.SceneError) as caught:
        ri.load_recording(path)
    assert path.name in str(caught.value) and caught.value.remedy
    return str(caught.value)


FORGED = {
    "745 GiB": (claimed("(100000000000,)"), "claims 800000000000 bytes"),
    "an overflowing shape": (claimed("(4294967296, 4294967296, 4294967296)"), "claims"),
    "a negative shape": (claimed("(-1,)"), "claims"),
    "no head": (b"nothing", "magic"),
    "another version": (b"\x93NUMPY\x09\x00" + b" " * 200, "unknown version"),
    "objects": (claimed("(1,)", "|O"), "bytes of object"),
    "another length": (array_bytes(np.arange(3.0)), "shape (16,"),
    "another type": (array_bytes(np.zeros(16, np.float32)), "float32"),
    "times that go back": (array_bytes(np.linspace(1.0, 0.0, 16)), "follow each other"),
    "no numbers": (array_bytes(np.full(16, np.nan)), "follow each other"),
}  # fmt: skip


@pytest.mark.parametrize("what", FORGED)
def test_forged_arrays(what: str, recorded: bytes, tmp_path: Path) -> None:
    content, told = FORGED[what]
    tracemalloc.start()
    try:
        message = refusal(tmp_path / "forged.npz", with_array(recorded, "times", content))
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()
    assert told in message or "times" in message


def test_indices_of_bodies(recorded: bytes, tmp_path: Path) -> None:
    with np.load(io.BytesIO(recorded)) as arrays:
        impacts = arrays["impacts"]
    assert len(impacts)
    impacts["body_b"] = 7
    assert "bodies that it does not have" in refusal(tmp_path / "forged.npz", with_array(recorded, "impacts", array_bytes(impacts)))


def test_other_packings_are_refused(recorded: bytes, tmp_path: Path) -> None:
    other = with_array(recorded, "", b"", zipfile.ZIP_BZIP2)
    assert "packed in a way" in refusal(tmp_path / "run.npz", other)
    stored = tmp_path / "stored.npz"
    stored.write_bytes(with_array(recorded, "", b"", zipfile.ZIP_STORED))
    assert ri.load_recording(stored).names == ["floor", "ball"]


def test_status_that_is_none(recorded: bytes, tmp_path: Path) -> None:
    for text in ("", "[]", "3", "[" * 100_000, json.dumps({"ok": True, "message": "", "events": [3]})):
        assert "status" in refusal(tmp_path / "run.npz", with_array(recorded, "status", array_bytes(np.array(text))))


def test_damaged_bytes(recorded: bytes, tmp_path: Path) -> None:
    """Any byte may be wrong, and the file may end anywhere: a `SceneError`, or the same recording."""
    random, refused = np.random.default_rng(30), 0
    path = tmp_path / "run.npz"
    for _ in range(300):
        data = bytearray(recorded[: random.integers(len(recorded))] if random.random() < 0.2 else recorded)
        for _ in range(random.integers(1, 4)):
            if data:
                data[random.integers(len(data))] = random.integers(256)
        path.write_bytes(data)
        try:
            assert ri.load_recording(path).names == ["floor", "ball"]
        except ri.SceneError as error:
            refused += 1
            assert "run.npz" in str(error)
    assert refused > 150


@pytest.mark.parametrize("name", ["a\0b", "\0", "a\ud800", "\udcff"])
def test_names_that_no_file_can_hold(name: str) -> None:
    ball = ri.Shape.sphere(1.0)
    for thing in (ri.Body(name, ball), ri.Trigger(name, ball), ri.BallJoint("a", "b", (0, 0, 0), name=name)):
        with pytest.raises(ri.SceneError, match=r"NUL|surrogate"):
            ri.Scene().add(thing)


FULL = """
import resource
import rigidimpulse as ri
scene = ri.Scene(bodies=[ri.Body("ball", ri.Shape.sphere(0.1))])
run = ri.simulate(scene, 0.1)
for suffix in [".npz", ".csv", ".html", ".glb", ".usda", ".usdc", ".usdz", ".h5"]:
    for limit in (100, 3000):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
        try:
            ri.simulate(scene, 0.1, cache="out/run.h5") if suffix == ".h5" else run.export(f"out/run{suffix}")
        except ri.SceneError as error:
            print(limit, error)
"""


def test_a_full_disk(tmp_path: Path) -> None:
    """A limit of 100 bytes a file: a message, no traceback of any library, and no rest of the file."""
    for module in ("resource", "h5py", "pxr"):
        pytest.importorskip(module)
    (tmp_path / "out").mkdir()
    done = subprocess.run([sys.executable, "-c", FULL], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and not done.stderr, done.stderr
    told = [line for line in done.stdout.splitlines() if line.startswith("100 ")]
    for suffix in (".npz", ".csv", ".html", ".glb", ".usda", ".usdc", ".usdz", ".h5"):
        assert any(f"run{suffix}': it cannot be written (" in line for line in told), (suffix, done.stdout)
    assert "3000 file 'out/run.h5': it cannot be written (" in done.stdout
    assert not [path.name for path in (tmp_path / "out").iterdir() if path.name.startswith(".")]


def test_folders_that_are_missing(tmp_path: Path) -> None:
    """No folder is made that nobody asked for."""
    run = ri.simulate(ri.Scene(bodies=[ri.Body("ball", ri.Shape.sphere(0.1))]), 0.1)
    writers = [lambda: run.export(tmp_path / "no" / "run.npz"), lambda: scene().export(tmp_path / "no" / "scene.glb")]
    for write in writers:
        with pytest.raises(ri.SceneError, match=r"there is no folder .*no'; make the folder"):
            write()
    with pytest.raises(ri.SceneError, match="it is a folder"):
        (tmp_path / "run.npz").mkdir()
        run.export(tmp_path / "run.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]
