"""Contacts of convex polyhedra that are near or a little inside each other: separating axis, clipping, four points.

The gap of two convex bodies along a unit normal n from a to b is  s(n) = min_b n.x - max_a n.x.  Its largest value over the normals
of faces and the cross products of edges (the separating axes; Gottschalk, Lin and Manocha 1996) is the gap where a face or two edges
are nearest, at most the gap elsewhere, and minus the depth of bodies inside each other. Where a face has it, the polygon of
the other body that faces it most squarely is cut by its sides (Sutherland and Hodgman 1974), and of the points within
the margin four stay: the deepest, the one farthest from it, and the ones farthest from their line on either side. Where two
edges have it by more than EDGE_WINS of the smaller inner radius, their closest points are the contact, unless their normal is within
ALIKE of that of a face: then what is cut out there are the contacts, along the normal of the edges, since bodies that lie crosswise on
each other, and rock, come to touch at the next of these points before they are looked at again.

Contacts are written as (x, y, z on a, x, y, z on b, normal, gap) in world axes relative to the position of a.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.geometry import HALF_SPACE, Geometry
from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.vector import turned_by

EDGE_WINS = 2e-3
ALIKE = 0.95
"""Cosine of the angle of the normal of two edges and that of a face above which it is the faces that come to touch."""
POINTS = 4
"""Contacts of two convex polyhedra."""
MOST_CORNERS = 64
"""Corners of a polygon that is cut."""
FROM_EDGE = 1 << 20
"""Added to the numbers of corners that clipping made."""


class Scratch(NamedTuple):
    """What contacts are worked out in."""

    polygon: np.ndarray  # (MOST_CORNERS, 3) m
    ids: np.ndarray  # (MOST_CORNERS,)
    spare: np.ndarray  # (MOST_CORNERS, 3)
    spare_ids: np.ndarray  # (MOST_CORNERS,)
    ways: np.ndarray  # (MOST_CORNERS, 3) m
    height: np.ndarray  # (MOST_CORNERS,) m
    chosen: np.ndarray  # (4,)


@jit_making_arrays
def make_scratch():
    """Room for one pair."""
    return Scratch(
        np.empty((MOST_CORNERS, 3)), np.empty(MOST_CORNERS, np.int64), np.empty((MOST_CORNERS, 3)), np.empty(MOST_CORNERS, np.int64),
        np.empty((MOST_CORNERS, 3)), np.empty(MOST_CORNERS), np.empty(4, np.int64),
    )  # fmt: skip


class Polyhedra(NamedTuple):
    """Faces of the s shapes that are convex polyhedra around their centre of mass, F in all, with L corners."""

    half: np.ndarray  # (s, 3) m, half the sides of boxes along the axes, 0 for others
    corner_first: np.ndarray  # (s+1,)
    corner: np.ndarray  # (V, 3) m
    face_first: np.ndarray  # (s+1,)
    plane: np.ndarray  # (F, 4) unit outward normal and offset, m
    loop_first: np.ndarray  # (F+1,)
    loop: np.ndarray  # (L,) corners of each face, counter-clockwise seen from outside
    half_space: np.ndarray  # (s, 4) unit normal and offset of shapes that are one half space, 0 for others


def make_polyhedra(geometry: Geometry, convex: np.ndarray, bare: np.ndarray | None = None) -> Polyhedra:
    """Tables of the shapes that are `convex` (s,) bool; those that are `bare` (s,) bool have corners, but no faces, others neither."""
    half, half_space = np.zeros((len(convex), 3)), np.zeros((len(convex), 4))
    planes: list[np.ndarray] = []
    loops: list[list[int]] = []
    corners: list[np.ndarray] = []
    firsts: tuple[list[int], ...] = ([0], [0])
    for s, is_convex in enumerate(convex):
        p = int(geometry.shape_first[s])
        if geometry.shape_first[s + 1] == p + 1 and geometry.kind[p] == HALF_SPACE:
            half_space[s] = geometry.frame[p, :4]
        vertex = geometry.vertex[int(geometry.vertex_first[p]) : int(geometry.vertex_first[p + 1])]
        if bare is not None and bare[s]:
            corners.append(vertex)
        if is_convex:
            before = sum(map(len, corners))
            for normal, loop in _faces(geometry, p):
                planes.append(np.append(normal, (vertex[loop] @ normal).max()))
                loops.append([before + v for v in loop])
            corners.append(vertex)
            size = vertex.max(0)
            if len(vertex) == 8 and np.allclose(np.abs(vertex), size, rtol=1e-12, atol=0.0):
                half[s] = size
        for first, number in zip(firsts, (sum(map(len, corners)), len(planes)), strict=True):
            first.append(number)
    return Polyhedra(
        half=half, corner_first=np.array(firsts[0]), corner=np.concatenate([*corners, np.zeros((0, 3))]), face_first=np.array(firsts[1]),
        plane=np.array(planes).reshape(-1, 4), loop_first=np.cumsum([0, *map(len, loops)]),
        loop=np.array([v for loop in loops for v in loop], np.int64), half_space=half_space,
    )  # fmt: skip


def _faces(geometry: Geometry, p: int) -> list[tuple[np.ndarray, list[int]]]:
    """Unit normals and corners, counted from the primitive's first vertex, of the faces of a convex primitive."""
    low = int(geometry.vertex_first[p])
    left, out = list(range(int(geometry.triangle_first[p]), int(geometry.triangle_first[p + 1]))), []
    while left:
        normal = geometry.triangle_normal[left[0]]
        flat = [t for t in left if float(geometry.triangle_normal[t] @ normal) > 1.0 - 1e-10]
        left = [t for t in left if t not in flat]
        out.append((normal, _loop(flat, geometry, low)))
    return out


def _loop(flat: list[int], geometry: Geometry, low: int) -> list[int]:
    """Corners of the polygon that triangles of one plane make, in order."""
    halves = {(int(t[k]) - low, int(t[(k + 1) % 3]) - low) for t in geometry.triangle[flat] for k in range(3)}
    following = {tail: head for tail, head in halves if (head, tail) not in halves}
    start = min(following)
    loop, v = [start], following[start]
    while v != start:
        loop.append(v)
        v = following[v]
    return loop


@inlined
def four_of(points, height, count, chosen):
    """Write the places of the points (count, 3) that carry all the others' load to chosen (4,); returns their number."""
    deepest = 0
    for k in range(1, count):
        if height[k] < height[deepest]:
            deepest = k
    farthest, distance = deepest, 0.0
    for k in range(count):
        d = (points[k, 0] - points[deepest, 0]) ** 2 + (points[k, 1] - points[deepest, 1]) ** 2 + (points[k, 2] - points[deepest, 2]) ** 2
        if d > distance:
            farthest, distance = k, d
    chosen[0] = deepest
    if distance == 0.0:
        return np.int64(1)
    chosen[1] = farthest
    ex, ey = points[farthest, 0] - points[deepest, 0], points[farthest, 1] - points[deepest, 1]
    ez = points[farthest, 2] - points[deepest, 2]
    # Twice the area of the triangle that a point makes with the first two, signed by a first one that has any.
    mx, my, mz, least, is_flat = 0.0, 0.0, 0.0, 1e-9 * distance, True
    high, low, most, lowest = -1, -1, least, -least
    for k in range(count):
        x, y, z = points[k, 0] - points[deepest, 0], points[k, 1] - points[deepest, 1], points[k, 2] - points[deepest, 2]
        cx, cy, cz = ey * z - ez * y, ez * x - ex * z, ex * y - ey * x
        if is_flat:
            area = sqrt(cx * cx + cy * cy + cz * cz)
            if area <= least:
                continue
            mx, my, mz, is_flat = cx / area, cy / area, cz / area, False
        signed = mx * cx + my * cy + mz * cz
        if signed > most:
            high, most = k, signed
        elif signed < lowest:
            low, lowest = k, signed
    number = np.int64(2)
    for k in (high, low):
        if k >= 0:
            chosen[number] = k
            number += 1
    return number


@jit
def half_space_contacts(shapes, s, r, j, nx, ny, nz, offset, margin, sign, scratch, real, out_ids):
    """Contacts of the solid n.x <= offset (relative to the shape's position) with shape s turned by r[j]; their number and the gap.

    sign: 1 where the half space is a, else -1; points are relative to the shape's position.
    """
    polygon, ids, height, chosen = scratch.polygon, scratch.ids, scratch.height, scratch.chosen
    count, least = 0, inf
    for v in range(shapes.corner_first[s], shapes.corner_first[s + 1]):
        x, y, z = turned_by(r, j, shapes.corner[v, 0], shapes.corner[v, 1], shapes.corner[v, 2])
        gap = nx * x + ny * y + nz * z - offset
        least = min(least, gap)
        if gap <= margin and count < MOST_CORNERS:
            polygon[count, 0], polygon[count, 1], polygon[count, 2] = x, y, z
            height[count], ids[count] = gap, v
            count += 1
    if count == 0:
        return np.int64(0), least
    number = four_of(polygon, height, count, chosen)
    on_plane, on_shape = (0, 3) if sign > 0.0 else (3, 0)
    for c in range(number):
        k = chosen[c]
        for i in range(3):
            n = nx if i == 0 else (ny if i == 1 else nz)
            real[c, on_plane + i], real[c, on_shape + i] = polygon[k, i] - height[k] * n, polygon[k, i]
            real[c, 6 + i] = sign * n
        real[c, 9] = height[k]
        out_ids[c, 0], out_ids[c, 1], out_ids[c, 2] = -1, -1, ids[k]
    return number, least


@inlined
def copy_contact(real, ids, source, target):
    """Copy a contact."""
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
def add_contact(real, ids, count, source):
    """Add the contact in row `source` to `count` others, in the place of the farthest where there are POINTS; returns their number."""
    at = count
    if count == POINTS:
        at = 0
        for n in range(1, count):
            if real[n, 9] > real[at, 9]:
                at = n
    copy_contact(real, ids, source, at)
    return min(count + 1, POINTS)


@inlined
def along_edges(real, count, edges, cosine, of_b, gap, size):
    """Turn `count` contacts of faces to the normal of the edges in row `edges`; returns whether the nearest is as near as the edges are.

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
