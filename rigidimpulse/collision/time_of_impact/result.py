"""What every sweep answers.

A sweep looks for the first time in [start, end] at which the gap of a pair of bodies comes down to `impact_margin`. Its
answer is a status and a time:

    SEPARATE   the pair stays apart: time inf
    IMPACT     the gap comes down to `impact_margin` at `time`
    TOUCHING   the gap is at or below `impact_margin` at the start and shrinks: time = start
    STALLED    the budget of queries is used up; until `time` there is no contact

Methods, one module each with the same function `sweep`: `bisection` (the default) and `conservative` never pass a
contact and leave a gap in [impact_margin - round-off, impact_margin + tolerance]; `linear` and `after` are cheaper and may miss one.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from rigidimpulse.collision.geometry import Geometry
from rigidimpulse.collision.time_of_impact.safe_step import SweepScratch

SEPARATE, IMPACT, TOUCHING, STALLED = 0, 1, 2, 3
"""Statuses, see the head of the file."""


class ImpactTimes(NamedTuple):
    """Answers for k pairs."""

    time: np.ndarray  # (k,) s, inf where SEPARATE
    status: np.ndarray  # (k,) int64
    queries: np.ndarray  # (k,) int64, gap evaluations used
    witness: (
        np.ndarray
    )  # (k, 10) m, points on a and b, normal from a to b (zeros if unknown) and gap where contact is made
    clear: np.ndarray  # (k,) s, until when a pair that is SEPARATE was looked at, if that is not `end`; else nan


class PairsToSweep(NamedTuple):
    """Pairs (k,) whose first contact is wanted."""

    a: np.ndarray  # (k,) bodies
    b: np.ndarray  # (k,)
    start: np.ndarray  # (k,) s, from when on
    impact_margin: np.ndarray  # (k,) m, gap at which contact is declared
    tolerance: np.ndarray  # (k,) m, how far above it the gap may be
    until: np.ndarray  # (k,) s, until when the answer is wanted, at most `end`; methods may go on to the end


class SearchEffort(NamedTuple):
    """How contacts are searched for."""

    ahead: float  # how far past a safe step the root is looked for, relative to the step; 0 for safe steps only
    max_queries: int  # gap evaluations a pair may use


class SweepDetector(Protocol):
    """What a sweep needs to know of the scene."""

    @property
    def geometry(self) -> Geometry:
        """The shapes."""
        ...

    @property
    def shape_of_body(self) -> np.ndarray:
        """(n,) int64."""
        ...

    @property
    def sweep_scratch(self) -> SweepScratch:
        """Working memory."""
        ...

    @property
    def max_queries(self) -> int:
        """Gap evaluations that a pair may use in an interval."""
        ...


def no_impacts(num_pairs: int) -> ImpactTimes:
    """Answers for pairs that stay apart; the kernels overwrite them."""
    return ImpactTimes(
        time=np.full(num_pairs, np.inf),
        status=np.full(num_pairs, SEPARATE, np.int64),
        queries=np.zeros(num_pairs, np.int64),
        witness=np.zeros((num_pairs, 10)),
        clear=np.full(num_pairs, np.nan),
    )
