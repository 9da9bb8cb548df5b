"""A tree of boxes that move: who overlaps a box is found, and a box replaced, in log n.

Bodies are sorted along a Z-curve through the centres of their boxes (Morton 1966) and are the leaves of a complete binary
tree; each node has the box of what is below it. Node 1 is the root, nodes 2 k and 2 k + 1 are below node k, leaf number r
is node `leaves` + r.
"""

from __future__ import annotations

from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays

_BITS = 10
_DIGITS = 1 << _BITS
_DEPTH = 64


class BoxTree(NamedTuple):
    """See the head of the file; n bodies, of which some may be left out."""

    low: np.ndarray  # (2 m, 3) m, m a power of two that is at least n
    high: np.ndarray
    body: np.ndarray  # (m,) of each leaf, -1 for none
    leaf: np.ndarray  # (n,) of each body, -1 if it is left out


def make_tree(num_bodies: int) -> BoxTree:
    """Make a tree with a capacity of `num_bodies`; `build_tree` fills it."""
    leaves = 1 << max(num_bodies - 1, 1).bit_length()
    return BoxTree(
        np.empty((2 * leaves, 3)), np.empty((2 * leaves, 3)), np.empty(leaves, np.int64), np.full(num_bodies, -1, np.int64)
    )


@jit
def _spread_bits(x):
    """The lowest ten bits of x, two zeros between each two."""
    x = (x | (x << 16)) & 0x30000FF
    x = (x | (x << 8)) & 0x300F00F
    x = (x | (x << 4)) & 0x30C30C3
    return (x | (x << 2)) & 0x9249249


@jit_making_arrays
def _curve_places(low, high, bodies, code):
    """Write the place of each body's box along the Z-curve into code (k,)."""
    least, most = np.full(3, inf), np.full(3, -inf)
    for i in bodies:
        for k in range(3):
            middle = 0.5 * (low[i, k] + high[i, k])
            # Endless boxes have no middle; they come first.
            if isfinite(middle):
                least[k], most[k] = min(least[k], middle), max(most[k], middle)
    for at in range(len(bodies)):
        code[at] = 0
        for k in range(3):
            middle = 0.5 * (low[bodies[at], k] + high[bodies[at], k])
            width = most[k] - least[k]
            share = (middle - least[k]) / width if width > 0.0 and isfinite(middle) else 0.0
            code[at] |= _spread_bits(np.int64(share * (_DIGITS - 1))) << k


@jit_making_arrays
def _sort_by_code(bodies, code):
    """Put bodies (k,) into the order of their codes, by counting digit after digit; returns the sorted bodies."""
    other, other_code = np.empty_like(bodies), np.empty_like(code)
    first = np.empty(_DIGITS + 1, np.int64)
    for digit in range(3):
        shift = digit * _BITS
        first[:] = 0
        for at in range(len(bodies)):
            first[((code[at] >> shift) & (_DIGITS - 1)) + 1] += 1
        for k in range(_DIGITS):
            first[k + 1] += first[k]
        for at in range(len(bodies)):
            key = (code[at] >> shift) & (_DIGITS - 1)
            other[first[key]], other_code[first[key]] = bodies[at], code[at]
            first[key] += 1
        bodies, code, other, other_code = other, other_code, bodies, code
    return bodies


@jit
def _join(tree, node):
    """Let a node have the box around both nodes below it."""
    for k in range(3):
        tree.low[node, k] = min(tree.low[2 * node, k], tree.low[2 * node + 1, k])
        tree.high[node, k] = max(tree.high[2 * node, k], tree.high[2 * node + 1, k])


@jit_making_arrays
def build_tree(tree, low, high, bodies):
    """Build the tree over the boxes low, high (n, 3) m of bodies (k,)."""
    code = np.empty(len(bodies), np.int64)
    _curve_places(low, high, bodies, code)
    order = _sort_by_code(bodies.copy(), code)
    leaves = len(tree.body)
    tree.leaf[:], tree.body[:] = -1, -1
    for r in range(leaves):
        for k in range(3):
            tree.low[leaves + r, k], tree.high[leaves + r, k] = inf, -inf
    for r in range(len(order)):
        i = order[r]
        tree.body[r], tree.leaf[i] = i, r
        for k in range(3):
            tree.low[leaves + r, k], tree.high[leaves + r, k] = low[i, k], high[i, k]
    for node in range(leaves - 1, 0, -1):
        _join(tree, node)


@jit
def replace_box(tree, i, low, high):
    """Let body i have the box in row i of low, high."""
    node = len(tree.body) + tree.leaf[i]
    for k in range(3):
        tree.low[node, k], tree.high[node, k] = low[i, k], high[i, k]
    while node > 1:
        node //= 2
        _join(tree, node)


@jit_making_arrays
def overlapping(tree, i, low, high, found):
    """Write the bodies whose boxes overlap or touch row i of low, high into found (n,), i itself left out; returns their number."""
    stack = np.empty(_DEPTH, np.int64)
    leaves = len(tree.body)
    stack[0], depth, count = 1, 1, 0
    while depth > 0:
        depth -= 1
        node = stack[depth]
        apart = False
        for k in range(3):
            apart |= (tree.low[node, k] > high[i, k]) | (low[i, k] > tree.high[node, k])
        if apart:
            continue
        if node >= leaves:
            if tree.body[node - leaves] != i:
                found[count] = tree.body[node - leaves]
                count += 1
            continue
        stack[depth], stack[depth + 1] = 2 * node, 2 * node + 1
        depth += 2
    return count
