"""Forecasts of cost: they grow with scene and duration, learn from runs, and survive a folder that is damaged or cannot be written."""

from __future__ import annotations

import json
import re
from pathlib import Path
from time import perf_counter

import pytest

import rigidimpulse as ri
from rigidimpulse.engine.begin import make_plan
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.forecast import IMPACTS, JOINTED, PILE, UNKNOWN, forecast, remember
from rigidimpulse.gallery.pile import pile
from rigidimpulse.model.plan import Plan
from rigidimpulse.model.world import World


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of the test's own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "rigidimpulse"


def boxes(number: int, hung: bool = False) -> tuple[World, Plan]:
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    for k in range(number):
        scene.add(ri.Body(f"box {k}", ri.Shape.box(0.2), position=(k, 0, 1)))
    if hung:
        scene.add(ri.BallJoint(None, "box 0", (0, 0, 1.2)))
    world = compile_scene(scene)
    return world, make_plan(world)


def test_it_comes_at_once_and_grows_with_the_scene_and_the_duration() -> None:
    start = perf_counter()
    one = forecast(*boxes(1), 1.0)
    assert perf_counter() - start < 5.0  # 0.05 s on a quiet machine
    assert one.kind == IMPACTS and one.low < one.seconds < one.high and one.high == pytest.approx(UNKNOWN * one.seconds)
    assert one.seconds < forecast(*boxes(3), 1.0).seconds < forecast(*boxes(3), 4.0).seconds
    world = compile_scene(pile(64))
    assert forecast(world, make_plan(world), 1.0).kind == PILE and forecast(*boxes(1, hung=True), 1.0).kind == JOINTED


def test_it_learns_and_says_how_far_off_it_was() -> None:
    scene = boxes(2)
    first = forecast(*scene, 1.0)
    assert first.last is None and "no run of this kind" in first.text(1.0)
    for _ in range(9):
        remember(*scene, 1.0, 8.0 * first.seconds)
    later = forecast(*scene, 1.0)
    # Nine runs of 8 and the unit itself: 8^(9 / 10).
    assert later.seconds == pytest.approx(8.0**0.9 * first.seconds) and later.remembered == 9
    assert later.low <= 8.0 * first.seconds <= later.high
    guess, took = later.last or (0.0, 0.0)
    assert took == pytest.approx(8.0 * first.seconds) and re.search(r"the last forecast was [\d.]+ times too low", later.text(1.0))
    assert guess < took
    assert forecast(*boxes(1, hung=True), 1.0).remembered == 0


NEGATIVE, WRONG = '{"machine": -1.0, "ratios": {}, "last": null}', '{"machine": 1.0, "ratios": {"x": ["y"]}, "last": 3}'


@pytest.mark.parametrize("text", ["", "[]", NEGATIVE, WRONG])
def test_a_damaged_file_is_measured_again(folder: Path, text: str) -> None:
    folder.mkdir()
    (folder / "forecasts.json").write_text(text, encoding="utf-8")
    assert forecast(*boxes(1), 1.0).seconds > 0.0
    assert json.loads((folder / "forecasts.json").read_text(encoding="utf-8"))["machine"] > 0.0


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "file"
    file.touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(file))
    scene = boxes(1)
    remember(*scene, 1.0, 1.0)
    assert forecast(*scene, 1.0).last is None
