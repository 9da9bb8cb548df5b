"""The stage sweep: the first contact of every pair whose course is new."""

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


@dataclass(frozen=True)
class ImpactTime:
    """One of REASONS; each is a module of this folder with the same `sweep`."""

    method: str
    stage: str = "sweep"

    name: str = "impact time"

    def bind(self, world) -> Bound | Skip:
        """In where something can collide."""
        if not world.can_collide:
            return Skip(world.why_no_impacts)
        method = importlib.import_module(f"rigidimpulse.collision.time_of_impact.{self.method}").sweep

        def sweep(context, window) -> None:
            sweep_window(context, window, method)

        return Bound(sweep, f"{self.method}: {REASONS[self.method]}")


def sweep_window(context, window, method) -> None:
    """Sweep the pairs that ask for it, and note when they come to contact."""
    stale = np.flatnonzero(~np.isnan(window.start))
    if not len(stale):
        return
    found = method(
        context.detector, context.state.course, window.a[stale], window.b[stale], window.start[stale], window.end,
        window.touch[stale], window.tolerance[stale],
    )
    window.time[stale] = found.time
    window.witness[stale] = found.witness
    window.start[stale] = np.nan
    for k in np.flatnonzero(found.status == STALLED):
        names = context.world.names
        context.log.report(
            float(found.time[k]), "sweep stalled", (names[window.a[stale[k]]], names[window.b[stale[k]]]),
            "the budget of gap queries was used up; raise iterations or the tolerance",
        )
