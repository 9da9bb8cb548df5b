"""How the bodies of a jointed island move in a sub-step h, and how the joints close at its end.

    kick    v <- v + h/2 g,   w <- w + h/2 I^-1 tau                   before and after the rows are solved; tau: torque of forces
    fly     x_1 = x_0 + h v,   q_1 by the free rotation from q_0     which keeps the angular momentum
    close   while |C(x_1)| > allowed:   v <- v + M^-1 J_0^T p,   J_0 M^-1 J_0^T p = -C(x_1) / h,   fly again

Impulses that close the joints act along the rows of the start (SHAKE: Ryckaert, Ciccotti, Berendsen 1977), which makes the map symplectic
where nothing else acts. A joint force F at the arm r turns its body like a spring of F r. Explicit steps bear h^2 F r below about 2 I. So
a body is given the moments of inertia

    I' = max(I, STIFFEN h^2 sum F r)

in all rows, with the forces of the last sub-step. I' falls by no more than FORGET of itself in a sub-step, or a blow would find the body
soft. Free rotation keeps the true I.

Source of the stiffening: Andrews, Teichmann, Kry, Geometric stiffness for real-time constrained multibody dynamics, 2017.
"""

from math import sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.core.vector import turned
from rigidimpulse.dynamics.constraints.joint import joint_values
from rigidimpulse.dynamics.constraints.jointed_island import count_joint_rows
from rigidimpulse.dynamics.constraints.rows import change_velocities, take_rows
from rigidimpulse.dynamics.solvers.free_rows import count_free, factor_free, give, take_free
from rigidimpulse.dynamics.solvers.tgs_soft.body_motion import is_twisted, set_orientation, turn_freely

STIFFEN, FORGET = 1.0, 0.1
MOST_ROUNDS = 6
"""Rounds of closing."""


@jit
def kick(bodies, now, members, h):
    """Let gravity and the torque of forces act on the members for h s."""
    for i in members:
        for k in range(3):
            now.velocity[i, k] += h * bodies.gravity[i, k]
        if is_twisted(bodies, i):
            x, y, z = turned(now.inv_inertia[i], bodies.torque[i])
            t, w = bodies.torque[i], now.angular_velocity[i]
            bodies.work[i] += h * (t[0] * (w[0] + 0.5 * h * x) + t[1] * (w[1] + 0.5 * h * y) + t[2] * (w[2] + 0.5 * h * z))
            w[0] += h * x
            w[1] += h * y
            w[2] += h * z


@jit
def set_inertia(bodies, now, members, stiffening):
    """Write the inverse inertia of the members, with what stiffening (n,) kg m2 adds, in world axes."""
    for i in members:
        r, least = bodies.rotation[i], stiffening[i]
        a, b, c = 1.0 / max(bodies.inertia[i, 0], least), 1.0 / max(bodies.inertia[i, 1], least), 1.0 / max(bodies.inertia[i, 2], least)
        for k in range(3):
            for j in range(3):
                now.inv_inertia[i, k, j] = a * r[k, 0] * r[j, 0] + b * r[k, 1] * r[j, 1] + c * r[k, 2] * r[j, 2]


@jit_making_arrays
def stiffen(island, stiffening, moment, h):
    """Update stiffening (n,) by the impulses (j, 3) of the joints over a sub-step of h s."""
    joints, wanted = island.joints, np.zeros(stiffening.shape[0])
    for j in island.which:
        pull = sqrt(moment[j, 0] ** 2 + moment[j, 1] ** 2 + moment[j, 2] ** 2)
        for i, anchor in ((joints.body_a[j], joints.anchor_a[j]), (joints.body_b[j], joints.anchor_b[j])):
            if i >= 0:
                arm = sqrt(anchor[0] ** 2 + anchor[1] ** 2 + anchor[2] ** 2)
                wanted[i] += STIFFEN * h * pull * arm
    for i in island.members:
        stiffening[i] = max(wanted[i], (1.0 - FORGET) * stiffening[i])


@jit
def fly(bodies, now, members, begin, landed, h):
    """Move the members from begin (n, 7) over h s by their velocities; landed (n, 3): their spins there, rad/s."""
    for i in members:
        for k in range(3):
            bodies.position[i, k] = begin[i, k] + h * now.velocity[i, k]
        for k in range(4):
            bodies.orientation[i, k] = begin[i, 3 + k]
        quaternion_to_matrix(bodies.orientation[i], bodies.rotation[i])
        w = now.angular_velocity[i]
        if bodies.alike[i]:
            set_orientation(bodies, i, h * w[0], h * w[1], h * w[2])
            for k in range(3):
                landed[i, k] = w[k]
            continue
        for k in range(3):
            bodies.velocity[8 * i + 3 + k] = w[k]
        turn_freely(bodies, i, h)
        for k in range(3):
            landed[i, k] = bodies.velocity[8 * i + 3 + k]


@jit
def carry_supports(bodies, now, supports, h):
    """Move what the island leans on and hangs from along its own path."""
    for i in supports:
        v, w = now.velocity[i], now.angular_velocity[i]
        for k in range(3):
            bodies.position[i, k] += h * v[k]
        set_orientation(bodies, i, h * w[0], h * w[1], h * w[2])


@jit_making_arrays
def hard_rows(joints, which, start):
    """Places, from `start` on, of the rows of joints that are hard and have no bounds."""
    found, i, m = np.empty(joints.coordinate.shape[0], np.int64), start, 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            if joints.stiffness[k] == np.inf and joints.lower[k] == -np.inf and joints.upper[k] == np.inf:
                found[m] = i
                m += 1
            i += 1
    return found[:m]


@jit_making_arrays
def fly_and_close(island, bodies, rows, free, flight, h):
    """Fly, and change velocities and impulses until the hard rows are closed; returns what is left, m or rad.

    rows: of the island at the start of the sub-step, those of its joints at the end; free: `FreeRows` of them. flight: begin and landed,
    see `fly`.
    """
    joints, which, now, members = island.joints, island.which, island.bodies, island.members
    value, (begin, landed) = np.empty(count_joint_rows(joints, which)), flight
    start = rows.bias.shape[0] - value.shape[0]
    hard, worst = hard_rows(joints, which, start), 0.0
    closing = take_rows(rows, hard)
    # Springs without bounds are FREE, too, and have no place in closing.
    alone = take_free(free, hard) if hard.shape[0] == count_free(rows) else factor_free(closing, members.shape[0])
    y, change = np.empty((members.shape[0], 6)), np.empty(hard.shape[0])
    for round_ in range(MOST_ROUNDS):
        fly(bodies, now, members, begin, landed, h)
        joint_values(joints, which, bodies.position, bodies.rotation, island.memory.angle, value)
        worst = 0.0
        for c in range(hard.shape[0]):
            x = value[hard[c] - start]
            worst = max(worst, abs(x)) if np.isfinite(x) else np.inf
            closing.bias[c], closing.impulse[c] = x / h, 0.0
        if worst <= island.allowed or round_ == MOST_ROUNDS - 1 or not np.isfinite(worst):
            break
        give(closing, alone, closing.bias, change, y)
        change_velocities(now, members, closing)
        for c in range(hard.shape[0]):
            rows.impulse[hard[c]] += closing.impulse[c]
    return worst
