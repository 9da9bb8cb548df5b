"""Backing up time by bisection on the gaps that FCL measures between two meshes.

The gap g(t) of two surfaces changes by at most L |dt|, with L a bound of the speed at which their points pass each other:

    L >= |v_b - v_a| + W_a r_a + W_b r_b        r: bounding radii, W: bounds of the spins over the interval (`motion_bound`)

So between two times at which the gap was measured, a way w = L (t_2 - t_1) apart, it is at least (g_1 + g_2 - w) / 2. An interval is split
in two, the earlier half first, until one of this holds:

    this bound is above half the impact margin: there is no contact in the interval
    w is less than the contact margin: its end tells
    w is less than a hundredth of the smaller body, the pair was in contact at the start, and with A a bound of the accelerations
        min(g_1, g_2) - A (t_2 - t_1)^2 / 8 is above half the impact margin: features that are there all the time stay apart

The last one is for pairs that slide: their gaps hardly change, and L shows nothing. A hump on which they are for less than that way may be
missed. The first interval at whose end the gap is at the impact margin or below, with w below the contact margin, is bisected with
interpolation until the gap at its beginning is at the margin (the search is Piyavskii's, 1972, for the first root instead of the least
value).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np

from rigidimpulse.collision.manifold.fcl_contacts import FclManifolds, MeshContact, Placed
from rigidimpulse.collision.time_of_impact.free_flight import rounding_slack
from rigidimpulse.collision.time_of_impact.motion_bound import (
    ACCELERATION,
    CENTRE_JERK,
    MOTION_SIZE,
    SPIN_BOUND,
    SPIN_RATE_BOUND,
    VELOCITY,
    motion_bound,
)
from rigidimpulse.collision.time_of_impact.result import IMPACT, SEPARATE, STALLED, TOUCHING, ImpactTimes, PairsToSweep, no_impacts
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.motion.trajectory import Trajectories, motion_at

MEETS = -1
"""Status of a pair whose surfaces meet at the start: FCL knows no gap below 0, so it is not swept."""
SLIDING = 1e-2
"""Way within which features of a pair in contact do not come and go, over the size of the smaller body."""
NEAR = 2.0
"""A pair is in contact at the start if its gap is less than this many contact margins."""
_EPSILON = 2.0**-52


@dataclass(frozen=True)
class Swept:
    """What a sweep needs to know of n bodies."""

    manifolds: FclManifolds
    shape_of_body: np.ndarray  # (n,)
    size: np.ndarray  # (n,) m, largest extent
    radius: np.ndarray  # (n,) m, about the centre of mass
    reach: np.ndarray  # (s,) m, the same of each shape
    max_queries: int


@jit
def _bring_pair(trajectory, a, b, t, motion):
    """Write the motion of two bodies at t [s]: places (2, 3), quaternions (2, 4), axes (2, 3, 3), velocities and spins (2, 3)."""
    place, turn, axes, velocity, spin = motion
    for side in range(2):
        motion_at(trajectory, b if side else a, t, place[side], turn[side], velocity[side], spin[side])
        quaternion_to_matrix(turn[side], axes[side])


@jit_making_arrays
def _bounds(trajectory, a, b, t, horizon, radius):
    """The bounds L [m/s] and A [m/s2] of two bodies from t on, over a horizon [s]; radius (n,) m."""
    work, turning, bending, spin = np.empty((2, MOTION_SIZE)), 0.0, 0.0, 0.0
    for side in range(2):
        i, record = b if side else a, work[side]
        motion_bound(trajectory, i, t, horizon, record)
        if record[SPIN_BOUND] > 0.0:
            spin += record[SPIN_BOUND]
            turning += record[SPIN_BOUND] * radius[i]
            bending += (record[SPIN_RATE_BOUND] + record[SPIN_BOUND] ** 2) * radius[i]
    speed, pull = 0.0, 0.0
    for k in range(3):
        most = abs(work[1, ACCELERATION + k] - work[0, ACCELERATION + k])
        most += horizon * abs(work[1, CENTRE_JERK + k] - work[0, CENTRE_JERK + k])
        speed += (abs(work[1, VELOCITY + k] - work[0, VELOCITY + k]) + horizon * most) ** 2
        pull += most**2
    # A frame that turns with one of the bodies sees the velocities turn.
    return sqrt(speed) + turning, sqrt(pull) + bending + 2.0 * spin * (sqrt(speed) + turning)


@dataclass(frozen=True)
class Search:
    """What is looked for on one pair's path.

    Attributes:
        start, end: s.
        margin: gap at which contact is declared, m.
        above: how far above it the gap may be at the time found, m.
        slack: how far rounding may move the gap, m.
        contact_margin: of the pair, m. size: of the smaller body, m.

    """

    start: float
    end: float
    margin: float
    above: float
    slack: float
    contact_margin: float
    size: float


class PairPath:
    """Two meshes on their trajectories; counts how often FCL was asked."""

    def __init__(self, swept: Swept, trajectory: Trajectories, a: int, b: int) -> None:
        """Bodies a and b."""
        self._swept, self._trajectory, self._bodies = swept, trajectory, (a, b)
        self._shapes = int(swept.shape_of_body[a]), int(swept.shape_of_body[b])
        self._motion = (np.empty((2, 3)), np.empty((2, 4)), np.empty((2, 3, 3)), np.empty((2, 3)), np.empty((2, 3)))
        self.queries = 0

    def _placed(self, t: float) -> Placed:
        _bring_pair(self._trajectory, *self._bodies, t, self._motion)
        place, axes = self._motion[0], self._motion[2]
        return Placed(*self._shapes, axes[0].T @ axes[1], axes[0].T @ (place[1] - place[0]))

    def gap(self, t: float) -> float:
        """The gap at t, m, 0 where the surfaces meet."""
        self.queries += 1
        placed = self._placed(t)
        return self._swept.manifolds.trees.gap(placed.a, placed.b, placed.R, placed.t)

    def closest(self, t: float, margin: float) -> MeshContact | None:
        """The contact at the closest points at t, in the frame of a; None where the surfaces meet."""
        return self._swept.manifolds.closest(self._placed(t), margin)

    def bounds(self, start: float, end: float) -> tuple[float, float]:
        """The bounds L [m/s] and A [m/s2] of an interval."""
        return _bounds(self._trajectory, *self._bodies, start, end - start, self._swept.radius)

    def witness(self, contact: MeshContact) -> np.ndarray:
        """Points, normal and gap (10,) in the world, at the time that was asked about last."""
        place, _, axes, _, _ = self._motion
        point_a, point_b = axes[0] @ contact.point_a + place[0], axes[0] @ contact.point_b + place[0]
        return np.concatenate([point_a, point_b, axes[0] @ contact.normal, [contact.gap]])

    def closing_speed(self, contact: MeshContact) -> float:
        """How fast the closest points approach along the normal, m/s, at the time that was asked about last."""
        place, _, axes, velocity, spin = self._motion
        normal, speed = axes[0] @ contact.normal, 0.0
        for side, point in enumerate((contact.point_a, contact.point_b)):
            arm = axes[0] @ point + place[0] - place[side]
            speed += (1.0 - 2.0 * side) * float(normal @ (velocity[side] + np.cross(spin[side], arm)))
        return speed


def sweep(
    swept: Swept, trajectory: Trajectories, pairs: PairsToSweep, contact_margin: np.ndarray, end: float
) -> ImpactTimes:
    """Find the first contact of each pair of meshes.

    Args:
        swept: the meshes and bodies.
        trajectory: paths of all bodies, known up to `end`.
        pairs: k pairs, from when on, and at which gap.
        contact_margin: (k,) m.
        end: s.

    Returns:
        Times with a gap in [impact_margin - round-off, impact_margin + tolerance]; the status is MEETS for pairs that were not swept.

    """
    result = no_impacts(len(pairs.a))
    for k, (a, b) in enumerate(zip(pairs.a.tolist(), pairs.b.tolist(), strict=True)):
        shape_a, shape_b = int(swept.shape_of_body[a]), int(swept.shape_of_body[b])
        slack = float(rounding_slack(trajectory, swept.reach, a, b, shape_a, shape_b, end))
        search = Search(
            float(pairs.start[k]), end, float(pairs.impact_margin[k]), max(float(pairs.tolerance[k]), slack), slack,
            float(contact_margin[k]), float(min(swept.size[a], swept.size[b])),
        )  # fmt: skip
        path = PairPath(swept, trajectory, a, b)
        result.time[k], result.status[k] = first_contact(path, search, swept.max_queries)
        result.queries[k] = path.queries
        if result.status[k] in (IMPACT, TOUCHING):
            contact = path.closest(float(result.time[k]), search.contact_margin)
            if contact is not None:
                result.witness[k] = path.witness(contact)
    return result


def first_contact(path: PairPath, search: Search, most: int) -> tuple[float, int]:
    """Time and status of the first contact on a path; most: how often FCL may be asked."""
    gap = path.gap(search.start)
    margin, above = search.margin, search.above
    if gap <= margin + above:
        contact = path.closest(search.start, search.contact_margin)
        if contact is None:
            return search.start, MEETS
        if path.closing_speed(contact) * (search.end - search.start) > search.slack:
            return search.start, int(TOUCHING if gap <= margin else IMPACT)
        # They hover, slide or leave: they may come closer by the slack for rounding.
        margin = min(gap, margin) - search.slack
        above = min(above, 0.5 * (gap - margin))
    resolution = SLIDING * search.size if gap <= NEAR * search.contact_margin else search.contact_margin
    return _search(path, replace(search, margin=margin, above=above), gap, resolution, most)


def _search(path: PairPath, search: Search, gap: float, resolution: float, most: int) -> tuple[float, int]:
    """Time and status of the first contact of a pair that has a gap above the margin at the start."""
    margin, (speed, bend) = search.margin, path.bounds(search.start, search.end)
    least = margin - 0.5 * abs(margin)
    low, above = search.start, gap
    if gap - speed * (search.end - search.start) > least:
        return inf, int(SEPARATE)
    later = [(search.end, path.gap(search.end))]
    while later and path.queries < most:
        high, below = later[-1]
        way = speed * (high - low)
        middle = max(0.5 * (low + high), low + (above - least) / speed)
        dip = min(above, below) - 0.125 * bend * (high - low) ** 2
        is_free = 0.5 * (above + below - way) > least or (way <= resolution and dip > least) or way <= search.contact_margin
        if below > margin and (is_free or not low < middle < high):
            low, above = later.pop()
        elif below <= margin and (way <= search.contact_margin or not low < middle < high):
            return _root(path, search, (low, above - margin), (high, below - margin)), int(IMPACT)
        else:
            later.append((middle, path.gap(middle)))
    return (low, int(STALLED)) if later else (inf, int(SEPARATE))


def _root(path: PairPath, search: Search, before: tuple[float, float], after: tuple[float, float]) -> float:
    """The last time known to be above the margin where the gap is `search.above` over it at most, or one rounding from the root.

    before, after: times, and gaps over the margin there.

    Bisection with interpolation (Illinois): every third time the middle is taken, so that the interval shrinks in any case.
    """
    (low, above), (high, below) = before, after
    weight_low = weight_high = 1.0
    trial = 0
    while above > search.above and high - low > 2.0 * _EPSILON * max(abs(low), abs(high)):
        trial += 1
        share = weight_low * above / (weight_low * above - weight_high * below) if below < 0.0 else 0.5
        t = low + (0.5 if trial % 3 == 0 else share) * (high - low)
        t = t if low < t < high else 0.5 * (low + high)
        if not low < t < high:
            break
        gap = path.gap(t) - search.margin
        if gap > 0.0:
            low, above, weight_low, weight_high = t, gap, 1.0, 0.5 * weight_high
        else:
            high, below, weight_high, weight_low = t, gap, 1.0, 0.5 * weight_low
    return low
