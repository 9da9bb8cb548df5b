"""Print what runs measure of themselves: energy made, drift of momentum, deepest overlap, and what the measuring costs.

Run it from the root of the repository: `python tests/bench/measure_status.py [gallery] [hard] [newcomer] [substepped] [NAME ...]`. A scene
that takes more than LONG is given up. With "substepped" all islands without joints are sub-stepped.
"""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.engine.measure.energy import RISE, allowed_rise, energy_rise
from rigidimpulse.engine.measure.measure import measured_faults, record_of_recording
from rigidimpulse.engine.measure.momentum import momentum_drifts
from rigidimpulse.engine.measure.overlap import overlap_depths

sys.path.insert(0, str(Path(__file__).parent.parent / "newcomer"))
LONG = 20.0
"""s of wall clock for a scene."""
FORCED = ri.Accuracy(contact_solver="substepped")
WARM = 0.3
"""s that a scene is run first, so that the time to compile is not counted."""


@dataclass(frozen=True)
class Case:
    """A scene with its duration and frame rate."""

    name: str
    scene: ri.Scene
    duration: float
    fps: float = 60.0
    accuracy: Any = "standard"


def cases(wanted: list[str]) -> Iterator[Case]:
    """All scenes that are asked for; all of the gallery and the newcomers' where none is."""
    from scenes import CORPUS  # pyright: ignore[reportMissingImports]

    chosen = [word for word in wanted if word != "substepped"] or ["gallery", "newcomer"]
    for kind, names in (("gallery", gallery.names()), ("hard", gallery.hard_names())):
        for name in names:
            if kind in chosen or name in chosen:
                entry = gallery.load(name)
                yield Case(name, entry.scene(), entry.duration, entry.fps, FORCED if "substepped" in wanted else entry.accuracy)
    for name, case in CORPUS.items():
        if "newcomer" in chosen or name in chosen:
            yield Case(name, case.make()[0].scene, case.duration, accuracy=FORCED if "substepped" in wanted else "standard")


def look(case: Case) -> str:
    """Run a scene and return its row."""
    ri.simulate(case.scene, min(case.duration, WARM), case.fps, accuracy=case.accuracy)  # compiles what is not in the cache
    begin = time.perf_counter()

    def give_up(_reached: float) -> None:
        if time.perf_counter() - begin > LONG:
            raise TimeoutError(f"more than {LONG} s")

    run = ri.simulate(case.scene, case.duration, case.fps, accuracy=case.accuracy, progress=give_up)
    took = time.perf_counter() - begin
    record = record_of_recording(run)
    begin = time.perf_counter()
    faults = measured_faults(record)
    cost = time.perf_counter() - begin
    rise, moved = energy_rise(record)
    drifts = momentum_drifts(record)
    depths = overlap_depths(record)
    share = depths.depth / depths.size
    made = float((rise / np.maximum(allowed_rise(record, moved), 1e-300)).max()) * RISE if moved > 0.0 else 0.0
    deepest = float(share.max(initial=0.0))
    return (
        f"{case.name:<24}{len(run.names):5d}{'sub' if record.may_be_sub_stepped else '':>5}{made:10.1e}"
        f"{drifts.momentum.max(initial=0.0):10.1e}{drifts.angular.max(initial=0.0):10.1e}{deepest:10.1e}{len(share):8d}"
        f"{took:8.2f}{1e3 * cost:9.1f}{cost / took:8.1%}  " + "; ".join(f"{f.time:.4g} s {f.kind} {f.bodies} {f.message}" for f in faults)
    )


if __name__ == "__main__":
    np.set_printoptions(linewidth=200)
    print(f"{'scene':<24}{'n':>5}{'':>5}{'energy':>10}{'momentum':>10}{'angular':>10}{'depth':>10}{'pairs':>8}{'run s':>8}{'cost ms':>9}")
    for case in cases(sys.argv[1:]):
        try:
            print(look(case), flush=True)
        except TimeoutError as error:
            print(f"{case.name:<24}{error}", flush=True)
        except Exception:
            traceback.print_exc()
