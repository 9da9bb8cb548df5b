"""glTF files on the command line: scenes in, motion out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from click.testing import CliRunner
from gltf_files import BOX, channels, physics, shaped, unpack, with_physics
from player import check_structure

from rigidimpulse.cli.cli import main


def call(*arguments):
    """Run a command in this process."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_a_file_goes_through(tmp_path: Path) -> None:
    """A box thrown up: y = 3 t - 9.81 t^2 / 2 in single precision, frames from 1001 on, the report on the error stream."""
    motion = {"mass": 1, "linearVelocity": [0, 3, 0], "inertiaDiagonal": [1, 1, 1]}
    file = with_physics([{"name": "box", "extensions": physics(motion, shaped())}, {"name": "lamp"}], [BOX])
    file.tree["extensionsUsed"].append("MSFT_lod")
    file.save(tmp_path / "in.glb")
    out = tmp_path / "out.glb"
    result = call("simulate", tmp_path / "in.glb", "-o", out, "--fps", 24, "--duration", 0.5, "--start-frame", 1001)
    assert result.exit_code == 0, result.output
    assert "MSFT_lod is not read" in result.stderr
    tree, data = unpack(out)
    check_structure(tree, data)
    found = channels(tree, data)
    assert set(found) == {("box", "translation")} and tree["nodes"][1] == {"name": "lamp"}
    times, places = found["box", "translation"]
    t = np.arange(13) / 24
    assert np.abs(times - (1001 + np.arange(13)) / 24).max() < 4e-6
    assert np.abs(places[:, 1] - (3 * t - 0.5 * 9.81 * t**2)).max() < 1e-6
    assert "exact flight" in call("explain", tmp_path / "in.glb").stdout
    few = tmp_path / "few.gltf"
    assert call("simulate", tmp_path / "in.glb", "-o", few, "--tolerance", 0.01).exit_code == 0 and few.is_file()


def test_a_gallery_scene_becomes_a_file(tmp_path: Path) -> None:
    out = tmp_path / "demo.glb"
    result = call("demo", "two_spheres", "-o", out, "--fps", 24)
    assert result.exit_code == 0 and "wrote" in result.stdout, result.output
    check_structure(*unpack(out))
