"""The page of a study in a real browser: a click on a point plays that run, its error counts up, and news come without a reload."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from chromium import Opened, open_page

import rigidimpulse as ri
from rigidimpulse.studies.glance.known import Glance
from rigidimpulse.studies.glance.page import SIDECAR

pytestmark = pytest.mark.browser


def tumbling() -> ri.Scene:
    scene = ri.Scene()
    bouncing = ri.Material(restitution=0.5, static_friction=0.3, dynamic_friction=0.3)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=bouncing))
    moving = {"position": (0, 0, 0.8), "velocity": (1, 0, 0), "angular_velocity": (3, 1, 2)}
    scene.add(ri.Body("box", ri.Shape.box((0.4, 0.3, 0.2)), material=bouncing, **moving))
    return scene


@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Glance, Path, Path]:
    """A study, its folder at the end, and a copy of the folder as it was when the sentence was there and the rest was not."""
    folder, middle = tmp_path_factory.mktemp("study"), tmp_path_factory.mktemp("middle") / "study"

    def changed(now: Glance) -> None:
        if now.verdict is not None and not now.finished and not middle.exists():
            shutil.copytree(folder, middle)

    known = ri.glance(tumbling(), 1.0, budget=20.0, peers=(), output=folder, changed=changed)
    return known, folder, middle


@pytest.fixture
def opened(browser: Any, studied: tuple[Glance, Path, Path]) -> Iterator[Opened]:
    opened = open_page(browser, (studied[1] / "study.html").as_uri(), 1280, 800)
    yield opened
    opened.page.close()


def test_the_page_is_one_file_with_the_sentence_and_all_runs(opened: Opened, studied: tuple[Glance, Path, Path]) -> None:
    known, folder, _ = studied
    assert [path.name for path in folder.iterdir()] == ["study.html"]
    assert known.verdict is not None
    assert opened.page.text_content("#headline") == known.verdict.headline
    played = {run.candidate.name for run in known.runs if run.recording is not None}
    assert set(opened.page.eval_on_selector_all(".tile", "all => all.map(each => each.dataset.name)")) == played
    assert set(opened.page.eval_on_selector_all(".point", "all => all.map(each => each.dataset.name)")) == played
    opened.page.wait_for_function("window.rigidimpulse.pictures.drawn > 0")
    assert opened.errors == [] and all(url.startswith(("file:", "data:", "blob:")) for url in opened.requests)


def test_a_click_on_a_point_plays_that_run_and_its_error_counts_up(opened: Opened) -> None:
    name = opened.page.eval_on_selector_all(".point.fixed", "all => all[0].dataset.name")
    opened.page.locator(f'.point[data-name="{name}"]').dispatch_event("click")
    assert opened.do("[r.state.mode, r.state.chosen, r.state.playing]") == ["one", name, True]
    assert opened.page.text_content("#card h3") == name
    opened.page.wait_for_function("window.rigidimpulse.state.time > 0.02")
    # The clock goes on by itself; errors at times that follow each other never fall, and grow from nothing to the largest.
    opened.page.click("#play")
    texts, errors = [], []
    for time in (0.0, 0.45, 0.6, 0.9):
        opened.do(f"(r.state.time = {time}, r.draw({time}))")
        texts.append(opened.page.text_content(".big .error"))
        errors.append(opened.do(f"r.errorAt({name!r}, {time})"))
    assert errors == sorted(errors) and errors[0] < 1e-6 and errors[-1] > 0.01
    assert len(set(texts)) >= 3 and texts[-1].endswith("mm")
    assert "off since" in opened.page.text_content(".chip")
    # The bodies that are drawn are where the run has them.
    assert opened.do("r.pictures.drawn") == 1


def test_a_picture_shows_the_run_where_it_is(opened: Opened, studied: tuple[Glance, Path, Path]) -> None:
    known = studied[0]
    opened.page.click("#play")
    for played in known.runs:
        if played.recording is not None:
            name = played.candidate.name
            opened.do(f"r.draw(r.state.time = {known.times[40]})")
            place = opened.do(f"r.pictures.figures.get({name!r}).nodes[0].position.toArray()")
            assert place == pytest.approx(played.recording.position("box")[40].tolist(), abs=1e-5)


def test_overlaid_and_dark(opened: Opened) -> None:
    opened.page.click("[data-mode=overlaid]")
    assert opened.page.locator(".keys button").count() == opened.page.locator(".point").count()
    before = opened.page.evaluate("getComputedStyle(document.querySelector('.panel')).backgroundColor")
    opened.page.click("#theme")
    assert opened.page.evaluate("getComputedStyle(document.querySelector('.panel')).backgroundColor") != before
    assert opened.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    opened.page.set_viewport_size({"width": 390, "height": 844})
    assert opened.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert opened.errors == []


def test_an_open_page_follows_the_study(browser: Any, studied: tuple[Glance, Path, Path], tmp_path: Path) -> None:
    """It takes what the script beside it hands over, and is loaded again when that is gone."""
    known, folder, middle = studied
    live = tmp_path / "live"
    shutil.copytree(middle, live)
    assert (live / SIDECAR).is_file()
    opened = open_page(browser, (live / "study.html").as_uri())
    few = opened.do("r.state.index.runs.length")
    assert few < len(known.runs) and "next:" in opened.page.text_content("#progress")
    shutil.copy(folder / "study.html", live / "study.html")
    (live / SIDECAR).unlink()
    opened.page.wait_for_function(f"window.rigidimpulse?.state.index.runs.length === {len(known.runs)}", timeout=20_000)
    assert opened.do("r.state.index.progress.finished")
    opened.page.close()
