"""Exact reference for smooth equal disks in a rectangle, by events: decimal arithmetic, roots in closed form.

Between events disks move in straight lines. With x, v the relative position and velocity of two disks of radius r,

    |x + v t| = 2 r:    t = (-b - sqrt(b^2 - a c)) / a,    a = v.v,  b = x.v < 0,  c = x.x - 4 r^2
    x_k + v_k t = +-(side_k - r)                            at a wall of coordinate k

and at the event, with n = x / |x|, equal masses exchange (1 + e) / 2 of the normal velocity; a wall reflects it with
its own e. Chaos multiplies rounding by about 2 distance / r at each impact between disks, so 50 digits leave all
printed ones exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from typing import NamedTuple

import numpy as np

DIGITS = 50

Plane = tuple[Decimal, Decimal]


class DiskEvent(NamedTuple):
    """An impact at `time` [s] of disk `a` with disk `b`, or with wall 0 (-x), 1 (+x), 2 (-y), 3 (+y): b = -1 - wall."""

    time: Decimal
    a: int
    b: int


@dataclass
class DisksInRectangle:
    """Disks of one radius and mass in the rectangle |x| <= sides[0], |y| <= sides[1].

    Attributes:
        positions: (n, 2) m. velocities: (n, 2) m/s. radius: m. sides: half sides, m.
        restitution: e between disks. wall_restitution: e at the walls.

    """

    positions: list[Plane]
    velocities: list[Plane]
    radius: Decimal
    sides: Plane
    restitution: Decimal = Decimal(1)
    wall_restitution: Decimal = Decimal(1)
    time: Decimal = Decimal(0)

    @staticmethod
    def of(
        positions: Sequence[Sequence[float]],
        velocities: Sequence[Sequence[float]],
        radius: float,
        sides: Sequence[float],
        restitution: float = 1.0,
        wall_restitution: float = 1.0,
    ) -> DisksInRectangle:
        """Return the disks for the exact values of the given binary numbers."""

        def pairs(rows: Sequence[Sequence[float]]) -> list[Plane]:
            return [(Decimal(float(row[0])), Decimal(float(row[1]))) for row in rows]

        return DisksInRectangle(
            pairs(positions), pairs(velocities), Decimal(radius), pairs([sides])[0],
            Decimal(restitution), Decimal(wall_restitution),
        )  # fmt: skip

    def advance(self, end: float, most_events: int | None = None) -> list[DiskEvent]:
        """Move on to the time `end` [s], or through `most_events` impacts if that is earlier; return the impacts."""
        events: list[DiskEvent] = []
        with localcontext() as context:
            context.prec = DIGITS
            stop = Decimal(end)
            while most_events is None or len(events) < most_events:
                event = min(self._candidates(), default=None)
                if event is None or event.time > stop:
                    self._drift(stop)
                    break
                self._drift(event.time)
                self._collide(event)
                events.append(event)
        return events

    def frames(self, times: np.ndarray) -> tuple[np.ndarray, list[DiskEvent]]:
        """Return the positions (f, n, 3) [m] at rising times [s], in the plane z = 0, and the impacts until the last."""
        events: list[DiskEvent] = []
        positions = np.zeros((len(times), len(self.positions), 3))
        for f, time in enumerate(times.tolist()):
            events += self.advance(time)
            positions[f, :, :2] = [[float(x) for x in place] for place in self.positions]
        return positions, events

    def _candidates(self) -> list[DiskEvent]:
        """Return the next impact of every pair that has one, if nothing else happened before."""
        found = []
        for a in range(len(self.positions)):
            for axis in range(2):
                v = self.velocities[a][axis]
                if v != 0:
                    side = 1 if v > 0 else -1
                    gap = side * (self.sides[axis] - self.radius) - self.positions[a][axis]
                    found.append(DiskEvent(self.time + gap / v, a, -1 - (2 * axis + (side > 0))))
            for b in range(a + 1, len(self.positions)):
                wait = self._wait(a, b)
                if wait is not None:
                    found.append(DiskEvent(self.time + wait, a, b))
        return found

    def _wait(self, a: int, b: int) -> Decimal | None:
        """Return the time until two disks touch, None if they never do."""
        x, y = (q - p for p, q in zip(self.positions[a], self.positions[b], strict=True))
        u, v = (q - p for p, q in zip(self.velocities[a], self.velocities[b], strict=True))
        approach = x * u + y * v
        if approach >= 0:
            return None
        speed = u * u + v * v
        root = approach * approach - speed * (x * x + y * y - 4 * self.radius * self.radius)
        return None if root < 0 else (-approach - root.sqrt()) / speed

    def _drift(self, time: Decimal) -> None:
        step = time - self.time
        self.positions = [
            (x + u * step, y + v * step)
            for (x, y), (u, v) in zip(self.positions, self.velocities, strict=True)
        ]  # fmt: skip
        self.time = time

    def _collide(self, event: DiskEvent) -> None:
        """Change the velocities at an impact."""
        a, b = event.a, event.b
        u, v = self.velocities[a]
        if b < 0:
            e = self.wall_restitution
            self.velocities[a] = (-e * u, v) if -1 - b < 2 else (u, -e * v)
            return
        x, y = (q - p for p, q in zip(self.positions[a], self.positions[b], strict=True))
        u_b, v_b = self.velocities[b]
        share = (1 + self.restitution) / 2 * (x * (u_b - u) + y * (v_b - v)) / (x * x + y * y)
        self.velocities[a] = (u + share * x, v + share * y)
        self.velocities[b] = (u_b - share * x, v_b - share * y)
