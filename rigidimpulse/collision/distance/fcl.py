"""Separation and overlap of two shapes, measured with FCL. Only this file and `fcl_trees` use it.

Every finite ROUND primitive is a skeleton (triangles, a segment or a point; the last two are triangles without area)
grown by a radius. Skeletons go to FCL as trees of triangles, for which its distance is exact to round-off; the gap is the
distance of the skeletons less both radii. Half spaces have closed forms and cylinders exact kernels of their own
(`manifold.pair_gap`).

Some calls of FCL abort, hang or give wrong answers. They are avoided: FCL is asked only for unsigned distance and yes-or-no collision of
non-empty trees, with indices in range and finite poses. Coordinates are scaled so that no triangle is small (FCL compares the square of
its normal with 1e-15). Trees are hollow: if surfaces are apart, a point of each connected part of one body is looked
for inside the other (`containment`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import fcl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rigidimpulse.collision.containment import points_inside
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, CompiledShape, Geometry, Primitive, build_geometry
from rigidimpulse.collision.manifold.dispatch import Posed, pair_gap
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.core.tolerances import TOLERANCES

Pose = tuple[np.ndarray, np.ndarray]
"""Position (3,) m and orientation (4,), unit quaternion wxyz, of a principal frame."""

_NOT_UNIT = TOLERANCES.distance.unit_quaternion
_UNDEFINED = np.full(3, np.nan)


class Separation(NamedTuple):
    """How far two shapes are apart.

    The gap is positive if they are separate. Where they overlap it is minus the depth for half spaces, and for spheres
    and capsules whose skeletons are outside the other body; otherwise it is not positive, and points and normal are NaN.
    """

    gap: float  # m
    point_a: np.ndarray  # (3,) m, world, closest point of a
    point_b: np.ndarray  # (3,) m
    normal: np.ndarray  # (3,) unit, from a to b


class _Skeleton(NamedTuple):
    """A tree of triangles for FCL, twice, so that a shape can be asked about itself."""

    radius: float
    objects: tuple[fcl.CollisionObject, fcl.CollisionObject]


class _Solid(NamedTuple):
    """What is asked of one shape."""

    half_spaces: list[np.ndarray]  # normal, offset
    skeletons: list[_Skeleton]
    cylinders: list[Primitive]
    vertices: np.ndarray  # (v, 3) all corners of skeletons
    radii: np.ndarray  # (v,) their radii
    parts: np.ndarray  # (k, 3) a point of each connected part
    centre: np.ndarray  # (3,) bounding sphere of what is finite
    reach: float


_NOTHING = Separation(np.inf, _UNDEFINED, _UNDEFINED, _UNDEFINED)


class Narrowphase:
    """Separation and overlap of compiled shapes, by index. Trees are built when a shape is first asked about.

    Args:
        shapes: the compiled shapes, in their principal frames.
        geometry: the same shapes as `build_geometry` gives them, if at hand.

    """

    def __init__(self, shapes: Sequence[CompiledShape], geometry: Geometry | None = None) -> None:
        """Check the shapes.

        Raises:
            SceneError: a shape has no primitives, numbers that are not finite, or faces that name missing vertices.

        """
        self.shapes = list(shapes)
        for index, shape in enumerate(self.shapes):
            _check(shape, index)
        self.geometry = build_geometry(self.shapes) if geometry is None else geometry
        self._scale = scale_of(self.shapes)
        self._solids: dict[int, _Solid] = {}
        self._request = fcl.DistanceRequest(enable_nearest_points=True)

    def separation(self, a: int, pose_a: Pose, b: int, pose_b: Pose) -> Separation:
        """Return gap, closest points and normal of shapes a and b.

        Raises:
            ValueError: a pose is not finite or its quaternion not of unit length.

        """
        (x_a, R_a), (x_b, R_b) = _frame(pose_a), _frame(pose_b)
        R, t = R_a.T @ R_b, R_a.T @ (x_b - x_a)  # from the frame of b into that of a
        best = self._skeleton_separation(a, b, R, t)
        best = min(best, self._cylinder_separation(a, b, R, t, best.gap), key=_gap)
        # Trees are hollow: surfaces that are apart may be one inside the other.
        if best.gap < np.inf and self._contained(a, b, R, t):
            best = _overlapping(0.0)
        best = min(best, self._plane_separation(a, b, R, t), key=_gap)
        return Separation(best.gap, R_a @ best.point_a + x_a, R_a @ best.point_b + x_a, R_a @ best.normal)

    def overlap(self, a: int, pose_a: Pose, b: int, pose_b: Pose) -> bool:
        """Tell whether shapes a and b have a point in common, touching included.

        Raises:
            ValueError: a pose is not finite or its quaternion not of unit length.

        """
        (x_a, R_a), (x_b, R_b) = _frame(pose_a), _frame(pose_b)
        R, t = R_a.T @ R_b, R_a.T @ (x_b - x_a)
        return (
            self._plane_separation(a, b, R, t).gap <= 0.0
            or self._skeletons_meet(a, b, R, t)
            or self._cylinder_separation(a, b, R, t, np.inf).gap <= 0.0
            or self._contained(a, b, R, t)
        )

    # From here on in the frame of a: y_a = R y_b + t.

    def _solid(self, index: int) -> _Solid:
        if index not in self._solids:
            self._solids[index] = _solid_of(self.shapes[index], self._scale)
        return self._solids[index]

    def _plane_separation(self, a: int, b: int, R: np.ndarray, t: np.ndarray) -> Separation:
        """Return the least separation of pairs with a half space."""
        solid_a, solid_b = self._solid(a), self._solid(b)
        best = _NOTHING
        for plane in solid_a.half_spaces:
            for other in solid_b.half_spaces:
                best = min(best, _planes(plane, _moved_plane(other, R, t)), key=_gap)
            best = min(best, _above(plane, solid_b, R, t), key=_gap)
        for plane in solid_b.half_spaces:
            best = min(best, _swapped(_above(_moved_plane(plane, R, t), solid_a, np.eye(3), np.zeros(3))), key=_gap)
        return best

    def _skeleton_separation(self, a: int, b: int, R: np.ndarray, t: np.ndarray) -> Separation:
        """Return the least separation of pairs of skeletons."""
        best = _NOTHING
        placed = fcl.Transform(R, t * self._scale)
        for skeleton_a in self._solid(a).skeletons:
            for skeleton_b in self._solid(b).skeletons:
                first, second = skeleton_a.objects[0], skeleton_b.objects[1]
                # Only b moves: the query is in a's frame, scaled so that no triangle is small.
                second.setTransform(placed)
                result = fcl.DistanceResult()
                distance = max(0.0, fcl.distance(first, second, self._request, result) / self._scale)
                gap = distance - skeleton_a.radius - skeleton_b.radius
                if not gap < best.gap:
                    continue
                # Skeletons that touch give no normal.
                best = _overlapping(gap)
                p, q = (np.array(point) / self._scale for point in result.nearest_points)
                length = float(np.linalg.norm(q - p))
                if distance > 0.0 and length > 0.0:
                    n = (q - p) / length
                    best = Separation(gap, p + skeleton_a.radius * n, q - skeleton_b.radius * n, n)
        return best

    def _skeletons_meet(self, a: int, b: int, R: np.ndarray, t: np.ndarray) -> bool:
        placed = fcl.Transform(R, t * self._scale)
        for skeleton_a in self._solid(a).skeletons:
            for skeleton_b in self._solid(b).skeletons:
                first, second = skeleton_a.objects[0], skeleton_b.objects[1]
                second.setTransform(placed)
                radius = skeleton_a.radius + skeleton_b.radius
                # Yes-or-no collision is exact for sharp surfaces; rounded ones meet where their skeletons are near.
                if radius == 0.0:
                    if fcl.collide(first, second, fcl.CollisionRequest(), fcl.CollisionResult()) > 0:
                        return True
                elif fcl.distance(first, second, fcl.DistanceRequest(), fcl.DistanceResult()) <= radius * self._scale:
                    return True
        return False

    def _cylinder_separation(self, a: int, b: int, R: np.ndarray, t: np.ndarray, limit: float) -> Separation:
        """Return the separation of two shapes of which one has cylinders, if below `limit`."""
        solid_a, solid_b = self._solid(a), self._solid(b)
        if not ((solid_a.cylinders and (solid_b.cylinders or solid_b.skeletons)) or (solid_b.cylinders and solid_a.skeletons)):
            return _NOTHING
        out = np.zeros(7)
        farthest = float(np.linalg.norm(R @ solid_b.centre + t - solid_a.centre)) + solid_a.reach + solid_b.reach
        # No gap is larger than `farthest`: the limit is finite.
        gap = pair_gap(self.geometry, Posed(a, np.zeros(3), np.eye(3)), Posed(b, t, R), min(limit, farthest), out)
        if gap >= limit:
            return _NOTHING
        between = out[3:6] - out[:3]
        length = float(np.linalg.norm(between))
        if length == 0.0:
            return _overlapping(gap)
        return Separation(gap, out[:3].copy(), out[3:6].copy(), between / (length if gap > 0.0 else -length))

    def _contained(self, a: int, b: int, R: np.ndarray, t: np.ndarray) -> bool:
        """Tell whether a connected part of one shape lies inside the other, given that surfaces are apart."""
        solid_a, solid_b = self._solid(a), self._solid(b)
        apart = float(np.linalg.norm(R @ solid_b.centre + t - solid_a.centre))
        # Only a body whose centre lies within the other's sphere can be inside it.
        if not (len(solid_a.parts) and len(solid_b.parts)) or apart >= max(solid_a.reach, solid_b.reach):
            return False
        return bool(
            points_inside(self.geometry, a, solid_b.parts @ R.T + t).any()
            or points_inside(self.geometry, b, (solid_a.parts - t) @ R).any()
        )


def _gap(separation: Separation) -> float:
    return separation.gap


def _swapped(separation: Separation) -> Separation:
    return Separation(separation.gap, separation.point_b, separation.point_a, -separation.normal)


def _overlapping(gap: float) -> Separation:
    """Return the separation of shapes that meet where nothing tells how deep."""
    return Separation(min(gap, 0.0), _UNDEFINED, _UNDEFINED, _UNDEFINED)


def _frame(pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Return position and rotation matrix of a pose, checked."""
    position = np.array(pose[0], dtype=np.float64)
    orientation = np.array(pose[1], dtype=np.float64)
    if position.shape != (3,) or not np.all(np.isfinite(position)):
        raise ValueError(f"position {position} is not three finite numbers")
    length = float(np.linalg.norm(orientation))
    if orientation.shape != (4,) or not abs(length - 1.0) <= _NOT_UNIT:
        raise ValueError(f"orientation {orientation} is not a unit quaternion (w, x, y, z)")
    rotation = np.empty((3, 3))
    quaternion_to_matrix(orientation / length, rotation)
    return position, rotation


# Half spaces


def _moved_plane(plane: np.ndarray, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    normal = R @ plane[:3]
    return np.array([*normal, plane[3] + normal @ t])


def _planes(first: np.ndarray, second: np.ndarray) -> Separation:
    """Return the separation of two half spaces: they overlap unless they face each other exactly."""
    if not np.array_equal(first[:3], -second[:3]):
        return _overlapping(-np.inf)
    gap = -float(first[3] + second[3])
    return Separation(gap, first[:3] * first[3], second[:3] * second[3], first[:3])


def _above(plane: np.ndarray, solid: _Solid, R: np.ndarray, t: np.ndarray) -> Separation:
    """Return the separation of a half space and a body whose pose in its frame is R, t."""
    n, offset = plane[:3], plane[3]
    best = _NOTHING
    if len(solid.vertices):
        heights = (solid.vertices @ R.T + t) @ n - offset - solid.radii
        lowest = int(np.argmin(heights))
        point = R @ solid.vertices[lowest] + t - solid.radii[lowest] * n
        best = Separation(float(heights[lowest]), point - heights[lowest] * n, point, n)
    for cylinder in solid.cylinders:
        axis = R @ cylinder.frame[3:6]
        across = n - (n @ axis) * axis
        size = float(np.linalg.norm(across))
        point = R @ cylinder.frame[:3] + t - np.copysign(cylinder.frame[6], n @ axis) * axis
        if size > 0.0:
            point = point - cylinder.radius / size * across
        gap = float(n @ point - offset)
        best = min(best, Separation(gap, point - gap * n, point, n), key=_gap)
    return best


# Preparation


def _check(shape: CompiledShape, index: int) -> None:
    if not shape.primitives:
        raise SceneError("no primitives", "give the shape a surface", f"shape {index}")
    for primitive in shape.primitives:
        numbers = (primitive.radius, primitive.frame, primitive.vertices)
        if not all(np.all(np.isfinite(part)) for part in numbers):
            raise SceneError("numbers that are not finite", "give finite sizes and vertices", f"shape {index}")
        faces, num_vertices = np.asarray(primitive.faces), len(primitive.vertices)
        if primitive.kind == ROUND and num_vertices == 0:
            raise SceneError("no vertices", "give the shape a surface", f"shape {index}")
        if len(faces) and (faces.min() < 0 or faces.max() >= num_vertices):
            raise SceneError(f"faces name vertices beyond {num_vertices}", "remove these faces", f"shape {index}")


def _triangles(primitive: Primitive) -> np.ndarray:
    """Return the faces (f, 3); a segment or a point is a triangle without area."""
    last = len(primitive.vertices) - 1
    return np.asarray(primitive.faces) if len(primitive.faces) else np.array([[0, last, last]])


def scale_of(shapes: Sequence[CompiledShape]) -> float:
    """Return the power of two that makes the smallest triangle a large one."""
    sizes = [1.0]
    for primitive in (primitive for shape in shapes for primitive in shape.primitives if primitive.kind == ROUND):
        a, b, c = np.moveaxis(primitive.vertices[_triangles(primitive)], 1, 0)
        size = np.sqrt(np.linalg.norm(np.cross(b - a, c - a), axis=1))
        extent = float(np.ptp(primitive.vertices, axis=0).max())
        sizes += [float(part.min()) for part in (size[size > TOLERANCES.surface.weld * extent],) if len(part)]
        sizes += [extent] if extent > 0.0 else []
    # A power of two: scaling there and back rounds nothing.
    return float(2.0 ** np.ceil(-np.log2(min(sizes))))


def _solid_of(shape: CompiledShape, scale: float) -> _Solid:
    rounds = [primitive for primitive in shape.primitives if primitive.kind == ROUND]
    cylinders = [primitive for primitive in shape.primitives if primitive.kind == CYLINDER]
    meshes = [primitive for primitive in rounds if primitive.radius == 0.0]
    skeletons = [_skeleton([primitive], scale) for primitive in rounds if primitive.radius > 0.0]
    if meshes:
        skeletons.append(_skeleton(meshes, scale))
    vertices = np.concatenate([np.zeros((0, 3)), *(primitive.vertices for primitive in rounds)])
    radii = np.concatenate([np.zeros(0), *(np.full(len(p.vertices), p.radius) for p in rounds)])
    balls = np.concatenate([vertices, np.zeros((0, 3)), *(p.frame[None, :3] for p in cylinders)])
    ball_radii = np.concatenate([radii, [np.hypot(p.radius, p.frame[6]) for p in cylinders]])
    centre = 0.5 * (balls.min(axis=0) + balls.max(axis=0)) if len(balls) else np.zeros(3)
    return _Solid(
        half_spaces=[primitive.frame[:4] for primitive in shape.primitives if primitive.kind == HALF_SPACE],
        skeletons=skeletons,
        cylinders=cylinders,
        vertices=vertices,
        radii=radii,
        parts=np.concatenate([np.zeros((0, 3)), *(_parts(p) for p in rounds), *(p.frame[None, :3] for p in cylinders)]),
        centre=centre,
        reach=float((np.linalg.norm(balls - centre, axis=1) + ball_radii).max()) if len(balls) else 0.0,
    )


def _parts(primitive: Primitive) -> np.ndarray:
    """Return a vertex (k, 3) of each connected part of a surface."""
    faces = _triangles(primitive)
    tail, head = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    links = coo_array((np.ones(len(tail)), (tail, head)), shape=(len(primitive.vertices),) * 2)
    _, label = connected_components(links, directed=False)
    _, first = np.unique(label[faces[:, 0]], return_index=True)
    return primitive.vertices[faces[first, 0]]


def _skeleton(primitives: list[Primitive], scale: float) -> _Skeleton:
    """Return the tree of one or more primitives of the same radius."""
    first = np.cumsum([0, *(len(primitive.vertices) for primitive in primitives)])
    vertices = np.concatenate([primitive.vertices for primitive in primitives]) * scale
    faces = np.concatenate([_triangles(p) + offset for p, offset in zip(primitives, first, strict=False)])
    return _Skeleton(primitives[0].radius, objects_of(vertices, faces))


def objects_of(vertices: np.ndarray, faces: np.ndarray) -> tuple[fcl.CollisionObject, fcl.CollisionObject]:
    """FCL's tree of triangles, as two objects: vertices (v, 3), scaled; faces (f, 3), at least one."""
    tree = fcl.BVHModel()
    tree.beginModel(len(faces), len(vertices))
    tree.addSubModel(np.ascontiguousarray(vertices), np.ascontiguousarray(faces))
    tree.endModel()
    return fcl.CollisionObject(tree), fcl.CollisionObject(tree)
