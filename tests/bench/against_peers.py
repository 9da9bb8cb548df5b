"""The benchmark scenes here and in other engines, in one sitting: `python tests/bench/against_peers.py [SCENE ...] [--rounds N] [--save]`.

Scenes are those of `piles` (boxes_1000, boxes_5000, hulls_1000) and of `impacts` (gas, bounce); engines are those of `engines`. Everything
runs in turn, round after round, so that other work on the machine hits all alike; what counts is the median over the rounds of the ratio to
the fastest engine of the same round. Piles, here at several settings: mean and median time for 1/60 s of motion, others at that step,
and how deep bodies are inside each other at any time (frames at 1/3 s, other engines only at the end) and at the end. Gas: all of 10 s,
steps of 1/240 s, and the error of the energy; bounce: all of 20 s at 1/60 s, the same. Times are those of the loop, as they are those of
the steps in other engines: scenes are compiled before, frames handed out after. All have one core; with --cores N the kernels here have N,
and times here are those of a clock instead of a processor. Each round has another fall of the same pile; depths are the greatest of
all rounds. With --save the lines go to tests/bench/<machine>/against_peers.csv.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from bench_scenes import machine
from engines import ENGINES, EngineRun, run_engines, use_cores
from impacts import bounce, gas
from piles import FPS, PILES, STEPS, depths, pile

import rigidimpulse as ri
from rigidimpulse.model.effect import STAGES

OURS = "rigidimpulse"
SETTINGS = {
    OURS: "standard",
    "preview": "preview",
    "step=1/30, substep_motion=1": ri.Accuracy(step=1.0 / 30.0, substep_motion=1.0),
    "step=1/20, substep_motion=1": ri.Accuracy(step=1.0 / 20.0, substep_motion=1.0),
    "substep_motion=1": ri.Accuracy(substep_motion=1.0),
}
FLIGHTS = {"gas": (gas, 1000, 10.0, 1.0 / 240.0), "bounce": (bounce, 49, 20.0, 1.0 / 60.0)}
"""Maker, number of balls, duration [s] and step of the other engines [s]."""


class Result(NamedTuple):
    """Mean and median time, ms for 1/60 s or s in all; depths of piles, ever and at the end, mm; and what else is to be known."""

    mean: float
    median: float
    deepest: float = np.nan
    last: float = np.nan
    note: str = ""


def pile_round(name: str, fall: int, engines: tuple[str, ...], clock: Callable[[], float]) -> dict[str, Result]:
    """Run a fall of a pile at all settings and in all engines."""
    number, hulls = PILES[name]
    scene, out = pile(number, hulls, fall), {}
    for what, accuracy in SETTINGS.items():
        ends: list[tuple[float, float]] = []
        run = ri.simulate(scene, STEPS / FPS, FPS, accuracy=accuracy, progress=lambda time, ends=ends: ends.append((time, clock())))
        at, spent = np.array(ends).T
        taken = 1e3 * np.diff(spent) / np.diff(at) / FPS
        ever = 1e3 * max(depths(scene, run, f).max(initial=0.0) for f in range(20, STEPS, 20))
        out[what] = Result(float(taken.mean()), float(np.median(taken)), ever, _depth(scene, run))
    for engine, answer in run_engines(scene, 1.0 / FPS, STEPS, names=engines).items():
        out[engine] = _pile_line(scene, answer)
    return out


def _pile_line(scene: ri.Scene, answer: EngineRun | str) -> Result:
    if isinstance(answer, str):
        return Result(np.nan, np.nan, note=answer)
    frame = SimpleNamespace(positions=answer.position, orientations=answer.orientation)
    return Result(float(answer.times.mean()), float(np.median(answer.times)), last=_depth(scene, frame))


def _depth(scene: ri.Scene, run) -> float:
    return 1e3 * float(depths(scene, run, -1).max(initial=0.0))


def flight_round(name: str, engines: tuple[str, ...]) -> dict[str, Result]:
    """Run a gas or bouncing balls in all engines: s in all, and the error of the energy."""
    make, number, duration, step = FLIGHTS[name]
    scene = make(number)
    run = ri.simulate(scene, duration)
    profile = run.profile
    assert profile is not None
    loop = sum(profile.stages[stage] for stage in STAGES if stage in profile.stages)
    note = f"{_energy_error(scene, run.velocities[-1], run.positions[-1])}; {profile.seconds:.3f} s with the scene compiled and recorded"
    out = {OURS: Result(loop, loop, note=note)}
    for engine, answer in run_engines(scene, step, round(duration / step), names=engines).items():
        if isinstance(answer, str):
            out[engine] = Result(np.nan, np.nan, note=answer)
        else:
            total = 1e-3 * float(answer.times.sum())
            out[engine] = Result(total, total, note=_energy_error(scene, answer.velocity, answer.position[-1]))
    return out


def _energy_error(scene: ri.Scene, velocity: np.ndarray, position: np.ndarray) -> str:
    """Relative error of the energy of balls; spin has no part in it where they are smooth."""
    moves = np.array([body.motion == "dynamic" for body in scene.bodies])
    masses = np.array([body.mass or 0.0 for body in scene.bodies])[moves]

    def energy(v: np.ndarray, x: np.ndarray) -> float:
        return float((masses * (0.5 * (v[moves] ** 2).sum(1) - x[moves] @ np.asarray(scene.gravity, float))).sum())

    start = energy(np.array([body.velocity for body in scene.bodies], float), np.array([body.position for body in scene.bodies], float))
    return f"energy off by {abs(energy(velocity, position) / start - 1.0):.1e}"


def show(name: str, rounds: list[dict[str, Result]], settings: list[str]) -> list[tuple]:
    """Print the lines of a scene, and return them: medians over the rounds, and of the ratios to the fastest engine of each."""
    fastest = [
        tuple(min(one[engine][k] for engine in one if engine not in settings and np.isfinite(one[engine][k])) for k in range(2))
        for one in rounds
    ]
    lines = []
    for what in rounds[0]:
        mean, middle = (median([one[what][k] for one in rounds]) for k in range(2))
        ratios = [median([one[what][k] / best[k] for one, best in zip(rounds, fastest, strict=True)]) for k in range(2)]
        deepest, last = (max(one[what][k] for one in rounds) for k in (2, 3))
        lines.append((name, what, mean, middle, *ratios, deepest, last, rounds[-1][what].note))
        times = f"mean {mean:8.3f} median {middle:8.3f} {'ms for 1/60 s' if name in PILES else 's'}"
        deep = f"deepest {deepest:.1f} mm, " if np.isfinite(deepest) else ""
        deep += f"at the end {last:.1f} mm" if np.isfinite(last) else ""
        print(f"{name:11} {what:25} {times}  of the fastest engine {ratios[0]:.2f} {ratios[1]:.2f}  {deep}{lines[-1][-1]}", flush=True)
    return lines


def main() -> None:
    """Run, print, save if asked to."""
    parser = argparse.ArgumentParser(description="The benchmark scenes here and in other engines.")
    parser.add_argument("scenes", nargs="*", help=f"of {', '.join([*PILES, *FLIGHTS])}; all but boxes_5000 if none is given")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--engines", default=",".join(ENGINES), help="others to run")
    parser.add_argument("--cores", type=int, default=1, help="that kernels here may use")
    parser.add_argument("--save", action="store_true", help="write tests/bench/<machine>/against_peers.csv")
    options = parser.parse_args()
    print(machine(), "| cores here:", options.cores)
    use_cores(options.cores)
    engines, clock = tuple(options.engines.split(",")), process_time if options.cores == 1 else perf_counter
    ri.simulate(gas(20), 1.0)
    ri.simulate(pile(200, False), 1.0)
    ri.simulate(pile(200, True), 1.0)
    lines = []
    for name in options.scenes or [name for name in [*PILES, *FLIGHTS] if name != "boxes_5000"]:
        rounds = [
            pile_round(name, fall, engines, clock) if name in PILES else flight_round(name, engines) for fall in range(options.rounds)
        ]
        lines.extend(show(name, rounds, list(SETTINGS)))
    if options.save:
        folder = Path(__file__).parent / machine()
        folder.mkdir(exist_ok=True)
        with (folder / "against_peers.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            columns = "scene", "engine", "mean", "median", "mean of the fastest", "median of the fastest", "deepest", "at the end", "note"
            writer.writerow(columns)
            writer.writerows(lines)


if __name__ == "__main__":
    main()
