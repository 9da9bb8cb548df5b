"""Pieces of the contacts of cylinders (see `cylinder`): their frame, their rims against planes, lines and circles.

A rim meets a curve q(s) where half the squared distance to the circle, f = ((rho - r)^2 + (z - z_rim)^2) / 2, is
least: Newton's method on f' = (rho - r) rho' + (z - z_rim) z'. With q' the tangent of the curve and c that of the
rim, the normal is q' x c.
"""

from __future__ import annotations

from math import copysign, cos, inf, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.cylinder import ZERO, basis, flat_length, from_axes, on_circle
from rigidimpulse.collision.distance.simplices import inner, over_triangle
from rigidimpulse.collision.manifold.contact_points import DEPTH, MOST_DEPTH, STRICT, TILT, Contact, append_contact
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, moved, row, subtract, turned

CYLINDER_CONTACT = np.int64(5)
"""Kind of all contacts of cylinders."""

RIM_POINTS = 8
"""Points, fixed on the cylinder, that stand for a rim that touches all around."""
SIDE, CAP, RIM, LOWEST, FIXED, NUM_FEATURES = (np.int64(number) for number in (0, 1, 3, 7, 9, 32))
"""Features of a cylinder: side; caps (top, bottom); rims where a curve goes in or out; lowest and fixed points. Those of primitive p begin
at FIRST_FEATURE + 32 p."""
FIRST_FEATURE = np.int64(1 << 30)
"""Features of cylinders begin beyond those of triangles, so that a contact of a body with both tells which it is of."""

WHOLE_PLANE, TRIANGLE = inf, -1.0
"""What bounds a plane, instead of the radius of a disc."""

BORDER = TOLERANCES.manifold.rim_border
_LEVEL = TOLERANCES.manifold.rim_level
_MERGE = TOLERANCES.manifold.rim_merge
_MAX_NEWTON = 30
_STEP = 0.25  # greatest step, rad or part of an edge
_CONVERGED = TOLERANCES.manifold.rim_converged
_ROUND_OFF = TOLERANCES.manifold.rim_round_off
_LEAST_CURVATURE = TOLERANCES.manifold.rim_least_curvature
_NUM_SAMPLES = 16  # points of a circle between which it has at most one least distance


class Solid(NamedTuple):
    """A cylinder in the frame of its pair: kernels work in its own axes and hand over results through it."""

    origin: tuple[float, float, float]
    u: tuple[float, float, float]
    v: tuple[float, float, float]
    w: tuple[float, float, float]  # the axis
    radius: float
    half: float
    feature: int  # number of its side; see SIDE and so on
    second: bool  # it is the second of its pair
    margin: float
    depth: float  # how far another surface may be inside, m
    tilt: float  # sine of the angle by which a contact within the margin may miss being locally closest


@inner
def solid_of(frame, radius, cylinder, margin):
    """Return the `Solid` of a primitive in the frame of its body."""
    u, v, w = basis((frame[cylinder, 3], frame[cylinder, 4], frame[cylinder, 5]))
    origin, half = row(frame, cylinder), frame[cylinder, 6]
    tilt = STRICT + min(TILT, margin / min(radius[cylinder], half))
    depth = min(DEPTH * margin, MOST_DEPTH * min(radius[cylinder], half))
    return Solid(origin, u, v, w, radius[cylinder], half, FIRST_FEATURE + NUM_FEATURES * cylinder, False, margin, depth, tilt)


@inner
def carried(solid, R, t):
    """Return the `Solid` of the second cylinder of a pair, given in its body's frame, in the frame of the first."""
    origin, u, v, w = moved(R, t, solid.origin), turned(R, solid.u), turned(R, solid.v), turned(R, solid.w)
    return Solid(origin, u, v, w, solid.radius, solid.half, solid.feature, True, solid.margin, solid.depth, solid.tilt)


@inner
def append(solid, found, count, touch, feature, other):
    """Append a contact of the cylinder with another body, unless it is there already.

    touch: (point of the cylinder, of the other body, normal from the one to the other, gap), in the axes of the cylinder; `feature`: number
    among the cylinder's; `other`: feature of the other body.
    """
    u, v, w = solid.u, solid.v, solid.w
    p, q, n, gap = touch
    p = along(solid.origin, 1.0, from_axes(u, v, w, p))
    q = along(solid.origin, 1.0, from_axes(u, v, w, q))
    n = from_axes(u, v, w, n)
    merge = _MERGE * (solid.radius + solid.half)
    feature += solid.feature
    if solid.second:
        n = (-n[0], -n[1], -n[2])
        return append_contact(found, count, Contact(q, p, n, gap, CYLINDER_CONTACT, other, feature), merge)
    return append_contact(found, count, Contact(p, q, n, gap, CYLINDER_CONTACT, feature, other), merge)


@inner
def write_points(solid, p, q, out):
    """Write two points, given in the axes of the cylinder, to out[0:6] in the frame of the pair."""
    p = along(solid.origin, 1.0, from_axes(solid.u, solid.v, solid.w, p))
    q = along(solid.origin, 1.0, from_axes(solid.u, solid.v, solid.w, q))
    for k in range(3):
        out[k] = p[k]
        out[3 + k] = q[k]


@inner
def rims_on_plane(solid, found, count, plane, bound, other):
    """Append the contacts of both rims with a plane (m, (a, b, c), beyond) through `a`, unit normal m out of the other body.

    The plane is bounded by the triangle a, b, c (`bound` TRIANGLE), with `beyond` (3) m more at its sides, or a circle of radius `bound`
    about a.
    """
    m, (a, b, c), beyond = plane
    radius, half, margin = solid.radius, solid.half, solid.margin
    border = BORDER * (radius + half)
    deepest = -inf if bound == WHOLE_PLANE else -solid.depth
    flat = flat_length(m[0], m[1])
    for bottom in range(2):
        level = half - 2.0 * half * bottom
        least = level * m[2] - radius * flat - dot(m, a)
        if least > margin:
            continue
        # A rim that is near all around has fixed points beside its lowest one.
        all_around = least + 2.0 * radius * flat <= margin
        for k in range(RIM_POINTS + 1 if all_around else 1):
            if k == 0:
                # A level rim has no lowest point.
                if flat <= _LEVEL:
                    continue
                p = (-radius * m[0] / flat, -radius * m[1] / flat, level)
            else:
                angle = 2.0 * pi * (k - 1) / RIM_POINTS
                p = (radius * cos(angle), radius * sin(angle), level)
            gap = dot(m, subtract(p, a))
            if gap > margin or gap < deepest:
                continue
            q = along(p, -gap, m)
            if bound == TRIANGLE:
                if not over_triangle(q, a, b, c, m, border + beyond[0], border + beyond[1], border + beyond[2]):
                    continue
            elif bound < WHOLE_PLANE and dot(subtract(q, a), subtract(q, a)) > (bound + border) ** 2:
                continue
            feature = LOWEST + bottom if k == 0 else FIXED + RIM_POINTS * bottom + k - 1
            count = append(solid, found, count, (p, q, (-m[0], -m[1], -m[2]), gap), feature, other)
    return count


@inner
def _curve(centre, u, v, rim_radius, s):
    """Return point and two derivatives of the circle of radius `rim_radius` across u, v, or of a line centre + s u."""
    if rim_radius == 0.0:
        return along(centre, s, u), u, ZERO
    q = on_circle(centre, u, v, rim_radius, s)
    return q, on_circle(ZERO, u, v, rim_radius, s + 0.5 * pi), subtract(centre, q)


@inner
def closest_to_ring(centre, u, v, rim_radius, s, radius, level, axial):
    """Return (s, f'') of the least distance, near s, of a line or circle to the rim of a cylinder.

    With axial = 0 and radius = 0 it is the distance to the cylinder's axis. f'' is negative if nothing is found.
    """
    for _ in range(_MAX_NEWTON):
        q, dq, ddq = _curve(centre, u, v, rim_radius, s)
        rho = flat_length(q[0], q[1])
        x, y = q[0] / rho, q[1] / rho
        outward, around = x * dq[0] + y * dq[1], x * dq[1] - y * dq[0]
        slope = (rho - radius) * outward + axial * (q[2] - level) * dq[2]
        bend = (rho - radius) * (around * around / rho + x * ddq[0] + y * ddq[1])
        curvature = outward * outward + bend + axial * (dq[2] * dq[2] + (q[2] - level) * ddq[2])
        # Between two least distances the curvature is negative: go downhill.
        step = -min(_STEP, max(-_STEP, slope / curvature)) if curvature > 0.0 else -copysign(_STEP, slope)
        s += step
        if abs(step) <= _ROUND_OFF * (1.0 + abs(s)):
            return s, curvature
    return s, curvature if abs(step) <= _CONVERGED else -1.0


@inner
def ring_contact(q, tangent, curvature, solid, level, skeleton):
    """Return (found, p, normal, distance) for the point q of a curve that is locally closest to a rim.

    `skeleton`: radius by which the curve is grown. The normal lies between those of cap and side; distance and q are of
    the skeleton.
    """
    rho = flat_length(q[0], q[1])
    out = (q[0] / rho, q[1] / rho, 0.0)
    p = (solid.radius * out[0], solid.radius * out[1], level)
    between = subtract(q, p)
    distance = sqrt(dot(between, between))
    squared = dot(tangent, tangent)
    if distance > solid.margin + skeleton or curvature * solid.radius <= _LEAST_CURVATURE * distance * squared:
        return False, p, out, distance
    up = copysign(1.0, level)
    across = cross(tangent, (-out[1], out[0], 0.0))
    size = sqrt(dot(across, across))
    # The normal from the tangents is exact for close curves, that from the two points for distant ones.
    if size * solid.radius > distance * sqrt(squared):
        n = along(ZERO, 1.0 / copysign(size, dot(across, out) + up * across[2]), across)
        distance = dot(n, between)
    else:
        n = along(ZERO, 1.0 / distance, between)
    in_arc = dot(n, out) >= -solid.tilt and up * n[2] >= -solid.tilt
    return in_arc and distance >= skeleton - solid.depth, p, n, distance


@inner
def circle_contacts(solid, found, count, circle, bottom, other):
    """Append the contacts of another cylinder's rim with the side (`bottom` -1) or a rim (0 top, 1 bottom) of this one.

    circle: (centre, u, v, radius) of the other rim, with u x v out of its cap; `other`: feature of its rim.
    """
    centre, u, v, rim_radius = circle
    radius, half, margin = solid.radius, solid.half, solid.margin
    beside = max(0.0, flat_length(centre[0], centre[1]) - radius)
    if flat_length(beside, max(0.0, abs(centre[2]) - half)) > margin + rim_radius:
        return count
    axial = 0.0 if bottom < 0 else 1.0
    level = 0.0 if bottom < 0 else half - 2.0 * half * bottom
    outward = cross(u, v)
    spacing = 2.0 * pi / _NUM_SAMPLES
    before, here = inf, inf
    for k in range(_NUM_SAMPLES + 2):  # `here` is the sample k - 1
        q = on_circle(centre, u, v, rim_radius, spacing * k)
        after = flat_length(flat_length(q[0], q[1]) - radius, axial * (q[2] - level))
        low = k > 1 and here <= before and here < after and here <= margin + rim_radius * spacing
        before, here = here, after
        if not low:
            continue
        for side in range(-1, 2, 2):  # two least distances may lie close together: come from both sides
            start = spacing * (k - 1 + side)
            s, bend = closest_to_ring(centre, u, v, rim_radius, start, radius * axial, level, axial)
            if bend < 0.0:
                continue
            q, tangent, inward = _curve(centre, u, v, rim_radius, s)
            if bottom < 0:
                rho = flat_length(q[0], q[1])
                n = (q[0] / rho, q[1] / rho, 0.0)
                gap = rho - radius
                p = (radius * n[0], radius * n[1], q[2])
                met = abs(q[2]) <= half * (1.0 + BORDER) and -solid.depth <= gap <= margin
                feature, going_out = SIDE, dot(cross(outward, q), (0.0, 0.0, 1.0)) > 0.0
            else:
                met, p, n, gap = ring_contact(q, tangent, bend, solid, level, 0.0)
                feature, going_out = RIM + bottom, dot(tangent, q) - tangent[2] * q[2] > 0.0
            in_arc = dot(n, inward) >= -solid.tilt * rim_radius and dot(n, outward) <= solid.tilt
            if met and in_arc and gap <= margin:
                count = append(solid, found, count, (p, q, n, gap), feature, other + (2 if going_out else 0))
    return count
