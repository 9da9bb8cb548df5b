"""Backing up time by bisection: the first contact of each pair, found to a tolerance and never passed.

The conservative bound gives a safe step and the features that limit it. Where their gap has come below `impact_margin` a little later, its
root is bracketed and bisected with interpolation, log2(h / tolerance) evaluations at most and mostly far fewer. The
bound then confirms that nothing touches before the root; if it names other features, their earlier root is taken, and
so on (`search`).
"""

from __future__ import annotations

from rigidimpulse.collision.time_of_impact.result import ImpactTimes, PairsToSweep, SearchEffort, SweepDetector, no_impacts
from rigidimpulse.collision.time_of_impact.search import first_contacts
from rigidimpulse.motion.trajectory import Trajectories

LOOK_AHEAD = 0.5
"""How far past a safe step the root is looked for, relative to the step."""


def sweep(detector: SweepDetector, trajectory: Trajectories, pairs: PairsToSweep, end: float) -> ImpactTimes:
    """Find the first contact of each pair of bodies.

    Args:
        detector: geometry, shapes of the bodies and scratch arrays.
        trajectory: paths of all bodies, known up to `end`.
        pairs: k pairs. Their `impact_margin` is 0 or more, above 0 where two surfaces without a radius may meet; rounding sets a limit
            to their `tolerance`.
        end: s.

    Returns:
        Times with a gap in [impact_margin - round-off, impact_margin + tolerance] and no contact before.

    """
    result = no_impacts(len(pairs.a))
    first_contacts(
        detector.geometry,
        trajectory,
        detector.sweep_scratch,
        detector.shape_of_body,
        pairs,
        float(end),
        SearchEffort(LOOK_AHEAD, detector.max_queries),
        result,
    )
    return result
