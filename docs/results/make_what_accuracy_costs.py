"""Make docs/what_accuracy_costs.md and its charts from real runs: `python docs/make_what_accuracy_costs.py [--budget S]`.

Table and chart of each scene go to docs/accuracy_costs/. Needs `pip install 'rigidimpulse[study,peers]'` and about as long as nine
budgets, on a core of its own.
"""

from __future__ import annotations

import argparse
import math
import platform
import shutil
import tempfile
from pathlib import Path
from typing import NamedTuple

from PIL import Image

import rigidimpulse as ri
from rigidimpulse.studies.peers import PEERS
from rigidimpulse.studies.work_precision import Study

DOCS = Path(__file__).resolve().parent
KEPT = DOCS / "accuracy_costs"
COLOURS = 48
"""Colours of a chart as it is kept: a third of the bytes, and the same to the eye."""


class Topic(NamedTuple):
    """A scene of the page: how long it is run [s], whether other engines know it, and what to say of it."""

    duration: float
    peers: bool
    words: str


TOPICS = {
    "bounce": Topic(10.0, True, "A ball falls from 10 m on a floor and bounces without loss: four impacts, parabolas in between."),
    "tumbling_box": Topic(10.0, True, "A box tumbles through the air, no impact at all: what is left is how a free body turns."),
    "disks_in_a_box": Topic(60.0, True, "Three elastic disks, 35 impacts: an error at one is a hundred times as large two impacts on."),
    "pool_break": Topic(5.0, True, "A cue ball breaks a rack of fifteen: forty impacts in a tenth of a second, then chaos."),
    "stack_10": Topic(4.0, True, "Ten boxes stand on each other: nothing may move."),
    "incline": Topic(4.0, True, "Blocks on a slope, 0.1 degrees to either side of the angle at which friction lets go, and at it."),
    "chain_swinging": Topic(0.05, False, "A chain of 100 links begins to swing a ball a thousand times as heavy as a link."),
    "arm": Topic(2.0, False, "An arm of two parts falls against the bounds of its joints: a cone and a soft twist, a hinge."),
    "spot": Topic(2.0, True, "A cow of 5,856 triangles falls on a torus of 4,096. (MuJoCo has hulls for meshes, Bullet for moving ones.)"),
    "toss_alone": Topic(81 / 148, True, "A real cube, thrown on a board and filmed; the reference is the recording."),
}
METHODS = {
    "kinematic": "kinematic, step", "penalty": "penalty, step", "linear": "linear, step", "bisection": "bisection, step",
    "after the fact": "after, step", "MuJoCo": "mujoco", "Bullet": "pybullet",
}  # fmt: skip
"""Columns of the table side by side: title and family."""
ADVICE = """## What to choose

- **Nothing.** The default finds impact times by bisection to 1e-13 of a body's size and flies exactly in between. Where bodies only fly
  and hit each other that is as right as sixteen digits allow, and no cheaper setting is faster by more than a little.
- **Lasting contact** is where accuracy is paid for: its error falls with the square of the step, its cost rises with the number of
  steps. Ask with `accuracy=ri.Within(position=...)` instead of trying steps.
- **"preview"** is for looking: impacts a little early, heaps deeper in each other while they fall (see below), everything else the same.
- **"linear"** is of second order in the step and costs about as much as bisection: there is no reason to use it but to see what it does.
  **"after"** moves bodies into each other for up to a step and is of first order. **Kinematic** responses turn velocities back without
  impulses: right for smooth balls, wrong as soon as anything spins. **Penalty** forces cost most, since springs must be stepped, and
  their error goes away with the stiffness, not with the step.
- **Chaos** ends every promise: look at `run.horizon` before you make the step smaller.
- **Other engines** take a fixed step whatever happens in it, so their error is of first order in the step; a contact lasts some steps
  there. They are made for crowds of bodies at 60 steps a second, which is where they are fast.

## A heap

A thousand boxes fall into a pit ([heaps](heaps.md)). There is no reference for where they land; what shows is how deep they are inside each
other on the way. The knobs are `substep_motion`, how far bodies move until contacts are looked for again, and `step`. Made by
`python tests/bench/substepped_costs.py`, on one core; boxes of 0.5 m.

![heap](heap_costs.png)

Every setting of other engines has one here that is both faster and less deep: at 12 mm `step=1/30, substep_motion=1` takes 0.7 of the
time that Rapier takes at 127 mm, a quarter of a box, with its usual steps of 1/60 s. With steps of 1/240 s PhysX is 9 mm deep and Rapier
26, in 3.8 and 1.5 times the time of the default here, at 2.9 mm. (The deepest pair of ten frames of any of five falls, of which three stay
apart with the default; times are the median of the five. One fall of an engine.)
"""


def main() -> None:
    """Run what is asked for, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--budget", type=float, default=60.0, help="s for a scene")
    parser.add_argument("--keep", type=Path, help="folder for the studies; those found there are gone on with")
    arguments = parser.parse_args()
    KEPT.mkdir(exist_ok=True)
    studies = {}
    for name in TOPICS:
        with tempfile.TemporaryDirectory() as folder:
            studies[name] = run(name, arguments.budget, (arguments.keep or Path(folder)) / name)
        print(name, len(studies[name].rows), "runs;", studies[name].reference.describe())
    page = "\n".join([HEAD, side_by_side(studies), ADVICE, *(section(name, studies[name]) for name in studies)])
    (DOCS / "what_accuracy_costs.md").write_text(page, encoding="utf-8")


HEAD = f"""# What accuracy costs

Made by `python docs/make_what_accuracy_costs.py` from runs on {platform.machine()}, one core; how to measure a scene of your own:
[studies](study.md). Errors are the largest of any body at any frame; costs are CPU seconds of the loop (of the steps, in other engines).
"""


def run(name: str, budget: float, folder: Path) -> Study:
    """Study one scene."""
    topic = TOPICS[name]
    result = ri.study(name, topic.duration, budget=budget, peers=PEERS if topic.peers else (), output=folder)
    shutil.copy(folder / "study.csv", KEPT / f"{name}.csv")
    chart = Image.open(folder / "study.png").convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    chart.save(KEPT / f"{name}.png", optimize=True)
    return result


def figure(value: float) -> str:
    """A number for a table."""
    return "-" if math.isnan(value) else "0" if value == 0.0 else f"{value:.1e}"


def side_by_side(studies: dict[str, Study]) -> str:
    """Best error of each method in each scene, and what it cost."""
    lines = ["## Side by side", "", "Least error of the place that a method reached, m, and what that cost, s.", ""]
    lines += [f"| scene | {' | '.join(METHODS)} |", "|---" * (len(METHODS) + 1) + "|"]
    for name, study in studies.items():
        cells = []
        for family in METHODS.values():
            rows = [row for row in study.rows if row.family == family and row.ran and not math.isnan(row.whole.position)]
            best = min(rows, key=lambda row: row.whole.position, default=None)
            cells.append("-" if best is None else f"{figure(best.whole.position)} in {figure(best.cost)}")
        lines.append(f"| `{name}` | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def section(name: str, study: Study) -> str:
    """What is said of one scene."""
    rows = [row for row in study.rows if row.family == "presets"] + [row for row in study.front() if row.family != "presets"]
    lines = [f"## `{name}`", "", TOPICS[name].words, "", f"Reference: {study.reference.describe()}.", ""]
    lines += ["| setting | cost, s | place, m | energy | impact times, s | overlap, m |", "|---|---|---|---|---|---|"]
    for row in rows:
        whole = row.whole
        least = study.reference.uncertainty
        place = figure(whole.position) if whole.position >= least else f"< {figure(least)}"
        numbers = [figure(row.cost), place, *(figure(value) for value in (whole.energy, whole.impact_time, whole.penetration))]
        lines.append(f"| {row.name} | {' | '.join(numbers)} |")
    found = study.advantage()
    for peer in PEERS:
        ratios = [ratio for row, _, ratio in found if row.family == peer]
        faster = sum(row.family == peer and row.ran for row in study.rows) - len(ratios)
        if ratios:
            lines += ["", f"At equal time {figure(min(ratios))} to {figure(max(ratios))} times as accurate as {peer}, whatever its step."]
        if faster:
            lines += ["", f"{peer} is faster than any run here with {faster} of its steps."]
    if study.left:
        lines += ["", f"The budget had no time for {len(study.left)} settings."]
    return "\n".join([*lines, "", f"![{name}](accuracy_costs/{name}.png)", ""])


if __name__ == "__main__":
    main()
