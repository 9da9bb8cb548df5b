r"""Mass, centre of mass and inertia of bodies.

A solid of density rho has mass m = rho V, centre of mass c = (1/V) \int x dV, and inertia about c
I = rho (tr(S) 1 - S), with the second moments S = \int (x - c)(x - c)^T dV.

Triangle meshes: the integrals over the solid are sums over the tetrahedra between a reference point and each face
(a, b, c), signed by volume v = a . (b x c) / 6:  \int 1 = v,  \int x = v s / 4,  \int x x^T = v (a a^T + b b^T + c c^T
+ s s^T) / 20, with s = a + b + c (B. Mirtich, Fast and accurate computation of polyhedral mass properties, J. Graphics
Tools 1 (1996), in the tetrahedral form of J. Blow & A. Binstock, 2004). Exact for polyhedra. They are summed with one
rounding (`math.fsum`), the second moments about the centre of mass found first, so results depend neither on the order
of faces nor on where the mesh was drawn.

Compounds: parts add, I = sum R_k I_k R_k^T + m_k (|d_k|^2 1 - d_k d_k^T), d_k from the common centre of mass.

Principal axes: Jacobi rotations, which keep axes close to the body's own and are accurate to the last digits for each
moment, however unequal they are (J. Demmel & K. Veselic, SIAM J. Matrix Anal. Appl. 13 (1992)).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.surface import Surface

_JACOBI_SWEEPS = 30  # convergence is quadratic: 4 to 6 sweeps are enough for any 3 x 3 matrix
_JACOBI_CONVERGED = TOLERANCES.inertia.jacobi_converged


class Solid(NamedTuple):
    """A shape filled with density 1: volume (m^3), centroid (3,) and inertia (3, 3) about it (m^5), shape's frame."""

    volume: float
    centroid: np.ndarray
    inertia: np.ndarray


class BodyMass(NamedTuple):
    """Mass properties of a body, and its principal frame: x_body = center_of_mass + axes @ x_principal."""

    mass: float  # kg; inf if the body is not dynamic
    center_of_mass: np.ndarray  # (3,) m, body frame
    inertia: np.ndarray  # (3, 3) kg m^2, about the centre of mass, body axes; inf on the diagonal if not dynamic
    moments: np.ndarray  # (3,) kg m^2, about the principal axes, in the order of the columns of `axes`
    axes: np.ndarray  # (3, 3) proper rotation, its columns are the principal axes in the body frame


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
    known: dict[tuple, BodyMass] = {}
    masses = []
    for body in bodies:
        given = (None if value is None else np.asarray(value, float).tobytes() for value in (body.mass, body.inertia, body.center_of_mass))
        key = (body.shape.key, body.motion, body.becomes_dynamic, body.material.density, *given)
        if key not in known:
            known[key] = body_mass(body)
        masses.append(known[key])
    return masses


def compute_solid(shape: Shape) -> Solid:
    """Return volume, centroid and inertia of a shape filled with density 1 (`Shape.solid` keeps the answer).

    Raises:
        SceneError: it does not enclose a volume: a half space, or an open, twisted, flat or inside-out mesh.

    """
    shape.check()
    try:
        solid = _COMPUTE[shape.kind](shape)
        if not (0.0 < solid.volume < math.inf and np.all(np.isfinite(solid.inertia)) and np.trace(solid.inertia) > 0):
            raise SceneError(f"its volume comes out as {solid.volume} m^3", "check its size, which is in metres")
    except SceneError as error:
        raise error.within(shape.label) from None
    return solid


def principal_axes(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return principal moments (3,) and axes (3, 3, columns, a proper rotation) of a symmetric tensor.

    Moments equal within `Tolerances.equal_moments` are made equal; a tensor that is diagonal within
    `Tolerances.diagonal_inertia`, or has three equal moments, keeps the axes it is given in.
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
        mass, center, tensor = float(body.mass), np.asarray(body.center_of_mass, float), None  # type: ignore[arg-type]
    else:
        try:
            solid = body.shape.solid()
        except SceneError as error:
            missing = [n for n, has in zip(("mass", "inertia", "center_of_mass"), given, strict=True) if not has]
            remedy = f"{error.remedy}, or give {', '.join(name + '=' for name in missing)}"
            raise SceneError(error.problem, remedy, error.where) from None
        mass = solid.volume * float(body.material.density) if body.mass is None else float(body.mass)
        center = solid.centroid if body.center_of_mass is None else np.asarray(body.center_of_mass, dtype=np.float64)
        tensor = mass / solid.volume * _moved(solid.inertia, solid.volume, center - solid.centroid)
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
        return np.asarray(body.center_of_mass, dtype=np.float64)
    try:
        return body.shape.solid().centroid
    except SceneError:
        return np.zeros(3)


def _sphere(shape: Shape) -> Solid:
    r = shape.radius
    volume = 4.0 / 3.0 * math.pi * r * r * r
    return Solid(volume, np.zeros(3), np.diag(np.full(3, 0.4 * volume * r * r)))


def _box(shape: Shape) -> Solid:
    assert shape.size is not None
    x, y, z = (float(length) for length in shape.size)
    volume = x * y * z
    sums = (y * y + z * z, x * x + z * z, x * x + y * y)
    return Solid(volume, np.zeros(3), np.diag([volume / 12.0 * total for total in sums]))


def _cylinder(shape: Shape) -> Solid:
    r, h = shape.radius, shape.height
    volume = math.pi * r * r * h
    across = volume * (3.0 * r * r + h * h) / 12.0
    return Solid(volume, np.zeros(3), np.diag([across, across, 0.5 * volume * r * r]))


def _capsule(shape: Shape) -> Solid:
    """A cylinder and two half spheres, whose centroids lie 3 r / 8 beyond its ends."""
    r, h = shape.radius, shape.height
    middle, caps = math.pi * r * r * h, 4.0 / 3.0 * math.pi * r * r * r
    along = 0.5 * middle * r * r + 0.4 * caps * r * r
    across = middle * (3.0 * r * r + h * h) / 12.0 + caps * (0.4 * r * r + 0.25 * h * h + 0.375 * h * r)
    return Solid(middle + caps, np.zeros(3), np.diag([across, across, along]))


def _mesh(shape: Shape) -> Solid:
    surface = shape.surface()
    _check_closed(surface)
    return _polyhedron(surface)


def _compound(shape: Shape) -> Solid:
    solids = [(part.shape.solid(), part.position, part.rotation) for part in shape.parts_flat()]
    volume = math.fsum(solid.volume for solid, _, _ in solids)
    centroids = [position + rotation @ solid.centroid for solid, position, rotation in solids]
    reference = centroids[0]
    moment = [solid.volume * (c - reference) for (solid, _, _), c in zip(solids, centroids, strict=True)]
    centroid = reference + _exact_sum(np.array(moment)) / volume
    tensors = [
        _moved(rotation @ solid.inertia @ rotation.T, solid.volume, c - centroid)
        for (solid, _, rotation), c in zip(solids, centroids, strict=True)
    ]
    inertia = _exact_sum(np.array(tensors).reshape(-1, 9)).reshape(3, 3)
    return Solid(volume, centroid, 0.5 * (inertia + inertia.T))


def _half_space(_: Shape) -> Solid:
    raise SceneError("it is infinite, it has no mass", "make the body motion='static'")


_COMPUTE = {
    "sphere": _sphere,
    "box": _box,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "mesh": _mesh,
    "compound": _compound,
    "half_space": _half_space,
}


def _check_closed(surface: Surface) -> None:
    """Raise a `SceneError` for a surface that bounds no solid."""
    if surface.num_open_edges:
        raise SceneError(
            f"it is open ({surface.num_open_edges} of its edges lack a second face), so it has no mass of its own",
            "close it, use Shape.convex_hull, or make the body motion='static'",
        )
    if surface.num_twisted_edges:
        raise SceneError(
            f"its faces do not all face outwards ({surface.num_twisted_edges} edges join faces of opposite winding)",
            "turn the faces that are the wrong way round (trimesh.repair.fix_normals(mesh)), or use Shape.convex_hull",
        )


def _polyhedron(surface: Surface) -> Solid:
    """Return the integrals over a closed surface."""
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    middle = 0.5 * (low + high)
    corners = (surface.vertices - middle)[surface.faces]
    area_vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * math.fsum(np.linalg.norm(area_vectors, axis=1).tolist())
    signed = np.sum(corners[:, 0] * np.cross(corners[:, 1], corners[:, 2]), axis=1) / 6.0
    volume = math.fsum(signed.tolist())
    if abs(volume) <= TOLERANCES.inertia.enclosed_volume * area * float(np.max(high - low)):
        raise SceneError("it encloses no volume", "give it a thickness, or make the body motion='static'")
    if volume < 0.0:
        raise SceneError(
            f"it is inside out (volume {volume:g} m^3)", "flip its faces: Shape.mesh(vertices, faces[:, ::-1])"
        )
    offset = _exact_sum(signed[:, None] * corners.sum(axis=1)) / (4.0 * volume)

    corners = corners - offset
    signed = np.sum(corners[:, 0] * np.cross(corners[:, 1], corners[:, 2]), axis=1) / 6.0
    points = np.concatenate([corners, corners.sum(axis=1, keepdims=True)], axis=1)  # (f, 4, 3): a, b, c, s
    moments = _exact_sum((signed[:, None, None] * np.swapaxes(points, 1, 2) @ points).reshape(-1, 9)) / 20.0
    second = moments.reshape(3, 3)
    return Solid(volume, middle + offset, np.trace(second) * np.eye(3) - 0.5 * (second + second.T))


def _moved(inertia: np.ndarray, mass: float, offset: np.ndarray) -> np.ndarray:
    """Return an inertia about the centre of mass moved to a point `offset` away (parallel axes)."""
    return inertia + mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))


def _given_inertia(inertia: np.ndarray) -> np.ndarray:
    """Return a given inertia, (3,) or (3, 3), as a symmetric tensor."""
    if inertia.shape == (3,):
        return np.diag(inertia)
    if np.max(np.abs(inertia - inertia.T)) > TOLERANCES.inertia.symmetric * np.max(np.abs(inertia)):
        raise SceneError(f"inertia {inertia.tolist()} is not symmetric", "give a symmetric tensor in kg m^2")
    return 0.5 * (inertia + inertia.T)


def _check_moments(moments: np.ndarray) -> None:
    """Raise a `SceneError` for moments that no body has."""
    small, middle, large = sorted(float(moment) for moment in moments)
    if small <= TOLERANCES.inertia.least_moment * large:
        raise SceneError(f"principal moments of inertia are {moments.tolist()} kg m^2", "all must be > 0")
    if small + middle < large * (1.0 - TOLERANCES.inertia.realizable):
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
    axes[:, [p, q]] = axes[:, [p, q]] @ np.array([[cosine, sine], [-sine, cosine]])


def _equalized(moments: np.ndarray) -> np.ndarray:
    """Make moments equal that differ by no more than rounding: all three, or the closest two."""
    allowed = TOLERANCES.inertia.equal_moments * float(np.max(np.abs(moments)))
    if np.ptp(moments) <= allowed:
        return np.full(3, moments.mean())
    gap, p, q = min((abs(moments[p] - moments[q]), p, q) for p, q in ((0, 1), (0, 2), (1, 2)))
    if gap <= allowed:
        moments[[p, q]] = 0.5 * (moments[p] + moments[q])
    return moments


def _exact_sum(rows: np.ndarray) -> np.ndarray:
    """Return the sum of rows (n, k), each column rounded once."""
    return np.array([math.fsum(column.tolist()) for column in rows.T])
