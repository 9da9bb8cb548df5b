"""What a run will cost, said before it: from the size of the scene, and from how fast this machine is.

    seconds = START + moving bodies x steps x unit x machine x correction

The unit is the time of a body for a step, by what the scene needs most; it was measured once. The machine is measured where it is used:
small operations of numpy, which take about as long as the loop between kernels. The correction is the geometric mean of took / forecast of
runs of the same kind that were remembered here, and of 1. Impacts are not known before a run, so single runs differ from the forecast by a
factor of several; the range says how much those that were remembered did.

Machine and corrections are kept in `rigidimpulse/forecasts.json` in the user's cache folder. They change no result of a run. Where the
folder cannot be written nothing is kept.
"""

from __future__ import annotations

import json
import math
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.files import make_folder, write_renamed
from rigidimpulse.engine.effects import EventKernel, SubsteppedContact
from rigidimpulse.engine.regime import only_expensive
from rigidimpulse.model.plan import Plan
from rigidimpulse.model.world import World

BALLS, PILE, JOINTED, IMPACTS = "impacts of balls", "sub-stepped islands", "joints and forces", "impacts and contacts"
UNITS = {BALLS: 6e-6, PILE: 2e-5, JOINTED: 4e-3, IMPACTS: 1e-3}
"""s for a moving body and a step, on the machine where CALIBRATED was measured."""
CALIBRATED = 3.0e-3
"""s that `_measure_machine` took there."""
START = 0.02
"""s to compile a small scene and make its recording."""
UNKNOWN = 10.0
"""Factor that a forecast may be off by where nothing is remembered."""
MOST_RATIOS = 20
"""Runs of a kind that are remembered."""
REPEATS = 5
"""Of the measurement of the machine, the least counts: 20 ms in all."""


@dataclass(frozen=True)
class Forecast:
    """What a run will cost.

    Attributes:
        kind: what the scene needs most. seconds: likely time, s. low, high: s, of nine runs in ten like those that are remembered.
        remembered: number of these. last: (forecast, took) of the last run of any kind, s, or None.

    """

    kind: str
    seconds: float
    low: float
    high: float
    remembered: int
    last: tuple[float, float] | None

    def text(self, duration: float) -> str:
        """Lines for people; duration: s of motion."""
        runs = f"{self.remembered} {'run' if self.remembered == 1 else 'runs'}"
        basis = f"corrected by {runs} here" if self.remembered else "no run of this kind is remembered here"
        between = f"{_seconds(self.low)} to {_seconds(self.high)}"
        lines = [f"forecast: {_seconds(self.seconds)} to compute {duration:g} s of motion, {between} ({basis})"]
        if self.last is not None:
            guess, took = self.last
            factor = max(took / guess, guess / took)
            side = "too low" if took > guess else "too high"
            off = "right" if factor < 1.05 else f"{factor:.2g} times {side}"
            lines.append(f"the last forecast was {off}: {_seconds(guess)}, the run took {_seconds(took)}")
        return "\n".join(lines)


def forecast(world: World, plan: Plan, duration: float) -> Forecast:
    """Say what a run of `duration` s will take on this machine, kernels compiled."""
    kept = _read()
    kind = kind_of(world, plan)
    ratios = kept["ratios"].get(kind, [])
    logs = np.log([1.0, *ratios])  # the unit itself counts as one run, so that a single odd run does not decide
    likely = _by_size(world, kind, duration, kept["machine"]) * math.exp(float(logs.mean()))
    spread = max(math.exp(1.64 * float(logs.std(ddof=1))), 1.2) if len(ratios) > 2 else UNKNOWN
    last = tuple(kept["last"]) if kept["last"] else None
    return Forecast(kind, likely, likely / spread, likely * spread, len(ratios), last)


def remember(world: World, plan: Plan, duration: float, took: float) -> None:
    """Keep what a run took, s, beside what was forecast; where that cannot be written nothing is kept."""
    kept, kind = _read(), kind_of(world, plan)
    guess = forecast(world, plan, duration).seconds
    ratio = took / _by_size(world, kind, duration, kept["machine"])
    kept["ratios"][kind] = [*kept["ratios"].get(kind, []), ratio][-MOST_RATIOS:]
    kept["last"] = [guess, took]
    _write(kept)


def kind_of(world: World, plan: Plan) -> str:
    """What a scene needs most."""
    if plan.includes(EventKernel.name):
        return BALLS
    if plan.includes(SubsteppedContact.name) and not only_expensive(world):
        return PILE
    return JOINTED if world.joints_of_scene or world.force_tables else IMPACTS


def _by_size(world: World, kind: str, duration: float, machine: float) -> float:
    """The forecast without its correction, s."""
    steps = max(duration / world.accuracy.step, 1.0)
    return machine / CALIBRATED * (START + steps * max(int(world.dynamic.sum()), 1) * UNITS[kind])


def _file() -> Path:
    folder = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or os.path.expanduser("~/.cache")
    return Path(folder) / "rigidimpulse" / "forecasts.json"


def _read() -> dict[str, Any]:
    """What is kept; measured now where nothing is, or where it cannot be read."""
    try:
        kept = json.loads(_file().read_text(encoding="utf-8"))
        known = {"machine": float(kept["machine"]), "ratios": dict(kept["ratios"]), "last": kept["last"]}
        numbers = [known["machine"], *(known["last"] or []), *(ratio for ratios in known["ratios"].values() for ratio in ratios)]
        if all(isinstance(value, float) and 0.0 < value < math.inf for value in numbers) and len(known["last"] or [1, 2]) == 2:
            return known
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        pass
    fresh: dict[str, Any] = {"machine": _measure_machine(), "ratios": {}, "last": None}
    _write(fresh)
    return fresh


def _write(kept: dict[str, Any]) -> None:
    with suppress(SceneError):
        make_folder(_file().parent)
        write_renamed(_file(), lambda target: target.write_text(json.dumps(kept), encoding="utf-8"))


def _measure_machine() -> float:
    """Time of 2,000 small operations of numpy, s."""
    times = []
    for _ in range(REPEATS):
        start, a = perf_counter(), np.ones(3)
        for _ in range(2000):
            a = a * 0.5 + 0.5
        times.append(perf_counter() - start)
    return min(times)


def _seconds(value: float) -> str:
    """A time with two digits, s."""
    return f"{value:.0f} s" if value >= 10.0 else f"{value:.2g} s"
