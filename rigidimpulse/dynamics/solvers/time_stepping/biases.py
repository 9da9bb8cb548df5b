"""What the rows of a jointed island ask for in a sub-step h: u is the rate of a row before impulses act, u' = u + W p the one after.

    contact, s > 0           u'_n >= -s / h                      free to close the gap, no further
             -skin <= s <= 0 u'_n >= 0                           held where it is
             s < -skin       u'_n >= PUSH min(-s - skin, skin) / h
             it closes in h, -e u_n > sqrt(2 g skin):  u'_n >= -e u_n
    hard row of a joint      u' = -x / h                         x: coordinate less target; what is left is closed by `flight`
    limit not reached        u' >= -x / h                        (u' <= -x / h of an upper one)
    limit overrun            u' >= PUSH |x| / h
    soft row, drive          p = -g (k x + c (u' - r))              where k W h^2 < SLOW, g: half of this sub-step and of the one before
                             p = -h (k (x + h u') + c (u' - r))     elsewhere, g = h

The soft row is explicit in x where its own oscillation is well resolved, so that it keeps its energy, and implicit where it is not, so that
any stiffness is stable. Explicit springs pull for half of a sub-step at each of its ends, as gravity does (Verlet). The pull at the end of
one and that at the start of the next are one impulse; at the end of a step the last half is given by itself. Without these halves the
energy at the end of steps was off by w h / 2. With d = g c, or h (h k + c), the row reads  u' + p / d = push / d;  where d = 0
the impulse is known. It is bounded by g times the greatest force: a motor whose bound was that of a whole sub-step lifted 1/16 more than
it can hold.
"""

from math import inf, sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.joint import joint_rows, relative_point_velocity
from rigidimpulse.dynamics.constraints.joint_limits import joint_weights, limit_side, spring_of
from rigidimpulse.dynamics.constraints.rows import BOUNDED, row_velocities, rows_of

PUSH = 0.2
"""Part of what is too deep that is put right in a sub-step."""
SLOW = 0.25
TINY = TOLERANCES.arithmetic.least_divisor


@jit_making_arrays
def fill_contact_biases(now, contacts, of_contacts, skins, pull, h):
    """Write b of the rows of contacts; skins (m,) m; pull: strength of gravity, m/s2. Returns the velocities u (m, 3) along the frames."""
    rows, first_row = of_contacts.rows, of_contacts.first_row
    u, along = np.zeros(rows.bias.shape[0]), np.zeros((first_row.shape[0], 3))
    row_velocities(now, contacts, first_row, of_contacts.frames, u)
    for c in range(first_row.shape[0]):
        i, s, skin = first_row[c], contacts.gap[c], skins[c]
        for k in range(rows_of(rows, i)):
            rows.bias[i + k] = along[c, k] = u[i + k]
        rebound = -contacts.restitution[c] * u[i]
        if s + h * u[i] < 0.0 and rebound > sqrt(2.0 * pull * skin):
            rows.bias[i] -= rebound
        elif s > 0.0:
            rows.bias[i] += s / h
        elif s < -skin:
            rows.bias[i] -= PUSH * min(-s - skin, skin) / h
    return along


@jit_making_arrays
def fill_joint_biases(island, rows, start, h, before):
    """Fill the rows of joints from `start` on, with biases, bounds, softness and first impulses; remembers their coordinates.

    before: s, length of the sub-step before in the same step, 0 if this is the first. Returns their directions (s, 3).
    """
    joints, memory = island.joints, island.memory
    count = rows.bias.shape[0] - start
    value, direction, u, weight = np.empty(count), np.empty((count, 3)), np.empty(count), np.empty(count)
    joint_rows(island, rows, start, value, direction)
    relative_point_velocity(island, direction, u)
    joint_weights(joints, island.which, rows, start, weight)
    i = 0
    for j in island.which:
        for k in range(joints.first[j], joints.first[j + 1]):
            r, x, side = start + i, value[i], limit_side(joints, k)
            memory.start_value[k] = x
            rows.bias[r], rows.impulse[r] = u[i], memory.force[k] * h
            rows.lower[r], rows.upper[r] = joints.lower[k] * h, joints.upper[k] * h
            slack = side * x > 0.0
            if joints.stiffness[k] == inf:
                rows.bias[r] += x / h if side == 0.0 or slack else PUSH * x / h
            elif side != 0.0 and slack:
                rows.lower[r] = rows.upper[r] = rows.impulse[r] = 0.0
            else:
                stiffness, damping = spring_of(joints, k, weight[i])
                ahead, pulls = (0.0, 0.5 * (h + before)) if _is_explicit(stiffness, weight[i], h) else (h, h)
                _soften(rows, r, (stiffness, damping, joints.rate[k]), x, (joints.lower[k], joints.upper[k]), ahead, pulls)
            i += 1
    return direction


@jit
def _is_explicit(stiffness, weight, h):
    """Whether the oscillation of a spring is well resolved by sub-steps of h s."""
    return stiffness * weight * h * h < SLOW


@jit
def _soften(rows, r, spring, x, bounds, ahead, pulls):
    """Let row r be the spring (stiffness, damping, rate) at the coordinate x, with bounds of its force: it pulls for `pulls` s.

    ahead: s, from x on to where it pulls, 0 for an explicit one.
    """
    (stiffness, damping, rate), (lower, upper) = spring, bounds
    d, force = pulls * (ahead * stiffness + damping), damping * rate - stiffness * x
    if d <= TINY:
        rows.impulse[r] = pulls * min(max(force, lower), upper)
        rows.lower[r] = rows.upper[r] = rows.impulse[r]
        # It is not FREE, or solvers that eliminate such rows would take it for a hard one.
        rows.kind[r] = BOUNDED
        return
    rows.lower[r], rows.upper[r] = pulls * lower, pulls * upper
    rows.softness[r] = 1.0 / d
    rows.bias[r] -= pulls * force / d


@jit_making_arrays
def fill_still_biases(island, contacts, of_contacts, start, before):
    """Write the biases that make the rates of joints and of closed contacts vanish: at the end of a step, where nothing moves on.

    Limits that are not reached, and contacts with a gap, carry nothing; explicit springs pull for half of the last sub-step, `before` s.
    Returns the directions of the joints' rows (s, 3).
    """
    joints, rows, first_row = island.joints, of_contacts.rows, of_contacts.first_row
    count = rows.bias.shape[0] - start
    value, direction, u, weight = np.empty(count), np.empty((count, 3)), np.zeros(rows.bias.shape[0]), np.empty(count)
    joint_rows(island, rows, start, value, direction)
    joint_weights(joints, island.which, rows, start, weight)
    relative_point_velocity(island, direction, u[start:])
    row_velocities(island.bodies, contacts, first_row, of_contacts.frames, u)
    for i in range(u.shape[0]):
        rows.bias[i] = u[i]
    for c in range(first_row.shape[0]):
        if contacts.gap[c] > 0.0:
            rows.upper[first_row[c]] = 0.0
    i = 0
    for j in island.which:
        for k in range(joints.first[j], joints.first[j + 1]):
            r, side = start + i, limit_side(joints, k)
            rows.lower[r], rows.upper[r] = joints.lower[k], joints.upper[k]
            if side * value[i] > 0.0:
                rows.lower[r] = rows.upper[r] = 0.0
            elif joints.stiffness[k] < inf:
                stiffness, damping = spring_of(joints, k, weight[i])
                pulls = 0.5 * before if _is_explicit(stiffness, weight[i], before) else 0.0
                _soften(rows, r, (stiffness, damping, joints.rate[k]), value[i], (joints.lower[k], joints.upper[k]), 0.0, pulls)
            i += 1
    return direction
