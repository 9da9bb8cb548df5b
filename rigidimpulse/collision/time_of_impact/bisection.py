"""Backing up time by bisection: the first contact of each pair, found to a tolerance and never passed.

The conservative bound gives a safe step and the features that limit it. Where their gap has come below `impact_margin` a little later, its
root is bracketed and bisected with interpolation, log2(h / tolerance) evaluations at most and mostly far fewer. The
bound then confirms that nothing touches before the root; if it names other features, their earlier root is taken, and
so on (`search`).
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.time_of_impact.result import ImpactTimes, PairsToSweep, SearchEffort, SweepDetector, no_impacts
from rigidimpulse.collision.time_of_impact.search import first_contacts
from rigidimpulse.motion.trajectory import Trajectories

LOOK_AHEAD = 0.5
"""How far past a safe step the root is looked for, relative to the step."""


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
    """Find the first contact of each pair of bodies.

    Args:
        detector: geometry, shapes of the bodies and scratch arrays.
        trajectory: paths of all bodies, known up to `end`.
        pairs_a: (k,) int64 bodies a; likewise pairs_b.
        start: (k,) s, from when each pair is swept.
        end: s.
        impact_margin: (k,) m, gap at which contact is declared: 0 or more, above 0 where two surfaces without a radius may
            meet.
        tolerance: (k,) m, how far above `impact_margin` the gap may be at the time found; rounding sets a limit to it.

    Returns:
        Times with a gap in [impact_margin - round-off, impact_margin + tolerance] and no contact before.

    """
    result = no_impacts(len(pairs_a))
    first_contacts(
        detector.geometry,
        trajectory,
        detector.sweep_scratch,
        detector.shape_of_body,
        PairsToSweep(pairs_a, pairs_b, start, impact_margin, tolerance),
        float(end),
        SearchEffort(LOOK_AHEAD, detector.max_queries),
        result,
    )
    return result
