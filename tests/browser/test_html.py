"""The one-file page in a real browser: what it plays is what was recorded.

A page stores poses and times as float32, so after a seek to a recorded time a pose equals the recorded one rounded to
float32: off by at most half a unit in the last place, 2^-24 of its size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from chromium import Opened, open_page

from rigidimpulse.recording.events import IMPACT_DTYPE
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.view.page import write_html
from rigidimpulse.view.server import show

pytestmark = pytest.mark.browser

FPS = 60
DROP = 1.0  # m, height of the ball's centre above its place of impact
GRAVITY = 9.81
IMPACT_TIME = float(np.sqrt(2.0 * DROP / GRAVITY))  # 0.4515 s
RESTITUTION = 0.7
FLOAT32_ROUNDING = 2.0**-24
STRANGE_NAME = 'a/b <img src=x onerror="alert(1)"> \u2603 &amp; \U0001f404'
STRANGE_TITLE = "</title><script>alert(2)</script> {{script}}"


def recording(num_frames: int = 61) -> Recording:
    """A ball that falls and bounces, a spinning box of strange name, a floor and a wall that rest."""
    scene = Scene(
        bodies=[
            Body("floor", Shape.half_space(), motion="static"),
            Body("wall", Shape.box((0.1, 2, 0.6)), motion="static", position=(-1.5, 0, 0.3)),
            Body("ball", Shape.sphere(0.25), position=(0, 0, 0.25 + DROP)),
            Body(STRANGE_NAME, Shape.box((0.4, 0.3, 0.2)), position=(1, 0.5, 1), material=Material(density=7800)),
        ]
    )
    times = np.arange(num_frames) / FPS
    position = np.zeros((num_frames, 4, 3))
    orientation = np.tile([1.0, 0.0, 0.0, 0.0], (num_frames, 4, 1))
    position[:, 1] = (-1.5, 0, 0.3)
    after = np.maximum(times - IMPACT_TIME, 0.0)
    falling = DROP - 0.5 * GRAVITY * times**2
    rising = RESTITUTION * GRAVITY * IMPACT_TIME * after - 0.5 * GRAVITY * after**2
    position[:, 2, 0] = 0.3 * times
    position[:, 2, 2] = 0.25 + np.where(times < IMPACT_TIME, falling, rising)
    position[:, 3] = np.array([1.0, 0.5, 1.0]) + times[:, None] * np.array([-0.4, 0.1, 0.05])
    half_angle = 7.0 * times  # beyond pi: the sign of the quaternion turns round on the way
    orientation[:, 3] = np.stack([np.cos(half_angle), 0 * times, 0.6 * np.sin(half_angle), 0.8 * np.sin(half_angle)], 1)
    impacts = np.zeros(1, IMPACT_DTYPE)
    impacts[0] = (IMPACT_TIME, 0, 2, (0.3 * IMPACT_TIME, 0, 0), (0, 0, 1), 3.0, (-0.5, 0, 0), 4.4, 3.1)
    velocities = np.zeros((num_frames, 4, 3))
    return Recording(
        times, list(scene.names), position, orientation, velocities, velocities, position, impacts, scene=scene
    )


@pytest.fixture(scope="module")
def shared(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Opened:
    """The page of `recording()`, opened once from its file."""
    path = tmp_path_factory.mktemp("page") / "run.html"
    write_html(recording(), path, title=STRANGE_TITLE)
    return open_page(browser, path.as_uri())


@pytest.fixture
def opened(shared: Opened) -> Opened:
    """The shared page, paused at the start; at the end of each test nothing may have gone wrong in it."""
    shared.do("r.pause()")
    shared.do("r.seek(0)")
    yield shared  # type: ignore[misc]
    assert shared.errors == []


def test_page_plays_when_opened_and_needs_no_network(shared: Opened) -> None:
    assert shared.do("r.playing") or shared.do("r.time") > 0.0
    assert shared.do("r.duration") == pytest.approx(1.0, abs=1e-6)
    outside = [url for url in shared.requests if not url.startswith(("file:", "data:", "blob:"))]
    assert outside == []
    assert shared.errors == []


def test_poses_change_while_playing_and_stand_still_when_paused(opened: Opened) -> None:
    before, resting = opened.do("r.pose('ball')"), opened.do("r.pose('wall')")
    opened.do("r.play()")
    opened.page.wait_for_function("window.rigidimpulse.time > 0.05", timeout=10_000)
    opened.do("r.pause()")
    assert opened.do("r.pose('ball')") != before
    assert opened.do("r.pose('wall')") == resting
    stopped = opened.do("[r.time, r.pose('ball')]")
    opened.page.wait_for_timeout(250)
    assert opened.do("[r.time, r.pose('ball')]") == stopped


def test_seek_shows_the_recorded_pose_to_float32(opened: Opened) -> None:
    run = recording()
    for frame in (0, 1, 13, 27, 28, 59, 60):
        opened.do(f"r.seek({float(run.times[frame])})")
        for name in run.names:
            pose = np.array(opened.page.evaluate("(name) => window.rigidimpulse.pose(name)", name))
            recorded = np.concatenate([run.position(name)[frame], np.roll(run.orientation(name)[frame], -1)])
            assert np.all(np.abs(pose - recorded) <= FLOAT32_ROUNDING * np.maximum(np.abs(recorded), 1e-30)), name


def test_pose_between_frames_is_interpolated(opened: Opened) -> None:
    run = recording()
    opened.do(f"r.seek({0.5 * float(run.times[10] + run.times[11])})")
    expected = 0.5 * (run.position("ball")[10] + run.position("ball")[11])
    # The middle of the frame is a float32 time too: it is off by 2^-24 of 0.2 s, at less than 5 m/s.
    assert np.allclose(opened.do("r.pose('ball')")[:3], expected, rtol=0, atol=4 * FLOAT32_ROUNDING)


def test_arrow_appears_at_the_impact_and_fades(opened: Opened) -> None:
    opened.do(f"r.seek({IMPACT_TIME - 1e-4})")
    assert opened.do("r.visibleArrows()") == []
    opened.do(f"r.seek({IMPACT_TIME + 1e-4})")
    (arrow,) = opened.do("r.visibleArrows()")
    direction = np.array([-0.5, 0.0, 3.0]) / np.hypot(0.5, 3.0)
    assert np.allclose(arrow["direction"], direction, atol=1e-6)
    assert np.allclose(arrow["point"], [0.3 * IMPACT_TIME, 0, 0], atol=1e-6)
    opened.page.keyboard.press("i")
    assert opened.do("r.visibleArrows()") == []
    opened.page.keyboard.press("i")
    opened.do(f"r.seek({IMPACT_TIME + 0.41})")
    assert opened.do("r.visibleArrows()") == []


def test_picture_shows_bodies_arrows_and_ground(opened: Opened) -> None:
    opened.do(f"r.seek({IMPACT_TIME + 0.03})")
    whole = opened.picture()
    assert whole.std() > 10.0  # a blank page has one colour
    # Each layer covers some hundred pixels of the 480 x 320; hiding one must change at least a handful clearly.
    for key, least in (("b", 1000), ("i", 60), ("g", 3000)):
        opened.page.keyboard.press(key)
        without = opened.picture()
        opened.page.keyboard.press(key)
        changed = np.abs(whole - without).max(axis=2) > 6.0
        assert np.count_nonzero(changed) > least, key


def test_keys_slider_and_buttons_move_time(opened: Opened) -> None:
    opened.page.keyboard.press("ArrowRight")
    opened.page.keyboard.press("ArrowRight")
    assert opened.do("r.time") == pytest.approx(2 / FPS, rel=1e-6)
    opened.page.keyboard.press("ArrowLeft")
    assert opened.do("r.time") == pytest.approx(1 / FPS, rel=1e-6)
    opened.page.evaluate(
        "() => { const s = document.getElementById('scrubber'); s.value = 0.5; s.dispatchEvent(new Event('input')); }"
    )
    assert opened.do("r.time") == pytest.approx(0.5, rel=1e-6)
    opened.page.keyboard.press(" ")
    assert opened.do("r.playing") is True
    opened.page.click("#play")
    assert opened.do("r.playing") is False
    assert opened.page.inner_text("#clock").startswith(f"{opened.do('r.time'):.3f} s")


def test_loops_unless_told_to_stop_at_the_end(opened: Opened) -> None:
    opened.do("r.seek(0.9)")
    opened.do("r.play()")
    opened.page.wait_for_function("window.rigidimpulse.time < 0.5", timeout=10_000)
    opened.page.click("#loop")
    opened.do("r.seek(0.9)")
    opened.do("r.play()")
    opened.page.wait_for_function("!window.rigidimpulse.playing", timeout=10_000)
    assert opened.do("r.time") == pytest.approx(1.0, rel=1e-6)
    opened.page.click("#loop")


def test_names_and_title_are_text_not_markup(opened: Opened) -> None:
    assert opened.page.inner_text("h1") == STRANGE_TITLE
    assert opened.page.title() == STRANGE_TITLE
    assert opened.page.query_selector("img") is None
    assert "2 moving bodies" in opened.page.inner_text("#summary")


def test_page_leaves_out_what_its_recording_has_not(opened: Opened) -> None:
    assert opened.page.query_selector("#ledger") is None
    layers = opened.page.eval_on_selector_all("#layers label span", "all => all.map(each => each.textContent)")
    assert layers == ["Bodies", "Impacts", "Normal part", "Friction part", "Trails", "Ground", "Wireframe", "Track"]
    assert not opened.page.is_visible("#plots-button") and not opened.page.is_visible("#checks")
    assert opened.page.query_selector(".dg") is None


def test_live_page_of_a_single_frame(browser: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with show(recording(num_frames=1), open_browser=False) as viewer:
        assert viewer.url in capsys.readouterr().out
        opened = open_page(browser, viewer.url)
        assert viewer.fetched.is_set()
        opened.do("r.play()")
        assert opened.do("[r.time, r.duration, r.playing]") == [0, 0, False]
        assert opened.do("r.pose('ball')")[:3] == pytest.approx([0, 0, 1.25])
        assert opened.errors == []
