"""Draw the small pictures of the effects and the gallery from runs of their scenes: `python docs/pictures/make_stills.py [NAME ...]`.

Needs pillow, which comes with `pip install 'rigidimpulse[study]'`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

from rigidimpulse import gallery, simulate
from rigidimpulse.view.picture import draw_picture

STILLS = Path(__file__).resolve().parent / "stills"
FRACTIONS = {
    "spot": 0.30,
    "marbles": 0.35,
    "table_on_four_feet": 0.5,
    "arm": 0.25,
    "cloth_on_ball": 0.6,
    "jelly_on_stairs": 0.5,
    "settled_layout": 0.1,
    "smoothed_path": 0.6,
    "pool_break": 0.1,
    "cradle_strings": 0.167,
    "dice": 0.12,
    "crowd_momentum": 0.3,
    "planets": 0.5,
    "emergency_stop": 0.6,
    "wing_nut": 0.3,
    "pile": 0.6,
}
"""Scenes, and the part of each run after which the picture is taken."""
SIZE = (360, 225)
"""Pixels."""


def main(names: list[str]) -> None:
    """Run the scenes and write their stills."""
    STILLS.mkdir(exist_ok=True)
    for name in names or FRACTIONS:
        entry = gallery.load(name)
        run = simulate(entry.scene(), entry.duration, entry.fps, accuracy=entry.accuracy)
        picture = draw_picture(run, *SIZE, frame=round(FRACTIONS[name] * (len(run.times) - 1)))
        path = STILLS / f"still_{name}.jpg"
        Image.fromarray(picture).save(path, quality=82, optimize=True)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
