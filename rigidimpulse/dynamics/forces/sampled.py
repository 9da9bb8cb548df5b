"""Forces given by a table.

    F(t) linear between the samples (t_j, F_j), zero before the first and after the last one

The impulse is the trapezium rule's, exactly: sum of (t_j+1 - t_j)(F_j + F_j+1) / 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.dynamics.forces.force import Force, body_point, checked_vector, dynamic_body, named
from rigidimpulse.dynamics.forces.timed import TimedForces
from rigidimpulse.model.world import World


@dataclass(frozen=True, eq=False)
class SampledForce(Force):
    """A force measured at times, linear between them, zero outside of them: a thrust curve, the force of a hammer.

    Checked when the scene is compiled: a `SceneError` names a body that is unknown or not dynamic, times that do not increase and arrays
    that are not finite or of unlike length.

    Attributes:
        body: name of the body.
        times: (k,) s, increasing.
        forces: (k, 3) N, in the world.
        point: (3,) m, where it acts, in world coordinates at the start; it moves with the body. None: the centre of mass.
        name: what the ledger calls it; None makes one of the body's name.

    """

    body: str
    times: ArrayLike
    forces: ArrayLike
    point: ArrayLike | None = None
    name: str | None = None
    kind: ClassVar[str] = "sampled forces"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> TimedForces:
        """Check and bind all sampled forces."""
        body, points, tables = [], [], []
        for force in forces:
            where = f"SampledForce({force.body!r})"
            i = dynamic_body(world, force.body, where)
            body.append(i)
            tables.append(_table(force.times, force.forces, where))
            point = world.position[i] if force.point is None else checked_vector(force.point, "point", "m", where)
            points.append(body_point(world, i, point))
        names = named(cls.kind, [f.name for f in forces], [f"sampled force on {f.body}" for f in forces])
        breaks = np.unique(np.concatenate([t for t, _ in tables]))
        return TimedForces(cls.kind, names, body, points, partial(_strength, tables), f"{len(forces)} acting", breaks)


def _table(times: ArrayLike, forces: ArrayLike, where: str) -> tuple[np.ndarray, np.ndarray]:
    try:
        t, f = np.asarray(times, float), np.asarray(forces, float)
    except (TypeError, ValueError):
        t, f = np.zeros(0), np.zeros(0)
    if t.ndim != 1 or len(t) < 2 or f.shape != (len(t), 3) or not (np.all(np.isfinite(t)) and np.all(np.isfinite(f))):
        raise SceneError(
            f"times have the shape {np.shape(times)}, forces {np.shape(forces)}", "give finite arrays (k,) and (k, 3), k >= 2", where
        )
    if np.any(np.diff(t) <= 0.0):
        raise SceneError("times do not increase", "sort the samples; give two samples of a jump times that differ", where)
    return t, f


def _strength(tables: list[tuple[np.ndarray, np.ndarray]], time: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Forces of rows, (r, 3) N."""
    return np.array([_at(tables[r], t) for t, r in zip(time.tolist(), rows.tolist(), strict=True)]).reshape(-1, 3)


def _at(table: tuple[np.ndarray, np.ndarray], t: float) -> np.ndarray:
    """Linear between samples, 0 outside."""
    times, forces = table
    if not times[0] <= t <= times[-1]:
        return np.zeros(3)
    return np.array([np.interp(t, times, forces[:, k]) for k in range(3)])
