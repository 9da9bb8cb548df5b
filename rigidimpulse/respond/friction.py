"""Coulomb's law at a single impact: stick when the cone allows it, else slide; energy never grows.

K (3, 3) is the inverse effective mass of the contact (A9), u the relative velocity of the contact points before, n
the normal.

    stick   J = -K^-1 (u + e (u.n) n + e_t u_t),                       accepted if |J_t| <= mu_s J.n
    slide   J = j (n - mu_k d),  j = -(1 + e) (u.n) / (n.K (n - mu_k d)),  d the direction of the slip *after* the impact

d is the root of (slip after) x d = 0 with (slip after).d >= 0, so that friction opposes the slip that remains (de
Saxce and Feng 1998). Without coupling of normal and tangential motion (spheres) it is the slip before, and J_t = mu
j. Newton's law with friction can make energy (Kane and Levinson 1985): then e and e_t are reduced together by the
factor at which no energy is made; for both zero the impact dissipates.
"""

from math import cos, pi, sin, sqrt

import numpy as np

from rigidimpulse._jit import jit

DIRECTIONS = 32
BISECTIONS = 60
# Round-off that counts as no energy, relative to the energy the impulse moves.
ENERGY_ROUND_OFF = 1e-15


@jit
def solve_3(k, x, y, z):
    """k^-1 (x, y, z) by the adjugate of the symmetric k."""
    a = k[1, 1] * k[2, 2] - k[1, 2] * k[1, 2]
    b = k[0, 2] * k[1, 2] - k[0, 1] * k[2, 2]
    c = k[0, 1] * k[1, 2] - k[0, 2] * k[1, 1]
    det = k[0, 0] * a + k[0, 1] * b + k[0, 2] * c
    d = k[0, 0] * k[2, 2] - k[0, 2] * k[0, 2]
    e = k[0, 1] * k[0, 2] - k[0, 0] * k[1, 2]
    f = k[0, 0] * k[1, 1] - k[0, 1] * k[0, 1]
    return (a * x + b * y + c * z) / det, (b * x + d * y + e * z) / det, (c * x + e * y + f * z) / det


@jit
def tangents(n, t1, t2):
    """Two unit vectors that complete n to a right-handed frame, without a branch cut near n (Duff et al. 2017)."""
    s = 1.0 if n[2] >= 0.0 else -1.0
    a = -1.0 / (s + n[2])
    b = n[0] * n[1] * a
    t1[0], t1[1], t1[2] = 1.0 + s * n[0] * n[0] * a, s * b, -s * n[0]
    t2[0], t2[1], t2[2] = b, s + n[1] * n[1] * a, -n[1]


@jit
def _slide(k, n, t1, t2, u, e, mu, angle, impulse):
    """Impulse for slip direction `angle` in the tangent plane; returns (cross, dot) of d and the slip after it."""
    ca, sa = cos(angle), sin(angle)
    fx = n[0] - mu * (ca * t1[0] + sa * t2[0])
    fy = n[1] - mu * (ca * t1[1] + sa * t2[1])
    fz = n[2] - mu * (ca * t1[2] + sa * t2[2])
    kx = k[0, 0] * fx + k[0, 1] * fy + k[0, 2] * fz
    ky = k[1, 0] * fx + k[1, 1] * fy + k[1, 2] * fz
    kz = k[2, 0] * fx + k[2, 1] * fy + k[2, 2] * fz
    denominator = n[0] * kx + n[1] * ky + n[2] * kz
    un = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    if denominator <= 0.0:
        impulse[0] = impulse[1] = impulse[2] = 0.0
        return 0.0, -1.0
    j = -(1.0 + e) * un / denominator
    impulse[0], impulse[1], impulse[2] = j * fx, j * fy, j * fz
    x, y, z = u[0] + j * kx, u[1] + j * ky, u[2] + j * kz
    s1 = x * t1[0] + y * t1[1] + z * t1[2]
    s2 = x * t2[0] + y * t2[1] + z * t2[2]
    return ca * s2 - sa * s1, ca * s1 + sa * s2


@jit
def _sliding_impulse(k, n, t1, t2, u, e, mu, impulse):
    """Find the direction of the remaining slip by a scan and bisection; False if there is none (then the contact sticks)."""
    from_angle = np.arctan2(
        u[0] * t2[0] + u[1] * t2[1] + u[2] * t2[2],
        u[0] * t1[0] + u[1] * t1[1] + u[2] * t1[2],
    )
    cross, dot = _slide(k, n, t1, t2, u, e, mu, from_angle, impulse)
    if cross == 0.0 and dot >= 0.0:
        return True
    step = 2.0 * pi / DIRECTIONS
    # Brackets nearest to the slip before are tried first: the direction turns little in most impacts.
    for i in range(DIRECTIONS):
        offset = ((i + 1) // 2) * step * (1.0 if i % 2 == 1 else -1.0)
        low = from_angle + offset - 0.5 * step
        high = low + step
        cross_low, _ = _slide(k, n, t1, t2, u, e, mu, low, impulse)
        cross_high, _ = _slide(k, n, t1, t2, u, e, mu, high, impulse)
        if cross_low * cross_high > 0.0:
            continue
        for _bisection in range(BISECTIONS):
            middle = 0.5 * (low + high)
            cross, dot = _slide(k, n, t1, t2, u, e, mu, middle, impulse)
            if cross * cross_low > 0.0:
                low = middle
            else:
                high = middle
        if dot >= 0.0 and impulse[0] * n[0] + impulse[1] * n[1] + impulse[2] * n[2] > 0.0:
            return True
    return False


@jit
def _impulse_for(k, n, t1, t2, u, e, e_t, mu_s, mu_k, impulse):
    un = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    if mu_s <= 0.0 and mu_k <= 0.0:
        kn = 0.0
        for a in range(3):
            for b in range(3):
                kn += n[a] * k[a, b] * n[b]
        j = -(1.0 + e) * un / kn
        for a in range(3):
            impulse[a] = j * n[a]
        return
    bounce = (e - e_t) * un
    x, y, z = solve_3(
        k,
        -((1.0 + e_t) * u[0] + bounce * n[0]),
        -((1.0 + e_t) * u[1] + bounce * n[1]),
        -((1.0 + e_t) * u[2] + bounce * n[2]),
    )
    j = x * n[0] + y * n[1] + z * n[2]
    tx, ty, tz = x - j * n[0], y - j * n[1], z - j * n[2]
    sticks = sqrt(tx * tx + ty * ty + tz * tz) <= mu_s * j
    if sticks or not _sliding_impulse(k, n, t1, t2, u, e, mu_k, impulse):
        impulse[0], impulse[1], impulse[2] = x, y, z


@jit
def energy_change(k, u, impulse):
    """Change of kinetic energy by an impulse at one contact, J.u + J.K J / 2 [J], and the energy it moves."""
    linear = quadratic = 0.0
    for a in range(3):
        linear += impulse[a] * u[a]
        for b in range(3):
            quadratic += 0.5 * impulse[a] * k[a, b] * impulse[b]
    return linear + quadratic, abs(linear) + quadratic


@jit
def contact_impulse(k, n, u, e, e_t, mu_s, mu_k, t1, t2, impulse):
    """The impulse [N s] on body b of one impact, into `impulse` (3,); t1, t2 (3,) are scratch. Needs u.n < 0."""
    tangents(n, t1, t2)
    _impulse_for(k, n, t1, t2, u, e, e_t, mu_s, mu_k, impulse)
    if mu_s <= 0.0 and mu_k <= 0.0:
        return
    change, moved = energy_change(k, u, impulse)
    if change <= ENERGY_ROUND_OFF * moved:
        return
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        _impulse_for(k, n, t1, t2, u, middle * e, middle * e_t, mu_s, mu_k, impulse)
        change, moved = energy_change(k, u, impulse)
        if change <= 0.0:
            low = middle
        else:
            high = middle
    _impulse_for(k, n, t1, t2, u, low * e, low * e_t, mu_s, mu_k, impulse)
