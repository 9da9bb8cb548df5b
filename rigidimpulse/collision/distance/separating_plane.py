"""The plane that comes closest to separating two convex bodies, where none separates them.

Bodies are points y grown by a radius. A plane n.y = d has a below and b above it, up to the depths

    r = max(0, n.y + r_a - d)  of the points of a,    r = max(0, d + r_b - n.y)  of those of b,    E(n, d) = sum of r^2 / 2

The least E is 0 exactly if the bodies are apart, and it is smooth in their poses. The forces r on the plane balance. Therefore they act
within the area where the two bodies face each other, as contact forces do.

With u, v normal to n and n(a, b) = n + a u + b v - (a^2 + b^2) n / 2 the minimum is found by Newton's method with a shift. It starts at the
best of the separating axes (normals of faces, products of edges; Gottschalk, Lin and Manocha 1996) and of the line of the centres.
Sources: soft margins: C. Cortes, V. Vapnik, Mach. Learn. 20, 1995; planes as variables: S. Brossette, P.-B. Wieber, Humanoids 2017.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import copy_matrix, copy_vector

ROUNDS = 80
CONVERGED = TOLERANCES.distance.plane_converged
LEAST_SHIFT = TOLERANCES.distance.least_plane_shift


@jit
def tangents(n, u, v):
    """Write two unit vectors normal to n and to each other."""
    k = 0
    for i in range(1, 3):
        if abs(n[i]) < abs(n[k]):
            k = i
    i, j = (k + 1) % 3, (k + 2) % 3
    length = sqrt(n[i] * n[i] + n[j] * n[j])
    u[k], u[i], u[j] = 0.0, -n[j] / length, n[i] / length
    for m in range(3):
        p, q = (m + 1) % 3, (m + 2) % 3
        v[m] = n[p] * u[q] - n[q] * u[p]


@jit
def _side(points, radius, sign, plane, g, H):
    """Add the points of one body, sign 1 for a and -1 for b; plane: n, u, v, d. Returns their E."""
    n, u, v, d = plane
    energy = 0.0
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        height = n[0] * x + n[1] * y + n[2] * z
        r = sign * (height - d) + radius
        # Points on their own side of the plane have no energy.
        if r <= 0.0:
            continue
        along_u = sign * (u[0] * x + u[1] * y + u[2] * z)
        along_v = sign * (v[0] * x + v[1] * y + v[2] * z)
        energy += 0.5 * r * r
        g[0] += r * along_u
        g[1] += r * along_v
        g[2] -= r * sign
        H[0, 0] += along_u * along_u - r * sign * height
        H[1, 1] += along_v * along_v - r * sign * height
        H[2, 2] += 1.0
        H[1, 0] += along_u * along_v
        H[2, 0] -= sign * along_u
        H[2, 1] -= sign * along_v
    return energy


@jit_making_arrays
def _expand(a, radius_a, b, radius_b, plane, g, H):
    """E with its derivatives by the two angles and d, written to g (3,) and the lower half of H (3, 3); plane: n, u, v, d."""
    n, u, v, _ = plane
    g[:] = 0.0
    H[:] = 0.0
    tangents(n, u, v)
    return _side(a, radius_a, 1.0, plane, g, H) + _side(b, radius_b, -1.0, plane, g, H)


@jit
def _solve(H, shift, g, s):
    """Write s = -(H + shift)^-1 g; returns whether H + shift is positive definite."""
    a = H[0, 0] + shift
    if a <= 0.0:
        return False
    l10, l20 = H[1, 0] / a, H[2, 0] / a
    b = H[1, 1] + shift - l10 * H[1, 0]
    if b <= 0.0:
        return False
    l21 = (H[2, 1] - l20 * H[1, 0]) / b
    c = H[2, 2] + shift - l20 * H[2, 0] - l21 * l21 * b
    if c <= 0.0:
        return False
    y1 = -g[1] + l10 * g[0]
    y2 = -g[2] + l20 * g[0] - l21 * y1
    s[2] = y2 / c
    s[1] = y1 / b - l21 * s[2]
    s[0] = -g[0] / a - l10 * s[1] - l20 * s[2]
    return True


@jit_making_arrays
def best_plane(a, radius_a, b, radius_b, n, d):
    """Bring n (3,), in place, and d to the least E nearby; returns d and E.

    a (i, 3), b (j, 3): points, of the size 1, about an origin near the plane.
    """
    u, v, g, s, trial = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    H, other = np.empty((3, 3)), np.empty((3, 3))
    trial_g = np.empty(3)
    energy = _expand(a, radius_a, b, radius_b, (n, u, v, d), g, H)
    shift = 1e-3 * (H[0, 0] + H[1, 1] + H[2, 2])
    for _ in range(ROUNDS):
        least = LEAST_SHIFT * (abs(H[0, 0]) + abs(H[1, 1]) + H[2, 2])
        shift = max(shift, least)
        # The bodies are apart: any plane between them will do.
        if energy == 0.0:
            break
        while not _solve(H, shift, g, s):
            shift *= 10.0
        size = abs(s[0]) + abs(s[1]) + abs(s[2])
        if size <= CONVERGED and shift <= least:
            break
        for k in range(3):
            trial[k] = n[k] + s[0] * u[k] + s[1] * v[k]
        trial /= sqrt(trial[0] * trial[0] + trial[1] * trial[1] + trial[2] * trial[2])
        trial_energy = _expand(a, radius_a, b, radius_b, (trial, u, v, d + s[2]), trial_g, other)
        lower = trial_energy < energy
        # Near the minimum rounding hides the fall of E; the gradient shows it longer.
        if lower or (size <= 1e-9 and np.abs(trial_g).sum() < np.abs(g).sum()):
            energy = trial_energy
            copy_vector(trial, n)
            d += s[2]
            copy_vector(trial_g, g)
            copy_matrix(other, H)
            shift *= 0.1
        else:
            if size <= CONVERGED * 10.0:
                break
            # The trial has changed u and v; g and H belong to those of n.
            tangents(n, u, v)
            # A larger shift shortens the step.
            shift *= 8.0
    return d, energy
