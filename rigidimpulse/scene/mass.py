"""Mass, centre of mass and inertia of bodies.

A solid of density rho has the mass m = rho V, and about its centre of mass the inertia rho I, with V and I of `solid`.

Principal axes: Jacobi rotations, which keep axes close to the body's own and are accurate to the last digits for each
moment, however unequal they are (J. Demmel & K. Veselic, SIAM J. Matrix Anal. Appl. 13 (1992)).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.portable import matmul
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.solid import parallel_axes

_JACOBI_SWEEPS = 30  # convergence is quadratic: 4 to 6 sweeps are enough for any 3 x 3 matrix
_JACOBI_CONVERGED = TOLERANCES.inertia.jacobi_converged


@dataclass(frozen=True, eq=False)
class BodyMass:
    """Mass properties of a body, and its principal frame: x_body = center_of_mass + axes @ x_principal."""

    mass: float  # kg; inf if the body is not dynamic
    center_of_mass: np.ndarray  # (3,) m, body frame
    inertia: np.ndarray  # (3, 3) kg m^2, about the centre of mass, body axes; inf on the diagonal if not dynamic
    moments: np.ndarray  # (3,) kg m^2, about the principal axes, in the order of the columns of `axes`
    axes: np.ndarray  # (3, 3) proper rotation, its columns are the principal axes in the body frame

    @cached_property
    def turn(self) -> np.ndarray:
        """(4,) quaternion of the axes."""
        from rigidimpulse.core.quaternion import from_matrix  # numba comes with it

        return from_matrix(self.axes)


MOST_KNOWN: int = 1000
"""Bodies whose masses are kept for those that are alike, also of the next scenes."""
_KNOWN: dict[tuple, BodyMass] = {}


def body_mass(body: Body) -> BodyMass:
    """Return the mass properties of a body: its own figures where given, else those of its shape and density.

    `mass` alone scales the shape's inertia. `center_of_mass` alone moves the point about which the shape's inertia is
    taken (parallel axes). A static body's frame is its body frame, a kinematic body turns about its centre of mass
    with its axes as drawn; neither needs a solid shape.

    Raises:
        SceneError: the shape is no solid and the figures do not make up for it, or the inertia is none of a body.

    """
    try:
        if not body.becomes_dynamic:
            infinite = np.full(3, np.inf)
            return BodyMass(np.inf, _frame_origin(body), np.diag(infinite), infinite, np.eye(3))
        return _dynamic_mass(body)
    except SceneError as error:
        raise error.within(f"body {body.name!r}") from None


def masses_of(bodies: Iterable[Body]) -> list[BodyMass]:
    """Return the mass properties of bodies, the same for those that are alike; errors are those of `body_mass`."""
    masses = []
    for body in bodies:
        given = (None if value is None else np.asarray(value, float).tobytes() for value in (body.mass, body.inertia, body.center_of_mass))
        key = (body.shape.key, body.motion, body.becomes_dynamic, body.material.density, *given)
        mass = _KNOWN.get(key)
        if mass is None:
            if len(_KNOWN) >= MOST_KNOWN:
                _KNOWN.clear()
            mass = _KNOWN[key] = body_mass(body)
        masses.append(mass)
    return masses


def principal_axes(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return principal moments (3,) and axes (3, 3, columns, a proper rotation) of a symmetric tensor.

    Moments equal within `equal_moments` (see `core.tolerances.Inertia`) are made equal; a tensor that is diagonal within
    `diagonal`, or has three equal moments, keeps the axes it is given in.
    """
    tensor = 0.5 * (inertia + inertia.T)
    axes = np.eye(3)
    largest = float(np.max(np.abs(np.diag(tensor))))
    if _off_diagonal(tensor) > TOLERANCES.inertia.diagonal * largest:
        for _ in range(_JACOBI_SWEEPS):
            if _off_diagonal(tensor) <= _JACOBI_CONVERGED * largest:
                break
            for p, q, r in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
                _jacobi_rotate(tensor, axes, p, q, r)
    moments = _equalized(np.diag(tensor).copy())
    if moments[0] == moments[1] == moments[2]:
        axes = np.eye(3)
    return moments, axes


def _dynamic_mass(body: Body) -> BodyMass:
    """Return the mass properties of a dynamic body."""
    given = (body.mass is not None, body.inertia is not None, body.center_of_mass is not None)
    if all(given):
        body.shape.check()
        mass, center, tensor = float(body.mass), np.array(body.center_of_mass, float), None  # type: ignore[arg-type]
    else:
        try:
            solid = body.shape.solid()
        except SceneError as error:
            missing = [n for n, has in zip(("mass", "inertia", "center_of_mass"), given, strict=True) if not has]
            remedy = f"{error.remedy}, or give {', '.join(name + '=' for name in missing)}"
            raise SceneError(error.problem, remedy, error.where) from None
        mass = solid.volume * float(body.material.density) if body.mass is None else float(body.mass)
        center = solid.centroid if body.center_of_mass is None else np.array(body.center_of_mass, dtype=np.float64)
        tensor = mass / solid.volume * parallel_axes(solid.inertia, solid.volume, center - solid.centroid)
    if body.inertia is not None:
        tensor = _given_inertia(np.asarray(body.inertia, dtype=np.float64))
    assert tensor is not None
    if not (math.isfinite(mass) and mass > 0.0 and np.all(np.isfinite(tensor))):
        raise SceneError(f"its mass comes out as {mass} kg", "check its size (metres), density (kg/m^3) and mass")
    moments, axes = principal_axes(tensor)
    _check_moments(moments)
    return BodyMass(mass, center, tensor, moments, axes)


def _frame_origin(body: Body) -> np.ndarray:
    """Return the centre of mass of a body that is not dynamic, its origin if it is static or its shape is no solid."""
    body.shape.check()
    if body.motion == "static":
        return np.zeros(3)
    if body.center_of_mass is not None:
        return np.array(body.center_of_mass, dtype=np.float64)
    try:
        return body.shape.solid().centroid
    except SceneError:
        return np.zeros(3)


def _given_inertia(inertia: np.ndarray) -> np.ndarray:
    """Return a given inertia, (3,) or (3, 3), as a symmetric tensor."""
    if inertia.shape == (3,):
        return np.diag(inertia)
    if np.max(np.abs(inertia - inertia.T)) > TOLERANCES.inertia.symmetric * np.max(np.abs(inertia)):
        raise SceneError(f"inertia {inertia.tolist()} is not symmetric", "give a symmetric tensor in kg m^2")
    return 0.5 * (inertia + inertia.T)


def is_possible(moments: np.ndarray) -> bool:
    """Return whether a body can have principal moments of inertia (3,), within the rounding of given figures."""
    small, middle, large = sorted(float(moment) for moment in moments)
    return small > TOLERANCES.inertia.least_moment * large and small + middle >= large * (1.0 - TOLERANCES.inertia.realizable)


def _check_moments(moments: np.ndarray) -> None:
    """Raise a `SceneError` for moments that no body has."""
    if is_possible(moments):
        return
    small, large = float(min(moments)), float(max(moments))
    if small <= TOLERANCES.inertia.least_moment * large:
        raise SceneError(f"principal moments of inertia are {moments.tolist()} kg m^2", "all must be > 0")
    raise SceneError(
        f"principal moments of inertia are {moments.tolist()} kg m^2",
        "no body has one above the sum of the other two: check inertia=, which is about the centre of mass",
    )


def _off_diagonal(tensor: np.ndarray) -> float:
    return float(max(abs(tensor[0, 1]), abs(tensor[0, 2]), abs(tensor[1, 2])))


def _jacobi_rotate(tensor: np.ndarray, axes: np.ndarray, p: int, q: int, r: int) -> None:
    """Turn tensor and axes, in place, by the smaller of the angles in the plane p q that make entry (p, q) zero."""
    entry = float(tensor[p, q])
    if entry == 0.0:
        return
    theta = (float(tensor[q, q]) - float(tensor[p, p])) / (2.0 * entry)
    tangent = math.copysign(1.0, theta) / (abs(theta) + math.hypot(1.0, theta))
    cosine = 1.0 / math.hypot(1.0, tangent)
    sine = tangent * cosine
    # Diagonal entries change by differences only, so that a small moment beside large ones keeps its digits.
    tensor[p, p] -= tangent * entry
    tensor[q, q] += tangent * entry
    tensor[p, q] = tensor[q, p] = 0.0
    entry_p, entry_q = float(tensor[r, p]), float(tensor[r, q])
    tensor[r, p] = tensor[p, r] = cosine * entry_p - sine * entry_q
    tensor[r, q] = tensor[q, r] = sine * entry_p + cosine * entry_q
    axes[:, [p, q]] = matmul(axes[:, [p, q]], np.array([[cosine, sine], [-sine, cosine]]))


def _equalized(moments: np.ndarray) -> np.ndarray:
    """Make moments equal that differ by no more than rounding: all three, or the closest two."""
    allowed = TOLERANCES.inertia.equal_moments * float(np.max(np.abs(moments)))
    if np.ptp(moments) <= allowed:
        return np.full(3, moments.mean())
    gap, p, q = min((abs(moments[p] - moments[q]), p, q) for p, q in ((0, 1), (0, 2), (1, 2)))
    if gap <= allowed:
        moments[[p, q]] = 0.5 * (moments[p] + moments[q])
    return moments
