"""The page of a run with everything it can show, in a real browser: time line, plots, contacts, trails, shapes as simulated.

The run is that of `test_html`, with a ledger and contacts made up for it, and with another mesh to draw for the box.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from chromium import Opened, open_page
from test_compare_page import changed
from test_html import FLOAT32_ROUNDING, FPS, STRANGE_NAME, recording

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate
from rigidimpulse.recording.contacts import CONTACT_DTYPE
from rigidimpulse.recording.events import Event
from rigidimpulse.recording.ledger import Ledger
from rigidimpulse.recording.status import Status
from rigidimpulse.view.page import render_page

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 900, 620
PIXELS = 2.0 / 480.0  # s: two pixels of a time line of 1 s with at least 480 pixels
OFFSET = np.array([0.1, -0.05, 0.2])  # m, of the centre of mass in the frame of the box
CONTACT_FRAMES = (20, 40)
POSE = 1e-5


def full_run() -> ri.Recording:
    """The ball's energy falls at the impact, the box has a contact for twenty frames and its centre of mass off its origin."""
    run = recording()
    kinetic, potential = 5.0 + 3.0 * np.sin(3.0 * run.times) ** 2, 4.0 * np.cos(3.0 * run.times) ** 2 - 10.0
    momentum = np.stack([run.times, -2.0 * run.times, np.cos(run.times)], axis=1)
    ledger = Ledger(run.times, kinetic, potential, momentum, momentum, {})
    contacts = np.zeros(1, CONTACT_DTYPE)
    start, end = run.times[list(CONTACT_FRAMES)]
    contacts[0] = (start, end, 0, 3, (1.0, 0.5, 0.9), (0, 0, 1), (0.0, 3.0, 4.0))
    centers = run.positions.copy()
    centers[:, 3] += rotate(run.orientations[:, 3], OFFSET)
    return replace(run, ledger=ledger, contacts=contacts, centers=centers)


@pytest.fixture(scope="module")
def shared(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Opened:
    """The page of `full_run`, opened once from its file."""
    path = tmp_path_factory.mktemp("page") / "run.html"
    run = full_run()
    assert run.scene is not None
    seen = ri.Visual(shape=ri.Shape.box((0.7, 0.2, 0.1)))
    bodies = [replace(body, visual=seen) if body.name == STRANGE_NAME else body for body in run.scene.bodies]
    path.write_text(render_page(replace(run, scene=ri.Scene(run.scene.gravity, bodies))), encoding="utf-8")
    page = open_page(browser, path.as_uri(), WIDTH, HEIGHT)
    page.page.keyboard.press("p")  # so low a window has the plots put away
    return page


@pytest.fixture
def opened(shared: Opened) -> Any:
    """The shared page, paused at the start; at the end of each test nothing may have gone wrong in it."""
    shared.do("r.pause()")
    shared.do("r.seek(0)")
    yield shared
    assert shared.errors == []


def place_on(opened: Opened, canvas: str, share: float) -> tuple[float, float]:
    """Pixel at a share of the time of a canvas whose axis lies over the time line."""
    marks, box = opened.page.locator("#marks").bounding_box(), opened.page.locator(canvas).bounding_box()
    return marks["x"] + 8 + share * (marks["width"] - 16), box["y"] + 0.5 * box["height"]


@pytest.mark.parametrize("canvas", ["#marks", "#energy", "#momentum"])
def test_a_click_moves_the_bodies_to_that_frame_and_dragging_scrubs(opened: Opened, canvas: str) -> None:
    run = full_run()
    opened.page.mouse.click(*place_on(opened, canvas, 0.5))
    time, frame = opened.do("r.time"), opened.do("r.frame")
    assert time == pytest.approx(0.5, abs=PIXELS)
    opened.do(f"r.seek({float(run.times[frame])})")
    for name in run.names:
        pose = np.array(opened.page.evaluate("(name) => window.rigidimpulse.pose(name)", name))
        recorded = np.concatenate([run.position(name)[frame], np.roll(run.orientation(name)[frame], -1)])
        assert np.allclose(pose, recorded, rtol=0, atol=POSE)
    opened.page.mouse.move(*place_on(opened, canvas, 0.5))
    opened.page.mouse.down()
    opened.page.mouse.move(*place_on(opened, canvas, 0.25))
    opened.page.mouse.up()
    assert opened.do("r.time") == pytest.approx(0.25, abs=PIXELS)


def test_impacts_are_marked_at_their_times(opened: Opened) -> None:
    # A column of the time line is orange where an impact is, in this run at 0.4515 s only.
    script = """(() => {
      const canvas = document.getElementById("marks"), pen = canvas.getContext("2d"), width = canvas.width;
      const {data} = pen.getImageData(0, 0, width, Math.round(canvas.height / 2)), found = [];
      for (let x = 0; x < width; x++) {
        for (let y = 0; y < canvas.height / 2; y++) {
          const [r, g, b, a] = data.subarray(4 * (y * width + x), 4 * (y * width + x) + 4);
          if (a > 40 && r > 200 && b < 90) { found.push(x); break; }
        }
      }
      return found.map((x) => (x / window.devicePixelRatio - 7.5) / (canvas.clientWidth - 16)); })()"""
    opened.do("r.seek(1)")
    found = opened.page.evaluate(script)
    assert 1 <= len(found) <= 4
    assert found == pytest.approx([0.4515] * len(found), abs=2.0 * PIXELS)


def test_plots_show_the_ledger_with_a_cursor_over_the_knob(opened: Opened) -> None:
    script = """(() => {
      const plot = window.rigidimpulse.ledger.plots[1], pen = plot.canvas.getContext("2d"), x = plot.x(window.rigidimpulse.time);
      const dark = (at) => {
        const [r, g, b, a] = pen.getImageData(Math.round(at * plot.scale), Math.round((plot.height - 2) * plot.scale), 1, 1).data;
        return a > 100 && r + g + b < 300;
      };
      return {x: x + plot.canvas.getBoundingClientRect().left, on: dark(x) || dark(x - 0.5), off: dark(x - 6) || dark(x + 6)}; })()"""
    for time in (0.2, 0.75):
        opened.do(f"r.seek({time})")
        cursor = opened.page.evaluate(script)
        assert cursor["on"] and not cursor["off"]
        assert cursor["x"] == pytest.approx(place_on(opened, "#marks", time)[0], abs=0.5)
    opened.do("r.seek(0.5)")
    run = full_run()
    assert run.ledger is not None
    potential = run.ledger.potential - run.ledger.potential.min()
    shown = dict(line.split("\n") for line in opened.page.eval_on_selector_all(".legend div", "all => all.map(e => e.innerText)"))
    kinetic = run.ledger.kinetic[30]
    for name, value in (("kinetic", kinetic), ("potential", potential[30]), ("total", kinetic + potential[30])):
        figure, unit = shown[name].split()
        assert float(figure) == pytest.approx(value * {"J": 1.0, "mJ": 1e3}[unit], rel=5e-3)  # three digits
    assert shown["momentum y"] == "\u22121 N\u2009s"


def test_contacts_show_the_forces_of_the_frame_when_they_are_asked_for(opened: Opened) -> None:
    opened.do("r.seek(0.5)")
    assert opened.do("r.contacts()") == []
    without = opened.picture()
    opened.page.keyboard.press("c")
    (contact,) = opened.do("r.contacts()")
    assert np.allclose(contact["point"], (1.0, 0.5, 0.9), rtol=0, atol=1e-6)
    assert np.allclose(contact["direction"], (0.0, 0.6, 0.8), rtol=0, atol=1e-6)
    assert changed(without, opened.picture()) > 100
    first, after = CONTACT_FRAMES
    for frame, count in ((first - 1, 0), (first, 1), (after - 1, 1), (after, 0)):
        opened.do(f"r.seek({frame / FPS})")
        assert len(opened.do("r.contacts()")) == count, frame
    opened.page.click("#layers-button")
    opened.page.click("text=Contacts")
    opened.page.click("#layers-button")
    assert opened.do("r.contacts()") == []


def test_trails_are_the_paths_of_the_centres_of_mass(opened: Opened) -> None:
    run = full_run()
    for name in ("ball", STRANGE_NAME):
        path = np.array(opened.page.evaluate("(name) => window.rigidimpulse.trail(name)", name)).reshape(-1, 4)
        assert np.allclose(path[:, 3], run.times, rtol=0, atol=FLOAT32_ROUNDING)
        # The turn is known to float32, of an arm of 0.23 m.
        assert np.allclose(path[:, :3], run.center_of_mass(name), rtol=0, atol=1e-6)
    opened.do("r.seek(0.9)")
    without = opened.picture()
    opened.page.keyboard.press("r")
    assert changed(without, opened.picture()) > 200
    opened.page.keyboard.press("r")
    assert changed(without, opened.picture()) < 20


def test_the_shape_that_collides_takes_the_place_of_what_is_drawn(opened: Opened) -> None:
    drawn = opened.picture()
    opened.page.keyboard.press("s")
    assert opened.do("r.simulated()") is True
    assert changed(drawn, opened.picture()) > 300
    opened.page.click("#layers-button")
    opened.page.click("text=As simulated")
    opened.page.click("#layers-button")
    assert opened.do("r.simulated()") is False
    assert changed(drawn, opened.picture()) < 20


def test_keys_step_by_frames_and_change_the_speed(opened: Opened) -> None:
    page = opened.page
    assert "frame 0 / 60" in page.inner_text("#clock")
    for key, frame in (("ArrowRight", 1), ("Shift+ArrowRight", 11), ("ArrowLeft", 10), ("End", 60), ("ArrowRight", 60), ("Home", 0)):
        page.keyboard.press(key)
        assert opened.do("r.frame") == frame
        assert f"frame {frame} / 60" in page.inner_text("#clock")
    for key, speed in (("-", 0.5), ("-", 0.25), ("-", 0.1), ("-", 0.1), ("+", 0.25), ("+", 0.5), ("+", 1), ("+", 2), ("+", 4), ("+", 4)):
        page.keyboard.press(key)
        assert opened.do("r.speed") == speed
        assert page.input_value("#speed") == f"{speed:g}"
    page.select_option("#speed", "1")
    assert opened.do("r.speed") == 1


def test_plots_can_be_put_away_and_come_back_where_there_is_room(opened: Opened, browser: Any) -> None:
    page = opened.page
    assert page.is_visible("#energy")
    page.keyboard.press("p")
    assert not page.is_visible("#energy")
    page.click("text=Plots")
    assert page.is_visible("#energy") and page.is_visible("#momentum")
    narrow = open_page(browser, page.url, 390, 700)
    narrow.do("r.pause()")
    assert not narrow.page.is_visible("#energy")
    narrow.page.keyboard.press("p")
    assert narrow.page.is_visible("#energy")
    narrow.page.mouse.click(*place_on(narrow, "#energy", 0.5))
    assert narrow.do("r.time") == pytest.approx(0.5, abs=0.01)
    for part in ("#ledger", "footer"):
        box = narrow.page.locator(part).bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 390
    assert narrow.errors == []
    narrow.page.close()


def test_warnings_are_below_the_title_and_lead_to_their_time(browser: Any, tmp_path: Any) -> None:
    """A run with a problem shows it without a click: kind, bodies and text as plain text; a click on its time goes there."""
    event = Event(0.5, "overlap", ("<b>ball</b>", "box"), "0.02 m inside each other: take a smaller step")
    path = tmp_path / "warned.html"
    path.write_text(render_page(replace(recording(), status=Status.of([event]))), encoding="utf-8")
    page = open_page(browser, path.as_uri(), WIDTH, 600)
    shown = page.page.inner_text("#warnings")
    for text in ("1 warning", "overlap", "<b>ball</b>, box", "0.02 m inside each other: take a smaller step"):
        assert text in shown
    page.page.click("#warnings li button")
    assert page.do("r.time") == pytest.approx(event.time) and not page.do("r.playing") and not page.errors


def test_a_run_without_problems_has_no_warnings(opened: Opened) -> None:
    assert not opened.page.is_visible("#warnings")
