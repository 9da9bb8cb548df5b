"""Limits of joints: when they are reached, when they let go, and what mass they feel.

A limit has the gap g = x - bound of a lower one, bound - x of an upper one. It is slack while g > 0 and carries nothing.
A sub-step ends where the first slack limit is reached: the path of g over it is taken for the parabola through g_0 with
the rate g_0' and g_1,

    g(t) = g_0 + g_0' t + (g_1 - g_0 - g_0' h) (t / h)^2,

and the sub-step is solved again up to its first root until no gap is closed on the way. There the bodies stop against
a hard limit, by an impulse without rebound. A soft limit, g <= 0, pushes with f = max(0, -k g - c g'); the sub-step ends
where the oscillator of `softness` has f = 0, so a soft limit is the damped oscillator from touch to touch and never pulls.

The mass of a row: W = J M^-1 J^T of the velocities that the joint's own hard rows allow, by orthogonal projection of Jh.
"""

from math import ceil, sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import copy_vector
from rigidimpulse.dynamics.constraints.softness import response

# Gaps that count as closed, and those that a slack limit may overrun, relative to the error at which joints are closed.
REACHED = 100.0
OVERRUN = 10.0
# A row that the joint's hard rows hold has no mass of its own; least W relative to that of the row alone.
LEAST_WEIGHT = TOLERANCES.joint.least_weight
# Steps of w t in which the release of a soft limit is looked for, most of them, and bisections.
SCAN = 0.5
MOST_SCANS = 1024
BISECTIONS = 60


@jit
def limit_side(joints, k):
    """1 of a lower limit, -1 of an upper one, 0 of what is no limit."""
    if joints.lower[k] == 0.0 and joints.upper[k] == np.inf:
        return 1.0
    return -1.0 if joints.upper[k] == 0.0 and joints.lower[k] == -np.inf else 0.0


@jit
def is_reached(joints, k, value, allowed):
    """Whether row k is a limit whose gap is closed; value: x - bound."""
    side = limit_side(joints, k)
    return side != 0.0 and side * value <= REACHED * allowed


@jit
def _remainder(line, basis, held, out):
    """The part of line (12,) across the first `held` vectors of basis, into out; returns its square."""
    copy_vector(line, out)
    # Twice, since one pass leaves the round-off of what it takes away.
    for _ in range(2):
        for b in range(held):
            along = 0.0
            for c in range(12):
                along += out[c] * basis[b, c]
            for c in range(12):
                out[c] -= along * basis[b, c]
    square = 0.0
    for c in range(12):
        square += out[c] * out[c]
    return square


@jit_making_arrays
def joint_weights(joints, which, rows, start, weight):
    """W of the soft rows of the joints listed in `which`, rows `start` and on; into weight (s,), 0 for hard ones."""
    basis, out = np.empty((6, 12)), np.empty(12)
    first = 0
    for j in which:
        held, count, soft = 0, joints.first[j + 1] - joints.first[j], False
        for i in range(count):
            weight[first + i], soft = 0.0, soft or joints.stiffness[joints.first[j] + i] < np.inf
        if not soft:
            first += count
            continue
        for i in range(count):
            k, line = joints.first[j] + i, rows.jacobian[start + first + i]
            # An orthonormal basis of the hard rows: soft rows and limits act on what these leave free.
            if joints.stiffness[k] == np.inf and limit_side(joints, k) == 0.0 and held < 6:
                square = _remainder(line, basis, held, out)
                if square > LEAST_WEIGHT * np.sum(line * line):
                    basis[held] = out / sqrt(square)
                    held += 1
        for i in range(count):
            line = rows.jacobian[start + first + i]
            if joints.stiffness[joints.first[j] + i] < np.inf:
                weight[first + i] = max(_remainder(line, basis, held, out), LEAST_WEIGHT * np.sum(line * line))
        first += count


@jit
def spring_of(joints, k, weight):
    """Stiffness and damping of a soft row that moves the mass 1 / weight."""
    share = 1.0 / max(weight, 1e-300) if joints.per_mass[k] else 1.0
    return share * joints.stiffness[k], share * joints.damping[k]


@jit
def _reach_time(gap, rate, end, h, overrun, most):
    """First root of the parabola of g over (0, most), most if there is none."""
    linear, bend = rate * h, end - gap - rate * h
    # The gap may close and open again within the sub-step.
    dips = bend > 0.0 and 0.0 < -linear < 2.0 * bend and gap - 0.25 * linear * linear / bend < -overrun
    if most == h and end >= -overrun and not dips:
        return h
    root = sqrt(max(linear * linear - 4.0 * bend * gap, 0.0))
    time = h * (2.0 * gap / (root - linear) if linear < 0.0 else -0.5 * (linear + root) / bend)
    # It is no number where the parabola has no root; comparisons with that are false.
    return time if 0.0 < time < most else most


@jit
def _pull(k, c, weight, x, u, a, t):
    """-k x - c x' at t of the oscillator with the acceleration a besides."""
    square, twice_s = k * weight, c * weight
    total, first, _ = response(square, twice_s, t)
    rate = -square * first * x + (1.0 - twice_s * first - square * total) * u + first * a
    return -k * ((1.0 - square * total) * x + first * u + total * a) - c * rate


@jit
def _release_time(k, c, weight, x, u, end, pressed, h):
    """When a soft limit with g = x <= 0, g' = u stops to push, h if it does not; end: g at h; pressed: whether it pushed on the way."""
    if not -k * x - c * u > 0.0:
        return h
    square = k * weight
    total, first, _ = response(square, c * weight, h)
    a = (end - (1.0 - square * total) * x - first * u) / total if pressed else 2.0 * (end - x - u * h) / (h * h)
    # A fast oscillator may let go and push again within h: the first sign change is looked for.
    count = min(ceil(h * sqrt(square) / SCAN) + 1, MOST_SCANS)
    late = 0.0
    for n in range(1, count + 1):
        early, late = late, h * n / count
        if _pull(k, c, weight, x, u, a, late) < 0.0:
            for _ in range(BISECTIONS):
                middle = 0.5 * (early + late)
                if _pull(k, c, weight, x, u, a, middle) < 0.0:
                    late = middle
                else:
                    early = middle
            return late
    return h


@jit
def next_switch(joints, which, memory, span, allowed):
    """Time at which the first limit of the joints listed in `which` is reached or lets go; memory: `JointMemory`, of a sub-step of h s.

    span: h, and the time up to which the path may go on as it does; that is returned where nothing switches.
    """
    h, time = span
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            side = limit_side(joints, k)
            if side == 0.0:
                continue
            gap, rate, end = side * memory.start_value[k], side * memory.start_rate[k], side * memory.end_value[k]
            if memory.slack[k]:
                time = min(time, _reach_time(gap, rate, end, h, OVERRUN * allowed, span[1]))
            elif joints.stiffness[k] < np.inf:
                stiffness, damping = spring_of(joints, k, memory.weight[k])
                time = min(time, _release_time(stiffness, damping, memory.weight[k], gap, rate, end, memory.active[k], h))
    return time
