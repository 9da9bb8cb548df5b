"""Harmonic forces.

    F(t) = A d sin(w t + phi),  w = 2 pi f,    impulse over a time T, phi = 0:  A d (1 - cos w T) / w
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.portable import sine
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.forces.force import Force, body_point, checked_direction, checked_number, checked_vector, dynamic_body, named
from rigidimpulse.dynamics.forces.timed import TimedForces
from rigidimpulse.model.world import World

PART_OF_PERIOD = 0.25
"""Longest step in periods: at its ends and middle, where forces are taken, a force of a period or a half is zero or as at the start."""
TINY = TOLERANCES.arithmetic.least_divisor


@dataclass(frozen=True, eq=False)
class HarmonicForce(Force):
    """A force that goes to and fro along a direction of the world: A sin(2 pi f t + phase).

    Checked when the scene is compiled: a `SceneError` names a body that is unknown or not dynamic, and numbers that are not finite.

    Attributes:
        body: name of the body.
        amplitude: A, N.
        frequency: f, Hz: cycles a second. From an angular frequency w [rad/s]: w / (2 pi).
        direction: (3,) of the force in the world; its length does not matter.
        phase: rad.
        point: (3,) m, where it acts, in world coordinates at the start; it moves with the body. None: the centre of mass.
        name: what the ledger calls it; None makes one of the body's name.

    """

    body: str
    amplitude: float
    frequency: float
    direction: ArrayLike
    phase: float = 0.0
    point: ArrayLike | None = None
    name: str | None = None
    kind: ClassVar[str] = "harmonic forces"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> TimedForces:
        """Check and bind all harmonic forces."""
        body, points, amplitude, rate, phase = [], [], [], [], []
        for force in forces:
            where = f"HarmonicForce({force.body!r})"
            i = dynamic_body(world, force.body, where)
            body.append(i)
            amplitude.append(checked_number(force.amplitude, "amplitude", "N", where) * checked_direction(force.direction, where))
            rate.append(2.0 * np.pi * checked_number(force.frequency, "frequency", "Hz", where))
            phase.append(checked_number(force.phase, "phase", "rad", where))
            point = world.position[i] if force.point is None else checked_vector(force.point, "point", "m", where)
            points.append(body_point(world, i, point))
        a, w, phi = np.array(amplitude), np.array(rate), np.array(phase)
        names = named(cls.kind, [f.name for f in forces], [f"harmonic force on {f.body}" for f in forces])
        longest = PART_OF_PERIOD * 2.0 * np.pi / np.maximum(np.abs(w), TINY)
        return TimedForces(cls.kind, names, body, points, partial(_strength, a, w, phi), f"{len(forces)} acting", longest=longest)


def _strength(a: np.ndarray, w: np.ndarray, phi: np.ndarray, time: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """a sin(w t + phi) of rows, (r, 3) N."""
    return sine(w[rows] * time + phi[rows])[:, None] * a[rows]
