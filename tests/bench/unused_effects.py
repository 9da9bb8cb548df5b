"""What effects cost a scene that does not use them: paired runs, in one sitting.

    python tests/bench/unused_effects.py [pairs]

For each effect of `tests/test_unused_effects.py` the plain scene is run in turn in a process that knows nothing of the effect and in one
that has run a scene with it; the median of the ratios of their times should be 1 within the noise, which the ratio of two plain runs shows.
"""

from __future__ import annotations

import json
import platform
import statistics
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from test_unused_effects import EFFECTS, PLAIN, RUN

TIME = '''
import json, time
spent = []
for _ in range(7):
    start = time.perf_counter()
    run = ri.simulate(scene, 2.0)
    spent.append(time.perf_counter() - start)
print(json.dumps({"seconds": min(spent[1:]), "hash": run.state_hash()[:12]}))
'''


def seconds(*parts: str) -> tuple[float, str]:
    """Least time of six warm runs in a fresh process [s], and the hash of the last."""
    program = "import rigidimpulse as ri\nsettings = {}\n" + "\n".join([*parts, TIME])
    out = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2])
    report = json.loads(out.stdout.splitlines()[-1])
    return report["seconds"], report["hash"]


def main(pairs: int) -> None:
    """Print a line an effect."""
    print(f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}; medians of {pairs} pairs")
    rows = {"nothing": ("ground", "", [])} | EFFECTS
    for name, (kind, call, _) in rows.items():
        ratios, hashes = [], set()
        for _ in range(pairs):
            plain, first = seconds(PLAIN[kind])
            after, second = seconds(PLAIN[kind], call, RUN, PLAIN[kind])
            ratios.append(after / plain)
            hashes |= {first, second}
        print(f"{name:18} {statistics.median(ratios):6.3f}   {' '.join(sorted(hashes))}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
