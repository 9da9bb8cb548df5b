"""The state of bodies at one instant of their trajectories: pose, velocities, inverse inertia, accelerations (kernels).

With R the rotation matrix of a body and I its principal moments, the inverse inertia in world axes is R diag(1 / I) R^T. Euler's equation
gives the angular acceleration I^-1 (torque - w x (I w)).
"""

import numpy as np

from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.motion.trajectory import FIXED, JERK, PRESCRIBED, TORQUE_RATE, rate_of, row_at, state_at


@jit
def world_inverse_inertia(r, inertia, out):
    """R diag(1 / I) R^T."""
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                r[i, 0] * r[j, 0] / inertia[0] + r[i, 1] * r[j, 1] / inertia[1] + r[i, 2] * r[j, 2] / inertia[2]
            )


@jit_making_arrays
def gyroscopic_acceleration(r, inertia, w, torque, out):
    """I^-1 (torque - w x (I w)), world frame."""
    x = np.empty(3)
    t = np.empty(3)
    for k in range(3):
        x[k] = r[0, k] * w[0] + r[1, k] * w[1] + r[2, k] * w[2]
        t[k] = r[0, k] * torque[0] + r[1, k] * torque[1] + r[2, k] * torque[2]
    a0 = (t[0] + (inertia[1] - inertia[2]) * x[1] * x[2]) / inertia[0]
    a1 = (t[1] + (inertia[2] - inertia[0]) * x[2] * x[0]) / inertia[1]
    a2 = (t[2] + (inertia[0] - inertia[1]) * x[0] * x[1]) / inertia[2]
    for k in range(3):
        out[k] = r[k, 0] * a0 + r[k, 1] * a1 + r[k, 2] * a2


@inlined
def bring(trajectory, i, time, bodies, rotation, acceleration, angular_acceleration):
    """Bring body i to `time`: pose, velocities, inverse inertia and its present accelerations."""
    state_at(trajectory, i, time, bodies.position[i], bodies.orientation[i], bodies.velocity[i], bodies.angular_velocity[i])
    quaternion_to_matrix(bodies.orientation[i], rotation[i])
    if bodies.inv_mass[i] > 0.0:
        world_inverse_inertia(rotation[i], trajectory.inertia[i], bodies.inv_inertia[i])
    for k in range(3):
        acceleration[i, k] = 0.0
        angular_acceleration[i, k] = 0.0
    if trajectory.mode[i] == FIXED or (bodies.inv_mass[i] == 0.0 and trajectory.mode[i] != PRESCRIBED):
        return
    s = time - trajectory.start[i]
    acceleration[i, 0], acceleration[i, 1], acceleration[i, 2] = row_at(trajectory.acceleration, i, rate_of(trajectory, i, JERK), s)
    if bodies.inv_mass[i] > 0.0:
        # The angular acceleration of the trajectory's load at this instant, with the gyroscopic term.
        torque = row_at(trajectory.torque, i, rate_of(trajectory, i, TORQUE_RATE), s)
        gyroscopic_acceleration(rotation[i], trajectory.inertia[i], bodies.angular_velocity[i], torque, angular_acceleration[i])


@jit
def bring_all(trajectory, members, time, bodies, rotation, acceleration, angular_acceleration):
    """The same for each of the members."""
    for i in members:
        bring(trajectory, i, time, bodies, rotation, acceleration, angular_acceleration)


@jit
def bring_gyroscopic(members, bodies, rotation, inertia, angular_acceleration):
    """Angular accelerations of torque-free bodies at their present spins."""
    for i in members:
        gyroscopic_acceleration(rotation[i], inertia[i], bodies.angular_velocity[i], (0.0, 0.0, 0.0), angular_acceleration[i])


@jit
def refresh_pose(members, bodies, rotation, inertia):
    """Rotation matrix and inverse inertia after a change of orientation."""
    for i in members:
        quaternion_to_matrix(bodies.orientation[i], rotation[i])
        world_inverse_inertia(rotation[i], inertia[i], bodies.inv_inertia[i])
