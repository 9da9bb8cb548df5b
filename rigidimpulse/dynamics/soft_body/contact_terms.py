"""Contacts of soft bodies as terms of the incremental potential: the method of multipliers.

A contact joins a point of a soft body, y = sum of w_k x_k over up to three vertices, with a point of a rigid body. With q = (X, Theta) the
displacement of the body by the soft body over the step and r the arm of the contact,

    u = y - a - (X + Theta x r)

is what is left to its aim a: u.n is the gap above the one wanted, u_t the slip over the step. With the force lambda of the last round,
the penalty rho and the radius of Coulomb's disk R = mu lambda_n of the last round, the force on the soft body is

    f_n = max(0, lambda_n - rho u.n),    f_t = lambda_t - rho u_t, cut to the length R

or lambda - rho u without bounds where a vertex is fastened to a body. f = -dpsi/du of a convex potential psi; rounds that set lambda = f
end where f_n >= 0, u.n >= 0, f_n u.n = 0 and |f_t| <= mu f_n, along the slip where there is any: Signorini's and Coulomb's laws.
Source: Alart, Curnier 1991; the fixed radius of a round: Haslinger 1983.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import along, cross, dot, row, subtract


class SoftContacts(NamedTuple):
    """m contacts of soft bodies with rigid bodies."""

    node: np.ndarray  # (m, 3) vertices; the first again where there are fewer
    weight: np.ndarray  # (m, 3)
    body: np.ndarray  # (m,) index of the rigid body
    unknown: np.ndarray  # (m,) place of the body among the unknowns, -1 where it is immovable
    arm: np.ndarray  # (m, 3) m, from its centre of mass at the end of the step
    normal: np.ndarray  # (m, 3) from the body to the soft body
    aim: np.ndarray  # (m, 3) m
    friction: np.ndarray  # (m,) mu
    penalty: np.ndarray  # (m,) N/m
    force: np.ndarray  # (m, 3) N, lambda
    radius: np.ndarray  # (m,) N, R
    fastened: np.ndarray  # (m,) bool
    key: np.ndarray  # (m,) names the contact from step to step


@jit
def miss(z, num_nodes, contacts, c):
    """Return u of contact c; z (n + 2 r, 3): vertices, then X and Theta of each rigid body among the unknowns."""
    u = (-contacts.aim[c, 0], -contacts.aim[c, 1], -contacts.aim[c, 2])
    for k in range(3):
        u = along(u, contacts.weight[c, k], row(z, contacts.node[c, k]))
    body = contacts.unknown[c]
    if body >= 0:
        at = num_nodes + 2 * body
        u = subtract(u, row(z, at))
        u = subtract(u, cross(row(z, at + 1), row(contacts.arm, c)))
    return u


@jit
def force_of(contacts, c, u):
    """Return f and psi of contact c at u."""
    rho = contacts.penalty[c]
    trial = along(row(contacts.force, c), -rho, u)
    if contacts.fastened[c]:
        return trial, 0.5 * dot(trial, trial) / rho
    normal = row(contacts.normal, c)
    pressing = dot(trial, normal)
    tangent = along(trial, -pressing, normal)
    # Contacts push only.
    pressing = max(0.0, pressing)
    energy = 0.5 * pressing * pressing / rho
    length, radius = sqrt(dot(tangent, tangent)), contacts.radius[c]
    if length <= radius:
        energy += 0.5 * length * length / rho
        share = 1.0
    else:
        # Slip: the force is on the cone, and the energy grows in proportion to the way.
        energy += (radius * length - 0.5 * radius * radius) / rho
        share = radius / length
    force = (pressing * normal[0], pressing * normal[1], pressing * normal[2])
    return along(force, share, tangent), energy


@jit
def contact_energy(z, num_nodes, contacts):
    """Return the sum of psi."""
    energy = 0.0
    for c in range(contacts.body.shape[0]):
        energy += force_of(contacts, c, miss(z, num_nodes, contacts, c))[1]
    return energy


@jit
def contact_forces(z, num_nodes, contacts, force):
    """Write f (m, 3)."""
    for c in range(contacts.body.shape[0]):
        f = force_of(contacts, c, miss(z, num_nodes, contacts, c))[0]
        for k in range(3):
            force[c, k] = f[k]


@jit
def add_contact_gradient(num_nodes, contacts, force, gradient):
    """Add the derivatives of the sum of psi, for forces (m, 3), to gradient (n + 2 r, 3)."""
    for c in range(contacts.body.shape[0]):
        f = row(force, c)
        add_to_ends(num_nodes, contacts, c, (-f[0], -f[1], -f[2]), gradient)


@jit
def add_to_ends(num_nodes, contacts, c, v, total):
    """Add (du/dz)^T v of contact c to total (n + 2 r, 3)."""
    body = contacts.unknown[c]
    moment = cross(row(contacts.arm, c), v)
    for k in range(3):
        for p in range(3):
            total[contacts.node[c, p], k] += contacts.weight[c, p] * v[k]
        if body >= 0:
            total[num_nodes + 2 * body, k] -= v[k]
            total[num_nodes + 2 * body + 1, k] -= moment[k]


@jit
def contact_stiffness(z, num_nodes, contacts, D):
    """Write the second derivatives D (m, 3, 3) of psi by u."""
    for c in range(contacts.body.shape[0]):
        rho = contacts.penalty[c]
        D[c] = 0.0
        if contacts.fastened[c]:
            for k in range(3):
                D[c, k, k] = rho
            continue
        normal = row(contacts.normal, c)
        trial = along(row(contacts.force, c), -rho, miss(z, num_nodes, contacts, c))
        pressing = dot(trial, normal)
        tangent = along(trial, -pressing, normal)
        length, radius = sqrt(dot(tangent, tangent)), contacts.radius[c]
        along_normal = rho if pressing > 0.0 else 0.0
        # On the cone the force turns with the slip but does not grow.
        across = rho if length <= radius else rho * radius / length
        slip = 0.0 if length <= radius else across / (length * length)
        for p in range(3):
            D[c, p, p] += across
            for q in range(3):
                D[c, p, q] += (along_normal - across) * normal[p] * normal[q] - slip * tangent[p] * tangent[q]
