"""What a step of soft bodies must keep: momentum, angular momentum, and no energy out of nothing.

Momentum and angular momentum of every piece of a soft body that is not pinned to the world follow from what acted on it,

    P1 = P0 + h (M g + sum of f),    L1 = L0 + X0 x h M g + sum of (c + r) x h f

with c the place at which an impulse h f acts on the centre of the rigid body it comes from (see `lever_place`) and r the arm there. The
implicit Euler step keeps P to the solver's tolerance, and lets L of what turns decay by (h w)^2 a step; a rigid velocity added to
the piece sets both right. Energy: with grad Phi = 0 the step changes K + E by the work of outer forces and by

    G = E(x1) - E(x0) - grad E~(x1) . dx - sum of m |v1 - v0|^2 / 2 + ...    (implicit Euler; E~ with dampers)

which is never positive for a convex E, but may be where springs buckle. G is computed as it is, velocities set right included; where it
is positive as much is taken from the motion of each piece relative to its own rigid motion, which keeps P and L.
Source: correcting energy and momenta after an implicit step: Dinev, Liu, Li, Thomaszewski, Kavan 2018.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.portable import dot
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.scene.mass import principal_axes

LINE: float = 1e-12
"""Moment about a line, over the largest one, up to which points lie on it."""


def lever_place(position: np.ndarray, velocity: np.ndarray, end_position: np.ndarray, h: float) -> np.ndarray:
    """Places c (n, 3) m with x1 x p1 - x1' x p1' = c x J, for bodies that an impulse J moves by h J / m over a step of h s.

    position, velocity: at its start; end_position: without J, on a parabola. (x1 = x1' + h J / m, p1 = p1' + J; c = x1' - h v1'.)
    """
    return 2.0 * position - end_position + h * velocity


def rigid_motion(mass: np.ndarray, x: np.ndarray, momentum: np.ndarray, angular_momentum: np.ndarray) -> np.ndarray:
    """Velocities (k, 3) m/s of k points as of one rigid body with this momentum (3,) and angular momentum (3,) about the origin."""
    total = mass.sum()
    centre = dot(x.T, mass) / total
    arm = x - centre
    inertia = np.eye(3) * float(dot(mass, dot(arm, arm))) - np.einsum("i,ij,ik->jk", mass, arm, arm)
    moments, axes = principal_axes(inertia)
    # Points on a line have no inertia about it.
    inverse = np.divide(1.0, moments, out=np.zeros(3), where=moments > LINE * moments.max())
    spin = dot(axes, inverse * dot(axes.T, angular_momentum - cross_arrays(centre, momentum)))
    return momentum / total + cross_arrays(spin, arm)


def set_momenta(
    mass: np.ndarray, x: np.ndarray, velocity: np.ndarray, momentum: np.ndarray, angular_momentum: np.ndarray
) -> None:
    """Bring the momenta of points to the given ones, about the origin, by a rigid velocity, in place; twice, against round-off."""
    for _ in range(2):
        lacking = momentum - dot(velocity.T, mass)
        lacking_angular = angular_momentum - (mass[:, None] * cross_arrays(x, velocity)).sum(0)
        if np.any(lacking) or np.any(lacking_angular):
            velocity += rigid_motion(mass, x, lacking, lacking_angular)


def take_energy(mass: np.ndarray, x: np.ndarray, velocity: np.ndarray, pieces: list[np.ndarray], excess: float) -> float:
    """Take kinetic energy (J) from the motion of each piece relative to its rigid motion, in place; returns what could not be taken."""
    inner = []
    for piece in pieces:
        m, place, v = mass[piece], x[piece], velocity[piece]
        centre = dot(place.T, m) / m.sum()
        arm = place - centre
        rigid = rigid_motion(m, arm, dot(v.T, m), (m[:, None] * cross_arrays(arm, v)).sum(0))
        inner.append((piece, rigid, v - rigid, 0.5 * float(dot(m, dot(v - rigid, v - rigid)))))
    # The motion relative to the rigid one carries neither momentum nor angular momentum.
    there = sum(part[3] for part in inner)
    kept = np.sqrt(max(0.0, 1.0 - excess / there)) if there > 0.0 else 1.0
    for piece, rigid, relative, _ in inner:
        velocity[piece] = rigid + kept * relative
    return max(0.0, excess - there)
