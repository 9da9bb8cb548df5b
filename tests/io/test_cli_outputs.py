"""Outputs of the command line: what cannot be written is refused before the run, and one that fails does not cost the others."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from rigidimpulse.cli.cli import main

SCENE = """import rigidimpulse as ri
def scene():
    return ri.Scene(bodies=[ri.Body("ball", ri.Shape.sphere(0.1), velocity=(1, 0, 3))])
"""
OPTIONS = [
    ("out.usda", ("--unit", "0"), "unit"), ("out.usda", ("--samples", "0"), "samples"), ("out.glb", ("--tolerance", "-1"), "tolerance"),
    ("out.glb", ("--tolerance", "nan"), "tolerance"), ("out.glb", ("--start-frame", "nan"), "start_frame"),
    ("out.glb", ("--start-frame", "-10"), "start_frame"), ("out.npz", ("--start-frame", "-10"), "start_frame"),
    ("out.glb", ("--pre-roll", "13"), "pre-roll"), ("out.glb", ("--unit", "0.01"), "unit"), ("out.gltf", ("--up-axis", "z"), "up_axis"),
]  # fmt: skip


def simulated(folder: Path, *arguments: object, scene: Path | None = None) -> tuple[int, str, str]:
    """Exit code, output and error stream of a run of 0.5 s at 24 fps."""
    if scene is None:
        scene = folder / "thrown.py"
        scene.write_text(SCENE)
    given = ["simulate", scene, "--duration", 0.5, "--fps", 24, *arguments]
    result = CliRunner().invoke(main, [str(argument) for argument in given])
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize(("name", "options", "told"), OPTIONS)
def test_bad_options_are_told_before_the_run(tmp_path: Path, name: str, options: tuple, told: str) -> None:
    """The run was simulated, "status: ok" printed, and then lost: not even the .npz file that came second was written."""
    if name.endswith("usda"):
        pytest.importorskip("pxr")
    code, output, error = simulated(tmp_path, "-o", tmp_path / name, "-o", tmp_path / "second.npz", *options)
    assert (code, output) == (2, "")
    assert told in error and len(error.splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["thrown.py"]


def test_the_longest_pre_roll_leaves_the_last_frame(tmp_path: Path) -> None:
    code, _, error = simulated(tmp_path, "-o", tmp_path / "last.npz", "--pre-roll", 12)
    assert (code, error) == (0, "") and (tmp_path / "last.npz").is_file()


def test_an_output_that_fails_leaves_the_others(tmp_path: Path) -> None:
    """A name that is too long for a temporary one beside it is seen when it is written; the second file was not written then."""
    code, output, error = simulated(tmp_path, "-o", tmp_path / f"{'n' * 245}.npz", "-o", tmp_path / "second.npz")
    assert code == 2 and "cannot be written" in error
    assert (tmp_path / "second.npz").is_file() and "second.npz" in output


@pytest.mark.parametrize("suffix", ["usda", "glb"])
def test_the_file_of_the_scene_is_not_written_over(tmp_path: Path, suffix: str) -> None:
    """A .glb file was written over by its own motion without a word; that of a USD scene was refused after the run."""
    if suffix == "usda":
        pytest.importorskip("pxr")
    source = tmp_path / f"in.{suffix}"
    assert simulated(tmp_path, "-o", source)[0] == 0
    before = source.read_bytes()
    code, output, error = simulated(tmp_path, "-o", source, scene=source)
    assert (code, output) == (2, "") and "the scene comes from" in error
    assert source.read_bytes() == before


@pytest.mark.parametrize("scene", ["nofile.py", "nofile.usda", "no_such_scene"])
def test_a_live_page_of_nothing_is_refused(scene: str) -> None:
    """Only the address of a page was printed."""
    result = CliRunner().invoke(main, ["live", scene, "--no-open"])
    assert (result.exit_code, result.stdout) == (2, "") and scene in result.stderr
