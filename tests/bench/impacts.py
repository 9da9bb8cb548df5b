"""How fast impacts are: `python tests/bench/impacts.py [scene ...] [--save]`.

Benchmarks, not tests: run them on a machine that does nothing else. Scenes are `gas` (`gas:300` for 300 balls), `bounce`, `break` and
`spots`; without any, all of them with `gas:1000`. Each line has the state hash, so that times are compared only between runs that
computed the same. Warm: kernels are compiled, the least of several runs counts. How cost grows with the number of balls is measured by
`rigidimpulse study --scaling`. With --save the lines go to tests/bench/<machine>/impacts.csv.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from bench_scenes import machine

import rigidimpulse as ri
from rigidimpulse.gallery import asset_path
from rigidimpulse.studies.scaling import gas

SMOOTH = ri.Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
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
    raise SystemExit(f"{name}: give gas:COUNT, bounce, break or spots")


def main() -> int:
    """Measure, print, save if asked to."""
    parser = argparse.ArgumentParser(description="How fast impacts are.")
    parser.add_argument("scenes", nargs="*", help="gas:COUNT, bounce, break, spots")
    parser.add_argument("--save", action="store_true", help="write tests/bench/<machine>/impacts.csv")
    arguments = parser.parse_args()
    print(machine())
    ri.simulate(gas(20), 1.0)
    lines = [scene_line(name) for name in arguments.scenes or ("gas:1000", "bounce", "break", "spots")]
    if arguments.save:
        folder = Path(__file__).parent / machine()
        folder.mkdir(exist_ok=True)
        target = folder / "impacts.csv"
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
