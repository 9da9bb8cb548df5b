"""One implicit step of soft bodies and the rigid bodies they touch, as a minimisation.

With x the vertices at the end of the step, x^ = x0 + h v0 + h^2 g their free flight, E the energy of springs, hinges and dampers (see
`mass_spring`), q = (X, Theta) the displacement of each rigid body by the soft body, M_b its inertia, and psi the contacts, `contact_terms`:

    Phi(x, q) = (x - x^)^T M (x - x^) / 2 h^2 + E(x) + sum of q^T M_b q / 2 h^2 + sum of psi     ->  least

Its stationary point is the implicit Euler step, M (v1 - v0) = h (M g - grad E(x1) + f) with v1 = (x1 - x0) / h, and h f is the impulse on
the bodies. Newton's method with the positive definite part of the second derivatives and a line search goes downhill in every
iteration, whatever k h^2 / m is; where that converges slowly, since springs are compressed, the whole of them is taken. Conjugate
gradients solve for its steps, as accurately as far from the goal it pays. With h / 2 for h, and x1 = 2 x - x0, it is the midpoint rule's.
Source: Martin, Thomaszewski, Grinspun, Gross 2011; Gast, Schroeder, Stomakhin, Jiang, Teran 2015.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.portable import dot
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.soft_body.conjugate_gradients import LinearSystem, conjugate_gradients, diagonal_inverses
from rigidimpulse.dynamics.soft_body.contact_terms import (
    SoftContacts,
    add_contact_gradient,
    contact_energy,
    contact_forces,
    contact_stiffness,
)
from rigidimpulse.dynamics.soft_body.mass_spring import SpringMesh

MOST_ITERATIONS = 200
"""Friction of cloth on a rim takes up to 120."""
MOST_LINEAR = 2000
STALLED, MOST_STALLED = 0.5, 8
"""Part of what is broken that a round must mend, or it counts as stalled. As many in a row end the search: where planes leave no
place, only penalties and forces grow. With 4, or with penalties that stop to grow, a cloth on a ball jammed."""
UPDATE = 0.3
"""Error at which forces of contacts are taken over, relative to the error that this makes."""
FLOOR = TOLERANCES.soft_body.force_round_off


class Problem(NamedTuple):
    """What Phi is made of."""

    soft_body: SpringMesh  # with its dampers
    h: float  # s
    goal: np.ndarray  # (n, 3) x^
    free: np.ndarray  # (n,) bool
    rigid: np.ndarray  # (r, 6, 6) M_b / h^2
    speed: float  # m/s, of the vertices


class Solution(NamedTuple):
    """Where Phi is least."""

    z: np.ndarray  # (n + 2 r, 3) x, and X, Theta of each rigid body
    force: np.ndarray  # (m, 3) N, f of the contacts
    gradient: np.ndarray  # (n + 2 r, 3) N, what is left of the gradient; of vertices that are not free the force that holds them
    iterations: int
    linear_iterations: int
    error: float  # m/s
    converged: bool


def value_of(p: Problem, contacts: SoftContacts, z: np.ndarray) -> float:
    n = len(p.free)
    away = z[:n] - p.goal
    push = z[n:].reshape(-1, 6)
    inertia = 0.5 / p.h**2 * float(dot(p.soft_body.mass, dot(away, away)))
    bodies = 0.5 * float(np.einsum("bi,bij,bj->", push, p.rigid, push))
    return inertia + bodies + p.soft_body.energy(z[:n]) + contact_energy(z, n, contacts)


def _gradient(p: Problem, contacts: SoftContacts, z: np.ndarray, force: np.ndarray) -> np.ndarray:
    n = len(p.free)
    gradient = np.empty_like(z)
    gradient[:n] = p.soft_body.mass[:, None] / p.h**2 * (z[:n] - p.goal) + p.soft_body.gradient(z[:n])
    gradient[n:] = np.einsum("bij,bj->bi", p.rigid, z[n:].reshape(-1, 6)).reshape(-1, 3)
    contact_forces(z, n, contacts, force)
    add_contact_gradient(n, contacts, force, gradient)
    return gradient


def _blocks(p: Problem, x: np.ndarray, exact: bool = False) -> np.ndarray:
    block = p.soft_body.hessian(x, exact)
    block[p.soft_body.pattern.diagonal] += (p.soft_body.mass / p.h**2)[:, None, None] * np.eye(3)
    return block


def set_penalties(p: Problem, contacts: SoftContacts, x: np.ndarray) -> None:
    """Set the penalties of contacts: well above the stiffness that the soft body and the body oppose to them.

    A vertex on an immovable body has its penalty in a block of its own, which the preconditioner inverts, so that it may be larger.
    """
    stiffness = np.trace(_blocks(p, x)[p.soft_body.pattern.diagonal], axis1=1, axis2=2) / 3.0
    give = np.einsum("mk,mk->m", contacts.weight**2, 1.0 / stiffness[contacts.node])
    movable = contacts.unknown >= 0
    inverse = np.linalg.inv(p.rigid)[contacts.unknown[movable]] if movable.any() else np.zeros((0, 6, 6))
    lever = cross_arrays(contacts.arm[movable], contacts.normal[movable])
    lever = np.concatenate([contacts.normal[movable], lever], axis=1)
    give[movable] += np.einsum("mi,mij,mj->m", lever, inverse, lever)
    contacts.penalty[:] = np.where(movable, 1.0, 1.0) / give


def minimise(p: Problem, contacts: SoftContacts, z: np.ndarray, tolerance: float) -> Solution:
    """Find where Phi is least, from z (n + 2 r, 3) on; the forces and radii of the contacts are brought up to date in place.

    Args:
        p: the step. contacts: with penalties.
        z: the start, with all vertices that are not free where they shall be.
        tolerance: error of velocities, relative to the speeds in the step.

    """
    n, z = len(p.free), z.copy()
    held = np.concatenate([~p.free, np.zeros(len(z) - n, bool)])
    mass = np.concatenate([p.soft_body.mass, p.h**2 * p.rigid[:, [0, 3], [0, 3]].reshape(-1)])
    total = float(p.soft_body.mass.sum())
    stiffness = np.trace(p.soft_body.hessian(z[:n])[p.soft_body.pattern.diagonal], axis1=1, axis2=2)
    noise = FLOOR * p.h * np.sqrt(float(np.sum((stiffness * np.abs(z[:n]).max(initial=0.0)) ** 2 / p.soft_body.mass)) / total)
    force = np.empty_like(contacts.force)
    linear, value, previous, iteration, blind, stepped = 0, value_of(p, contacts, z), np.inf, 0, False, False
    last, stalled = np.inf, 0
    while True:
        gradient = _gradient(p, contacts, z, force)
        residual = np.where(held[:, None], 0.0, -gradient)
        error = p.h * np.sqrt(float(np.sum(residual**2 / mass[:, None])) / total)
        change = np.linalg.norm(force - contacts.force, axis=1) / contacts.penalty
        broken = float(change.max(initial=0.0)) / p.h
        if blind and error > 0.5 * previous:  # round-off is all that is left
            noise = max(noise, error)
        goal = tolerance * p.speed + noise
        done = error <= goal and broken <= goal
        if done or iteration == MOST_ITERATIONS or stalled == MOST_STALLED:
            return Solution(z, force, gradient, iteration, linear, max(error, broken), done)
        iteration += 1
        if broken > goal and (error <= goal or (stepped and error <= UPDATE * _effect(p, contacts, force, mass))):
            contacts.force[:] = force
            if broken > 0.2 * last:  # it closes in slowly: near the goal higher penalties no longer hinder the search
                contacts.penalty[:] *= 4.0
            stalled = stalled + 1 if broken > STALLED * last else 0
            last = broken
            pressing = np.einsum("ij,ij->i", force, contacts.normal)
            contacts.radius[:] = contacts.friction * np.maximum(pressing, 0.0)
            value, previous, blind, stepped = value_of(p, contacts, z), np.inf, False, False
            continue
        accuracy = min(0.1, max(0.1 * goal / error, 0.5 * error / previous if previous < np.inf else 0.1))
        exact = 0.1 * previous < error < previous
        previous = error
        step, count = _newton_step(p, contacts, z, residual, accuracy, exact)
        linear += count
        moved, new = _search(p, contacts, z, step, value, float(np.sum(residual * step)))
        blind, stepped = moved is None or value - new <= 1e-13 * abs(value), True
        z = z + step if moved is None else moved
        value = value_of(p, contacts, z) if moved is None else new


def _effect(p: Problem, contacts: SoftContacts, force: np.ndarray, mass: np.ndarray) -> float:
    """Error (m/s) that taking over the forces of the contacts will make."""
    change = np.zeros((len(mass), 3))
    add_contact_gradient(len(p.free), contacts, force - contacts.force, change)
    change[: len(p.free)][~p.free] = 0.0
    return p.h * float(np.sqrt(np.sum(change**2 / mass[:, None]) / p.soft_body.mass.sum()))


def _newton_step(
    p: Problem, contacts: SoftContacts, z: np.ndarray, residual: np.ndarray, accuracy: float, exact: bool
) -> tuple[np.ndarray, int]:
    """Return a step (n + 2 r, 3) downhill, and the iterations it took."""
    n, pattern = len(p.free), p.soft_body.pattern
    block = _blocks(p, z[:n], exact)
    D = np.empty((len(contacts.body), 3, 3))
    contact_stiffness(z, n, contacts, D)
    apart = (contacts.unknown < 0) & (contacts.weight[:, 0] == 1.0)  # of one vertex only: part of its own block
    np.add.at(block, pattern.diagonal[contacts.node[apart, 0]], D[apart])
    coupling = SoftContacts(*(column[~apart] for column in contacts))
    linear_part, D = coupling._replace(aim=np.zeros_like(coupling.aim)), D[~apart]
    node_inverse, rigid_inverse, step = np.empty((n, 3, 3)), np.empty_like(p.rigid), np.empty_like(z)
    diagonal_inverses(pattern.diagonal, block, p.rigid, coupling, D, node_inverse, rigid_inverse)
    system = LinearSystem(pattern.first, pattern.column, block, p.free, p.rigid, coupling, linear_part, D)
    count = conjugate_gradients(system, node_inverse, rigid_inverse, residual.copy(), accuracy, np.int64(MOST_LINEAR), step)
    return step, count


def _search(
    p: Problem, contacts: SoftContacts, z: np.ndarray, step: np.ndarray, value: float, slope: float
) -> tuple[np.ndarray | None, float]:
    """First of the steps 1, 1/2, 1/4, ... that lowers Phi by its share of the slope, and Phi there; None where round-off hides it.

    There the gradient tells whether Newton's step is any good: it is that of a convex function nearby.
    """
    share = 1.0
    for _ in range(30):
        trial = z + share * step
        new = value_of(p, contacts, trial)
        if new <= value - 1e-4 * share * slope:
            return trial, new
        # The promised fall is below the round-off of Phi.
        if share * slope <= 1e-13 * abs(value):
            return None, value
        share *= 0.5
    return None, value
