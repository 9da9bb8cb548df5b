"""Colours of bodies on all pages: of a run, live, and of a wedge."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from chromium import Opened, open_page
from PIL import Image

import rigidimpulse as ri

pytestmark = pytest.mark.browser

RED, GREEN, BLUE = (0.6, 0.1, 0.1), (0.1, 0.5, 0.1), (0.1, 0.1, 0.6)
CUBE = trimesh.creation.box((1.0, 1.0, 1.0))
BY_SIDE = np.array([RED if abs(n[2]) > 0.5 else GREEN if abs(n[1]) > 0.5 else BLUE for n in CUBE.face_normals])
LEAST = 200
"""Pixels of each colour: the cube has thousands where it is alone."""


def painted(height: float = 0.1) -> ri.Scene:
    """A cube with red, green and blue sides, which turns above a purple floor, and collides as a sphere."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(offset=-1.0), motion="static", visual=ri.Visual("#a020f0")))
    cube = ri.Visual(shape=ri.Shape.mesh(CUBE.vertices, CUBE.faces, BY_SIDE))
    scene.add(ri.Body("cube", ri.Shape.sphere(0.5), position=(0, 0, height), angular_velocity=(0, 0, 1), visual=cube))
    return scene


def assert_colours(picture: np.ndarray) -> None:
    """Check that red, green and blue are seen, and the floor."""
    red, green, blue = np.moveaxis(picture.astype(float), 2, 0)
    assert np.sum((red > 1.5 * green) & (red > 1.5 * blue)) > LEAST
    assert np.sum((green > 1.5 * red) & (green > 1.5 * blue)) > LEAST
    assert np.sum((blue > 1.5 * red) & (blue > 1.5 * green)) > LEAST
    assert np.sum((blue > 1.05 * red) & (red > 1.2 * green)) > LEAST


def drawn(opened: Opened) -> np.ndarray:
    opened.page.wait_for_timeout(500)
    return np.asarray(Image.open(io.BytesIO(opened.page.screenshot())).convert("RGB"))


def test_the_page_of_a_run(browser: Any, tmp_path: Path) -> None:
    path = ri.simulate(painted(), 0.2).export(tmp_path / "run.html")
    opened = open_page(browser, path.as_uri(), 700, 500)
    assert opened.errors == []
    assert_colours(opened.picture())


def test_the_live_page(browser: Any) -> None:
    session = ri.live(painted, 0.2, open_browser=False)
    try:
        opened = open_page(browser, session.url, 700, 500)
        opened.page.wait_for_function("() => window.rigidimpulse.doing === 'done'", timeout=20_000)
        assert_colours(drawn(opened))
        assert opened.errors == []
    finally:
        session.close()


def test_the_cards_of_a_wedge(browser: Any, tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    wedge = ri.wedge(painted, {"height": [0.1]}, tmp_path / "wedge", duration=0.2, fps=30, workers=ri.Workers(processes=1))
    opened = open_page(browser, (wedge.folder / "index.html").as_uri(), 1000, 700)
    assert_colours(drawn(opened))
    assert opened.errors == []
