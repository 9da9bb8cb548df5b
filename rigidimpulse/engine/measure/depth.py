"""How deep points and edges of one shape are inside another: lower bounds of the depth of penetration, without the solver's geometry.

A shape is looked at as what may enter another one, its probes, and as what may be entered, its solids. All are made of the primitives of
the compiled shape, in its principal frame.

    probe   a ball (c, r): a sphere, points of the axis of a capsule; or an edge (p, q) of a polyhedron; or points of the rims of a cylinder
    solid   n.x <= d for all faces of a half space or a convex polyhedron; a segment with a radius; a cylinder; a closed surface

A point at the depth d in a convex solid, its least distance from the faces, has to move by d to come out, and with it the body: the depth of
penetration is d or more. A ball around it has to move by d + r. An edge is cut by the planes of all faces; the depth is a concave function
along what is left, and the largest of the depths at both ends and in the middle is at least half the largest of all. Two convex polyhedra
are inside each other if and only if an edge of one enters the other. A ball outside a face is as deep as r - h, h its height above the
face, if its foot lies in the face; feet beside it do not count. The ball is then found by the edges of the polyhedron.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from trimesh.triangles import closest_point

from rigidimpulse.collision.containment import points_inside
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, Geometry, build_geometry
from rigidimpulse.collision.geometry import CompiledShape, Primitive

MOST_EDGES: int = 192
"""Edges of a primitive that are looked at, evenly chosen of all; all corners of those with fewer count."""
MOST_FACES: int = 400
"""Faces up to which a polyhedron may be looked at as convex; larger ones are surfaces."""
RIM_POINTS: int = 24
"""Points of a rim of a cylinder: they are off the rim by less than 1 % of its radius."""
AXIS_POINTS: int = 5
"""Points of the axis of a capsule."""
ALONG: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75)
"""Places along an edge that are looked for in a surface."""
CONVEX: float = 1e-6
"""Height of a vertex above a face, of the size of the polyhedron, up to which it counts as convex."""
FLAT: float = 1e-9
"""1 less the cosine of the angle of two faces up to which the edge between them is a diagonal of one face."""
SAME_PLANE: float = 1e-6
"""Difference of unit normals, and of offsets over the size, up to which two faces are in one plane."""
DEEPEST: int = 8
"""Points inside a surface whose depth is computed: those that are farthest from its corners."""


@dataclass(frozen=True, eq=False)
class Probe:
    """What may enter another shape, in the shape's frame."""

    centres: np.ndarray  # (k, 3) m of balls
    radii: np.ndarray  # (k,) m
    edges: np.ndarray  # (e, 2, 3) m


@dataclass(frozen=True, eq=False)
class Solid:
    """What may be entered, in the shape's frame."""

    convex: list[np.ndarray]  # (m, 4) outward normals and offsets
    rounded: list[tuple[np.ndarray, np.ndarray, float]]  # ends (3,) of a segment, and its radius, m
    cylinders: list[Primitive]
    surface: np.ndarray  # (t, 3, 3) m, triangles of closed surfaces that are not convex
    geometry: Geometry | None  # of these surfaces


@dataclass(frozen=True, eq=False)
class Posed:
    """Poses of a shape's frame in another, c of them."""

    rotation: np.ndarray  # (c, 3, 3)
    translation: np.ndarray  # (c, 3) m

    def points(self, x: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the shape in the other frame, (c, ..., 3)."""
        flat = x.reshape(-1, 3)
        return (np.einsum("cij,kj->cki", self.rotation, flat) + self.translation[:, None]).reshape(len(self.rotation), *x.shape)


def probe_of(shape: CompiledShape) -> Probe:
    """What of a shape may enter another one."""
    centres, radii, edges = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros((0, 2, 3))]
    for primitive in shape.primitives:
        if primitive.kind == CYLINDER:
            centres.append(_rims(primitive))
            radii.append(np.zeros(2 * RIM_POINTS))
        elif primitive.kind != HALF_SPACE and len(primitive.faces):
            edges.append(_edges(primitive))
        elif primitive.kind != HALF_SPACE:
            places = np.linspace(0.0, 1.0, AXIS_POINTS if len(primitive.vertices) > 1 else 1)[:, None]
            centres.append(primitive.vertices[0] + places * (primitive.vertices[-1] - primitive.vertices[0]))
            radii.append(np.full(len(places), primitive.radius))
    return Probe(np.vstack(centres), np.concatenate(radii), np.concatenate(edges))


def solid_of(shape: CompiledShape) -> Solid:
    """What of a shape may be entered; open surfaces may not."""
    solid, hollow = Solid([], [], [], np.zeros((0, 3, 3)), None), []
    for primitive in shape.primitives:
        if primitive.kind == HALF_SPACE:
            solid.convex.append(primitive.frame[None, :4])
        elif primitive.kind == CYLINDER:
            solid.cylinders.append(primitive)
        elif not len(primitive.faces):
            solid.rounded.append((primitive.vertices[0], primitive.vertices[-1], primitive.radius))
        else:
            planes = _convex_planes(primitive)
            if planes is None:
                hollow.append(primitive)
            else:
                solid.convex.append(planes)
    if not hollow:
        return solid
    geometry = build_geometry([CompiledShape(tuple(hollow))])
    surface = np.concatenate([p.vertices[p.faces] for p in hollow])
    return replace(solid, surface=surface, geometry=geometry)


def depth_in(solid: Solid, probe: Probe, posed: Posed) -> np.ndarray:
    """Depth (c,) m by which probes at c poses in the frame of a solid are inside it; 0 where nothing is known to be."""
    depth = np.zeros(len(posed.translation))
    centres, edges = posed.points(probe.centres), posed.points(probe.edges)
    for planes in solid.convex:
        if len(probe.centres):
            np.maximum(depth, _balls_in_planes(planes, centres, probe.radii), out=depth)
        if len(probe.edges):
            np.maximum(depth, _edges_in_planes(planes, edges), out=depth)
    points = np.concatenate([centres, *(edges[:, :, 0] + s * (edges[:, :, 1] - edges[:, :, 0]) for s in ALONG)], axis=1)
    radii = np.concatenate([probe.radii, np.zeros(points.shape[1] - len(probe.radii))])
    for first, last, radius in solid.rounded:
        inside = radius + radii - _distance_to_segment(points, first, last)
        np.maximum(depth, inside.max(axis=1, initial=0.0), out=depth)
    for cylinder in solid.cylinders:
        np.maximum(depth, _depth_in_cylinder(cylinder, points).max(axis=1, initial=0.0), out=depth)
    if solid.geometry is not None:
        np.maximum(depth, _depth_in_surface(solid.surface, solid.geometry, points), out=depth)
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


def _edges_in_planes(planes: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Depth (c,) of edges (c, e, 2, 3) behind planes (m, 4): the largest at both ends and in the middle of what is behind all."""
    height = edges @ planes[:, :3].T - planes[:, 3]
    at_p, at_q = height[:, :, 0], height[:, :, 1]
    slope = at_q - at_p
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -at_p / slope
    begin = np.where(slope < 0.0, crossing, 0.0).max(axis=2, initial=0.0)
    end = np.where(slope > 0.0, crossing, 1.0).min(axis=2, initial=1.0)
    depth = np.zeros(begin.shape)
    for place in (begin, 0.5 * (begin + end), end):
        np.maximum(depth, -(at_p + place[:, :, None] * slope).max(axis=2), out=depth)
    # Edges in a plane of which they are in front have no crossing: the heights tell.
    return np.where(begin <= end, depth, 0.0).max(axis=1, initial=0.0)


def _distance_to_segment(points: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Distance (c, k) of points (c, k, 3) from a segment, m."""
    along = last - first
    length = float(along @ along)
    place = np.clip((points - first) @ along / length, 0.0, 1.0) if length > 0.0 else np.zeros(points.shape[:2])
    return np.linalg.norm(points - first - place[:, :, None] * along, axis=2)


def _depth_in_cylinder(cylinder: Primitive, points: np.ndarray) -> np.ndarray:
    """Depth (c, k) of points in a cylinder, negative outside, m."""
    axis = cylinder.frame[3:6]
    from_centre = points - cylinder.frame[:3]
    along = from_centre @ axis
    across = np.linalg.norm(from_centre - along[:, :, None] * axis, axis=2)
    return np.minimum(cylinder.radius - across, cylinder.frame[6] - np.abs(along))


def _depth_in_surface(surface: np.ndarray, geometry: Geometry, points: np.ndarray) -> np.ndarray:
    """Depth (c,) of points (c, k, 3) in closed surfaces (t, 3, 3), m."""
    depth = np.zeros(len(points))
    corners = surface.reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    near = np.all((points > low) & (points < high), axis=2)
    for c in np.flatnonzero(near.any(axis=1)).tolist():
        inside = points[c, near[c]]
        inside = inside[points_inside(geometry, 0, inside)]
        if len(inside) > DEEPEST:
            step = max(len(corners) // MOST_EDGES, 1)
            far = np.linalg.norm(inside[:, None] - corners[None, ::step], axis=2).min(axis=1)
            inside = inside[np.argsort(-far, kind="stable")[:DEEPEST]]
        for point in inside:
            nearest = closest_point(surface, np.broadcast_to(point, (len(surface), 3)))
            depth[c] = max(depth[c], float(np.linalg.norm(nearest - point, axis=1).min()))
    return depth


def _rims(cylinder: Primitive) -> np.ndarray:
    """Points (2 RIM_POINTS, 3) of both rims."""
    axis = cylinder.frame[3:6]
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= np.linalg.norm(across)
    angle = 2.0 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    rim = cylinder.radius * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(axis, across))
    cap = cylinder.frame[6] * axis
    return cylinder.frame[:3] + np.vstack([rim + cap, rim - cap])


def _edges(primitive: Primitive) -> np.ndarray:
    """Edges (e, 2, 3) of a polyhedron that are no diagonals of flat faces; evenly chosen where there are many."""
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
    sides, _ = _sides(primitive.faces)
    if len(primitive.faces) > MOST_FACES or len(sides) % 2 or np.any(sides[::2] != sides[1::2]):
        return None
    normals = _normals(primitive)
    offsets = np.einsum("ij,ij->i", normals, primitive.vertices[primitive.faces[:, 0]])
    size = float(np.ptp(primitive.vertices, axis=0).max())
    if (primitive.vertices @ normals.T - offsets).max() > CONVEX * size:
        return None
    planes = np.column_stack([normals, offsets])[np.any(normals != 0.0, axis=1)]
    _, kept = np.unique(np.round(planes / [1.0, 1.0, 1.0, size] / SAME_PLANE), axis=0, return_index=True)
    return planes[np.sort(kept)]
