"""Throws of a die of 16 mm, each to rest: what one costs, and how many there are in a minute.

`python tests/bench/throws.py [--throws N] [--processes N] [--profile]`

Each throw has another pose, velocity and spin. Prints seconds for all, milliseconds of a throw, the sides that came up, and the largest
speed at the end; with --profile where the time of one throw went. The first throw, in which kernels are loaded, is not counted.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from time import perf_counter
from typing import Any

import numpy as np
from bench_scenes import machine
from middle import SCENES

import rigidimpulse as ri
from rigidimpulse.core.quaternion import to_matrix


def throws(number: int) -> Iterator[dict[str, Any]]:
    """Starts of throws, alike in every run."""
    random = np.random.default_rng(5)
    for _ in range(number):
        yield {
            "die.position": (0.0, 0.0, random.uniform(0.05, 0.15)),
            "die.orientation": random.normal(size=4),
            "die.velocity": (random.uniform(0.2, 1.0), random.normal(0.0, 0.1), 0.0),
            "die.angular_velocity": random.normal(0.0, 20.0, 3),
        }


def side_up(orientation: np.ndarray) -> int:
    """Which side of a die is up: +-1, +-2, +-3 for its axes."""
    vertical = to_matrix(orientation)[2]
    axis = int(np.argmax(np.abs(vertical)))
    return (axis + 1) * (1 if vertical[axis] > 0.0 else -1)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--throws", type=int, default=200)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--profile", action="store_true")
    options = parser.parse_args()
    make, duration = SCENES["die"]
    runs = ri.simulate_many(make(), throws(options.throws + 1), duration, processes=options.processes)
    next(runs)
    start = perf_counter()
    ended = [run.kept for run in runs]
    seconds = perf_counter() - start
    sides = Counter(side_up(state.orientations[1]) for state in ended)
    fastest = max(float(np.linalg.norm(state.velocities[1])) for state in ended)
    print(machine())
    print(f"{len(ended)} throws in {seconds:.2f} s, {1e3 * seconds / len(ended):.1f} ms each, {60.0 * len(ended) / seconds:,.0f} a minute")
    print(f"sides {dict(sorted(sides.items()))}, largest speed at the end {fastest:.1e} m/s")
    if options.profile:
        run = ri.simulate(make(), duration)
        assert run.profile is not None
        print(run.profile.table())


if __name__ == "__main__":
    main()
