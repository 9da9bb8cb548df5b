"""Contacts of the edges of two ROUND primitives: crossing edges, and nearly parallel ones (see `mesh_mesh`)."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from rigidimpulse.collision.distance.simplices import CORNER, EDGE_EDGE, arc_miss, edge_normals, inner
from rigidimpulse.collision.manifold.contact_points import (
    INSIDE,
    MERGE,
    ROUND_OFF,
    STRICT,
    TILT,
    Contact,
    append_contact,
)
from rigidimpulse.core.kernels import inlined
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, moved, row, subtract, turned

CROSSING = TOLERANCES.manifold.crossing_edges
NEARLY_PARALLEL = 0.02
"""Greatest sine of the angle of two edges that may touch along a length."""
SIDEWAYS = 0.5
"""Greatest offset across the normal, relative to the distance, of the ends of such a length."""


class Edges(NamedTuple):
    """Two edges in the frame of the first body: p + s d and q + t e, with s and t in [0, 1]."""

    a: int  # number of the first
    b: int
    p: tuple[float, float, float]  # m
    d: tuple[float, float, float]
    q: tuple[float, float, float]
    e: tuple[float, float, float]


@inner
def arcs_miss(geometry, view, edges, normal):
    """Return (miss, end) of the edge whose arc a normal from a to b misses by more (see `arc_miss`).

    The normal, and the end, which points from a to b too, are in the frame of a.
    """
    edge_normal, edge_kind, R_back = geometry.edge_normal, geometry.edge_kind, view.R_back
    edge_a, edge_b, d, e = edges.a, edges.b, edges.d, edges.e
    length = sqrt(dot(d, d))
    direction = (d[0] / length, d[1] / length, d[2] / length)
    normal_0, normal_1 = edge_normals(edge_normal, edge_a)
    miss_a, end_a = arc_miss(normal, direction, normal_0, normal_1, edge_kind[edge_a])
    length = sqrt(dot(e, e))
    direction = turned(R_back, (e[0] / length, e[1] / length, e[2] / length))
    outward = turned(R_back, (-normal[0], -normal[1], -normal[2]))
    normal_0, normal_1 = edge_normals(edge_normal, edge_b)
    miss_b, end_b = arc_miss(outward, direction, normal_0, normal_1, edge_kind[edge_b])
    end_b = turned(view.R, end_b)
    return (miss_a, end_a) if miss_a > miss_b else (miss_b, (-end_b[0], -end_b[1], -end_b[2]))


@inner
def _crossing(p, d, q, e, reach):
    """Return (near, point_a, point_b, c, distance) for the common normal c of two edges p + s d, q + t e.

    `near`: both closest points lie on the edges and are at most `reach` apart; c points from a to b.
    """
    c = cross(d, e)
    c_squared = dot(c, c)
    between = subtract(q, p)
    s = dot(cross(between, e), c) / c_squared
    t = dot(cross(between, d), c) / c_squared
    point_a = along(p, s, d)
    point_b = along(q, t, e)
    distance = dot(subtract(point_b, point_a), c) / sqrt(c_squared)
    # The normal points from a to b.
    if distance < 0.0:
        distance = -distance
        c = (-c[0], -c[1], -c[2])
    inside = -INSIDE <= s <= 1.0 + INSIDE and -INSIDE <= t <= 1.0 + INSIDE
    return inside and distance <= reach, point_a, point_b, c, distance


@inlined
def _crossing_contact(geometry, view, found, count, edges):
    """Append the contact of two edges if they cross (frame of the first body); returns the new count, and whether they are in reach."""
    p, d, q, e = edges.p, edges.d, edges.q, edges.e
    near, point_a, point_b, c, distance = _crossing(p, d, q, e, view.reach)
    if not near:
        return count, False
    c_length = sqrt(dot(c, c))
    spread = sqrt(dot(d, d) * dot(e, e)) / c_length  # 1 / sine: how much the normal leans where an edge leans
    size = sqrt(min(dot(d, d), dot(e, e)))
    tolerance = STRICT + ROUND_OFF * spread + min(TILT, view.margin * spread / size)
    sense = 1.0
    # Near each other the points do not tell which body is on which side, since bodies may be a little inside each other: the arcs do.
    for _ in range(2 if distance <= view.depth and view.leeway == 0.0 else 1):
        scale = sense / c_length
        normal = (c[0] * scale, c[1] * scale, c[2] * scale)
        miss, end = arcs_miss(geometry, view, edges, normal)
        if miss <= tolerance + view.leeway and sense * distance <= view.skeleton:
            if 0.0 < miss <= tolerance:
                normal = end
            surface_a = along(point_a, view.radius_t, normal)
            surface_b = along(point_b, -view.radius_v, normal)
            gap = dot(subtract(surface_b, surface_a), normal)
            contact = Contact(surface_a, surface_b, normal, gap, EDGE_EDGE, edges.a, edges.b)
            return append_contact(found, count, contact, MERGE * size), True
        sense = -sense
    return count, True


@inner
def _overlap(p, d, q, e):
    """Return (low, high, start, speed) of the overlap of two nearly parallel edges along d, in units of length.

    The point of p + s d at `place` has the point q + e (place - start) / speed beside it.
    """
    length = sqrt(dot(d, d))
    speed = dot(e, d) / length
    start = dot(subtract(q, p), d) / length
    return max(0.0, min(start, start + speed)), min(length, max(start, start + speed)), start, speed


@inlined
def _parallel_contacts(geometry, view, found, count, edges):
    """Append both ends of the overlap of two nearly parallel edges of meshes (frame of the first body); returns as `_crossing_contact`."""
    edge, edge_a, edge_b = geometry.edge, edges.a, edges.b
    p, d, q, e = edges.p, edges.d, edges.q, edges.e
    length = sqrt(dot(d, d))
    u = (d[0] / length, d[1] / length, d[2] / length)
    low, high, start, speed = _overlap(p, d, q, e)
    middle = 0.5 * (low + high)
    between = subtract(along(q, (middle - start) / speed, e), along(p, middle, u))
    distance = sqrt(dot(between, between))
    if high - low <= MERGE * length or distance > view.skeleton or distance <= ROUND_OFF * length:
        return count, False
    normal = (between[0] / distance, between[1] / distance, between[2] / distance)
    error = ROUND_OFF * (length + abs(p[0]) + abs(p[1]) + abs(p[2])) / distance
    if error > TILT and view.leeway == 0.0:
        return count, True
    tolerance = STRICT + view.leeway + error
    if arcs_miss(geometry, view, edges, normal)[0] > tolerance:
        return count, True
    for end in range(2):
        place = high if end == 1 else low
        point_a = along(p, place, u)
        point_b = along(q, (place - start) / speed, e)
        between = subtract(point_b, point_a)
        gap = dot(between, normal)
        sideways = along(between, -gap, normal)
        if not 0.0 < gap <= view.skeleton or dot(sideways, sideways) > (SIDEWAYS * gap) ** 2:
            continue
        # The end is a vertex of one edge, beside the other edge.
        of_a = place == 0.0 or place == length
        feature_a = 2 * edge[edge_a, end] if of_a else 2 * edge_a + 1
        feature_b = 2 * edge_b + 1 if of_a else 2 * edge[edge_b, end if speed > 0.0 else 1 - end]
        contact = Contact(point_a, point_b, normal, gap, CORNER, feature_a, feature_b)
        count = append_contact(found, count, contact, MERGE * length)
    return count, True


@inner
def edges_of(edge_a, edge_b, ends_a, ends_b):
    """Two edges from their numbers and their ends (p, p + d) and (q, q + e)."""
    (p, p_end), (q, q_end) = ends_a, ends_b
    return Edges(edge_a, edge_b, p, subtract(p_end, p), q, subtract(q_end, q))


@inner
def edge_contacts(geometry, view, found, count, edge_a, edge_b):
    """Append the contacts of an edge of the first body with one of the second, of whose vertices `view` is.

    Returns the new count, and whether the edges are in reach.
    """
    vertex, edge = geometry.vertex, geometry.edge
    q, q_end = moved(view.R, view.t, row(vertex, edge[edge_b, 0])), moved(view.R, view.t, row(vertex, edge[edge_b, 1]))
    edges = edges_of(edge_a, edge_b, (row(vertex, edge[edge_a, 0]), row(vertex, edge[edge_a, 1])), (q, q_end))
    d, e, any_near = edges.d, edges.e, False
    c = cross(d, e)
    sine_squared = dot(c, c) / (dot(d, d) * dot(e, e))
    if sine_squared > CROSSING * CROSSING:
        count, any_near = _crossing_contact(geometry, view, found, count, edges)
    # Nearly parallel edges of meshes have both ends of their overlap.
    if view.radius_v == 0.0 and view.radius_t == 0.0 and sine_squared < NEARLY_PARALLEL * NEARLY_PARALLEL:
        count, near = _parallel_contacts(geometry, view, found, count, edges)
        any_near = any_near or near
    return count, any_near
