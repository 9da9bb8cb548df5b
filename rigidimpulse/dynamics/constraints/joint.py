"""Coordinates and rows of joints.

A joint has an anchor and a frame of three axes on each of its bodies. With d = p_b - p_a the offset of the anchors, e_k
and f_k the axes carried by a and b, E = [e]^T [f] and (k, l, m) cyclic, its coordinates x and their rates u = J v are

    along k      x = e_k . d                                     force along e_k at p_b
    radius k     x = |d - e_k (e_k . d)|                         force along it at p_b   (from the line of e_k)
    distance     x = |d|                                         force along d / |d|
    about k      x = e_k . phi, exp(phi) = E                     torque along row k of dphi/dw   (all three rotations held)
    across k, i  x = angle . e_i of the swing of e_k to f_k      torque along dx/dw              (free to turn about e_k; i != k)
    twist k      x = atan2(E_ml - E_lm, E_ll + E_mm)             torque along (e_k + f_k) / (1 + e_k . f_k)
    swing k      x = angle between e_k and f_k                   torque along e_k x f_k
    angle        x = angle of the rotation E, 0 to pi            torque along its axis

Torques act along the gradients of the coordinates, so x' = u at any angle and springs have the energy k x^2 / 2. With theta = |phi|,

    dphi/dw = 1 - [phi]x / 2 + c [phi]x^2,   c = (1 - theta / 2 cot(theta / 2)) / theta^2    (Bullo and Murray 1995),

and the swing by the angle b of e_k to f_k = (f_k, f_l, f_m) in the axes of a has x = g (-f_m, f_l) along l and m, g = b / sin b.

The twist about k is the second factor of E = swing twist, the swing being the shortest turn that takes e_k to f_k
(Huyghe 1996; Dobrowolski 2015). It is counted through full turns; it is not defined where e_k = -f_k, and its torque
grows without bound on the way there. Swing and angle have no direction at 0 (x along the first free axis is taken) and
turn round at pi.

A row asks for x = target, x >= target or x <= target, hard or as a spring and damper (see `softness`); what it may
exert is kept between its bounds. The rows of all joints are one table: whatever the joint, the kernels see coordinates
and bounds.
"""

from math import atan2, pi, sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import from_columns
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import copy_vector
from rigidimpulse.dynamics.constraints.rows import BOUNDED, FREE, write_body, write_row
from rigidimpulse.scene.joint_coordinates import ABOUT, ACROSS, ANGLE, DISTANCE, RADIUS, SWING, TWIST

TINY = TOLERANCES.arithmetic.least_divisor
SMALL = TOLERANCES.joint.least_sine
FLAT = TOLERANCES.joint.series_angle


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
def _linear(code, d, e, direction):
    """Coordinate that is a length and the direction (3,) that it grows in."""
    if code < RADIUS:
        for r in range(3):
            direction[r] = e[r, code]
        return direction[0] * d[0] + direction[1] * d[1] + direction[2] * d[2]
    first, axis = 0, code - RADIUS
    x, y, z = d[0], d[1], d[2]
    if code != DISTANCE:
        first = (axis + 1) % 3
        along = e[0, axis] * x + e[1, axis] * y + e[2, axis] * z
        x, y, z = x - along * e[0, axis], y - along * e[1, axis], z - along * e[2, axis]
    length = sqrt(x * x + y * y + z * z)
    if length > 0.0:
        direction[0], direction[1], direction[2] = x / length, y / length, z / length
    else:
        for r in range(3):
            direction[r] = e[r, first]
    return length


@jit
def _along_axes(e, x, y, z, direction):
    """direction = e (x, y, z) / |(x, y, z)|; returns the length, 0 without touching direction."""
    length = sqrt(x * x + y * y + z * z)
    if length > 0.0:
        for r in range(3):
            direction[r] = (x * e[r, 0] + y * e[r, 1] + z * e[r, 2]) / length
    return length


@jit
def _about(turn, e, k, direction):
    """Part k of the rotation vector of `turn`, with its gradient (3,) in the world."""
    q0, q1, q2, q3 = from_columns(
        (turn[0, 0], turn[1, 0], turn[2, 0]), (turn[0, 1], turn[1, 1], turn[2, 1]), (turn[0, 2], turn[1, 2], turn[2, 2])
    )
    half = sqrt(q1 * q1 + q2 * q2 + q3 * q3)
    angle = 2.0 * atan2(half, q0)
    grown = angle / half if half > SMALL else 2.0
    curve = (1.0 - 0.5 * angle * q0 / half) / (angle * angle) if angle > FLAT else 1.0 / 12.0 + angle * angle / 720.0
    phi = (grown * q1, grown * q2, grown * q3)
    x, after, last = phi[k], phi[(k + 1) % 3], phi[(k + 2) % 3]
    own = 1.0 + curve * (x * x - angle * angle)
    for r in range(3):
        direction[r] = own * e[r, k] + (curve * x * after + 0.5 * last) * e[r, (k + 1) % 3]
        direction[r] += (curve * x * last - 0.5 * after) * e[r, (k + 2) % 3]
    return x


@jit
def _across(turn, e, k, i, direction):
    """Part i of the swing of axis k, with its gradient (3,) in the world."""
    after, last = (k + 1) % 3, (k + 2) % 3
    upright, left, right = turn[k, k], turn[after, k], turn[last, k]
    sine = sqrt(left * left + right * right)
    swing = atan2(sine, upright)
    grown, slope = 1.0 + swing * swing / 6.0, 1.0 / 3.0
    if swing > FLAT:
        sine = max(sine, SMALL)
        grown, slope = swing / sine, (sine - swing * upright) / (sine * sine * sine)
    first = i == after
    own, other = (right, left) if first else (left, right)
    for r in range(3):
        direction[r] = (grown * upright + slope * own * own) * e[r, i] - grown * other * e[r, k]
        direction[r] -= slope * own * other * e[r, last if first else after]
    return -grown * right if first else grown * left


@jit_making_arrays
def _angular(code, e, f, near, direction):
    """Coordinate that is an angle and the direction (3,) that it grows in; a TWIST is taken near the angle `near`."""
    turn = np.empty((3, 3))
    _relative_rotation(e, f, turn)
    if code >= ACROSS:
        return _across(turn, e, (code - ACROSS) // 3, (code - ACROSS) % 3, direction)
    if code == ANGLE:
        copy_vector(e[:, 0], direction)
        x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
        return atan2(_along_axes(e, x, y, z, direction), turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    k = (code - ABOUT) % 3
    if code < TWIST:
        return _about(turn, e, k, direction)
    after, last = (k + 1) % 3, (k + 2) % 3
    if code >= SWING:
        copy_vector(e[:, after], direction)
        across = np.zeros(3)
        across[after], across[last] = -turn[last, k], turn[after, k]
        return atan2(_along_axes(e, across[0], across[1], across[2], direction), turn[k, k])
    # TWIST: torque along (e_k + f_k) / (1 + e_k . f_k), which grows without bound as f_k turns to -e_k.
    share = 1.0 / max(1.0 + turn[k, k], TINY)
    for r in range(3):
        direction[r] = share * (e[r, k] + f[r, k])
    angle = atan2(turn[last, after] - turn[after, last], turn[after, after] + turn[last, last])
    # Counted through full turns.
    return angle + 2.0 * pi * np.rint((near - angle) / (2.0 * pi))


@jit_making_arrays
def _measure(code, d, e, f, near, direction):
    return _linear(code, d, e, direction) if is_linear(code) else _angular(code, e, f, near, direction)


@jit
def is_linear(code):
    """Whether a coordinate is a length, and its row a force."""
    return code < ABOUT


@jit
def add_forces(joints, which, impulse, direction, share, total):
    """Add a share of the rows' impulses or forces (s,), along their directions (s, 3), to those of the joints on b, total (j, 3)."""
    i = 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            if is_linear(joints.coordinate[k]):
                for r in range(3):
                    total[j, r] += share * impulse[i] * direction[i, r]
            i += 1


@jit_making_arrays
def joint_values(joints, which, position, rotation, angle, value):
    """Fill value with coordinate - target of the rows of the joints listed in `which`; angle (k,): last coordinates."""
    pa, pb, d, direction = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    e, f = np.empty((3, 3)), np.empty((3, 3))
    i = 0
    for j in which:
        _carry(joints, j, 0, position, rotation, pa, e)
        _carry(joints, j, 1, position, rotation, pb, f)
        for c in range(3):
            d[c] = pb[c] - pa[c]
        for k in range(joints.first[j], joints.first[j + 1]):
            value[i] = _measure(joints.coordinate[k], d, e, f, angle[k], direction) - joints.target[k]
            i += 1


@jit
def _write_angular(bodies, number, a, b, direction, rows, i):
    x, y, z = direction[0], direction[1], direction[2]
    if a >= 0 and bodies.inv_mass[a] > 0.0:
        rows.first[i] = number[a]
        write_body(bodies, a, rows.jacobian[i, :6], (0.0, 0.0, 0.0), (-x, -y, -z))
    if b >= 0 and bodies.inv_mass[b] > 0.0:
        rows.second[i] = number[b]
        write_body(bodies, b, rows.jacobian[i, 6:], (0.0, 0.0, 0.0), (x, y, z))


@jit_making_arrays
def joint_rows(island, rows, start, value, direction):
    """Fill rows from `start` on with those of the joints of a `JointedIsland`, in the present pose.

    value (s,) gets coordinate - target of the s rows, and direction (s, 3) their directions. The remembered coordinates are updated.
    Bounds of impulses are left as they are. Returns the number of rows filled.
    """
    joints, bodies, rotation, number, angle = island.joints, island.bodies, island.rotation, island.number, island.memory.angle
    pa, pb, d, ra, rb = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    e, f = np.empty((3, 3)), np.empty((3, 3))
    i = np.int64(0)
    for j in island.which:
        _carry(joints, j, 0, bodies.position, rotation, pa, e)
        _carry(joints, j, 1, bodies.position, rotation, pb, f)
        for c in range(3):
            d[c] = pb[c] - pa[c]
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
                write_row(bodies, number, (a, b), (ra, rb), (way[0], way[1], way[2]), rows, start + i)
            else:
                _write_angular(bodies, number, a, b, way, rows, start + i)
            one_sided = joints.lower[k] > -np.inf or joints.upper[k] < np.inf
            rows.kind[start + i] = BOUNDED if one_sided else FREE
            i += 1
    return i


@jit_making_arrays
def relative_point_velocity(island, direction, u):
    """Write the rates u (s,) of the coordinates of a `JointedIsland` at the present velocities."""
    joints, bodies, rotation = island.joints, island.bodies, island.rotation
    pa, pb = np.empty(3), np.empty(3)
    e, f, v = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    i = 0
    for j in island.which:
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
