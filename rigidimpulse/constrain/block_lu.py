"""Solving the sparse linear systems of an island: 6 x 6 blocks, one row and column of blocks a body.

A matrix whose blocks (i, j) and (j, i) are there only where bodies i and j share a constraint is factored as  A = L D U
by block Gaussian elimination. The bodies are taken in the order of least degree (Markowitz 1957; Tinney and Walker
1967), so that chains, stacks and trees fill in nothing:

    U_kj = D_k^-1 A_kj,      A_ij <- A_ij - A_ik U_kj      for all i, j that are still to come and touch k.

Within a block rows are exchanged (partial pivoting); between blocks they are not, since the systems solved here are the
identity plus a positive part.
"""

from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.copying import copy_vector

SIZE = 6
TINY = 1e-300


class Elimination(NamedTuple):
    """The order of elimination of n bodies, and where their blocks lie."""

    order: np.ndarray  # (n,) bodies
    start: np.ndarray  # (n + 1,) of the neighbours of the k-th body eliminated, in
    later: np.ndarray  # (e,) bodies still to come
    slot: np.ndarray  # (n, n) place of block (i, j), -1 if it is zero
    num_blocks: np.int64


@jit
def plan_elimination(first, second, n):
    """Return the `Elimination` of n bodies; constraint i joins bodies first[i] and second[i], either may be -1."""
    joined = np.zeros((n, n), np.bool_)
    for i in range(first.shape[0]):
        if first[i] >= 0 and second[i] >= 0 and first[i] != second[i]:
            joined[first[i], second[i]] = joined[second[i], first[i]] = True
    degree = np.zeros(n, np.int64)
    for i in range(n):
        for j in range(n):
            if joined[i, j]:
                degree[i] += 1
    slot = np.full((n, n), -1, np.int64)
    order = np.empty(n, np.int64)
    start = np.zeros(n + 1, np.int64)
    later = np.empty(n, np.int64)
    gone = np.zeros(n, np.bool_)
    count = np.int64(0)
    for k in range(n):
        pick = np.int64(-1)
        for i in range(n):
            if not gone[i] and (pick < 0 or degree[i] < degree[pick]):
                pick = i
        order[k] = pick
        gone[pick] = True
        slot[pick, pick] = count
        count += 1
        size = start[k]
        if size + n > later.shape[0]:
            wider = np.empty(2 * later.shape[0] + n, np.int64)
            copy_vector(later, wider[:size])
            later = wider
        for i in range(n):
            if joined[pick, i] and not gone[i]:
                later[size] = i
                size += 1
                slot[pick, i], slot[i, pick] = count, count + 1
                count += 2
                degree[i] -= 1
        start[k + 1] = size
        for x in range(start[k], size):
            for y in range(x + 1, size):
                i, j = later[x], later[y]
                if not joined[i, j]:
                    joined[i, j] = joined[j, i] = True
                    degree[i] += 1
                    degree[j] += 1
    return Elimination(order, start, later[: start[n]], slot, count)


@jit
def _factor_block(a, pivots):
    """LU factors of a block in its place, rows exchanged."""
    for k in range(SIZE):
        pivot = k
        for i in range(k + 1, SIZE):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        pivots[k] = pivot
        if pivot != k:
            for j in range(SIZE):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
        if a[k, k] == 0.0:
            a[k, k] = TINY
        for i in range(k + 1, SIZE):
            a[i, k] /= a[k, k]
            factor = a[i, k]
            if factor != 0.0:
                for j in range(k + 1, SIZE):
                    a[i, j] -= factor * a[k, j]


@jit
def _solve_block(a, pivots, x):
    """Solve with a factored block for the columns of x (6, c), in place."""
    columns = x.shape[1]
    for k in range(SIZE):
        pivot = pivots[k]
        if pivot != k:
            for c in range(columns):
                x[k, c], x[pivot, c] = x[pivot, c], x[k, c]
    for k in range(SIZE):
        for i in range(k + 1, SIZE):
            factor = a[i, k]
            if factor != 0.0:
                for c in range(columns):
                    x[i, c] -= factor * x[k, c]
    for k in range(SIZE - 1, -1, -1):
        for j in range(k + 1, SIZE):
            factor = a[k, j]
            if factor != 0.0:
                for c in range(columns):
                    x[k, c] -= factor * x[j, c]
        for c in range(columns):
            x[k, c] /= a[k, k]


@jit
def factor(elimination, blocks, pivots):
    """Factor the matrix in blocks (num_blocks, 6, 6) in place; pivots (n, 6)."""
    order, start, later, slot = elimination.order, elimination.start, elimination.later, elimination.slot
    for k in range(order.shape[0]):
        body = order[k]
        diagonal = blocks[slot[body, body]]
        _factor_block(diagonal, pivots[body])
        for y in range(start[k], start[k + 1]):
            upper = blocks[slot[body, later[y]]]
            _solve_block(diagonal, pivots[body], upper)
            for x in range(start[k], start[k + 1]):
                left = blocks[slot[later[x], body]]
                target = blocks[slot[later[x], later[y]]]
                for i in range(SIZE):
                    for m in range(SIZE):
                        value = left[i, m]
                        if value != 0.0:
                            for j in range(SIZE):
                                target[i, j] -= value * upper[m, j]


@jit
def solve_factored(elimination, blocks, pivots, x):
    """Solve for the vector x (n, 6) in place."""
    order, start, later, slot = elimination.order, elimination.start, elimination.later, elimination.slot
    n = order.shape[0]
    for k in range(n):
        body = order[k]
        _solve_block(blocks[slot[body, body]], pivots[body], x[body].reshape((SIZE, 1)))
        for t in range(start[k], start[k + 1]):
            left, target = blocks[slot[later[t], body]], x[later[t]]
            for i in range(SIZE):
                for m in range(SIZE):
                    target[i] -= left[i, m] * x[body, m]
    for k in range(n - 1, -1, -1):
        body = order[k]
        for t in range(start[k], start[k + 1]):
            upper, source = blocks[slot[body, later[t]]], x[later[t]]
            for i in range(SIZE):
                for m in range(SIZE):
                    x[body, i] -= upper[i, m] * source[m]
