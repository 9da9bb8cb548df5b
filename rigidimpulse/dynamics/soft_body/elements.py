"""Elastic elements of a soft body: springs along edges and struts, hinges between neighbouring faces.

Spring between vertices i and j, d = x_j - x_i, l = |d|, n = d / l, of rest length L:

    E = k (l - L)^2 / 2,    dE/dx_j = k (l - L) n = -dE/dx_i,    H_jj = k (n n^T + max(0, 1 - L / l) (1 - n n^T))

where max(0, .) leaves out the negative part of compressed springs, so that H is positive semidefinite; without it H is exact.
Hinge over the edge from a to b, e = b - a, with the opposite vertices c of the left and d of the right face, N_c = (a - c) x (b - c),
N_d = (b - d) x (a - d):

    phi = atan2((N_c x N_d) . e / |e|, N_c . N_d),    0 where flat;    E = kappa (phi - phi_0)^2 / 2,    H = kappa (grad phi)(grad phi)^T

    dphi/dc = -|e| N_c / N_c^2,    dphi/da = -((c - b) . e / |e|) N_c / N_c^2 - ((d - b) . e / |e|) N_d / N_d^2

and the same with (c, d) and (a, b) exchanged, the latter with the other sign (phi - phi_0 is taken within half a turn).
Sources: springs: Choi, Ko 2002; hinges: Bridson, Marino, Fedkiw 2003, Grinspun, Hirani, Desbrun, Schröder 2003.
"""

from __future__ import annotations

from math import atan2, pi, sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.vector import cross, dot, row, subtract


@jit
def spring_lengths(x, spring, length):
    """Write the lengths (s,) of springs (s, 2) at vertices x (n, 3)."""
    for s in range(spring.shape[0]):
        d = subtract(row(x, spring[s, 1]), row(x, spring[s, 0]))
        length[s] = sqrt(dot(d, d))


@jit
def spring_energy(x, spring, rest, stiffness):
    """Return the sum of k (l - L)^2 / 2."""
    energy = 0.0
    for s in range(spring.shape[0]):
        d = subtract(row(x, spring[s, 1]), row(x, spring[s, 0]))
        stretch = sqrt(dot(d, d)) - rest[s]
        energy += 0.5 * stiffness[s] * stretch * stretch
    return energy


@jit
def add_spring_gradient(x, spring, rest, stiffness, gradient):
    """Add dE/dx to gradient (n, 3); a spring of no length pulls nowhere."""
    for s in range(spring.shape[0]):
        i, j = spring[s, 0], spring[s, 1]
        d = subtract(row(x, j), row(x, i))
        length = sqrt(dot(d, d))
        if length > 0.0:
            pull = stiffness[s] * (length - rest[s]) / length
            for k in range(3):
                gradient[i, k] -= pull * d[k]
                gradient[j, k] += pull * d[k]


@jit
def add_spring_hessian(x, spring, rest, stiffness, least, slot, block):
    """Add H to blocks (b, 3, 3), with max(least, .) for max(0, .); slot (s, 4): places of the blocks ii, jj, ij, ji."""
    for s in range(spring.shape[0]):
        d = subtract(row(x, spring[s, 1]), row(x, spring[s, 0]))
        length = sqrt(dot(d, d))
        # Compressed springs would make H indefinite: the part across them is left out.
        across = stiffness[s] * max(least, 1.0 - rest[s] / length) if length > 0.0 else stiffness[s]
        both = (stiffness[s] - across) / (length * length) if length > 0.0 else 0.0
        for p in range(3):
            for q in range(3):
                value = both * d[p] * d[q] + (across if p == q else 0.0)
                block[slot[s, 0], p, q] += value
                block[slot[s, 1], p, q] += value
                block[slot[s, 2], p, q] -= value
                block[slot[s, 3], p, q] -= value


@jit
def hinge_angle(x, hinge, h):
    """Return phi of hinge h; hinge (g, 4): a, b, c, d."""
    a, b, c, d = row(x, hinge[h, 0]), row(x, hinge[h, 1]), row(x, hinge[h, 2]), row(x, hinge[h, 3])
    e = subtract(b, a)
    normal_c, normal_d = cross(subtract(a, c), subtract(b, c)), cross(subtract(b, d), subtract(a, d))
    return atan2(dot(cross(normal_c, normal_d), e), dot(normal_c, normal_d) * sqrt(dot(e, e)))


@jit
def hinge_angles(x, hinge, angle):
    """Write phi (g,) of all hinges."""
    for h in range(hinge.shape[0]):
        angle[h] = hinge_angle(x, hinge, h)


@jit
def turned_angle(angle, rest):
    """Return angle - rest within half a turn."""
    turn = angle - rest
    if turn > pi:
        return turn - 2.0 * pi
    return turn + 2.0 * pi if turn < -pi else turn


@jit_making_arrays
def hinge_slope(x, hinge, h, slope):
    """Write grad phi of hinge h to slope (4, 3), zero where a face has no area."""
    a, b, c, d = row(x, hinge[h, 0]), row(x, hinge[h, 1]), row(x, hinge[h, 2]), row(x, hinge[h, 3])
    e = subtract(b, a)
    length = sqrt(dot(e, e))
    normal_c, normal_d = cross(subtract(a, c), subtract(b, c)), cross(subtract(b, d), subtract(a, d))
    area_c, area_d = dot(normal_c, normal_c), dot(normal_d, normal_d)
    slope[:] = 0.0
    # A face without area has no normal.
    if area_c == 0.0 or area_d == 0.0:
        return
    a_c, a_d = dot(subtract(c, b), e) / (length * area_c), dot(subtract(d, b), e) / (length * area_d)
    b_c, b_d = dot(subtract(c, a), e) / (length * area_c), dot(subtract(d, a), e) / (length * area_d)
    for k in range(3):
        slope[0, k] = -a_c * normal_c[k] - a_d * normal_d[k]
        slope[1, k] = b_c * normal_c[k] + b_d * normal_d[k]
        slope[2, k] = -length / area_c * normal_c[k]
        slope[3, k] = -length / area_d * normal_d[k]


@jit
def hinge_energy(x, hinge, rest, stiffness):
    """Return the sum of kappa (phi - phi_0)^2 / 2."""
    energy = 0.0
    for h in range(hinge.shape[0]):
        turn = turned_angle(hinge_angle(x, hinge, h), rest[h])
        energy += 0.5 * stiffness[h] * turn * turn
    return energy


@jit_making_arrays
def add_hinge_gradient(x, hinge, rest, stiffness, gradient):
    """Add dE/dx to gradient (n, 3)."""
    slope = np.empty((4, 3))
    for h in range(hinge.shape[0]):
        moment = stiffness[h] * turned_angle(hinge_angle(x, hinge, h), rest[h])
        if moment != 0.0:
            hinge_slope(x, hinge, h, slope)
            for m in range(4):
                for k in range(3):
                    gradient[hinge[h, m], k] += moment * slope[m, k]


@jit_making_arrays
def add_hinge_hessian(x, hinge, stiffness, slot, block):
    """Add kappa (grad phi)(grad phi)^T to blocks (b, 3, 3); slot (g, 16): places of the blocks, by row."""
    slope = np.empty((4, 3))
    for h in range(hinge.shape[0]):
        hinge_slope(x, hinge, h, slope)
        for m in range(4):
            for o in range(4):
                at = slot[h, 4 * m + o]
                for p in range(3):
                    for q in range(3):
                        block[at, p, q] += stiffness[h] * slope[m, p] * slope[o, q]
