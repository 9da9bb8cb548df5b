"""Contacts of convex polyhedra that are near or a little inside each other: separating axis, clipping, four points.

The gap of two convex bodies along a unit normal n from a to b is  s(n) = min_b n.x - max_a n.x.  Its largest value over the normals
of faces and the cross products of edges (the separating axes; Gottschalk, Lin and Manocha 1996) is the gap where a face or two edges
are nearest, a lower bound of the gap elsewhere, and minus the depth of bodies inside each other. Where a face has it, the polygon of
the other body that faces it most squarely is cut by its sides (Sutherland and Hodgman 1974), and of the points within
the margin four stay: the deepest, the one farthest from it, and the ones farthest from their line on either side. Where two
edges have it by more than EDGE_WINS of the smaller inner radius, their closest points are the contact. There is one exception: if the
normal of the edges is within ALIKE of that of a face, the polygon cut out on that face gives the contacts, along the normal of the edges.
Bodies that lie crosswise on each other and rock touch at the next of these points before their contacts are found again.

Contacts are written as (x, y, z on a, x, y, z on b, normal, gap) in world axes relative to the position of a.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.epa import Polytope, make_polytope
from rigidimpulse.collision.distance.gjk import Simplex, make_simplex
from rigidimpulse.collision.geometry import HALF_SPACE, Geometry
from rigidimpulse.collision.manifold.hull_faces import faces
from rigidimpulse.collision.manifold.reduce import GAP_WEIGHT
from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.portable import dot
from rigidimpulse.core.simd import EIGHT
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import turned_by

EDGE_WINS = TOLERANCES.manifold.edge_wins
ALIKE = 0.95
"""Cosine of the angle between the normal of two edges and that of a face above which the face gives the contacts."""
POINTS = 4
"""Contacts of two convex polyhedra."""
MOST_CORNERS = 64
"""Most corners of a polygon that is cut."""
FROM_EDGE = 1 << 20
"""Added to the numbers of corners that clipping made."""


class Polygon(NamedTuple):
    """Scratch memory for a polygon that is cut."""

    corner: np.ndarray  # (MOST_CORNERS, 3) m
    ids: np.ndarray  # (MOST_CORNERS,)
    spare: np.ndarray  # (MOST_CORNERS, 3)
    spare_ids: np.ndarray  # (MOST_CORNERS,)
    paths: np.ndarray  # (MOST_CORNERS, 3) m, relative motion of corners
    height: np.ndarray  # (MOST_CORNERS,) m
    chosen: np.ndarray  # (4,)


@jit_making_arrays
def make_polygon():
    """Scratch memory for one pair."""
    return Polygon(
        np.empty((MOST_CORNERS, 3)), np.empty(MOST_CORNERS, np.int64), np.empty((MOST_CORNERS, 3)), np.empty(MOST_CORNERS, np.int64),
        np.empty((MOST_CORNERS, 3)), np.empty(MOST_CORNERS), np.empty(4, np.int64),
    )  # fmt: skip


class Scratch(NamedTuple):
    """Scratch memory for the contacts of one pair of convex polyhedra."""

    polygon: Polygon
    simplex: Simplex
    polytope: Polytope
    work: np.ndarray  # (3, 3)
    axes: np.ndarray  # (3, 3) R_a^T R_b
    between: np.ndarray  # (3,) m, from a to b, in world axes
    origin: np.ndarray  # (3,) zeros


@jit_making_arrays
def make_scratch():
    """Scratch memory for one pair."""
    return Scratch(
        make_polygon(), make_simplex(), make_polytope(), np.empty((3, 3)), np.empty((3, 3)), np.zeros(3), np.zeros(3)
    )


class Pair(NamedTuple):
    """Two bodies that are convex polyhedra, a and b in the arrays of bodies, and their shapes."""

    rotation: np.ndarray  # (n, 3, 3)
    velocity: np.ndarray  # (8 n,) v and w of body i from 8 i on, m/s and rad/s
    a: int
    b: int
    s: int  # shape of a
    t: int  # shape of b


class Query(NamedTuple):
    """Which contacts are wanted."""

    margin: float  # m, greatest gap
    ahead: float  # s, time for whose motion contacts are known in advance
    size: float  # m, smaller inner radius


class Points(NamedTuple):
    """The contacts of one pair as they are found."""

    real: np.ndarray  # (POINTS + 1, 10) on a, on b, normal, gap
    ids: np.ndarray  # (POINTS + 1, 3) kind and features


class Polyhedra(NamedTuple):
    """Faces of p convex polyhedra, F in all, with L corners: the first s are shapes, around their centre of mass.

    Then come the parts of shapes that are several polyhedra, each around a centre of its own. Shapes that are neither have no corners.
    """

    half: np.ndarray  # (p, 3) m, half the sides of boxes along the axes, 0 for others
    corner_first: np.ndarray  # (p+1,)
    corner: np.ndarray  # (V, 3) m
    column_first: np.ndarray  # (p+1,)
    column: np.ndarray  # (C,) m, x of the corners of each, then y, then z: each filled up with the first corner to a multiple of EIGHT
    face_first: np.ndarray  # (p+1,)
    plane: np.ndarray  # (F, 4) unit outward normal and offset, m
    loop_first: np.ndarray  # (F+1,)
    loop: np.ndarray  # (L,) corners of each face, counter-clockwise seen from outside
    half_space: np.ndarray  # (p, 4) unit normal and offset of shapes that are one half space, 0 for others
    part_first: np.ndarray  # (s+1,) the first part of each shape; a polyhedron and a half space are their only part
    part: np.ndarray  # (P,) which polyhedron it is
    centre: np.ndarray  # (P, 3) m, its centre in the shape
    bound: np.ndarray  # (P,) m, of a sphere about the centre


class _Tables:
    """The tables of polyhedra that are added one by one."""

    def __init__(self) -> None:
        """None is there yet."""
        self.half: list[np.ndarray] = []
        self.half_space: list[np.ndarray] = []
        self.corners: list[np.ndarray] = []
        self.planes: list[np.ndarray] = []  # (m, 4) of each
        self.loops: list[list[int]] = []
        self.corner_first, self.face_first = [0], [0]

    def add(self, corners: np.ndarray, half_space: np.ndarray | None = None) -> None:
        """Add corners (v, 3) that have no faces, or a half space (4,)."""
        self.half.append(np.zeros(3))
        self.half_space.append(np.zeros(4) if half_space is None else half_space)
        self.corners.append(corners)
        self.corner_first.append(self.corner_first[-1] + len(corners))
        self.face_first.append(len(self.loops))

    def add_polyhedron(self, corners: np.ndarray, normals: np.ndarray, triangles: np.ndarray, *, is_shape: bool) -> None:
        """Add a polyhedron with the outward normals (t, 3) of its triangles (t, 3); as a shape it is a BOX where it can be."""
        self.add(corners)
        found = faces(normals, triangles)
        of_face, loops = np.array([normal for normal, _ in found]), [loop for _, loop in found]
        size_of_loop = np.array([len(loop) for loop in loops])
        heights = dot(corners[np.concatenate(loops)], np.repeat(of_face, size_of_loop, axis=0))
        farthest = np.maximum.reduceat(heights, np.cumsum(size_of_loop) - size_of_loop)
        self.planes.append(np.column_stack([of_face, farthest]))
        self.loops += [[self.corner_first[-2] + v for v in loop] for loop in loops]
        self.face_first[-1] = len(self.loops)
        size = corners.max(0)
        # Eight corners at +- the same lengths: a box along the principal axes, which has kernels of its own.
        if is_shape and len(corners) == 8 and np.allclose(np.abs(corners), size, rtol=1e-12, atol=0.0):
            self.half[-1] = size


def make_polyhedra(geometry: Geometry, convex: np.ndarray, bare: np.ndarray | None = None, several: np.ndarray | None = None) -> Polyhedra:
    """Tables of shapes (s,).

    Args:
        geometry: of the shapes.
        convex: (s,) bool, shapes that are one convex polyhedron. bare: (s,) bool, those that get corners, but no faces. several: (s,) bool,
            those that are several convex polyhedra, see `convexity.several_polyhedra`. All others have nothing.

    """
    tables, nothing = _Tables(), np.zeros((0, 3))
    parts: list[list[tuple[int, np.ndarray, float]]] = []
    for s, is_convex in enumerate(convex):
        p = int(geometry.shape_first[s])
        single = geometry.shape_first[s + 1] == p + 1
        corners = geometry.vertex[int(geometry.vertex_first[p]) : int(geometry.vertex_first[p + 1])]
        if single and geometry.kind[p] == HALF_SPACE:
            tables.add(nothing, geometry.frame[p, :4])
            parts.append([(s, np.zeros(3), inf)])
        elif is_convex:
            tables.add_polyhedron(corners, *_triangles_of(geometry, p), is_shape=True)
            parts.append([(s, np.zeros(3), _reach(corners))])
        else:
            tables.add(corners if bare is not None and bare[s] else nothing)
            parts.append([])
    for s in np.flatnonzero(several).tolist() if several is not None else []:
        for p in range(int(geometry.shape_first[s]), int(geometry.shape_first[s + 1])):
            corners = geometry.vertex[int(geometry.vertex_first[p]) : int(geometry.vertex_first[p + 1])]
            centre = corners.sum(axis=0) / len(corners)
            parts[s].append((len(tables.corners), centre, _reach(corners - centre)))
            tables.add_polyhedron(corners - centre, *_triangles_of(geometry, p), is_shape=False)
    flat = [part for of_shape in parts for part in of_shape]
    columns = [_columns_of(corners) for corners in tables.corners]
    return Polyhedra(
        half=np.array(tables.half).reshape(-1, 3), corner_first=np.array(tables.corner_first),
        corner=np.concatenate([*tables.corners, nothing]), column_first=np.cumsum([0, *map(len, columns)]),
        column=np.concatenate([*columns, np.zeros(0)]), face_first=np.array(tables.face_first),
        plane=np.concatenate([*tables.planes, np.zeros((0, 4))]), loop_first=np.cumsum([0, *map(len, tables.loops)]),
        loop=np.array([v for loop in tables.loops for v in loop], np.int64), half_space=np.array(tables.half_space).reshape(-1, 4),
        part_first=np.cumsum([0, *map(len, parts)]), part=np.array([which for which, _, _ in flat], np.int64),
        centre=np.array([centre for _, centre, _ in flat]).reshape(-1, 3), bound=np.array([bound for _, _, bound in flat]),
    )  # fmt: skip


def _columns_of(corners: np.ndarray) -> np.ndarray:
    """The columns of corners (v, 3), see `Polyhedra.column`."""
    number = len(corners)
    which = np.arange(EIGHT * -(-number // EIGHT))
    return np.ravel(corners[np.where(which < number, which, 0)].T)


def _triangles_of(geometry: Geometry, p: int) -> tuple[np.ndarray, np.ndarray]:
    """Normals (t, 3) of the triangles of primitive p, and its corners (t, 3) by their numbers in it."""
    first, last = int(geometry.triangle_first[p]), int(geometry.triangle_first[p + 1])
    return geometry.triangle_normal[first:last], geometry.triangle[first:last] - int(geometry.vertex_first[p])


def _reach(corners: np.ndarray) -> float:
    """Distance of the farthest of corners (v, 3) from their origin, m."""
    return float(np.sqrt((corners * corners).sum(axis=1).max()))


@inlined
def four_of(points, height, count, chosen):
    """Choose up to four points (count, 3) that can carry the load of all: writes their places to chosen (4,), returns their number.

    They are the deepest, the one farthest from it, and the farthest from the line through both on either side; where all are on one side,
    the fourth is the one farthest outside of the triangle of the three. What is higher (count,) m than the deepest counts as less far out,
    see `reduce`: a corner 7 mm above a floor took the place of one 0.3 mm above it.
    """
    deepest = 0
    for k in range(1, count):
        if height[k] < height[deepest]:
            deepest = k
    farthest, distance, best = deepest, 0.0, -inf
    for k in range(count):
        d = (points[k, 0] - points[deepest, 0]) ** 2 + (points[k, 1] - points[deepest, 1]) ** 2 + (points[k, 2] - points[deepest, 2]) ** 2
        place = sqrt(d) - GAP_WEIGHT * (height[k] - height[deepest])
        if d > 0.0 and place > best:
            farthest, distance, best = k, d, place
    chosen[0] = deepest
    if distance == 0.0:
        return np.int64(1)
    chosen[1] = farthest
    ex, ey = points[farthest, 0] - points[deepest, 0], points[farthest, 1] - points[deepest, 1]
    ez = points[farthest, 2] - points[deepest, 2]
    # Twice the area of the triangle that a point makes with the first two, signed by a first one that has any.
    mx, my, mz, least, is_flat = 0.0, 0.0, 0.0, 1e-9 * distance, True
    high, low, most, lowest, open_by = -1, -1, -inf, inf, GAP_WEIGHT * sqrt(distance)
    for k in range(count):
        x, y, z = points[k, 0] - points[deepest, 0], points[k, 1] - points[deepest, 1], points[k, 2] - points[deepest, 2]
        cx, cy, cz = ey * z - ez * y, ez * x - ex * z, ex * y - ey * x
        if is_flat:
            area = sqrt(cx * cx + cy * cy + cz * cz)
            if area <= least:
                continue
            mx, my, mz, is_flat = cx / area, cy / area, cz / area, False
        signed = mx * cx + my * cy + mz * cz
        less = open_by * (height[k] - height[deepest])
        if signed > least and signed - less > most:
            high, most = k, signed - less
        elif signed < -least and signed + less < lowest:
            low, lowest = k, signed + less
    number = np.int64(2)
    for k in (high, low):
        if k >= 0:
            chosen[number] = k
            number += 1
    if number == 3:
        turn = 1.0 if high >= 0 else -1.0
        number += _add_outermost(points, height, count, chosen, (turn * mx, turn * my, turn * mz), least)
    return number


@inlined
def _add_outermost(points, height, count, chosen, axis, least):
    """Write to chosen[3] the point farthest outside of the triangle of the first three; return how many, 0 or 1.

    The three are anticlockwise about the axis. Twice the area that it makes with a side is more than `least`. Of the sides those from the
    second to the third and on to the first are looked at: what lies beyond the other one is chosen already.
    """
    (mx, my, mz), outermost, best = axis, -1, -inf
    for begin, end in ((chosen[1], chosen[2]), (chosen[2], chosen[0])):
        ex, ey = points[end, 0] - points[begin, 0], points[end, 1] - points[begin, 1]
        ez = points[end, 2] - points[begin, 2]
        side = sqrt(ex * ex + ey * ey + ez * ez)
        for k in range(count):
            x, y, z = points[k, 0] - points[begin, 0], points[k, 1] - points[begin, 1], points[k, 2] - points[begin, 2]
            out = -(mx * (ey * z - ez * y) + my * (ez * x - ex * z) + mz * (ex * y - ey * x))
            place = out / side - GAP_WEIGHT * (height[k] - height[chosen[0]])
            if out > least and place > best:
                outermost, best = k, place
    if outermost < 0:
        return np.int64(0)
    chosen[3] = outermost
    return np.int64(1)


class Plane(NamedTuple):
    """The solid n.x <= offset, relative to the position of the other body."""

    normal: tuple[float, float, float]
    offset: float  # m
    sign: float  # 1 where the half space is a, else -1


@jit
def half_space_contacts(shapes, s, rotation, j, plane, margin, polygon, points):
    """Contacts of a half space with shape s turned by rotation[j]; their number and the gap.

    Points are relative to the shape's position.
    """
    corner, ids, height, chosen = polygon.corner, polygon.ids, polygon.height, polygon.chosen
    real, out_ids = points
    (nx, ny, nz), offset, sign = plane
    count, least = 0, inf
    for v in range(shapes.corner_first[s], shapes.corner_first[s + 1]):
        x, y, z = turned_by(rotation, j, shapes.corner[v, 0], shapes.corner[v, 1], shapes.corner[v, 2])
        gap = nx * x + ny * y + nz * z - offset
        least = min(least, gap)
        if gap <= margin and count < MOST_CORNERS:
            corner[count, 0], corner[count, 1], corner[count, 2] = x, y, z
            height[count], ids[count] = gap, v
            count += 1
    if count == 0:
        return np.int64(0), least
    # Four points can carry the load of all.
    number = four_of(corner, height, count, chosen)
    on_plane, on_shape = (0, 3) if sign > 0.0 else (3, 0)
    for c in range(number):
        k = chosen[c]
        for i in range(3):
            n = nx if i == 0 else (ny if i == 1 else nz)
            real[c, on_plane + i], real[c, on_shape + i] = corner[k, i] - height[k] * n, corner[k, i]
            real[c, 6 + i] = sign * n
        real[c, 9] = height[k]
        out_ids[c, 0], out_ids[c, 1], out_ids[c, 2] = -1, -1, ids[k]
    return number, least


@inlined
def polyhedron_half_space_contacts(shapes, pair, query, scratch, points):
    """Contacts of a half space and a convex polyhedron, in either order, relative to a; returns their number and the gap."""
    rotation, _, a, b, s, t = pair
    real, between = points.real, scratch.between
    half_space_is_a = shapes.face_first[s] == shapes.face_first[s + 1]
    half_space, w, i, sign = shapes.half_space, s if half_space_is_a else t, a if half_space_is_a else b, 1.0 if half_space_is_a else -1.0
    nx, ny, nz = turned_by(rotation, i, half_space[w, 0], half_space[w, 1], half_space[w, 2])
    offset = half_space[w, 3] - sign * (nx * between[0] + ny * between[1] + nz * between[2])
    solid, j = (t, b) if half_space_is_a else (s, a)
    plane = Plane((nx, ny, nz), offset, sign)
    count, least = half_space_contacts(shapes, solid, rotation, j, plane, query.margin, scratch.polygon, points)
    if half_space_is_a:
        for k in range(count):
            for c in range(3):
                real[k, c] += between[c]
                real[k, 3 + c] += between[c]
    return count, least


@inlined
def copy_contact(points, source, target):
    """Copy a contact."""
    real, ids = points
    for k in range(10):
        real[target, k] = real[source, k]
    for k in range(3):
        ids[target, k] = ids[source, k]


@inlined
def nearest_of(real, count):
    """Least gap of `count` contacts."""
    nearest = inf
    for n in range(count):
        nearest = min(nearest, real[n, 9])
    return nearest


@inlined
def add_contact(points, count, source):
    """Add the contact at `source` to `count` others, in the place of the farthest where there are POINTS; returns their number."""
    real, at = points.real, count
    if count == POINTS:
        at = 0
        for n in range(1, count):
            if real[n, 9] > real[at, 9]:
                at = n
    copy_contact(points, source, at)
    return min(count + 1, POINTS)


@inlined
def along_edges(real, count, edges, cosine, of_b, gap, size):
    """Turn `count` contacts of faces to the normal of the edges at place `edges`; returns whether the nearest is as near as the edges are.

    A corner at the height h over a face is h cos over it along the normal of edges that is tilted so, and at least as far as the edges are.
    cosine: of both normals; of_b: whether the face is b's; gap: of the edges, m; size: smaller inner radius, m.
    """
    own, other, turn = 3 if of_b else 0, 0 if of_b else 3, 1.0 if of_b else -1.0
    for n in range(count):
        real[n, 9] *= cosine
        for k in range(3):
            real[n, 6 + k] = real[edges, 6 + k]
            real[n, own + k] = real[n, other + k] + turn * real[n, 9] * real[n, 6 + k]
    return nearest_of(real, count) <= gap + EDGE_WINS * size
