"""The time of impact, found for every pair of which a body has a new trajectory."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from rigidimpulse.collision.time_of_impact.result import STALLED
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run

REASONS = {
    "bisection": "first contact in the interval, guarded: never past it",
    "conservative": "safe steps up to the contact, never past it",
    "linear": "linear approximation of the gap: cheap, may miss contacts",
    "after": "no backing up: contact is dealt with at the end of the step",
}


MODULES = {"bisection": "bisection", "conservative": "conservative", "linear": "linear", "after": "end_of_step"}
"""The module of `collision/time_of_impact` that holds each method; all have the same function `sweep`."""


def sweep_with(method: str) -> Callable[[Run, PairEvents], None]:
    """The sweep of one of REASONS; its module is imported here, so that the others are not."""
    first_contacts = importlib.import_module(f"rigidimpulse.collision.time_of_impact.{MODULES[method]}").sweep

    def sweep(run: Run, pair_events: PairEvents) -> None:
        sweep_stale_pairs(run, pair_events, first_contacts)

    return sweep


def sweep_stale_pairs(run: Run, pair_events: PairEvents, method: Callable[..., Any]) -> None:
    """Sweep the pairs that ask for it, and note when they come to contact."""
    stale = np.flatnonzero(~np.isnan(pair_events.start))
    if not len(stale):
        return
    found = method(
        run.detector, run.state.trajectory, pair_events.a[stale], pair_events.b[stale], pair_events.start[stale], pair_events.end,
        pair_events.impact_margin[stale], pair_events.tolerance[stale],
    )
    pair_events.time[stale] = found.time
    pair_events.witness[stale] = found.witness
    pair_events.start[stale] = np.nan
    for k in np.flatnonzero(found.status == STALLED):
        names = run.world.names
        run.log.report(
            float(found.time[k]), "sweep stalled", (names[pair_events.a[stale[k]]], names[pair_events.b[stale[k]]]),
            "the budget of gap queries was used up; raise iterations or the tolerance",
        )
