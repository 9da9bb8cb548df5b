"""What the card of an impact says: numbers of each impact, worked out when the page is written.

A row has the columns of `COLUMNS`, all SI. Impulse and time, the two that people compare with `run.impacts`, are kept in double precision.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rigidimpulse.recording.impact_states import impact_states
from rigidimpulse.scene.mass import masses_of
from rigidimpulse.scene.material import combine

MOST_CARDS = 3_000
"""Impacts with a card, the strongest: some 200 bytes each."""
COLUMNS = {
    "body_a": 1, "body_b": 1, "point": 3, "normal": 3, "tangent_impulse": 3, "approach_speed": 1, "separation_speed": 1, "known": 1,
    "velocity": 12, "angular_velocity": 12, "inverse_mass": 2, "spin": 2, "slip": 1, "others": 1, "energy": 1,
}  # fmt: skip
"""Columns and their widths: those of `run.impacts`, then those of `recording.impact_states.ImpactStates`."""


def card_rows(impacts: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Return the rows of the impacts that have a card, by time."""
    push = np.where(np.isfinite(impacts["impulse"]), impacts["impulse"], -1.0)
    chosen = np.argsort(-push, kind="stable")[:MOST_CARDS]
    chosen = np.sort(chosen[push[chosen] > 0.0])
    return chosen[np.argsort(impacts["time"][chosen], kind="stable")]


def card_table(recording: Any, rows: npt.NDArray[np.int64]) -> npt.NDArray[np.float32]:
    """Return the cards (k, sum of widths) of impacts of a recording with its scene."""
    impacts, states = recording.impacts[rows], impact_states(recording, rows)
    given = {name: impacts[name] if name in impacts.dtype.names else getattr(states, name) for name in COLUMNS}
    parts = [np.asarray(given[name], dtype=np.float64).reshape(len(rows), width) for name, width in COLUMNS.items()]
    return np.concatenate(parts, axis=1).astype(np.float32)


def card_keys(recording: Any, rows: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Return (2, k): times, s, and normal impulses, N s."""
    return np.stack([recording.impacts[name][rows] for name in ("time", "impulse")]).astype(np.float64)


def card_entries(recording: Any, rows: npt.NDArray[np.int64]) -> dict[str, Any]:
    """Return what the manifest says of the cards: columns, coefficients of the pairs that meet ("a,b": e, mu_s, mu_k), masses by body."""
    bodies, impacts = list(recording.scene.bodies), recording.impacts[rows]
    pairs = {}
    for a, b in sorted({(int(a), int(b)) for a, b in zip(impacts["body_a"], impacts["body_b"], strict=True)}):
        pairs[f"{a},{b}"] = list(combine(bodies[a].material, bodies[b].material)[:3])
    masses = [mass.mass if np.isfinite(mass.mass) else None for mass in masses_of(bodies)] if len(rows) else []
    return {"columns": COLUMNS, "pairs": pairs, "masses": masses, "numImpacts": len(recording.impacts)}
