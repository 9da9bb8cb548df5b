"""Broad phase of heaps: pairs of bodies whose covers overlap, kept until a body leaves its cover.

The cover of a body is the sphere that holds it, widened by a slack for the way it may go; immovable bodies are covered by
their boxes.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse.collision.broad_phase import overlapping_pairs
from rigidimpulse.core.kernels import jit, jit_making_arrays

SLACK = 0.1
"""Inner radii of slack that every body gets beside what it needs."""
CLOSE = 0.02
"""Inner radii within which two slow bodies stay of where they were to each other; contacts are looked for farther away than that."""
INTERVALS = 2.0
"""Lengths of time ahead for whose motion bodies get slack, too."""


@jit
def _way(velocity, acceleration, i, ahead):
    """How far (m) body i may come in `ahead` s."""
    speed, pull = 0.0, 0.0
    for k in range(3):
        speed += velocity[i, k] ** 2
        pull += acceleration[i, k] ** 2
    return ahead * (sqrt(speed) + ahead * sqrt(pull))


@jit
def _left_fat_box(members, now, acceleration, least, ahead, covered, centre, slack):
    """Whether a member may leave its cover in `ahead` s, or has none."""
    for i in members:
        if not covered[i]:
            return True
        away = 0.0
        for k in range(3):
            away += (now.position[i, k] - centre[i, k]) ** 2
        if sqrt(away) + least[i] + _way(now.velocity, acceleration, i, ahead) > slack[i]:
            return True
    return False


@jit
def _boxes(order, now, acceleration, least, ahead, world_min, world_max, moves, radius, inner, covered, centre, slack, low, high):
    """Covers at the present places, and their boxes (n, 3) by rank."""
    for r in range(order.shape[0]):
        i = order[r]
        if not (covered[i] and moves[i]):
            for k in range(3):
                low[r, k], high[r, k] = (world_min[i, k], world_max[i, k]) if covered[i] else (np.inf, -np.inf)
            continue
        slack[i] = least[i] + INTERVALS * _way(now.velocity, acceleration, i, ahead) + SLACK * min(inner[i], radius[i])
        for k in range(3):
            centre[i, k] = now.position[i, k]
            low[r, k] = now.position[i, k] - radius[i] - slack[i]
            high[r, k] = now.position[i, k] + radius[i] + slack[i]


@jit
def _drop_far(order, now, moves, radius, slack, pairs, count):
    """Leave out pairs whose covering spheres are apart; returns how many stay."""
    kept = 0
    for p in range(count):
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


@jit_making_arrays
def near_pairs(order, pairs, now, acceleration, least, inner, ahead, world_min, world_max, moves, radius, member, other, out):
    """Write pairs (a, b, touch) by index, of members with each other and with others, that may meet in `ahead` s; their number.

    member, other: (n,) bool; out (k, 3). Others stay where they are, or nearly so. touch is 0 where the pair had no contact when it
    was looked at, and neither body has gone or goes far enough to make one.
    """
    reach, x, count = radius.copy(), now.position, 0
    way = np.zeros(radius.shape[0])
    for i in range(radius.shape[0]):
        if member[i]:
            reach[i] += least[i] + _way(now.velocity, acceleration, i, ahead)
            spin = 0.0
            for k in range(3):
                way[i] += now.velocity[i, k] ** 2
                spin += now.angular_velocity[i, k] ** 2
            way[i] = ahead * (sqrt(way[i]) + radius[i] * sqrt(spin)) / inner[i]
    for p in range(pairs.first.shape[0]):
        i, j = order[pairs.first[p]], order[pairs.second[p]]
        if not ((member[i] and (member[j] or other[j])) or (member[j] and other[i])):
            continue
        apart = False
        if moves[i] and moves[j]:
            dx, dy, dz = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
            apart = dx * dx + dy * dy + dz * dz > (reach[i] + reach[j]) ** 2
        else:
            m, f = (i, j) if moves[i] else (j, i)
            for k in range(3):
                apart = apart or x[m, k] - reach[m] > world_max[f, k] or x[m, k] + reach[m] < world_min[f, k]
        if apart:
            continue
        out[count, 0], out[count, 1] = i, j
        out[count, 2] = pairs.count[p] > 0 or not pairs.known[p] or way[i] + way[j] > CLOSE
        count += 1
    return count


class FatBoxes:
    """Covers of the bodies of a scene.

    Attributes:
        order: (n,) bodies by their places at the start of the run.
        least: (n,) m, what a body that moves needs beside its way.

    """

    def __init__(self, world, order: np.ndarray, inner: np.ndarray, least: np.ndarray) -> None:
        """Nobody is covered."""
        n = world.num_bodies
        self.world, self.order, self.least = world, order, least
        self._moves = world.dynamic | world.moving
        self._inner = inner
        self._covered = np.zeros(n, bool)
        self._centre, self._slack = np.zeros((n, 3)), np.zeros(n)
        self._most = max(64, 16 * n)

    def renewed(self, now, acceleration, members: np.ndarray, others: np.ndarray, ahead: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Ranks (k,) int32 of pairs that may meet, ascending, where they had to be found anew; None where the known ones hold.

        members: (k,) bodies that move; others: (m,) more bodies that are to be covered where they are.
        """
        world = self.world
        # A body that came to rest elsewhere is looked at as a member of those that move.
        if np.all(self._covered[others]) and not _left_fat_box(
            members, now, acceleration, self.least, ahead, self._covered, self._centre, self._slack
        ):
            return None
        self._covered[:] = ~world.dynamic
        self._covered[members] = self._covered[others] = True
        n = world.num_bodies
        low, high = np.empty((n, 3)), np.empty((n, 3))
        _boxes(
            self.order, now, acceleration, self.least, ahead, world.static_min, world.static_max, self._moves, world.bound_radius,
            self._inner, self._covered, self._centre, self._slack, low, high,
        )  # fmt: skip
        movable = world.dynamic[self.order]
        pairs = np.empty((self._most, 2), np.int32)
        count = overlapping_pairs(low, high, movable, pairs)
        if count < 0:
            self._most = -count - count // 4
            pairs = np.empty((self._most, 2), np.int32)
            count = overlapping_pairs(low, high, movable, pairs)
        count = _drop_far(self.order, now, self._moves, world.bound_radius, self._slack, pairs, count)
        first, second = np.ascontiguousarray(pairs[:count].T)
        if len(world.apart):
            a, b = self.order[first], self.order[second]
            may = world.may_collide(np.minimum(a, b), np.maximum(a, b))
            first, second = first[may], second[may]
        return first, second

    def near(self, pairs, now, acceleration, member: np.ndarray, other: np.ndarray, ahead: float) -> np.ndarray:
        """Pairs (a, b, touch) by index, a of lower rank, of members with each other and with others that may meet in `ahead` s, (3, k)."""
        world = self.world
        out = np.empty((len(pairs.first), 3), np.int64)
        count = near_pairs(
            self.order, pairs, now, acceleration, self.least, self._inner, ahead, world.static_min, world.static_max, self._moves,
            world.bound_radius, member, other, out,
        )  # fmt: skip
        return out[:count].T
