"""No backing up: contact is looked for at the end of the step only, and dealt with there, overlap and all.

This is what engines with fixed steps do. What passes through within the step is missed; what has got inside is found
as long as it is in there at the end. The normal of bodies that overlap is the one they had at the start of the step.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.containment import points_in_shape
from rigidimpulse.collision.geometry import HALF_SPACE, ROUND
from rigidimpulse.collision.time_of_impact.linear import measure
from rigidimpulse.collision.time_of_impact.motion_bound import put, turned, turned_back, vector
from rigidimpulse.collision.time_of_impact.result import IMPACT, ImpactTimes, PairsToSweep, SweepDetector, no_impacts
from rigidimpulse.collision.time_of_impact.scratch_layout import GAP, NORMAL
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.core.vector import along, row, subtract
from rigidimpulse.motion.trajectory import Trajectories, pose_at


@jit_making_arrays
def _is_inside(geometry, trajectory, shape_of_body, a, b, t):
    """Tell whether a primitive of one body lies inside the other, for bodies whose surfaces do not cross."""
    position, orientation, axes = np.empty(6), np.empty((2, 4)), np.empty(18)
    points, inside = np.empty((1, 3)), np.zeros(1, np.bool_)
    for side in range(2):
        pose_at(trajectory, b if side else a, t, position[3 * side : 3 * side + 3], orientation[side])
        quaternion_to_matrix(orientation[side], axes[9 * side : 9 * side + 9].reshape((3, 3)))
    for side in range(2):
        small, large = shape_of_body[b if side else a], shape_of_body[a if side else b]
        for primitive in range(geometry.shape_first[small], geometry.shape_first[small + 1]):
            if geometry.kind[primitive] == HALF_SPACE:
                continue
            point = row(geometry.frame, primitive)
            if geometry.kind[primitive] == ROUND:
                point = row(geometry.vertex, geometry.vertex_first[primitive])
            point = along(turned(axes, 9 * side, point), 1.0, vector(position, 3 * side))
            point = turned_back(axes, 9 - 9 * side, subtract(point, vector(position, 3 - 3 * side)))
            points[0, 0], points[0, 1], points[0, 2] = point
            points_in_shape(geometry, large, points, inside)
            if inside[0]:
                return True
    return False


@jit
def _sweep(geometry, trajectory, shape_of_body, pairs, end, result):
    start, impact_margin = pairs.start, pairs.impact_margin
    for k in range(pairs.a.shape[0]):
        a, b, witness = pairs.a[k], pairs.b[k], result.witness[k]
        measure(geometry, trajectory, shape_of_body, a, b, end, witness)
        result.queries[k] = 1
        gap = witness[GAP]
        if gap > impact_margin[k] and not _is_inside(geometry, trajectory, shape_of_body, a, b, end):
            continue
        result.time[k], result.status[k] = end, IMPACT
        if gap <= 0.0 or gap > impact_margin[k]:  # crossing or inside
            measure(geometry, trajectory, shape_of_body, a, b, start[k], witness)
            normal = vector(witness, NORMAL)
            measure(geometry, trajectory, shape_of_body, a, b, end, witness)
            put(witness, NORMAL, normal)
            result.queries[k] = 3


def sweep(detector: SweepDetector, trajectory: Trajectories, pairs: PairsToSweep, end: float) -> ImpactTimes:
    """Report the pairs that are in contact at `end`; arguments as for `bisection.sweep`; `tolerance` and `until` are not read.

    Returns:
        `end` for pairs that overlap there or are closer than `impact_margin`.

    """
    result = no_impacts(len(pairs.a))
    _sweep(detector.geometry, trajectory, detector.shape_of_body, pairs, float(end), result)
    return result
