"""How fast impacts are: `python tests/bench/impacts.py [scene ...] [--save]`, or `... scaling [--save]`.

Benchmarks, not tests: run them on a machine that does nothing else. Scenes are `gas` (`gas:300` for 300 balls), `bounce`, `break` and
`spots`; without any, all of them with `gas:1000`. Each line has the state hash, so that times are compared only between runs that
computed the same. Warm: kernels are compiled, the least of several runs counts. `scaling` runs gases of 10 to 20,000 balls and prints
the exponent p of cost per impact = c n^p between the sizes. With --save the lines go to tests/bench/<machine>/impacts.csv or
impacts_scaling.csv.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import math
import sys
import tracemalloc
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from bench_scenes import machine

import rigidimpulse as ri
from rigidimpulse.gallery import asset_path

SMOOTH = ri.Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
FILLED = 0.05
"""Part of the box that the balls of a gas fill."""
SIZES = (10, 30, 100, 300, 1000, 3000, 10_000, 20_000)
SCALING_TIME, SCALING_COLLISIONS = 4.0, 6000.0
"""Least duration of a run of the scaling mode, s, and its least duration times the number of balls, s."""
REPEATS = 3


class Line(NamedTuple):
    """One measured run: what, least time [s], impacts, impacts a second, largest relative error of energy, state hash."""

    what: str
    seconds: float
    impacts: int
    rate: float
    energy_error: float
    state_hash: str


def add_walls(scene: ri.Scene, half: tuple[float, float, float], material: ri.Material) -> None:
    """Add six half spaces around the origin."""
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = -sign
            wall = ri.Shape.half_space(tuple(normal), -half[axis])
            scene.add(ri.Body(f"wall {axis} {sign:+.0f}", wall, motion="static", material=material))


def gas(count: int) -> ri.Scene:
    """Return balls of 0.5 m and 1 kg in a closed box, elastic and smooth, without gravity; speeds of a normal distribution of 1 m/s."""
    rng, radius = np.random.default_rng(0), 0.5
    side = (count * 4.0 / 3.0 * math.pi * radius**3 / FILLED) ** (1.0 / 3.0)
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    add_walls(scene, (0.5 * side,) * 3, SMOOTH)
    rows = math.ceil(count ** (1.0 / 3.0) - 1e-9)
    ticks = (np.arange(rows) + 0.5) * (side - 2.0 * radius) / rows - 0.5 * side + radius
    places = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    ball = ri.Shape.sphere(radius)
    for k, place in enumerate(places[rng.permutation(len(places))[:count]]):
        scene.add(ri.Body(f"ball {k}", ball, position=tuple(place), velocity=tuple(rng.normal(size=3)), mass=1.0, material=SMOOTH))
    return scene


def bounce(count: int = 49) -> ri.Scene:
    """Return elastic balls dropped from 5 m, far apart."""
    scene = ri.Scene(gravity=(0.0, 0.0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=SMOOTH))
    for k in range(count):
        scene.add(ri.Body(f"ball {k}", ri.Shape.sphere(0.1), position=(3.0 * (k % 7), 3.0 * (k // 7), 5.0), mass=10.0, material=SMOOTH))
    return scene


def pool_break() -> ri.Scene:
    """Return a cue ball and a rack of fifteen between four cushions, elastic and smooth."""
    radius, pitch = 0.5 * 57.15e-3, 57.25e-3
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    add_walls(scene, (1.27, 0.635, 0.1), SMOOTH)
    ball = ri.Shape.sphere(radius)
    scene.add(ri.Body("cue ball", ball, position=(-0.635, 0.004, 0.0), velocity=(8.0, 0.0, 0.0), mass=0.17, material=SMOOTH))
    for row in range(5):
        for k in range(row + 1):
            place = (0.635 + row * pitch * math.sqrt(0.75), pitch * (k - 0.5 * row), 0.0)
            scene.add(ri.Body(f"ball {row} {k}", ball, position=place, mass=0.17, material=SMOOTH))
    return scene


def spots() -> ri.Scene:
    """Return two cows in a narrow box without gravity, elastic: they hit each other and the walls again and again."""
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    add_walls(scene, (1.0, 0.7, 0.7), SMOOTH)
    cow = ri.Shape.from_file(asset_path("spot.obj"), scale=0.5)
    for k, speed in enumerate((6.0, -6.0)):
        scene.add(
            ri.Body(
                f"cow {k}", cow, position=(0.5 * (2 * k - 1), 0.05 * k, 0.0), velocity=(speed, 2.0 * k, 1.0),
                angular_velocity=(0.5, 1.0 - k, 0.3), mass=10.0, material=SMOOTH,
            )
        )  # fmt: skip
    return scene


def measure(what: str, make, duration: float, fps: float = 60.0, loop_only: bool = False, repeats: int = REPEATS) -> Line:
    """Run a scene several times; all of `simulate` counts, compilation of the scene included, or the stages of the loop only."""
    least, runs = math.inf, []
    for _ in range(repeats):
        scene = make()
        start = perf_counter()
        runs.append(ri.simulate(scene, duration, fps))
        least = min(least, sum(line.seconds for line in runs[-1].plan.lines) if loop_only else perf_counter() - start)
    if len({run.state_hash() for run in runs}) > 1:
        raise SystemExit(f"{what}: runs differ")
    run = runs[0]
    error = float(np.abs(run.ledger.total / run.ledger.total[0] - 1.0).max())
    line = Line(what, least, len(run.impacts), len(run.impacts) / least, error, run.state_hash()[:16])
    print(
        f"{line.what:22} {line.seconds:8.3f} s  {line.impacts:7d} impacts  {line.rate:9.0f} /s  energy {line.energy_error:.1e}  "
        f"{line.state_hash}  {run.status.message[:60]}",
        flush=True,
    )
    return line


def scene_line(name: str) -> Line:
    """Measure a scene by its name on the command line."""
    kind, _, count = name.partition(":")
    if kind == "gas":
        return measure(f"gas of {int(count or 1000)}, 10 s", lambda: gas(int(count or 1000)), 10.0)
    if kind == "bounce":
        return measure("49 balls, 20 s", bounce, 20.0)
    if kind == "break":
        return measure("break of 15, 20 s", pool_break, 20.0)
    if kind == "spots":
        return measure("spot on spot, 10 s", spots, 10.0)
    raise SystemExit(f"{name}: give gas:COUNT, bounce, break, spots or scaling")


def memory_of(count: int) -> float:
    """Return the bytes a body that the run of a gas allocates at its peak, frames left out; the scene itself is not counted."""
    scene = gas(count)
    tracemalloc.start()
    ri.simulate(scene, 0.1, 1.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / count


def scaling() -> list[Line]:
    """Measure gases of all sizes and print exponents of the cost per impact; only the stages of the loop count."""
    lines: list[Line] = []
    for count in SIZES:
        duration = max(SCALING_TIME, SCALING_COLLISIONS / count)
        lines.append(measure(f"gas of {count}", lambda n=count: gas(n), duration, 1e-3, loop_only=True))
        print(f"  {1e6 * lines[-1].seconds / lines[-1].impacts:.1f} us an impact", flush=True)
    for first, second in itertools.pairwise(lines):
        exponent = math.log(first.rate / second.rate) / math.log(size_of(second) / size_of(first))
        print(f"{first.what} to {second.what}: exponent {exponent:+.3f}")
    low, high = (next(line for line in lines if size_of(line) == size) for size in (100, 10_000))
    print(f"100 to 10,000: exponent {math.log(low.rate / high.rate) / math.log(100.0):+.3f}")
    print(f"memory of a run: {memory_of(5000):.0f} bytes a body")
    return lines


def size_of(line: Line) -> int:
    """Return the number of balls of a line."""
    return int(line.what.split()[2])


def main() -> int:
    """Measure, print, save if asked to."""
    parser = argparse.ArgumentParser(description="How fast impacts are.")
    parser.add_argument("scenes", nargs="*", help="gas:COUNT, bounce, break, spots, or scaling alone")
    parser.add_argument("--save", action="store_true", help="write tests/bench/<machine>/impacts.csv or impacts_scaling.csv")
    arguments = parser.parse_args()
    print(machine())
    ri.simulate(gas(20), 1.0)
    is_scaling = arguments.scenes == ["scaling"]
    lines = scaling() if is_scaling else [scene_line(name) for name in arguments.scenes or ("gas:1000", "bounce", "break", "spots")]
    if arguments.save:
        folder = Path(__file__).parent / machine()
        folder.mkdir(exist_ok=True)
        target = folder / ("impacts_scaling.csv" if is_scaling else "impacts.csv")
        with target.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(Line._fields)
            for line in lines:
                numbers = [f"{line.seconds:.4f}", line.impacts, f"{line.rate:.0f}", f"{line.energy_error:.1e}"]
                writer.writerow([line.what, *numbers, line.state_hash])
        print(f"wrote {target}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
