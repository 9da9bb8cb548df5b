"""Times of the main scenes against their bounds: `python tests/bench/bench_scenes.py [--save]`.

Benchmarks, not tests: run them on a machine that does nothing else. Each line has the state hash, so that times are
compared only between runs that computed the same. Warm: kernels compiled, first run discarded, median of the rest.
Cold: the first run ever, in a new process with an empty cache of kernels. With --save the lines go to
tests/bench/<machine>/scenes.csv.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import rigidimpulse as ri
from rigidimpulse import gallery

REPEATS = 5
WARM_BOUNDS = {"spot": 4.0, "pool_break": 0.5}
"""s for a warm run of the scene's own duration on two cores."""
COLD_BOUND = 30.0
HELP_BOUND = 0.3
PACKAGE_FOLDER = Path(ri.__file__).resolve().parent.parent


class Line(NamedTuple):
    """One measured time: what, state hash (or none), median and least time, bound [s], and how many runs."""

    what: str
    state_hash: str
    median: float
    least: float
    bound: float
    runs: int


def warm(name: str) -> Line:
    """Time warm runs of a gallery scene, compilation of the scene included."""
    entry = gallery.load(name)
    times, hashes = [], set()
    for _ in range(REPEATS + 1):
        scene = entry.scene()
        start = perf_counter()
        run = ri.simulate(scene, entry.duration, entry.fps, accuracy=entry.accuracy)
        times.append(perf_counter() - start)
        hashes.add(run.state_hash())
    if len(hashes) > 1:
        raise SystemExit(f"{name}: runs differ: {sorted(hashes)}")
    what = f"{name}, {entry.duration:g} s, warm"
    return Line(what, hashes.pop()[:16], statistics.median(times[1:]), min(times[1:]), WARM_BOUNDS[name], REPEATS)


def cold(name: str) -> Line:
    """Time the first run ever: a new process, an empty cache of kernels."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
        seconds = _time_of([sys.executable, "-m", "rigidimpulse", "demo", name], environment)
    return Line(f"{name}, first run ever", "", seconds, seconds, COLD_BOUND, 1)


def help_text() -> Line:
    """Time `rigidimpulse --help`."""
    command = [sys.executable, "-m", "rigidimpulse", "--help"]
    times = [_time_of(command, dict(os.environ)) for _ in range(REPEATS + 1)][1:]
    return Line("rigidimpulse --help", "", statistics.median(times), min(times), HELP_BOUND, REPEATS)


def machine() -> str:
    """Return processor, number of cores and Python, fit for the name of a folder."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        found = re.search(r"model name\s*:\s*(.+)", cpuinfo.read_text())
        model = found.group(1) if found else model
    name = f"{model} {len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count()} cores"
    return re.sub(r"[^A-Za-z0-9.]+", "-", f"{name} Python {platform.python_version()}").strip("-")


def _time_of(command: list[str], environment: dict[str, str]) -> float:
    """Return the wall time of a command that must succeed, s."""
    path = os.pathsep.join(filter(None, [str(PACKAGE_FOLDER), environment.get("PYTHONPATH", "")]))
    start = perf_counter()
    subprocess.run(command, env={**environment, "PYTHONPATH": path}, check=True, stdout=subprocess.DEVNULL)
    return perf_counter() - start


def main() -> int:
    """Measure, print, save if asked to; return 1 if a bound is broken."""
    parser = argparse.ArgumentParser(description="Times of the main scenes against their bounds.")
    parser.add_argument("--save", action="store_true", help="write tests/bench/<machine>/scenes.csv")
    save = parser.parse_args().save
    print(machine())
    lines = []
    for measure in (help_text, lambda: cold("spot"), lambda: warm("spot"), lambda: warm("pool_break")):
        line = measure()
        lines.append(line)
        verdict = "ok" if line.median <= line.bound else "TOO SLOW"
        print(
            f"{line.what:28} median {line.median:7.3f} s  least {line.least:7.3f} s  bound {line.bound:5.1f} s  "
            f"{verdict}  {line.state_hash}",
            flush=True,
        )
    if save:
        folder = Path(__file__).parent / machine()
        folder.mkdir(exist_ok=True)
        with (folder / "scenes.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(Line._fields)
            writer.writerows([*line[:2], *(f"{value:.4f}" for value in line[2:5]), line.runs] for line in lines)
        print(f"wrote {folder / 'scenes.csv'}")
    return int(any(line.median > line.bound for line in lines))


if __name__ == "__main__":
    sys.exit(main())
