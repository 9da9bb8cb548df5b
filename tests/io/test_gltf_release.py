"""Animated nodes that are let go: files with and without physics, and the way there and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gltf_files import BOX, Gltf, physics, shaped, with_physics

import rigidimpulse as ri

TIMES = np.linspace(0.0, 1.0, 25)
PATH = TIMES[:, None] * np.array([1.0, 0.5, 0.0]) + [0.0, 5.0, 0.0]


def check_thrown(run: ri.Recording, release: float) -> None:
    """The body flies on from where it is let go, with the velocity of its keys (single precision in the file)."""
    after = np.maximum(run.times - release, 0.0)[:, None]
    expected = np.array([0.0, 5.0, 0.0]) + run.times[:, None] * [1.0, 0.5, 0.0] + 0.5 * np.array([0.0, -9.81, 0.0]) * after**2
    np.testing.assert_allclose(run.position("crate"), expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize("kinematic", [False, True])
def test_with_physics(tmp_path: Path, kinematic: bool) -> None:
    motion = {"mass": 2.0, "isKinematic": kinematic}
    nodes = [{"name": "crate", "extensions": physics(motion, shaped()), "extras": {"release_time": 0.5}}]
    file = with_physics(nodes, [BOX])
    file.animate(0, "translation", TIMES, PATH)
    scene = ri.load_scene(file.save(tmp_path / "thrown.glb"))
    assert (scene["crate"].motion, scene["crate"].release_time, scene["crate"].mass) == ("kinematic", 0.5, 2.0)
    check_thrown(ri.simulate(scene, 0.9), 0.5)


def test_without_physics(tmp_path: Path) -> None:
    file = Gltf([{"name": "crate", "mesh": 0, "extras": {"release_time": 0.25}}])
    file.mesh()
    file.animate(0, "translation", TIMES, PATH)
    scene = ri.load_scene(file.save(tmp_path / "thrown.glb"))
    check_thrown(ri.simulate(scene, 0.9), 0.25)


def test_there_and_back(tmp_path: Path) -> None:
    keys = ri.Keyframes(TIMES, PATH)
    box = ri.Shape.box((1, 2, 3))
    body = ri.Body("crate", box, motion="kinematic", position=PATH[0], mass=7.0, keyframes=keys, release_time=0.75)
    again = ri.load_scene(ri.Scene(gravity=(0, -9.81, 0), bodies=[body]).export(tmp_path / "scene.glb"))["crate"]
    assert (again.motion, again.release_time) == ("kinematic", 0.75)
    assert again.mass == pytest.approx(7.0)
    check_thrown(ri.simulate(ri.Scene(gravity=(0, -9.81, 0), bodies=[again]), 0.9), 0.75)


@pytest.mark.parametrize("value", ["soon", -1.0, 0, True, 1e300])
def test_what_is_no_time_is_refused(tmp_path: Path, value: object) -> None:
    file = Gltf([{"name": "crate", "mesh": 0, "extras": {"release_time": value}}])
    file.mesh()
    with pytest.raises(ri.SceneError, match="release_time"):
        ri.load_scene(file.save(tmp_path / "bad.glb"))
