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

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import copy_vector

SIZE = 6
TINY = TOLERANCES.arithmetic.least_divisor


class Elimination(NamedTuple):
    """The order of elimination of n bodies, and where their blocks lie."""

    order: np.ndarray  # (n,) bodies
    start: np.ndarray  # (n + 1,) of the neighbours of the k-th body eliminated, in
    later: np.ndarray  # (e,) bodies still to come
    slot: np.ndarray  # (n, n) place of block (i, j), -1 if it is zero
    num_blocks: np.int64


@jit_making_arrays
def plan_elimination(first, second, n):
    """Return the `Elimination` of n bodies; constraint i joins bodies first[i] and second[i], either may be -1."""
    # Few arrays: for a body or two, to make one for each took longer than to plan.
    marks, places = np.zeros((n + 1, n), np.bool_), np.zeros((3, n + 1), np.int64)
    joined, gone, start, order, degree = marks[:n], marks[n], places[0], places[1, :n], places[2, :n]
    for i in range(first.shape[0]):
        if first[i] >= 0 and second[i] >= 0 and first[i] != second[i]:
            joined[first[i], second[i]] = joined[second[i], first[i]] = True
    for i in range(n):
        for j in range(n):
            if joined[i, j]:
                degree[i] += 1
    slot = np.full((n, n), -1, np.int64)
    later = np.empty(n, np.int64)
    count = np.int64(0)
    for k in range(n):
        # Least degree first; ties go to the lower index, so that the order is the same in every run.
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
                # Fill-in: two neighbours of an eliminated body become neighbours.
                if not joined[i, j]:
                    joined[i, j] = joined[j, i] = True
                    degree[i] += 1
                    degree[j] += 1
    return Elimination(order, start, later[: start[n]], slot, count)


@jit
def _factor_block(blocks, s, pivots, body):
    """LU factors of block s in its place, rows exchanged."""
    for k in range(SIZE):
        pivot = k
        for i in range(k + 1, SIZE):
            if abs(blocks[s, i, k]) > abs(blocks[s, pivot, k]):
                pivot = i
        pivots[body, k] = pivot
        if pivot != k:
            for j in range(SIZE):
                blocks[s, k, j], blocks[s, pivot, j] = blocks[s, pivot, j], blocks[s, k, j]
        # A singular block must not divide by zero.
        if blocks[s, k, k] == 0.0:
            blocks[s, k, k] = TINY
        head = blocks[s, k, k]
        for i in range(k + 1, SIZE):
            factor = blocks[s, i, k] / head
            blocks[s, i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, SIZE):
                    blocks[s, i, j] -= factor * blocks[s, k, j]


@jit
def _solve_block(blocks, s, pivots, body, t):
    """Solve with the factored block s of a body for the columns of block t, in place."""
    for k in range(SIZE):
        pivot = pivots[body, k]
        if pivot != k:
            for c in range(SIZE):
                blocks[t, k, c], blocks[t, pivot, c] = blocks[t, pivot, c], blocks[t, k, c]
    for k in range(SIZE):
        for i in range(k + 1, SIZE):
            factor = blocks[s, i, k]
            if factor != 0.0:
                for c in range(SIZE):
                    blocks[t, i, c] -= factor * blocks[t, k, c]
    for k in range(SIZE - 1, -1, -1):
        for j in range(k + 1, SIZE):
            factor = blocks[s, k, j]
            if factor != 0.0:
                for c in range(SIZE):
                    blocks[t, k, c] -= factor * blocks[t, j, c]
        head = blocks[s, k, k]
        for c in range(SIZE):
            blocks[t, k, c] /= head


@jit
def _solve_vector(blocks, s, pivots, x, body):
    """Solve with the factored block s of a body for its row of x, in place."""
    for k in range(SIZE):
        pivot = pivots[body, k]
        if pivot != k:
            x[body, k], x[body, pivot] = x[body, pivot], x[body, k]
    for k in range(SIZE):
        value = x[body, k]
        for i in range(k + 1, SIZE):
            x[body, i] -= blocks[s, i, k] * value
    for k in range(SIZE - 1, -1, -1):
        value = x[body, k]
        for j in range(k + 1, SIZE):
            value -= blocks[s, k, j] * x[body, j]
        x[body, k] = value / blocks[s, k, k]


@jit
def _subtract_product(blocks, left, upper, target):
    """Block `target` -= block `left` times block `upper`."""
    for i in range(SIZE):
        for m in range(SIZE):
            value = blocks[left, i, m]
            if value != 0.0:
                for j in range(SIZE):
                    blocks[target, i, j] -= value * blocks[upper, m, j]


@jit
def factor(elimination, blocks, pivots):
    """Factor the matrix in blocks (num_blocks, 6, 6) in place; pivots (n, 6)."""
    order, start, later, slot = elimination.order, elimination.start, elimination.later, elimination.slot
    for k in range(order.shape[0]):
        body = order[k]
        diagonal = slot[body, body]
        _factor_block(blocks, diagonal, pivots, body)
        for y in range(start[k], start[k + 1]):
            upper = slot[body, later[y]]
            _solve_block(blocks, diagonal, pivots, body, upper)
            for x in range(start[k], start[k + 1]):
                _subtract_product(blocks, slot[later[x], body], upper, slot[later[x], later[y]])


@jit
def _has_value(x, body):
    """Whether any entry of a body's row of x is not zero."""
    for k in range(SIZE):
        if x[body, k] != 0.0:
            return True
    return False


@jit
def solve_factored(elimination, blocks, pivots, x):
    """Solve for the vector x (n, 6) in place."""
    order, start, later, slot = elimination.order, elimination.start, elimination.later, elimination.slot
    n = order.shape[0]
    for k in range(n):
        body = order[k]
        # A force on one body of a chain concerns only those that are eliminated after it.
        if not _has_value(x, body):
            continue
        _solve_vector(blocks, slot[body, body], pivots, x, body)
        for t in range(start[k], start[k + 1]):
            left, target = slot[later[t], body], later[t]
            for i in range(SIZE):
                for m in range(SIZE):
                    x[target, i] -= blocks[left, i, m] * x[body, m]
    for k in range(n - 1, -1, -1):
        body = order[k]
        for t in range(start[k], start[k + 1]):
            upper, source = slot[body, later[t]], later[t]
            if not _has_value(x, source):
                continue
            for i in range(SIZE):
                for m in range(SIZE):
                    x[body, i] -= blocks[upper, i, m] * x[source, m]
