"""Print a table of the newcomer corpus: scene, ok, processor time for a second of motion, deepest overlap, and what is missed.

Run it from the root of the repository: `python tests/newcomer/report.py [NAME ...]`. A scene that takes more than LONG is given up.
"""

from __future__ import annotations

import sys
import traceback

from scenes import CORPUS
from stage import look

LONG = 60.0
"""s of processor time for a scene."""


if __name__ == "__main__":
    print(f"{'scene':<22}{'ok':<5}{'s per s':>9}{'depth':>10}  missed")
    for name in sys.argv[1:] or CORPUS:
        try:
            seen = look(CORPUS[name], LONG)
        except Exception:
            print(f"{name:<22}{'no':<5}  {traceback.format_exc().splitlines()[-1]}", flush=True)
            continue
        print(
            f"{name:<22}{'no' if seen.missed else 'yes':<5}{seen.cost:9.2f}{seen.depth:10.1e}  {'; '.join(seen.missed)[:300]}", flush=True
        )
