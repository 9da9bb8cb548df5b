"""Draw pages of an earlier version of the package beside those of this one: `python docs/pictures/before_and_after.py CHECKOUT [NAME ...]`.

CHECKOUT: a clone of the project at the earlier commit. Each scene of the gallery runs in both, and both pages are drawn at the same time of
the run, as a browser of 1280 by 800 pixels shows them. Needs Chromium, Playwright and pillow, as the tests of pages do.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "browser"))
PICTURES = Path(__file__).resolve().parent / "before_and_after"
TIMES = {
    "spot": 0.6,
    "pool_break": 0.45,
    "cradle_two": 0.75,
    "superball": 0.6,
    "wing_nut": 1.5,
    "arm": 0.7,
    "pile": 1.2,
    "rolling": 0.8,
    "cloth_on_ball": 1.0,
    "jelly_on_stairs": 0.8,
}
"""Scenes, and the time in s at which they are drawn."""
WINDOW = (1280, 800)
HALF = (560, 350)
"""Pixels of a page in the browser, and in the picture."""


def make_page(checkout: Path, name: str, folder: Path) -> Path:
    """The page of a gallery scene, by the package of a checkout."""
    page = folder / f"{name}.html"
    command = [sys.executable, "-m", "rigidimpulse", "demo", name, "-o", str(page)]
    subprocess.run(command, env={**os.environ, "PYTHONPATH": str(checkout)}, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return page


def draw(browser, page: Path, time: float) -> Image.Image:
    """The page at a time of its run, s."""
    from chromium import open_page  # pyright: ignore[reportMissingImports]

    opened = open_page(browser, page.as_uri(), *WINDOW)
    opened.do("r.pause()")
    opened.do(f"r.seek({time})")
    opened.page.wait_for_timeout(1500)
    image = Image.open(io.BytesIO(opened.page.screenshot())).convert("RGB")
    opened.page.close()
    return image.resize(HALF, Image.Resampling.LANCZOS)


def main(checkout: Path, names: list[str]) -> None:
    """Draw the scenes, before on the left."""
    from chromium import chromium  # pyright: ignore[reportMissingImports]

    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as place, chromium() as browser:
        for name in names or TIMES:
            both = Image.new("RGB", (2 * HALF[0] + 8, HALF[1]), "white")
            for side, package in enumerate((checkout, ROOT)):
                folder = Path(place) / str(side)
                folder.mkdir(exist_ok=True)
                both.paste(draw(browser, make_page(package, name, folder), TIMES[name]), (side * (HALF[0] + 8), 0))
            path = PICTURES / f"{name}.jpg"
            both.save(path, quality=80, optimize=True)
            print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), sys.argv[2:])
