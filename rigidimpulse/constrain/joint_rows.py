"""Coordinates and rows of joints.

A joint has an anchor and a frame of three axes on each of its bodies; the frames coincide at the start. With d = p_b -
p_a the offset of the anchors, e_k and f_k the axes carried by a and b, and E = [e]^T [f], its coordinates x and their
rates u = J v are

    along k      x = e_k . d                                     force along e_k at p_b
    about k      x = (E_ml - E_lm) / 2, (k, l, m) cyclic         torque along e_k   (all three rotations held)
    across k     x = e_k . (e_0 x f_0), k = 1, 2                 torque along e_k   (free to turn about e_0)
    twist        x = angle of f_1 in the plane of e_1, e_2       torque along e_0   (counted through full turns)
    swing        x = angle between e_0 and f_0                   torque along e_0 x f_0
    distance     x = |d|                                         force along d / |d|

A row asks for x = target, x >= target or x <= target, hard or as a spring and damper (see `softness`); what it may
exert is kept between its bounds. The rows of all joints are one table: whatever the joint, the kernels see coordinates
and bounds.
"""

from math import atan2, pi, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.rows import BOUNDED, FREE, write_body, write_row

ALONG, ABOUT, ACROSS, TWIST, SWING, DISTANCE = 0, 3, 6, 9, 10, 11
"""Coordinates; ALONG, ABOUT and ACROSS plus the axis."""


class Joints(NamedTuple):
    """j joints with k rows; bodies are indices into the world, -1 is the world itself."""

    body_a: np.ndarray  # (j,)
    body_b: np.ndarray  # (j,)
    anchor_a: np.ndarray  # (j, 3) m, in the principal frame of a (in the world if a is -1)
    anchor_b: np.ndarray  # (j, 3)
    frame_a: np.ndarray  # (j, 3, 3) columns: the axes in the principal frame of a
    frame_b: np.ndarray  # (j, 3, 3)
    first: np.ndarray  # (j + 1,) first row of each joint
    coordinate: np.ndarray  # (k,)
    target: np.ndarray  # (k,) m or rad
    lower: np.ndarray  # (k,) N or N m, least and most that the row may exert
    upper: np.ndarray  # (k,)
    stiffness: np.ndarray  # (k,) N/m or N m/rad; inf: hard
    damping: np.ndarray  # (k,) N s/m or N m s/rad
    rate: np.ndarray  # (k,) m/s or rad/s, the rate that the damping strives for


@jit
def _carry(joints, j, side, position, rotation, point, frame):
    """Anchor and axes (columns) of one side of joint j in the world."""
    i = joints.body_b[j] if side else joints.body_a[j]
    anchor = joints.anchor_b[j] if side else joints.anchor_a[j]
    axes = joints.frame_b[j] if side else joints.frame_a[j]
    for r in range(3):
        point[r] = position[i, r] if i >= 0 else anchor[r]
        for c in range(3):
            frame[r, c] = 0.0 if i >= 0 else axes[r, c]
    if i >= 0:
        for r in range(3):
            for t in range(3):
                point[r] += rotation[i, r, t] * anchor[t]
                for c in range(3):
                    frame[r, c] += rotation[i, r, t] * axes[t, c]


@jit
def _relative_rotation(e, f, out):
    for r in range(3):
        for c in range(3):
            out[r, c] = e[0, r] * f[0, c] + e[1, r] * f[1, c] + e[2, r] * f[2, c]


@jit
def _measure(code, d, e, f, near, direction):
    """Coordinate and the direction (3,) that it grows in; a TWIST is taken near the angle `near`."""
    if code < ABOUT:
        for r in range(3):
            direction[r] = e[r, code]
        return direction[0] * d[0] + direction[1] * d[1] + direction[2] * d[2]
    if code == DISTANCE:
        length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        for r in range(3):
            direction[r] = d[r] / length if length > 0.0 else e[r, 0]
        return length
    turn = np.empty((3, 3))
    _relative_rotation(e, f, turn)
    if code == SWING:
        x, y = -turn[2, 0], turn[1, 0]  # e_0 x f_0 lies across e_0
        size = sqrt(x * x + y * y)
        for r in range(3):
            direction[r] = (x * e[r, 1] + y * e[r, 2]) / size if size > 0.0 else e[r, 1]
        return atan2(size, turn[0, 0])
    axis = 0 if code == TWIST else (code - ABOUT if code < ACROSS else code - ACROSS)
    for r in range(3):
        direction[r] = e[r, axis]
    if code == TWIST:
        angle = atan2(turn[2, 1], turn[1, 1])
        return angle + 2.0 * pi * np.rint((near - angle) / (2.0 * pi))
    if code < ACROSS:
        after, last = (axis + 1) % 3, (axis + 2) % 3
        return 0.5 * (turn[last, after] - turn[after, last])
    return -turn[2, 0] if axis == 1 else turn[1, 0]


@jit
def is_linear(code):
    """Whether a coordinate is a length, and its row a force."""
    return code < ABOUT or code == DISTANCE


@jit
def joint_values(joints, which, position, rotation, angle, value):
    """Fill value with coordinate - target of the rows of the joints listed in `which`; angle (k,): last coordinates."""
    pa, pb, d, direction = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    e, f = np.empty((3, 3)), np.empty((3, 3))
    i = 0
    for j in which:
        _carry(joints, j, 0, position, rotation, pa, e)
        _carry(joints, j, 1, position, rotation, pb, f)
        d[:] = pb - pa
        for k in range(joints.first[j], joints.first[j + 1]):
            value[i] = _measure(joints.coordinate[k], d, e, f, angle[k], direction) - joints.target[k]
            i += 1


@jit
def _write_angular(bodies, number, a, b, direction, rows, i):
    x, y, z = direction[0], direction[1], direction[2]
    if a >= 0 and bodies.inv_mass[a] > 0.0:
        rows.first[i] = number[a]
        write_body(bodies, a, rows.jacobian[i, :6], 0.0, 0.0, 0.0, -x, -y, -z)
    if b >= 0 and bodies.inv_mass[b] > 0.0:
        rows.second[i] = number[b]
        write_body(bodies, b, rows.jacobian[i, 6:], 0.0, 0.0, 0.0, x, y, z)


@jit
def joint_rows(joints, which, bodies, rotation, number, angle, rows, start, value, direction):
    """Fill rows from `start` on with those of the joints listed in `which`, in the present pose.

    angle (k,) last coordinates, updated; value (s,) coordinate - target and direction (s, 3) of the s rows are written.
    Bounds of impulses are left as they are. Returns the number of rows filled.
    """
    pa, pb, d, ra, rb = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    e, f = np.empty((3, 3)), np.empty((3, 3))
    i = np.int64(0)
    for j in which:
        _carry(joints, j, 0, bodies.position, rotation, pa, e)
        _carry(joints, j, 1, bodies.position, rotation, pb, f)
        d[:] = pb - pa
        a, b = joints.body_a[j], joints.body_b[j]
        for k in range(joints.first[j], joints.first[j + 1]):
            code, way = joints.coordinate[k], direction[i]
            angle[k] = _measure(code, d, e, f, angle[k], way)
            value[i] = angle[k] - joints.target[k]
            if is_linear(code):
                for r in range(3):
                    # e_k turns with a: its lever arm ends at the anchor of b.
                    ra[r] = (pa[r] if code == DISTANCE else pb[r]) - (bodies.position[a, r] if a >= 0 else 0.0)
                    rb[r] = pb[r] - (bodies.position[b, r] if b >= 0 else 0.0)
                write_row(bodies, number, a, b, ra, rb, way[0], way[1], way[2], rows, start + i)
            else:
                _write_angular(bodies, number, a, b, way, rows, start + i)
            one_sided = joints.lower[k] > -np.inf or joints.upper[k] < np.inf
            rows.kind[start + i] = BOUNDED if one_sided else FREE
            i += 1
    return i


@jit
def relative_point_velocity(joints, which, bodies, rotation, direction, u):
    """Rates u (s,) of the coordinates at the present velocities."""
    pa, pb = np.empty(3), np.empty(3)
    e, f, v = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    i = 0
    for j in which:
        _carry(joints, j, 0, bodies.position, rotation, pa, e)
        _carry(joints, j, 1, bodies.position, rotation, pb, f)
        for k in range(joints.first[j], joints.first[j + 1]):
            code = joints.coordinate[k]
            v[:] = 0.0
            for side in range(2):
                body = joints.body_b[j] if side else joints.body_a[j]
                if body < 0:
                    continue
                sign = 1.0 if side else -1.0
                w = bodies.angular_velocity[body]
                if is_linear(code):
                    r = (pa if side == 0 and code == DISTANCE else pb) - bodies.position[body]
                    v[0] += sign * (bodies.velocity[body, 0] + w[1] * r[2] - w[2] * r[1])
                    v[1] += sign * (bodies.velocity[body, 1] + w[2] * r[0] - w[0] * r[2])
                    v[2] += sign * (bodies.velocity[body, 2] + w[0] * r[1] - w[1] * r[0])
                else:
                    v += sign * w
            u[i] = v[0] * direction[i, 0] + v[1] * direction[i, 1] + v[2] * direction[i, 2]
            i += 1
