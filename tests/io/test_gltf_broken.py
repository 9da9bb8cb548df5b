"""Broken files: every one of 200 ends in a `SceneError` or in a scene, at once (more: tests/bench/fuzz.py)."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from broken_files import broken, good_files

import rigidimpulse as ri
from rigidimpulse.engine.compile_scene import compile_scene

CASES = 200
MOST_SECONDS = 5.0


def test_the_files_are_good_before_they_are_broken(tmp_path: Path) -> None:
    for file in good_files():
        scene = ri.load_scene(file.save(tmp_path / "good.glb"))
        assert compile_scene(scene).num_bodies == len(scene.bodies) > 0


@pytest.mark.parametrize("part", range(4))
def test_broken_files_are_refused_or_read(part: int, tmp_path: Path) -> None:
    """Warnings of numpy are errors here, too. What was read is written again, whole, or refused without a trace."""
    path, refused = tmp_path / "broken.glb", 0
    seeds = range(part, CASES, 4)
    for seed in seeds:
        path.write_bytes(broken(seed))
        begin = time.perf_counter()
        try:
            scene = ri.load_scene(path)
            compile_scene(scene)
            scene.export(tmp_path / "out.glb")
            ri.load_scene(tmp_path / "out.glb")
        except ri.SceneError as error:
            assert str(error)
            refused += 1
        assert time.perf_counter() - begin < MOST_SECONDS, f"seed {seed}"
    # Most are refused, and some are not broken where it matters.
    assert 0.3 * len(seeds) < refused < len(seeds)
    assert {entry.name for entry in tmp_path.iterdir()} <= {"broken.glb", "out.glb"}


@pytest.mark.parametrize("data", [b"", b"glTF", b"{}", b"[]", b"null", b"{", b"\xff\xfe", b'{"asset": {"version": "1.0"}}', b"[" * 100_000])
def test_what_is_no_gltf_file(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "it.gltf").write_bytes(data)
    with pytest.raises(ri.SceneError, match=r"it\.gltf"):
        ri.load_scene(tmp_path / "it.gltf")


@pytest.mark.parametrize("value", ["NaN", "1e999", "1e30", '"1"', "true", "null"])
def test_numbers_that_are_none(value: str, tmp_path: Path) -> None:
    text = '{"asset": {"version": "2.0"}, "nodes": [{"translation": [VALUE, 0, 0]}]}'.replace("VALUE", value)
    (tmp_path / "it.gltf").write_text(text)
    with pytest.raises(ri.SceneError):
        ri.load_scene(tmp_path / "it.gltf")


def test_an_index_beyond_all_bounds_takes_no_memory(tmp_path: Path) -> None:
    for count in (2**53 - 1, 999_999_999):
        entry = f'{{"componentType": 5126, "type": "VEC3", "count": {count}}}'
        mesh = '"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]'
        text = f'{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}], {mesh}, "accessors": [{entry}]}}'
        (tmp_path / "it.gltf").write_text(text)
        with pytest.raises(ri.SceneError, match="without bytes"):
            ri.load_scene(tmp_path / "it.gltf")
