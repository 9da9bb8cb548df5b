"""Trajectories of the members of sub-stepped islands: how they end and begin (kernels)."""

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.quaternion import product, quaternion_to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.motion.trajectory import FREE, LENGTH, LINEAR, SPEEDS, begin, begin_straight, stepped_at

TURN = 2.5
"""Angle by which a body may turn in one trajectory, rad."""
SPAN = 1.0
"""Longest time that is stepped at once, in sqrt(r / g) of the smallest inner radius r."""
MOST_PIECES = 4
"""Parts of what is stepped at once, between which trajectories begin again."""
EVEN = TOLERANCES.sub_stepping.even_path


@jit
def end_trajectories(trajectory, members, time, steady, bodies, rotation, acceleration, angular_acceleration):
    """End the trajectories of members at `time`, bring them there, and let them go straight on; steady (n, 3) m/s2 is what pulls them."""
    for i in members:
        place, q, v, w = stepped_at(trajectory, i, time)
        # Inverse inertia in world axes: R diag(1 / I) R^T.
        x, y, z = 1.0 / trajectory.inertia[i, 0], 1.0 / trajectory.inertia[i, 1], 1.0 / trajectory.inertia[i, 2]
        quaternion_to_matrix(q, rotation[i])
        for c in range(3):
            for d in range(3):
                bodies.inv_inertia[i, c, d] = (
                    x * rotation[i, c, 0] * rotation[i, d, 0] + y * rotation[i, c, 1] * rotation[i, d, 1]
                    + z * rotation[i, c, 2] * rotation[i, d, 2]
                )
        trajectory.start[i], trajectory.top[i, LENGTH] = time, 1.0
        bodies.position[i, 0], bodies.position[i, 1], bodies.position[i, 2] = place
        bodies.orientation[i, 0], bodies.orientation[i, 1], bodies.orientation[i, 2], bodies.orientation[i, 3] = q
        bodies.velocity[i, 0], bodies.velocity[i, 1], bodies.velocity[i, 2] = v
        bodies.angular_velocity[i, 0], bodies.angular_velocity[i, 1], bodies.angular_velocity[i, 2] = w
        for c in range(4):
            trajectory.orientation[i, c] = bodies.orientation[i, c]
        for c in range(3):
            trajectory.position[i, c] = bodies.position[i, c]
            trajectory.velocity[i, c] = trajectory.top[i, SPEEDS + c] = bodies.velocity[i, c]
            trajectory.angular_velocity[i, c] = trajectory.top[i, SPEEDS + 3 + c] = bodies.angular_velocity[i, c]
            trajectory.top[i, SPEEDS + 6 + c] = trajectory.top[i, SPEEDS + 9 + c] = trajectory.acceleration[i, c] = 0.0
            acceleration[i, c], angular_acceleration[i, c] = steady[i, c], 0.0
        begin_straight(trajectory, i)


@jit
def let_fly(trajectory, members, steady):
    """Let members that have arrived fly freely from where they are."""
    for i in members:
        trajectory.mode[i] = FREE
        for c in range(3):
            trajectory.acceleration[i, c] = steady[i, c]
        begin(trajectory, i)


@inlined
def is_slow(bodies, i, inner, limits):
    """Whether body i moves no farther than limits[0] 1/s of its inner radius, m, and spins no faster than limits[1] rad/s."""
    speed, spin = 0.0, 0.0
    for c in range(3):
        speed += bodies.velocity[i, c] ** 2
        spin += bodies.angular_velocity[i, c] ** 2
    return np.sqrt(speed) <= limits[0] * inner and np.sqrt(spin) <= limits[1]


@jit
def mark_slow(bodies, inner, limits, member):
    """Unmark members (n,) that are not slow; limits: see `is_slow`."""
    for i in range(member.shape[0]):
        member[i] = member[i] and is_slow(bodies, i, inner[i], limits)


class Ends(NamedTuple):
    """What says when trajectories of n bodies end."""

    inner: np.ndarray  # (n,) m
    strength: np.ndarray  # (n,) m/s2, of what pulls them
    reach: np.ndarray  # (n,) m
    skin: np.ndarray  # (n,) m
    all_stray: bool  # whether contacts are taken to act on all


@jit
def most_stray(bodies, members, ends, pressed, allowed):
    """Largest w / TURN of the members, and w sqrt(r / (8 d)) of those that contacts act on, 1/s; d: `allowed` skins.

    The centre of a body that rolls over a point at r strays by d = r (w h)^2 / 8 from its straight way in h s.
    """
    most = 0.0
    for i in members:
        spin = 0.0
        for c in range(3):
            spin += bodies.angular_velocity[i, c] ** 2
        most = max(most, np.sqrt(spin) / TURN)
        if pressed[i] or ends.all_stray:
            most = max(most, np.sqrt(spin * ends.reach[i] / (8.0 * allowed * ends.skin[i])))
    return most


@jit
def end_of_piece(bodies, members, ends, pressed, at_once, span):
    """When trajectories of members that begin at span[0] end, s: at span[1], or before it if members are tiny or spin fast.

    ends: `Ends`; pressed: (n,) bool, bodies that contacts act on. at_once: s, that is stepped at once at most, and skins by which
    trajectories may stray from the ways of turning bodies. In what is stepped at once bodies may fall by half an inner radius.
    """
    step, allowed = at_once
    time, end = span
    strength, inner, spans = 0.0, np.inf, 1.0
    for i in members:
        strength, inner = max(strength, ends.strength[i]), min(inner, ends.inner[i])
    if strength > 0.0:
        spans = max(np.ceil(step / min(step, SPAN * np.sqrt(inner / strength)) - 1e-9), 1.0)
    wanted, most = np.ceil(most_stray(bodies, members, ends, pressed, allowed) * step), MOST_PIECES * spans
    # Spins may be no numbers: the end of the step finds them.
    pieces = max(wanted if wanted < most else most, spans)
    left = max(np.ceil((end - time) * pieces / step - 1e-6), 1.0)
    return end if left == 1.0 else time + (end - time) / left


@jit
def stray_of(members, spin, pairs, order, straightness, near):
    """The same of members (k,) that turn by spin (k, 3) rad/s, and may be acted on where they are in pairs, of ranks; order (n,) by rank.

    straightness: reach, skin (n,) m and `allowed`, as above. near (n,) bool is scratch.
    """
    most, (reach, skin, allowed) = 0.0, straightness
    for i in range(near.shape[0]):
        near[i] = False
    for p in range(pairs.first.shape[0]):
        near[order[pairs.first[p]]] = near[order[pairs.second[p]]] = True
    for k in range(members.shape[0]):
        i, w = members[k], spin[k]
        size = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        most = max(most, size / TURN)
        if near[i]:
            most = max(most, size * np.sqrt(reach[i] / (8.0 * allowed * skin[i])))
    return most


@jit
def depart(trajectory, members, time, length, bodies, position, orientation, velocity):
    """Trajectories from the present poses to the given ones (k, 3), (k, 4), where the velocities are (k, 6).

    They are straight, and parabolas for bodies that fly freely: the velocities of those agree with where they come.
    """
    for k in range(members.shape[0]):
        i = members[k]
        a0, a1, a2, a3 = bodies.orientation[i, 0], bodies.orientation[i, 1], bodies.orientation[i, 2], bodies.orientation[i, 3]
        q0, q1, q2, q3 = product(orientation[k, 0], orientation[k, 1], orientation[k, 2], orientation[k, 3], a0, -a1, -a2, -a3)
        # The shorter turn.
        if q0 < 0.0:
            q0, q1, q2, q3 = -q0, -q1, -q2, -q3
        sine = np.sqrt(q1 * q1 + q2 * q2 + q3 * q3)
        factor = 2.0 * np.arctan2(sine, q0) / (sine * length) if sine > 0.0 else 0.0
        missed, way = 0.0, 0.0
        for c in range(3):
            first, last = bodies.velocity[i, c], velocity[k, c]
            # Whether the way agrees with the mean of the velocities: then it is a parabola.
            missed += np.abs(position[k, c] - bodies.position[i, c] - 0.5 * length * (first + last))
            way += 0.5 * length * (np.abs(first) + np.abs(last))
        trajectory.start[i], trajectory.mode[i] = time, LINEAR
        trajectory.angular_velocity[i, 0] = factor * q1
        trajectory.angular_velocity[i, 1] = factor * q2
        trajectory.angular_velocity[i, 2] = factor * q3
        for c in range(3):
            trajectory.position[i, c] = bodies.position[i, c]
            # Else the path is straight, since contacts moved the body otherwise than its velocities say.
            pull = (velocity[k, c] - bodies.velocity[i, c]) / length if missed <= EVEN * way else 0.0
            trajectory.velocity[i, c] = (position[k, c] - bodies.position[i, c]) / length - 0.5 * length * pull
            trajectory.acceleration[i, c], trajectory.torque[i, c] = pull, 0.0
            trajectory.top[i, SPEEDS + c], trajectory.top[i, SPEEDS + 3 + c] = bodies.velocity[i, c], bodies.angular_velocity[i, c]
            trajectory.top[i, SPEEDS + 6 + c] = velocity[k, c] - bodies.velocity[i, c]
            trajectory.top[i, SPEEDS + 9 + c] = velocity[k, 3 + c] - bodies.angular_velocity[i, c]
        for c in range(4):
            trajectory.orientation[i, c] = bodies.orientation[i, c]
        trajectory.top[i, LENGTH] = length
        begin_straight(trajectory, i)
