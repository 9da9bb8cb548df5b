"""The sub-stepped solver of heaps: soft contacts with a skin, a relaxing pass, friction in a cone (kernels).

A step is cut into sub-steps of length h. In each of them, for every body and every contact with normal n, separation s
(gap less the skin), effective masses m = 1 / (n.K n) and m_t = 1 / tr(K_t), and normal impulse p and friction f carried over
from the sub-step before (a warm start):

    v <- v + h g                                                                gravity
    v <- v + M^-1 J^T (p n + f)                                                 warm start
    p <- max(0, (1 - i) p - m k (u_n + c))                                      normal row, with
         s > 0:   c = s / h,        k = 1,          i = 0                       (free to close the gap, no further)
         s <= 0:  c = s w / a_1,    k = a_2 a_3,    i = a_3                     (spring and damper, implicit)
    x <- x + h v,   q <- exp(h w) q                                             and where no contact pushed: x <- x - h^2 g / 2
    f <- f - m_t u_t,  |f| > mu_s p:  f <- mu_k p f / |f|                       friction, before the normal row
    p once more with k = 1, i = 0, c = max(s, 0) / h                            relax: takes out the speed the spring gave

Friction is found in the relaxing pass only, from speeds that the spring has no part in: with it in both passes a stack of three
boxes rocks for ever at some cm/s. A contact that closes gets its friction at once.

w = 2 pi F / h is the frequency of the spring, z its damping ratio, a_1 = 2 z + h w, a_2 = h w a_1, a_3 = 1 / (1 + a_2); twice
w against what cannot be moved. Rows are visited in the order of the pairs (Gauss-Seidel). Separations and arms are
those of points fixed in the bodies, anew in every sub-step; radii are taken along the normal, so that balls roll.
At the end of a sub-step contacts that were seen at u_n < -sqrt(2 g skin) / e and are closed by now leave at -e u_n. The
torque-free part of rotation keeps the angular momentum: w <- I(q')^-1 I(q) w, with q' from the spin at mid-way.

Method: Macklin et al., Small steps in physics simulation, 2019; the relaxing pass and restitution after E. Catto, Solver2D
(2024). The load of a column of k bodies presses the skin in by k g / w^2; the error is of first order in h.
"""

from math import pi, sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.heap_motion import kick, move
from rigidimpulse.constrain.heap_rows import (
    APPROACH,
    ARM_A,
    ARM_B,
    CORE_A,
    CORE_B,
    DYNAMIC_FRICTION,
    FRICTION,
    IMPULSE,
    MASS_N,
    MASS_T,
    RESTITUTION,
    ROUND_A,
    ROUND_B,
    SEPARATION,
    SKIN,
    STATIC_FRICTION,
    pair_speeds,
    turned_row,
)

FREQUENCY = 0.25
"""F: frequency of the spring in sub-steps."""
DAMPING = 10.0
"""z: damping ratio."""
DEEPEST = 10.0
"""Depth, in skins, beyond which a contact pushes no harder."""
TINY = 1e-300


def softness(h: float) -> np.ndarray:
    """Rows (w / a_1 [1/s], a_2 a_3, a_3): between movable bodies, against immovable ones, and twice those of the relaxing pass, (4, 3)."""
    out = np.zeros((4, 3))
    for k, factor in enumerate((1.0, 2.0)):
        w = factor * 2.0 * pi * FREQUENCY / h
        a_1 = 2.0 * DAMPING + h * w
        a_2 = h * w * a_1
        a_3 = 1.0 / (1.0 + a_2)
        out[k] = w / a_1, a_2 * a_3, a_3
        out[2 + k] = 0.0, 1.0, 0.0
    return out


@jit
def _add_turn(m, rx, ry, rz, x, y, z):
    """(r x d) . I^-1 (r x d) for d = (x, y, z); m a row of `HeapBodies.mass`."""
    cx, cy, cz = ry * z - rz * y, rz * x - rx * z, rx * y - ry * x
    return (
        cx * (m[1] * cx + m[2] * cy + m[3] * cz)
        + cy * (m[2] * cx + m[4] * cy + m[5] * cz)
        + cz * (m[3] * cx + m[5] * cy + m[6] * cz)
    )


@jit
def _effective_masses(bodies, a, b, row):
    """Fill m and m_t; the trace of K bounds its largest eigenvalue, whatever the tangents."""
    ma, mb = bodies.mass[a], bodies.mass[b]
    ax, ay, az = row[ARM_A], row[ARM_A + 1], row[ARM_A + 2]
    bx, by, bz = row[ARM_B], row[ARM_B + 1], row[ARM_B + 2]
    linear = ma[0] + mb[0]
    normal = _add_turn(ma, ax, ay, az, row[0], row[1], row[2]) + _add_turn(mb, bx, by, bz, row[0], row[1], row[2])
    trace = 0.0
    for k in range(3):
        x, y, z = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
        trace += _add_turn(ma, ax, ay, az, x, y, z) + _add_turn(mb, bx, by, bz, x, y, z)
    row[MASS_N] = 1.0 / (linear + normal)
    row[MASS_T] = 1.0 / (linear + max(trace - normal, 0.0))


@jit
def _turn_normal(row, x, y, z):
    """The normal of two rounded surfaces runs between their centres, (x, y, z) apart; friction stays across it."""
    length = sqrt(x * x + y * y + z * z)
    if length > TINY:
        row[0], row[1], row[2] = x / length, y / length, z / length
        along = row[FRICTION] * row[0] + row[FRICTION + 1] * row[1] + row[FRICTION + 2] * row[2]
        for k in range(3):
            row[FRICTION + k] -= along * row[k]


@jit
def _place(bodies, pairs, rows):
    """Arms, normals of two rounded surfaces, and separations of all rows at the present poses."""
    for p in range(pairs.first.shape[0]):
        if pairs.count[p] == 0:
            continue
        a, b = pairs.first[p], pairs.second[p]
        ra, rb = bodies.rotation[a], bodies.rotation[b]
        # Impulses act at one point, so that no torque is left over: mid-way, or on the surface of what can move, so that it rolls.
        share = 0.5 if bodies.mass[b, 0] > 0.0 else 1.0
        share = share if bodies.mass[a, 0] > 0.0 else 0.0
        dx = bodies.position[b, 0] - bodies.position[a, 0]
        dy = bodies.position[b, 1] - bodies.position[a, 1]
        dz = bodies.position[b, 2] - bodies.position[a, 2]
        for c in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
            row = rows[c]
            ax, ay, az = turned_row(ra, row, CORE_A)
            bx, by, bz = turned_row(rb, row, CORE_B)
            x, y, z = dx + (bx - ax), dy + (by - ay), dz + (bz - az)
            round_a, round_b = row[ROUND_A], row[ROUND_B]
            if round_a > 0.0 and round_b > 0.0:
                _turn_normal(row, x, y, z)
            nx, ny, nz = row[0], row[1], row[2]
            row[SEPARATION] = (x * nx + y * ny + z * nz) - (round_a + round_b) - row[SKIN]
            px, py, pz = ax + round_a * nx, ay + round_a * ny, az + round_a * nz
            qx, qy, qz = dx + (bx - round_b * nx), dy + (by - round_b * ny), dz + (bz - round_b * nz)
            ax, ay, az = share * px + (1.0 - share) * qx, share * py + (1.0 - share) * qy, share * pz + (1.0 - share) * qz
            row[ARM_A], row[ARM_A + 1], row[ARM_A + 2] = ax, ay, az
            row[ARM_B], row[ARM_B + 1], row[ARM_B + 2] = ax - dx, ay - dy, az - dz


@jit
def _push(v, m, sign, row, at, x, y, z):
    """Add the impulse sign (x, y, z) at the arm row[at:] to the velocity row v (6,)."""
    x, y, z = sign * x, sign * y, sign * z
    v[0] += m[0] * x
    v[1] += m[0] * y
    v[2] += m[0] * z
    tx = row[at + 1] * z - row[at + 2] * y
    ty = row[at + 2] * x - row[at] * z
    tz = row[at] * y - row[at + 1] * x
    v[3] += m[1] * tx + m[2] * ty + m[3] * tz
    v[4] += m[2] * tx + m[4] * ty + m[5] * tz
    v[5] += m[3] * tx + m[5] * ty + m[6] * tz


@jit
def _point_velocity(v, row, at):
    return (
        v[0] + (v[4] * row[at + 2] - v[5] * row[at + 1]),
        v[1] + (v[5] * row[at] - v[3] * row[at + 2]),
        v[2] + (v[3] * row[at + 1] - v[4] * row[at]),
    )


@jit
def _slip_velocity(va, vb, row):
    ax, ay, az = _point_velocity(va, row, ARM_A)
    bx, by, bz = _point_velocity(vb, row, ARM_B)
    return bx - ax, by - ay, bz - az


@jit
def _apply(bodies, a, b, row, x, y, z):
    """The impulse (x, y, z) on b and its opposite on a; returns the work that an immovable body does by it [J]."""
    va, vb, ma, mb = bodies.velocity[a], bodies.velocity[b], bodies.mass[a], bodies.mass[b]
    if ma[0] > 0.0 and mb[0] > 0.0:
        _push(va, ma, -1.0, row, ARM_A, x, y, z)
        _push(vb, mb, 1.0, row, ARM_B, x, y, z)
        return 0.0
    if ma[0] > 0.0:
        _push(va, ma, -1.0, row, ARM_A, x, y, z)
        ux, uy, uz = _point_velocity(vb, row, ARM_B)
        return -(x * ux + y * uy + z * uz)
    _push(vb, mb, 1.0, row, ARM_B, x, y, z)
    ux, uy, uz = _point_velocity(va, row, ARM_A)
    return x * ux + y * uy + z * uz


@jit
def _warm_start(bodies, pairs, rows):
    work = 0.0
    for p in range(pairs.first.shape[0]):
        if pairs.count[p] == 0:
            continue
        a, b = pairs.first[p], pairs.second[p]
        for c in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
            row = rows[c]
            if row[MASS_N] == 0.0:
                _effective_masses(bodies, a, b, row)
            x = row[IMPULSE]
            if x == 0.0:
                row[FRICTION] = row[FRICTION + 1] = row[FRICTION + 2] = 0.0
            else:
                work += _apply(
                    bodies, a, b, row, x * row[0] + row[FRICTION], x * row[1] + row[FRICTION + 1], x * row[2] + row[FRICTION + 2]
                )
    return work


@jit
def _friction(row, ux, uy, uz, un, limit):
    """The change of the friction impulse of a row with slip velocity u and the normal impulse `limit`; the row is updated."""
    m = row[MASS_T]
    x = row[FRICTION] - m * (ux - un * row[0])
    y = row[FRICTION + 1] - m * (uy - un * row[1])
    z = row[FRICTION + 2] - m * (uz - un * row[2])
    length = sqrt(x * x + y * y + z * z)
    if length > row[STATIC_FRICTION] * limit:
        share = row[DYNAMIC_FRICTION] * limit / length
        x, y, z = share * x, share * y, share * z
    dx, dy, dz = x - row[FRICTION], y - row[FRICTION + 1], z - row[FRICTION + 2]
    row[FRICTION], row[FRICTION + 1], row[FRICTION + 2] = x, y, z
    return dx, dy, dz


@jit
def _rub(bodies, a, b, row, limit):
    """Friction of a row for the normal impulse `limit`; returns the supports' work."""
    ux, uy, uz = _slip_velocity(bodies.velocity[a], bodies.velocity[b], row)
    un = ux * row[0] + uy * row[1] + uz * row[2]
    x, y, z = _friction(row, ux, uy, uz, un, limit)
    return _apply(bodies, a, b, row, x, y, z)


@jit
def _solve(bodies, pairs, rows, h, soft, first_soft):
    """One pass over all rows; soft (4, 3) from `softness`, of which rows first_soft and the next count. Returns supports' work."""
    work = 0.0
    for p in range(pairs.first.shape[0]):
        a, b = pairs.first[p], pairs.second[p]
        va, vb = bodies.velocity[a], bodies.velocity[b]
        held = first_soft if bodies.mass[a, 0] > 0.0 and bodies.mass[b, 0] > 0.0 else first_soft + 1
        for c in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
            row = rows[c]
            ux, uy, uz = _slip_velocity(va, vb, row)
            un = ux * row[0] + uy * row[1] + uz * row[2]
            s, old = row[SEPARATION], row[IMPULSE]
            if old == 0.0 and un * h + s >= 0.0 and s > 0.0:
                row[FRICTION] = row[FRICTION + 1] = row[FRICTION + 2] = 0.0
                continue
            if row[STATIC_FRICTION] > 0.0 and first_soft > 0:
                x, y, z = _friction(row, ux, uy, uz, un, old)
                work += _apply(bodies, a, b, row, x, y, z)
                ux, uy, uz = _slip_velocity(va, vb, row)
                un = ux * row[0] + uy * row[1] + uz * row[2]
            if s > 0.0:
                new = max(old - row[MASS_N] * (un + s / h), 0.0)
            else:
                bias = soft[held, 0] * max(s, -DEEPEST * row[SKIN])
                new = max((1.0 - soft[held, 2]) * old - row[MASS_N] * soft[held, 1] * (un + bias), 0.0)
            row[IMPULSE] = new
            if new > 0.0:
                bodies.loose[a] = bodies.loose[b] = False
            change = new - old
            work += _apply(bodies, a, b, row, change * row[0], change * row[1], change * row[2])
            if old == 0.0 and new > 0.0 and row[STATIC_FRICTION] > 0.0:
                # It closed just now: its friction belongs to this sub-step.
                work += _rub(bodies, a, b, row, new)
    return work


@jit
def outgrown(bodies, h):
    """Whether a body may meet others than those of its pairs in the next sub-step."""
    for i in range(bodies.mass.shape[0]):
        v = bodies.velocity[i]
        if h * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) > bodies.path[i]:
            return True
    return False


@jit
def stale_pairs(pairs, places):
    """Write the places of the pairs whose contacts must be looked at before the next sub-step; returns their number."""
    count = 0
    for p in range(pairs.first.shape[0]):
        if pairs.slide[p] <= 0.0 or (pairs.count[p] > 0 and pairs.turn[p] < 0.0):
            places[count] = p
            count += 1
    return count


@jit
def _age(bodies, pairs, h):
    """Take the motion of the coming sub-step from what the pairs have left; those that have not enough for another get nothing."""
    for p in range(pairs.first.shape[0]):
        speed, spin = pair_speeds(bodies, pairs, p)
        pairs.slide[p] -= h * speed
        if pairs.slide[p] < h * speed:
            pairs.slide[p] = 0.0
        pairs.turn[p] -= h * spin


@jit
def _rebound(bodies, pairs, rows, gravity):
    """Give contacts that came in fast and are closed their rebound; gravity: its strength [m/s2]. Returns the supports' work [J]."""
    work = 0.0
    for p in range(pairs.first.shape[0]):
        a, b = pairs.first[p], pairs.second[p]
        for c in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
            row = rows[c]
            target = -row[RESTITUTION] * row[APPROACH]
            if row[IMPULSE] == 0.0 or target <= sqrt(2.0 * gravity * row[SKIN]):
                continue
            ux, uy, uz = _slip_velocity(bodies.velocity[a], bodies.velocity[b], row)
            change = max(row[MASS_N] * (target - (ux * row[0] + uy * row[1] + uz * row[2])), 0.0)
            work += _apply(bodies, a, b, row, change * row[0], change * row[1], change * row[2])
            row[APPROACH] = row[IMPULSE] = row[FRICTION] = row[FRICTION + 1] = row[FRICTION + 2] = 0.0
            if row[STATIC_FRICTION] > 0.0:
                work += _rub(bodies, a, b, row, change)
                row[FRICTION] = row[FRICTION + 1] = row[FRICTION + 2] = 0.0
    return work


@jit
def advance(bodies, pairs, rows, most, h, soft, gravity, places):
    """Sub-steps of length h, at most `most`, until pairs must be looked at again. Returns their number and the supports' work [J]."""
    done, work = 0, 0.0
    biased, relaxing = np.int64(0), np.int64(2)
    _place(bodies, pairs, rows)
    while done < most:
        kick(bodies, h)
        work += _warm_start(bodies, pairs, rows)
        work += _solve(bodies, pairs, rows, h, soft, biased)
        _age(bodies, pairs, h)
        move(bodies, h)
        _place(bodies, pairs, rows)
        work += _solve(bodies, pairs, rows, h, soft, relaxing)
        work += _rebound(bodies, pairs, rows, gravity)
        done += 1
        if done < most and (outgrown(bodies, h) or stale_pairs(pairs, places) > 0):
            break
    return done, work


@jit
def note_approach(bodies, pairs, rows):
    """Remember how fast the contacts of all pairs approach, and let their masses be computed anew."""
    _place(bodies, pairs, rows)
    for p in range(pairs.first.shape[0]):
        va, vb = bodies.velocity[pairs.first[p]], bodies.velocity[pairs.second[p]]
        for c in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
            row = rows[c]
            row[MASS_N] = 0.0
            ux, uy, uz = _slip_velocity(va, vb, row)
            row[APPROACH] = ux * row[0] + uy * row[1] + uz * row[2]
