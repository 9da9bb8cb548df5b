"""The witness of a safe time: the features that limit it and the direction along which they do.

The direction is carried by one of the bodies, so the gap along it at any other pose costs two support functions and
no search. It is a lower bound of the distance of the features, and equals it for a vertex over a face. The time at
which it reaches a value is found cheaply; the conservative bound then tells whether anything was earlier.
"""

from __future__ import annotations

from math import inf, log2

from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE
from rigidimpulse.collision.time_of_impact.motion_bound import MOTION_SIZE, POSITION, SPIN, VELOCITY, turned, turned_back, vector
from rigidimpulse.collision.time_of_impact.scratch_layout import (
    CARRIER,
    ELEMENT_A,
    ELEMENT_B,
    FRAME,
    MOTION,
    NORMAL,
    PLACE,
    PRIMITIVE_A,
    PRIMITIVE_B,
    TOWARDS,
    TURN,
    WITNESS,
)
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.core.vector import along, cross, dot, length, row, scaled, subtract
from rigidimpulse.motion.trajectory import pose_at

MOST_OF_IT = 0.5
"""Part of the length of a vector that must be across an axis: less of it is round-off."""
_EPSILON = 2.0**-52
_TRUNCATION = 0.2  # kappa_1 of the ITP method times the first bracket; kappa_2 = 2, n_0 = 1


@jit
def _beside(across, axis):
    """The direction of a vector across an axis; zero where all of it is round-off.

    An axis is a unit vector to round-off. Along a normal that is parallel to it, the vector is round-off, and lies along the axis: as
    a direction it put the point of a cylinder that stood upright a radius beyond its end.
    """
    size = length(across)
    if size == 0.0:
        return across
    unit = scaled(across, 1.0 / size)
    beside = along(unit, -dot(unit, axis), axis)
    size = length(beside)
    return scaled(beside, 1.0 / size if size > MOST_OF_IT else 0.0)


@jit
def support_point(geometry, primitive, element, normal):
    """Return the point of a primitive that is farthest along a unit normal; of a ROUND one, of its element.

    The element is a triangle, or -1 - vertex.
    """
    kind, radius, frame, vertex, triangle = geometry.kind, geometry.radius, geometry.frame, geometry.vertex, geometry.triangle
    if kind[primitive] == HALF_SPACE:
        return scaled(row(frame, primitive), frame[primitive, 3])
    if kind[primitive] == CYLINDER:
        axis = (frame[primitive, 3], frame[primitive, 4], frame[primitive, 5])
        cosine = dot(normal, axis)
        across = _beside(along(normal, -cosine, axis), axis)
        half_height = frame[primitive, 6]
        point = along(row(frame, primitive), half_height if cosine > 0.0 else -half_height, axis)
        return along(point, radius[primitive], across)
    best = -inf
    point = (0.0, 0.0, 0.0)
    for k in range(3 if element >= 0 else 1):
        corner = row(vertex, triangle[element, k] if element >= 0 else -1 - element)
        if dot(normal, corner) > best:
            best, point = dot(normal, corner), corner
    return along(point, radius[primitive], normal)


@jit
def _gap_along(geometry, work, index, direction):
    """Gap of the witness along its direction at the poses at PLACE and FRAME."""
    normal = turned(work, FRAME + 9 * index[CARRIER], direction)
    own_a, own_b = turned_back(work, FRAME, normal), turned_back(work, FRAME + 9, scaled(normal, -1.0))
    point_a = support_point(geometry, index[PRIMITIVE_A], index[ELEMENT_A], own_a)
    point_b = support_point(geometry, index[PRIMITIVE_B], index[ELEMENT_B], own_b)
    between = subtract(vector(work, PLACE + 3), vector(work, PLACE))
    return dot(normal, between) - dot(own_b, point_b) - dot(own_a, point_a)


@jit
def _next_trial(low, above, high, below, truncation, least, left):
    """Time at which the gap is looked at next; above > 0 at low, below < 0 at high, `left` evaluations are left."""
    middle = 0.5 * (low + high)
    radius = least * 2.0**left - 0.5 * (high - low)
    secant = (above * high - below * low) / (above - below)
    inward = 1.0 if middle > secant else -1.0
    shift = truncation * (high - low) * (high - low)
    t = secant + inward * shift if shift <= abs(middle - secant) else middle
    if abs(t - middle) > radius:
        t = middle - inward * radius
    return t if low < t < high else middle


@jit_making_arrays
def witness_root(geometry, trajectory, scratch, a, b, interval, impact_margin, tolerance):
    """Find where the witness of bodies a and b comes down to `impact_margin` in an interval of time.

    Bisection with interpolation (ITP: Oliveira and Takahashi 2020): at most log2((high - low) / rounding) + 1
    evaluations after those at the ends, mostly far fewer.

    Returns:
        (t, evaluations): the last time known to be above, where its gap is at most impact_margin + tolerance or t is one
        rounding from the root; inf if it is not above at low and below at high.

    """
    work, index, (low, high) = scratch.work, scratch.index, interval
    least = _EPSILON * max(abs(low), abs(high))
    budget = 1 + int(max(log2((high - low) / least), 0.0))
    truncation = _TRUNCATION / (high - low)
    direction = vector(work, TOWARDS)
    above, below = -1.0, 1.0
    for trial in range(budget + 2):
        t = low if trial == 0 else high
        if trial > 1:
            t = _next_trial(low, above, high, below, truncation, least, budget + 1 - trial)
        for side in range(2):
            place, turn, frame = PLACE + 3 * side, TURN + 4 * side, FRAME + 9 * side
            pose_at(trajectory, b if side else a, t, work[place : place + 3], work[turn : turn + 4])
            quaternion_to_matrix(work[turn : turn + 4], work[frame : frame + 9].reshape((3, 3)))
        gap = _gap_along(geometry, work, index, direction) - impact_margin
        if trial == 0:
            above = gap
        elif trial == 1 or gap < 0.0:
            high, below = t, gap
        else:
            low, above = t, gap
        # No sign change between the ends: no root is bracketed.
        if above < 0.0 or (trial == 1 and below >= 0.0):
            return inf, trial + 1
        if trial > 0 and (above <= tolerance or high - low <= 2.0 * least):
            return low, trial + 1
    return low, budget + 2


@jit
def closing_speed(work):
    """Rate at which the points of the witness approach along its normal, for the motions at MOTION; inf without normal."""
    normal = vector(work, WITNESS + NORMAL)
    if dot(normal, normal) == 0.0:
        return inf
    result = 0.0
    for side in range(2):
        motion = MOTION + MOTION_SIZE * side
        arm = subtract(vector(work, WITNESS + 3 * side), vector(work, motion + POSITION))
        speed = dot(normal, along(vector(work, motion + VELOCITY), 1.0, cross(vector(work, motion + SPIN), arm)))
        result += -speed if side else speed
    return result
