"""Memory that runs take: `python tests/bench/memory.py [COUNT]`, of a gas of COUNT balls and a pile of COUNT boxes.

Resident memory of a process at its peak, beyond that of a run of FEW bodies of the same kind and of the big scene before it runs: compiled
scene, state, contacts and one frame a second. Arrays that are there but never touched take none. Each scene has a process of its own.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import sys
from concurrent.futures import ProcessPoolExecutor

from bench_scenes import machine

import rigidimpulse as ri
from rigidimpulse.gallery.pile import pile
from rigidimpulse.studies.scaling import LAYERS, gas

FEW = 300
DURATION = {"gas": 0.5, "pile": 2.0}
"""s; boxes lie on each other by then."""


def peak() -> int:
    """Return the most resident memory that this process has had, bytes."""
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def memory_of(kind: str, count: int) -> float:
    """Return the bytes a body that the run of a scene of a kind takes."""

    def make(number: int) -> ri.Scene:
        return gas(number) if kind == "gas" else pile(number, LAYERS)

    ri.simulate(make(FEW), DURATION[kind], 1.0)
    scene = make(count)
    before = peak()
    ri.simulate(scene, DURATION[kind], 1.0)
    return (peak() - before) / count


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Memory that runs take.")
    parser.add_argument("count", nargs="?", type=int, default=10_000)
    count = parser.parse_args().count
    print(machine())
    for kind in DURATION:
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as own:
            print(f"{kind} of {count} bodies: {own.submit(memory_of, kind, count).result():.0f} bytes a body")


if __name__ == "__main__":
    main()
