"""Study ten scenes with many settings: `python docs/results/measure_accuracy_costs.py [--budget S] [--page]`.

With --page only the playable page of `spot` is made. Table and chart of each scene go to docs/results/accuracy_costs/; `make_results.py`
makes the page of them. Needs `pip install 'rigidimpulse[study,peers]'` and about as long as ten budgets, on a core of its own.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

from PIL import Image
from provenance import note
from topics import KEPT, TOPICS

import rigidimpulse as ri
from rigidimpulse.studies.peers import PEERS

PLAYED = KEPT.parent.parent / "_static" / "study_spot.html"
"""The playable page."""
COLOURS = 48
"""Colours of a chart as it is kept: a third of the bytes, and the same to the eye."""


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--budget", type=float, default=60.0, help="s for a scene")
    parser.add_argument("--keep", type=Path, help="folder for the studies; those found there are continued")
    parser.add_argument("--page", action="store_true", help="only the page that plays the runs of `spot`")
    arguments = parser.parse_args()
    if arguments.page:
        make_page(arguments.budget)
        return
    KEPT.mkdir(exist_ok=True)
    for name in TOPICS:
        with tempfile.TemporaryDirectory() as folder:
            measure(name, arguments.budget, (arguments.keep or Path(folder)) / name)


def make_page(budget: float) -> None:
    """Make the page that plays the runs of `spot`."""
    with tempfile.TemporaryDirectory() as folder:
        ri.glance("spot", TOPICS["spot"].duration, budget=budget, output=folder)
        shutil.copy(Path(folder) / "study.html", PLAYED)


def measure(name: str, budget: float, folder: Path) -> None:
    """Study one scene and keep its table, its chart and what is known of its reference."""
    topic = TOPICS[name]
    study = ri.study(name, topic.duration, budget=budget, peers=PEERS if topic.peers else (), output=folder)
    shutil.copy(folder / "study.csv", KEPT / f"{name}.csv")
    chart = Image.open(folder / "study.png").convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    chart.save(KEPT / f"{name}.png", optimize=True)
    reference = study.reference
    note(
        KEPT / f"{name}.csv", "python docs/results/measure_accuracy_costs.py", reference=reference.describe(),
        uncertainty=reference.uncertainty, left=len(study.left),
    )  # fmt: skip
    print(name, len(study.rows), "runs;", reference.describe())


if __name__ == "__main__":
    main()
