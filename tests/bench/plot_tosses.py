"""Draw docs/results/tosses.png from tests/bench/tosses/each.csv: `python tests/bench/plot_tosses.py`. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

FOLDER = Path(__file__).parent
PICTURE = FOLDER.parent.parent / "docs" / "results" / "tosses.png"


def main() -> None:
    """Plot rotation error against position error of every toss, those fitted to and those judged."""
    errors = np.genfromtxt(FOLDER / "tosses" / "each.csv", delimiter=",", names=True)
    figure, axes = plt.subplots(figsize=(6.4, 4.0), dpi=110)
    for name, color, part in (("fitted to (even)", "#8a8f98", errors[::2]), ("judged (odd)", "#2f7fb8", errors[1::2])):
        axes.scatter(part["position"], part["rotation"], s=16, color=color, alpha=0.85, linewidths=0.0, label=name)
        axes.scatter(part["position"].mean(), part["rotation"].mean(), s=110, marker="+", color=color, linewidths=2.0)
    axes.set(xscale="log", yscale="log", xlabel="mean position error, % of the cube's width", ylabel="mean rotation error, degrees")
    axes.set_xticks([2, 5, 10, 20, 50], ["2", "5", "10", "20", "50"])
    axes.set_yticks([1, 2, 5, 10, 20, 50, 100], ["1", "2", "5", "10", "20", "50", "100"])
    axes.minorticks_off()
    axes.grid(color="#e4e6ea", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="lower right", title="+ mean of the half")
    figure.tight_layout()
    figure.savefig(PICTURE)


if __name__ == "__main__":
    main()
