"""How long pages of many bodies take to open, and what they hold: both ways to keep the motion, in headless Chromium.

    python tests/bench/open_pages.py [BODIES FRAMES ...]

Boxes, balls, capsules and cylinders that all move and turn, in a window of 1280 x 720. "moving" is the time from navigation to the end of
the first picture whose time is not the start; MB heap: the heap of JavaScript after collection, without arrays; seek is the mean of twenty.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import rigidimpulse as ri
from rigidimpulse.recording.events import IMPACT_DTYPE
from rigidimpulse.view.page import render_page

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "browser"))
from chromium import FLAGS, find_chromium

WATCH = """(() => {
  let kept;
  Object.defineProperty(window, "rigidimpulse", {get: () => kept, set(value) {
    kept = value;
    const viewer = value.viewer, render = viewer.render;
    viewer.render = () => {
      render();
      if (value.time > 0 && !window.moving) {
        const gl = viewer.renderer.getContext();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits for the picture
        window.moving = performance.now();
      }
    };
  }});
})()"""
SEEK = """(() => {
  const start = performance.now();
  for (let k = 0; k < 20; k++) { rigidimpulse.seek((k / 20) * rigidimpulse.duration); }
  return (performance.now() - start) / 20;
})()"""


def many(num_bodies: int, num_frames: int) -> ri.Recording:
    """Return bodies that swing and turn above a floor."""
    rng = np.random.default_rng(0)
    shapes = [ri.Shape.box((0.3, 0.2, 0.1)), ri.Shape.sphere(0.15), ri.Shape.capsule(0.08, 0.2), ri.Shape.cylinder(0.12, 0.2)]
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    for k in range(num_bodies):
        scene.add(ri.Body(f"body {k}", shapes[k % 4]))
    times = np.arange(num_frames) / 60.0
    positions, orientations = np.zeros((num_frames, num_bodies + 1, 3)), np.zeros((num_frames, num_bodies + 1, 4))
    orientations[:, 0, 0] = 1.0
    swing = np.sin(times[:, None, None] * rng.normal(size=(num_bodies, 3)))
    positions[:, 1:] = rng.uniform(-5.0, 5.0, (num_bodies, 3)) + [0.0, 0.0, 6.0] + 0.6 * swing
    axis = rng.normal(size=(num_bodies, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    half = 0.5 * times[:, None] * rng.uniform(1.0, 8.0, num_bodies)
    orientations[:, 1:] = np.concatenate([np.cos(half)[..., None], np.sin(half)[..., None] * axis], axis=2)
    rest = np.zeros_like(positions)
    impacts = np.zeros(0, IMPACT_DTYPE)
    return ri.Recording(times, list(scene.names), positions, orientations, rest, rest, positions, impacts, scene=scene)


def measure(playwright, path: Path) -> str:
    """Return the figures of a page."""
    browser = playwright.chromium.launch(executable_path=find_chromium(), headless=True, args=[*FLAGS, "--js-flags=--expose-gc"])
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.add_init_script(WATCH)
    page.goto(path.as_uri(), wait_until="commit")
    page.wait_for_function("window.moving", timeout=300_000, polling=50)
    moving = page.evaluate("window.moving / 1000")
    page.evaluate("rigidimpulse.pause(); gc()")
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    pile = {entry["name"]: entry["value"] for entry in session.send("Performance.getMetrics")["metrics"]}["JSHeapUsedSize"]
    seek = page.evaluate(SEEK)
    browser.close()
    return f"{path.stat().st_size / 1e6:8.1f} MB {moving:8.2f} s moving {pile / 1e6:8.1f} MB heap {seek:8.2f} ms a seek"


def main() -> None:
    """Measure all sizes both ways."""
    from playwright.sync_api import sync_playwright

    sizes = [int(word) for word in sys.argv[1:]] or [1000, 240, 1000, 1440]
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        for num_bodies, num_frames in zip(sizes[::2], sizes[1::2]):
            run = many(num_bodies, num_frames)
            for kind, bound in (("tracks", 10**9), ("glTF", 0)):
                path = Path(folder) / f"{kind}.html"
                path.write_text(render_page(run, most_keys=bound), encoding="utf-8")
                print(f"{num_bodies} x {num_frames} as {kind:7}", measure(playwright, path), flush=True)


if __name__ == "__main__":
    main()
