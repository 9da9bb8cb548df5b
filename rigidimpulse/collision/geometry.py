"""Compiled shapes: every surface of a scene in the flat arrays that all kernels read.

A shape is a list of primitives: half spaces, cylinders, and *round* ones (a set of triangles grown by a radius: a
sphere is one point, a capsule one segment, a box, hull or mesh a surface with radius 0). Coordinates are those of the
body's principal frame (origin at the centre of mass, axes along the principal axes).

Each vertex and each edge is owned by one of its triangles, so that a pair of features is visited once. Edges are
classed by the signed sine of their dihedral angle, (n_0 x n_1) . d with d the direction of the edge in the winding of
face 0: positive is convex. Flat and concave edges never touch another edge, and a vertex on a straight crease never
touches a face before the ends of the crease do.

The box tree is split at the median of the triangles' centres along their widest axis; children of a node are
neighbours in the arrays, and triangles are stored in the order of the leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.collision.normal_cones import Features, edge_cones, every_direction, node_cones, unit_vectors, vertex_cones
from rigidimpulse.core.portable import dot, matmul
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.triangles import unique_edges

if TYPE_CHECKING:
    from rigidimpulse.scene.shape import Shape

HALF_SPACE, ROUND, CYLINDER = 0, 1, 2
"""Kinds of primitive."""

EDGE_HIDDEN, EDGE_CONVEX, EDGE_BOUNDARY, EDGE_CAPSULE = 0, 1, 2, 3
"""Kinds of edge: flat or concave, convex, boundary (or not manifold), axis of a capsule."""

LEAF_SIZE = 2
"""Most triangles in a leaf of the box tree."""
WORTH_CONES = 128
"""Triangles of a surface from which on a search is faster with cones of normals."""

_POINT_OWNS = 0b000001  # a sphere's triangle (v, v, v) owns its vertex
_SEGMENT_OWNS = 0b001011  # a capsule's triangle (a, b, b) owns both vertices and edge 0


@dataclass(frozen=True, eq=False)
class Primitive:
    """One convex or triangulated piece of a shape, in the principal frame of its body.

    Attributes:
        kind: `HALF_SPACE`, `ROUND` or `CYLINDER`.
        radius: rounding radius (`ROUND`) or rim radius (`CYLINDER`), m.
        frame: (7,) half space: unit normal, offset; cylinder: centre, unit axis, half height; else zeros.
        vertices: (v, 3) m; one for a sphere, two for a capsule.
        faces: (f, 3) indices, counter-clockwise seen from outside; empty for a sphere and a capsule.

    """

    kind: int
    radius: float = 0.0
    frame: np.ndarray = field(default_factory=lambda: np.zeros(7))
    vertices: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    faces: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))


@dataclass(frozen=True, eq=False)
class CompiledShape:
    """The primitives of one shape, in the principal frame of the bodies that use it."""

    primitives: tuple[Primitive, ...]


class Geometry(NamedTuple):
    """All compiled shapes of a scene: s shapes, p primitives, V vertices, T triangles, E edges, N tree nodes.

    All stored indices are absolute. Ranges: entry k to entry k + 1 of the `_first` arrays.
    """

    shape_first: np.ndarray  # (s+1,) primitives of a shape
    kind: np.ndarray  # (p,) HALF_SPACE, ROUND, CYLINDER
    radius: np.ndarray  # (p,) m
    frame: np.ndarray  # (p, 7) see Primitive
    bound_centre: np.ndarray  # (p, 3) bounding sphere, radius included
    bound_radius: np.ndarray  # (p,) inf for a half space
    closed: np.ndarray  # (p,) bool: the surface bounds a solid
    vertex_first: np.ndarray  # (p+1,)
    triangle_first: np.ndarray  # (p+1,)
    edge_first: np.ndarray  # (p+1,)
    node_first: np.ndarray  # (p+1,)
    vertex: np.ndarray  # (V, 3)
    vertex_corner: np.ndarray  # (V,) bool: may touch a face
    vertex_edge_first: np.ndarray  # (V+1,)
    vertex_edge: np.ndarray  # (2E,) edges around each vertex
    triangle: np.ndarray  # (T, 3); sphere (v, v, v), capsule (a, b, b)
    triangle_normal: np.ndarray  # (T, 3) unit, outward; zeros for sphere and capsule
    triangle_edge: np.ndarray  # (T, 3) edge k joins vertices k and (k + 1) % 3; -1 for none
    triangle_owns: np.ndarray  # (T,) bits 0-2: owns vertex k; bits 3-5: owns edge k
    touching_first: np.ndarray  # (T+1,)
    touching: np.ndarray  # (F,) what a triangle owns that may touch: 2 * vertex for a corner, 2 * edge + 1 for an edge in sight
    edge: np.ndarray  # (E, 2)
    edge_normal: np.ndarray  # (E, 2, 3) normals of both faces; one face twice at a boundary; zeros for a capsule
    edge_kind: np.ndarray  # (E,) EDGE_HIDDEN, EDGE_CONVEX, EDGE_BOUNDARY, EDGE_CAPSULE
    node_min: np.ndarray  # (N, 3) box without the radius
    node_max: np.ndarray  # (N, 3)
    node_child: np.ndarray  # (N,) left child, the right one is next to it; -1 for a leaf
    node_start: np.ndarray  # (N,) first triangle
    node_count: np.ndarray  # (N,) number of triangles
    node_cone: np.ndarray  # (N, 11) of the normals with which it can touch, see `normal_cones.node_cones`


_COUNTED = {
    "shape_first": "kind", "vertex_first": "vertex", "triangle_first": "triangle", "edge_first": "edge", "node_first": "node_child",
    "vertex_edge_first": "vertex_edge", "touching_first": "touching", "triangle": "vertex", "edge": "vertex", "vertex_edge": "edge",
    "triangle_edge": "edge", "node_child": "node_child", "node_start": "triangle",
}  # fmt: skip
"""Arrays of a `Geometry` with indices, and the array whose entries they count."""


class Shapes(NamedTuple):
    """The shapes of the bodies of a scene."""

    geometry: Geometry
    of_body: np.ndarray  # (n,) shape of each body


class _Surface(NamedTuple):
    """Arrays of one primitive, with indices that start at 0; names as in `Geometry`."""

    closed: bool
    vertex: np.ndarray
    vertex_corner: np.ndarray
    triangle: np.ndarray
    triangle_normal: np.ndarray
    triangle_edge: np.ndarray
    triangle_owns: np.ndarray
    edge: np.ndarray
    edge_normal: np.ndarray
    edge_kind: np.ndarray
    node_min: np.ndarray
    node_max: np.ndarray
    node_child: np.ndarray
    node_start: np.ndarray
    node_count: np.ndarray
    node_cone: np.ndarray


def build_geometry(shapes: Sequence[CompiledShape]) -> Geometry:
    """Put the compiled shapes of a scene into the flat arrays of a `Geometry`, in the given order."""
    primitives = [primitive for shape in shapes for primitive in shape.primitives]
    surfaces = [_surface(primitive) for primitive in primitives]
    vertex_first = _offsets([len(s.vertex) for s in surfaces])
    triangle_first = _offsets([len(s.triangle) for s in surfaces])
    edge_first = _offsets([len(s.edge) for s in surfaces])
    node_first = _offsets([len(s.node_child) for s in surfaces])
    vertex_corner = _join([s.vertex_corner for s in surfaces], (0,), np.bool_)
    triangle = _join([s.triangle for s in surfaces], (0, 3), np.int64, vertex_first)
    triangle_edge = _join([s.triangle_edge for s in surfaces], (0, 3), np.int64, edge_first)
    triangle_owns = _join([s.triangle_owns for s in surfaces], (0,), np.int64)
    edge_kind = _join([s.edge_kind for s in surfaces], (0,), np.int64)
    touching_first, touching = _touching(triangle, triangle_edge, triangle_owns, vertex_corner, edge_kind)
    edge = _join([s.edge for s in surfaces], (0, 2), np.int64, vertex_first)
    vertex_edge_first, vertex_edge = _edges_around_vertices(edge, int(vertex_first[-1]))
    bounds = [_bounding_sphere(primitive) for primitive in primitives]
    return Geometry(
        shape_first=_offsets([len(shape.primitives) for shape in shapes]),
        kind=np.array([p.kind for p in primitives], dtype=np.int64),
        radius=np.array([p.radius for p in primitives], dtype=np.float64),
        frame=_join([p.frame[None, :] for p in primitives], (0, 7), np.float64),
        bound_centre=_join([centre[None, :] for centre, _ in bounds], (0, 3), np.float64),
        bound_radius=np.array([radius for _, radius in bounds], dtype=np.float64),
        closed=np.array([s.closed for s in surfaces], dtype=np.bool_),
        vertex_first=vertex_first,
        triangle_first=triangle_first,
        edge_first=edge_first,
        node_first=node_first,
        vertex=_join([s.vertex for s in surfaces], (0, 3), np.float64),
        vertex_corner=vertex_corner,
        vertex_edge_first=vertex_edge_first,
        vertex_edge=vertex_edge,
        triangle=triangle,
        triangle_normal=_join([s.triangle_normal for s in surfaces], (0, 3), np.float64),
        triangle_edge=triangle_edge,
        triangle_owns=triangle_owns,
        touching_first=touching_first,
        touching=touching,
        edge=edge,
        edge_normal=_join([s.edge_normal for s in surfaces], (0, 2, 3), np.float64),
        edge_kind=edge_kind,
        node_min=_join([s.node_min for s in surfaces], (0, 3), np.float64),
        node_max=_join([s.node_max for s in surfaces], (0, 3), np.float64),
        node_child=_join([s.node_child for s in surfaces], (0,), np.int64, node_first),
        node_start=_join([s.node_start for s in surfaces], (0,), np.int64, triangle_first),
        node_count=_join([s.node_count for s in surfaces], (0,), np.int64),
        node_cone=_join([s.node_cone for s in surfaces], (0, 11), np.float64),
    )


def joined(first: Geometry, second: Geometry) -> Geometry:
    """The shapes of two geometries, those of the second behind those of the first."""
    fields = {}
    for name, a in first._asdict().items():
        b = getattr(second, name)
        if name in _COUNTED:
            shift = len(getattr(first, _COUNTED[name]))
        elif name == "touching":
            shift = np.where(b % 2 == 0, 2 * len(first.vertex), 2 * len(first.edge))
        else:
            fields[name] = np.concatenate([a, b])
            continue
        fields[name] = np.concatenate([a[:-1] if name.endswith("_first") else a, np.where(b < 0, b, b + shift)])
    return Geometry(**fields)


def compile_shape(shape: Shape, center_of_mass: ArrayLike, principal_rotation: ArrayLike) -> CompiledShape:
    """Put every primitive of a shape into the principal frame of a body.

    Args:
        shape: the shape, in the body's own frame.
        center_of_mass: (3,) m, body frame.
        principal_rotation: (3, 3), its columns are the principal axes in the body frame.

    Raises:
        SceneError: the shape has no valid surface (see `Shape.check`).

    """
    shape.check()
    centre = np.asarray(center_of_mass, dtype=np.float64)
    axes = np.asarray(principal_rotation, dtype=np.float64)
    primitives = []
    for part in shape.parts_flat():
        rotation = matmul(axes.T, part.rotation)
        position = dot(axes.T, part.position - centre)
        primitives.append(_place(part.shape, rotation, position))
    return CompiledShape(tuple(primitives))


def _place(shape: Shape, rotation: np.ndarray, position: np.ndarray) -> Primitive:
    """Return the primitive of a single shape moved by a rotation, then a translation."""
    if shape.kind == "half_space":
        normal, offset = shape.plane()
        normal = dot(rotation, normal)
        return Primitive(HALF_SPACE, frame=np.array([*normal, offset + dot(normal, position), 0.0, 0.0, 0.0]))
    if shape.kind == "sphere":
        return Primitive(ROUND, shape.radius, vertices=position[None, :])
    half_axis = rotation[:, 2] * (0.5 * shape.height)
    if shape.kind == "capsule":
        return Primitive(ROUND, shape.radius, vertices=np.array([position - half_axis, position + half_axis]))
    if shape.kind == "cylinder":
        return Primitive(CYLINDER, shape.radius, frame=np.array([*position, *rotation[:, 2], 0.5 * shape.height]))
    surface = shape.surface()
    return Primitive(ROUND, vertices=matmul(surface.vertices, rotation.T) + position, faces=surface.faces)


def _surface(primitive: Primitive) -> _Surface:
    """Return the arrays of one primitive."""
    if primitive.kind != ROUND or len(primitive.faces) == 0:
        return _curved_surface(primitive)
    vertex = np.ascontiguousarray(primitive.vertices, dtype=np.float64)
    faces = np.asarray(primitive.faces, dtype=np.int64)
    order, nodes = _box_tree(vertex[faces])
    triangle = np.ascontiguousarray(faces[order])
    corners = vertex[triangle]
    area_vector = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    triangle_normal = unit_vectors(area_vector)
    edge, edge_normal, edge_kind, triangle_edge, edge_owner, balanced = _edges(vertex, triangle, triangle_normal)
    # Each vertex and edge is owned by one triangle, so that a pair of features is visited once.
    _, vertex_owner = np.unique(triangle.ravel(), return_index=True)
    owns = np.zeros((len(triangle), 6), dtype=np.int64)
    owns[vertex_owner // 3, vertex_owner % 3] = 1
    owns[edge_owner // 3, 3 + edge_owner % 3] = 1
    # A closed surface has a positive volume; turned inside out it encloses nothing.
    volume = float(np.sum((corners[:, 0] - vertex[0]) * area_vector))
    surface = _Surface(
        closed=balanced and volume > 0.0,
        vertex=vertex,
        vertex_corner=_corners(vertex, edge, edge_kind),
        triangle=triangle,
        triangle_normal=triangle_normal,
        triangle_edge=triangle_edge,
        triangle_owns=owns @ (1 << np.arange(6)),
        edge=edge,
        edge_normal=edge_normal,
        edge_kind=edge_kind,
        node_min=nodes[0],
        node_max=nodes[1],
        node_child=nodes[2],
        node_start=nodes[3],
        node_count=nodes[4],
        node_cone=every_direction(len(nodes[4])),
    )
    # The back of what bounds no solid is outside too.
    worth = surface.closed and len(triangle) >= WORTH_CONES
    return surface._replace(node_cone=_cones(surface, owns)) if worth else surface


def _cones(surface: _Surface, owns: np.ndarray) -> np.ndarray:
    """Return the cones (N, 11) of the nodes of a surface that bounds a solid; owns (t, 6): bits of `triangle_owns`."""
    triangle, corner, num_vertices = surface.triangle, surface.vertex_corner, len(surface.vertex)
    normals = np.repeat(surface.triangle_normal, 3, axis=0)
    total = np.column_stack([np.bincount(triangle.ravel(), weights=normals[:, k], minlength=num_vertices) for k in range(3)])
    vertex_axis = unit_vectors(total)
    vertex_angle = np.where(corner, vertex_cones(surface.vertex, surface.edge, vertex_axis), -1.0)
    kind = surface.edge_kind
    edge_axis, edge_angle = edge_cones(surface.edge_normal, kind == EDGE_CONVEX, kind == EDGE_HIDDEN)
    features = Features(
        triangle, surface.triangle_edge, owns, surface.triangle_normal, vertex_axis, vertex_angle, edge_axis, edge_angle
    )
    return node_cones(features, surface.node_start, surface.node_child)


def _curved_surface(primitive: Primitive) -> _Surface:
    """Return the arrays of a sphere (1 vertex), a capsule (2), or a half space or cylinder (none)."""
    vertex = np.ascontiguousarray(primitive.vertices, dtype=np.float64).reshape(-1, 3)
    num_vertices = len(vertex)
    # A point or a segment is stored as one triangle without area: the kernels need no other case.
    num_triangles = min(num_vertices, 1)
    num_edges = max(num_vertices - 1, 0)
    last = num_vertices - 1
    return _Surface(
        closed=True,
        vertex=vertex,
        vertex_corner=np.ones(num_vertices, dtype=np.bool_),
        triangle=np.tile(np.array([0, last, last], dtype=np.int64), (num_triangles, 1)),
        triangle_normal=np.zeros((num_triangles, 3)),
        triangle_edge=np.tile(np.array([num_edges - 1, -1, -1], dtype=np.int64), (num_triangles, 1)),
        triangle_owns=np.full(num_triangles, _SEGMENT_OWNS if num_edges else _POINT_OWNS, dtype=np.int64),
        edge=np.tile(np.array([0, last], dtype=np.int64), (num_edges, 1)),
        edge_normal=np.zeros((num_edges, 2, 3)),
        edge_kind=np.full(num_edges, EDGE_CAPSULE, dtype=np.int64),
        node_min=vertex.min(axis=0, keepdims=True) if num_vertices else vertex,
        node_max=vertex.max(axis=0, keepdims=True) if num_vertices else vertex,
        node_child=np.full(num_triangles, -1, dtype=np.int64),
        node_start=np.zeros(num_triangles, dtype=np.int64),
        node_count=np.ones(num_triangles, dtype=np.int64),
        node_cone=every_direction(num_triangles),
    )


def _edges(
    vertex: np.ndarray, triangle: np.ndarray, normal: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]:
    """Return edge, edge_normal, edge_kind, triangle_edge, first half edge of each edge, and if all are balanced."""
    edges = unique_edges(triangle, len(vertex))
    first, last = edges.first, edges.last
    edge = np.column_stack([triangle.ravel()[first], np.roll(triangle, -1, axis=1).ravel()[first]])
    edge_normal = np.stack([normal[first // 3], normal[last // 3]], axis=1)
    along = unit_vectors(vertex[edge[:, 1]] - vertex[edge[:, 0]])
    sine = np.sum(np.cross(edge_normal[:, 0], edge_normal[:, 1]) * along, axis=1)
    cosine = np.sum(edge_normal[:, 0] * edge_normal[:, 1], axis=1)
    # Two faces folded back to back (cosine near -1) are the rim of a sheet: it can touch, so it counts as convex.
    folded = (np.abs(sine) <= TOLERANCES.surface.flat_angle) & (cosine < 0.0)
    kind = np.where((sine > TOLERANCES.surface.flat_angle) | folded, EDGE_CONVEX, EDGE_HIDDEN)
    kind[(edges.count != 2) | (edges.balance != 0)] = EDGE_BOUNDARY
    return edge, edge_normal, kind, edges.triangle_edge, first, bool(np.all(edges.balance == 0))


def _corners(vertex: np.ndarray, edge: np.ndarray, edge_kind: np.ndarray) -> np.ndarray:
    """Return the vertices (v,) bool that have an edge in sight and do not lie inside a straight crease."""
    seen = edge[edge_kind != EDGE_HIDDEN]
    along = unit_vectors(vertex[seen[:, 1]] - vertex[seen[:, 0]])
    ends = seen.T.ravel()
    directions = np.concatenate([along, -along])
    degree = np.bincount(ends, minlength=len(vertex))
    total = np.column_stack([np.bincount(ends, weights=directions[:, k], minlength=len(vertex)) for k in range(3)])
    straight = (degree == 2) & (np.linalg.norm(total, axis=1) <= TOLERANCES.surface.flat_angle)
    return (degree > 0) & ~straight


def _touching(
    triangle: np.ndarray, triangle_edge: np.ndarray, owns: np.ndarray, vertex_corner: np.ndarray, edge_kind: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return, as offsets (T+1,) and a list, what each triangle owns that may touch (see `Geometry`); arguments as there."""
    bits = owns[:, None] >> np.arange(6) & 1
    corners = (bits[:, :3] > 0) & (vertex_corner[triangle] if len(vertex_corner) else False)
    edges = (bits[:, 3:] > 0) & (edge_kind[triangle_edge] != EDGE_HIDDEN if len(edge_kind) else False)
    there = np.stack([edges, corners], axis=2).reshape(-1, 6)
    features = np.stack([2 * triangle_edge + 1, 2 * triangle], axis=2).reshape(-1, 6)
    return _offsets(there.sum(axis=1)), features[there]


def _box_tree(corners: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Build the tree over triangles (t, 3, 3), level by level.

    Returns the order of the triangles and, per node: min, max, left child, first triangle, number of triangles.
    """
    low, high, centre = corners.min(axis=1), corners.max(axis=1), corners.mean(axis=1)
    order = np.arange(len(corners))
    start, count = np.array([0]), np.array([len(corners)])
    num_nodes = 1
    levels = []
    while len(start):
        first = _offsets(count)
        at = np.repeat(start - first[:-1], count) + np.arange(first[-1])  # places of this level's triangles in `order`
        members = order[at]
        node_min = np.minimum.reduceat(low[members], first[:-1])
        node_max = np.maximum.reduceat(high[members], first[:-1])
        split = count > LEAF_SIZE
        child = np.where(split, num_nodes + 2 * (np.cumsum(split) - 1), -1)
        levels.append((node_min, node_max, child, start, count))
        num_nodes += 2 * int(split.sum())

        middle = centre[members]
        extent = np.maximum.reduceat(middle, first[:-1]) - np.minimum.reduceat(middle, first[:-1])
        node = np.repeat(np.arange(len(count)), count)
        position = middle[np.arange(len(members)), extent.argmax(axis=1)[node]]
        order[at] = members[np.lexsort((members, position, node))]
        half = count[split] // 2
        start = np.column_stack([start[split], start[split] + half]).ravel()
        count = np.column_stack([half, count[split] - half]).ravel()
    return order, tuple(np.concatenate(column).astype(column[0].dtype) for column in zip(*levels, strict=True))


def _bounding_sphere(primitive: Primitive) -> tuple[np.ndarray, float]:
    """Return centre and radius of a sphere around a primitive, wide enough for round-off."""
    if primitive.kind == HALF_SPACE:
        return np.zeros(3), np.inf
    if primitive.kind == CYLINDER:
        radius = float(np.hypot(primitive.radius, primitive.frame[6]))
        return primitive.frame[:3], radius * (1.0 + TOLERANCES.arithmetic.round_off)
    low, high = primitive.vertices.min(axis=0), primitive.vertices.max(axis=0)
    centres = (0.5 * (low + high), primitive.vertices.mean(axis=0))
    radii = [float(np.linalg.norm(primitive.vertices - centre, axis=1).max()) for centre in centres]
    best = int(np.argmin(radii))
    return centres[best], (radii[best] + primitive.radius) * (1.0 + TOLERANCES.arithmetic.round_off)


def _edges_around_vertices(edge: np.ndarray, num_vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Return, as offsets and a list, the edges that end at each vertex."""
    ends = edge.ravel()
    return _offsets(np.bincount(ends, minlength=num_vertices)), np.argsort(ends, kind="stable") // 2


def _offsets(counts: ArrayLike) -> np.ndarray:
    """Return the running total (k+1,) of counts (k,), starting at 0."""
    counts = np.asarray(counts, dtype=np.int64)
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(counts)])


def _join(
    arrays: list[np.ndarray], empty: tuple[int, ...], dtype: type, offsets: np.ndarray | None = None
) -> np.ndarray:
    """Concatenate arrays; with `offsets` add one to the indices of each array, leaving -1 (none) as it is."""
    if not arrays:
        return np.zeros(empty, dtype=dtype)
    if offsets is not None:
        arrays = [np.where(a < 0, a, a + first) for a, first in zip(arrays, offsets, strict=False)]
    return np.ascontiguousarray(np.concatenate(arrays), dtype=dtype)
