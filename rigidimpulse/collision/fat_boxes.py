"""Fat boxes: pairs of bodies whose enlarged boxes overlap, kept until a body leaves its fat box.

The fat box of a body is the box of its bounding sphere, enlarged by a slack for its motion (Box2D: enlarged AABB). Immovable bodies have
the box of their shape. As long as every body stays within its slack, the pairs found before hold all that may touch, and nothing is
searched.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import NamedTuple, Protocol

import numpy as np

from rigidimpulse.collision.broad_phase import find_overlapping
from rigidimpulse.collision.contact_records import MEMBER, OUTSIDE, SUPPORT, ContactPairs, in_play
from rigidimpulse.core.kernels import jit

SLACK = 0.1
"""Slack in inner radii that every body gets in addition to what it needs."""
CLOSE = 0.02
"""Relative motion in inner radii of two slow bodies that makes no new contact: contacts are searched for farther away than that."""
INTERVALS = 2.0
"""Slack for motion, in lengths of the time ahead."""


class BodyBounds(NamedTuple):
    """What does not change of n bodies."""

    order: np.ndarray  # (n,) bodies by their positions at the start of the run
    moves: np.ndarray  # (n,) bool, dynamic or kinematic
    radius: np.ndarray  # (n,) m, of the bounding sphere about the centre of mass
    inner: np.ndarray  # (n,) m, distance from the centre of mass to the nearest face
    clearance: np.ndarray  # (n,) m, slack that a moving body needs in addition to its path
    low: np.ndarray  # (n, 3) m, box of a body that does not move
    high: np.ndarray  # (n, 3) m


class Fat(NamedTuple):
    """Fat boxes of n bodies, and scratch memory."""

    boxed: np.ndarray  # (n,) bool, the body has one
    centre: np.ndarray  # (n, 3) m
    slack: np.ndarray  # (n,) m
    reach: np.ndarray  # (n,) m, scratch
    path: np.ndarray  # (n,) inner radii, scratch


class MovingBodies(Protocol):
    """What is known of n bodies at one instant, in the world."""

    @property
    def position(self) -> np.ndarray:
        """(n, 3) m."""
        ...

    @property
    def velocity(self) -> np.ndarray:
        """(n, 3) m/s."""
        ...

    @property
    def angular_velocity(self) -> np.ndarray:
        """(n, 3) rad/s."""
        ...


@jit
def _path_length(velocity, acceleration, i, ahead):
    """Upper bound of the path (m) of body i in `ahead` s."""
    speed, pull = 0.0, 0.0
    for k in range(3):
        speed += velocity[i, k] ** 2
        pull += acceleration[i, k] ** 2
    return ahead * (sqrt(speed) + ahead * sqrt(pull))


@jit
def stay_in_boxes(bounds, fat, now, acceleration, part, ahead):
    """Whether members stay in their fat boxes for `ahead` s, and supports have one; part: (n,) MEMBER, SUPPORT or OUTSIDE, by index."""
    for i in range(part.shape[0]):
        # A body that came to rest elsewhere counts as a member, since it moved.
        if part[i] == OUTSIDE:
            continue
        if not fat.boxed[i]:
            return False
        if part[i] == SUPPORT or not bounds.moves[i]:
            continue
        away = 0.0
        for k in range(3):
            away += (now.position[i, k] - fat.centre[i, k]) ** 2
        if sqrt(away) + bounds.clearance[i] + _path_length(now.velocity, acceleration, i, ahead) > fat.slack[i]:
            return False
    return True


@jit
def _make_boxes(now, acceleration, bounds, ahead, fat, low, high):
    """Make fat boxes at the present positions, and write their corners (n, 3) by rank."""
    boxed, centre, slack = fat.boxed, fat.centre, fat.slack
    radius, inner, clearance = bounds.radius, bounds.inner, bounds.clearance
    for r in range(bounds.order.shape[0]):
        i = bounds.order[r]
        if not (boxed[i] and bounds.moves[i]):
            for k in range(3):
                low[r, k], high[r, k] = (bounds.low[i, k], bounds.high[i, k]) if boxed[i] else (np.inf, -np.inf)
            continue
        slack[i] = clearance[i] + INTERVALS * _path_length(now.velocity, acceleration, i, ahead) + SLACK * min(inner[i], radius[i])
        for k in range(3):
            centre[i, k] = now.position[i, k]
            low[r, k] = now.position[i, k] - radius[i] - slack[i]
            high[r, k] = now.position[i, k] + radius[i] + slack[i]


@jit
def _drop_far(now, bounds, slack, pairs):
    """Leave out pairs whose enlarged bounding spheres are apart; returns the number of pairs left."""
    order, moves, radius = bounds.order, bounds.moves, bounds.radius
    kept = 0
    for p in range(pairs.shape[0]):
        i, j = order[pairs[p, 0]], order[pairs[p, 1]]
        if moves[i] and moves[j]:
            reach = radius[i] + radius[j] + slack[i] + slack[j]
            away = 0.0
            for k in range(3):
                away += (now.position[i, k] - now.position[j, k]) ** 2
            if away > reach * reach:
                continue
        pairs[kept, 0], pairs[kept, 1] = pairs[p, 0], pairs[p, 1]
        kept += 1
    return kept


@jit
def near_pairs(bounds, fat, pairs, now, acceleration, part, ahead, out):
    """Write pairs (a, b, may touch) by index, of members with each other and with supports, that may meet in `ahead` s; their number.

    part: (n,) MEMBER, SUPPORT or OUTSIDE, by index; out: (3, k). Supports stand almost still. The third number is 0 where the pair had no
    contact when its contacts were last found, and the bodies move too little to make one. Returns -1 where the pairs do not hold all that
    may meet, see `stay_in_boxes`.
    """
    order, moves, radius, x = bounds.order, bounds.moves, bounds.radius, now.position
    reach, path, count = fat.reach, fat.path, np.int64(0)
    if not stay_in_boxes(bounds, fat, now, acceleration, part, ahead):
        return np.int64(-1)
    for i in range(radius.shape[0]):
        reach[i], path[i] = radius[i], 0.0
        if part[i] == MEMBER:
            reach[i] += bounds.clearance[i] + _path_length(now.velocity, acceleration, i, ahead)
            spin = 0.0
            for k in range(3):
                path[i] += now.velocity[i, k] ** 2
                spin += now.angular_velocity[i, k] ** 2
            # How far any point of the body moves, in inner radii.
            path[i] = ahead * (sqrt(path[i]) + radius[i] * sqrt(spin)) / bounds.inner[i]
    for p in range(pairs.first.shape[0]):
        i, j = order[pairs.first[p]], order[pairs.second[p]]
        if not in_play(part, i, j):
            continue
        apart = False
        # Moving bodies by their spheres, immovable ones by the box of their shape.
        if moves[i] and moves[j]:
            dx, dy, dz = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
            apart = dx * dx + dy * dy + dz * dz > (reach[i] + reach[j]) ** 2
        else:
            m, f = (i, j) if moves[i] else (j, i)
            for k in range(3):
                apart = apart or x[m, k] - reach[m] > bounds.high[f, k] or x[m, k] + reach[m] < bounds.low[f, k]
        if apart:
            continue
        out[0, count], out[1, count] = i, j
        out[2, count] = pairs.count[p] > 0 or not pairs.known[p] or path[i] + path[j] > CLOSE
        count += 1
    return count


class FatBoxes:
    """Fat boxes of the bodies of a scene.

    Attributes:
        bounds: what does not change of the bodies.

    """

    def __init__(self, bounds: BodyBounds, dynamic: np.ndarray, may_collide: Callable[[np.ndarray, np.ndarray], np.ndarray] | None) -> None:
        """No body has a fat box yet.

        Args:
            bounds: of n bodies.
            dynamic: (n,) bool; a pair without a dynamic body is left out.
            may_collide: tells which pairs (k,), (k,) of bodies take part; None if all do.

        """
        n = len(bounds.order)
        self.bounds, self._dynamic, self._may_collide = bounds, dynamic, may_collide
        self.fat = Fat(np.zeros(n, bool), np.zeros((n, 3)), *np.zeros((3, n)))
        self._capacity, self._near = max(64, 16 * n), np.empty((3, 0), np.int64)

    def renewed(self, now: MovingBodies, acceleration: np.ndarray, part: np.ndarray, ahead: float) -> tuple[np.ndarray, np.ndarray]:
        """Ranks (k,) int32 of pairs that may meet, ascending, found again; part: (n,) which bodies move and which stand."""
        bounds, fat = self.bounds, self.fat
        fat.boxed[:] = ~self._dynamic | (part != OUTSIDE)
        low, high = np.empty((2, len(bounds.order), 3))
        _make_boxes(now, acceleration, bounds, ahead, fat, low, high)
        pairs = find_overlapping(low, high, self._dynamic[bounds.order], self._capacity)
        self._capacity = max(self._capacity, 5 * len(pairs) // 4)
        count = _drop_far(now, bounds, fat.slack, pairs)
        first, second = np.ascontiguousarray(pairs[:count].T)
        if self._may_collide is not None:
            a, b = bounds.order[first], bounds.order[second]
            may = self._may_collide(np.minimum(a, b), np.maximum(a, b))
            first, second = first[may], second[may]
        return first, second

    def space_for(self, pairs: ContactPairs) -> np.ndarray:
        """Space (3, k) for as many pairs as `near_pairs` may find among these."""
        if self._near.shape[1] < len(pairs.first):
            self._near = np.empty((3, 2 * len(pairs.first)), np.int64)
        return self._near

    def near(self, pairs: ContactPairs, now: MovingBodies, acceleration: np.ndarray, part: np.ndarray, ahead: float) -> np.ndarray | None:
        """Pairs (a, b, may touch) by index, a of lower rank, that may meet in `ahead` s, (3, k); None where `pairs` must be renewed."""
        space = self.space_for(pairs)
        count = near_pairs(self.bounds, self.fat, pairs, now, acceleration, part, ahead, space)
        # A view would be of another type where it is whole.
        return None if count < 0 else space[:, :count].copy()
