"""The benchmark scenes here and in other engines, in one sitting: `python tests/bench/against_peers.py [SCENE ...] [--rounds N] [--save]`.

Scenes are those of `piles` (boxes_1000, boxes_5000, hulls_1000) and of `impacts` (gas, bounce); engines are those of `engines`. Everything
runs in turn, round after round, so that other work on the machine hits all alike; what counts is the median over the rounds of the ratio to
the fastest engine of the same round. Piles: median time of a step, at 1/60 s, and how deep bodies are inside each other at the end. Gas:
all of 10 s, steps of 1/240 s, and the error of the energy; bounce: all of 20 s at 1/60 s, the same. Times are those of the loop, as they
are those of the steps in other engines: scenes are compiled before, frames handed out after. With --save the lines go to
tests/bench/<machine>/against_peers.csv.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from statistics import median
from time import process_time
from types import SimpleNamespace

import numpy as np
from bench_scenes import machine
from engines import EngineRun, run_engines
from impacts import bounce, gas
from piles import PILES, STEPS, depths, pile

import rigidimpulse as ri
from rigidimpulse.plan import STAGES

OURS = "rigidimpulse"
FLIGHTS = {"gas": (gas, 1000, 10.0, 1.0 / 240.0), "bounce": (bounce, 49, 20.0, 1.0 / 60.0)}
"""Maker, number of balls, duration [s] and step of the other engines [s]."""


def pile_round(name: str) -> dict[str, tuple[float, str]]:
    """Run a pile in all engines: ms a step, and what else is to be known."""
    number, hulls = PILES[name]
    scene, ends = pile(number, hulls), [0.0]
    run = ri.simulate(scene, STEPS / 60.0, progress=lambda _time: ends.append(process_time()))
    out = {OURS: (1e3 * median(np.diff(ends[1:])), _depth(scene, run))}
    for engine, answer in run_engines(scene, 1.0 / 60.0, STEPS).items():
        out[engine] = _pile_line(scene, answer)
    return out


def _pile_line(scene: ri.Scene, answer: EngineRun | str) -> tuple[float, str]:
    if isinstance(answer, str):
        return np.nan, answer
    frame = SimpleNamespace(positions=answer.position[None], orientations=answer.orientation[None])
    return float(np.median(answer.times)), _depth(scene, frame)


def _depth(scene: ri.Scene, run) -> str:
    deep = 1e3 * depths(scene, run, -1)
    return f"depth at most {deep.max(initial=0.0):.1f} mm, mean {deep.mean() if len(deep) else 0.0:.2f}"


def flight_round(name: str) -> dict[str, tuple[float, str]]:
    """Run a gas or bouncing balls in all engines: s in all, and the error of the energy."""
    make, number, duration, step = FLIGHTS[name]
    scene = make(number)
    run = ri.simulate(scene, duration)
    profile = run.profile
    assert profile is not None
    loop = sum(profile.stages[stage] for stage in STAGES if stage in profile.stages)
    note = f"{_energy_error(scene, run.velocities[-1], run.positions[-1])}; {profile.seconds:.3f} s with the scene compiled and recorded"
    out = {OURS: (loop, note)}
    for engine, answer in run_engines(scene, step, round(duration / step)).items():
        if isinstance(answer, str):
            out[engine] = np.nan, answer
        else:
            out[engine] = 1e-3 * float(answer.times.sum()), _energy_error(scene, answer.velocity, answer.position)
    return out


def _energy_error(scene: ri.Scene, velocity: np.ndarray, position: np.ndarray) -> str:
    """Relative error of the energy of balls; spin has no part in it where they are smooth."""
    moves = np.array([body.motion == "dynamic" for body in scene.bodies])
    masses = np.array([body.mass or 0.0 for body in scene.bodies])[moves]

    def energy(v: np.ndarray, x: np.ndarray) -> float:
        return float((masses * (0.5 * (v[moves] ** 2).sum(1) - x[moves] @ np.asarray(scene.gravity, float))).sum())

    start = energy(np.array([body.velocity for body in scene.bodies], float), np.array([body.position for body in scene.bodies], float))
    return f"energy off by {abs(energy(velocity, position) / start - 1.0):.1e}"


def main() -> None:
    """Run, print, save if asked to."""
    parser = argparse.ArgumentParser(description="The benchmark scenes here and in other engines.")
    parser.add_argument("scenes", nargs="*", help=f"of {', '.join([*PILES, *FLIGHTS])}; all but boxes_5000 if none is given")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--save", action="store_true", help="write tests/bench/<machine>/against_peers.csv")
    options = parser.parse_args()
    print(machine())
    ri.simulate(gas(20), 1.0)
    ri.simulate(pile(64, False), 1.0)
    ri.simulate(pile(64, True), 1.0)
    lines = []
    for name in options.scenes or [name for name in [*PILES, *FLIGHTS] if name != "boxes_5000"]:
        rounds = [pile_round(name) if name in PILES else flight_round(name) for _ in range(options.rounds)]
        for engine in rounds[0]:
            times = [one[engine][0] for one in rounds]
            ratios = [one[OURS][0] / one[engine][0] for one in rounds]
            lines.append((name, engine, median(times), median(ratios), rounds[-1][engine][1]))
            unit = "ms a step" if name in PILES else "s"
            compared = f"ours / its {median(ratios):7.3f}"
            print(f"{name:11} {engine:13} {median(times):9.3f} {unit}  {compared}  {rounds[-1][engine][1]}", flush=True)
        best = [min(v[0] for k, v in one.items() if k != OURS and np.isfinite(v[0])) for one in rounds]
        to_best = median([one[OURS][0] / b for one, b in zip(rounds, best)])
        print(f"{name:11} against the fastest of each round: {to_best:.3f}", flush=True)
    if options.save:
        folder = Path(__file__).parent / machine()
        folder.mkdir(exist_ok=True)
        with (folder / "against_peers.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("scene", "engine", "time", "ours over its", "note"))
            writer.writerows(lines)


if __name__ == "__main__":
    main()
