"""Draw docs/results/middle.png from docs/results/data/middle.csv: `python tests/bench/plot_middle.py`. Needs matplotlib."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.lines import Line2D

RESULTS = Path(__file__).resolve().parents[2] / "docs" / "results"
COLOURS = {
    "standard": "#2f7fb8", "preview": "#7fb8dd", "MuJoCo": "#c2571a", "Bullet": "#8a6d3b", "PhysX": "#5b8c3a", "Rapier": "#8e5aa8",
}  # fmt: skip
NONE, ALL = 1e-6, 1.0
"""Errors below which there is none to be seen, and above which one body is wholly inside the other, or past it."""
PARTS = "_parts"
"""Ending of scenes whose meshes are in convex parts; they share a chart with the scene of meshes."""
ACROSS = 4


def error(row: dict[str, str]) -> float:
    """What is wrong with a run: depth of bodies, of their size; where nothing touches, the gap of joints, m."""
    return min(max(float(row["depth"]), float(row["gap"]), NONE), ALL)


def main() -> None:
    """A small chart for each scene: error against cost, both logarithmic; down and left is better."""
    with (RESULTS / "data" / "middle.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if not math.isnan(float(row["seconds"]))]
    scenes = list(dict.fromkeys(row["scene"].removesuffix(PARTS) for row in rows))
    figure, grid = plt.subplots(
        -(-len(scenes) // ACROSS), ACROSS, figsize=(12.0, 2.5 * -(-len(scenes) // ACROSS)), dpi=100, sharey=True, layout="constrained"
    )
    for axes, scene in zip(grid.flat, scenes, strict=False):
        for row in (row for row in rows if row["scene"].removesuffix(PARTS) == scene):
            color, ours, hollow = COLOURS[row["what"]], row["what"] in ("standard", "preview"), row["scene"].endswith(PARTS)
            axes.scatter(
                float(row["seconds"]), error(row), s=60 if ours else 42, marker="o" if ours else "s", edgecolors=color, linewidths=1.8,
                facecolors="white" if ours and hollow else color, zorder=3,
            )  # fmt: skip
        axes.set(xscale="log", yscale="log", xlim=(5e-4, 60.0), ylim=(0.5 * NONE, 2.0 * ALL))
        axes.axvline(1.0, color="#9aa1ac", linewidth=1.2, zorder=1)
        axes.set_title(scene, loc="left", fontsize=10)
        axes.set_xticks([1e-3, 1e-2, 1e-1, 1.0, 10.0], ["1 ms", "10 ms", "0.1 s", "1 s", "10 s"], fontsize=8)
        axes.set_yticks([1e-6, 1e-4, 1e-2, 1.0], ["1e-6 or less", "1e-4", "1e-2", "1"], fontsize=8)
        axes.minorticks_off()
        axes.grid(color="#eceef1", linewidth=0.7, zorder=0)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in grid.flat[len(scenes) :]:
        axes.set_axis_off()
    markers = dict.fromkeys(COLOURS, "s") | {"standard": "o", "preview": "o"}
    handles = [Line2D([], [], ls="", marker=markers[name], ms=7, color=color, label=name) for name, color in COLOURS.items()]
    handles.append(Line2D([], [], ls="", marker="o", ms=7, mfc="white", mec="#2f7fb8", label="in convex parts, as in the engines"))
    figure.legend(handles=handles, ncols=len(handles), frameon=False, loc="outside upper center", fontsize=10)
    figure.supxlabel("processor time for a second of motion (the line: as fast as it plays)", fontsize=10)
    figure.supylabel("deepest overlap, of the size of the smaller body, or gap of joints, m", fontsize=10)
    figure.savefig(RESULTS / "middle.png")


if __name__ == "__main__":
    main()
