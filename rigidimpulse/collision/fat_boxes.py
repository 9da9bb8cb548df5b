"""Fat boxes: pairs of bodies whose enlarged boxes overlap, kept until a body leaves its fat box.

The fat box of a body is the box of its bounding sphere, enlarged by a slack for its motion (Box2D: enlarged AABB). Immovable bodies have
the box of their shape. As long as every body stays within its slack, the pairs found before hold all that may touch, and nothing is
searched.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse.collision.broad_phase import overlapping_pairs
from rigidimpulse.core.kernels import jit, jit_making_arrays

SLACK = 0.1
"""Slack in inner radii that every body gets in addition to what it needs."""
CLOSE = 0.02
"""Relative motion in inner radii of two slow bodies that makes no new contact: contacts are searched for farther away than that."""
INTERVALS = 2.0
"""Slack for motion, in lengths of the time ahead."""


@jit
def _path_length(velocity, acceleration, i, ahead):
    """Upper bound of the path (m) of body i in `ahead` s."""
    speed, pull = 0.0, 0.0
    for k in range(3):
        speed += velocity[i, k] ** 2
        pull += acceleration[i, k] ** 2
    return ahead * (sqrt(speed) + ahead * sqrt(pull))


@jit
def _left_fat_box(members, now, acceleration, clearance, ahead, boxed, centre, slack):
    """Whether a member may leave its fat box in `ahead` s, or has none."""
    for i in members:
        if not boxed[i]:
            return True
        away = 0.0
        for k in range(3):
            away += (now.position[i, k] - centre[i, k]) ** 2
        if sqrt(away) + clearance[i] + _path_length(now.velocity, acceleration, i, ahead) > slack[i]:
            return True
    return False


@jit
def _boxes(order, now, acceleration, clearance, ahead, world_min, world_max, moves, radius, inner, boxed, centre, slack, low, high):
    """Make fat boxes at the present positions, and write their corners (n, 3) by rank."""
    for r in range(order.shape[0]):
        i = order[r]
        if not (boxed[i] and moves[i]):
            for k in range(3):
                low[r, k], high[r, k] = (world_min[i, k], world_max[i, k]) if boxed[i] else (np.inf, -np.inf)
            continue
        slack[i] = clearance[i] + INTERVALS * _path_length(now.velocity, acceleration, i, ahead) + SLACK * min(inner[i], radius[i])
        for k in range(3):
            centre[i, k] = now.position[i, k]
            low[r, k] = now.position[i, k] - radius[i] - slack[i]
            high[r, k] = now.position[i, k] + radius[i] + slack[i]


@jit
def _drop_far(order, now, moves, radius, slack, pairs, count):
    """Leave out pairs whose enlarged bounding spheres are apart; returns the number of pairs left."""
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
def near_pairs(order, pairs, now, acceleration, clearance, inner, ahead, world_min, world_max, moves, radius, member, other, out):
    """Write pairs (a, b, may touch) by index, of members with each other and with others, that may meet in `ahead` s; their number.

    member, other: (n,) bool; out (k, 3). Others stand almost still. The third number is 0 where the pair had no contact when its contacts
    were last found, and the bodies move too little to make one.
    """
    reach, x, count = radius.copy(), now.position, 0
    path = np.zeros(radius.shape[0])
    for i in range(radius.shape[0]):
        if member[i]:
            reach[i] += clearance[i] + _path_length(now.velocity, acceleration, i, ahead)
            spin = 0.0
            for k in range(3):
                path[i] += now.velocity[i, k] ** 2
                spin += now.angular_velocity[i, k] ** 2
            path[i] = ahead * (sqrt(path[i]) + radius[i] * sqrt(spin)) / inner[i]
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
        out[count, 2] = pairs.count[p] > 0 or not pairs.known[p] or path[i] + path[j] > CLOSE
        count += 1
    return count


class FatBoxes:
    """Fat boxes of the bodies of a scene.

    Attributes:
        order: (n,) bodies by their positions at the start of the run.
        clearance: (n,) m, slack that a moving body needs in addition to its path.

    """

    def __init__(self, world, order: np.ndarray, inner: np.ndarray, clearance: np.ndarray) -> None:
        """No body has a fat box yet."""
        n = world.num_bodies
        self.world, self.order, self.clearance = world, order, clearance
        self._moves = world.dynamic | world.moving
        self._inner = inner
        self._boxed = np.zeros(n, bool)
        self._centre, self._slack = np.zeros((n, 3)), np.zeros(n)
        self._most = max(64, 16 * n)

    def renewed(self, now, acceleration, members: np.ndarray, others: np.ndarray, ahead: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Ranks (k,) int32 of pairs that may meet, ascending, if they had to be searched; None if the pairs found before still hold.

        members: (k,) bodies that move; others: (m,) bodies that stand.
        """
        world = self.world
        # A body that came to rest elsewhere counts as a member, since it moved.
        if np.all(self._boxed[others]) and not _left_fat_box(
            members, now, acceleration, self.clearance, ahead, self._boxed, self._centre, self._slack
        ):
            return None
        self._boxed[:] = ~world.dynamic
        self._boxed[members] = self._boxed[others] = True
        n = world.num_bodies
        low, high = np.empty((n, 3)), np.empty((n, 3))
        _boxes(
            self.order, now, acceleration, self.clearance, ahead, world.static_min, world.static_max, self._moves, world.bound_radius,
            self._inner, self._boxed, self._centre, self._slack, low, high,
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
        """Pairs (a, b, may touch) by index, a of lower rank, of members with each other and others that may meet in `ahead` s, (3, k)."""
        world = self.world
        out = np.empty((len(pairs.first), 3), np.int64)
        count = near_pairs(
            self.order, pairs, now, acceleration, self.clearance, self._inner, ahead, world.static_min, world.static_max, self._moves,
            world.bound_radius, member, other, out,
        )  # fmt: skip
        return out[:count].T
