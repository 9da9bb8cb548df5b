"""The passes of the solver of heaps over batches of patches, see `heap_solver` for the method and `heap_records` for the record.

With d = (x_b - x_a) moved since the step began, the arms of a patch are those to one point O that goes along with both bodies:
r_a = ARM_A + (1 - s) d, r_b = ARM_B - s d, s = SHARE, so that impulses leave no torque over. The gap at a point c of a body that has turned
by the rotation vector h has changed along n, to second order, by c.G with G = h x (h x n) / 2 - h x n.

At O the patch has relative velocity u and spin w. A point (x, y) moves along n at u.n + y w.t_1 - x w.t_2; its impulse p is one along n
at O and a torque p (y t_1 - x t_2). A pass finds the impulses of a patch one after the other by the couplings between them (Gauss-
Seidel) and gives their sum to the bodies.
"""

from __future__ import annotations

from rigidimpulse._jit import jit
from rigidimpulse.constrain.heap_records import (
    ARM_A,
    ARM_B,
    BETWEEN,
    DEPTH,
    FIELDS,
    GAP,
    HARD,
    LEVER,
    MASS,
    MU_DYNAMIC,
    MU_STATIC,
    NORMAL,
    POINT,
    POINT_SIZE,
    PRESS,
    PUSH_1,
    PUSH_2,
    RADIUS_A,
    RADIUS_B,
    SHARE,
    SOFT,
    STEP_N,
    STEP_T,
    STIFF,
    TANGENT_1,
    TANGENT_2,
    TO_NORMAL,
    TO_TURN_1,
    TO_TURN_2,
    TWIST,
    TWIST_TO_1,
    TWIST_TO_2,
    X,
    Y,
)
from rigidimpulse.constrain.lanes import fma, gather, load, root, scatter, spread, store, where_greater, width_of

DEEPEST = 10.0
"""Depth, in skins, beyond which a contact pushes no harder."""
TINY = 1e-30


@jit
def _cross(a, b):
    return fma(a[1], b[2], -(a[2] * b[1])), fma(a[2], b[0], -(a[0] * b[2])), fma(a[0], b[1], -(a[1] * b[0]))


@jit
def _dot(a, b):
    return fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2]))


@jit
def _times(m, a):
    """The symmetric matrix m (xx, xy, xz, yy, yz, zz) times a."""
    return (
        fma(m[0], a[0], fma(m[1], a[1], m[2] * a[2])),
        fma(m[1], a[0], fma(m[3], a[1], m[4] * a[2])),
        fma(m[2], a[0], fma(m[4], a[1], m[5] * a[2])),
    )


@jit
def _add(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@jit
def _less(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@jit
def _along(a, f, b):
    """a + f b."""
    return fma(f, b[0], a[0]), fma(f, b[1], a[1]), fma(f, b[2], a[2])


@jit
def _three(lanes, record, at):
    """The field of three at `at`."""
    w = width_of(lanes)
    return load(lanes, record, at), load(lanes, record, at + w), load(lanes, record, at + 2 * w)


@jit
def _linear(row):
    return row[0], row[1], row[2]


@jit
def _angular(row):
    return row[3], row[4], row[5]


@jit
def prepare(lanes, batches, number, mass, soft):
    """Effective masses, couplings and springs of all patches; soft (2, 3) from `heap_solver.softness`: movable, immovable."""
    w = width_of(lanes)
    record, one, zero, tiny, half = batches.record, spread(lanes, 1.0), spread(lanes, 0.0), spread(lanes, TINY), spread(lanes, 0.5)
    for k in range(number):
        o = k * FIELDS * w
        ma, mb = gather(lanes, mass, batches.first, k * w), gather(lanes, mass, batches.second, k * w)
        im = ma[6] + mb[6]
        n = _three(lanes, record, o + NORMAL * w)
        t = _three(lanes, record, o + TANGENT_1 * w)
        u = _three(lanes, record, o + TANGENT_2 * w)
        arm_a, arm_b = _three(lanes, record, o + ARM_A * w), _three(lanes, record, o + ARM_B * w)
        # In the place of a spring between movable bodies one twice as stiff against what is not.
        both = ma[6] * mb[6]
        stiff = where_greater(both, zero, spread(lanes, soft[0, 0]), spread(lanes, soft[1, 0]))
        store(record, o + STIFF * w, stiff)
        store(record, o + HARD * w, where_greater(both, zero, spread(lanes, soft[0, 1]), spread(lanes, soft[1, 1])))
        store(record, o + SOFT * w, where_greater(both, zero, spread(lanes, soft[0, 2]), spread(lanes, soft[1, 2])))
        store(record, o + DEPTH * w, load(lanes, record, o + DEPTH * w) * stiff * spread(lanes, DEEPEST))
        turning = (ma[0] + mb[0], ma[1] + mb[1], ma[2] + mb[2], ma[3] + mb[3], ma[4] + mb[4], ma[5] + mb[5])
        at_t, at_u, at_n = _times(turning, t), _times(turning, u), _times(turning, n)
        k44, k45, k55 = _dot(t, at_t), _dot(t, at_u), _dot(u, at_u)
        k46, k56, k66 = _dot(t, at_n), _dot(u, at_n), _dot(n, at_n)
        na, nb = _cross(arm_a, n), _cross(arm_b, n)
        ta, tb = _cross(arm_a, t), _cross(arm_b, t)
        ua, ub = _cross(arm_a, u), _cross(arm_b, u)
        ia, ib = _times(ma, na), _times(mb, nb)
        sum_n = _add(ia, ib)
        k33 = im + (_dot(na, ia) + _dot(nb, ib))
        k31, k32 = _dot(ta, ia) + _dot(tb, ib), _dot(ua, ia) + _dot(ub, ib)
        k34, k35, k36 = _dot(t, sum_n), _dot(u, sum_n), _dot(n, sum_n)
        ia, ib = _times(ma, ta), _times(mb, tb)
        sum_t = _add(ia, ib)
        k11, k12 = im + (_dot(ta, ia) + _dot(tb, ib)), _dot(ua, ia) + _dot(ub, ib)
        k14, k15, k16 = _dot(t, sum_t), _dot(u, sum_t), _dot(n, sum_t)
        ia, ib = _times(ma, ua), _times(mb, ub)
        sum_u = _add(ia, ib)
        k22 = im + (_dot(ua, ia) + _dot(ub, ib))
        k24, k25, k26 = _dot(t, sum_u), _dot(u, sum_u), _dot(n, sum_u)
        uneven = half * (k11 - k22)
        store(record, o + STEP_T * w, one / (half * (k11 + k22) + root(fma(uneven, uneven, k12 * k12)) + tiny))
        store(record, o + STEP_N * w, one / (k66 + tiny))
        _store_three(record, o + TO_NORMAL * w, w, k31, k32, k36)
        _store_three(record, o + TO_TURN_1 * w, w, k14, k24, k46)
        _store_three(record, o + TO_TURN_2 * w, w, k15, k25, k56)
        store(record, o + TWIST_TO_1 * w, k16)
        store(record, o + TWIST_TO_2 * w, k26)
        _prepare_points(lanes, record, o, k33, k34, k35, k44, k45, k55)


@jit
def _store_three(record, at, w, a, b, c):
    store(record, at, a)
    store(record, at + w, b)
    store(record, at + 2 * w, c)


@jit
def _prepare_points(lanes, record, o, k33, k34, k35, k44, k45, k55):
    """Effective masses of the points along n, and how they push each other."""
    w = width_of(lanes)
    tiny = spread(lanes, TINY)
    place = o + BETWEEN * w
    for c in range(4):
        g = o + (POINT + POINT_SIZE * c) * w
        x, y = load(lanes, record, g + X * w), load(lanes, record, g + Y * w)
        own = k33 + (y + y) * k34 - (x + x) * k35 + y * y * k44 - (x + x) * y * k45 + x * x * k55
        store(record, g + MASS * w, load(lanes, record, g + MASS * w) / (own + tiny))
        for d in range(c + 1, 4):
            q = o + (POINT + POINT_SIZE * d) * w
            x1, y1 = load(lanes, record, q + X * w), load(lanes, record, q + Y * w)
            store(record, place, k33 + (y + y1) * k34 - (x + x1) * k35 + y * y1 * k44 - fma(x, y1, x1 * y) * k45 + x * x1 * k55)
            place += w


@jit
def _arms(lanes, record, o, xa, xb):
    """The arms to O, and how far b has moved from a."""
    w = width_of(lanes)
    share = load(lanes, record, o + SHARE * w)
    d = (xb[0] - xa[0], xb[1] - xa[1], xb[2] - xa[2])
    arm_a, arm_b = _three(lanes, record, o + ARM_A * w), _three(lanes, record, o + ARM_B * w)
    return _along(arm_a, spread(lanes, 1.0) - share, d), _along(arm_b, -share, d), d


@jit
def _push(velocity, batches, first, va, vb, ma, mb, arm_a, arm_b, f, torque):
    """Give the impulse f at O and the torque to b and their opposites to a."""
    ta, tb = _times(ma, _add(_cross(arm_a, f), torque)), _times(mb, _add(_cross(arm_b, f), torque))
    a, b = -ma[6], mb[6]
    scatter(
        velocity, batches.first, first,
        (fma(a, f[0], va[0]), fma(a, f[1], va[1]), fma(a, f[2], va[2]), va[3] - ta[0], va[4] - ta[1], va[5] - ta[2], va[6], va[7]),
    )  # fmt: skip
    scatter(
        velocity, batches.second, first,
        (fma(b, f[0], vb[0]), fma(b, f[1], vb[1]), fma(b, f[2], vb[2]), vb[3] + tb[0], vb[4] + tb[1], vb[5] + tb[2], vb[6], vb[7]),
    )  # fmt: skip


@jit
def _sum_up(t, u, n, along_t, along_u, along_n):
    """along_t t + along_u u + along_n n."""
    return (
        fma(t[0], along_t, fma(u[0], along_u, n[0] * along_n)),
        fma(t[1], along_t, fma(u[1], along_u, n[1] * along_n)),
        fma(t[2], along_t, fma(u[2], along_u, n[2] * along_n)),
    )


@jit
def warm_start(lanes, batches, number, velocity, moved, mass):
    """Give all bodies the impulses carried over."""
    w = width_of(lanes)
    record, zero = batches.record, spread(lanes, 0.0)
    for k in range(number):
        o = k * FIELDS * w
        va, vb = gather(lanes, velocity, batches.first, k * w), gather(lanes, velocity, batches.second, k * w)
        ma, mb = gather(lanes, mass, batches.first, k * w), gather(lanes, mass, batches.second, k * w)
        xa, xb = gather(lanes, moved, batches.first, k * w), gather(lanes, moved, batches.second, k * w)
        arm_a, arm_b, _ = _arms(lanes, record, o, xa, xb)
        press, turn_1, turn_2 = zero, zero, zero
        for c in range(batches.points[k]):
            g = o + (POINT + POINT_SIZE * c) * w
            p = load(lanes, record, g + PRESS * w)
            press = press + p
            turn_1, turn_2 = fma(p, load(lanes, record, g + Y * w), turn_1), fma(-p, load(lanes, record, g + X * w), turn_2)
        f1 = where_greater(press, zero, load(lanes, record, o + PUSH_1 * w), zero)
        f2 = where_greater(press, zero, load(lanes, record, o + PUSH_2 * w), zero)
        twist = where_greater(press, zero, load(lanes, record, o + TWIST * w), zero)
        _store_three(record, o + PUSH_1 * w, w, f1, f2, twist)
        n = _three(lanes, record, o + NORMAL * w)
        t, u = _three(lanes, record, o + TANGENT_1 * w), _three(lanes, record, o + TANGENT_2 * w)
        f, torque = _sum_up(t, u, n, f1, f2, press), _sum_up(t, u, n, turn_1, turn_2, twist)
        _push(velocity, batches, k * w, va, vb, ma, mb, arm_a, arm_b, f, torque)


@jit
def _clamp(lanes, x, limit):
    x = where_greater(x, limit, limit, x)
    return where_greater(-limit, x, -limit, x)


@jit
def _rub(lanes, record, o, points, u1, u2, w3):
    """Friction of a patch with slip (u1, u2) and spin w3 about n: the changes of its impulses along t_1, t_2 and about n."""
    w = width_of(lanes)
    zero, one = spread(lanes, 0.0), spread(lanes, 1.0)
    press, lever = zero, zero
    for c in range(points):
        g = o + (POINT + POINT_SIZE * c) * w
        p = load(lanes, record, g + PRESS * w)
        press, lever = press + p, fma(p, load(lanes, record, g + LEVER * w), lever)
    static, dynamic = load(lanes, record, o + MU_STATIC * w), load(lanes, record, o + MU_DYNAMIC * w)
    old = load(lanes, record, o + TWIST * w)
    free = fma(-load(lanes, record, o + STEP_N * w), w3, old)
    size = where_greater(free, zero, free, -free)
    new = where_greater(size, static * lever, _clamp(lanes, free, dynamic * lever), free)
    store(record, o + TWIST * w, new)
    d3 = new - old
    u1 = fma(load(lanes, record, o + TWIST_TO_1 * w), d3, u1)
    u2 = fma(load(lanes, record, o + TWIST_TO_2 * w), d3, u2)
    old_1, old_2 = load(lanes, record, o + PUSH_1 * w), load(lanes, record, o + PUSH_2 * w)
    step = load(lanes, record, o + STEP_T * w)
    f1, f2 = fma(-step, u1, old_1), fma(-step, u2, old_2)
    square, most = fma(f1, f1, f2 * f2), static * press
    factor = where_greater(square, most * most, dynamic * press / root(square + spread(lanes, TINY * TINY)), one)
    f1, f2 = f1 * factor, f2 * factor
    store(record, o + PUSH_1 * w, f1)
    store(record, o + PUSH_2 * w, f2)
    return f1 - old_1, f2 - old_2, d3


@jit
def _press(lanes, record, g, speed, gap, relaxing, per_h, stiff, hard, soft, deepest):
    """Normal impulse of the points at g that approach at -speed, in m/s; returns its change."""
    w = width_of(lanes)
    zero = spread(lanes, 0.0)
    mass, old = load(lanes, record, g + MASS * w), load(lanes, record, g + PRESS * w)
    if relaxing:
        new = fma(-mass, fma(where_greater(gap, zero, gap, zero), per_h, speed), old)
    else:
        spring = where_greater(stiff * gap, -deepest, stiff * gap, -deepest)
        bias = where_greater(gap, zero, gap * per_h, spring)
        share = where_greater(gap, zero, spread(lanes, 1.0), hard)
        kept = where_greater(gap, zero, zero, soft)
        new = fma(-(mass * share), speed + bias, fma(-kept, old, old))
    new = where_greater(new, zero, new, zero)
    store(record, g + PRESS * w, new)
    return new - old


@jit
def _turned_normal(theta, n, half):
    """G of a body turned by theta."""
    across = _cross(theta, n)
    twice = _cross(theta, across)
    return fma(half, twice[0], -across[0]), fma(half, twice[1], -across[1]), fma(half, twice[2], -across[2])


@jit
def solve(lanes, batches, number, velocity, moved, mass, h, relaxing):
    """One pass over all patches; relaxing: the one with friction and without springs, after the bodies have moved."""
    w = width_of(lanes)
    record, zero, per_h, half = batches.record, spread(lanes, 0.0), spread(lanes, 1.0 / h), spread(lanes, 0.5)
    for k in range(number):
        o, points = k * FIELDS * w, batches.points[k]
        va, vb = gather(lanes, velocity, batches.first, k * w), gather(lanes, velocity, batches.second, k * w)
        xa, xb = gather(lanes, moved, batches.first, k * w), gather(lanes, moved, batches.second, k * w)
        n = _three(lanes, record, o + NORMAL * w)
        t, u = _three(lanes, record, o + TANGENT_1 * w), _three(lanes, record, o + TANGENT_2 * w)
        arm_a, arm_b, d = _arms(lanes, record, o, xa, xb)
        # How the gap has changed: at O, and from there along t_1 and t_2.
        ga, gb = _turned_normal(_angular(xa), n, half), _turned_normal(_angular(xb), n, half)
        core_a = _along(_three(lanes, record, o + ARM_A * w), -load(lanes, record, o + RADIUS_A * w), n)
        core_b = _along(_three(lanes, record, o + ARM_B * w), load(lanes, record, o + RADIUS_B * w), n)
        at_o = _dot(n, d) + (_dot(gb, core_b) - _dot(ga, core_a))
        between = _less(gb, ga)
        slope_1, slope_2 = _dot(t, between), _dot(u, between)
        # Relative velocity at O and relative spin, along the axes.
        slip = _less(_add(_linear(vb), _cross(_angular(vb), arm_b)), _add(_linear(va), _cross(_angular(va), arm_a)))
        spin = _less(_angular(vb), _angular(va))
        un, w1, w2 = _dot(n, slip), _dot(t, spin), _dot(u, spin)
        f1, f2, f3 = zero, zero, zero
        if relaxing:
            f1, f2, f3 = _rub(lanes, record, o, points, _dot(t, slip), _dot(u, slip), _dot(n, spin))
            un = _coupled(lanes, record, o + TO_NORMAL * w, f1, f2, f3, un)
            w1 = _coupled(lanes, record, o + TO_TURN_1 * w, f1, f2, f3, w1)
            w2 = _coupled(lanes, record, o + TO_TURN_2 * w, f1, f2, f3, w2)
        press, turn_1, turn_2 = _press_points(lanes, record, o, points, un, w1, w2, at_o, slope_1, slope_2, relaxing, per_h)
        ma, mb = gather(lanes, mass, batches.first, k * w), gather(lanes, mass, batches.second, k * w)
        f, torque = _sum_up(t, u, n, f1, f2, press), _sum_up(t, u, n, turn_1, turn_2, f3)
        _push(velocity, batches, k * w, va, vb, ma, mb, arm_a, arm_b, f, torque)


@jit
def _coupled(lanes, record, at, f1, f2, f3, speed):
    c = _three(lanes, record, at)
    return fma(c[0], f1, fma(c[1], f2, fma(c[2], f3, speed)))


@jit
def _press_points(lanes, record, o, points, un, w1, w2, at_o, slope_1, slope_2, relaxing, per_h):
    """Normal impulses of the points of a patch; returns the sum of their changes along n and its torque about t_1 and t_2."""
    w = width_of(lanes)
    zero = spread(lanes, 0.0)
    stiff, hard = load(lanes, record, o + STIFF * w), load(lanes, record, o + HARD * w)
    soft, deepest = load(lanes, record, o + SOFT * w), load(lanes, record, o + DEPTH * w)
    press, turn_1, turn_2 = zero, zero, zero
    p0, p1, p2 = zero, zero, zero
    for c in range(points):
        g = o + (POINT + POINT_SIZE * c) * w
        x, y = load(lanes, record, g + X * w), load(lanes, record, g + Y * w)
        gap = load(lanes, record, g + GAP * w) + (at_o + fma(x, slope_1, y * slope_2))
        speed = fma(y, w1, fma(-x, w2, un))
        if c == 1:
            speed = fma(load(lanes, record, o + BETWEEN * w), p0, speed)
        elif c == 2:
            speed = fma(load(lanes, record, o + (BETWEEN + 1) * w), p0, speed)
            speed = fma(load(lanes, record, o + (BETWEEN + 3) * w), p1, speed)
        elif c == 3:
            speed = fma(load(lanes, record, o + (BETWEEN + 2) * w), p0, speed)
            speed = fma(load(lanes, record, o + (BETWEEN + 4) * w), p1, speed)
            speed = fma(load(lanes, record, o + (BETWEEN + 5) * w), p2, speed)
        change = _press(lanes, record, g, speed, gap, relaxing, per_h, stiff, hard, soft, deepest)
        if c == 0:
            p0 = change
        elif c == 1:
            p1 = change
        elif c == 2:
            p2 = change
        press, turn_1, turn_2 = press + change, fma(change, y, turn_1), fma(-change, x, turn_2)
    return press, turn_1, turn_2
