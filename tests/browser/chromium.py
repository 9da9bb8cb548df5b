"""Finds the system's Chromium and starts it headless, with WebGL in software and without a word to the network."""

from __future__ import annotations

import io
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--no-sandbox --disable-gpu --use-angle=swiftshader --enable-unsafe-swiftshader --disable-quic --no-first-run "
    "--disable-background-networking --disable-component-update --disable-sync"
).split()


def find_chromium() -> str:
    """Return the path of a Chromium; without one skip the test, but fail it where CI is set."""
    for name in NAMES:
        path = shutil.which(name)
        if path:
            return path
    message = f"no browser found: none of {', '.join(NAMES)} is on the PATH (Debian: apt-get install chromium)"
    if os.environ.get("CI"):
        pytest.fail(message)
    pytest.skip(message)


@contextmanager
def chromium() -> Iterator[Any]:
    """Yield a headless browser of Playwright's synchronous API."""
    path = find_chromium()
    if not os.environ.get("CI"):
        pytest.importorskip("playwright", reason="playwright is not installed (pip install rigidimpulse[test])")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, headless=True, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


@dataclass
class Opened:
    """A page in the browser, and what it complained about or asked for."""

    page: Any
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def do(self, script: str) -> Any:
        """Return the value of a script that uses `r` for the page's rigidimpulse object."""
        return self.page.evaluate(f"(() => {{ const r = window.rigidimpulse; return {script}; }})()")

    def picture(self) -> np.ndarray:
        """Return what the page shows without its overlay, (height, width, 3) of 0..255."""
        from PIL import Image

        self.page.evaluate("document.body.classList.add('bare')")
        self.page.wait_for_timeout(300)
        picture = self.page.screenshot()
        self.page.evaluate("document.body.classList.remove('bare')")
        return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=np.float64)


def open_page(browser: Any, url: str, width: int = 480, height: int = 320, **options: Any) -> Opened:
    """Open a page and wait until it has drawn itself; options: of the browser's `new_page`."""
    page = browser.new_page(viewport={"width": width, "height": height}, **options)
    opened = Opened(page)
    page.on("console", lambda message: opened.errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: opened.errors.append(str(error)))
    page.on("dialog", lambda dialog: (opened.errors.append("dialog: " + dialog.message), dialog.dismiss()))
    page.on("request", lambda request: opened.requests.append(request.url))
    page.goto(url)
    page.wait_for_function("window.rigidimpulse !== undefined", timeout=45_000)
    return opened
