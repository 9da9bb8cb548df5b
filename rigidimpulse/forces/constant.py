"""Constant forces at centres of mass.

    a = g + sum F / m,    V = -sum F . x,    impulse over a time T: F T

The acceleration is as uniform as gravity's, so paths between impacts stay parabolas and the rotation stays free: exact, without
an integrator (law B1 of impulse and momentum: the impulse of a constant force is F T).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.body import vector
from rigidimpulse.errors import SceneError, unknown_name
from rigidimpulse.plan import Bound, Skip


@dataclass(frozen=True, eq=False)
class ConstantForce:
    """A force that keeps its strength and its direction in the world and acts at the centre of mass of a dynamic body.

    `Scene.add` takes it; it is checked when the scene is compiled: a `SceneError` names the body where it is unknown or not
    dynamic, where the force is not three finite numbers, and where a `point` is given. The torque of a force at a point of the
    body would turn with the body, and the course of a body is exact for torques that are constant in the world only.

    Attributes:
        body: name of the body.
        force: (3,) N, world frame.
        point: None, the centre of mass; any other point is refused.

    """

    body: str
    force: ArrayLike
    point: ArrayLike | None = None
    stage: ClassVar[str] = "forces"

    def bind(self, _world) -> Skip:
        """Constant forces are one line of the plan, not one each."""
        return Skip("a constant force; see constant forces")


@dataclass(frozen=True)
class ConstantForces:
    """Acceleration of the group's bodies by all constant forces."""

    stage: str = "forces"
    name: str = "constant forces"

    def bind(self, world) -> Bound | Skip:
        """In where a force that is not zero acts."""
        if not np.any(world.push):
            return Skip("no constant force acts")

        def push(context, group) -> None:
            context.acceleration[group.members] += world.push[group.members]

        pushed = [world.names[i] for i in np.flatnonzero(world.push.any(axis=1))]
        named = f"{pushed[0]!r}" if len(pushed) == 1 else f"{len(pushed)} bodies"
        return Bound(push, f"on {named} at the centre of mass: paths stay parabolas")


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
        if force.point is not None:
            raise SceneError(
                f"point is {force.point!r}: its torque would turn with the body, which no path in closed form follows",
                "leave the point out: the force then acts at the centre of mass", where,
            )  # fmt: skip
        try:
            total[i] += vector(force.force, "force", "N")
        except SceneError as error:
            raise error.within(where) from None
    return inv_mass[:, None] * total
