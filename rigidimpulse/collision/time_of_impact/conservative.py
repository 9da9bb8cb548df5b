"""Backing up time by safe steps alone: conservative advancement until the gap is at `impact_margin`.

Every step is a safe one, so no contact is passed (Mirtich 1996). Each step leaves a third-order
remainder of the time to contact, so few are needed; where bodies graze, each halves what is left.
"""

from __future__ import annotations

from rigidimpulse.collision.time_of_impact.result import ImpactTimes, PairsToSweep, SearchEffort, SweepDetector, no_impacts
from rigidimpulse.collision.time_of_impact.search import first_contacts
from rigidimpulse.motion.trajectory import Trajectories


def sweep(detector: SweepDetector, trajectory: Trajectories, pairs: PairsToSweep, end: float) -> ImpactTimes:
    """Find the first contact of each pair of bodies; arguments and result as for `bisection.sweep`."""
    result = no_impacts(len(pairs.a))
    first_contacts(
        detector.geometry,
        trajectory,
        detector.sweep_scratch,
        detector.shape_of_body,
        pairs,
        float(end),
        SearchEffort(0.0, detector.max_queries),
        result,
    )
    return result
