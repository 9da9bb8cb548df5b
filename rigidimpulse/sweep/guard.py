"""How long two moving shapes stay apart for certain: one safe step, whatever the shapes.

`safe_time` looks at two bodies at one instant and returns a span over which their gap stays above a threshold. It holds for exactly the
motion that `bound` describes, turning and accelerating bodies included, so stepping by safe spans never passes a contact (conservative
advancement, Mirtich 1996; Zhang, Lee and Kim 2006, here with exact first and second derivatives and bounded third ones).

Every pair of primitives has its kernel: `guard_half_space`, `guard_round`, `guard_cylinder`. The first primitive's body carries the frame:
a half space before a ROUND primitive before a cylinder. Bodies that start at or below the threshold but leave it are let go: until they
come back, the gap is not below the present one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.detect.features import along, relative_pose, row, subtract, turned
from rigidimpulse.geometry import CYLINDER, HALF_SPACE, ROUND, Geometry
from rigidimpulse.sweep.bound import (
    AXES,
    MOTION_SIZE,
    ORIENTATION,
    POSITION,
    SEEN_SIZE,
    VELOCITY,
    length,
    relative_motion,
    vector,
)
from rigidimpulse.sweep.guard_closest import CLOSEST_SIZE
from rigidimpulse.sweep.guard_cylinder import (
    cylinder_cylinder_safe_until,
    half_space_cylinder_safe_until,
    round_cylinder_safe_until,
)
from rigidimpulse.sweep.guard_half_space import half_space_round_safe_until
from rigidimpulse.sweep.guard_root import point_safe_until
from rigidimpulse.sweep.guard_round import round_round_safe_until
from rigidimpulse.sweep.guard_witness import WITNESS_SIZE

STACK_SIZE = 128
"""Rows of the traversal stack: two trees of up to 2^60 triangles."""


class SweepScratch(NamedTuple):
    """Constants per shape, and arrays that the kernels of a sweep write into; made by `make_scratch`."""

    reach: np.ndarray  # (s,) m, radius of the shape about its body's centre of mass; inf with a half space
    ball: np.ndarray  # (s,) bool: one sphere about the centre of mass, on which no rotation can be seen
    plane: np.ndarray  # (s,) the half space that is all of the shape, or -1
    motion: np.ndarray  # (2, MOTION_SIZE) of bodies a and b
    position: np.ndarray  # (2, 3) m, poses of bodies a and b at which a witness is looked at
    orientation: np.ndarray  # (2, 4)
    axes: np.ndarray  # (2, 3, 3)
    rotation: np.ndarray  # (3, 3) second body's axes in the frame of the first
    offset: np.ndarray  # (3,) m, second body's centre of mass in the frame of the first
    seen: np.ndarray  # (2, SEEN_SIZE) second seen from the first; first seen from the second, in the axes of the first
    corners_first: np.ndarray  # (3, 3) m, frame of the first
    corners_second: np.ndarray  # (3, 3) m, frame of the first
    closest: np.ndarray  # (CLOSEST_SIZE,) of the pair last looked at
    feature: np.ndarray  # (4,) int64, the witness: primitive and element of a, primitive and element of b
    witness: np.ndarray  # (WITNESS_SIZE,) where the witness is, see `guard_witness`
    stack: np.ndarray  # (STACK_SIZE, 2) int64
    stack_time: np.ndarray  # (STACK_SIZE,)


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
            ball[shape] = len(vertices) == 1 and not vertices.any()
            if ball[shape]:
                reach[shape] = geometry.radius[first]
    return SweepScratch(
        reach=reach,
        ball=ball,
        plane=plane,
        motion=np.zeros((2, MOTION_SIZE)),
        position=np.zeros((2, 3)),
        orientation=np.zeros((2, 4)),
        axes=np.zeros((2, 3, 3)),
        rotation=np.zeros((3, 3)),
        offset=np.zeros(3),
        seen=np.zeros((2, SEEN_SIZE)),
        corners_first=np.zeros((3, 3)),
        corners_second=np.zeros((3, 3)),
        closest=np.zeros(CLOSEST_SIZE),
        feature=np.full(4, -1, np.int64),
        witness=np.zeros(WITNESS_SIZE),
        stack=np.zeros((STACK_SIZE, 2), np.int64),
        stack_time=np.zeros(STACK_SIZE),
    )


@jit
def _look_from(scratch, first, second, horizon):
    """Write the relative pose and motion of two motion rows, in the frame of the first."""
    axes_first, axes_second = first[AXES:ORIENTATION].reshape((3, 3)), second[AXES:ORIENTATION].reshape((3, 3))
    relative_pose(axes_first, first[POSITION:VELOCITY], axes_second, second[POSITION:VELOCITY], scratch.rotation, scratch.offset)
    relative_motion(first, second, first, horizon, scratch.seen[0])
    relative_motion(second, first, first, horizon, scratch.seen[1])


@jit
def _bounds_safe_until(geometry, scratch, first, second, threshold, horizon):
    """Safe time of the bounding spheres of two primitives along the line between them; 0 where they overlap."""
    reach = geometry.bound_radius[first] + geometry.bound_radius[second] + threshold
    if reach == np.inf:
        return 0.0
    arm = turned(scratch.rotation, row(geometry.bound_centre, second))
    between = subtract(along(arm, 1.0, vector(scratch.offset, 0)), row(geometry.bound_centre, first))
    distance = length(between)
    if distance <= reach:
        return 0.0
    normal = along((0.0, 0.0, 0.0), 1.0 / distance, between)
    return point_safe_until(scratch.seen[0], normal, arm, distance - reach, horizon)


@jit
def _primitives_safe_until(geometry, scratch, first, second, threshold, horizon):
    """Safe time of two primitives; their elements that limit it are left in scratch.feature[1] and [3]."""
    kind_first, kind_second = geometry.kind[first], geometry.kind[second]
    if kind_first == HALF_SPACE:
        if kind_second == ROUND:
            return half_space_round_safe_until(geometry, scratch, first, second, threshold, horizon)
        if kind_second == CYLINDER:
            return half_space_cylinder_safe_until(geometry, scratch, first, second, threshold, horizon)
        return horizon
    if kind_second == ROUND:
        return round_round_safe_until(geometry, scratch, first, second, threshold, horizon)
    if kind_first == ROUND:
        return round_cylinder_safe_until(geometry, scratch, first, second, threshold, horizon)
    return cylinder_cylinder_safe_until(geometry, scratch, first, second, threshold, horizon)


@jit
def safe_time(geometry, shape_a, motion_a, shape_b, motion_b, threshold, horizon, scratch):
    """Find how long two shapes stay farther apart than a threshold.

    Two half spaces never limit each other.

    Args:
        geometry: the compiled shapes.
        shape_a: index of a's shape; likewise shape_b.
        motion_a: motion row of a (`bound.motion_bound`), its bounds valid over the horizon; likewise motion_b.
        threshold: m.
        horizon: s.
        scratch: `SweepScratch`. If the result is short of the horizon, scratch.feature names the features that limit it.

    Returns:
        s <= horizon such that the gap is above the threshold on [0, s); where it starts at or below the threshold and grows, above
        its present value.

    """
    viewer = -1
    for p in range(geometry.shape_first[shape_a], geometry.shape_first[shape_a + 1]):
        for q in range(geometry.shape_first[shape_b], geometry.shape_first[shape_b + 1]):
            swapped = geometry.kind[q] < geometry.kind[p]
            if viewer != swapped:
                viewer = int(swapped)
                if swapped:
                    _look_from(scratch, motion_b, motion_a, horizon)
                else:
                    _look_from(scratch, motion_a, motion_b, horizon)
            first, second = (q, p) if swapped else (p, q)
            if _bounds_safe_until(geometry, scratch, first, second, threshold, horizon) >= horizon:
                continue
            s = _primitives_safe_until(geometry, scratch, first, second, threshold, horizon)
            if s < horizon:
                horizon = s
                feature = scratch.feature
                feature[0], feature[2] = p, q
                if swapped:
                    feature[1], feature[3] = feature[3], feature[1]
    return horizon
