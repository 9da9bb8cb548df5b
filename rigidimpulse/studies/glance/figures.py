"""How wrong the runs of a glance are: off the truth by so much until when, or so deep inside each other.

    error(t)   largest |x - x_ref| of the dynamic bodies, m, at the frames that the reference tells
    bound      largest error(t) + uncertainty of the reference: the run is not further from the truth (triangle inequality)
    left       first frame at which a body is further off than LEFT of its size + uncertainty: anybody would see it

Where the reference tells too little there is no truth to be off: motion in a pile is chaotic, round-off decides it after a few impacts.
There the measure is depth, the deepest that two bodies are inside each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.model.world import World
from rigidimpulse.recording.recording import Recording
from rigidimpulse.studies.measures import penetration
from rigidimpulse.studies.reference import Reference

LEFT = 1e-2
"""Of a body's size."""
LEAST_TOLD = 0.1
"""Share of the duration that a reference must tell for places to be the measure."""
DEPTH_FRAMES = 24
"""Frames in which bodies are looked for that are inside each other."""
PLACE, DEPTH = "place", "depth"


@dataclass(frozen=True, eq=False)
class Figures:
    """How wrong one run is.

    Attributes:
        curve: (f,) m by frame, error or depth; NaN where it is not known.
        bound: m, largest error and the uncertainty of the reference, or deepest overlap.
        largest: m, largest of the curve.
        left: s, when the run left the truth; inf if it did not as far as it is told.

    """

    curve: np.ndarray
    bound: float
    largest: float
    left: float


def measure_of(reference: Reference, pile: bool, duration: float) -> str:
    """Whether runs are measured by places or by depth; pile: whether bodies are in sub-stepped islands."""
    return DEPTH if pile or reference.truth is None or reference.until < LEAST_TOLD * duration else PLACE


def is_pile(run: Recording) -> bool:
    """Whether bodies of a run were in sub-stepped islands."""
    return run.ledger is not None and "sub-stepping" in run.ledger.dissipated


def place_figures(world: World, run: Recording, reference: Reference) -> Figures:
    """Compare a run with the truth until the reference's horizon."""
    truth = reference.truth
    assert truth is not None
    distance = np.linalg.norm(run.positions - truth.position, axis=2)[:, world.dynamic]
    told = truth.times <= reference.until
    known = np.isfinite(truth.position[:, world.dynamic, 0])
    distance[known & ~np.isfinite(distance)] = np.inf
    distance[~known] = 0.0
    curve = np.where(told, distance.max(axis=1, initial=0.0), np.nan)
    seen = (distance > LEFT * world.size[world.dynamic] + reference.uncertainty).any(axis=1) & told
    left = float(truth.times[np.argmax(seen)]) if seen.any() else np.inf
    largest = float(curve[told].max(initial=0.0))
    return Figures(curve, largest + reference.uncertainty, largest, left)


def depth_figures(world: World, run: Recording) -> Figures:
    """How deep the bodies of a run are inside each other."""
    depth = penetration(world, run, DEPTH_FRAMES)
    known = np.isfinite(depth)
    largest = float(depth[known].max(initial=0.0))
    off = known & (np.nan_to_num(depth) > LEFT * float(world.size[world.dynamic].min(initial=np.inf)))
    return Figures(depth, largest, largest, float(run.times[np.argmax(off)]) if off.any() else np.inf)
