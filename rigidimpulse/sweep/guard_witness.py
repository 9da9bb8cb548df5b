"""The witness of a safe time: the pair of features that limits it, and its gap at any pose.

A witness is (primitive of a, element of a, primitive of b, element of b): the element is a triangle against a ROUND primitive or a
cylinder, a vertex against a half space, and not read for half spaces and cylinders. Its gap costs no walk through trees, so the time at
which it reaches a value is found cheaply; the guard then says whether anything else was earlier.
"""

from __future__ import annotations

from rigidimpulse._jit import jit
from rigidimpulse.detect.cylinder import cylinder_cylinder_distance, cylinder_support, cylinder_triangle_distance
from rigidimpulse.detect.features import along, dot, moved, relative_pose, row, subtract, turned
from rigidimpulse.geometry import CYLINDER, HALF_SPACE, ROUND
from rigidimpulse.integrate.course import pose_at
from rigidimpulse.rotation import quaternion_to_matrix
from rigidimpulse.sweep.bound import POSITION, SPIN, VELOCITY, length, vector
from rigidimpulse.sweep.guard_closest import closest_simplices, highest, load_corners, load_turned_corners

WITNESS_POINT_A, WITNESS_POINT_B, WITNESS_NORMAL, WITNESS_GAP = 0, 3, 6, 9
WITNESS_SIZE = 10
"""Offsets into the row of a witness, world frame: points on a and b, unit normal from a to b (zeros if unknown), gap."""

_NOTHING = (0.0, 0.0, 0.0)


@jit
def _half_space_gap(geometry, scratch, half_space, other, vertex):
    """Gap of a half space to a vertex or to a cylinder: (gap, normal, first point, second point), frame of the first."""
    frame, radius = geometry.frame[half_space], geometry.radius[other]
    normal = vector(frame, 0)
    if geometry.kind[other] == ROUND:
        point = along(moved(scratch.rotation, scratch.offset, row(geometry.vertex, vertex)), -radius, normal)
    else:
        axis = turned(scratch.rotation, vector(geometry.frame[other], 3))
        point = moved(scratch.rotation, scratch.offset, vector(geometry.frame[other], 0))
        cosine = dot(normal, axis)
        point = along(point, -geometry.frame[other][6] if cosine > 0.0 else geometry.frame[other][6], axis)
        across = along(normal, -cosine, axis)
        size = length(across)
        if size > 0.0:
            point = along(point, -radius / size, across)
    gap = dot(normal, point) - frame[3]
    return gap, normal, along(point, -gap, normal), point


@jit
def _round_gap(geometry, scratch, first, triangle_first, second, triangle_second):
    """Gap of two grown simplices, as `_half_space_gap`."""
    num_first = load_corners(geometry, triangle_first, scratch.corners_first)
    num_second = load_turned_corners(geometry, triangle_second, scratch.rotation, scratch.offset, scratch.corners_second)
    normal_first = row(geometry.triangle_normal, triangle_first)
    normal_second = turned(scratch.rotation, row(geometry.triangle_normal, triangle_second))
    separation, _ = closest_simplices(
        scratch.corners_first, num_first, normal_first, scratch.corners_second, num_second, normal_second, scratch.closest
    )
    normal = vector(scratch.closest, 0)
    on_first = along(vector(scratch.closest, 3), geometry.radius[first], normal)
    on_second = along(vector(scratch.closest, 6), -geometry.radius[second], normal)
    return separation - geometry.radius[first] - geometry.radius[second], normal, on_first, on_second


@jit
def _cylinder_gap(geometry, scratch, first, triangle, second):
    """Gap of a grown simplex or a cylinder to a cylinder, as `_half_space_gap`."""
    frame, radius, closest = geometry.frame[second], geometry.radius[second], scratch.closest
    centre, axis = moved(scratch.rotation, scratch.offset, vector(frame, 0)), turned(scratch.rotation, vector(frame, 3))
    if geometry.kind[first] == CYLINDER:
        other, radius_first = geometry.frame[first], geometry.radius[first]
        centre_first, axis_first = vector(other, 0), vector(other, 3)
        if cylinder_cylinder_distance(centre_first, axis_first, other[6], radius_first, centre, axis, frame[6], radius, closest) <= 0.0:
            return 0.0, _NOTHING, _NOTHING, _NOTHING
        normal = vector(closest, 6)
        separation = dot(normal, subtract(centre, centre_first)) - cylinder_support(axis_first, other[6], radius_first, normal)
        return separation - cylinder_support(axis, frame[6], radius, normal), normal, vector(closest, 0), vector(closest, 3)
    num_corners = load_corners(geometry, triangle, scratch.corners_first)
    grown = geometry.radius[first]
    if cylinder_triangle_distance(centre, axis, frame[6], radius, scratch.corners_first, closest) <= 0.0:
        return -grown, _NOTHING, _NOTHING, _NOTHING
    normal = along(_NOTHING, -1.0, vector(closest, 6))
    separation = dot(normal, centre) - cylinder_support(axis, frame[6], radius, normal)
    separation -= highest(scratch.corners_first, num_corners, normal) + grown
    return separation, normal, along(vector(closest, 3), grown, normal), vector(closest, 0)


@jit
def _write(witness, first, position, axes, normal, on_first, on_second, swapped):
    """Write points and normal, given in the frame of body `first` (0: a, 1: b), to the witness row."""
    on_first = moved(axes[first], position[first], on_first)
    on_second = moved(axes[first], position[first], on_second)
    normal = turned(axes[first], normal)
    for k in range(3):
        witness[WITNESS_POINT_A + k] = on_second[k] if swapped else on_first[k]
        witness[WITNESS_POINT_B + k] = on_first[k] if swapped else on_second[k]
        witness[WITNESS_NORMAL + k] = -normal[k] if swapped else normal[k]


@jit
def witness_gap(geometry, scratch, feature):
    """Find the gap of the features at the poses in scratch.position and scratch.axes; writes scratch.witness, returns the gap."""
    p, q = feature[0], feature[2]
    swapped = geometry.kind[q] < geometry.kind[p]
    first, second = (q, p) if swapped else (p, q)
    element_first, element_second = (feature[3], feature[1]) if swapped else (feature[1], feature[3])
    viewer = int(swapped)
    axes, position = scratch.axes, scratch.position
    relative_pose(axes[viewer], position[viewer], axes[1 - viewer], position[1 - viewer], scratch.rotation, scratch.offset)
    if geometry.kind[first] == HALF_SPACE:
        gap, normal, on_first, on_second = _half_space_gap(geometry, scratch, first, second, element_second)
    elif geometry.kind[second] == CYLINDER:
        gap, normal, on_first, on_second = _cylinder_gap(geometry, scratch, first, element_first, second)
    else:
        gap, normal, on_first, on_second = _round_gap(geometry, scratch, first, element_first, second, element_second)
    _write(scratch.witness, viewer, position, axes, normal, on_first, on_second, swapped)
    scratch.witness[WITNESS_GAP] = gap
    return gap


@jit
def pose_pair(course, scratch, shape_a, shape_b, a, b, t):
    """Write the poses of bodies a and b at time t to scratch; the axes of a ball stay those of the world."""
    for side in range(2):
        body, shape = (b, shape_b) if side else (a, shape_a)
        pose_at(course, body, t, scratch.position[side], scratch.orientation[side])
        if scratch.ball[shape]:
            for i in range(3):
                for j in range(3):
                    scratch.axes[side, i, j] = 1.0 if i == j else 0.0
        else:
            quaternion_to_matrix(scratch.orientation[side], scratch.axes[side])


@jit
def closing_speed(scratch):
    """Rate at which the points of scratch.witness approach along its normal, for the motions in scratch.motion (same time)."""
    normal = vector(scratch.witness, WITNESS_NORMAL)
    result = 0.0
    for side in range(2):
        motion = scratch.motion[side]
        point = vector(scratch.witness, WITNESS_POINT_B if side else WITNESS_POINT_A)
        arm = subtract(point, vector(motion, POSITION))
        spin = vector(motion, SPIN)
        turning = (spin[1] * arm[2] - spin[2] * arm[1], spin[2] * arm[0] - spin[0] * arm[2], spin[0] * arm[1] - spin[1] * arm[0])
        speed = dot(normal, along(vector(motion, VELOCITY), 1.0, turning))
        result += -speed if side else speed
    return result
