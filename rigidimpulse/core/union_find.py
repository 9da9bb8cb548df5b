"""Connected sets (kernels): islands of bodies, pieces of soft bodies.

`parent` (n,) names for each element another one of its set; the root of a set, its lowest element, names itself.
"""

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays


@jit
def root_of(parent, i):
    """The lowest element of the set of i; the way there is shortened."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@jit
def unite(parent, i, j):
    """Make one set of those of i and j."""
    a, b = root_of(parent, i), root_of(parent, j)
    parent[max(a, b)] = min(a, b)


@jit_making_arrays
def roots(number, first, second):
    """Root (n,) of each of n elements, with links between first (k,) and second (k,)."""
    parent = np.arange(number)
    for k in range(first.shape[0]):
        unite(parent, first[k], second[k])
    for i in range(number):
        parent[i] = root_of(parent, i)
    return parent
