"""The contact sheet of a wedge: its cards show the runs at one time, and can be sorted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import open_page

import rigidimpulse as ri
from rigidimpulse.studies.wedges.wedge import Wedge

pytest.importorskip("h5py")
pytestmark = pytest.mark.browser

POSE = 1e-4
"""m and of quaternions: half a step of 16 bits is 1.5e-5, and float32 of a metre 6e-8."""


def tumble(height: float = 1.0) -> ri.Scene:
    """A box and a ball over the floor; a height below 0 is refused."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    size = (0.4, 0.3, 0.2) if height > 0.0 else (-1.0, 1.0, 1.0)
    bouncing = ri.Material(restitution=0.5)
    scene.add(ri.Body("box", ri.Shape.box(size), position=(0, 0, height), angular_velocity=(3, 1, 2), material=bouncing))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0.5, 0, height), velocity=(0.2, 0, 0)))
    return scene


@pytest.fixture(scope="module")
def wedge(tmp_path_factory: pytest.TempPathFactory) -> Wedge:
    folder = tmp_path_factory.mktemp("wedge")
    return ri.wedge(tumble, {"height": [1.0, 1.5, -1.0], "seed": [0, 1]}, folder, duration=0.8, fps=30, workers=ri.Workers(processes=1))


@pytest.fixture(scope="module")
def page(browser: Any, wedge: Wedge) -> Any:
    opened = open_page(browser, (wedge.folder / "index.html").as_uri(), 1000, 900)
    assert not opened.errors
    return opened.page


def scrub(page: Any, time: float) -> None:
    script = "(time) => { const s = document.getElementById('scrubber'); s.value = time; s.oninput(); window.rigidimpulse.draw(time); }"
    page.evaluate(script, time)


def test_cards_show_their_runs(page: Any, wedge: Wedge) -> None:
    assert "6 takes" in page.inner_text("#summary") and "2 failed" in page.inner_text("#summary")
    for frame in (0, 7, 24):
        time = float(wedge.recording(0).times[frame])
        scrub(page, time)
        poses = page.evaluate("""() => window.rigidimpulse.cards.map((card) => card.picture && card.picture.moving.map(
            (node) => [...node.position.toArray(), ...node.quaternion.toArray()]))""")
        assert [pose is None for pose in poses] == [False] * 4 + [True] * 2
        for number in range(4):
            run = wedge.recording(number)
            for pose, name in zip(np.array(poses[number]), ("box", "ball"), strict=True):
                recorded = np.concatenate([run.position(name)[frame], np.roll(run.orientation(name)[frame], -1)])
                sign = np.sign(pose[3:] @ recorded[3:])
                assert np.allclose(pose * [1, 1, 1, sign, sign, sign, sign], recorded, rtol=0, atol=POSE)
    assert page.evaluate("window.rigidimpulse.state.drawn") == 4


def test_something_is_seen(page: Any) -> None:
    # Blue boxes on grey: pictures differ from card to card and from time to time.
    scrub(page, 0.0)
    page.wait_for_timeout(200)
    before = [page.locator(".picture").nth(k).screenshot() for k in (0, 2)]
    scrub(page, 0.5)
    page.wait_for_timeout(200)
    assert page.locator(".picture").nth(0).screenshot() != before[0] != before[1]


def test_cards_are_sorted_by_any_figure(page: Any, wedge: Wedge) -> None:
    def numbers() -> list[int]:
        return [int(text.split()[0]) for text in page.locator(".number").all_inner_texts()]

    page.select_option("#sort", "J dissipated")
    lost = [wedge.takes[number].dissipated for number in numbers()[:4]]
    assert lost == sorted(lost) and numbers()[4:] == [4, 5]
    page.select_option("#sort", "height")
    page.click("#order")
    assert numbers() == [3, 2, 1, 0, 5, 4]
    page.click("#order")
    page.select_option("#sort", "")
    assert numbers() == [0, 1, 2, 3, 4, 5]


def test_a_card_opens_its_page(page: Any, wedge: Wedge) -> None:
    link = page.locator("a.card").nth(1).get_attribute("href")
    assert (Path(wedge.folder) / link).is_file()
    assert page.locator("div.card").count() == 2
