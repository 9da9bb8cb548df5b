"""Thrusters.

    thrust F = u q d,  m' = -q   while the propellant p lasts, p / q

u exhaust velocity, q mass flow, d direction in the body. Without other forces (Tsiolkovsky 1903), m_0 with the propellant:

    v(t) = v_0 + u ln(m_0 / (m_0 - q t)),    x(t) = u [t - (m_0 / q - t) ln(m_0 / (m_0 - q t))]

Specific impulse: u, or u / g in seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import rotate_inverse
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.forces.force import (
    Force,
    Instant,
    body_point,
    checked_direction,
    checked_number,
    checked_vector,
    dynamic_body,
    named,
    no_links,
)
from rigidimpulse.dynamics.forces.mass_flow import BurningForces
from rigidimpulse.model.world import World


@dataclass(frozen=True, eq=False)
class Thruster(Force):
    """A rocket motor: thrust in a direction of the body while it throws mass out the other way.

    The body's mass at the start holds the propellant, all over the body: its inertia falls in proportion, its centre of mass stays. Where
    it moves, make the tank a body of its own, fixed to the others by a `FixedJoint`; a stage that drops is a joint with a `release_time`.

    Checked when the scene is compiled: a `SceneError` names a body that is unknown or not dynamic, numbers that are not positive, and
    propellant that is not less than the mass of the body.

    Attributes:
        body: name of the body.
        exhaust_velocity: u, m/s, relative to the body.
        mass_flow: q, kg/s.
        direction: (3,) of the thrust, in world coordinates at the start; it turns with the body. Its length does not matter.
        propellant: p, kg.
        start: s, when it is lit.
        point: (3,) m, where the thrust acts, in world coordinates at the start; it moves with the body. None: the centre of mass.
        name: what the ledger calls it; None makes one of the body's name.

    """

    body: str
    exhaust_velocity: float
    mass_flow: float
    direction: ArrayLike
    propellant: float
    start: float = 0.0
    point: ArrayLike | None = None
    name: str | None = None
    kind: ClassVar[str] = "thrusters"
    takes_mass: ClassVar[bool] = True

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> ThrusterForces:
        """Check and bind all thrusters."""
        rows, taken = [], np.zeros(world.num_bodies)
        for force in forces:
            where = f"Thruster({force.body!r})"
            i = dynamic_body(world, force.body, where)
            speed, flow, propellant = (
                checked_number(value, name, unit, where)
                for value, name, unit in (
                    (force.exhaust_velocity, "exhaust_velocity", "m/s"), (force.mass_flow, "mass_flow", "kg/s"),
                    (force.propellant, "propellant", "kg"),
                )
            )  # fmt: skip
            for value, name in ((speed, "exhaust_velocity"), (flow, "mass_flow"), (propellant, "propellant")):
                if value <= 0.0:
                    raise SceneError(f"{name} is {value!r}", "give a number > 0", where)
            taken[i] += propellant
            if taken[i] >= world.mass[i]:
                raise SceneError(
                    f"its propellant, {taken[i]:g} kg with that of others, is not less than the mass of the body, {world.mass[i]:g} kg",
                    "the mass of the body includes the propellant: give it more", where,
                )  # fmt: skip
            start = checked_number(force.start, "start", "s", where)
            along = rotate_inverse(world.orientation[i], checked_direction(force.direction, where))
            point = world.position[i] if force.point is None else checked_vector(force.point, "point", "m", where)
            rows.append((i, *along, *body_point(world, i, point), speed * flow, flow, start, start + propellant / flow))
        names = named(cls.kind, [f.name for f in forces], [f"thruster of {f.body}" for f in forces])
        return ThrusterForces(names, np.array(rows, float))


class ThrusterForces(BurningForces):
    """Thrusters (k,), each on one body."""

    def __init__(self, names: list[str], rows: np.ndarray) -> None:
        """rows (k, 11): body, direction (3) and point (3) along principal axes, thrust, flow, start, end."""
        self.kind, self.names = Thruster.kind, names
        self.body, self.cause = rows[:, 0].astype(np.int64), np.arange(len(rows))
        self.links, self.is_steady = no_links(), False
        self.reason = f"{len(rows)} burning, from {rows[:, 9].min():g} s to {rows[:, 10].max():g} s"
        self._along, self._point = rows[:, 1:4], rows[:, 4:7]
        self._thrust, self._flow, self._start, self._end = rows[:, 7:11].T
        self._breaks = np.unique(rows[:, 9:11])

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force and torque of rows."""
        i = self.body[rows]
        burns = (at.time[i] >= self._start[rows]) & (at.time[i] < self._end[rows])
        force = np.einsum("ijk,ik->ij", at.rotation[i], self._along[rows] * (self._thrust[rows] * burns)[:, None])
        arm = np.einsum("ijk,ik->ij", at.rotation[i], self._point[rows])
        return np.hstack([force, cross_arrays(arm, force)])

    def burnt(self, times: np.ndarray) -> np.ndarray:
        """Propellant used."""
        return self._flow * np.clip(times - self._start, 0.0, self._end - self._start)

    def next_break(self, time: float) -> float:
        """Next start or end of burning."""
        k = int(np.searchsorted(self._breaks, time, side="right"))
        return float(self._breaks[k]) if k < len(self._breaks) else np.inf
