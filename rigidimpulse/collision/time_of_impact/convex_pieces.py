"""Safe time of two convex pieces: simplices (points, segments, triangles) and cylinders, grown by the threshold.

Several directions n are tried and the best counts: the normal of either face, carried by its body; the direction of
the closest features, or of a face or an edge where it separates nothing, carried by either body; and, for crossing edges, n turning
with both of them. For a carried n
every corner has its own offset and speed (`separating_quadratic`): one offset with the largest speed would stall a body that
rolls or slides.

n turning with both edges e_a (at rest in A) and e_b, seen from A: n stays across both to first order if n' = m,

    m = f (n x e_a),   f = -n.(w x e_b) / ((n x e_a).e_b),     n(s) = n cos(nu s) + (m / nu) sin(nu s),   nu = |m|

and for D the vector from a corner of A to one of B, f_ij = n.D:   f' = m.D + n.y',   f'' = -nu^2 n.D + 2 m.y' + n.y'',
|f'''| <= J + 3 nu |y''| + 3 nu^2 |y'| + nu^3 |D|, the lengths bounded over [0, h]. A cylinder whose side touches takes part as its axis, an
edge grown by its radius: no point of it is outside of that.

Records lie in the arrays `work` and `index` of a `PairScratch`.
"""

from __future__ import annotations

from math import inf

from rigidimpulse.collision.distance.cylinder import cylinder_cylinder_distance, cylinder_support, cylinder_triangle_distance
from rigidimpulse.collision.time_of_impact.closest_direction import NO_EDGES, closest_simplices, farthest
from rigidimpulse.collision.time_of_impact.motion_bound import SEEN_ARM_JERK, SEEN_JERK, SEEN_SIZE, SEEN_SPIN, put, seen_motion, vector
from rigidimpulse.collision.time_of_impact.scratch_layout import (
    CARRIER,
    CLOSEST,
    CORNER,
    COUNT,
    CYLINDER,
    CYLINDER_AXIS,
    CYLINDER_HEIGHT,
    CYLINDER_RADIUS,
    CYLINDER_SIZE,
    DIRECTION,
    FACE,
    FIRST,
    GAP,
    LIMIT,
    LIMIT_VIEW,
    NORMAL,
    ORIGIN,
    OTHER_VIEW,
    POINT_FIRST,
    POINT_SECOND,
    SECOND,
    SEEN,
    THINNED,
)
from rigidimpulse.collision.time_of_impact.separating_quadratic import cylinder_safe_until, safe_until, viewed_safe_until, write_view
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, length, scaled, subtract

_ON_SIDE = TOLERANCES.time_of_impact.on_cylinder_side
_TURN = 0.5  # rad, angle that a direction turns at most: beyond it the third derivatives take over


@jit
def _cylinder_record(work, side):
    """Return centre, axis, half height and radius of the cylinder of the first (0) or second (1) piece."""
    at = CYLINDER + CYLINDER_SIZE * side
    return vector(work, at), vector(work, at + CYLINDER_AXIS), work[at + CYLINDER_HEIGHT], work[at + CYLINDER_RADIUS]


@jit
def _cylinder_top(work, side, normal):
    """Return the greatest normal . p over the cylinder of one side."""
    centre, axis, half_height, radius = _cylinder_record(work, side)
    return dot(normal, centre) + cylinder_support(axis, half_height, radius, normal)


@jit
def _top(scratch, side, normal):
    """Return the greatest normal . p over the first (0) or second (1) piece."""
    if scratch.index[COUNT + side] == 0:
        return _cylinder_top(scratch.work, side, normal)
    return farthest(scratch.work, CORNER + 9 * side, scratch.index[COUNT + side], normal)


@jit
def _cylinder_carried(work, side, normal, level, horizon):
    """As `_carried`, for a cylinder."""
    other = 1 - side
    seen, origin = SEEN + SEEN_SIZE * side, vector(work, ORIGIN + 3 * other)
    centre, axis, half_height, radius = _cylinder_record(work, other)
    gap = dot(normal, centre) - cylinder_support(axis, half_height, radius, normal) - level
    cylinder = (subtract(centre, origin), axis, half_height, radius)
    return cylinder_safe_until(work, seen, normal, cylinder, gap, horizon)


@jit
def _carried(scratch, side, normal, view, level, horizon):
    """Safe time of the other piece above a level along a normal, with its view, that the body of one side carries."""
    work, index, other = scratch.work, scratch.index, 1 - side
    seen, origin = SEEN + SEEN_SIZE * side, vector(work, ORIGIN + 3 * other)
    if index[COUNT + other] == 0:
        return _cylinder_carried(work, side, normal, level, horizon)
    for k in range(index[COUNT + other]):
        point = vector(work, CORNER + 9 * other + 3 * k)
        gap = dot(normal, point) - level
        arm = subtract(point, origin)
        horizon = viewed_safe_until(work, seen, view, 1.0, (arm, length(arm), 0.0), gap, horizon)
    return horizon


@jit
def _with_edges(work, index, edges, normal, threshold, horizon):
    """Safe time of two simplices along n turning with both crossing edges."""
    k, j = edges // 3, edges % 3
    num_first, num_second = index[COUNT], index[COUNT + 1]
    edge_first = subtract(vector(work, CORNER + 3 * ((k + 1) % num_first)), vector(work, CORNER + 3 * k))
    edge_second = subtract(vector(work, CORNER + 9 + 3 * ((j + 1) % num_second)), vector(work, CORNER + 9 + 3 * j))
    m = cross(normal, edge_first)
    # m = f (n x e_a): see the head of the file; parallel edges have none.
    wanted, available = -dot(normal, cross(vector(work, SEEN + SEEN_SPIN), edge_second)), dot(m, edge_second)
    if available == 0.0:
        return 0.0
    m = scaled(m, wanted / available)
    nu = length(m)
    if nu * horizon > _TURN:
        horizon = _TURN / nu
    for j in range(num_second):
        point = vector(work, CORNER + 9 + 3 * j)
        arm = subtract(point, vector(work, ORIGIN + 3))
        velocity, acceleration = seen_motion(work, SEEN, arm)
        jerk = work[SEEN + SEEN_JERK] + work[SEEN + SEEN_ARM_JERK] * length(arm)
        # Bounds of |y''|, |y'| and |D| over the horizon.
        bend_bound = length(acceleration) + horizon * jerk
        speed_bound = length(velocity) + horizon * bend_bound
        for k in range(num_first):
            between = subtract(point, vector(work, CORNER + 3 * k))
            reach = length(between) + horizon * speed_bound
            # |f'''| <= J + 3 nu |y''| + 3 nu^2 |y'| + nu^3 |D|.
            rest = jerk + nu * (3.0 * bend_bound + nu * (3.0 * speed_bound + nu * reach))
            gap = dot(normal, between)
            closing = -dot(m, between) - dot(normal, velocity)
            bend = nu * nu * gap - 2.0 * dot(m, velocity) - dot(normal, acceleration) + rest * horizon / 3.0
            horizon = safe_until(gap - threshold, closing, bend, horizon)
    return horizon


@jit
def _with_thinned(work, index, normal, threshold, horizon):
    """Safe time of the two pieces along n turning with crossing edges, the sides of cylinders among them; 0 if none cross."""
    is_side = True
    for side in range(2):
        if index[COUNT + side] == 0:
            centre, axis, half_height, radius = _cylinder_record(work, side)
            is_side = is_side and abs(dot(normal, axis)) < _ON_SIDE
            put(work, CORNER + 9 * side, along(centre, -half_height, axis))
            put(work, CORNER + 9 * side + 3, along(centre, half_height, axis))
            # A cylinder touched at its side takes part as its axis, an edge grown by its radius.
            threshold += radius
    if not is_side:
        return 0.0
    first, second = index[COUNT], index[COUNT + 1]
    index[COUNT], index[COUNT + 1] = first if first else 2, second if second else 2
    _, edges = closest_simplices(work, index, THINNED)
    s = 0.0
    if edges >= 0:
        s = _with_edges(work, index, edges, vector(work, THINNED + NORMAL), threshold, horizon)
    # The pieces are as they were.
    index[COUNT], index[COUNT + 1] = first, second
    return s


@jit_making_arrays
def _closest_to_cylinder(scratch):
    """As `_closest`, where the second piece is a cylinder."""
    work, index = scratch.work, scratch.index
    centre, axis, half_height, radius = _cylinder_record(work, SECOND)
    points = work[CLOSEST : CLOSEST + GAP]
    if index[COUNT] == 0:
        cylinder_cylinder_distance((centre, axis, half_height, radius), _cylinder_record(work, FIRST), points)
    else:
        corners = work[CORNER : CORNER + 9].reshape((3, 3))
        cylinder_triangle_distance(centre, axis, half_height, radius, corners, points)
    # The kernels give the cylinder first; here it is the second piece.
    on_cylinder, normal = vector(work, CLOSEST), scaled(vector(work, CLOSEST + NORMAL), -1.0)
    put(work, CLOSEST + POINT_FIRST, vector(work, CLOSEST + POINT_SECOND))
    put(work, CLOSEST + POINT_SECOND, on_cylinder)
    put(work, CLOSEST + NORMAL, normal)
    top = _top(scratch, FIRST, normal)
    return -_top(scratch, SECOND, scaled(normal, -1.0)) - top, NO_EDGES


@jit
def _closest(scratch):
    """Write the closest points and the normal of the two pieces at CLOSEST; return (separation, crossing edges)."""
    if scratch.index[COUNT + 1] == 0:
        return _closest_to_cylinder(scratch)
    return closest_simplices(scratch.work, scratch.index, CLOSEST)


@jit
def _face_direction(work, index, side):
    """Return the normal of a face, turned from the first piece to the second."""
    normal = vector(work, FACE + 3 * side)
    other = vector(work, CORNER + 9) if index[COUNT + 1] > 0 else vector(work, CYLINDER + CYLINDER_SIZE)
    return normal if dot(normal, subtract(other, vector(work, CORNER))) > 0.0 else scaled(normal, -1.0)


@jit
def _separation(work, index, side, outward):
    """Separation of two simplices along a unit direction that points out of the piece of one side."""
    other = 1 - side
    nearest = -farthest(work, CORNER + 9 * other, index[COUNT + other], scaled(outward, -1.0))
    return nearest - farthest(work, CORNER + 9 * side, index[COUNT + side], outward)


@jit
def _surface_direction(work, index):
    """The direction of largest separation among the normals of both faces and those across their edges in their planes.

    The difference of two points at the distance g is off by round-off / g, and may separate nothing. Where faces lie in one plane, as those
    of bodies in a row do, only an edge tells the direction. Returns (separation, direction from the first piece to the second).
    """
    best, direction = -inf, (0.0, 0.0, 0.0)
    for side in range(2):
        if index[COUNT + side] < 3:
            continue
        face, sign = vector(work, FACE + 3 * side), 1.0 - 2.0 * side
        for k in range(5):
            outward = scaled(face, 1.0 if k == 3 else -1.0)
            if k < 3:
                corner, following = CORNER + 9 * side + 3 * k, CORNER + 9 * side + 3 * ((k + 1) % 3)
                outward = cross(subtract(vector(work, following), vector(work, corner)), face)
            size = length(outward)
            if size == 0.0:
                continue
            outward = scaled(outward, 1.0 / size)
            separation = _separation(work, index, side, outward)
            if separation > best:
                best, direction = separation, scaled(outward, sign)
    return best, direction


@jit
def pieces_safe_until(scratch, threshold, horizon):
    """Safe time of the two convex pieces at COUNT and CORNER, FACE or CYLINDER.

    Of a simplex and a cylinder the cylinder is the second. If the result is short of the horizon, the record at CLOSEST
    tells what limits it. Of the record at LIMIT the direction is tried first (zeros if there is none).

    Args:
        scratch: `PairScratch`.
        threshold: m, radii of the pieces included.
        horizon: s.

    Returns:
        (s, the side that carries the best direction: 0 first, 1 second).

    """
    work, index = scratch.work, scratch.index
    best, carrier, separation = 0.0, 0, 0.0
    edges = NO_EDGES
    normal = direction = vector(work, LIMIT + DIRECTION)
    # The limit so far, the faces of first and second, and the closest features carried by first and second.
    for trial in range(5):
        side = index[CARRIER] if trial == 0 else (trial - 1) % 2
        if trial == 0 and dot(normal, normal) == 0.0:
            continue
        if trial == 1 or trial == 2:
            if index[COUNT + side] < 3:
                continue
            normal = _face_direction(work, index, side)
        elif trial == 3:
            separation, edges = _closest(scratch)
            normal = vector(work, CLOSEST + NORMAL)
            if separation <= threshold and index[COUNT] > 0 and index[COUNT + 1] > 0:
                surface, direction_of_surface = _surface_direction(work, index)
                if separation <= 0.0 or surface > threshold:
                    separation, normal, edges = surface, direction_of_surface, NO_EDGES
                    put(work, CLOSEST + NORMAL, normal)
            if separation <= 0.0:
                break
        outward = normal if side == 0 else scaled(normal, -1.0)
        level = _top(scratch, side, outward) + threshold
        if trial < 3 and -_top(scratch, 1 - side, scaled(outward, -1.0)) <= level:
            continue
        if trial > 0:
            write_view(work, SEEN + SEEN_SIZE * side, outward, OTHER_VIEW)
        view = OTHER_VIEW if trial > 0 else LIMIT_VIEW
        s = _carried(scratch, side, outward, view, level, horizon)
        if s >= horizon:
            return horizon, side
        if s > best or (trial == 3 and best == 0.0):
            best, carrier, direction = s, side, normal
    if separation <= 0.0:
        best = 0.0
        put(work, CLOSEST + NORMAL, (0.0, 0.0, 0.0))
    elif edges >= 0:
        best = max(best, _with_edges(work, index, edges, normal, threshold, horizon))
    elif index[COUNT + 1] == 0:
        best = max(best, _with_thinned(work, index, normal, threshold, horizon))
    work[CLOSEST + GAP] = separation
    put(work, CLOSEST + DIRECTION, direction)
    return best, carrier
