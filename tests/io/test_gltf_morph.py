"""Flexible bodies in glTF files: morph targets and their weights give the recorded vertices, in single precision."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_files import unpack, values

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.dynamics.soft_body.track import FlexibleTrack
from rigidimpulse.io.gltf.morph import kept_frames


@pytest.fixture(scope="module")
def run() -> ri.Recording:
    entry = gallery.load("cloth_on_ball")
    return ri.simulate(entry.scene(), 0.3, 30.0)


def played(path: Path, name: str, times: np.ndarray) -> np.ndarray:
    """Vertices (k, v, 3) of a node's mesh at times, as a player makes them of base, targets and weights."""
    tree, data = unpack(path)
    node = next(k for k, entry in enumerate(tree["nodes"]) if entry.get("name") == name)
    primitive = tree["meshes"][tree["nodes"][node]["mesh"]]["primitives"][0]
    base = values(tree, data, primitive["attributes"]["POSITION"]).astype(float)
    targets = np.array([values(tree, data, target["POSITION"]) for target in primitive["targets"]], float)
    channel = next(c for c in tree["animations"][0]["channels"] if c["target"] == {"node": node, "path": "weights"})
    sampler = tree["animations"][0]["samplers"][channel["sampler"]]
    keys = values(tree, data, sampler["input"]).ravel()
    weights = values(tree, data, sampler["output"]).reshape(len(keys), len(targets))
    shares = np.array([np.interp(times, keys, column) for column in weights.T])
    return base + np.einsum("tk,tvd->kvd", shares, targets)


def test_frames_are_the_recorded_ones_and_between_them_straight(run: ri.Recording, tmp_path: Path) -> None:
    path = run.export(tmp_path / "cloth.glb")
    (track,) = run.soft_bodies
    np.testing.assert_allclose(played(path, track.name, run.times), track.vertices, rtol=0, atol=1e-6)
    middle = 0.5 * (run.times[3] + run.times[4])
    halfway = 0.5 * (track.vertices[3] + track.vertices[4])
    np.testing.assert_allclose(played(path, track.name, np.array([middle]))[0], halfway, rtol=0, atol=1e-6)


def test_start_frame_moves_the_weights_too(run: ri.Recording, tmp_path: Path) -> None:
    path = run.export(tmp_path / "cloth.glb", start_frame=1001)
    track = run.soft_bodies[0]
    np.testing.assert_allclose(played(path, track.name, run.times + 1001 / 30.0), track.vertices, rtol=0, atol=1e-4)


def test_left_out_frames_are_missed_by_no_more_than_the_tolerance(run: ri.Recording, tmp_path: Path) -> None:
    # A net that falls: g t^2 / 2 between keys h apart is off a straight line by g h^2 / 8.
    times = np.arange(101) / 100.0
    fall = np.zeros((101, 4, 3)) + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    fall[:, :, 2] -= 0.5 * 9.81 * times[:, None] ** 2
    for tolerance in (1e-1, 1e-2, 1e-3):
        kept = kept_frames(fall, tolerance)
        off = max(np.abs(np.interp(times, times[kept], fall[kept, v, 2]) - fall[:, v, 2]).max() for v in range(4))
        assert off <= tolerance
        assert len(kept) <= 2.0 * np.sqrt(9.81 / (8.0 * tolerance)) + 2.0
    still = FlexibleTrack("still", np.zeros((101, 4, 3)) + fall[0], np.array([[0, 1, 2], [1, 3, 2]]))
    assert kept_frames(still.vertices, None).tolist() == kept_frames(still.vertices, 1e-3).tolist() == [0]
    path = replace(run, soft_bodies=[replace(still, vertices=still.vertices[: len(run.times)])]).export(tmp_path / "still.glb")
    tree: dict[str, Any] = unpack(path)[0]
    assert not any(channel["target"]["path"] == "weights" for a in tree.get("animations", []) for channel in a["channels"])
