"""The shapes of a scene, compiled: their primitives, the flat arrays that kernels read, and what the engine asks of each.

Runs of one scene, changed a little each time, have the same shapes. The shapes of the last few scenes are kept if they are small: for a
thrown die they took a tenth of the time of a run.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, CompiledShape, Geometry, build_geometry, compile_shape
from rigidimpulse.core.quaternion import rotate
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.mass import BodyMass
from rigidimpulse.scene.shape import Shape

SMALL: int = 20_000
"""Triangles of all shapes of a scene up to which they are kept: some 10 MB."""
KEPT: int = 8
"""Scenes whose shapes are kept."""


@dataclass(frozen=True, eq=False)
class ShapeSet:
    """All shapes of a scene, k of them; nobody changes the arrays."""

    shapes: tuple[CompiledShape, ...]
    geometry: Geometry
    size: np.ndarray  # (k,) m, largest extent
    radius: np.ndarray  # (k,) m, about the origin, which is the centre of mass
    flat: np.ndarray  # (k,) bool, with faces or rims: pairs of them need a gap for well-defined normals
    half_space: np.ndarray  # (k,) bool, half spaces only
    ball: np.ndarray  # (k,) bool, one sphere about the origin


class _Placed:
    """A shape in the principal frame of a body; equal to what has the same surface there."""

    def __init__(self, shape: Shape, mass: BodyMass) -> None:
        self.shape, self.mass = shape, mass
        self._key = (shape.key, mass.center_of_mass.tobytes(), mass.axes.tobytes())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Placed) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


def compile_shapes(bodies: Iterable[Body], masses: Iterable[BodyMass]) -> tuple[ShapeSet, np.ndarray]:
    """Compile each shape once for each frame it is used in; returns them, and which (n,) each body has.

    Raises:
        SceneError: a shape has no valid surface.

    """
    known: dict[_Placed, int] = {}
    index = [known.setdefault(_Placed(body.shape, mass), len(known)) for body, mass in zip(bodies, masses, strict=True)]
    placed = tuple(known)
    triangles = sum(_triangles(one.shape) for one in placed)
    return (_kept if triangles <= SMALL else _compiled)(placed), np.array(index, np.int64)


def _triangles(shape: Shape) -> int:
    """Triangles of the meshes of a shape."""
    return sum(len(part.shape.faces) for part in shape.parts_flat() if part.shape.faces is not None)


def _compiled(placed: tuple[_Placed, ...]) -> ShapeSet:
    """Compile shapes."""
    shapes = tuple(compile_shape(one.shape, one.mass.center_of_mass, one.mass.axes) for one in placed)
    geometry, number = build_geometry(shapes), range(len(shapes))
    extents = np.array([_extent(geometry, shape) for shape in number]).reshape(-1, 2)
    kinds = (_has_faces, _is_half_space, _is_ball)
    flat, half_space, ball = (np.array([is_kind(geometry, shape) for shape in number], bool) for is_kind in kinds)
    return ShapeSet(shapes, geometry, extents[:, 0], extents[:, 1], flat, half_space, ball)


_kept = lru_cache(KEPT)(_compiled)


def world_boxes(
    geometry: Geometry, shape_of_body: np.ndarray, position: np.ndarray, orientation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lows and highs (n, 3) m of the boxes of all bodies; position (n, 3) m and orientation (n, 4) of their principal frames."""
    low = np.full((len(shape_of_body), 3), np.inf)
    high = -low
    for i, shape in enumerate(shape_of_body.tolist()):
        for p in _primitives(geometry, shape):
            if geometry.kind[p] == HALF_SPACE:
                low[i], high[i] = _plane_box(geometry.frame[p], position[i], orientation[i])
                if len(_primitives(geometry, shape)) > 1:
                    low[i], high[i] = -np.inf, np.inf
                break
            points, r = _primitive_points(geometry, p)
            placed = rotate(orientation[i], points) + position[i]
            low[i] = np.minimum(low[i], placed.min(0) - r)
            high[i] = np.maximum(high[i], placed.max(0) + r)
    return low, high


def _plane_box(frame: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Box of a half space. Normal to an axis of the world it ends at the plane; else every body would be paired with every half space."""
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    normal = rotate(orientation, frame[:3])
    if np.count_nonzero(normal) == 1 and np.abs(normal).max() == 1.0:
        axis = int(np.argmax(np.abs(normal)))
        (high if normal[axis] > 0.0 else low)[axis] = position[axis] + normal[axis] * frame[3]
    return low, high


def _primitives(geometry: Geometry, shape: int) -> range:
    return range(int(geometry.shape_first[shape]), int(geometry.shape_first[shape + 1]))


def _primitive_points(geometry: Geometry, p: int) -> tuple[np.ndarray, float]:
    """Points (k, 3) and the radius of the ball about each that enclose a finite primitive."""
    if geometry.kind[p] == CYLINDER:
        centre, axis, half = geometry.frame[p, :3], geometry.frame[p, 3:6], geometry.frame[p, 6]
        return np.array([centre - half * axis, centre + half * axis]), float(geometry.radius[p])
    return geometry.vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]], float(geometry.radius[p])


def _extent(geometry: Geometry, shape: int) -> tuple[float, float]:
    """Largest extent of a shape, and its bounding radius about the origin."""
    low, high, reach = np.full(3, np.inf), np.full(3, -np.inf), 0.0
    for p in _primitives(geometry, shape):
        if geometry.kind[p] == HALF_SPACE:
            return np.inf, np.inf
        points, r = _primitive_points(geometry, p)
        low, high = np.minimum(low, points.min(0) - r), np.maximum(high, points.max(0) + r)
        reach = max(reach, float(np.linalg.norm(points, axis=1).max()) + r)
    return float((high - low).max()), reach


def _has_faces(geometry: Geometry, shape: int) -> bool:
    """Whether a shape has polyhedra or cylinders."""
    return any(
        geometry.kind[p] == CYLINDER or (geometry.kind[p] == ROUND and geometry.radius[p] == 0.0) for p in _primitives(geometry, shape)
    )


def _is_half_space(geometry: Geometry, shape: int) -> bool:
    return all(geometry.kind[p] == HALF_SPACE for p in _primitives(geometry, shape))


def _is_ball(geometry: Geometry, shape: int) -> bool:
    p, last = int(geometry.shape_first[shape]), int(geometry.shape_first[shape + 1])
    v = int(geometry.vertex_first[p])
    single = last == p + 1 and geometry.kind[p] == ROUND and geometry.vertex_first[p + 1] == v + 1
    return bool(single and not np.any(geometry.vertex[v]))
