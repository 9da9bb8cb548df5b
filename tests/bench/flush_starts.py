"""A thousand starts flush on each other: none may fall through anything, rise, or cause a warning (see `regressions/flush_scenes.py`).

    python tests/bench/flush_starts.py              one line for each start that breaks the law, and a table
    python tests/bench/flush_starts.py 0 50         those of the seeds 0 to 49
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "regressions"))

from flush_scenes import RISE, Start, check

SEEDS = 1000


def main() -> int:
    """Run the starts; the exit code is 1 where one breaks the law."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", nargs="?", type=int, default=0)
    parser.add_argument("end", nargs="?", type=int, default=SEEDS)
    options = parser.parse_args()
    begun, broken, tried, worst = process_time(), Counter(), Counter(), 0.0
    for seed in range(options.first, options.end):
        try:
            start, moved, message = check(seed)
        except Exception as error:
            start, moved, message = Start(seed), np.inf, repr(error)
        tried[start.arrangement] += 1
        worst = max(worst, moved)
        if moved > RISE or message:
            broken[start.arrangement] += 1
            print(f"{start.label}: moves by {moved:.2e}; {message[:160]}", flush=True)
    for arrangement, count in tried.items():
        print(f"{arrangement:12} {count:5} starts, {broken[arrangement]:4} break the law")
    print(f"greatest motion {worst:.2e} of the size, {process_time() - begun:.0f} s of processor time")
    return bool(broken)


if __name__ == "__main__":
    sys.exit(main())
