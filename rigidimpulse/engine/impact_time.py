"""The stage sweep: the time of impact of every pair whose trajectory is new."""

from __future__ import annotations

import importlib
from dataclasses import dataclass

import numpy as np

from rigidimpulse.collision.time_of_impact.result import STALLED
from rigidimpulse.engine.plan import Bound, Skip

REASONS = {
    "bisection": "first contact in the interval, guarded: never past it",
    "conservative": "safe steps up to the contact, never past it",
    "linear": "linear approximation of the gap: cheap, may miss contacts",
    "after": "no backing up: contact is dealt with at the end of the step",
}


MODULES = {"bisection": "bisection", "conservative": "conservative", "linear": "linear", "after": "end_of_step"}
"""The module of `collision/time_of_impact` that holds each method; all have the same function `sweep`."""


@dataclass(frozen=True)
class ImpactTime:
    """One of REASONS."""

    method: str
    stage: str = "sweep"

    name: str = "impact time"

    def bind(self, world) -> Bound | Skip:
        """In where something can collide."""
        if not world.can_collide:
            return Skip(world.why_no_impacts)
        method = importlib.import_module(f"rigidimpulse.collision.time_of_impact.{MODULES[self.method]}").sweep

        def sweep(run, pair_events) -> None:
            sweep_stale_pairs(run, pair_events, method)

        return Bound(sweep, f"{self.method}: {REASONS[self.method]}")


def sweep_stale_pairs(run, pair_events, method) -> None:
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
