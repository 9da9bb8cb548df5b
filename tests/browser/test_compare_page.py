"""The page of two runs in a real browser: ghosts where the second run was, the plot in step with time.

Run A is that of `test_html`; in run B the ball drifts off sideways and the box turns on about the vertical. Poses and distances are
stored as float32, off by at most 2^-24 of their size.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from chromium import Opened, open_page
from test_html import FLOAT32_ROUNDING, STRANGE_NAME, recording

import rigidimpulse as ri
from rigidimpulse.core.quaternion import multiply
from rigidimpulse.dynamics.soft_body.track import FlexibleTrack

pytestmark = pytest.mark.browser

DRIFT = np.array([0.0, 0.9, 0.0])  # m/s
TURN = 1.5  # rad/s
HORIZON = 0.6  # s, of the ball
WIDTH, HEIGHT = 900, 600
CLEAR = 6.0  # of 255: a change of colour that one sees


def two_runs() -> tuple[ri.Recording, ri.Recording]:
    """Runs A and B."""
    a = recording()
    patch = np.array([[1.4, -1, 0.5], [1.8, -1, 0.5], [1.8, -0.6, 0.5], [1.4, -0.6, 0.5]])
    soft_body = FlexibleTrack("patch", np.tile(patch, (len(a.times), 1, 1)), np.array([[0, 1, 2], [0, 2, 3]]))
    a = replace(a, soft_bodies=[soft_body])
    positions, orientations, vertices = a.positions.copy(), a.orientations.copy(), soft_body.vertices.copy()
    positions[:, 2] += a.times[:, None] * DRIFT
    half = 0.5 * TURN * a.times
    orientations[:, 3] = multiply(np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1), orientations[:, 3])
    vertices[:, :, 2] += 0.25 * a.times[:, None]
    return a, replace(a, positions=positions, orientations=orientations, soft_bodies=[replace(soft_body, vertices=vertices)])


@pytest.fixture(scope="module")
def shared(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Opened:
    """The page of the two runs, opened once from its file."""
    path = tmp_path_factory.mktemp("page") / "two.html"
    ri.compare(*two_runs(), ("first", "second"), {"ball": HORIZON}).export(path)
    return open_page(browser, path.as_uri(), WIDTH, HEIGHT)


@pytest.fixture
def opened(shared: Opened) -> Any:
    """The shared page, paused at the start with the pointer away; at the end of each test nothing may have gone wrong in it."""
    shared.page.mouse.move(2, 2)
    shared.do("r.pause()")
    shared.do("r.seek(0)")
    yield shared
    assert shared.errors == []


def changed(one: np.ndarray, other: np.ndarray) -> int:
    """Number of pixels that look different."""
    return int(np.count_nonzero(np.abs(one - other).max(axis=2) > CLEAR))


def on_screen(opened: Opened, name: str) -> tuple[float, float]:
    """Pixel at which the origin of a body of run A is seen."""
    script = """(name) => {
      const viewer = window.rigidimpulse.viewer, entry = [...window.rigidimpulse.pose(name)].slice(0, 3);
      viewer.render();
      const point = viewer.camera.position.clone().fromArray(entry).applyMatrix4(viewer.scene.matrixWorld).project(viewer.camera);
      return [(0.5 + 0.5 * point.x) * window.innerWidth, (0.5 - 0.5 * point.y) * window.innerHeight]; }"""
    x, y = opened.page.evaluate(script, name)
    return x, y


def test_page_plays_when_opened_and_needs_no_network(shared: Opened) -> None:
    assert shared.do("r.playing") or shared.do("r.time") > 0.0
    assert [url for url in shared.requests if not url.startswith(("file:", "data:", "blob:"))] == []
    assert shared.page.inner_text("#runs").split() == ["first", "second"]
    assert "1 and 1 impacts" in shared.page.inner_text("#summary")
    assert shared.errors == []


def test_ghosts_are_where_the_second_run_was_and_bodies_where_the_first_was(opened: Opened) -> None:
    a, b = two_runs()
    for frame in (0, 1, 13, 27, 60):
        opened.do(f"r.seek({float(a.times[frame])})")
        for name in ("ball", STRANGE_NAME):
            for run, poses in ((a, "rigidimpulse"), (b, "rigidimpulse.comparison")):
                pose = np.array(opened.page.evaluate(f"(name) => window.{poses}.pose(name)", name))
                quaternion = np.roll(run.orientation(name)[frame], -1)
                assert np.allclose(pose[:3], run.position(name)[frame], rtol=0, atol=4 * FLOAT32_ROUNDING)
                assert abs(abs(pose[3:] @ quaternion) - 1.0) < 4 * FLOAT32_ROUNDING
        vertices = np.array(opened.do("r.comparison.vertices(0)")).reshape(-1, 3)
        assert np.allclose(vertices, b.soft_bodies[0].vertices[frame], rtol=0, atol=4 * FLOAT32_ROUNDING)


def test_distances_are_those_of_the_runs(opened: Opened) -> None:
    for time in (0.25, 0.508, 1.0):  # the second lies between frames
        opened.do(f"r.seek({time})")
        distance, angle = opened.do("r.comparison.apart('ball')")
        assert distance == pytest.approx(0.9 * time, rel=1e-5) and angle == 0.0
        _, angle = opened.page.evaluate("(name) => window.rigidimpulse.comparison.apart(name)", STRANGE_NAME)
        assert angle == pytest.approx(TURN * time, rel=1e-5)
        assert opened.do("r.comparison.apart(null)") == pytest.approx([0.9 * time, TURN * time], rel=1e-5)
    assert opened.page.inner_text("#distance") == "900 mm"
    assert opened.page.inner_text("#angle") == "1.5 rad"


def test_each_run_can_be_hidden_and_ghosts_show_only_where_runs_differ(opened: Opened) -> None:
    page = opened.page
    apart_at = {}
    for time in (0.0, 0.9):
        opened.do(f"r.seek({time})")
        both = opened.picture()
        page.keyboard.press("2")
        apart_at[time] = changed(both, opened.picture())
        page.keyboard.press("2")
        page.keyboard.press("1")
        ghosts = opened.picture()
        assert changed(both, ghosts) > 1000  # ball and box cover thousands of the 540,000 pixels
        page.click(".run-b")
        assert changed(ghosts, opened.picture()) > 1000  # what was left were ghosts
        page.click(".run-b")
        page.click(".run-a")
        assert changed(both, opened.picture()) < 20
    assert apart_at[0.0] < 20  # where the runs agree there is nothing to see of the second one
    assert apart_at[0.9] > 2000


def test_static_bodies_have_no_ghost(opened: Opened) -> None:
    assert opened.page.evaluate("Object.keys(window.rigidimpulse.viewer.scene_tree.find(['ghosts']).children).length") == 3


def test_cursor_of_the_plot_is_at_the_time_and_over_the_knob_of_the_bar(opened: Opened) -> None:
    script = """(() => {
      const plot = window.rigidimpulse.comparison.plot, pen = plot.canvas.getContext("2d"), x = plot.x(window.rigidimpulse.time);
      const dark = (at) => {
        const [r, g, b, a] = pen.getImageData(Math.round(at * plot.scale), Math.round(8 * plot.scale), 1, 1).data;
        return a > 100 && r + g + b < 300;
      };
      return {x: x + plot.canvas.getBoundingClientRect().left, on: dark(x) || dark(x - 0.5), off: dark(x - 5) || dark(x + 5)};
    })()"""
    for time in (0.1, 0.35, 0.8):
        opened.do(f"r.seek({time})")
        cursor = opened.page.evaluate(script)
        marks = opened.page.locator("#marks").bounding_box()
        assert cursor["on"] and not cursor["off"], time
        assert cursor["x"] == pytest.approx(marks["x"] + 8 + (marks["width"] - 16) * time, abs=0.5)


def test_a_click_on_the_plot_goes_there_and_dragging_scrubs(opened: Opened) -> None:
    plot, marks = opened.page.locator("#apart").bounding_box(), opened.page.locator("#marks").bounding_box()
    place = {share: marks["x"] + 8 + share * (marks["width"] - 16) for share in (0.25, 0.5, 0.75)}
    pixel, height = 1.0 / (marks["width"] - 16), plot["y"] + 0.5 * plot["height"]  # s, of 1 s in all
    opened.page.mouse.click(place[0.5], height)
    assert opened.do("r.time") == pytest.approx(0.5, abs=pixel)
    opened.page.mouse.move(place[0.75], height)
    assert opened.do("r.time") == pytest.approx(0.5, abs=pixel)  # not pressed
    opened.page.mouse.down()
    opened.page.mouse.move(place[0.25], height)
    opened.page.mouse.up()
    assert opened.do("r.time") == pytest.approx(0.25, abs=pixel)


def test_a_body_under_the_pointer_or_clicked_at_is_shown_by_itself(opened: Opened) -> None:
    page = opened.page
    opened.do("r.seek(0.5)")
    ball = on_screen(opened, "ball")
    page.mouse.move(*ball)
    assert opened.do("r.comparison.focus") == "ball"
    assert page.inner_text("#who") == "ball"
    page.wait_for_function("document.getElementById('label').textContent === 'ball  450 mm'", timeout=5_000)
    page.mouse.move(2, 300)
    assert opened.do("r.comparison.focus") is None
    page.mouse.click(*ball)
    page.mouse.move(2, 300)
    assert opened.do("r.comparison.focus") == "ball"
    page.mouse.click(*ball)
    page.mouse.move(2, 300)
    assert opened.do("r.comparison.focus") is None
    page.wait_for_function("document.getElementById('label').hidden", timeout=5_000)


def test_a_body_beyond_its_horizon_loses_its_colour_until_time_goes_back(opened: Opened) -> None:
    spread = """(() => {
      let colour = null;
      window.rigidimpulse.viewer.scene_tree.find(["bodies", "2 ball"]).object.traverse((part) => {
        if (part.isMesh) { colour = part.material.color; } });
      return Math.max(...colour.toArray()) - Math.min(...colour.toArray()); })()"""
    before = opened.page.evaluate(spread)
    opened.do(f"r.seek({HORIZON + 0.01})")
    assert opened.do("r.comparison.beyond()") == ["ball"]
    assert opened.page.evaluate(spread) < 0.5 * before
    assert opened.page.inner_text("#trust") == "beyond the horizon, 0.6 s"
    opened.do(f"r.seek({HORIZON - 0.01})")
    assert opened.do("r.comparison.beyond()") == []
    assert opened.page.evaluate(spread) == before
    assert opened.page.inner_text("#trust") == "within the horizon, 0.6 s"


def test_page_of_equal_runs_of_one_frame(browser: Any, tmp_path: Any) -> None:
    one = recording(num_frames=1)
    opened = open_page(browser, ri.compare(one, one).export(tmp_path / "one.html").as_uri())
    assert opened.page.inner_text("#distance") == "0 m"
    assert opened.do("r.comparison.pose('ball')")[:3] == pytest.approx([0, 0, 1.25])
    assert opened.errors == []
