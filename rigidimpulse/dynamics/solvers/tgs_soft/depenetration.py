"""Depenetration: bodies that join a sub-stepped island closer than the contact margin are moved apart, without speed (kernels).

For a contact with normal n, arms r_a, r_b and a separation s < 0 from the contact margin, the smallest displacement in the metric of mass

    p = -s / (n.(M_a^-1 + M_b^-1) n),    dx = M^-1 p n,    with (r x n) for rotations

makes s = 0. Contacts take turns (Gauss and Seidel) until all are met to CLEARED skins, or MOST_PASSES times. Only bodies that are new to
the island are moved. Contacts deeper than DEEPEST skins are left to the solver, which pushes them apart with velocities.
"""

from rigidimpulse.collision.contact_records import SEPARATION, SKIN, in_play
from rigidimpulse.core.kernels import jit
from rigidimpulse.dynamics.solvers.tgs_soft.bodies import INVERSE_MASS, set_inverse_inertia
from rigidimpulse.dynamics.solvers.tgs_soft.body_motion import set_orientation
from rigidimpulse.dynamics.solvers.tgs_soft.records import normal_of, point_of

CLEARED, DEEPEST, MOST_PASSES = 0.01, 1.0, 200


@jit
def _turn_for(bodies, i, x, y, z, nx, ny, nz):
    """Rotation of body i, rad/(N s), for a unit impulse n at the arm (x, y, z), and the share of that in 1/kg."""
    m, o = bodies.mass, 8 * i
    tx, ty, tz = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
    wx = m[o] * tx + m[o + 1] * ty + m[o + 2] * tz
    wy = m[o + 1] * tx + m[o + 3] * ty + m[o + 4] * tz
    wz = m[o + 2] * tx + m[o + 4] * ty + m[o + 5] * tz
    return wx, wy, wz, m[o + INVERSE_MASS] + tx * wx + ty * wy + tz * wz


@jit
def _shift(bodies, i, p, n, w):
    """Move body i by an impulse p n over a unit of time; w: its rotation for a unit impulse."""
    (nx, ny, nz), (wx, wy, wz) = n, w
    move = bodies.mass[8 * i + INVERSE_MASS] * p
    bodies.position[i, 0] += move * nx
    bodies.position[i, 1] += move * ny
    bodies.position[i, 2] += move * nz
    set_orientation(bodies, i, p * wx, p * wy, p * wz)
    if not bodies.alike[i]:
        set_inverse_inertia(bodies, i)


@jit
def move_apart(bodies, pairs, rows, fresh):
    """Move fresh members (n+1,) bool apart from each other and from all else; returns whether any was moved."""
    moved = False
    for _ in range(MOST_PASSES):
        worst = 0.0
        for p in range(pairs.first.shape[0]):
            a, b = pairs.first[p], pairs.second[p]
            if pairs.count[p] == 0 or not (fresh[a] or fresh[b]) or not in_play(bodies.part, a, b):
                continue
            for r in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
                # Deep contacts are left to the solver, which pushes them apart with velocities.
                if rows[r, SEPARATION] < -DEEPEST * rows[r, SKIN]:
                    continue
                nx, ny, nz = normal_of(bodies.position, bodies.rotation, rows, r, a, b, pairs.carrier[p])
                x, y, z, s = point_of(bodies.position, bodies.rotation, rows, r, (a, b), (nx, ny, nz), 0.5)
                if s > -CLEARED * rows[r, SKIN]:
                    continue
                worst, moved = max(worst, -s), True
                dx, dy, dz = (
                    bodies.position[b, 0] - bodies.position[a, 0], bodies.position[b, 1] - bodies.position[a, 1],
                    bodies.position[b, 2] - bodies.position[a, 2],
                )  # fmt: skip
                ax, ay, az, give_a = _turn_for(bodies, a, x, y, z, nx, ny, nz)
                bx, by, bz, give_b = _turn_for(bodies, b, x - dx, y - dy, z - dz, nx, ny, nz)
                give_a, give_b = give_a if fresh[a] else 0.0, give_b if fresh[b] else 0.0
                # The smallest displacement in the metric of mass; only bodies new to the island give way.
                push = -s / (give_a + give_b)
                if fresh[a]:
                    _shift(bodies, a, -push, (nx, ny, nz), (ax, ay, az))
                if fresh[b]:
                    _shift(bodies, b, push, (nx, ny, nz), (bx, by, bz))
        if worst == 0.0:
            break
    return moved
