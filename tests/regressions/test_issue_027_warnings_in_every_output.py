"""A run with a warning says it in every file that is written of it: time, kind, bodies, amount and remedy."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

import rigidimpulse as ri
from rigidimpulse.cli.cli import main

REMEDY = "move them apart in the scene"


def overlapping() -> ri.Scene:
    """A ball drawn 0.05 m into the floor: it is moved, and the status says so."""
    floor = ri.Body("floor", ri.Shape.box((2, 2, 1)), position=(0, 0, -0.5), motion="static")
    return ri.Scene(bodies=[floor, ri.Body("ball, <red>", ri.Shape.sphere(0.1), position=(0, 0, 0.05))])


@pytest.fixture(scope="module")
def run() -> ri.Recording:
    """A run with a warning."""
    made = ri.simulate(overlapping(), 0.1, 30)
    assert [event.kind for event in made.status.problems] == ["overlap at the start"] and REMEDY in made.status.message
    return made


def test_npz(run: ri.Recording, tmp_path: Path) -> None:
    assert ri.load_recording(run.export(tmp_path / "run.npz")).status == run.status


def test_cache(run: ri.Recording, tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    assert ri.simulate(overlapping(), 0.1, 30, cache=tmp_path / "run.h5").status == run.status
    assert ri.load_recording(tmp_path / "run.h5").status == run.status


def test_gltf(run: ri.Recording, tmp_path: Path) -> None:
    tree = json.loads(run.export(tmp_path / "run.gltf").read_text(encoding="utf-8"))
    assert tree["asset"]["extras"]["rigidimpulse"] == run.status.data()
    assert tree["scenes"][0]["extras"]["rigidimpulse warnings"] == list(run.status.warnings)


@pytest.mark.parametrize("suffix", [".usda", ".usdz"])
def test_usd(run: ri.Recording, tmp_path: Path, suffix: str) -> None:
    usd = pytest.importorskip("pxr.Usd")
    stage = usd.Stage.Open(str(run.export(tmp_path / f"run{suffix}")))
    told = stage.GetRootLayer().customLayerData["rigidimpulse"]
    assert told["ok"] is False and list(told["warnings"]) == list(run.status.warnings)
    assert json.loads(told["status"]) == run.status.data()


def test_csv(run: ri.Recording, tmp_path: Path) -> None:
    with run.export(tmp_path / "run.csv").open(newline="", encoding="utf-8") as file:
        lines = file.read().splitlines()
    assert lines[0] == f"# {run.status.warnings[0]}"
    assert next(csv.reader(lines[1:]))[0] == "time [s]"


def test_page(run: ri.Recording, tmp_path: Path) -> None:
    page = run.export(tmp_path / "run.html").read_text(encoding="utf-8")
    text = page.split('<script id="manifest" type="application/json">')[1].split("</script>")[0]
    (told,) = json.loads(text)["warnings"]
    (event,) = run.status.problems
    assert told == {"time": event.time, "kind": event.kind, "bodies": ", ".join(event.bodies), "message": event.message}


def test_part_has_the_clock_of_its_frames(run: ri.Recording) -> None:
    late = replace(run, status=run.status.later(0.1))
    assert late.part(1).status.problems[0].time == pytest.approx(0.1 - run.times[1])


def test_command_line(run: ri.Recording, tmp_path: Path) -> None:
    scene = tmp_path / "scene.glb"
    overlapping().export(scene)
    said = CliRunner().invoke(main, ["simulate", str(scene), "--duration", "0.1", "-o", str(tmp_path / "out.npz")])
    assert said.exit_code == 0 and "overlap at the start" in said.output and REMEDY in said.output
