"""What accuracy costs in a pile: `python tests/bench/substepped_costs.py` runs 1,000 boxes, `... --draw` draws docs/results/pile_costs.png.

The pile of `piles`, 5 s, at several values of `Accuracy.substep_motion` and `step`, and in the fastest other engines (see `engines`) at two
steps each. Time is that of the loop for 1/60 s of motion, recording included, the mean over all in which anything moves: a pile that has
come to rest costs nothing, other engines are not allowed to sleep. Depth is the greatest of any pair in the frames at 0.5, 1 ... 5 s, by
separating axes from the recorded poses; each needs a run of its own in another engine. Settings here have FALLS falls, which begin a
nanometre apart and end differently, by a third in time and tenfold in depth: what counts is the median time and the greatest depth. Lines
go to docs/results/accuracy_costs/pile_1000.csv.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from time import process_time
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from bench_scenes import machine
from engines import run_engines, use_cores
from piles import depths, pile

import rigidimpulse as ri

NUMBER, DURATION, FPS, FALLS = 1000, 5.0, 60.0, 5
LOOKS = tuple(np.arange(0.5, DURATION + 0.25, 0.5))
"""s, when depths are measured."""
STANDARD, HALVES = 1.0 / 60.0, 1.0 / 30.0
SETTINGS = {
    "step 1/60": [ri.Accuracy(substep_motion=motion) for motion in (0.05, 0.1, 0.3, 1.0)],
    "step 1/30": [ri.Accuracy(step=HALVES, substep_motion=motion) for motion in (0.1, 0.3, 1.0)],
    "step 1/20": [ri.Accuracy(step=1.0 / 20.0, substep_motion=motion) for motion in (0.3, 1.0)],
}
NAMED = {(STANDARD, 0.1): "standard", (HALVES, 0.3): "preview"}
PEERS, PEER_STEPS = ("PhysX", "Rapier"), (1.0 / 60.0, 1.0 / 240.0)
RESULTS = Path(__file__).resolve().parent.parent.parent / "docs" / "results"
TABLE, PICTURE = RESULTS / "accuracy_costs" / "pile_1000.csv", RESULTS / "pile_costs.png"
TICKS = (2.0, 3.0, 5.0, 10.0, 20.0, 30.0)
"""ms."""
BESIDE = {
    "standard": (7, -12), "preview": (9, -1), "substep_motion 0.05": (9, -3), "step 1/60": (9, 5), "step 1/30": (9, -8),
    "step 1/20": (-88, -10), "step 1/60, substep_motion 0.3": (9, -11),
}  # fmt: skip
"""Points by which names are beside their points, of a setting of a family, a setting, or a family."""
NO_DEPTH = 0.1
"""mm; what is less deep is drawn there."""
COLOURS = {"step 1/60": "#2f6fb2", "step 1/30": "#3b8a5a", "step 1/20": "#7a5aa8", "PhysX": "#b23a48", "Rapier": "#d1662f"}


class Point(NamedTuple):
    """One setting: ms for 1/60 s, mean of those that move, and the median; greatest depths, mm, ever and at the end."""

    family: str
    setting: str
    mean: float
    median: float
    depth: float
    last_depth: float


def ours() -> list[Point]:
    """All settings here, on one core."""
    use_cores(1)
    ri.simulate(pile(64, False), 1.0)
    points = []
    for family, settings in SETTINGS.items():
        for accuracy in settings:
            falls = np.array([_fall(accuracy, k) for k in range(FALLS)])
            name = NAMED.get((accuracy.step, accuracy.substep_motion), f"substep_motion {accuracy.substep_motion:g}")
            points.append(Point(family, name, *np.median(falls[:, :2], axis=0).tolist(), *falls[:, 2:].max(axis=0).tolist()))
            print(points[-1], falls.round(2).tolist(), flush=True)
    return points


def _fall(accuracy: ri.Accuracy, k: int) -> tuple[float, float, float, float]:
    """Mean and median time, ms for 1/60 s, and depths, mm, ever and at the end, of fall k."""
    scene, ends = pile(NUMBER, False, k), []
    run = ri.simulate(scene, DURATION, FPS, accuracy=accuracy, progress=lambda time: ends.append((time, process_time())))
    at, spent = np.array(ends).T
    taken = 1e3 * np.diff(spent) / np.diff(at) / FPS
    deep = [1e3 * depths(scene, run, round(time * FPS)).max(initial=0.0) for time in LOOKS]
    return float(taken.mean()), float(np.median(taken)), max(deep), deep[-1]


def others() -> list[Point]:
    """Other engines."""
    scene, points = pile(NUMBER, False), []
    for step in PEER_STEPS:
        deep: dict[str, list[float]] = {}
        for time in LOOKS:
            answers = run_engines(scene, step, round(time / step), names=PEERS)
            for name, answer in answers.items():
                if not isinstance(answer, str):
                    frame = SimpleNamespace(positions=answer.position, orientations=answer.orientation)
                    deep.setdefault(name, []).append(float(depths(scene, frame, 0).max(initial=0.0)))
        for name, found in deep.items():
            taken = answers[name].times / (step * FPS)
            points.append(
                Point(name, f"step 1/{round(1.0 / step)}", float(taken.mean()), float(np.median(taken)), 1e3 * max(found), 1e3 * found[-1])
            )
            print(points[-1], flush=True)
    return points


def draw(points: list[Point]) -> None:
    """Depth against time, both logarithmic: down and left is better."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.4), dpi=110, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for family in dict.fromkeys(point.family for point in points):
        mine = [point for point in points if point.family == family]
        is_ours = family in SETTINGS
        label = f"rigidimpulse, {family}" if is_ours else family
        mean, depth = [point.mean for point in mine], [max(point.depth, NO_DEPTH) for point in mine]
        axes.plot(mean, depth, "o-" if is_ours else "s--", color=COLOURS[family], label=label, lw=1.8 if is_ours else 1.2, ms=6)
        for point, deep in zip(mine, depth, strict=True):
            names = (f"{family}, {point.setting}", point.setting, family)
            place = next((BESIDE[name] for name in names if name in BESIDE), (9, -3))
            axes.annotate(
                point.setting, (point.mean, deep), xytext=place, textcoords="offset points", fontsize=9, color=COLOURS[family]
            )
    axes.set(xscale="log", yscale="log", xlabel="ms for 1/60 s of motion, mean of those that move")
    axes.set_ylabel(f"deepest overlap at any time, mm ({NO_DEPTH:g}: or less)")
    axes.set_title("1,000 boxes fall into a pit: depth against time", loc="left", fontsize=12)
    axes.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
    axes.set(xlim=(1.2, 45.0), ylim=(0.8, 250.0))
    axes.xaxis.set_minor_formatter("")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.grid(color="#e4e6ea", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9)
    figure.savefig(PICTURE)


def main() -> None:
    """Measure and write, or read; draw."""
    parser = argparse.ArgumentParser(description="What accuracy costs in a pile.")
    parser.add_argument("--draw", action="store_true", help="only draw, from the lines written last time")
    if not parser.parse_args().draw:
        print(machine())
        with TABLE.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(Point._fields)
            writer.writerows([*point[:2], *(f"{value:.3f}" for value in point[2:])] for point in (*ours(), *others()))
    with TABLE.open(newline="") as file:
        draw([Point(row["family"], row["setting"], *(float(row[name]) for name in Point._fields[2:])) for row in csv.DictReader(file)])


if __name__ == "__main__":
    main()
