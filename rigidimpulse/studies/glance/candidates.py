"""The few settings that tell most: the presets, fixed steps, penalty forces, and other engines. Ten at most.

A fixed step sees an impact at the end of the step in which it happens, as many engines do. One has a step of 1/60 s; the other has the
step that takes as long as the standard run. The same two are run of every other engine that is installed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib.util import find_spec

from rigidimpulse.scene.accuracy import LADDER, PRESETS, Accuracy
from rigidimpulse.studies.peers import PEERS

PRESET, FIXED, PENALTY, PEER = "preset", "fixed", "penalty", "engine"
TITLES = {"mujoco": "MuJoCo", "pybullet": "Bullet"}
"""Names of other engines for people."""
FIXED_RATE = 60
"""Steps a second of the coarse fixed step."""
MOST_RATE = 30_720
"""Steps a second of a fixed step, at most."""


@dataclass(frozen=True)
class Candidate:
    """A setting that is run.

    Attributes:
        name: what people call it. kind: PRESET, FIXED, PENALTY or PEER.
        setting: its values in words. accuracy: those of this library; None for another engine.
        engine: name of another engine, or "". rate: steps a second of fixed steps, else 0.

    """

    name: str
    kind: str
    setting: str
    accuracy: Accuracy | None
    engine: str = ""
    rate: int = 0


def presets() -> list[Candidate]:
    """Preview, standard and exact."""
    return [_preset(name) for name in LADDER]


def _preset(name: str) -> Candidate:
    accuracy = Accuracy(**PRESETS[name])
    return Candidate(name, PRESET, f"step 1/{round(1.0 / accuracy.step)} s, tolerance {accuracy.tolerance:.0e}", accuracy)


def fixed_step(rate: int) -> Candidate:
    """Impacts are seen at the end of steps of 1/rate s."""
    accuracy = Accuracy(impact_time="after", step=1.0 / rate)
    return Candidate(f"fixed step 1/{rate}", FIXED, "impacts seen at the ends of steps", accuracy, rate=rate)


def penalty() -> Candidate:
    """Springs push bodies apart that are inside each other."""
    return Candidate("penalty", PENALTY, "springs push bodies apart", Accuracy(response="penalty"))


def other_engine(engine: str, rate: int) -> Candidate:
    """Another engine with steps of 1/rate s."""
    return Candidate(f"{TITLES.get(engine, engine)} 1/{rate}", PEER, f"another engine, step 1/{rate} s", None, engine, rate)


def installed_engines() -> list[str]:
    """Other engines that can be run here."""
    return [name for name in PEERS if find_spec(name) is not None]


def same_cost_rate(seconds: float, coarse_seconds: float, coarse_rate: int) -> int:
    """Steps a second with which fixed steps take `seconds`, or a little less, if they take `coarse_seconds` at the coarse rate.

    It is a round multiple of the coarse rate, 1 at least.
    """
    times = min(max(seconds / max(coarse_seconds, 1e-6), 1.0), MOST_RATE / coarse_rate)
    power = 10.0 ** math.floor(math.log10(times))
    return coarse_rate * round(math.floor(times / power) * power)
