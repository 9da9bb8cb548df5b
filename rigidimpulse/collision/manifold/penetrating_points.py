"""Points of bodies that are inside others, with the way out: what the penalty method pushes at.

    half space, n.x <= o, and a corner p of radius r:     d = o + r - n.p,        out along n
    spheres and capsules:  closest points p, q of axes:   d = r_a + r_b - |q - p|, out along q - p
    corner p of radius r and a surface of triangles:      d = r + s,               out along the way from p to the nearest surface point
    edges that cross, p and q where their lines are nearest:  d = (p - q).n,       out along n = +- e_a x e_b, out of both edges' wedges

s is the depth of p in the solid, negative outside. A box, hull or mesh has its corners for points (radius 0), a sphere its centre, a
capsule the two ends of its axis, and where a corner of a surface comes at the middle of its axis that one. Each point has its own spring,
and both bodies are pushed along the same line. They are pushed, and friction acts, where the body is deepest: at p - r n, on the surface of
a sphere or capsule, so that friction turns it. Two spheres or capsules are pushed at the middle of their overlap.

The nearest surface point of a corner is looked for on faces that push it back into its own body (n.m > 0, m the mean direction of its
edges): otherwise the corners of a box that stands flush on another would be pushed out through its side. The test whether a point is inside
uses a place NUDGE of the edges' length inside its own body, so that flush corners do not come and go. Edges much deeper than the corners of
the pair, or than its least deep edges, are no way out and are dropped.

Sources: P. Moore, J. Wilhelms, Collision detection and response for computer animation, SIGGRAPH 1988 (a spring from each point that is
inside to the nearest point of the surface); Ericson, Real-Time Collision Detection, 2005, section 5.1.5 (nearest point of a triangle).
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from rigidimpulse.collision.containment import point_in_mesh
from rigidimpulse.collision.distance.simplices import closest_on_segments
from rigidimpulse.collision.geometry import HALF_SPACE, ROUND
from rigidimpulse.collision.manifold.penetrating_edges import crossing_edges, drop_deep_edges
from rigidimpulse.collision.manifold.penetrating_surface import NUDGE, ON_FACE, add_point, box_squared, nearest_on_surface
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import along, dot, moved, row, subtract, turned, turned_back


@jit
def _points_in_half_space(solids, plane, other, bodies, poses, points, count):
    """Corners of a ROUND primitive of bodies[1] in a half space of bodies[0]."""
    geometry, (position, rotation), (a, b) = solids.geometry, poses, bodies
    normal = turned(rotation[a], row(geometry.frame, plane))
    offset = geometry.frame[plane, 3] + dot(normal, row(position, a))
    for v in range(geometry.vertex_first[other], geometry.vertex_first[other + 1]):
        if geometry.vertex_corner[v]:
            p = moved(rotation[b], row(position, b), row(geometry.vertex, v))
            depth = offset + geometry.radius[other] - dot(normal, p)
            if depth > 0.0:
                deepest = along(p, -geometry.radius[other], normal)
                count = add_point(points, count, bodies, (-1 - plane, v), deepest, normal, depth)
    return count


@jit
def _points_of_axes(solids, first, second, bodies, poses, points, count):
    """The closest points of two spheres or capsules."""
    geometry, (position, rotation), (a, b) = solids.geometry, poses, bodies
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
        count = add_point(points, count, bodies, (p_first, q_first), point, normal, depth)
    return count


@jit
def _points_in_surface(solids, surface, other, bodies, poses, points, count):
    """Corners of a ROUND primitive of bodies[1] in the solid of triangles of bodies[0]."""
    (geometry, axes, sizes), (position, rotation), (a, b) = solids, poses, bodies
    radius, root = geometry.radius[other], geometry.node_first[surface]
    for v in range(geometry.vertex_first[other], geometry.vertex_first[other + 1]):
        if not geometry.vertex_corner[v]:
            continue
        world = moved(rotation[b], row(position, b), row(geometry.vertex, v))
        p = turned_back(rotation[a], subtract(world, row(position, a)))
        if box_squared(geometry, root, p) > radius * radius:
            continue
        # Asked a little inside its own body, so that flush corners do not come and go.
        axis = turned_back(rotation[a], turned(rotation[b], row(axes, v)))
        inside = geometry.closed[surface] and point_in_mesh(geometry, surface, along(p, NUDGE * sizes[v], axis))
        if radius == 0.0 and not inside:
            continue
        squared, q, t = nearest_on_surface(geometry, surface, p, axis)
        # No face pushes the corner back into its body: the nearest one counts.
        if t < 0:
            squared, q, t = nearest_on_surface(geometry, surface, p, (0.0, 0.0, 0.0))
        distance = sqrt(squared)
        if not inside and distance >= radius:
            continue
        out = subtract(q, p) if inside else subtract(p, q)
        face = row(geometry.triangle_normal, t)
        normal = face
        # On a face its normal is exact, however small the distance; elsewhere it is the way to the nearest point.
        if dot(out, face) < (1.0 - ON_FACE) * distance:
            normal = (out[0] / distance, out[1] / distance, out[2] / distance)
        depth = radius + (dot(out, normal) if inside else -distance)
        if depth > 0.0:
            normal = turned(rotation[a], normal)
            count = add_point(points, count, bodies, (-1 - surface, v), along(world, -radius, normal), normal, depth)
    return count


@jit
def _corners_at_axis(solids, surface, capsule, bodies, poses, points, count):
    """Corners of a surface of bodies[0] beside the axis of a capsule of bodies[1]; its ends are points of their own."""
    geometry, (position, rotation), (a, b) = solids.geometry, poses, bodies
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
            count = add_point(points, count, bodies, (corner, v), p, normal, geometry.radius[capsule] - distance)
    return count


@jit
def _points_of_primitives(solids, i, j, bodies, poses, points, count):
    """Points of two primitives of bodies a and b, that of a first."""
    geometry = solids.geometry
    back = (bodies[1], bodies[0])
    if geometry.kind[i] == HALF_SPACE or geometry.kind[j] == HALF_SPACE:
        if geometry.kind[j] == ROUND:
            return _points_in_half_space(solids, i, j, bodies, poses, points, count)
        if geometry.kind[i] == ROUND:
            return _points_in_half_space(solids, j, i, back, poses, points, count)
        return count
    first, thick_i, thick_j = count, geometry.radius[i] > 0.0, geometry.radius[j] > 0.0
    if thick_i and thick_j:
        return _points_of_axes(solids, i, j, bodies, poses, points, count)
    if not thick_i:
        count = _points_in_surface(solids, i, j, bodies, poses, points, count)
        if thick_j and geometry.vertex_first[j + 1] == geometry.vertex_first[j] + 2:
            count = _corners_at_axis(solids, i, j, bodies, poses, points, count)
    if not thick_j:
        count = _points_in_surface(solids, j, i, back, poses, points, count)
        if thick_i and geometry.vertex_first[i + 1] == geometry.vertex_first[i] + 2:
            count = _corners_at_axis(solids, j, i, back, poses, points, count)
    if not thick_i and not thick_j:
        end = crossing_edges(geometry, i, j, bodies, poses, points, count)
        count = drop_deep_edges(points, first, count, end)
    return count


@jit
def find_points(solids, shape_of_body, reach, pairs, poses, points):
    """Points inside, of all pairs (p, 2) a < b; returns how many there are, also where that is more than the buffer holds.

    solids, poses, points: see `surface`. reach (n,) m about the centres of mass.
    """
    geometry, position = solids.geometry, poses.position
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
                count = _points_of_primitives(solids, i, j, (a, b), poses, points, count)
    return count
