"""First impacts of random pairs of meshes with own manifolds and with FCL's: `python tests/bench/narrow_phases.py [--fresh N] [--write]`.

200 pairs of hulls that meet, and 60 of meshes with hollows (`tests/both_sides/mesh_pairs.py`). The exit code is 1 if the impulses
of a pair of hulls differ by more than BOUND, or a pair meets in one of the runs only.

    --fresh N    pairs of other seeds, from N on
    --write      keep the table as docs/results/data/narrow_phases.csv
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "both_sides"))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "results"))

from mesh_pairs import DURATION, concave_pair, convex_pair
from provenance import DATA, note

from rigidimpulse.studies.narrow_phases import compare_narrow_phases

BOUND = 1e-6
"""Of the impulse, relative."""
PAIRS = {"convex": (convex_pair, 200), "concave": (concave_pair, 60)}
COLUMNS = ("kind", "seed", "time", "later", "place", "turn", "impulse", "own", "fcl", "common", "raw", "ghosts")


def main() -> int:
    """Run the pairs and print a line for each that breaks the law."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fresh", type=int, default=0)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    rows, broken = [], 0
    for kind, (make, number) in PAIRS.items():
        seed, meet = options.fresh, 0
        while meet < number:
            found = compare_narrow_phases(make(seed), DURATION, 10.0)
            meet += bool(found.first_impacts)
            broken += bool(found.only_own or found.only_fcl)
            for impact in found.first_impacts:
                values = {"kind": kind, "seed": seed, **asdict(impact)}
                rows.append([values[name] for name in COLUMNS])
                if kind == "convex" and not impact.impulse <= BOUND:
                    broken += 1
                    print(f"seed {seed}: impulses differ by {impact.impulse:.2e}", flush=True)
            seed += 1
        chosen = [row for row in rows if row[0] == kind]
        worst = max(row[COLUMNS.index("impulse")] for row in chosen)
        print(f"{kind}: {meet} of {seed - options.fresh} pairs meet, impulses differ by {worst:.2e} at most", flush=True)
    if options.write:
        path = DATA / "narrow_phases.csv"
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])
        note(path, "python tests/bench/narrow_phases.py --write")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
