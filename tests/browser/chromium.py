"""Finds the system's Chromium and starts it headless, with WebGL in software and without a word to the network."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

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
