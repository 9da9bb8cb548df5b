"""Damped springs between anchors.

    d = p_b - p_a,    F = -(k (|d| - l) + c d.d' / |d|) d / |d|  on b at p_b,  -F on a at p_a,    V = k (|d| - l)^2 / 2

Anchors move with their bodies: p = x + R c, p' = v + w x (R c). Two masses on a spring swing with w^2 = k (1 / m_a + 1 / m_b).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.core.quaternion import rotate
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.forces.force import Force, ForceTable, Instant, body_point, checked_number, checked_vector, end_of, named
from rigidimpulse.model.world import World

AT_LIMIT = TOLERANCES.force.spring_limit


@dataclass(frozen=True, eq=False)
class Spring(Force):
    """A damped spring between points of two bodies, or of a body and the world.

    Checked when the scene is compiled: a `SceneError` names unknown bodies, ends of which none is dynamic or that are the same, and numbers
    that are negative or not finite.

    Attributes:
        a, b: names of the bodies; None is the world.
        anchor_a, anchor_b: (3,) m, where it is fastened, in world coordinates at the start.
        stiffness: k, N/m. damping: c, N s/m, along the spring.
        rest_length: l, m; None: its length at the start. break_force: N, it is gone when its force exceeds it.
        name: what the ledger calls it; None makes one of the bodies' names.

    """

    a: str | None
    b: str | None
    anchor_a: ArrayLike
    anchor_b: ArrayLike
    stiffness: float
    damping: float = 0.0
    rest_length: float | None = None
    break_force: float = math.inf
    name: str | None = None
    kind: ClassVar[str] = "springs"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> SpringForces:
        """Check and bind all springs."""
        lines = []
        for spring in forces:
            where = f"Spring({spring.a!r}, {spring.b!r})"
            ends = [end_of(world, name, where) for name in (spring.a, spring.b)]
            if ends[0] == ends[1]:
                raise SceneError("both ends are the same", "fasten it to two bodies, or to a body and the world (None)", where)
            if not any(i >= 0 and world.dynamic[i] for i in ends):
                raise SceneError("neither end is dynamic", "fasten it to a dynamic body", where)
            points = [checked_vector(p, f"anchor_{s}", "m", where) for p, s in ((spring.anchor_a, "a"), (spring.anchor_b, "b"))]
            length = float(np.linalg.norm(points[1] - points[0]))
            if spring.rest_length is not None:
                length = checked_number(spring.rest_length, "rest_length", "m", where, least=0.0)
            k = checked_number(spring.stiffness, "stiffness", "N/m", where, least=0.0)
            c = checked_number(spring.damping, "damping", "N s/m", where, least=0.0)
            # What stands is as good as the world.
            ends = [i if i >= 0 and (world.dynamic[i] or world.moving[i]) else -1 for i in ends]
            arms = [body_point(world, i, p) for i, p in zip(ends, points, strict=True)]
            if not spring.break_force > 0.0:
                raise SceneError(f"break_force is {spring.break_force!r}", "give a force in N, > 0, or leave it out", where)
            lines.append(Line(ends[0], ends[1], arms[0], arms[1], k, c, length, float(spring.break_force)))
        told = [f"spring {f.a or 'world'} - {f.b or 'world'}" for f in forces]
        return SpringForces(named(cls.kind, [f.name for f in forces], told), lines, world)


class Line(NamedTuple):
    """One spring: bodies (-1 the world), arms (3,) m along principal axes, N/m, N s/m, m, N."""

    a: int
    b: int
    arm_a: np.ndarray
    arm_b: np.ndarray
    stiffness: float
    damping: float
    length: float
    break_force: float


class SpringTable(NamedTuple):
    """s springs as the kernel reads them, and the spring of each of k rows."""

    ends: np.ndarray  # (s, 2) bodies, -1 the world
    arms: np.ndarray  # (s, 2, 3) m
    values: np.ndarray  # (s, 3) stiffness, damping, length
    is_carried: np.ndarray  # (s, 2) bool, ends on bodies with a given path
    spring_of: np.ndarray  # (k,)


@jit_making_arrays
def _pull(rows, end_of_row, springs, carried, bodies, rotation, out):
    """Force and torque of rows, into out (r, 6); carried (r, 6): place and velocity of an other end on a given path."""
    ends, arms, table, is_carried, spring_of = springs
    p, v, arm = np.empty((2, 3)), np.zeros((2, 3)), np.empty((2, 3))
    for row in range(rows.shape[0]):
        s, mine = spring_of[rows[row]], end_of_row[rows[row]]
        for end in range(2):
            i, c = ends[s, end], arms[s, end]
            if i < 0 or is_carried[s, end]:
                for k in range(3):
                    p[end, k] = carried[row, k] if i >= 0 else c[k]
                    v[end, k] = carried[row, 3 + k]
                continue
            turn, w, r = rotation[i], bodies.angular_velocity[i], arm[end]
            for k in range(3):
                r[k] = turn[k, 0] * c[0] + turn[k, 1] * c[1] + turn[k, 2] * c[2]
            for k in range(3):
                m, n = (k + 1) % 3, (k + 2) % 3
                p[end, k] = bodies.position[i, k] + r[k]
                v[end, k] = bodies.velocity[i, k] + w[m] * r[n] - w[n] * r[m]
        length = math.sqrt((p[1, 0] - p[0, 0]) ** 2 + (p[1, 1] - p[0, 1]) ** 2 + (p[1, 2] - p[0, 2]) ** 2)
        # A spring of length 0 has no direction, and pulls nothing.
        share = 1.0 / length if length > 0.0 else 0.0
        rate = 0.0
        for k in range(3):
            rate += share * (p[1, k] - p[0, k]) * (v[1, k] - v[0, k])
        pull = table[s, 0] * (length - table[s, 2]) + table[s, 1] * rate
        sign = -share * pull if mine == 1 else share * pull
        for k in range(3):
            out[row, k] = sign * (p[1, k] - p[0, k])
        # The torque about the centre of mass.
        r = arm[mine]
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            out[row, 3 + k] = r[m] * out[row, n] - r[n] * out[row, m]


class SpringForces(ForceTable):
    """Springs: a row for each end on a dynamic body."""

    def __init__(self, names: list[str], lines: list[Line], world: World) -> None:
        """Of s springs."""
        self.kind, self.names = Spring.kind, names
        self._ends = np.array([[line.a, line.b] for line in lines], np.int64)
        self._arms = np.array([[line.arm_a, line.arm_b] for line in lines])
        self._table = np.array([[line.stiffness, line.damping, line.length] for line in lines])
        self._stiffness = self._table[:, 0].copy()
        self._limit, self._broke = np.array([line.break_force for line in lines]), np.full(len(lines), np.inf)
        dynamic = (self._ends >= 0) & world.dynamic[self._ends]
        self.cause, self._end = np.nonzero(dynamic)
        self.body = self._ends[self.cause, self._end]
        self.links = self._ends[dynamic.all(axis=1)]
        self._carried = (self._ends >= 0) & ~dynamic
        self.is_steady = not self._carried.any()
        self.reason = f"{len(lines)} acting"

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force and torque of rows."""
        out, carried = np.empty((len(rows), 6)), np.zeros((len(rows), 6))
        for r in np.flatnonzero(self._carried[self.cause[rows]].any(axis=1)).tolist():
            spring, end = self.cause[rows[r]], 1 - self._end[rows[r]]
            p, v = at.carried_point(int(self._ends[spring, end]), float(at.time[self.body[rows[r]]]), self._arms[spring, end])
            carried[r, :3], carried[r, 3:] = p, v
        springs = SpringTable(self._ends, self._arms, self._table, self._carried, self.cause)
        _pull(rows, self._end, springs, carried, at.bodies, at.rotation, out)
        return out

    def give_way(self, value: np.ndarray, time: float) -> list[int]:
        """Springs that break."""
        over = np.linalg.norm(value[:, :3], axis=1) >= self._limit[self.cause] * (1.0 - AT_LIMIT)
        broken = np.unique(self.cause[over]).tolist()
        self._limit[broken], self._table[broken, :2], self._broke[broken] = np.inf, 0.0, time
        return broken

    def carry_on(self, earlier: Self) -> None:
        """Springs that broke in an earlier run are broken, by their names."""
        gone = [name for name, broke in zip(earlier.names, earlier._broke, strict=True) if np.isfinite(broke)]
        broken = np.isin(self.names, gone)
        self._limit[broken], self._table[broken, :2] = np.inf, 0.0
        self._broke[broken] = [earlier._broke[earlier.names.index(name)] for name in np.array(self.names)[broken].tolist()]

    def share_until_break(self, value: np.ndarray, change: np.ndarray) -> float:
        """Where |F + s dF| first is the limit: the root of a quadratic."""
        limit = self._limit[self.cause]
        f, df = value[:, :3], change[:, :3]
        rows = np.flatnonzero(np.linalg.norm(f + df, axis=1) > limit)
        a, b = (df[rows] ** 2).sum(axis=1), (f[rows] * df[rows]).sum(axis=1)
        c = np.minimum((f[rows] ** 2).sum(axis=1) - limit[rows] ** 2, 0.0)
        return float(np.min((np.sqrt(b * b - a * c) - b) / a, initial=1.0))

    def potential(self, times: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Potential energy of each spring (f, springs)."""
        ends = []
        for end in (0, 1):
            i, arm = self._ends[:, end], self._arms[:, end]
            place = position[:, i] + rotate(orientation[:, i], np.broadcast_to(arm, (len(times), *arm.shape)))
            ends.append(np.where((i < 0)[None, :, None], arm[None], place))
        length = np.linalg.norm(ends[1] - ends[0], axis=-1)
        energy = 0.5 * self._stiffness * (length - self._table[:, 2]) ** 2
        return np.where(times[:, None] < self._broke, energy, 0.0)
