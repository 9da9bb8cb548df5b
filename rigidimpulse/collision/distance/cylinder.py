"""Least distance of a solid right circular cylinder to points, segments, triangles and other cylinders.

    cylinder_support(axis, half_height, radius, n) -> s, the greatest n . (p - centre) over the cylinder, |n| = 1
    cylinder_triangle_distance(centre, axis, half_height, radius, triangle (3, 3), out (9,)) -> distance
    cylinder_cylinder_distance(first, second, out (9,)) -> distance, each a tuple (centre, axis, half_height, radius)
    Centres and axes are (3,) arrays or 3-tuples, axes of unit length. A triangle may be a segment (a, b, b) or a point.
    out = point on the first cylinder, point on the second shape, unit normal from first to second. Where they overlap
    the distance is 0, both points are a common one, and the normal is 0.

The normal n certifies the distance: n . p over the second shape less n . p over the first is a lower bound
of the distance, and equals it up to round-off (`least n . p`, that is min_B n . p - n . centre_a - s_a(n), certifies
the answer).

In the frame of the cylinder (axis z, half height h, radius r, rho^2 = x^2 + y^2) the distance of a point is
    d^2 = max(0, rho - r)^2 + max(0, |z| - h)^2,
a convex function with continuous slope, so its least value on a segment is where the slope vanishes: found piece by
piece between the crossings of rho = r and z = +-h, in closed form or by Newton's method kept inside a bracket. A
triangle's interior is closest only where its plane supports the cylinder. Two cylinders are closest at their sides
(common perpendicular of the axes) or at a point of one of the four rims; the rims are searched by Newton's method,
and if the support gap does not confirm the result, the discs they bound are searched as convex sets, chord by chord.

Support function: s(n) = r sqrt(1 - (n . axis)^2) + h |n . axis|.
"""

from __future__ import annotations

from math import copysign, cos, inf, pi, sin, sqrt

from rigidimpulse.collision.distance.simplices import inner, over_triangle
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, subtract

_EPSILON = 2.0**-52
_ROUND_OFF = TOLERANCES.distance.cylinder_round_off
_MAX_NEWTON = 60  # steps of Newton's method, most of which halve a bracket
_MAX_HALVINGS = 60
_NUM_SAMPLES = 8  # points of a rim from which the closest one is sought
_THIN = TOLERANCES.distance.cylinder_thin_triangle
_PARALLEL = TOLERANCES.distance.cylinder_parallel_axes
ZERO, AXIS = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)


@jit
def cylinder_support(axis, half_height, radius, n):
    """Return the greatest n . (p - centre) over the cylinder, for a unit vector n."""
    across = cross(axis, n)
    return radius * sqrt(dot(across, across)) + half_height * abs(dot(axis, n))


@jit_making_arrays
def cylinder_triangle_distance(centre, axis, half_height, radius, triangle, out):
    """Write the closest points and the normal to `out`; return the distance, 0 where they overlap."""
    u, v, w = basis(axis)
    a = to_frame(centre, u, v, w, triangle[0])
    b = to_frame(centre, u, v, w, triangle[1])
    c = to_frame(centre, u, v, w, triangle[2])
    return _write(centre, u, v, w, closest_on_triangle(a, b, c, radius, half_height), out)


@jit_making_arrays
def cylinder_cylinder_distance(first, second, out):
    """Write the closest points and the normal to `out`; return the distance, 0 where they overlap."""
    (centre_a, axis_a, half_height_a, radius_a), (centre_b, axis_b, half_height_b, radius_b) = first, second
    u, v, w = basis(axis_a)
    centre = to_frame(centre_a, u, v, w, centre_b)
    axis = to_axes(u, v, w, axis_b)
    return _write(
        centre_a, u, v, w, closest_on_cylinder(centre, axis, radius_b, half_height_b, radius_a, half_height_a), out
    )


@inner
def flat_length(x, y):
    """Return sqrt(x^2 + y^2). The C library's `hypot` takes several times as long, a quarter of all that contacts of cylinders take."""
    return sqrt(x * x + y * y)


@inner
def basis(axis):
    """Return three orthonormal vectors, the last along the unit vector `axis`; the others depend on nothing else."""
    x, y, z = axis[0], axis[1], axis[2]
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        scale = 1.0 / flat_length(y, z)
        u = (0.0, z * scale, -y * scale)
    elif abs(y) <= abs(z):
        scale = 1.0 / flat_length(x, z)
        u = (-z * scale, 0.0, x * scale)
    else:
        scale = 1.0 / flat_length(x, y)
        u = (y * scale, -x * scale, 0.0)
    w = (x, y, z)
    return u, cross(w, u), w


@inner
def to_frame(centre, u, v, w, point):
    """Return the coordinates of a point in the frame at `centre` with axes u, v, w."""
    return to_axes(u, v, w, subtract(point, centre))


@inner
def to_axes(u, v, w, q):
    """Return (q . u, q . v, q . w)."""
    return dot(q, u), dot(q, v), dot(q, w)


@inner
def from_axes(u, v, w, q):
    """Return q_0 u + q_1 v + q_2 w."""
    return along(along(along(ZERO, q[0], u), q[1], v), q[2], w)


@inner
def _write(centre, u, v, w, pair, out):
    distance, p, q, n = pair
    p, q, n = from_axes(u, v, w, p), from_axes(u, v, w, q), from_axes(u, v, w, n)
    for k in range(3):
        out[k] = centre[k] + p[k]
        out[3 + k] = centre[k] + q[k]
        out[6 + k] = n[k]
    return distance


# From here on in the frame of the cylinder. Results are (distance, point on the cylinder, other point, normal).


@inner
def closest_on_curve(q, tangent, radius, half):
    """Return the closest pair of the cylinder and a point q.

    If q is the closest point of a curve in whose interior it lies, with the given tangent (else 0), and the cylinder's
    rim is closest to it, the normal is perpendicular to both curves: where they cross, that is sharper than the
    difference of the points, whose error grows as 1 / distance.
    """
    x, y, z = q
    rho = flat_length(x, y)
    beside, beyond = rho - radius, abs(z) - half
    if beside <= 0.0 and beyond <= 0.0:
        return 0.0, q, q, ZERO
    end = copysign(1.0, z)
    out = (x / rho, y / rho, 0.0) if rho > 0.0 else (1.0, 0.0, 0.0)
    distance = flat_length(max(beside, 0.0), max(beyond, 0.0))
    p = (min(rho, radius) * out[0], min(rho, radius) * out[1], end * min(abs(z), half))
    if beside <= _ROUND_OFF * radius and beside < beyond:  # over the cap, or so close to it that the rest is rounding
        n = (0.0, 0.0, end)
    elif beyond <= _ROUND_OFF * half:
        n = out
    else:
        n = along((0.0, 0.0, end * beyond / distance), beside / distance, out)
    if beside > -_ROUND_OFF * radius and beyond > -_ROUND_OFF * half:
        across = cross(tangent, (-out[1], out[0], 0.0))
        size = sqrt(dot(across, across))
        if size * radius > distance * sqrt(dot(tangent, tangent)):
            across = along(ZERO, 1.0 / copysign(size, dot(across, n)), across)
            if dot(across, out) >= 0.0 and across[2] * end >= 0.0:
                n = across
    return distance, p, q, n


@inner
def slope_along(q, dq, ddq, radius, half):
    """Return the first two derivatives of d^2 / 2 at the point q of a curve with derivatives dq, ddq."""
    slope, curvature = 0.0, 0.0
    rho = flat_length(q[0], q[1])
    beside, beyond = rho - radius, abs(q[2]) - half
    if beside > 0.0:
        x, y = q[0] / rho, q[1] / rho
        outward, around = x * dq[0] + y * dq[1], x * dq[1] - y * dq[0]
        slope += beside * outward
        curvature += outward * outward + beside * (around * around / rho + x * ddq[0] + y * ddq[1])
    if beyond > 0.0:
        beyond = copysign(beyond, q[2])
        slope += beyond * dq[2]
        curvature += dq[2] * dq[2] + beyond * ddq[2]
    return slope, curvature


@inner
def closest_on_segment(a, d, radius, half):
    """Return t in [0, 1] so that a + t d is the closest point of a segment to the cylinder."""
    low, high = 0.0, 1.0
    slope_low, _ = slope_along(a, d, ZERO, radius, half)
    slope_high, _ = slope_along(along(a, 1.0, d), d, ZERO, radius, half)
    if slope_low >= 0.0:
        return low
    if slope_high <= 0.0:
        return high
    across = d[0] * d[0] + d[1] * d[1]
    nearest = -(a[0] * d[0] + a[1] * d[1]) / across if across > 0.0 else inf
    miss = (a[0] * d[1] - a[1] * d[0]) / sqrt(across) if across > 0.0 else inf
    chord = sqrt((radius - miss) * (radius + miss) / across) if abs(miss) < radius else inf
    for t in (nearest, nearest - chord, nearest + chord, (half - a[2]) / d[2], (-half - a[2]) / d[2]):
        if low < t < high:
            slope, _ = slope_along(along(a, t, d), d, ZERO, radius, half)
            if slope == 0.0:
                return t
            if slope < 0.0:
                low, slope_low = t, slope
            else:
                high, slope_high = t, slope
    # In what is left the squared distance is smooth and convex.
    t = low + (high - low) * slope_low / (slope_low - slope_high)
    for _ in range(_MAX_NEWTON):
        slope, curvature = slope_along(along(a, t, d), d, ZERO, radius, half)
        if slope < 0.0:
            low = t
        else:
            high = t
        following = t - slope / curvature
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - t) <= _EPSILON:
            break
        t = following
    return t


@inner
def closest_on_triangle(a, b, c, radius, half):
    """Return the closest pair of the cylinder and a triangle, which may be a segment or a point."""
    best = _closest_on_face(a, b, c, radius, half)
    if best[0] < inf:
        return best
    n, bound = ZERO, -inf
    u = c
    for v in (a, b, c):
        d = subtract(v, u)
        t = closest_on_segment(u, d, radius, half)
        pair = closest_on_curve(along(u, t, d), d if 0.0 < t < 1.0 else ZERO, radius, half)
        if pair[0] < best[0]:
            best = pair
        # n . p over the triangle less that over the cylinder is a lower bound: the side with the best one gives the normal.
        reach = min(dot(pair[3], a), dot(pair[3], b), dot(pair[3], c)) - cylinder_support(AXIS, half, radius, pair[3])
        if reach > bound:
            n, bound = pair[3], reach
        u = v
    return best[0], best[1], best[2], n


@inner
def _closest_on_face(a, b, c, radius, half):
    """Return the closest pair if the triangle's interior takes part in it; otherwise the distance is inf."""
    ab, ac = subtract(b, a), subtract(c, a)
    m = cross(ab, ac)
    size = sqrt(dot(m, m))
    nowhere = (inf, ZERO, ZERO, ZERO)
    if size <= _THIN * (dot(ab, ab) + dot(ac, ac)):
        return nowhere
    m = (m[0] / size, m[1] / size, m[2] / size)
    height = dot(m, a)
    side = copysign(1.0, height)  # n points from the centre of the cylinder to the plane
    n, height = along(ZERO, side, m), abs(height)
    flat = flat_length(n[0], n[1])
    p = (radius, 0.0, copysign(half, n[2]))
    if flat > 0.0:
        p = (radius * n[0] / flat, radius * n[1] / flat, p[2])
    reach = dot(n, p)
    if reach >= height:  # the plane cuts the cylinder, also between its centre and p
        q = along(ZERO, height / reach, p)
        return (0.0, q, q, ZERO) if over_triangle(q, a, b, c, m, 0.0, 0.0, 0.0) else nowhere
    q = along(p, height - reach, n)
    return (height - reach, p, q, n) if over_triangle(q, a, b, c, m, 0.0, 0.0, 0.0) else nowhere


@inner
def closest_on_cylinder(centre, axis, radius_b, half_b, radius, half):
    """Return the closest pair of the cylinder and another one, given by centre, unit axis, radius and half height."""
    best = (inf, ZERO, ZERO, ZERO)
    n, bound = ZERO, -inf
    noise = _ROUND_OFF * (sqrt(dot(centre, centre)) + radius + half + radius_b + half_b)
    for part in range(9):  # the sides, the four rims, their four discs
        if part == 0:
            pair = closest_sides(centre, axis, radius_b, half_b, radius, half)
        else:
            pair = _closest_on_rim((part - 1) % 4, part > 4, centre, axis, radius_b, half_b, radius, half)
        if pair[0] < best[0]:
            best = pair
        reach = cylinder_support(AXIS, half, radius, pair[3]) + cylinder_support(axis, half_b, radius_b, pair[3])
        if dot(pair[3], centre) - reach > bound:
            n, bound = pair[3], dot(pair[3], centre) - reach
        if best[0] <= max(bound + noise, 0.0):
            break
    return (best[0] if bound > 0.0 else 0.0), best[1], best[2], n


@inner
def closest_sides(centre, axis, radius_b, half_b, radius, half):
    """Return the closest pair of the two sides if the axes' common perpendicular meets both; else distance inf."""
    turn = flat_length(axis[0], axis[1])
    if turn > _PARALLEL:
        c = (-axis[1] / turn, axis[0] / turn, 0.0)
        s = dot(cross(centre, axis), c) / turn
        t = (centre[1] * c[0] - centre[0] * c[1]) / turn
        if abs(s) <= half and abs(t) <= half_b:
            other = along(centre, t, axis)
            foot = (0.0, 0.0, other[2])
            length = flat_length(other[0], other[1])
            if length <= radius + radius_b:
                share = radius / (radius + radius_b)
                common = (share * other[0], share * other[1], other[2])
                return 0.0, common, common, ZERO
            n = (other[0] / length, other[1] / length, 0.0)
            return length - radius - radius_b, along(foot, radius, n), along(other, -radius_b, n), n
    return inf, ZERO, ZERO, ZERO


@inner
def _closest_on_rim(rim, thorough, centre, axis, radius_b, half_b, radius, half):
    """Return the closest pair of one of four rims (0 and 2 of B, 1 and 3 of A, near ones first) and the other solid.

    If `thorough`, between the whole disc within the rim and the other solid.
    """
    u, v, w = basis(axis)
    if rim % 2 == 0:
        away = copysign(half_b, dot(centre, axis)) * (1.0 if rim else -1.0)
        return _closest_on_circle(along(centre, away, axis), u, v, radius_b, thorough, radius, half)
    away = copysign(half, centre[2]) * (-1.0 if rim == 3 else 1.0)
    middle = to_frame(centre, u, v, w, (0.0, 0.0, away))
    x, y = (u[0], v[0], w[0]), (u[1], v[1], w[1])
    distance, q, p, n = _closest_on_circle(middle, x, y, radius, thorough, radius_b, half_b)
    p, q, n = from_axes(u, v, w, p), from_axes(u, v, w, q), from_axes(u, v, w, n)
    return distance, along(centre, 1.0, p), along(centre, 1.0, q), along(ZERO, -1.0, n)


@inner
def _closest_on_circle(centre, u, v, rim_radius, thorough, radius, half):
    """Return the closest pair of the cylinder and a circle (or the disc in it) about `centre`, across u and v."""
    if thorough:
        angle, q, inner = _closest_on_disc(centre, u, v, rim_radius, radius, half)
        if inner:
            pair = closest_on_curve(q, ZERO, radius, half)
            n = cross(u, v)
            return (
                (pair[0], pair[1], pair[2], along(ZERO, copysign(1.0, dot(n, pair[3])), n)) if pair[0] > 0.0 else pair
            )
    else:
        angle, least = 0.0, inf
        # The distance along a circle has several minima: Newton's method starts at the best sample.
        for k in range(_NUM_SAMPLES):
            q = on_circle(centre, u, v, rim_radius, 2.0 * pi / _NUM_SAMPLES * k)
            pair = closest_on_curve(q, ZERO, radius, half)
            if pair[0] < least:
                angle, least = 2.0 * pi / _NUM_SAMPLES * k, pair[0]
    angle = _refine_on_circle(centre, u, v, rim_radius, angle, radius, half)
    tangent = on_circle(ZERO, u, v, 1.0, angle + 0.5 * pi)
    return closest_on_curve(on_circle(centre, u, v, rim_radius, angle), tangent, radius, half)


@inner
def on_circle(centre, u, v, rim_radius, angle):
    """Return centre + rim_radius (cos(angle) u + sin(angle) v)."""
    return along(along(centre, rim_radius * cos(angle), u), rim_radius * sin(angle), v)


@inner
def _refine_on_circle(centre, u, v, rim_radius, angle, radius, half):
    """Return the angle of a least distance near `angle`: Newton's method downhill, in a bracket once there is one."""
    low, high = -inf, inf
    for _ in range(_MAX_NEWTON):
        out = on_circle(ZERO, u, v, rim_radius, angle)
        tangent = on_circle(ZERO, u, v, rim_radius, angle + 0.5 * pi)
        q = along(centre, 1.0, out)
        slope, curvature = slope_along(q, tangent, along(ZERO, -1.0, out), radius, half)
        step = pi / _NUM_SAMPLES
        # Downhill where the distance is not convex.
        step = min(step, max(-step, -slope / curvature)) if curvature > 0.0 else -copysign(step, slope)
        if abs(step) <= 4.0 * _EPSILON or slope == 0.0:
            break
        if slope < 0.0:
            low = angle
        else:
            high = angle
        angle = angle + step if low < angle + step < high else 0.5 * (low + high)
    return angle


@inner
def _closest_on_disc(centre, u, v, rim_radius, radius, half):
    """Return (angle, point, inner) of the disc's point closest to the cylinder; `inner` if it is not on the rim.

    Over the chords of the disc the least squared distance is convex; the slope at its closest point tells where to go.
    """
    low, high = -0.5 * pi, 0.5 * pi
    angle, q, inner = 0.0, centre, True
    for _ in range(_MAX_HALVINGS):
        middle = 0.5 * (low + high)
        width = rim_radius * cos(middle)
        start = along(along(centre, rim_radius * sin(middle), u), -width, v)
        chord = along(ZERO, 2.0 * width, v)
        t = closest_on_segment(start, chord, radius, half)
        q = along(start, t, chord)
        inner = 0.0 < t < 1.0
        slope, _ = slope_along(q, u, ZERO, radius, half)
        # At the rim the chord's end moves with the angle, so the slope along the chord counts, too.
        if not inner:
            angle = 0.5 * pi - middle if t > 0.5 else middle - 0.5 * pi
            slope_chord, _ = slope_along(q, v, ZERO, radius, half)
            slope = slope * cos(middle) - (1.0 if t > 0.5 else -1.0) * slope_chord * sin(middle)
        if slope == 0.0:
            break
        if slope < 0.0:
            low = middle
        else:
            high = middle
    return angle, q, inner
