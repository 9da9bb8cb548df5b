"""Shapes of colliders in USD: prims of geometry with their stretch K (3, 3) in metres a unit, as shapes of the engine.

    Sphere              K = s 1: radius |s| r; any other: the hull of 162 points of the ellipsoid
    Cube                K diagonal: sides |k_i| size; with shear: the hull of its corners
    Capsule             K = s 1: the same; any other, and unequal radii: the hull of two spheres
    Cylinder            K even across its axis: the same; any other, and unequal radii: the hull of two rims of 48 points
    Cone                the hull of a rim of 48 points and its tip
    Plane               half space below it: endless, as in UsdPhysics
    Mesh                by `physics:approximation`: none, convexDecomposition and meshSimplification: its triangles, exactly;
                        convexHull; boundingCube and boundingSphere, about its points in its own axes

A negative scale counts as its magnitude, except for meshes. Capsules and cylinders stand along z in `Shape`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import from_matrix, multiply
from rigidimpulse.io.pieces import EQUAL, rim_points, sphere_points
from rigidimpulse.io.usd.frames import snapped
from rigidimpulse.io.usd.library import Prim, SdfPath, UsdGeom, UsdPhysics
from rigidimpulse.scene.shape import Shape

HALF = np.sqrt(0.5)
NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])
FROM_Z = {"X": np.array([HALF, 0.0, HALF, 0.0]), "Y": np.array([HALF, -HALF, 0.0, 0.0]), "Z": NO_TURN}
"""Quaternion wxyz that takes z to an axis."""
EXACT = ("convexDecomposition", "meshSimplification")

Placed = tuple[Shape, np.ndarray, np.ndarray]
"""A shape, its position (3,) m and orientation (4,) wxyz in the rigid frame of its prim."""


class Shapes:
    """Shapes of prims; those that are equal are one. notes: what is not as the file says."""

    def __init__(self, code: float, hulls: frozenset[SdfPath] = frozenset(), as_drawn: bool = False) -> None:
        """code: time code of the scene. hulls: paths of meshes that collide as their convex hull, whatever they say.

        as_drawn: read meshes as they are drawn, not as they collide.
        """
        self._code, self._hulls, self._as_drawn = code, hulls, as_drawn
        self.notes: list[str] = []
        self._known: dict[tuple, Placed] = {}

    def of(self, prim: Prim, stretch: np.ndarray) -> Placed | None:
        """Return the shape of a prim under a stretch K (3, 3) m a unit, None for geometry that is not read.

        Raises:
            SceneError: it has no extent, or is broken; names the prim.

        """
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        approximation = UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get() if prim.IsA(UsdGeom.Mesh) else None
        if prim.GetPath() in self._hulls:
            approximation = "convexHull"
        if self._as_drawn:
            approximation = None
        key = (source.GetPath(), approximation, stretch.tobytes())
        if key not in self._known:
            try:
                made = self._mesh(prim, stretch, approximation) if prim.IsA(UsdGeom.Mesh) else self._implicit(prim, stretch)
                if made is None:
                    self.notes.append(f"collider {prim.GetPath()} of type {prim.GetTypeName()} is not read")
                    return None
                made[0].check()
            except SceneError as error:
                raise error.within(f"prim {prim.GetPath()}") from None
            self._known[key] = made
        return self._known[key]

    def _implicit(self, prim: Prim, stretch: np.ndarray) -> Placed | None:
        """Return the shape of a prim that is given by figures."""
        kind = str(prim.GetTypeName())
        axis = _token(prim, "axis", "Z")
        if kind == "Plane":
            normal = stretch[:, "XYZ".index(axis)]
            return Shape.half_space(normal / np.linalg.norm(normal)), np.zeros(3), NO_TURN
        sheared = np.abs(stretch - np.diag(np.diag(stretch))).max() > EQUAL * np.abs(stretch).max()
        made = None if sheared else _exact(prim, kind, axis, np.abs(np.diag(stretch)))
        if made is None:
            points = _points(prim, kind, axis)
            if points is None:
                return None
            matrix = stretch if sheared else np.diag(np.abs(np.diag(stretch)))
            made = Shape.convex_hull(points @ matrix.T), NO_TURN
            self.notes.append(f"collider {prim.GetPath()}: its {kind} is taken as a convex hull")
        return made[0], np.zeros(3), made[1]

    def _mesh(self, prim: Prim, stretch: np.ndarray, approximation: str | None) -> Placed:
        """Return the shape of a mesh prim."""
        points, faces = triangles(prim, self._code)
        if UsdGeom.Mesh(prim).GetPointsAttr().ValueMightBeTimeVarying():
            self.notes.append(f"collider {prim.GetPath()} changes its shape: it stays as it is at the start")
        points = points @ stretch.T
        if approximation == "convexHull":
            return Shape.convex_hull(points), np.zeros(3), NO_TURN
        low, high = points.min(axis=0), points.max(axis=0)
        middle = 0.5 * (low + high)
        if approximation == "boundingCube":
            return Shape.box(high - low), middle, NO_TURN
        if approximation == "boundingSphere":
            return Shape.sphere(float(np.linalg.norm(points - middle, axis=1).max())), middle, NO_TURN
        if approximation in EXACT:
            self.notes.append(f"collider {prim.GetPath()}: its approximation is {approximation}; the mesh itself collides")
        elif approximation not in (None, "none"):
            self.notes.append(f"collider {prim.GetPath()}: the approximation {approximation} is not read; the mesh itself collides")
        return Shape.mesh(points, faces[:, ::-1] if np.linalg.det(stretch) < 0.0 else faces), np.zeros(3), NO_TURN


def triangles(prim: Prim, code: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (v, 3) in units of the file and triangles (t, 3) of a mesh prim at a time code; polygons are fans.

    Raises:
        SceneError: there are none, or an index is wrong.

    """
    mesh = UsdGeom.Mesh(prim)
    points, counts, index = (
        np.array(attribute.Get(code) or (), dtype)
        for attribute, dtype in (
            (mesh.GetPointsAttr(), float), (mesh.GetFaceVertexCountsAttr(), np.int64), (mesh.GetFaceVertexIndicesAttr(), np.int64)
        )
    )  # fmt: skip
    if not len(points) or not len(index) or counts.min() < 3 or counts.sum() != len(index):
        raise SceneError("the mesh has no triangles, or its counts do not fit its indices", "export it again")
    if index.min() < 0 or index.max() >= len(points):
        raise SceneError("an index is beyond the points", "export it again")
    faces = index[corners_of(mesh)[1]]
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        faces = faces[:, ::-1]
    return points, faces


def corners_of(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return for each triangle of a UsdGeom.Mesh the polygon (t,) that it is of, and the places (t, 3) of its corners in the indices."""
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(), np.int64)
    fans = np.repeat(np.arange(len(counts)), counts - 2)
    start = np.cumsum(counts) - counts
    step = np.arange(len(fans)) - (np.cumsum(counts - 2) - (counts - 2))[fans]
    return fans, np.column_stack([start[fans], start[fans] + step + 1, start[fans] + step + 2])


def placed_in(made: Placed, own: tuple[np.ndarray, np.ndarray], body: tuple[np.ndarray, np.ndarray]) -> Placed:
    """Return a shape in the rigid frame of a body; own, body: positions (3,) m and rotations (3, 3) of its prim and of the body's."""
    (shape, place, turn), (x, rotation), (origin, frame) = made, own, body
    relative = snapped(frame.T @ rotation)
    orientation = multiply(from_matrix(relative), turn) if np.any(relative != np.eye(3)) else turn
    return shape, frame.T @ (x - origin) + relative @ place, orientation


def _token(prim: Prim, name: str, default: str) -> str:
    attribute = prim.GetAttribute(name)
    value = attribute.Get() if attribute else None
    return str(value) if value in ("X", "Y", "Z") else default


def _figure(prim: Prim, name: str) -> float:
    """Return a length of a prim in units of the file."""
    attribute = prim.GetAttribute(name)
    value = attribute.Get() if attribute else None
    if value is None or not np.isfinite(value) or value <= 0.0:
        raise SceneError(f"{name} is {value}", "give a finite number > 0")
    return float(value)


def _radii(prim: Prim, kind: str) -> tuple[float, float]:
    """Return the radii of a capsule or cylinder below and above."""
    if kind.endswith("_1"):
        return _figure(prim, "radiusBottom"), _figure(prim, "radiusTop")
    radius = _figure(prim, "radius")
    return radius, radius


def _exact(prim: Prim, kind: str, axis: str, scale: np.ndarray) -> tuple[Shape, np.ndarray] | None:
    """Return a shape and its turn where the engine has it under the scales (3,), None where it has not."""
    k = "XYZ".index(axis)
    along, across = scale[k], np.delete(scale, k)
    even = np.ptp(scale) <= EQUAL * scale.max()
    if kind == "Cube":
        return Shape.box(_figure(prim, "size") * scale), NO_TURN
    if kind == "Sphere":
        return (Shape.sphere(_figure(prim, "radius") * along), NO_TURN) if even else None
    if kind not in ("Capsule", "Capsule_1", "Cylinder", "Cylinder_1"):
        return None
    low, high = _radii(prim, kind)
    if abs(low - high) > EQUAL * max(low, high):
        return None
    if kind.startswith("Capsule"):
        return (Shape.capsule(low * along, _figure(prim, "height") * along), FROM_Z[axis]) if even else None
    round_ = np.ptp(across) <= EQUAL * across.max()
    return (Shape.cylinder(low * across[0], _figure(prim, "height") * along), FROM_Z[axis]) if round_ else None


def _points(prim: Prim, kind: str, axis: str) -> np.ndarray | None:
    """Return points (p, 3) in units of the file whose hull stands for a prim, None for what is not read."""
    if kind == "Cube":
        return 0.5 * _figure(prim, "size") * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    if kind == "Sphere":
        return _figure(prim, "radius") * sphere_points()
    if kind not in ("Capsule", "Capsule_1", "Cylinder", "Cylinder_1", "Cone"):
        return None
    half = 0.5 * _figure(prim, "height")
    low, high = (_figure(prim, "radius"), 0.0) if kind == "Cone" else _radii(prim, kind)
    points = sphere_points() if kind.startswith("Capsule") else rim_points()
    ends = [radius * points + [0.0, y, 0.0] for radius, y in ((low, -half), (high, half))]
    return np.roll(np.concatenate(ends), "XYZ".index(axis) - 1, axis=1)
