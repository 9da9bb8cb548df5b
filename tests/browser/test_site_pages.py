"""Pages of the gallery in a real browser: from the index to a scene that plays, from files alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from test_html import recording

from rigidimpulse import gallery
from rigidimpulse.gallery.record import at_most
from rigidimpulse.studies.hard_cases import FAILED, PASSED, CaseResult, as_plain
from rigidimpulse.studies.site_pages import index_page, scene_page
from rigidimpulse.view.page import write_html
from rigidimpulse.view.picture import draw_picture, png

pytestmark = pytest.mark.browser


def write_site(folder: Path) -> None:
    """A scene with pages and one that has none, as if it had crashed."""
    checks = [as_plain(at_most("error <m>", 0.5, 1.0, "a < b & c")), as_plain(at_most("other", 2.0, 1.0, "law"))]
    results = []
    for name, outcome, found in (("two_spheres", FAILED, checks), ("bounce", PASSED, checks[:1])):
        results.append(CaseResult(name, f"about <{name}>", "", outcome, found, 1.5, 4.0, 7, "finished"))
        (folder / f"{name}.html").write_text(scene_page(gallery.load(name), results[-1], folder), encoding="utf-8")
    write_html(recording(), folder / "two_spheres_play.html", title="two_spheres")
    (folder / "two_spheres.png").write_bytes(png(draw_picture(recording(), 160, 100)))
    (folder / "two_spheres.html").write_text(scene_page(gallery.load("two_spheres"), results[0], folder), encoding="utf-8")
    (folder / "index.html").write_text(index_page(results, folder), encoding="utf-8")


def test_from_the_index_to_a_scene_that_plays(browser: Any, tmp_path: Path) -> None:
    write_site(tmp_path)
    page = browser.new_page(viewport={"width": 400, "height": 300})
    errors: list[str] = []
    asked: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto((tmp_path / "index.html").as_uri())
    assert page.inner_text(".card.bad .badge") == "✗ 1 of 2 checks" and page.inner_text(".card.good .badge") == "✓ 1 of 1 check"
    page.wait_for_function("document.querySelector('.card.bad img').naturalWidth === 160")
    assert page.locator(".card.good .none").count() == 1
    page.click(".card.bad")
    page.wait_for_selector("iframe")
    assert page.inner_text("h1") == "two_spheres" and page.inner_text(".lead") == gallery.load("two_spheres").description
    rows = page.eval_on_selector_all("section.checks tr", "all => all.map(row => row.innerText.split('\\t')[1])")
    assert rows == ["check", "error <m>", "other"]
    frame = next(each for each in page.frames if each.url.endswith("_play.html"))
    frame.wait_for_function("window.rigidimpulse !== undefined && window.rigidimpulse.playing", timeout=45_000)
    page.click(".back a")
    page.wait_for_selector(".cards")
    assert errors == [] and [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    page.close()
