"""Points of bodies that are inside others, with the way out: what the penalty method pushes at.

    half space, n.x <= o, and a corner p of radius r:     d = o + r - n.p,        out along n
    spheres and capsules:  closest points p, q of axes:   d = r_a + r_b - |q - p|, out along q - p
    corner p of radius r and a surface of triangles:      d = r + s,               out along the way from p to the nearest surface point
    edges that cross, p and q where their lines are nearest:  d = (p - q).n,       out along n = +- e_a x e_b, out of both edges' wedges

s is the depth of p in the solid, negative outside. A box, hull or mesh has its corners for points (radius 0), a sphere its centre, a
capsule the two ends of its axis, and where a corner of a surface comes at the middle of its axis that one. Each point has its own spring,
and both bodies are pushed along the same line.

The nearest surface point of a corner is looked for on faces that push it back into its own body (n.m > 0, m the mean direction of its
edges): the corners of a box that stands flush on another would else leave by its side. Whether a point is inside is asked a little way,
NUDGE of the edges' length, inside of its own body: flush corners do not come and go. Edges much deeper than the corners of the pair, or
than its least deep edges, are no way out and left away.

Sources: P. Moore, J. Wilhelms, Collision detection and response for computer animation, SIGGRAPH 1988 (a spring from each point that is
inside to the nearest point of the surface); Ericson, Real-Time Collision Detection, 2005, section 5.1.5 (nearest point of a triangle).
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.detect.box_tree import STACK_ROWS
from rigidimpulse.detect.features import along, closest_on_segments, cross, dot, edge_normals, in_edge_arc, moved, row, subtract, turned
from rigidimpulse.detect.inside import point_in_mesh
from rigidimpulse.geometry import CYLINDER, EDGE_CAPSULE, EDGE_HIDDEN, HALF_SPACE, ROUND, CompiledShape, Geometry, Primitive, build_geometry

SIDES = 24
"""Sides of the prism that stands for a cylinder."""
ON_FACE = 1e-6
"""Part of the distance by which the way to a face may differ from that along its normal; the normal is exact however near the face is."""

NUDGE, MOST_DEPTH = 1e-6, 2.0
OUT_OF_WEDGE = 0.5
"""Sine of the angle by which the normal of crossing edges may be outside the arc between the normals of their faces."""
EDGE = np.int64(1 << 40)
"""Added to edges where they are told from vertices."""


def solid_geometry(shapes: list[CompiledShape]) -> Geometry:
    """Geometry of compiled shapes with a prism of SIDES sides in the place of each cylinder."""
    solids = [
        replace(shape, primitives=tuple(_prism(p) if p.kind == CYLINDER else p for p in shape.primitives)) for shape in shapes
    ]
    return build_geometry(solids)


def _prism(cylinder: Primitive) -> Primitive:
    """Prism inside a cylinder."""
    centre, axis, half = cylinder.frame[:3], cylinder.frame[3:6], cylinder.frame[6]
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= np.linalg.norm(u)
    angle, k = 2.0 * np.pi * np.arange(SIDES) / SIDES, np.arange(SIDES)
    rim = cylinder.radius * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * np.cross(axis, u))
    following, zero = (k + 1) % SIDES, np.zeros(SIDES - 2, np.int64)
    side = [np.stack([k, following, following + SIDES], 1), np.stack([k, following + SIDES, k + SIDES], 1)]
    bottom, top = np.stack([zero, k[2:], k[1:-1]], 1), np.stack([zero, k[1:-1], k[2:]], 1) + SIDES
    vertices = np.concatenate([centre - half * axis + rim, centre + half * axis + rim])
    return Primitive(ROUND, vertices=vertices, faces=np.concatenate([*side, bottom, top]))


def inward_axes(geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Mean direction (V, 3) of the visible edges that leave each vertex of a surface, unit or 0, in the frame of its shape.

    And the length (V,) m of the shortest of them, 0 where there is none.
    """
    total = np.zeros_like(geometry.vertex)
    tail, head = geometry.edge[(geometry.edge_kind != EDGE_HIDDEN) & (geometry.edge_kind != EDGE_CAPSULE)].T
    way = geometry.vertex[head] - geometry.vertex[tail]
    long = np.linalg.norm(way, axis=1)
    way /= long[:, None]
    size = np.full(len(total), np.inf)
    np.minimum.at(size, tail, long)
    np.minimum.at(size, head, long)
    np.add.at(total, tail, way)
    np.add.at(total, head, -way)
    length = np.linalg.norm(total, axis=1)[:, None]
    return np.where(length > ON_FACE, total / np.maximum(length, ON_FACE), 0.0), np.where(np.isfinite(size), size, 0.0)


@jit
def _nearest_on_triangle(p, a, b, c):
    """Nearest point of triangle abc to p."""
    ab, ac, ap = subtract(b, a), subtract(c, a), subtract(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    bp = subtract(p, b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return b
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return along(a, d1 / (d1 - d3), ab)
    cp = subtract(p, c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return c
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return along(a, d2 / (d2 - d6), ac)
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return along(b, (d4 - d3) / ((d4 - d3) + (d5 - d6)), subtract(c, b))
    size = va + vb + vc
    return along(along(a, vb / size, ab), vc / size, ac)


@jit
def _box_squared(geometry, node, p):
    """Squared distance of a point from the box of a node."""
    total = 0.0
    for k in range(3):
        off = max(0.0, geometry.node_min[node, k] - p[k], p[k] - geometry.node_max[node, k])
        total += off * off
    return total


@jit
def nearest_on_surface(geometry, primitive, p, axis):
    """Nearest point of a surface of triangles to p (x, y, z) in its frame: squared distance, point, triangle.

    axis: if not 0, triangles count whose normals do not point against it; the triangle is -1 if none does.
    """
    free = axis[0] == 0.0 and axis[1] == 0.0 and axis[2] == 0.0
    stack = np.empty(STACK_ROWS, np.int64)
    stack[0] = geometry.node_first[primitive]
    depth, best, nearest, place = 1, inf, p, np.int64(-1)
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if _box_squared(geometry, node, p) >= best:
            continue
        child = geometry.node_child[node]
        if child >= 0:
            first_is_nearer = _box_squared(geometry, child, p) <= _box_squared(geometry, child + 1, p)
            stack[depth] = child + 1 if first_is_nearer else child
            stack[depth + 1] = child if first_is_nearer else child + 1
            depth += 2
            continue
        start = geometry.node_start[node]
        for t in range(start, start + geometry.node_count[node]):
            if not (free or dot(axis, row(geometry.triangle_normal, t)) > 0.0):
                continue
            corner = geometry.triangle[t]
            a, b, c = row(geometry.vertex, corner[0]), row(geometry.vertex, corner[1]), row(geometry.vertex, corner[2])
            q = _nearest_on_triangle(p, a, b, c)
            off = subtract(q, p)
            if dot(off, off) < best:
                best, nearest, place = dot(off, off), q, t
    return best, nearest, place


@jit
def _turned_back(R, v):
    """R^T v."""
    return (
        R[0, 0] * v[0] + R[1, 0] * v[1] + R[2, 0] * v[2],
        R[0, 1] * v[0] + R[1, 1] * v[1] + R[2, 1] * v[2],
        R[0, 2] * v[0] + R[1, 2] * v[1] + R[2, 2] * v[2],
    )


@jit
def _add(real, integer, count, bodies, features, point, normal, depth):
    """Write a point if there is room; bodies (a, b), normal from a to b; where a is the larger they are swapped. Returns count + 1."""
    if count < real.shape[0]:
        swap = bodies[0] > bodies[1]
        sign = -1.0 if swap else 1.0
        integer[count, 0], integer[count, 1] = (bodies[1], bodies[0]) if swap else bodies
        integer[count, 2], integer[count, 3] = (features[1], features[0]) if swap else features
        for k in range(3):
            real[count, k] = point[k]
            real[count, 3 + k] = sign * normal[k]
        real[count, 6] = depth
    return count + 1


@jit
def _points_in_half_space(geometry, plane, other, bodies, position, rotation, real, integer, count):
    """Corners of a ROUND primitive of bodies[1] in a half space of bodies[0]."""
    a, b = bodies
    normal = turned(rotation[a], row(geometry.frame, plane))
    offset = geometry.frame[plane, 3] + dot(normal, row(position, a))
    for v in range(geometry.vertex_first[other], geometry.vertex_first[other + 1]):
        if geometry.vertex_corner[v]:
            p = moved(rotation[b], row(position, b), row(geometry.vertex, v))
            depth = offset + geometry.radius[other] - dot(normal, p)
            if depth > 0.0:
                count = _add(real, integer, count, bodies, (-1 - plane, v), p, normal, depth)
    return count


@jit
def _points_of_axes(geometry, first, second, bodies, position, rotation, real, integer, count):
    """The closest points of two spheres or capsules."""
    a, b = bodies
    p_first, q_first = geometry.vertex_first[first], geometry.vertex_first[second]
    p = moved(rotation[a], row(position, a), row(geometry.vertex, p_first))
    q = moved(rotation[b], row(position, b), row(geometry.vertex, q_first))
    p_axis = subtract(moved(rotation[a], row(position, a), row(geometry.vertex, geometry.vertex_first[first + 1] - 1)), p)
    q_axis = subtract(moved(rotation[b], row(position, b), row(geometry.vertex, geometry.vertex_first[second + 1] - 1)), q)
    s, t = closest_on_segments(p, p_axis, q, q_axis)
    p, q = along(p, s, p_axis), along(q, t, q_axis)
    between = subtract(q, p)
    distance = sqrt(dot(between, between))
    depth = geometry.radius[first] + geometry.radius[second] - distance
    if depth > 0.0 and distance > 0.0:
        normal = (between[0] / distance, between[1] / distance, between[2] / distance)
        point = along(p, geometry.radius[first] - 0.5 * depth, normal)
        count = _add(real, integer, count, bodies, (p_first, q_first), point, normal, depth)
    return count


@jit
def _points_in_surface(geometry, axes, sizes, surface, other, bodies, position, rotation, real, integer, count):
    """Corners of a ROUND primitive of bodies[1] in the solid of triangles of bodies[0]."""
    a, b = bodies
    radius, root = geometry.radius[other], geometry.node_first[surface]
    for v in range(geometry.vertex_first[other], geometry.vertex_first[other + 1]):
        if not geometry.vertex_corner[v]:
            continue
        world = moved(rotation[b], row(position, b), row(geometry.vertex, v))
        p = _turned_back(rotation[a], subtract(world, row(position, a)))
        if _box_squared(geometry, root, p) > radius * radius:
            continue
        axis = _turned_back(rotation[a], turned(rotation[b], row(axes, v)))
        inside = geometry.closed[surface] and point_in_mesh(geometry, surface, along(p, NUDGE * sizes[v], axis))
        if radius == 0.0 and not inside:
            continue
        squared, q, t = nearest_on_surface(geometry, surface, p, axis)
        if t < 0:
            squared, q, t = nearest_on_surface(geometry, surface, p, (0.0, 0.0, 0.0))
        distance = sqrt(squared)
        if not inside and distance >= radius:
            continue
        out = subtract(q, p) if inside else subtract(p, q)
        face = row(geometry.triangle_normal, t)
        normal = face
        if dot(out, face) < (1.0 - ON_FACE) * distance:
            normal = (out[0] / distance, out[1] / distance, out[2] / distance)
        depth = radius + (dot(out, normal) if inside else -distance)
        if depth > 0.0:
            count = _add(real, integer, count, bodies, (-1 - surface, v), world, turned(rotation[a], normal), depth)
    return count


@jit
def _corners_at_axis(geometry, surface, capsule, bodies, position, rotation, real, integer, count):
    """Corners of a surface of bodies[0] beside the axis of a capsule of bodies[1]; its ends are points of their own."""
    a, b = bodies
    v = geometry.vertex_first[capsule]
    start = moved(rotation[b], row(position, b), row(geometry.vertex, v))
    axis = subtract(moved(rotation[b], row(position, b), row(geometry.vertex, v + 1)), start)
    for corner in range(geometry.vertex_first[surface], geometry.vertex_first[surface + 1]):
        if not geometry.vertex_corner[corner]:
            continue
        p = moved(rotation[a], row(position, a), row(geometry.vertex, corner))
        s = dot(subtract(p, start), axis) / dot(axis, axis)
        if not 0.0 < s < 1.0:
            continue
        out = subtract(along(start, s, axis), p)
        distance = sqrt(dot(out, out))
        if 0.0 < distance < geometry.radius[capsule]:
            normal = (out[0] / distance, out[1] / distance, out[2] / distance)
            count = _add(real, integer, count, bodies, (corner, v), p, normal, geometry.radius[capsule] - distance)
    return count


@jit
def _ends(geometry, e, body, position, rotation):
    """Start and way of an edge, world."""
    p = moved(rotation[body], row(position, body), row(geometry.vertex, geometry.edge[e, 0]))
    return p, subtract(moved(rotation[body], row(position, body), row(geometry.vertex, geometry.edge[e, 1])), p)


@jit
def _edge_near(geometry, e, body, surface, other, position, rotation):
    """Whether an edge of a body may touch the box of a surface of another."""
    p, d = _ends(geometry, e, body, position, rotation)
    p = _turned_back(rotation[other], subtract(p, row(position, other)))
    d, root = _turned_back(rotation[other], d), geometry.node_first[surface]
    for k in range(3):
        if max(p[k], p[k] + d[k]) < geometry.node_min[root, k] or min(p[k], p[k] + d[k]) > geometry.node_max[root, k]:
            return False
    return geometry.edge_kind[e] != EDGE_HIDDEN


@jit
def _leaves_wedge(geometry, e, body, way, rotation, n):
    """Whether n points out of the wedge of an edge."""
    length = sqrt(dot(way, way))
    normal_0, normal_1 = edge_normals(geometry.edge_normal, e)
    way = (way[0] / length, way[1] / length, way[2] / length)
    normal_0, normal_1 = turned(rotation[body], normal_0), turned(rotation[body], normal_1)
    return in_edge_arc(n, way, normal_0, normal_1, geometry.edge_kind[e], OUT_OF_WEDGE)


@jit
def _holds(geometry, surface, e, body, way, middle, position, rotation):
    """Whether the solid of an edge holds a point, taken a little way into the edge's wedge."""
    normal_0, normal_1 = edge_normals(geometry.edge_normal, e)
    out = turned(rotation[body], along(normal_0, 1.0, normal_1))
    point = subtract(along(middle, -NUDGE * sqrt(dot(way, way)), out), row(position, body))
    return point_in_mesh(geometry, surface, _turned_back(rotation[body], point))


@jit
def _crossing_edges(geometry, first, second, bodies, position, rotation, real, integer, count):
    """Edges of two surfaces that cross where the solids overlap."""
    a, b = bodies
    if not (geometry.closed[first] and geometry.closed[second]):
        return count
    for e in range(geometry.edge_first[first], geometry.edge_first[first + 1]):
        if not _edge_near(geometry, e, a, second, b, position, rotation):
            continue
        p0, p_way = _ends(geometry, e, a, position, rotation)
        for f in range(geometry.edge_first[second], geometry.edge_first[second + 1]):
            if not _edge_near(geometry, f, b, first, a, position, rotation):
                continue
            q0, q_way = _ends(geometry, f, b, position, rotation)
            s, t = closest_on_segments(p0, p_way, q0, q_way)
            n = cross(p_way, q_way)
            length = sqrt(dot(n, n))
            if not (0.0 < s < 1.0 and 0.0 < t < 1.0) or length == 0.0:
                continue
            p, q = along(p0, s, p_way), along(q0, t, q_way)
            n = (n[0] / length, n[1] / length, n[2] / length)
            depth = dot(subtract(p, q), n)
            if depth < 0.0:
                n, depth = (-n[0], -n[1], -n[2]), -depth
            back = (-n[0], -n[1], -n[2])
            if (
                depth > 0.0
                and _leaves_wedge(geometry, e, a, p_way, rotation, n)
                and _leaves_wedge(geometry, f, b, q_way, rotation, back)
                and _holds(geometry, first, e, a, p_way, along(p, -0.5 * depth, n), position, rotation)
                and _holds(geometry, second, f, b, q_way, along(p, -0.5 * depth, n), position, rotation)
            ):
                count = _add(real, integer, count, bodies, (EDGE + e, EDGE + f), p, n, depth)
    return count


@jit
def _drop_deep_edges(real, integer, first, edges, end):
    """Keep of rows [edges, end) those not much deeper than the corners [first, edges), or than the least deep of them: the way out."""
    if end > real.shape[0] or end == edges:
        return end
    limit = 0.0
    for c in range(first, edges):
        limit = max(limit, real[c, 6])
    if first == edges:
        limit = inf
        for c in range(edges, end):
            limit = min(limit, real[c, 6])
    kept = edges
    for c in range(edges, end):
        if real[c, 6] <= MOST_DEPTH * limit:
            real[kept], integer[kept] = real[c], integer[c]
            kept += 1
    return kept


@jit
def _points_of_primitives(geometry, axes, sizes, i, j, bodies, position, rotation, real, integer, count):
    """Points of two primitives of bodies a and b, that of a first."""
    back = (bodies[1], bodies[0])
    if geometry.kind[i] == HALF_SPACE or geometry.kind[j] == HALF_SPACE:
        if geometry.kind[j] == ROUND:
            return _points_in_half_space(geometry, i, j, bodies, position, rotation, real, integer, count)
        if geometry.kind[i] == ROUND:
            return _points_in_half_space(geometry, j, i, back, position, rotation, real, integer, count)
        return count
    first, thick_i, thick_j = count, geometry.radius[i] > 0.0, geometry.radius[j] > 0.0
    if thick_i and thick_j:
        return _points_of_axes(geometry, i, j, bodies, position, rotation, real, integer, count)
    if not thick_i:
        count = _points_in_surface(geometry, axes, sizes, i, j, bodies, position, rotation, real, integer, count)
        if thick_j and geometry.vertex_first[j + 1] == geometry.vertex_first[j] + 2:
            count = _corners_at_axis(geometry, i, j, bodies, position, rotation, real, integer, count)
    if not thick_j:
        count = _points_in_surface(geometry, axes, sizes, j, i, back, position, rotation, real, integer, count)
        if thick_i and geometry.vertex_first[i + 1] == geometry.vertex_first[i] + 2:
            count = _corners_at_axis(geometry, j, i, back, position, rotation, real, integer, count)
    if not thick_i and not thick_j:
        end = _crossing_edges(geometry, i, j, bodies, position, rotation, real, integer, count)
        count = _drop_deep_edges(real, integer, first, count, end)
    return count


@jit
def find_points(geometry, axes, sizes, shape_of_body, reach, pairs, position, rotation, real, integer):
    """Points inside, of all pairs (p, 2) a < b; returns how many there are, also where there is no room for all.

    axes, sizes: see `inward_axes`. reach (n,) m about the centres of mass; position (n, 3), rotation (n, 3, 3) of the principal frames.
    real (cap, 7): a point of the line of action and the normal from a to b, world, and the depth, m.
    integer (cap, 4): a, b, and what touches: a vertex of one and of the other a vertex, or a primitive p as -1 - p.
    """
    # Not a literal: that would compile everything above twice.
    count = np.int64(0)
    for k in range(pairs.shape[0]):
        a, b = pairs[k, 0], pairs[k, 1]
        off = subtract(row(position, b), row(position, a))
        if reach[a] + reach[b] < inf and dot(off, off) >= (reach[a] + reach[b]) ** 2:
            continue
        shape_a, shape_b = shape_of_body[a], shape_of_body[b]
        for i in range(geometry.shape_first[shape_a], geometry.shape_first[shape_a + 1]):
            for j in range(geometry.shape_first[shape_b], geometry.shape_first[shape_b + 1]):
                count = _points_of_primitives(geometry, axes, sizes, i, j, (a, b), position, rotation, real, integer, count)
    return count
