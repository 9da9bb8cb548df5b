"""Constant forces.

    a = g + sum F / m,    V = -sum F . x,    impulse over a time T: F T

The acceleration is as uniform as gravity's, so paths between impacts stay parabolas and the rotation stays free: exact, without
an integrator (law B1 of impulse and momentum: the impulse of a constant force is F T). So much for forces at centres of mass; those at
points of a body, and those on a body that loses mass, vary (see `varying`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.scene.body import vector
from rigidimpulse.scene.effect import SceneEffect

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.force import ForceTable
    from rigidimpulse.model.world import World


@dataclass(frozen=True, eq=False)
class ConstantForce(SceneEffect):
    """A force that keeps its strength and its direction in the world and acts on a dynamic body.

    `Scene.add` takes it; it is checked when the scene is compiled: a `SceneError` names the body where it is unknown or not
    dynamic, and where the force or the point is not three finite numbers. At the centre of mass paths stay parabolas, exactly; at a
    point of the body the torque turns with it, and a numerical integrator comes in.

    Attributes:
        body: name of the body.
        force: (3,) N, world frame.
        point: (3,) m, where it acts, in world coordinates at the start; it moves with the body. None: the centre of mass.

    """

    body: str
    force: ArrayLike
    point: ArrayLike | None = None
    stage: ClassVar[str] = "forces"
    kind: ClassVar[str] = "forces at points"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> ForceTable:
        """Check and bind forces whose torque or effect varies: those at points, and those on bodies that lose mass."""
        from rigidimpulse.dynamics.forces.force import body_point, checked_vector, dynamic_body, named
        from rigidimpulse.dynamics.forces.timed import TimedForces

        body, points, strength = [], [], []
        for force in forces:
            where = f"ConstantForce({force.body!r})"
            i = dynamic_body(world, force.body, where)
            body.append(i)
            strength.append(checked_vector(force.force, "force", "N", where))
            point = world.position[i] if force.point is None else checked_vector(force.point, "point", "m", where)
            points.append(body_point(world, i, point))
        value = np.array(strength)
        names = named(cls.kind, [None] * len(forces), [f"constant force on {f.body}" for f in forces])
        table = TimedForces(cls.kind, names, body, points, partial(_strength, value), f"{len(forces)} acting")
        table.is_steady = True
        return table


def _strength(value: np.ndarray, _time: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The same at all times, (r, 3) N."""
    return value[rows]


def push_of_forces(forces: Sequence[ConstantForce], names: list[str], inv_mass: np.ndarray) -> np.ndarray:
    """Accelerations (n, 3) m/s^2, sum F / m, of n bodies of inverse mass (n,) 1/kg, 0 for those that are not dynamic.

    Raises:
        SceneError: unknown body, one that is not dynamic, bad numbers, a point; names the force's body.

    """
    total = np.zeros((len(names), 3))
    for force in forces:
        where = f"ConstantForce({force.body!r})"
        if force.body not in names:
            raise unknown_name("body", force.body, names, where)
        i = names.index(force.body)
        if inv_mass[i] == 0.0:
            raise SceneError(f"body {force.body!r} is not dynamic", "a force moves dynamic bodies only: name one of them", where)
        try:
            total[i] += vector(force.force, "force", "N")
        except SceneError as error:
            raise error.within(where) from None
    return inv_mass[:, None] * total
