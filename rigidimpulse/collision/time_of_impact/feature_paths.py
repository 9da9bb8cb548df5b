"""First contact of two features on prescribed curved paths: points, edges and triangles, in any pairing.

On a `FeaturePath` the position x and the rotation vector theta are linear in tau from 0 to 1; longer paths are
chained from such pieces. With rho = |theta'|, a the unit vector and phi the length of theta, a corner c of the
feature moves as

    p  = x + R(theta) c,    p' = x' + w x R c,
    w  = [sin(phi) / phi + (1 - sin(phi) / phi) a a^T + (1 - cos(phi)) / phi [a]x] theta'

The matrix is the mean of R(s theta) over s in [0, 1], which turns by at most s rho, so |w| <= rho and |w'| <= rho^2 /
2: however fast the feature spins, |p''| <= 3/2 rho^2 |c|. Along the fixed direction n of the closest features, each
pair of corners stays apart for

    g - c s - 1/2 (|p_a''| + |p_b''|) s^2 > 0,    g = n.(p_b - p_a),   c = -n.(p_b' - p_a')

The least such time is a step that passes no contact; steps are repeated until the gap is at `impact_margin` (conservative
advancement).
"""

from __future__ import annotations

from math import inf, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.collision.time_of_impact.closest_direction import closest_simplices
from rigidimpulse.collision.time_of_impact.motion_bound import put, vector
from rigidimpulse.collision.time_of_impact.scratch_layout import CLOSEST, CORNER, COUNT, FACE, FIRST, INDEX_SIZE, NORMAL, SECOND, WORK_SIZE
from rigidimpulse.collision.time_of_impact.separating_quadratic import safe_until
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.quaternion import exponential, rotated
from rigidimpulse.core.vector import along, cross, dot, length, row, scaled, subtract

MAX_STEPS = 1_000_000
"""Safe steps before a search is given up."""

_ROUND_OFF = 4.0 * 2.0**-52  # of the gap, relative to the coordinates


class FeaturePath(NamedTuple):
    """Pose of a feature for tau from 0 to 1: row 0 at the start, row 1 at the end, linear between."""

    position: np.ndarray  # (2, 3) m
    rotation: np.ndarray  # (2, 3) rad, rotation vectors


@jit
def _spin(theta, rate):
    """w of the rotation vector theta that changes at a constant rate."""
    phi = length(theta)
    if phi == 0.0:
        return rate
    axis = scaled(theta, 1.0 / phi)
    sinc = sin(phi) / phi
    result = along(scaled(rate, sinc), (1.0 - sinc) * dot(axis, rate), axis)
    return along(result, 2.0 * sin(0.5 * phi) ** 2 / phi, cross(axis, rate))


@jit
def _place(corners, path, tau, side, work, speeds):
    """Write the corners at tau to CORNER in `work`, their velocities to `speeds` (18,), and the unit normal to FACE."""
    rate = subtract(row(path.rotation, SECOND), row(path.rotation, FIRST))
    theta = along(row(path.rotation, FIRST), tau, rate)
    velocity = subtract(row(path.position, SECOND), row(path.position, FIRST))
    position = along(row(path.position, FIRST), tau, velocity)
    w = _spin(theta, rate)
    q0, q1, q2, q3 = exponential(theta[0], theta[1], theta[2])
    for k in range(corners.shape[0]):
        arm = rotated(q0, q1, q2, q3, corners[k, 0], corners[k, 1], corners[k, 2])
        put(work, CORNER + 9 * side + 3 * k, along(position, 1.0, arm))
        put(speeds, 9 * side + 3 * k, along(velocity, 1.0, cross(w, arm)))
    if corners.shape[0] == 3:
        first = vector(work, CORNER + 9 * side)
        normal = cross(
            subtract(vector(work, CORNER + 9 * side + 3), first), subtract(vector(work, CORNER + 9 * side + 6), first)
        )
        put(work, FACE + 3 * side, scaled(normal, 1.0 / length(normal)))


@jit
def _bend(corners, path, k):
    """Bound of |p''| of corner k."""
    rate = length(subtract(row(path.rotation, SECOND), row(path.rotation, FIRST)))
    return 1.5 * rate * rate * length(row(corners, k))


@jit
def _first_contact(first, second, impact_margin, tolerance, work, index, speeds):
    """Return (tau, steps) of two features, each (corners, path); tau is inf without contact, nan if the steps were used up."""
    (corners_a, path_a), (corners_b, path_b) = first, second
    index[COUNT], index[COUNT + 1] = corners_a.shape[0], corners_b.shape[0]
    tau = 0.0
    for step in range(1, MAX_STEPS + 1):
        _place(corners_a, path_a, tau, FIRST, work, speeds)
        _place(corners_b, path_b, tau, SECOND, work, speeds)
        separation, _ = closest_simplices(work, index, CLOSEST)
        size = length(vector(work, CORNER)) + length(vector(work, CORNER + 9))
        if separation <= impact_margin + max(tolerance, _ROUND_OFF * size):
            return tau, step
        normal = vector(work, CLOSEST + NORMAL)
        safe = 1.0 - tau
        for i in range(corners_a.shape[0]):
            for j in range(corners_b.shape[0]):
                gap = dot(normal, subtract(vector(work, CORNER + 9 + 3 * j), vector(work, CORNER + 3 * i))) - impact_margin
                # Each pair of corners has its own offset, speed and bend along n.
                closing = -dot(normal, subtract(vector(speeds, 9 + 3 * j), vector(speeds, 3 * i)))
                safe = safe_until(gap, closing, _bend(corners_a, path_a, i) + _bend(corners_b, path_b, j), safe)
        if tau + safe >= 1.0:
            return inf, step
        if tau + safe <= tau:
            return tau, step
        tau += safe
    return np.nan, MAX_STEPS


def first_contact(
    corners_a: ArrayLike,
    path_a: FeaturePath,
    corners_b: ArrayLike,
    path_b: FeaturePath,
    *,
    impact_margin: float = 0.0,
    tolerance: float = 0.0,
) -> float:
    """Find when two features on prescribed paths first come together; never passes a contact, however fast they spin.

    Args:
        corners_a: (k, 3) m, in the frame of the feature: a point (k = 1), an edge (2) or a triangle (3).
        path_a: its pose from tau = 0 to 1.
        corners_b: as corners_a, of the other feature.
        path_b: its pose.
        impact_margin: m, distance that counts as contact.
        tolerance: m, how far above `impact_margin` the distance may be at the time found; rounding sets a limit to it.

    Returns:
        tau of the first contact in [0, 1], inf if there is none.

    Raises:
        ValueError: a feature has not one to three corners, a triangle has no area, or something is not finite.
        RuntimeError: MAX_STEPS safe steps did not reach the end.

    """
    features = []
    for corners, path in ((corners_a, path_a), (corners_b, path_b)):
        arrays = [np.ascontiguousarray(a, dtype=np.float64) for a in (corners, path.position, path.rotation)]
        if not (arrays[0].shape in ((1, 3), (2, 3), (3, 3)) and arrays[1].shape == arrays[2].shape == (2, 3)):
            raise ValueError("a feature has 1 to 3 corners (k, 3), and a path a position and a rotation (2, 3)")
        if not all(np.isfinite(a).all() for a in arrays):
            raise ValueError("corners and paths must be finite")
        if len(arrays[0]) == 3 and not np.cross(arrays[0][1] - arrays[0][0], arrays[0][2] - arrays[0][0]).any():
            raise ValueError("a triangle without area: give its longest edge")
        features.append((arrays[0], FeaturePath(arrays[1], arrays[2])))
    work, index, speeds = np.zeros(WORK_SIZE), np.zeros(INDEX_SIZE, np.int64), np.zeros(18)
    tau, steps = _first_contact(*features, float(impact_margin), float(tolerance), work, index, speeds)
    if np.isnan(tau):
        raise RuntimeError(f"no end after {steps} safe steps: split the path into shorter pieces")
    return float(tau)
