"""The page of a large recording, whose motion is a glTF file: poses are those of the recording, and all else is as on other pages.

The bound on keys is lowered, so that a small run counts as large. Positions and rotations are float32 in the file, where rotations
are made unit again: off by a few 2^-24.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from chromium import Opened, open_page
from test_html import STRANGE_NAME, recording
from test_recording_page import full_run

from rigidimpulse.view.contents import is_large
from rigidimpulse.view.page import render_page

pytestmark = pytest.mark.browser

POSE = 1e-5


@pytest.fixture(scope="module")
def opened(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Opened:
    """The page of `full_run` as a large one, paused."""
    path = tmp_path_factory.mktemp("page") / "large.html"
    path.write_text(render_page(full_run(), most_keys=2 * 61 - 1), encoding="utf-8")
    page = open_page(browser, path.as_uri())
    page.do("r.pause()")
    return page


def test_large_is_more_keys_of_moving_bodies_than_the_bound() -> None:
    # Of the four bodies two move, at 61 frames; floor and wall are no keys.
    for most, large in ((2 * 61, False), (2 * 61 - 1, True)):
        assert is_large(recording(), most) is large
        page = render_page(recording(), most_keys=most)
        assert ('data-kind="glb"' in page) is large
        assert ('data-kind="motion"' in page) is not large


def test_poses_are_those_of_the_recording(opened: Opened) -> None:
    run = full_run()
    for frame in (0, 1, 13, 27, 28, 59, 60):
        opened.do(f"r.seek({float(run.times[frame])})")
        for name in run.names:
            pose = np.array(opened.page.evaluate("(name) => window.rigidimpulse.pose(name)", name))
            recorded = np.concatenate([run.position(name)[frame], np.roll(run.orientation(name)[frame], -1)])
            sign = np.sign(pose[3:] @ recorded[3:])
            assert np.allclose(pose * [1, 1, 1, sign, sign, sign, sign], recorded, rtol=0, atol=POSE), (frame, name)


def test_between_frames_bodies_are_between(opened: Opened) -> None:
    run = full_run()
    opened.do(f"r.seek({0.5 * float(run.times[10] + run.times[11])})")
    middle = 0.5 * (run.position("ball")[10] + run.position("ball")[11])
    assert np.allclose(opened.do("r.pose('ball')")[:3], middle, rtol=0, atol=POSE)


def test_time_line_plots_trails_and_playing_work_as_on_other_pages(opened: Opened) -> None:
    run = full_run()
    marks = opened.page.locator("#marks").bounding_box()
    opened.page.mouse.click(marks["x"] + 8 + 0.5 * (marks["width"] - 16), marks["y"] + 10)
    assert opened.do("r.time") == pytest.approx(0.5, abs=2.0 / 400.0)
    path = np.array(opened.page.evaluate("(name) => window.rigidimpulse.trail(name)", STRANGE_NAME)).reshape(-1, 4)
    assert np.allclose(path[:, :3], run.center_of_mass(STRANGE_NAME), rtol=0, atol=POSE)
    opened.page.keyboard.press("-")
    assert opened.do("r.speed") == 0.5
    opened.do("r.seek(0.1)")
    opened.do("r.play()")
    opened.page.wait_for_function("window.rigidimpulse.time > 0.15", timeout=10_000)
    opened.do("r.pause()")
    opened.page.keyboard.press("p")
    assert opened.page.is_visible("#energy")
    outside = [url for url in opened.requests if not url.startswith(("file:", "data:", "blob:"))]
    assert outside == [] and opened.errors == []
