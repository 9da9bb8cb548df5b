"""Fields of force.

    user field     F(t, x, v) at the centre of mass
    attractor      a = -s r / (|r|^2 + e^2)^((p + 1) / 2),    r = x - c,    on the centre of mass

p = 2 is gravitation (s = G M), p = -1 a spring of frequency sqrt(s). Potential per mass, p not 1: -s (|r|^2 + e^2)^((1 - p) / 2) / (p - 1);
p = 1: s ln(|r|^2 + e^2) / 2. A dynamic body as the centre feels the opposite forces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.portable import power
from rigidimpulse.dynamics.forces.force import (
    Force,
    ForceTable,
    Instant,
    checked_number,
    checked_vector,
    dynamic_bodies,
    dynamic_body,
    named,
    no_links,
)
from rigidimpulse.model.world import World


@dataclass(frozen=True, eq=False)
class ForceField(Force):
    """A force that a function of yours gives, at centres of mass: wind, water, a magnet.

    The function is called many times a step, for trial states too: it must depend on its arguments alone. Where it is smooth paths are of
    order 4. What it returns is checked at the start of the run: a `SceneError` says if it is not (k, 3) finite numbers.

    Attributes:
        force: function(time (k,) s, position (k, 3) m, velocity (k, 3) m/s) -> (k, 3) N of k bodies.
        bodies: names; None: all dynamic bodies.
        name: what the ledger calls it; None: "field".

    """

    force: Callable[[np.ndarray, np.ndarray, np.ndarray], ArrayLike]
    bodies: Sequence[str] | None = None
    name: str | None = None
    kind: ClassVar[str] = "force fields"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> FieldForces:
        """Check and bind all fields."""
        body = []
        for field in forces:
            where = "ForceField"
            if not callable(field.force):
                raise SceneError(f"force is {field.force!r}", "give a function of time, position and velocity", where)
            body.append(dynamic_bodies(world, field.bodies, where))
            i = body[-1]
            try:
                value = np.asarray(field.force(np.zeros(len(i)), world.position[i].copy(), world.velocity[i].copy()), float)
            except Exception as error:
                raise SceneError(f"its function fails: {error!r}", "make it take arrays (k,), (k, 3), (k, 3)", where) from error
            if value.shape != (len(i), 3) or not np.all(np.isfinite(value)):
                raise SceneError(
                    f"its function returns the shape {value.shape} for {len(i)} bodies, or numbers that are not finite",
                    "return finite forces (k, 3) in N", where,
                )  # fmt: skip
        return FieldForces(named(cls.kind, [f.name for f in forces], ["field"] * len(forces)), [f.force for f in forces], body)


class FieldForces(ForceTable):
    """User fields, one row for each body of each."""

    def __init__(self, names: list[str], functions: list[Callable], bodies: list[np.ndarray]) -> None:
        """functions and bodies (k,) of each field."""
        self.kind, self.names = ForceField.kind, names
        self.body = np.concatenate(bodies)
        self.cause = np.repeat(np.arange(len(bodies)), [len(i) for i in bodies])
        self.links, self.is_steady = no_links(), False
        self.reason = f"on {len(np.unique(self.body))} bodies"
        self._functions = functions

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force of rows."""
        wrench = np.zeros((len(rows), 6))
        for k, function in enumerate(self._functions):
            these = np.flatnonzero(self.cause[rows] == k)
            if len(these):
                i = self.body[rows[these]]
                wrench[these, :3] = function(at.time[i], at.bodies.position[i], at.bodies.velocity[i])
        return wrench


@dataclass(frozen=True, eq=False)
class PointAttractor(Force):
    """Draws centres of mass towards a point or a body, with an acceleration that falls with a power of the distance.

    Checked when the scene is compiled: a `SceneError` names bodies that are unknown or not dynamic and numbers that are not finite. A body
    that comes to a centre without softening meets forces without bound: "forces change too fast" is reported.

    Attributes:
        center: (3,) m, or the name of a dynamic body, which feels the opposite forces.
        strength: s, m^(p+1)/s2: the acceleration at the distance 1 m. G M for gravitation; negative repels.
        power: p: the acceleration is s / distance^p.
        softening: e >= 0, m: distance below which the force stays finite.
        bodies: names; None: all dynamic bodies but the centre.
        name: what the ledger calls it; None: "attractor".

    """

    center: ArrayLike | str
    strength: float
    power: float = 2.0
    softening: float = 0.0
    bodies: Sequence[str] | None = None
    name: str | None = None
    kind: ClassVar[str] = "attractors"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> AttractorForces:
        """Check and bind all attractors."""
        rows = []
        for k, force in enumerate(forces):
            where = f"PointAttractor({force.center!r})"
            middle = dynamic_body(world, force.center, where) if isinstance(force.center, str) else -1
            point = np.zeros(3) if middle >= 0 else checked_vector(force.center, "center", "m", where)
            s = checked_number(force.strength, "strength", "m^(p+1)/s2", where)
            p = checked_number(force.power, "power", "", where)
            e = checked_number(force.softening, "softening", "m", where, least=0.0)
            pulled = [i for i in dynamic_bodies(world, force.bodies, where).tolist() if i != middle]
            if not pulled:
                raise SceneError("it attracts no body but its centre", "name other bodies, or leave it out", where)
            rows += [(k, i, middle, *point, s, p, e) for i in pulled]
        names = named(cls.kind, [f.name for f in forces], ["attractor"] * len(forces))
        return AttractorForces(names, np.array(rows).reshape(-1, 9), world.mass)


class AttractorForces(ForceTable):
    """Attractors: one row for each attracted body, and one for its opposite on a body that attracts."""

    def __init__(self, names: list[str], rows: np.ndarray, mass: np.ndarray) -> None:
        """rows (k, 9): attractor, attracted body, centre body or -1, point (3), strength, power, softening."""
        self.kind, self.names = PointAttractor.kind, names
        body, middle = rows[:, 1].astype(np.int64), rows[:, 2].astype(np.int64)
        back = middle >= 0
        self.body = np.concatenate([body, middle[back]])
        self._line = np.concatenate([np.arange(len(body)), np.flatnonzero(back)])
        self._sign = np.concatenate([np.ones(len(body)), -np.ones(int(back.sum()))])
        self.cause = rows[self._line, 0].astype(np.int64)
        self.links, self.is_steady = np.column_stack([body[back], middle[back]]), True
        self.reason = f"on {len(np.unique(body))} bodies"
        self._pulled, self._middle, self._point = body, middle, rows[:, 3:6]
        self._strength, self._power, self._square = rows[:, 6], rows[:, 7], rows[:, 8] ** 2
        self._mass = mass

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force of rows."""
        k = self._line[rows]
        r = self._arm(k, at.bodies.position)
        distance = (r**2).sum(axis=-1) + self._square[k]
        pull = self._mass[self._pulled[k]] * self._strength[k] * power(distance, -0.5 * (self._power[k] + 1.0))
        return np.hstack([-(self._sign[rows] * pull)[:, None] * r, np.zeros((len(rows), 3))])

    def potential(self, times: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Potential energy of each attractor (f, attractors)."""
        k = np.arange(len(self._pulled))
        distance = (self._arm(k, position) ** 2).sum(axis=-1) + self._square
        p = np.where(self._power == 1.0, 2.0, self._power)
        energy = np.where(
            self._power == 1.0, 0.5 * np.log(distance), -(power(distance, 0.5 * (1.0 - p))) / (p - 1.0)
        )
        total = np.zeros((len(self.names), len(times)))
        np.add.at(total, self.cause[k], (self._mass[self._pulled] * self._strength * energy).T)
        return total.T

    def _arm(self, k: np.ndarray, position: np.ndarray) -> np.ndarray:
        """Arms (..., k, 3) from centres to the attracted; position (..., n, 3)."""
        here = position[..., self._pulled[k], :]
        free = (self._middle[k] < 0)[:, None]
        return here - np.where(free, self._point[k], position[..., self._middle[k], :])
