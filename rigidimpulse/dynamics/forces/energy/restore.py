"""A set of bodies that keeps its layout up to a common rigid motion: shape matching.

    V = min over T = (R, t) of  k/2 sum_i <|p - T p0|^2>_i,    <|p - T p0|^2>_i = |x_i - R x0_i - t|^2 + s_i |R_i - R R0_i|^2

x0_i, R0_i is the layout wanted, <>_i the mean over the sphere of radius rho_i around body i, the smallest about its centre of mass that
holds it, so s_i = rho_i^2 / 3 with the sum of squares of matrix entries. The best motion is that of Kabsch (Acta Cryst. A32, 1976):

    t = mean of x_i - R x0_i,    R = U diag(1, 1, det U V') V'    from    U S V' = sum_i (x_i - mean x) (x0_i - mean x0)' + s_i R_i R0_i'

As V is at its least in T, its gradient is that at fixed T: forces -k (x_i - R x0_i - t), torques likewise, which sum up to nothing; the
second derivatives are those of V(x, T) with T eliminated. Source: M. Müller, B. Heidelberger, M. Teschner, M. Gross, Meshless deformations
based on shape matching, SIGGRAPH 2005.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import multiply, normalize, rotate, to_matrix
from rigidimpulse.dynamics.forces.energy.term import Expansion, Poses, body_indices, eliminated, levers, positive, turning
from rigidimpulse.model.world import World


@dataclass(frozen=True, eq=False)
class RestoreShape:
    """Lets a set of bodies keep its layout, up to a rigid motion of all: V = k/2 sum of mean squares of their points' displacements.

    Checked when it is used: a `SceneError` names unknown bodies, fewer than two, half spaces, bad numbers.

    Attributes:
        bodies: names; static ones may be among them.
        weight: k, N/m.
        positions: (b, 3) m of the bodies' origins, orientations: (b, 4), (w, x, y, z): the layout. None: as in the scene given.

    Source: Müller, Heidelberger, Teschner, Gross 2005; see the head of the module.
    """

    bodies: Sequence[str]
    weight: float = 1.0
    positions: ArrayLike | None = None
    orientations: ArrayLike | None = None

    def compile(self, world: World) -> CompiledShapeMatch:
        """Bind the set to a compiled scene."""
        where = f"RestoreShape({list(self.bodies)!r})"
        bodies = body_indices(world, self.bodies, where)
        weight = positive(self.weight, "weight", "N/m", where)
        if len(bodies) < 2:
            raise SceneError(f"it has {len(bodies)} bodies", "name two or more", where)
        radius = world.bound_radius[bodies]
        if not np.all(np.isfinite(radius)):
            name = world.names[bodies[np.argmax(radius)]]
            raise SceneError(f"body {name!r} is a half space, which has no size", "leave it out", where)
        position, orientation = _layout(self, world, bodies, where)
        return CompiledShapeMatch(bodies, weight, radius**2 / 3.0, position - position.mean(0), to_matrix(orientation))


def _layout(term: RestoreShape, world: World, bodies: np.ndarray, where: str) -> tuple[np.ndarray, np.ndarray]:
    """Return centres of mass (b, 3) and principal orientations (b, 4) of the layout wanted."""
    starts = [world.body_pose(i, world.position[i], world.orientation[i]) for i in bodies.tolist()]
    origin, orientation = (np.array(part) for part in zip(*starts, strict=True))
    for name, value, entry in (("positions", term.positions, 3), ("orientations", term.orientations, 4)):
        if value is None:
            continue
        try:
            given = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            given = np.array(np.nan)
        zero = entry == 4 and given.ndim == 2 and not np.all(np.any(given, axis=1))
        if given.shape != (len(bodies), entry) or not np.all(np.isfinite(given)) or zero:
            what = "finite numbers" if entry == 3 else "quaternions (w, x, y, z)"
            raise SceneError(f"{name} are {value!r}", f"give {what} ({len(bodies)}, {entry}), one row a body", where)
        if entry == 3:
            origin = given
        else:
            orientation = normalize(given)
    return origin + rotate(orientation, world.offset[bodies]), multiply(orientation, world.turn[bodies])


@dataclass(frozen=True, eq=False)
class CompiledShapeMatch:
    """A set: bodies (b,), k, s (b,) m^2, x0 - mean x0 (b, 3) m, R0 (b, 3, 3)."""

    bodies: np.ndarray
    weight: float
    spread: np.ndarray
    place: np.ndarray
    axes: np.ndarray

    def motion(self, at: Poses) -> np.ndarray:
        """Return R (3, 3) of the best common motion."""
        x = at.position[self.bodies]
        product = (x - x.mean(0)).T @ self.place
        product += np.einsum("b,bij,bkj->ik", self.spread, at.rotation[self.bodies], self.axes)
        u, _, v = np.linalg.svd(product)
        return u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v

    def expand(self, at: Poses, total: Expansion) -> None:
        """Add the set to a sum."""
        number, k = len(self.bodies), self.weight
        R, x, turned = self.motion(at), at.position[self.bodies], at.rotation[self.bodies]
        wanted = R @ self.axes
        c = self.place @ R.T
        r = x - x.mean(0) - c
        value = 0.5 * k * float(np.sum(r * r) + np.sum(self.spread * np.sum((turned - wanted) ** 2, axis=(1, 2))))
        Q = turned @ np.swapaxes(wanted, 1, 2)
        twist = np.stack([Q[:, 2, 1] - Q[:, 1, 2], Q[:, 0, 2] - Q[:, 2, 0], Q[:, 1, 0] - Q[:, 0, 1]], axis=1)
        gradient = k * np.concatenate([r, self.spread[:, None] * twist], axis=1)
        # Variables: the bodies', then those of T: t, and the rotation that multiplies R from the left.
        hessian = np.zeros((6 * number + 6,) * 2)
        common = slice(6 * number, None)
        stiff = k * self.spread[:, None, None] * (np.trace(Q, axis1=1, axis2=2)[:, None, None] * np.eye(3) - Q)
        away = levers(c)
        hessian[common, common] = k * np.einsum("bij,bik->jk", away, away)
        hessian[common, common][3:, 3:] += np.sum(0.5 * (stiff + np.swapaxes(stiff, 1, 2)) - turning(c, k * r), axis=0)
        for i in range(number):
            own = slice(6 * i, 6 * i + 6)
            hessian[own, own][:3, :3] = k * np.eye(3)
            hessian[own, own][3:, 3:] = 0.5 * (stiff[i] + stiff[i].T)
            hessian[common, own][:, :3] = -k * away[i].T
            hessian[common, own][3:, 3:] = -stiff[i]
            hessian[own, common] = hessian[common, own].T
        total.add(value, self.bodies, gradient, eliminated(hessian, 6 * number))
