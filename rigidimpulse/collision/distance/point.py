"""Signed distance of points from rigid shapes, and the first time at which a moving point comes near one.

A shape is the union of its primitives; of those that overlap the least distance counts. Half spaces, spheres, capsules and cylinders
are in closed form; of a mesh it is the nearest triangle's, by its box tree, negative where `collision.containment` finds the
point inside; an open mesh has no inside. A moving point advances by its distance, which no surface can be nearer than
(conservative advancement, Mirtich 1996, for a point).
"""

from __future__ import annotations

from math import inf, sqrt

from rigidimpulse.collision.containment import point_in_mesh
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import along, dot, row, subtract

STACK = 128
MOST_ADVANCES = 60


@jit
def closest_on_triangle(p, a, b, c):
    """Return the barycentric coordinates of the point of triangle abc closest to p (after Ericson 2005, section 5.1.5)."""
    ab, ac, ap = subtract(b, a), subtract(c, a), subtract(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    bp = subtract(p, b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
        return 1.0 - v, v, 0.0
    cp = subtract(p, c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
        return 1.0 - w, 0.0, w
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - w, w
    total = va + vb + vc
    v, w = vb / total, vc / total
    return 1.0 - v - w, v, w


@jit
def triangle_point(a, b, c, weights):
    """Return the point of triangle abc with barycentric coordinates `weights`."""
    return along(along((weights[0] * a[0], weights[0] * a[1], weights[0] * a[2]), weights[1], b), weights[2], c)


@jit
def _away(p, centre, radius):
    """Return distance and normal of a point p from a ball."""
    d = subtract(p, centre)
    length = sqrt(dot(d, d))
    normal = (d[0] / length, d[1] / length, d[2] / length) if length > 0.0 else (0.0, 0.0, 1.0)
    return length - radius, normal


@jit
def _cylinder(frame, radius, p):
    """Return distance and normal of a point from a cylinder."""
    axis = (frame[3], frame[4], frame[5])
    d = subtract(p, (frame[0], frame[1], frame[2]))
    height = dot(d, axis)
    across = along(d, -height, axis)
    off = sqrt(dot(across, across))
    out = (across[0] / off, across[1] / off, across[2] / off) if off > 0.0 else (axis[1], axis[2], axis[0])
    if off == 0.0:
        out = along(out, -dot(out, axis), axis)
        length = sqrt(dot(out, out))
        if length < 0.1:  # the axis is a diagonal of the coordinates
            out = (axis[1], -axis[0], 0.0)
            length = sqrt(dot(out, out))
        out = (out[0] / length, out[1] / length, out[2] / length)
    end = axis if height >= 0.0 else (-axis[0], -axis[1], -axis[2])
    beyond, beside = abs(height) - frame[6], off - radius
    if beyond > 0.0 and beside > 0.0:
        length = sqrt(beyond * beyond + beside * beside)
        n = along((beyond / length * end[0], beyond / length * end[1], beyond / length * end[2]), beside / length, out)
        return length, n
    return (beyond, end) if beyond > beside else (beside, out)


@jit
def _box_squared(p, low, high):
    total = 0.0
    for k in range(3):
        gap = max(0.0, low[k] - p[k], p[k] - high[k])
        total += gap * gap
    return total


@jit
def _nearest_triangle(geometry, primitive, p, limit, stack):
    """Return the squared distance to the nearest triangle of a mesh, below limit^2, its index (-1: none) and the nearest point."""
    best, found, nearest = limit * limit, -1, p
    stack[0] = geometry.node_first[primitive]
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if _box_squared(p, row(geometry.node_min, node), row(geometry.node_max, node)) >= best:
            continue
        child = geometry.node_child[node]
        if child >= 0:
            # The nearer box is walked first, so that the farther one can be left out.
            left = _box_squared(p, row(geometry.node_min, child), row(geometry.node_max, child))
            right = _box_squared(p, row(geometry.node_min, child + 1), row(geometry.node_max, child + 1))
            stack[depth] = child + 1 if left <= right else child
            stack[depth + 1] = child if left <= right else child + 1
            depth += 2
            continue
        start = geometry.node_start[node]
        for t in range(start, start + geometry.node_count[node]):
            a, b = row(geometry.vertex, geometry.triangle[t, 0]), row(geometry.vertex, geometry.triangle[t, 1])
            c = row(geometry.vertex, geometry.triangle[t, 2])
            q = triangle_point(a, b, c, closest_on_triangle(p, a, b, c))
            d = subtract(p, q)
            squared = dot(d, d)
            if squared < best:
                best, found, nearest = squared, t, q
    return best, found, nearest


@jit
def _mesh(geometry, primitive, p, limit, stack):
    """Return signed distance and normal of a point from a mesh; `limit` if it is not nearer."""
    squared, triangle, q = _nearest_triangle(geometry, primitive, p, limit, stack)
    if triangle < 0:
        return limit, (0.0, 0.0, 0.0)
    inside = geometry.closed[primitive] and point_in_mesh(geometry, primitive, p)
    length = sqrt(squared)
    if length == 0.0:
        return 0.0, row(geometry.triangle_normal, triangle)
    d = subtract(p, q)
    if inside:
        return -length, (-d[0] / length, -d[1] / length, -d[2] / length)
    return length, (d[0] / length, d[1] / length, d[2] / length)


@jit
def signed_distance(geometry, shape, p, limit, stack):
    """Return signed distance (m) and outward unit normal of the surface of a shape at point p, in the shape's frame.

    Surfaces farther than `limit` are left out; where there is no nearer one `limit` is returned with no normal. `stack`: (128,) int64.
    """
    best, normal = limit, (0.0, 0.0, 0.0)
    for k in range(geometry.shape_first[shape], geometry.shape_first[shape + 1]):
        if geometry.kind[k] == HALF_SPACE:
            n = (geometry.frame[k, 0], geometry.frame[k, 1], geometry.frame[k, 2])
            d = dot(n, p) - geometry.frame[k, 3]
        elif geometry.kind[k] == CYLINDER:
            d, n = _cylinder(geometry.frame[k], geometry.radius[k], p)
        else:
            first = geometry.vertex_first[k]
            count = geometry.vertex_first[k + 1] - first
            if count <= 2:
                a = row(geometry.vertex, first)
                e = subtract(row(geometry.vertex, first + count - 1), a)
                squared = dot(e, e)
                # A sphere or capsule: the axis, a point or a segment, and the radius around it.
                s = min(1.0, max(0.0, dot(subtract(p, a), e) / squared)) if squared > 0.0 else 0.0
                d, n = _away(p, along(a, s, e), geometry.radius[k])
            else:
                d, n = _mesh(geometry, k, p, max(abs(best), 0.0), stack)
        # Of primitives that overlap the least distance counts.
        if d < best:
            best, normal = d, n
    return best, normal


@jit
def first_contact(geometry, shape, start, end, gap, stack):
    """Return (time, distance, normal, place) where a point moving from start to end comes within `gap` of a shape, in its frame.

    time is in [0, 1], or inf where it does not come so near; distance and unit normal are those at that place. A point that starts
    nearer touches at time 0.
    """
    way = subtract(end, start)
    length = sqrt(dot(way, way))
    s, p = 0.0, start
    near = 0.02 * gap
    for _ in range(MOST_ADVANCES):
        d, normal = signed_distance(geometry, shape, p, length + 2.0 * gap, stack)
        if d <= gap + near:
            return s, d, normal, p
        if d - gap > (1.0 - s) * length:
            return inf, d, normal, p
        s = min(1.0, s + (d - gap) / length)
        p = along(start, s, way)
    return s, d, normal, p


@jit
def first_contact_with_triangle(p, way_p, corners, ways, radius, gap):
    """Return (time, weights, normal, distance) at which a moving ball comes within `gap` of a moving triangle.

    p, way_p: centre and its way over the step; corners, ways: three of each; weights: barycentric, of the place touched; normal: unit,
    from the ball to the triangle; distance: between their surfaces then. time is inf where it does not come so near within the step.
    """
    # No point of the triangle comes nearer to the ball faster than its fastest corner does.
    fastest = 0.0
    for k in range(3):
        d = subtract(way_p, ways[k])
        fastest = max(fastest, dot(d, d))
    fastest = sqrt(fastest)
    s, length = 0.0, 0.0
    weights, normal = (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for _ in range(MOST_ADVANCES):
        a, b, c = along(corners[0], s, ways[0]), along(corners[1], s, ways[1]), along(corners[2], s, ways[2])
        centre = along(p, s, way_p)
        weights = closest_on_triangle(centre, a, b, c)
        d = subtract(triangle_point(a, b, c, weights), centre)
        length = sqrt(dot(d, d))
        if length > 0.0:
            normal = (d[0] / length, d[1] / length, d[2] / length)
        # Advances come to the gap from above, ever more slowly: 2 % above it counts as there.
        if length - radius <= 1.02 * gap:
            return s, weights, normal, length - radius
        if (length - radius - gap) > (1.0 - s) * fastest:
            return inf, weights, normal, length - radius
        # Conservative advancement: no contact comes before this.
        s = min(1.0, s + (length - radius - gap) / fastest)
    return s, weights, normal, length - radius
