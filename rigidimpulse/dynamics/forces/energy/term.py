"""Energy terms on the poses of bodies: what each gives, and how they add up.

    V = sum of the terms,    V(x + d, exp(t) q) = V + g.s + s.H s / 2 + ...,    s = (d_1, t_1, d_2, t_2, ...)

x are centres of mass, q orientations of principal axes, d (3,) m translations and t (3,) rad rotation vectors, both along the axes of the
world. The gradient g holds minus the force [N] and minus the torque about the centre of mass [N m] of each body.

A point of a body at the arm c from its centre of mass goes to x + d + c + t x c + t x (t x c) / 2, so an energy whose derivative by
that point is f has the rotational part  c x f  of the gradient and  (f c' + c f') / 2 - (f.c) 1  of the second derivatives.

Source of the idea: A. Witkin, K. Fleischer, A. Barr, Energy constraints on parameterized models, SIGGRAPH 1987.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from scipy.sparse import coo_array, csc_array

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.quaternion import rotate_inverse, to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.model.world import World
from rigidimpulse.scene.body import number

FLAT = TOLERANCES.energy.flat_curvature


class Poses(NamedTuple):
    """Where n bodies are."""

    position: np.ndarray  # (n, 3) m, centres of mass
    orientation: np.ndarray  # (n, 4) principal axes
    rotation: np.ndarray  # (n, 3, 3) the same as matrices


def poses(position: np.ndarray, orientation: np.ndarray) -> Poses:
    """Return the poses of centres of mass (n, 3) m and orientations of principal axes (n, 4)."""
    return Poses(position, orientation, to_matrix(orientation))


class Expansion:
    """Value, gradient and second derivatives of a sum of terms.

    Attributes:
        value: J. magnitude: sum of the absolute values of the terms, J, which bounds the rounding of `value`.
        gradient: (n, 6) N and N m, minus force and torque of each body.

    """

    def __init__(self, num_bodies: int) -> None:
        """Start with nothing."""
        self.value = self.magnitude = 0.0
        self.gradient = np.zeros((num_bodies, 6))
        self._blocks: list[tuple[np.ndarray, np.ndarray]] = []

    def add(self, value: float, bodies: np.ndarray, gradient: np.ndarray, hessian: np.ndarray | None = None) -> None:
        """Add a term.

        Args:
            value: J.
            bodies: (b,) indices, each once.
            gradient: (b, 6). hessian: (6 b, 6 b); None for a term that is linear in translations.

        """
        self.value += value
        self.magnitude += abs(value)
        self.gradient[bodies] += gradient
        if hessian is not None:
            self._blocks.append(((6 * bodies[:, None] + np.arange(6)).ravel(), hessian))

    def hessian(self) -> csc_array:
        """Return the second derivatives (6 n, 6 n)."""
        size = self.gradient.size
        if not self._blocks:
            return csc_array((size, size))
        rows = np.concatenate([np.repeat(at, len(at)) for at, _ in self._blocks])
        columns = np.concatenate([np.tile(at, len(at)) for at, _ in self._blocks])
        entries = np.concatenate([block.ravel() for _, block in self._blocks])
        return coo_array((entries, (rows, columns)), shape=(size, size)).tocsc()


class CompiledEnergy(Protocol):
    """A term bound to a compiled scene: what runs and minimisers read."""

    def expand(self, at: Poses, total: Expansion) -> None:
        """Add the term at some poses to a sum."""
        ...


class Energy(Protocol):
    """A term as people write it: a frozen dataclass of settings."""

    def compile(self, world: World) -> CompiledEnergy:
        """Check the term and bind it to a compiled scene; a `SceneError` says what is wrong."""
        ...


def body_index(world: World, name: str | None, where: str) -> int:
    """Return the index of a body, -1 for None, the world. Raises SceneError for an unknown name."""
    if name is None:
        return -1
    if name not in world.names:
        raise unknown_name("body", name, world.names, where)
    return world.names.index(name)


def body_indices(world: World, names: Sequence[str], where: str) -> np.ndarray:
    """Return the indices (b,) of bodies. Raises SceneError for a name that is unknown or there twice."""
    if isinstance(names, str):
        raise SceneError(f"bodies is the text {names!r}", f"give a list of names: [{names!r}]", where)
    indices = [body_index(world, name, where) for name in names]
    if len(set(indices)) < len(indices) or -1 in indices:
        raise SceneError(f"bodies are {list(names)!r}", "name bodies of the scene, each once", where)
    return np.array(indices, np.int64)


def positive(value: float, name: str, unit: str, where: str) -> float:
    """Return a value as a finite number above 0, or raise a `SceneError`."""
    try:
        result = number(value, name, unit)
        if result <= 0.0:
            raise SceneError(f"{name} is {value!r}", f"give a number > 0, in {unit}")
    except SceneError as error:
        raise error.within(where) from None
    return result


def body_point(world: World, body: int, anchor: np.ndarray) -> np.ndarray:
    """Return a point (3,) m, given in the world at the start, from the centre of mass along principal axes of its body (-1: as it is)."""
    return anchor if body < 0 else rotate_inverse(world.orientation[body], anchor - world.position[body])


def cross_matrix(c: np.ndarray) -> np.ndarray:
    """Return the matrices (..., 3, 3) with which c (..., 3) multiplies vectors from the left: C t = c x t."""
    out = np.zeros((*c.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -c[..., 2], c[..., 1], -c[..., 0]
    return out - np.swapaxes(out, -1, -2)


def levers(c: np.ndarray) -> np.ndarray:
    """Return the motions (..., 3, 6) of points at the arms c (..., 3) by translation and rotation of their body."""
    return np.concatenate([np.broadcast_to(np.eye(3), (*c.shape, 3)), -cross_matrix(c)], axis=-1)


def turning(c: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return the second derivatives (..., 3, 3) by rotation of points at the arms c (..., 3), f (..., 3) the derivatives of the energy."""
    product = f[..., :, None] * c[..., None, :]
    return 0.5 * (product + np.swapaxes(product, -1, -2)) - np.sum(f * c, axis=-1)[..., None, None] * np.eye(3)


def eliminated(hessian: np.ndarray, kept: int) -> np.ndarray:
    """Return the second derivatives (kept, kept) of the minimum over all variables but the first `kept`, taken where they are at it."""
    mixed = hessian[kept:, :kept]
    curvature, axes = np.linalg.eigh(hessian[kept:, kept:])
    stiff = curvature > FLAT * max(float(curvature[-1]), 0.0)
    along = axes[:, stiff].T @ mixed
    return hessian[:kept, :kept] - along.T @ (along / curvature[stiff, None])
