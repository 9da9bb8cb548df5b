r"""Volume, centroid and inertia of shapes.

A solid of density 1 has the volume V, the centroid c = (1/V) \int x dV, and about c the inertia
I = tr(S) 1 - S, with the second moments S = \int (x - c)(x - c)^T dV.

Triangle meshes: the integrals over the solid are sums over the tetrahedra between a reference point and each face
(a, b, c), signed by volume v = a . (b x c) / 6:  \int 1 = v,  \int x = v s / 4,  \int x x^T = v (a a^T + b b^T + c c^T
+ s s^T) / 20, with s = a + b + c (B. Mirtich, Fast and accurate computation of polyhedral mass properties, J. Graphics
Tools 1 (1996), in the tetrahedral form of J. Blow & A. Binstock, 2004). Exact for polyhedra. They are summed with one
rounding (`math.fsum`), the second moments about the centroid found first. So results depend neither on the order
of faces nor on where the mesh was drawn.

Compounds: parts add, I = sum R_k I_k R_k^T + V_k (|d_k|^2 1 - d_k d_k^T), d_k from the common centroid.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.portable import dot, matmul
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.scene.surface import Surface

if TYPE_CHECKING:
    from rigidimpulse.scene.shape import Shape


class Solid(NamedTuple):
    """A shape filled with density 1: volume (m^3), centroid (3,) and inertia (3, 3) about it (m^5), shape's frame."""

    volume: float
    centroid: np.ndarray
    inertia: np.ndarray


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
    solids = [(part.shape.solid(), part.position, part.rotation) for part in shape.solids_flat()]
    volume = math.fsum(solid.volume for solid, _, _ in solids)
    centroids = [position + dot(rotation, solid.centroid) for solid, position, rotation in solids]
    reference = centroids[0]
    moment = [solid.volume * (c - reference) for (solid, _, _), c in zip(solids, centroids, strict=True)]
    centroid = reference + _exact_sum(np.array(moment)) / volume
    tensors = [
        parallel_axes(matmul(matmul(rotation, solid.inertia), rotation.T), solid.volume, c - centroid)
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
    moments = _exact_sum(matmul(signed[:, None, None] * np.swapaxes(points, 1, 2), points).reshape(-1, 9)) / 20.0
    second = moments.reshape(3, 3)
    return Solid(volume, middle + offset, np.trace(second) * np.eye(3) - 0.5 * (second + second.T))


def parallel_axes(inertia: np.ndarray, mass: float, offset: np.ndarray) -> np.ndarray:
    """Return an inertia about the centre of mass moved to a point `offset` away (parallel axes)."""
    return inertia + mass * (dot(offset, offset) * np.eye(3) - np.outer(offset, offset))


def _exact_sum(rows: np.ndarray) -> np.ndarray:
    """Return the sum of rows (n, k), each column rounded once."""
    return np.array([math.fsum(column.tolist()) for column in rows.T])
