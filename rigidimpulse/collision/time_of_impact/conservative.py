"""Backing up time by safe steps alone: conservative advancement until the gap is at `impact_margin`.

Every step is a safe one, so no contact is passed (Mirtich 1996). Each step leaves a third-order
remainder of the time to contact, so few are needed; where bodies graze, each halves what is left.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.time_of_impact.result import ImpactTimes, PairsToSweep, SearchEffort, SweepDetector, no_impacts
from rigidimpulse.collision.time_of_impact.search import first_contacts
from rigidimpulse.motion.trajectory import Trajectories


def sweep(
    detector: SweepDetector,
    trajectory: Trajectories,
    pairs_a: np.ndarray,
    pairs_b: np.ndarray,
    start: np.ndarray,
    end: float,
    impact_margin: np.ndarray,
    tolerance: np.ndarray,
) -> ImpactTimes:
    """Find the first contact of each pair of bodies; arguments and result as for `bisection.sweep`."""
    result = no_impacts(len(pairs_a))
    first_contacts(
        detector.geometry,
        trajectory,
        detector.sweep_scratch,
        detector.shape_of_body,
        PairsToSweep(pairs_a, pairs_b, start, impact_margin, tolerance),
        float(end),
        SearchEffort(0.0, detector.max_queries),
        result,
    )
    return result
