"""Conjugate gradients for the linear systems of an implicit step.

The matrix is that of the soft bodies (3 x 3 blocks in compressed rows) plus that of the rigid bodies (6 x 6 blocks) plus J^T D J of the
contacts, which join both and are applied one by one. The preconditioner inverts the blocks on the diagonal, contacts included.
Source: Hestenes, Stiefel 1952; on cloth: Baraff, Witkin 1998.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.vector import copy_matrix, cross, row
from rigidimpulse.dynamics.soft_body.contact_terms import SoftContacts, add_to_ends, miss


class LinearSystem(NamedTuple):
    """The matrix of n vertices, r rigid bodies and m contacts."""

    first: np.ndarray  # (n + 1,) first block of each vertex
    column: np.ndarray  # (b,) vertex of each block's column
    block: np.ndarray  # (b, 3, 3)
    free: np.ndarray  # (n,) bool, vertices that nothing holds
    rigid: np.ndarray  # (r, 6, 6)
    contacts: SoftContacts
    no_aim: SoftContacts  # the same with aims of zero: u is then linear in z
    D: np.ndarray  # (m, 3, 3) second derivatives of psi by u


@jit
def apply_matrix(system, z, out):
    """Write the matrix times z (n + 2 r, 3); rows of vertices that are not free are zero."""
    first, column, block, free, rigid, contacts, no_aim, D = system
    n = free.shape[0]
    for i in range(n):
        s0, s1, s2 = 0.0, 0.0, 0.0
        for b in range(first[i], first[i + 1]):
            j = column[b]
            x, y, w = z[j, 0], z[j, 1], z[j, 2]
            s0 += block[b, 0, 0] * x + block[b, 0, 1] * y + block[b, 0, 2] * w
            s1 += block[b, 1, 0] * x + block[b, 1, 1] * y + block[b, 1, 2] * w
            s2 += block[b, 2, 0] * x + block[b, 2, 1] * y + block[b, 2, 2] * w
        out[i, 0], out[i, 1], out[i, 2] = s0, s1, s2
    for b in range(rigid.shape[0]):
        for p in range(6):
            total = 0.0
            for q in range(6):
                total += rigid[b, p, q] * z[n + 2 * b + q // 3, q % 3]
            out[n + 2 * b + p // 3, p % 3] = total
    # J^T D J of the contacts, which join vertices and bodies.
    for c in range(D.shape[0]):
        u = miss(z, n, no_aim, c)
        v = (
            D[c, 0, 0] * u[0] + D[c, 0, 1] * u[1] + D[c, 0, 2] * u[2],
            D[c, 1, 0] * u[0] + D[c, 1, 1] * u[1] + D[c, 1, 2] * u[2],
            D[c, 2, 0] * u[0] + D[c, 2, 1] * u[1] + D[c, 2, 2] * u[2],
        )
        add_to_ends(n, contacts, c, v, out)
    for i in range(n):
        if not free[i]:
            out[i] = 0.0


@jit_making_arrays
def diagonal_inverses(diagonal, block, rigid, contacts, D, node_inverse, rigid_inverse):
    """Write the inverses (n, 3, 3) and (r, 6, 6) of the blocks on the diagonal."""
    for i in range(diagonal.shape[0]):
        copy_matrix(block[diagonal[i]], node_inverse[i])
    for i in range(rigid.shape[0]):
        copy_matrix(rigid[i], rigid_inverse[i])
    lever = np.zeros((3, 6))
    for k in range(3):
        lever[k, k] = 1.0
    for c in range(D.shape[0]):
        for p in range(3):
            node_inverse[contacts.node[c, p]] += contacts.weight[c, p] ** 2 * D[c]
        body = contacts.unknown[c]
        if body >= 0:
            x, y, z = row(contacts.arm, c)
            lever[0, 4], lever[0, 5], lever[1, 3], lever[1, 5], lever[2, 3], lever[2, 4] = z, -y, -z, x, y, -x
            rigid_inverse[body] += lever.T @ (D[c] @ lever)
    for i in range(diagonal.shape[0]):
        _invert(node_inverse[i])
    for b in range(rigid.shape[0]):
        rigid_inverse[b] = np.linalg.inv(rigid_inverse[b])


@jit_making_arrays
def _invert(A):
    """Invert a symmetric matrix (3, 3) in place, by cofactors; of one that is not positive definite the mean of its diagonal."""
    a, b, c = row(A, 0), row(A, 1), row(A, 2)
    bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
    determinant = a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2]
    if not (a[0] > 0.0 and ab[2] > 0.0 and determinant > 0.0):
        mean = (abs(a[0]) + abs(b[1]) + abs(c[2])) / 3.0
        A[:] = 0.0
        for k in range(3):
            A[k, k] = 1.0 / mean
        return
    for k in range(3):
        A[k, 0], A[k, 1], A[k, 2] = bc[k] / determinant, ca[k] / determinant, ab[k] / determinant


@jit
def _precondition(node_inverse, rigid_inverse, free, r, out):
    """Write the preconditioner times r (n + 2 b, 3)."""
    n = free.shape[0]
    for i in range(n):
        for k in range(3):
            value = node_inverse[i, k, 0] * r[i, 0] + node_inverse[i, k, 1] * r[i, 1] + node_inverse[i, k, 2] * r[i, 2]
            out[i, k] = value if free[i] else 0.0
    for b in range(rigid_inverse.shape[0]):
        for p in range(6):
            total = 0.0
            for q in range(6):
                total += rigid_inverse[b, p, q] * r[n + 2 * b + q // 3, q % 3]
            out[n + 2 * b + p // 3, p % 3] = total


@jit
def _inner(a, b):
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i, 0] * b[i, 0] + a[i, 1] * b[i, 1] + a[i, 2] * b[i, 2]
    return total


@jit_making_arrays
def conjugate_gradients(system, node_inverse, rigid_inverse, r, accuracy, most, z):
    """Write the solution z (n + 2 b, 3) of matrix z = r; r is destroyed. Returns the number of iterations.

    It ends where r has fallen to `accuracy` times its start in the preconditioner's norm, or after `most` iterations.
    """
    free = system.free
    z[:] = 0.0
    s, p, image = np.empty_like(r), np.empty_like(r), np.empty_like(r)
    _precondition(node_inverse, rigid_inverse, free, r, s)
    copy_matrix(s, p)
    size = _inner(r, s)
    goal = accuracy * accuracy * size
    for count in range(most):
        if size <= goal or size <= 0.0:
            return count
        apply_matrix(system, p, image)
        bend = _inner(p, image)
        if bend <= 0.0:  # a direction of negative curvature: the sum so far goes downhill (Steihaug 1983)
            if count == 0:
                copy_matrix(p, z)
            return count
        step = size / bend
        for i in range(r.shape[0]):
            for k in range(3):
                z[i, k] += step * p[i, k]
                r[i, k] -= step * image[i, k]
        _precondition(node_inverse, rigid_inverse, free, r, s)
        new = _inner(r, s)
        ratio = new / size
        for i in range(r.shape[0]):
            for k in range(3):
                p[i, k] = s[i, k] + ratio * p[i, k]
        size = new
    return most
