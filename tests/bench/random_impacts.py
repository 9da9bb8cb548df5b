"""Random impacts by the million: `python tests/bench/random_impacts.py [NUMBER]`, a million if no number is given.

The hard case `random_impacts` with more clouds: the same bodies, the same checks. A million take about an hour on one core.
The exit code is 1 if a check fails.
"""

from __future__ import annotations

import sys
from time import perf_counter

from rigidimpulse.engine.simulate import simulate
from rigidimpulse.gallery.hard.crowds import CLOUD_FPS, CLOUD_TIME, check_random, cloud


def main() -> int:
    """Run the clouds and print the checks."""
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    start = perf_counter()
    checks = check_random(number, simulate(cloud(0), CLOUD_TIME, CLOUD_FPS))
    for check in checks:
        print("passed" if check.passed else "FAILED", check.what, check.value, check.bound)
    print(f"{perf_counter() - start:.0f} s")
    return 0 if all(check.passed for check in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
