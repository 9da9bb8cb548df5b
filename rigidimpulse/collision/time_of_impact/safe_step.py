"""How long two moving shapes stay apart for certain: one safe step, whatever the shapes.

`safe_time` looks at two bodies at one instant and returns a span over which their gap stays above a threshold. It
holds for exactly the motion that `motion_bound` describes, turning and accelerating bodies included, so stepping by safe
spans never passes a contact (conservative advancement, Mirtich 1996; Zhang, Lee and Kim 2006, here with exact first
and second derivatives and bounded third ones).

Primitives are walked through by `bvh_walk`, their convex pieces are bounded by `convex_pieces`. The body of the
first primitive carries the frame: a half space before a ROUND primitive before a cylinder. Bodies that start at or
below the threshold but leave it are let go: until they come back, the gap is not below the present one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.cylinder import basis
from rigidimpulse.collision.geometry import CYLINDER as CYLINDER_KIND
from rigidimpulse.collision.geometry import HALF_SPACE, ROUND, Geometry
from rigidimpulse.collision.time_of_impact.bvh_walk import NO_NODE, half_space_safe_until, trees_safe_until
from rigidimpulse.collision.time_of_impact.convex_pieces import pieces_safe_until
from rigidimpulse.collision.time_of_impact.motion_bound import (
    AXES,
    MOTION_SIZE,
    POSITION,
    SEEN_SIZE,
    put,
    relative_motion,
    turned,
    turned_back,
    vector,
)
from rigidimpulse.collision.time_of_impact.scratch_layout import (
    CARRIER,
    CLOSEST,
    COUNT,
    CYLINDER,
    CYLINDER_AXES,
    CYLINDER_AXIS,
    CYLINDER_HEIGHT,
    CYLINDER_RADIUS,
    CYLINDER_SIZE,
    DIRECTION,
    ELEMENT_A,
    ELEMENT_B,
    FIRST,
    GAP,
    INDEX_SIZE,
    LIMIT,
    LIMIT_SIZE,
    MOTION,
    NORMAL,
    ORIGIN,
    POINT_FIRST,
    POINT_SECOND,
    PRIMITIVE_A,
    PRIMITIVE_B,
    ROTATION,
    SECOND,
    SEEN,
    TOWARDS,
    WITNESS,
    WORK_SIZE,
)
from rigidimpulse.collision.time_of_impact.separating_quadratic import cylinder_safe_until, point_safe_until
from rigidimpulse.collision.time_of_impact.witness import support_point
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import along, dot, length, row, scaled, subtract


class SweepScratch(NamedTuple):
    """Constants per shape, and the arrays that the kernels of a sweep write into; made by `make_scratch`."""

    reach: np.ndarray  # (s,) m, radius of the shape about its body's centre of mass; inf with a half space
    ball: np.ndarray  # (s,) bool: one sphere about the centre of mass, on which no rotation can be seen
    plane: np.ndarray  # (s,) the half space that is all of the shape, or -1
    work: np.ndarray  # (WORK_SIZE,) and
    index: np.ndarray  # (INDEX_SIZE,) int64, see `scratch_layout`


def make_scratch(geometry: Geometry) -> SweepScratch:
    """Make the scratch arrays of the sweeps through bodies with these shapes."""
    num_shapes = len(geometry.shape_first) - 1
    reach, ball, plane = np.zeros(num_shapes), np.zeros(num_shapes, np.bool_), np.full(num_shapes, -1, np.int64)
    for shape in range(num_shapes):
        first, last = geometry.shape_first[shape], geometry.shape_first[shape + 1]
        reaches = np.linalg.norm(geometry.bound_centre[first:last], axis=1) + geometry.bound_radius[first:last]
        reach[shape] = reaches.max(initial=0.0)
        if last - first == 1 and geometry.kind[first] == HALF_SPACE:
            plane[shape] = first
        if last - first == 1 and geometry.kind[first] == ROUND:
            vertices = geometry.vertex[geometry.vertex_first[first] : geometry.vertex_first[first + 1]]
            # A ball about the centre of mass: its rotation moves nothing.
            ball[shape] = len(vertices) == 1 and not vertices.any()
            if ball[shape]:
                reach[shape] = geometry.radius[first]
    return SweepScratch(reach, ball, plane, np.zeros(WORK_SIZE), np.zeros(INDEX_SIZE, np.int64))


@jit
def _look_from(work, first, second, horizon):
    """Write pose and motion of the second motion record as seen from the first, and the reverse."""
    between = subtract(vector(work, second + POSITION), vector(work, first + POSITION))
    put(work, ORIGIN + 3, turned_back(work, first + AXES, between))
    for k in range(3):
        column = (work[second + AXES + k], work[second + AXES + 3 + k], work[second + AXES + 6 + k])
        column = turned_back(work, first + AXES, column)
        work[ROTATION + k], work[ROTATION + 3 + k], work[ROTATION + 6 + k] = column
    relative_motion(work, first, second, first, horizon, SEEN)
    relative_motion(work, second, first, first, horizon, SEEN + SEEN_SIZE)


@jit
def _place_cylinder(frame, radius, primitive, work, index, side):
    """Put a cylinder into the place of the first (0) or second (1) piece, in the frame of the first body."""
    centre, axis = row(frame, primitive), (frame[primitive, 3], frame[primitive, 4], frame[primitive, 5])
    if side:
        centre = along(turned(work, ROTATION, centre), 1.0, vector(work, ORIGIN + 3))
        axis = turned(work, ROTATION, axis)
        u, v, _ = basis(axis)
        put(work, CYLINDER_AXES, (u[0], v[0], axis[0]))
        put(work, CYLINDER_AXES + 3, (u[1], v[1], axis[1]))
        put(work, CYLINDER_AXES + 6, (u[2], v[2], axis[2]))
    at = CYLINDER + CYLINDER_SIZE * side
    put(work, at, centre)
    put(work, at + CYLINDER_AXIS, axis)
    work[at + CYLINDER_HEIGHT], work[at + CYLINDER_RADIUS] = frame[primitive, 6], radius[primitive]
    index[COUNT + side] = 0


@jit
def _bounds_safe_until(bound_centre, bound_radius, first, second, work, threshold, horizon):
    """Safe time of the bounding spheres of two primitives along the line between them; 0 where they overlap."""
    reach = bound_radius[first] + bound_radius[second] + threshold
    arm = turned(work, ROTATION, row(bound_centre, second))
    between = subtract(along(arm, 1.0, vector(work, ORIGIN + 3)), row(bound_centre, first))
    distance = length(between)
    # Without a gap the spheres say nothing.
    if distance <= reach:
        return 0.0
    return point_safe_until(work, SEEN, scaled(between, 1.0 / distance), arm, 0.0, distance - reach, horizon)


@jit
def _half_space_cylinder(geometry, second, work, index, normal, level, horizon):
    """Safe time of a cylinder of the second body above a level along a normal."""
    frame, radius = geometry.frame, geometry.radius
    _place_cylinder(frame, radius, second, work, index, SECOND)
    point = support_point(geometry, second, FIRST, turned_back(work, ROTATION, scaled(normal, -1.0)))
    point = along(turned(work, ROTATION, point), 1.0, vector(work, ORIGIN + 3))
    at = CYLINDER + CYLINDER_SIZE
    arm, axis = subtract(vector(work, at), vector(work, ORIGIN + 3)), vector(work, at + CYLINDER_AXIS)
    cylinder = (arm, axis, frame[second, 6], radius[second])
    return cylinder_safe_until(work, SEEN, normal, cylinder, dot(normal, point) - level, horizon)


@jit
def _half_space_pair(geometry, first, second, scratch, threshold, horizon):
    """Safe time of a half space and another primitive; the record at LIMIT gets direction and closest points."""
    radius, frame, work, index = geometry.radius, geometry.frame, scratch.work, scratch.index
    normal = row(frame, first)
    down = turned_back(work, ROTATION, scaled(normal, -1.0))
    level = frame[first, 3] + threshold
    s = horizon
    if geometry.kind[second] == ROUND:
        s = half_space_safe_until(geometry, geometry.node_first[second], normal, level + radius[second], scratch, horizon)
    else:
        s = _half_space_cylinder(geometry, second, work, index, normal, level, horizon)
    if s < horizon:
        index[CARRIER] = 0
        point = support_point(geometry, second, index[ELEMENT_B], down)
        point = along(turned(work, ROTATION, point), 1.0, vector(work, ORIGIN + 3))
        gap = dot(normal, point) - frame[first, 3]
        put(work, LIMIT + POINT_FIRST, along(point, -gap, normal))
        put(work, LIMIT + POINT_SECOND, point)
        put(work, LIMIT + NORMAL, normal)
        put(work, LIMIT + DIRECTION, normal)
        work[LIMIT + GAP] = gap
    return s


@jit
def _solid_pair(geometry, first, second, scratch, threshold, horizon):
    """Safe time of two primitives that are no half spaces; the record at LIMIT tells what limits it."""
    radius, kind, work, index = geometry.radius, geometry.kind, scratch.work, scratch.index
    grown_first, grown_second = radius[first], radius[second]
    root_first, root_second = geometry.node_first[first], geometry.node_first[second]
    if kind[second] == CYLINDER_KIND:
        grown_second, root_second = 0.0, NO_NODE
        _place_cylinder(geometry.frame, radius, second, work, index, SECOND)
    if kind[first] == CYLINDER_KIND:
        _place_cylinder(geometry.frame, radius, first, work, index, FIRST)
        put(work, LIMIT + DIRECTION, (0.0, 0.0, 0.0))
        s, carrier = pieces_safe_until(scratch, threshold, horizon)
        if s < horizon:
            index[CARRIER] = carrier
            for k in range(LIMIT_SIZE):
                work[LIMIT + k] = work[CLOSEST + k]
        return s
    # Skeletons are bounded; their radii are part of the threshold.
    threshold += grown_first + grown_second
    s = trees_safe_until(geometry, root_first, root_second, scratch, threshold, horizon)
    if s < horizon:
        normal = vector(work, LIMIT + NORMAL)
        # From the skeletons to the surfaces.
        work[LIMIT + GAP] -= grown_first + grown_second
        put(work, LIMIT + POINT_FIRST, along(vector(work, LIMIT + POINT_FIRST), grown_first, normal))
        put(work, LIMIT + POINT_SECOND, along(vector(work, LIMIT + POINT_SECOND), -grown_second, normal))
    return s


@jit
def _name_witness(work, index, p, q, swapped, first):
    """Bring what limits the safe time from first and second to a and b, points to the world; `first`: its motion."""
    sign = -1.0 if swapped else 1.0
    towards = scaled(vector(work, LIMIT + DIRECTION), sign)
    put(work, TOWARDS, turned_back(work, ROTATION, towards) if index[CARRIER] else towards)
    axes, centre = first + AXES, vector(work, first + POSITION)
    point_first = along(turned(work, axes, vector(work, LIMIT + POINT_FIRST)), 1.0, centre)
    point_second = along(turned(work, axes, vector(work, LIMIT + POINT_SECOND)), 1.0, centre)
    put(work, WITNESS + POINT_FIRST, point_second if swapped else point_first)
    put(work, WITNESS + POINT_SECOND, point_first if swapped else point_second)
    put(work, WITNESS + NORMAL, turned(work, axes, scaled(vector(work, LIMIT + NORMAL), sign)))
    work[WITNESS + GAP] = work[LIMIT + GAP]
    index[PRIMITIVE_A], index[PRIMITIVE_B] = p, q
    if swapped:
        element = index[ELEMENT_A]
        index[ELEMENT_A], index[ELEMENT_B], index[CARRIER] = index[ELEMENT_B], element, 1 - index[CARRIER]


@jit
def safe_time(geometry, shape_a, shape_b, scratch, threshold, horizon):
    """Find how long two shapes stay farther apart than a threshold.

    Two half spaces never limit each other.

    Args:
        geometry: the compiled shapes.
        shape_a: index of a's shape; likewise shape_b.
        scratch: `PairScratch`, with the motions of a and b (`motion_bound`) at MOTION, their bounds valid over the horizon.
        threshold: m.
        horizon: s.

    Returns:
        s <= horizon such that the gap is above the threshold on [0, s); where it starts at or below the threshold and
        grows, above its present value. If s is short of the horizon, TOWARDS, WITNESS and the first five of `index`
        tell what limits it: features whose present gap need not be the least one.

    """
    work, index, view = scratch.work, scratch.index, -1
    for p in range(geometry.shape_first[shape_a], geometry.shape_first[shape_a + 1]):
        for q in range(geometry.shape_first[shape_b], geometry.shape_first[shape_b + 1]):
            # A half space carries the frame before a ROUND primitive, that before a cylinder.
            swapped = geometry.kind[q] < geometry.kind[p]
            motion = MOTION + MOTION_SIZE if swapped else MOTION
            if view != motion:
                view = motion
                _look_from(work, motion, MOTION + MOTION + MOTION_SIZE - motion, horizon)
            first, second = q if swapped else p, p if swapped else q
            s = _bounds_safe_until(
                geometry.bound_centre, geometry.bound_radius, first, second, work, threshold, horizon
            )
            # The bounding spheres alone are apart for long enough.
            if s >= horizon or geometry.kind[second] == HALF_SPACE:
                continue
            if geometry.kind[first] == HALF_SPACE:
                s = _half_space_pair(geometry, first, second, scratch, threshold, horizon)
            else:
                s = _solid_pair(geometry, first, second, scratch, threshold, horizon)
            if s < horizon:
                horizon = s
                _name_witness(work, index, p, q, swapped, motion)
    return horizon
