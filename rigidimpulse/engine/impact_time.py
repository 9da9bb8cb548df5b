"""The time of impact, found for every pair of which a body has a new trajectory."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from rigidimpulse.collision.time_of_impact.result import STALLED
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.pair_table import note_sweep, pairs_to_sweep
from rigidimpulse.engine.run import Run

REASONS = {
    "bisection": "first contact in the interval, guarded: never past it",
    "conservative": "safe steps up to the contact, never past it",
    "linear": "linear approximation of the gap: cheap, may miss contacts",
    "after": "no backing up: contact is dealt with at the end of the step",
}


MODULES = {"bisection": "bisection", "conservative": "conservative", "linear": "linear", "after": "end_of_step"}
"""The module of `collision/time_of_impact` that holds each method; all have the same function `sweep`."""
STALLED_REMEDY = "the budget of gap queries was used up; raise iterations or the tolerance"


def sweep_with(method: str) -> Callable[[Run, PairEvents], None]:
    """The sweep of one of REASONS; its module is imported here, so that the others are not."""
    first_contacts = importlib.import_module(f"rigidimpulse.collision.time_of_impact.{MODULES[method]}").sweep

    def sweep(run: Run, pair_events: PairEvents) -> None:
        sweep_stale_pairs(run, pair_events, first_contacts)

    return sweep


def sweep_stale_pairs(run: Run, pair_events: PairEvents, method: Callable[..., Any]) -> None:
    """Sweep the pairs that ask for it, until the next event is known, and note when they come to contact."""
    table, step, end = pair_events.table, run.world.accuracy.step, pair_events.end
    if not len(pair_events.pairs):
        return
    places, asked = pairs_to_sweep(table, step, end)
    while len(places):
        found = run.narrow_phase.sweep(run, method, asked, end)
        note_sweep(table, places, found)
        for k in np.flatnonzero(found.status == STALLED).tolist():
            pair_events.report(float(found.time[k]), "sweep stalled", places[k : k + 1], STALLED_REMEDY)
        places, asked = pairs_to_sweep(table, step, end)
