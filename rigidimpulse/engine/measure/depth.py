"""How deep points and edges of one shape are inside another: lower bounds of the depth of penetration, without the solver's geometry.

A shape is looked at as what may enter another one, its probes, and as what may be entered, its solids. All are made of the primitives of
the compiled shape, in its principal frame.

    probe   a ball (c, r): a sphere, points of the axis of a capsule; or an edge (p, q) of a polyhedron, and lines
            from the middle of a convex one to those of its faces; or points of a cylinder
    solid   n.x <= d for all faces of a half space or a convex polyhedron; a segment with a radius; a cylinder; a closed surface

A point at the depth d in a convex solid, its least distance from the faces, has to move by d to come out, and with it the body: the depth
of penetration is d or more. A ball around it has to move by d + r. An edge is cut by the planes of all faces; the depth is a concave
function along what is left, and the largest of the depths at both ends and in the middle is at least half the largest of all. Two convex
polyhedra are inside each other if and only if an edge of one enters the other; equal boxes may have all of them in each other's faces, so
there are the lines to the middles of faces, too. A ball outside a face is as deep as r - h, h its height above the face, if its foot lies
in the face; a ball whose foot is beside it is found by the edges of the polyhedron.

Points inside a shape, with a lower bound of their depth in it, are for the check of ways through surfaces, see `tunnelling`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigidimpulse.collision.containment import points_inside
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, CompiledShape, Geometry, Primitive, build_geometry
from rigidimpulse.core.kept import kept_with_argument
from rigidimpulse.engine.measure.edges_in_parts import Parts, enter_with_edges, parts_of

MOST_EDGES: int = 96
"""Edges of a primitive that are looked at, evenly chosen of all; all corners of those with fewer count."""
CORNERS_OF_BOX = np.array(list(np.ndindex(2, 2, 2)), bool)
"""(8, 3), on which side each corner is."""
MOST_BOUNDS: int = 64
"""Corners, and faces, with which shapes are told to be apart at once; larger shapes by their boxes."""
MOST_SORTED: int = 4000
"""Faces up to which edges are looked for that are no diagonals."""
MOST_SPOKES: int = 48
"""Faces of a convex polyhedron to whose middles lines are drawn."""
MOST_FACES: int = 400
"""Faces up to which a polyhedron may be looked at as convex; larger ones are surfaces."""
RIM_POINTS: int = 24
"""Points of a rim of a cylinder: they are off the rim by less than 1 % of its radius."""
AXIS_POINTS: int = 5
"""Points of the axis of a capsule, and circles of a cylinder."""
ALONG: tuple[float, ...] = (0.0, 0.5)
"""Places along an edge that are looked for in a cylinder and in a surface."""
CONVEX: float = 1e-6
"""Height of a vertex above a face, of the size of the polyhedron, up to which it counts as convex."""
FLAT: float = 1e-9
"""1 less the cosine of the angle of two faces up to which the edge between them is a diagonal of one face."""
SAME_PLANE: float = 1e-6
"""Difference of unit normals, and of offsets over the size, up to which two faces are in one plane."""
DEEPEST: int = 3
"""Points inside a surface whose depth is computed: those that are farthest from its corners."""
OFF_MIDDLE = np.array([0.123, 0.271, 0.191])
"""Place of a point, of its depth, beside the middle of its body: bodies that start above a corner of a grid would meet no triangle."""
MOST_POINTS: int = 8
"""Points of a body that are looked at, evenly chosen of its parts."""
MOST_TRIED: int = 96
"""Faces of a closed surface, evenly chosen, below which a point inside is looked for."""
HALVINGS: int = 8
"""Heights below a face that are tried, each half of the one before; the first is half the size."""


@dataclass(frozen=True, eq=False)
class Probe:
    """What may enter another shape, in the shape's frame."""

    centres: np.ndarray  # (k, 3) m of balls
    radii: np.ndarray  # (k,) m
    edges: np.ndarray  # (e, 2, 3) m
    corners: np.ndarray  # (v, 3) m, their convex hull holds the shape; none for half spaces


@dataclass(frozen=True, eq=False)
class Solid:
    """What may be entered, in the shape's frame."""

    convex: list[np.ndarray]  # (m, 4) outward normals and offsets
    parts: Parts  # the same together
    rounded: list[tuple[np.ndarray, np.ndarray, float]]  # ends (3,) of a segment, and its radius, m
    cylinders: list[Primitive]
    hollow: list[Primitive]  # surfaces that are not convex, or open
    surface: np.ndarray  # (t, 3, 3) m, triangles of closed surfaces that are not convex
    middles: np.ndarray  # (4, t) m, of these triangles, and how far their corners are
    inside: tuple[Geometry, int] | None  # compiled shape of these surfaces
    bounds: np.ndarray  # (m, 4) planes behind which the shape is


@dataclass(frozen=True, eq=False)
class Posed:
    """Poses of a shape's frame in another, c of them."""

    rotation: np.ndarray  # (c, 3, 3)
    translation: np.ndarray  # (c, 3) m

    def points(self, x: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the shape in the other frame, (c, ..., 3)."""
        moved = x.reshape(-1, 3) @ self.rotation.swapaxes(1, 2) + self.translation[:, None]
        return moved.reshape(len(self.rotation), *x.shape)

    def part(self, which: np.ndarray) -> Posed:
        """The poses of these places or of this mask."""
        return Posed(self.rotation[which], self.translation[which])


@kept_with_argument
def _planes_of(shape: CompiledShape) -> list[np.ndarray | None]:
    """Planes (m, 4) of each primitive that is convex and has faces."""
    return [_convex_planes(primitive) if len(primitive.faces) else None for primitive in shape.primitives]


@kept_with_argument
def probe_of(shape: CompiledShape) -> Probe:
    """What of a shape may enter another one."""
    centres, radii, edges = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros((0, 2, 3))]
    for primitive, faces in zip(shape.primitives, _planes_of(shape), strict=True):
        if primitive.kind == CYLINDER:
            centres.append(_points_of(primitive))
            radii.append(np.zeros(len(centres[-1])))
        elif primitive.kind != HALF_SPACE and len(primitive.faces):
            edges += [_edges(primitive)] if faces is None else [_edges(primitive), _spokes(primitive, faces)]
        elif primitive.kind != HALF_SPACE:
            centres.append(_on_axis(primitive.vertices[0], primitive.vertices[-1]))
            radii.append(np.full(len(centres[-1]), primitive.radius))
    return Probe(np.vstack(centres), np.concatenate(radii), np.concatenate(edges), _hull_corners(shape))


@kept_with_argument
def solid_of(shape: CompiledShape) -> Solid:
    """What of a shape may be entered; open surfaces may not, and others only as part of a `whole_solid`."""
    solid, boxes = Solid([], parts_of([], []), [], [], [], np.zeros((0, 3, 3)), np.zeros((4, 0)), None, _bounds(shape)), []
    for primitive, faces in zip(shape.primitives, _planes_of(shape), strict=True):
        if primitive.kind == HALF_SPACE:
            solid.convex.append(primitive.frame[None, :4])
            boxes.append(np.array([[-np.inf], [np.inf]]) * np.ones(3))
        elif primitive.kind == CYLINDER:
            solid.cylinders.append(primitive)
        elif not len(primitive.faces):
            solid.rounded.append((primitive.vertices[0], primitive.vertices[-1], primitive.radius))
        elif faces is None:
            solid.hollow.append(primitive)
        else:
            solid.convex.append(faces)
            boxes.append(np.array([primitive.vertices.min(axis=0), primitive.vertices.max(axis=0)]))
    solid = replace(solid, parts=parts_of(solid.convex, boxes))
    if len(shape.primitives) == 1 and solid.convex and len(solid.convex[0]) <= MOST_BOUNDS:
        return replace(solid, bounds=np.vstack([solid.bounds, solid.convex[0]]))
    return solid


def whole_solid(solid: Solid, shape: CompiledShape, geometry: Geometry, index: int) -> Solid:
    """A solid with its surfaces that are not convex, if it has any; geometry, index: where its shape is compiled."""
    if not solid.hollow:
        return solid
    if len(solid.hollow) < len(shape.primitives):
        geometry, index = build_geometry([CompiledShape(tuple(solid.hollow))]), 0
    surface = np.concatenate([p.vertices[p.faces] for p in solid.hollow])
    return replace(solid, surface=surface, middles=middles_of(surface), inside=(geometry, index))


def surely_apart(corners: np.ndarray, bounds: np.ndarray, posed: Posed, allowed: np.ndarray | float = 0.0) -> np.ndarray:
    """Which of c probes (c,) are in front of a plane behind which the solid is, and so apart from it.

    corners: (c, v, 3) or (1, v, 3) of the probes, bounds: (c, m, 4) or (1, m, 4) of the solids; without any nothing is known.
    allowed: m, (c,) or one for all, by which probes may be behind the plane.
    """
    if not corners.shape[1] or not bounds.shape[1]:
        return np.zeros(len(posed.translation), bool)
    placed = corners @ posed.rotation.swapaxes(1, 2) + posed.translation[:, None]
    heights = placed @ bounds[:, :, :3].swapaxes(1, 2) - bounds[:, None, :, 3]
    return heights.min(axis=1).max(axis=1) > -allowed


def depth_in(solid: Solid, probe: Probe, posed: Posed) -> np.ndarray:
    """Depth (c,) m by which probes at c poses in the frame of a solid are inside it; 0 where nothing is known to be."""
    depth = np.zeros(len(posed.translation))
    centres = posed.points(probe.centres)
    for planes in solid.convex if len(probe.centres) else []:
        np.maximum(depth, _balls_in_planes(planes, centres, probe.radii), out=depth)
    if solid.convex and len(probe.edges):
        enter_with_edges(solid.parts, probe.edges, *map(np.ascontiguousarray, (posed.rotation, posed.translation)), depth)
    if not (solid.rounded or solid.cylinders or solid.inside):
        return depth
    edges = posed.points(probe.edges)
    points = np.concatenate([centres, *(edges[:, :, 0] + s * (edges[:, :, 1] - edges[:, :, 0]) for s in ALONG)], axis=1)
    radii = np.concatenate([probe.radii, np.zeros(points.shape[1] - len(probe.radii))])
    for first, last, radius in solid.rounded:
        inside = radius + probe.radii - _distance_to_segment(centres, first, last)
        np.maximum(depth, inside.max(axis=1, initial=0.0), out=depth)
        for centre in _on_axis(first, last):
            np.maximum(depth, (radius - _distance_of_edges(edges, centre)).max(axis=1, initial=0.0), out=depth)
    for cylinder in solid.cylinders:
        np.maximum(depth, (radii + _depth_in_cylinder(cylinder, points)).max(axis=1, initial=0.0), out=depth)
    if solid.inside is not None:
        np.maximum(depth, _depth_in_surface(solid, points, radii), out=depth)
    return depth


def _balls_in_planes(planes: np.ndarray, centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Depth (c,) of balls (c, k) behind planes (m, 4)."""
    height = centres @ planes[:, :3].T - planes[:, 3]
    nearest = height.argmax(axis=2)
    top = np.take_along_axis(height, nearest[:, :, None], axis=2)[:, :, 0]
    depth = radii - top
    beside = top > 0.0
    if len(planes) > 1 and np.any(beside & (depth > 0.0)):
        # The foot on the nearest face must be behind all others.
        foot = centres - top[:, :, None] * planes[nearest, :3]
        behind = foot @ planes[:, :3].T - planes[:, 3]
        np.put_along_axis(behind, nearest[:, :, None], 0.0, axis=2)
        depth[beside & (behind.max(axis=2) > 0.0)] = 0.0
    return depth.max(axis=1, initial=0.0)


def _distance_to_segment(points: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Distance (c, k) of points (c, k, 3) from a segment, m."""
    along = last - first
    length = float(along @ along)
    place = np.clip((points - first) @ along / length, 0.0, 1.0) if length > 0.0 else np.zeros(points.shape[:2])
    return np.linalg.norm(points - first - place[:, :, None] * along, axis=2)


def _distance_of_edges(edges: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Distance (c, e) of edges (c, e, 2, 3) from a point (3,), m."""
    begin, along = edges[:, :, 0], edges[:, :, 1] - edges[:, :, 0]
    squared = np.einsum("cei,cei->ce", along, along)
    place = np.einsum("cei,cei->ce", point - begin, along)
    place = np.clip(np.divide(place, squared, out=np.zeros_like(place), where=squared > 0.0), 0.0, 1.0)
    return np.linalg.norm(begin + place[:, :, None] * along - point, axis=2)


def _on_axis(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Points (k, 3) of the axis of a capsule, evenly spread; the middle of a sphere."""
    places = np.linspace(0.0, 1.0, AXIS_POINTS if np.any(first != last) else 1)
    return first + places[:, None] * (last - first)


def _depth_in_cylinder(cylinder: Primitive, points: np.ndarray) -> np.ndarray:
    """Depth (c, k) of points in a cylinder, less the distance from it outside, m."""
    axis = cylinder.frame[3:6]
    from_centre = points - cylinder.frame[:3]
    along = from_centre @ axis
    across = np.linalg.norm(from_centre - along[:, :, None] * axis, axis=2)
    side, cap = cylinder.radius - across, cylinder.frame[6] - np.abs(along)
    return np.where((side > 0.0) & (cap > 0.0), np.minimum(side, cap), -np.hypot(np.minimum(side, 0.0), np.minimum(cap, 0.0)))


def _depth_in_surface(solid: Solid, points: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Depth (c,) of balls of radii (k,) about points (c, k, 3) in the surfaces of a solid, m; of points those that are inside count."""
    if solid.inside is None:
        return np.zeros(len(points))
    depth, (geometry, index) = np.zeros(len(points)), solid.inside
    corners = solid.surface.reshape(-1, 3)
    low, high = (-solid.bounds[:3, 3], solid.bounds[3:6, 3]) if len(solid.bounds) else (-np.inf, np.inf)
    near = np.all((points > low - radii[:, None]) & (points < high + radii[:, None]), axis=2)
    pose, place = np.nonzero(near)
    if not len(pose):
        return depth
    # All poses at once: to ask pose by pose took longer than to answer.
    centres, r = points[pose, place], radii[place]
    inside = points_inside(geometry, index, centres)
    counts = np.flatnonzero(inside | (r > 0.0))
    for c in np.unique(pose[counts]).tolist():
        chosen = counts[pose[counts] == c]
        if len(chosen) > DEEPEST:
            far = np.linalg.norm(centres[chosen, None] - corners[None, :: max(len(corners) // MOST_EDGES, 1)], axis=2).min(axis=1)
            chosen = chosen[np.argsort(np.where(inside[chosen], -far, far), kind="stable")[:DEEPEST]]
        for k in chosen.tolist():
            distance = distance_from_triangles(solid.surface, solid.middles, centres[k])
            depth[c] = max(depth[c], r[k] + distance if inside[k] else r[k] - distance)
    return depth


@kept_with_argument
def inner_points(shape: CompiledShape) -> np.ndarray:
    """Points inside a shape, and how deep they are in it, (k, 4) m; points of open surfaces have no depth."""
    points = [_point_in(primitive, planes) for primitive, planes in zip(shape.primitives, _planes_of(shape), strict=True)]
    points = [point for point in points if point is not None]
    return np.array(points[:: -(-len(points) // MOST_POINTS)]).reshape(-1, 4) if points else np.zeros((0, 4))


def _point_in(primitive: Primitive, planes: np.ndarray | None) -> np.ndarray | None:
    """A point (4,) in a primitive, and its depth; None in half spaces, which others are above or inside."""
    if primitive.kind == HALF_SPACE:
        return None
    if primitive.kind == CYLINDER:
        middle, rho = primitive.frame[:3], min(primitive.radius, float(primitive.frame[6]))
    elif not len(primitive.faces):
        middle, rho = primitive.vertices.mean(axis=0), primitive.radius
    elif planes is not None:
        middle = primitive.vertices.mean(axis=0)
        rho = float((planes[:, 3] - planes[:, :3] @ middle).min())
    else:
        return _point_in_surface(primitive)
    beside = OFF_MIDDLE * rho
    return np.array([*(middle + beside), rho - float(np.linalg.norm(beside))])


def _point_in_surface(primitive: Primitive) -> np.ndarray:
    """The same of a surface that is not convex: below the middle of a face; on it if nothing is inside."""
    triangles = primitive.vertices[primitive.faces]
    chosen = slice(None, None, -(-len(triangles) // MOST_TRIED))
    middle, normal = triangles[chosen].mean(axis=1), _normals(primitive)[chosen]
    geometry, size = build_geometry([CompiledShape((primitive,))]), float(np.ptp(primitive.vertices, axis=0).max())
    for height in 0.5 ** np.arange(1, HALVINGS + 1) * size:
        below = middle - height * normal
        below = below[points_inside(geometry, 0, below)]
        if len(below):
            depths = [distance_from_triangles(triangles, middles_of(triangles), point) for point in below]
            return np.array([*below[int(np.argmax(depths))], max(depths)])
    return np.array([*middle[0], 0.0])


def middles_of(triangles: np.ndarray) -> np.ndarray:
    """Coordinates of the middles of triangles (t, 3, 3), and how far their corners are from them, (4, t) m."""
    middle = triangles.mean(axis=1)
    return np.vstack([middle.T, np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)])


def distance_from_triangles(triangles: np.ndarray, middles: np.ndarray, point: np.ndarray) -> float:
    """Distance of a point (3,) from triangles (t, 3, 3), m; middles: of them, see `middles_of`."""
    # With trimesh comes half a second of imports, which the first picture of simple shapes need not wait for.
    from trimesh.triangles import closest_point

    # One coordinate after the other: along an axis of three numpy takes ten times as long.
    x, y, z = (middles[k] - point[k] for k in range(3))
    from_middles = np.sqrt(x * x + y * y + z * z)
    # Middles are points of the surface: no triangle that is farther away than the nearest of them counts.
    near = triangles[from_middles - middles[3] <= from_middles.min()]
    nearest = closest_point(near, np.broadcast_to(point, (len(near), 3)))
    return float(np.linalg.norm(nearest - point, axis=1).min())


def _hull_corners(shape: CompiledShape) -> np.ndarray:
    """Points (v, 3) whose convex hull holds a shape; none for shapes with half spaces."""
    if any(primitive.kind == HALF_SPACE for primitive in shape.primitives):
        return np.zeros((0, 3))
    polyhedra = all(len(primitive.faces) for primitive in shape.primitives)
    if polyhedra and sum(len(primitive.vertices) for primitive in shape.primitives) <= MOST_BOUNDS:
        return np.vstack([primitive.vertices for primitive in shape.primitives])
    low, high = box_of(shape)
    return np.where(CORNERS_OF_BOX, high, low)


def _bounds(shape: CompiledShape) -> np.ndarray:
    """Planes (6, 4) of the box of a shape; none for shapes with half spaces."""
    low, high = box_of(shape)
    return np.column_stack([np.vstack([-np.eye(3), np.eye(3)]), [*-low, *high]]) if np.all(np.isfinite(high)) else np.zeros((0, 4))


@kept_with_argument
def box_of(shape: CompiledShape) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner (3,) m of a shape along the axes of its frame; without end for half spaces."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for primitive in shape.primitives:
        if primitive.kind == HALF_SPACE:
            return np.full(3, -np.inf), np.full(3, np.inf)
        points, reach = primitive.vertices, np.full(3, primitive.radius)
        if primitive.kind == CYLINDER:
            axis = primitive.frame[3:6]
            points = primitive.frame[:3] + np.outer([-1.0, 1.0], primitive.frame[6] * axis)
            reach = primitive.radius * np.sqrt(np.maximum(1.0 - axis * axis, 0.0))
        low, high = np.minimum(low, points.min(axis=0) - reach), np.maximum(high, points.max(axis=0) + reach)
    return low, high


def _points_of(cylinder: Primitive) -> np.ndarray:
    """Points (k, 3) of a cylinder: of both rims, of circles between them, and of the caps."""
    axis = cylinder.frame[3:6]
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= np.linalg.norm(across)
    angle = 2.0 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    circle = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(axis, across)
    circles = [(1.0, height) for height in np.linspace(-1.0, 1.0, AXIS_POINTS)] + [(0.5, -1.0), (0.5, 1.0)]
    return cylinder.frame[:3] + np.vstack([part * cylinder.radius * circle + s * cylinder.frame[6] * axis for part, s in circles])


def _edges(primitive: Primitive) -> np.ndarray:
    """Edges (e, 2, 3) of a polyhedron that are no diagonals of flat faces; evenly chosen where there are many.

    Of surfaces of very many faces one side of each chosen face: edges in flat faces do no harm.
    """
    if len(primitive.faces) > MOST_SORTED:
        return primitive.vertices[primitive.faces[:: -(-len(primitive.faces) // MOST_EDGES), :2]]
    normals = _normals(primitive)
    sides, owner = _sides(primitive.faces)
    pair = np.flatnonzero(np.all(sides[1:] == sides[:-1], axis=1))
    flat = np.zeros(len(sides), bool)
    same = (normals[owner[pair]] * normals[owner[pair + 1]]).sum(axis=1) > 1.0 - FLAT
    flat[pair[same]] = flat[pair[same] + 1] = True
    twin = np.zeros(len(sides), bool)
    twin[pair + 1] = True
    chosen = sides[~flat & ~twin]
    return primitive.vertices[chosen[:: -(-len(chosen) // MOST_EDGES)]] if len(chosen) else np.zeros((0, 2, 3))


def _spokes(primitive: Primitive, planes: np.ndarray) -> np.ndarray:
    """Lines (e, 2, 3) from the middle of a convex polyhedron to the middles of its faces."""
    corners, middle = primitive.vertices, primitive.vertices.mean(axis=0)
    planes = planes[:: -(-len(planes) // MOST_SPOKES)]
    on_face = np.abs(corners @ planes[:, :3].T - planes[:, 3]) <= CONVEX * np.ptp(corners, axis=0).max()
    faces = on_face.T @ corners / on_face.sum(axis=0)[:, None]
    return np.stack([np.broadcast_to(middle, faces.shape), faces], axis=1)


def _sides(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (3 t, 2) of the sides of faces (t, 3), sorted, and the face (3 t,) of each."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    order = np.lexsort((sides[:, 1], sides[:, 0]))
    return sides[order], np.repeat(np.arange(len(faces)), 3)[order]


def _normals(primitive: Primitive) -> np.ndarray:
    """Unit normals (t, 3) of faces, zeros of those without area."""
    corners = primitive.vertices[primitive.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)


def _convex_planes(primitive: Primitive) -> np.ndarray | None:
    """Planes (m, 4) of a convex polyhedron, one for all faces in it; None for other surfaces, and those of very many faces."""
    if len(primitive.faces) > MOST_FACES:
        return None
    sides, _ = _sides(primitive.faces)
    if len(sides) % 2 or np.any(sides[::2] != sides[1::2]):
        return None
    normals = _normals(primitive)
    offsets = np.einsum("ij,ij->i", normals, primitive.vertices[primitive.faces[:, 0]])
    size = float(np.ptp(primitive.vertices, axis=0).max())
    if (primitive.vertices @ normals.T - offsets).max() > CONVEX * size:
        return None
    planes = np.column_stack([normals, offsets])[np.any(normals != 0.0, axis=1)]
    _, kept = np.unique(np.round(planes / [1.0, 1.0, 1.0, size] / SAME_PLANE), axis=0, return_index=True)
    return planes[np.sort(kept)]
