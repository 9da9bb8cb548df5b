"""Backing up time by a linear approximation: the gap is taken to shrink at the speed it has at the start.

    t = start + (gap - impact_margin) / c,     c = -n.(v_b + w_b x r_b - v_a - w_a x r_a)

with the points that are closest then, and the normal n from a to b.

The error is that of a straight line, 1/2 |gap''| (t - start)^2 / c: second order in the step. Two queries a contact.
It may miss contacts: those of bodies that do not approach at the start because they are still to be accelerated or
turned, and those of other features than the closest ones; where it is late the bodies overlap. `bisection` does
neither.
"""

from __future__ import annotations

from math import inf

import numpy as np

from rigidimpulse.collision.manifold.dispatch import Posed, pair_gap
from rigidimpulse.collision.time_of_impact.motion_bound import put
from rigidimpulse.collision.time_of_impact.result import IMPACT, TOUCHING, ImpactTimes, PairsToSweep, SweepDetector, no_impacts
from rigidimpulse.collision.time_of_impact.scratch_layout import FIRST, GAP, NORMAL, POINT_FIRST, POINT_SECOND, SECOND
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.core.vector import along, cross, dot, length, row, scaled, subtract
from rigidimpulse.motion.trajectory import Trajectories, motion_at


@jit_making_arrays
def measure(geometry, trajectory, shape_of_body, a, b, t, witness):
    """Measure the least gap of two bodies: points, normal and gap to witness (10,); returns the closing speed.

    Where surfaces cross or coincide, the normal is the line between the centres of mass, and the points tell nothing.
    """
    x, q, v, w = np.empty((2, 3)), np.empty((2, 4)), np.empty((2, 3)), np.empty((2, 3))
    axes, points = np.empty((2, 3, 3)), np.zeros(7)
    for side in range(2):
        motion_at(trajectory, b if side else a, t, x[side], q[side], v[side], w[side])
        quaternion_to_matrix(q[side], axes[side])
    posed_a, posed_b = Posed(shape_of_body[a], x[0], axes[0]), Posed(shape_of_body[b], x[1], axes[1])
    gap = pair_gap(geometry, posed_a, posed_b, inf, points)
    point_a, point_b = (points[0], points[1], points[2]), (points[3], points[4], points[5])
    between = scaled(subtract(point_b, point_a), 1.0 if gap >= 0.0 else -1.0)
    # Surfaces that coincide have no normal of their own.
    if dot(between, between) == 0.0:
        between = subtract(row(x, SECOND), row(x, FIRST))
    size = length(between)
    normal = scaled(between, 1.0 / size if size > 0.0 else 0.0)
    put(witness, POINT_FIRST, point_a)
    put(witness, POINT_SECOND, point_b)
    put(witness, NORMAL, normal)
    witness[GAP] = gap
    speed_a = along(row(v, FIRST), 1.0, cross(row(w, FIRST), subtract(point_a, row(x, FIRST))))
    speed_b = along(row(v, SECOND), 1.0, cross(row(w, SECOND), subtract(point_b, row(x, SECOND))))
    return dot(normal, subtract(speed_a, speed_b))


@jit
def _sweep(geometry, trajectory, shape_of_body, pairs, end, result):
    start, impact_margin = pairs.start, pairs.impact_margin
    for k in range(pairs.a.shape[0]):
        a, b, witness = pairs.a[k], pairs.b[k], result.witness[k]
        closing = measure(geometry, trajectory, shape_of_body, a, b, start[k], witness)
        result.queries[k] = 1
        if closing <= 0.0:
            continue
        wait = (witness[GAP] - impact_margin[k]) / closing
        if wait <= 0.0:
            result.time[k], result.status[k] = start[k], TOUCHING
        elif start[k] + wait <= end:
            result.time[k], result.status[k] = start[k] + wait, IMPACT
            measure(geometry, trajectory, shape_of_body, a, b, start[k] + wait, witness)
            result.queries[k] = 2


def sweep(detector: SweepDetector, trajectory: Trajectories, pairs: PairsToSweep, end: float) -> ImpactTimes:
    """Estimate the first contact of each pair of bodies; arguments as for `bisection.sweep`; `tolerance` and `until` are not read.

    Returns:
        Times with an error of second order in the step; the gap measured there is in the witness.

    """
    result = no_impacts(len(pairs.a))
    _sweep(detector.geometry, trajectory, detector.shape_of_body, pairs, float(end), result)
    return result
