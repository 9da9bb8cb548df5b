"""The bodies of the sub-stepped solver: masses, poses and velocities, by rank (see `collision.contact_records`).

What changes in a sub-step lies in flat arrays of 8 numbers for each body, one line of a SIMD vector: velocity (v, w), moved and drift
(displacement and rotation vector), mass (inverse inertia xx, xy, xz, yy, yz, zz in world axes, and 1/m). The inverse inertia in world
axes is  R diag(1 / I) R^T,  with R the rotation and I the principal moments.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_records import INVERSE_MASS, MEMBER, OUTSIDE
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix


class SolverBodies(NamedTuple):
    """n bodies by rank, and one entry that is no body, for lanes of a SIMD vector without work."""

    shape: np.ndarray  # (n+1,)
    material: np.ndarray  # (n+1,)
    inertia: np.ndarray  # (n+1, 3) principal
    alike: np.ndarray  # (n+1,) bool, all moments are equal: the inverse inertia does not depend on the rotation
    inner: np.ndarray  # (n+1,) m, distance from the centre of mass to the nearest face; inf for what cannot be moved
    skin: np.ndarray  # (n+1,) m, contact margin: gap at which contacts rest
    reach: np.ndarray  # (n+1,) m, radius about the centre of mass, 0 for balls, inf for half spaces
    radius: np.ndarray  # (n+1,) m, of the sphere about the centre of mass that holds the body
    part: np.ndarray  # (n+1,) OUTSIDE, MEMBER or SUPPORT
    position: np.ndarray  # (n+1, 3) m
    orientation: np.ndarray  # (n+1, 4)
    rotation: np.ndarray  # (n+1, 3, 3)
    gravity: np.ndarray  # (n+1, 3) m/s2, with forces
    torque: np.ndarray  # (n+1, 3) N m, of forces
    work: np.ndarray  # (n+1,) J, of that torque since the energy was last balanced
    velocity: np.ndarray  # (8 (n+1),) m/s and rad/s, world
    before: np.ndarray  # (8 (n+1),) the same before contacts acted in the sub-step
    moved: np.ndarray  # (8 (n+1),) m and rad, since contacts were last found
    drift: np.ndarray  # (8 (n+1),) the same since the batches of slow bodies were made
    quick: np.ndarray  # (n+1,) bool, its contacts are in none of those batches
    mass: np.ndarray  # (8 (n+1),)
    change: np.ndarray  # (n+1,) m/s, how much contacts may change its velocity until they are looked for again
    held: np.ndarray  # (n+1,) bool, it stops what meets it


@jit
def set_inverse_inertia(bodies, i):
    """Write the inverse inertia of body i, in world axes, to `mass`."""
    r, moments, m = bodies.rotation[i], bodies.inertia[i], 8 * i
    a, b, c = 1.0 / moments[0], 1.0 / moments[1], 1.0 / moments[2]
    bodies.mass[m] = a * r[0, 0] * r[0, 0] + b * r[0, 1] * r[0, 1] + c * r[0, 2] * r[0, 2]
    bodies.mass[m + 1] = a * r[0, 0] * r[1, 0] + b * r[0, 1] * r[1, 1] + c * r[0, 2] * r[1, 2]
    bodies.mass[m + 2] = a * r[0, 0] * r[2, 0] + b * r[0, 1] * r[2, 1] + c * r[0, 2] * r[2, 2]
    bodies.mass[m + 3] = a * r[1, 0] * r[1, 0] + b * r[1, 1] * r[1, 1] + c * r[1, 2] * r[1, 2]
    bodies.mass[m + 4] = a * r[1, 0] * r[2, 0] + b * r[1, 1] * r[2, 1] + c * r[1, 2] * r[2, 2]
    bodies.mass[m + 5] = a * r[2, 0] * r[2, 0] + b * r[2, 1] * r[2, 1] + c * r[2, 2] * r[2, 2]


@jit_making_arrays
def load_bodies(bodies, order, now, load, inv_mass, part):
    """Load the present state of the bodies that take part; part (n,) by index, order (n,) index by rank.

    load: accelerations (n, 3) m/s2 and torques (n, 3) N m of what acts on bodies beside contacts, by index.
    """
    acceleration, torque = load
    for k in range(order.shape[0]):
        i = order[k]
        bodies.part[k], bodies.quick[k] = part[i], True
        if part[i] == OUTSIDE:
            continue
        for c in range(3):
            bodies.position[k, c] = now.position[i, c]
            bodies.velocity[8 * k + c] = now.velocity[i, c]
            bodies.velocity[8 * k + 3 + c] = now.angular_velocity[i, c]
            bodies.gravity[k, c] = acceleration[i, c] if part[i] == MEMBER or inv_mass[i] == 0.0 else 0.0
            bodies.torque[k, c] = torque[i, c] if part[i] == MEMBER else 0.0
        for c in range(4):
            bodies.orientation[k, c] = now.orientation[i, c]
        for c in range(6):
            bodies.moved[8 * k + c] = bodies.drift[8 * k + c] = 0.0
        quaternion_to_matrix(bodies.orientation[k], bodies.rotation[k])
        if part[i] == MEMBER:
            bodies.mass[8 * k + INVERSE_MASS] = inv_mass[i]
            set_inverse_inertia(bodies, k)
        else:
            # Supports have no inverse mass: impulses do not move them.
            bodies.mass[8 * k : 8 * k + 8] = 0.0
