"""The card of an impact in a real browser: its numbers are those of the recording, whatever way it is opened.

The run is a box that tumbles onto the ground and bounces to rest, with a ball on a string beside it.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from chromium import Opened, open_page

import rigidimpulse as ri
from rigidimpulse.gallery.record import at_most
from rigidimpulse.recording.impact_states import impact_states
from rigidimpulse.recording.recording import Recording
from rigidimpulse.view.page import write_html

pytestmark = pytest.mark.browser

WIDTH, HEIGHT = 960, 680
SERIOUS = ("serious", "critical")


def bouncing() -> Recording:
    """The run."""
    material = ri.Material(density=600, restitution=0.65, static_friction=0.4, dynamic_friction=0.3)
    scene = ri.Scene()
    scene.add(ri.Body("ground", ri.Shape.half_space(), motion="static", material=material))
    moving = {"position": (0, 0, 0.8), "velocity": (0.6, 0, 0), "angular_velocity": (1, 4, 0.5)}
    scene.add(ri.Body("<b>box", ri.Shape.box((0.4, 0.3, 0.2)), material=material, **moving))
    scene.add(ri.Body("bob", ri.Shape.sphere(0.1), position=(-0.9, 0.4, 0.9), material=material))
    scene.add(ri.DistanceJoint(None, "bob", (-0.5, 0.4, 1.4), (-0.9, 0.4, 0.9), name="string"))
    return ri.simulate(scene, 1.6, fps=60)


@pytest.fixture(scope="module")
def run() -> Recording:
    """The run of `bouncing`."""
    return bouncing()


@pytest.fixture(scope="module")
def address(run: Recording, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Its page, with a check that holds and one that does not."""
    path = tmp_path_factory.mktemp("card") / "run.html"
    write_html(run, path, "A box bounces to rest", [at_most("depth, m", 1e-9, 1e-6, "apart"), at_most("speed, m/s", 2.0, 1.0, "rest")])
    return path.as_uri()


@pytest.fixture(scope="module")
def shared(browser: Any, address: str) -> Opened:
    """The page, opened once."""
    return open_page(browser, address, WIDTH, HEIGHT)


@pytest.fixture
def opened(shared: Opened) -> Any:
    """The shared page, paused at the start without a card; at the end of each test nothing may have gone wrong in it."""
    shared.do("r.pause()")
    shared.do("r.impact.select(-1)")
    shared.do("r.seek(0)")
    yield shared
    assert shared.errors == []


def number(text: str) -> float:
    """The first number of a text of the page."""
    return float(text.split()[0].replace("\u2212", "-"))


def vector(text: str) -> np.ndarray:
    """A vector of the page."""
    return np.array([float(part) for part in text.replace("\u2212", "-").strip("() mNs\u2009").split(",")])


def four(value: float) -> float:
    """A number with the four digits that the card shows."""
    return float(f"{value:.4g}")


def strongest(run: Recording) -> int:
    """Row of the strongest impact."""
    return int(np.argmax(run.impacts["impulse"]))


def fact(opened: Opened, term: str) -> str:
    """A value of the list at the foot of the card."""
    facts = opened.page.eval_on_selector_all(".facts div", "all => all.map(e => [e.children[0].innerText, e.children[1].innerText])")
    return dict(facts)[term]


def assert_card_is(opened: Opened, run: Recording, row: int) -> None:
    """The card has the numbers of a row of `run.impacts`, to the digits shown, and they agree with each other."""
    impact, page = run.impacts[row], opened.page
    assert number(page.inner_text("#impact-value")) == four(impact["impulse"])
    assert number(fact(opened, "approach speed")) == four(impact["approach_speed"])
    assert number(fact(opened, "separation speed")) == pytest.approx(impact["separation_speed"], rel=6e-4, abs=1e-9)
    for term, name in (("point", "point"), ("normal n", "normal"), ("friction impulse", "tangent_impulse")):
        largest = float(np.abs(impact[name]).max())
        assert np.allclose(vector(fact(opened, term)), impact[name], rtol=0, atol=6e-3 * largest + 1e-6)
    friction = float(np.linalg.norm(impact["tangent_impulse"]))
    if friction > 1e-6:
        assert f"{four(friction):g}" in page.inner_text("#impact-friction").replace("\u2009", " ")
    above, below = page.eval_on_selector_all(".formula p:nth-child(2) .fraction span", "all => all.map(e => e.innerText)")
    top = above.replace("m/s", "").replace("\u00d7", "*").replace("\u2212", "-")
    bottom = below.replace("kg\u207b\u00b9", "").replace("kg", "").replace("\u2212", "-")
    assert eval(top) / eval(bottom) == pytest.approx(impact["impulse"], rel=2e-3)  # sums of numbers


def test_a_click_on_a_spike_opens_the_card_with_the_numbers_of_the_run(opened: Opened, run: Recording) -> None:
    row = strongest(run)
    time, marks = float(run.impacts["time"][row]), opened.page.locator("#marks").bounding_box()
    (group,) = [group for group in opened.do("r.impact.groups()") if any(spike["index"] == row for spike in group)]
    assert len(group) == 1  # it stands alone
    opened.page.mouse.click(marks["x"] + group[0]["x"], marks["y"] + marks["height"] - 24)
    assert opened.do("r.impact.selected") == row and opened.do("r.time") == pytest.approx(time, abs=1e-6)
    assert_card_is(opened, run, row)
    assert opened.page.inner_text("#impact-title") == "<b>box hits ground"
    assert not opened.do("r.playing")
    states = impact_states(run, np.array([row]))
    assert states.known[0]
    cells = opened.page.eval_on_selector_all("#impact td", "all => all.map(e => e.innerText).filter(Boolean)")
    shown = [vector(cell) for cell in cells]
    for values, pair in ((states.velocity[0, 1], shown[:2]), (states.angular_velocity[0, 1], shown[2:4])):
        for recorded, seen in zip(values, pair, strict=True):
            assert np.allclose(seen, recorded, rtol=0, atol=6e-3 * np.abs(recorded).max())


def test_keys_and_buttons_visit_every_impact_in_order(opened: Opened, run: Recording) -> None:
    page, count = opened.page, len(run.impacts)
    for k in range(4):
        page.keyboard.press("]")
        assert opened.do("r.impact.selected") == k
        assert_card_is(opened, run, k)
    opened.do(f"r.impact.select({count - 2})")
    page.click("#card-next")
    assert page.is_disabled("#card-next") and f"Impact {count} of {count}" in page.inner_text("#impact-place")
    page.keyboard.press("[")
    assert opened.do("r.impact.selected") == count - 2
    page.keyboard.press("Escape")
    assert opened.do("r.impact.selected") == -1 and not page.is_visible("#impact")
    every = opened.do("Array.from({length: r.impact.count}, (_, k) => r.impact.get(k))")
    for name in ("time", "impulse"):  # in double precision
        assert np.array_equal([each[name] for each in every], run.impacts[name])


def test_many_close_impacts_are_a_hill_that_opens(opened: Opened, run: Recording) -> None:
    page = opened.page
    hills = [group for group in opened.do("r.impact.groups()") if len(group) > 1]
    assert hills and sum(spike["count"] for group in opened.do("r.impact.groups()") for spike in group) == len(run.impacts)
    count = sum(spike["count"] for spike in hills[-1])
    button = page.locator("#timeline .hill").last
    assert str(count) in button.inner_text() and button.get_attribute("aria-expanded") == "false"
    before = opened.do("r.room().bottom")
    button.click()
    assert page.is_visible("#magnifier") and page.locator("#timeline .hill").last.get_attribute("aria-expanded") == "true"
    assert opened.do("r.room().bottom") < before  # the scene gives way
    strip = opened.do("r.impact.strip()")
    assert sum(spike["count"] for group in strip for spike in group) == count
    group = next(group for group in strip if len(group) == 1)
    box = page.locator("#hill").bounding_box()
    page.mouse.click(box["x"] + group[0]["x"], box["y"] + box["height"] - 22)
    assert opened.do("r.impact.selected") == group[0]["index"]
    assert number(page.inner_text("#impact-value")) == four(run.impacts["impulse"][group[0]["index"]])
    page.click("#close-hill")
    assert not page.is_visible("#magnifier") and opened.do("r.room().bottom") == pytest.approx(before, abs=1.0)


def on_screen(opened: Opened, points: Any) -> np.ndarray:
    """Pixels (k, 2) of points (k, 3) of the recorded frame."""
    script = """(points) => {
      const {viewer} = window.rigidimpulse;
      viewer.camera.updateWorldMatrix(true, false);
      viewer.scene.updateWorldMatrix(true, false);
      return points.map((point) => {
        const at = viewer.camera.position.clone().fromArray(point).applyMatrix4(viewer.scene.matrixWorld).project(viewer.camera);
        return [(0.5 + 0.5 * at.x) * window.innerWidth, (0.5 - 0.5 * at.y) * window.innerHeight]; }); }"""
    return np.array(opened.page.evaluate(script, np.asarray(points, float).tolist()))


def body_on_screen(opened: Opened, name: str) -> np.ndarray:
    """Pixel (2,) of a body, once two pictures in a row have it there: on a busy machine the next picture may take a while."""
    pictures = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    before, now = np.full(2, np.inf), np.zeros(2)
    while np.any(before != now):
        opened.page.evaluate(pictures)
        before, now = now, on_screen(opened, [opened.do(f"r.pose({name!r})")[:3]])[0]
    return now


def test_a_click_on_an_arrow_or_a_body_opens_its_impact(opened: Opened, run: Recording) -> None:
    row = strongest(run)
    impact = run.impacts[row]
    opened.do(f"r.seek({float(impact['time']) + 1e-4})")
    opened.page.mouse.move(*on_screen(opened, [impact["point"] + 0.05 * impact["normal"]])[0])
    opened.page.wait_for_timeout(200)
    size = float(np.hypot(impact["impulse"], np.linalg.norm(impact["tangent_impulse"])))
    assert number(opened.page.inner_text("#label-hover")) == four(size)
    opened.page.mouse.click(*on_screen(opened, [impact["point"] + 0.05 * impact["normal"]])[0])
    assert opened.do("r.impact.selected") == row
    opened.do("r.impact.select(-1)")
    opened.do("r.seek(0)")
    opened.page.mouse.click(*body_on_screen(opened, "<b>box"))
    assert opened.do("r.impact.selected") == 0
    opened.do("r.impact.select(-1)")
    opened.page.mouse.click(*body_on_screen(opened, "bob"))
    assert opened.do("r.impact.selected") == -1 and "no impacts" in opened.page.inner_text("#announce")


def test_the_action_is_framed_in_what_panels_leave_free_and_never_from_below_the_floor(opened: Opened, run: Recording) -> None:
    for key in ("", "p", "]"):
        if key:
            opened.page.keyboard.press(key)
        room = opened.do("r.room()")
        for name in ("<b>box", "bob"):
            x, y = on_screen(opened, run.position(name)).T
            assert np.all((room["left"] <= x) & (x <= room["right"]) & (room["top"] <= y) & (y <= room["bottom"])), (key, name)
        for part in ("footer", "header", "#impact", "#ledger"):
            box = opened.page.locator(part).bounding_box()
            if box is not None:
                outside = (box["y"] >= room["bottom"] - 1, box["y"] + box["height"] <= room["top"] + 1, box["x"] >= room["right"] - 1)
                assert any(outside), (key, part)
    opened.page.keyboard.press("p")
    opened.page.keyboard.press("Escape")
    opened.page.mouse.move(400, 250)
    opened.page.mouse.down()
    opened.page.mouse.move(400, 20, steps=4)  # as far down as it goes
    opened.page.mouse.up()
    opened.page.wait_for_timeout(200)
    assert opened.do("r.camera()[1]") > 0.0
    opened.page.keyboard.press("f")


def test_title_checks_joints_and_vectors_are_on_the_page(opened: Opened, run: Recording) -> None:
    page = opened.page
    assert page.inner_text("h1") == "A box bounces to rest"
    assert "1 of 2 checks hold" in page.inner_text("#checks summary")
    page.click("#checks summary")
    assert "speed, m/s" in page.inner_text("#checks") and "at most 1" in page.inner_text("#checks")
    page.click("#checks summary")
    assert opened.do("r.joints()") == [{"name": "string", "kind": "distance", "shown": True}]
    spin = opened.page.evaluate("window.rigidimpulse.spin('<b>box', 'velocity', 10)")
    assert np.allclose(spin, run.angular_velocity("<b>box")[10], rtol=1e-5, atol=1e-6)
    without = opened.picture()
    page.keyboard.press("v")
    assert np.count_nonzero(np.abs(without - opened.picture()).max(axis=2) > 8) > 50
    page.keyboard.press("v")
    assert page.query_selector(".dg") is None


def test_time_goes_on_while_everything_is_hidden(opened: Opened) -> None:
    opened.page.keyboard.press("u")
    opened.do("r.seek(0.3)")
    assert not opened.page.is_visible("footer") and opened.do("r.room()") == {"left": 0, "top": 0, "right": WIDTH, "bottom": HEIGHT}
    opened.page.keyboard.press("u")
    opened.do("r.seek(0.4)")
    assert opened.page.is_visible("footer") and opened.errors == []


def test_phone_dark_and_reduced_motion(browser: Any, address: str, run: Recording) -> None:
    phone = open_page(browser, address, 390, 844, color_scheme="dark", reduced_motion="reduce", has_touch=True)
    page = phone.page
    assert phone.do("r.time") == 0.0 and not phone.do("r.playing")  # nothing moves by itself
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    page.evaluate(f"window.rigidimpulse.impact.select({strongest(run)})")
    value = page.locator("#impact-value").bounding_box()
    assert value["y"] + value["height"] < 844 and page.evaluate("document.documentElement.scrollWidth") <= 390
    for selector in ("#play", "#next", "#layers-button", "#card-next", "#card-close", "#loop"):
        box = page.locator(selector).bounding_box()
        assert box["width"] >= 44 and box["height"] >= 44, selector
    page.click("#theme-button")
    assert page.evaluate("document.documentElement.dataset.theme") == "light"
    assert phone.errors == []
    page.close()


@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_no_serious_fault(browser: Any, address: str, width: int) -> None:
    if not os.environ.get("CI"):
        pytest.importorskip("axe_playwright_python", reason="axe-playwright-python is not installed (pip install rigidimpulse[test])")
    from axe_playwright_python.sync_playwright import Axe

    page = open_page(browser, address, width, 844, reduced_motion="reduce").page
    axe, found = Axe(), []
    if width < 820:
        page.keyboard.press("d")
    page.evaluate("window.rigidimpulse.impact.select(0)")
    found += axe.run(page).response["violations"]
    page.keyboard.press("Escape")
    page.keyboard.press("d")  # each width in light and in dark
    page.click("#layers-button")
    page.locator("#timeline .hill").last.click()
    page.click("#checks summary")
    found += axe.run(page).response["violations"]
    serious = [fault for fault in found if fault["impact"] in SERIOUS]
    told = {f"{fault['id']}: {node['html'][:120]} {node['failureSummary'][:200]}" for fault in serious for node in fault["nodes"]}
    assert told == set()
    page.close()


def test_every_control_is_reached_by_the_keyboard_and_has_a_name(opened: Opened) -> None:
    page = opened.page
    page.keyboard.press("]")
    page.evaluate("document.activeElement.blur()")
    seen = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        seen.add(page.evaluate("document.activeElement.id || document.activeElement.tagName"))
    assert {"layers-button", "plots-button", "theme-button", "play", "next", "scrubber", "speed", "loop", "card-next", "card-close"} <= seen
    page.focus("#next")
    page.keyboard.press("Tab")
    page.keyboard.press("Shift+Tab")
    before = opened.do("r.impact.selected")
    page.keyboard.press("Enter")  # a button that was reached by the keyboard is pressed
    assert opened.do("r.impact.selected") == before + 1
