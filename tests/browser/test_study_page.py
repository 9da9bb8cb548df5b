"""The page of a study in a real browser: offline, every family a line, another error measure at the choice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rigidimpulse as ri
from rigidimpulse.studies.settings import grid

pytestmark = pytest.mark.browser


def test_the_page_shows_families_and_changes_the_measure(browser: Any, tmp_path: Path) -> None:
    settings = [setting for setting in grid() if setting.family in ("presets", "linear, step", "after, step")]
    ri.study("bounce", 4.0, settings=settings, output=tmp_path)
    page = browser.new_page(viewport={"width": 1200, "height": 800})
    errors: list[str] = []
    asked: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda request: asked.append(request.url) if not request.url.startswith(("file:", "data:", "blob:")) else None)
    page.goto((tmp_path / "settings.html").as_uri())
    page.wait_for_selector(".legendtext")

    def names() -> set[str]:
        return set(page.eval_on_selector_all(".legendtext", "all => all.map(each => each.textContent)"))

    assert names() == {"front", "presets", "linear, step", "after, step"}
    # Points lie where the table says: one of the first family after the front.
    plot = "document.querySelector('.plotly-graph-div')"
    assert page.evaluate(f"{plot}.layout.yaxis.title.text") == "largest error of the place, m"
    page.locator(".updatemenu-header").click()
    page.locator(".updatemenu-dropdown-button", has_text="impact's time").click()
    assert page.evaluate(f"{plot}.layout.yaxis.title.text") == "largest error of an impact's time, s"
    assert "linear, step" in names()
    assert errors == [] and asked == []
