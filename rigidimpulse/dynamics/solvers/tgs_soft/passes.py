"""The passes of the sub-stepped solver over batches of patches; see `solver` for the method and `records` for the record.

With d = (x_b - x_a) moved since the step began, the arms of a patch are those to one point O that goes along with both bodies:
r_a = ARM_A + (1 - s) d, r_b = ARM_B - s d, s = SHARE, so that impulses leave no torque over. The gap at a point c of a body that has turned
by the rotation vector h has changed along n, to second order, by c.G with G = h x (h x n) / 2 - h x n.

At O the patch has relative velocity u and spin w. A point (x, y) moves along n at u.n + y w.t_1 - x w.t_2; its impulse p is one along n
at O and a torque p (y t_1 - x t_2). A pass finds the impulses of a patch one after the other by the couplings between them (Gauss-
Seidel) and gives their sum to the bodies.
"""

from __future__ import annotations

from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.simd import fma, gather, load, root, scatter, spread, store, where_greater, width_of
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.solvers.tgs_soft.records import (
    ARM_A,
    ARM_B,
    ARM_FIELDS,
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

SLIPS = 8.0
"""How many times what static friction bears a sub-step must ask for until a contact slips. A new contact bears little in its first
sub-steps, and friction of the next ones is to stop what slides by then: boxes on a slope between both coefficients slid off it. So what
slips by less than this times mu g h has static friction."""
DEEPEST = 10.0
"""Depth, in skins, beyond which a contact pushes no harder."""
TINY = TOLERANCES.sub_stepping.least_divisor


@inlined
def cross(a, b):
    return fma(a[1], b[2], -(a[2] * b[1])), fma(a[2], b[0], -(a[0] * b[2])), fma(a[0], b[1], -(a[1] * b[0]))


@inlined
def dot(a, b):
    return fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2]))


@inlined
def times(m, a):
    """The symmetric matrix m (xx, xy, xz, yy, yz, zz) times a."""
    return (
        fma(m[0], a[0], fma(m[1], a[1], m[2] * a[2])),
        fma(m[1], a[0], fma(m[3], a[1], m[4] * a[2])),
        fma(m[2], a[0], fma(m[4], a[1], m[5] * a[2])),
    )


@inlined
def add(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def less(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def along(a, f, b):
    """a + f b."""
    return fma(f, b[0], a[0]), fma(f, b[1], a[1]), fma(f, b[2], a[2])


@inlined
def three(simd, record, at):
    """The field of three at `at`."""
    w = width_of(simd)
    return load(simd, record, at), load(simd, record, at + w), load(simd, record, at + 2 * w)


@inlined
def linear(row):
    return row[0], row[1], row[2]


@inlined
def angular(row):
    return row[3], row[4], row[5]


@inlined
def store_three(record, at, w, a, b, c):
    store(record, at, a)
    store(record, at + w, b)
    store(record, at + 2 * w, c)


@inlined
def _arms(simd, batches, k):
    """The arms of batch k as they were when it was made."""
    w = width_of(simd)
    o = k * ARM_FIELDS * w
    return three(simd, batches.arm, o + ARM_A * w), three(simd, batches.arm, o + ARM_B * w)


@inlined
def _moved_arms(simd, arm_a, arm_b, share, xa, xb):
    """The arms to O, and how far b has moved from a."""
    d = (xb[0] - xa[0], xb[1] - xa[1], xb[2] - xa[2])
    return along(arm_a, spread(simd, 1.0) - share, d), along(arm_b, -share, d), d


@inlined
def _push(velocity, batches, first, velocities, masses, arms, impulse):
    """Give the impulse f at O and the torque to b and their opposites to a; each argument holds those of a and of b."""
    (va, vb), (ma, mb), (arm_a, arm_b), (f, torque) = velocities, masses, arms, impulse
    ta, tb = times(ma, add(cross(arm_a, f), torque)), times(mb, add(cross(arm_b, f), torque))
    a, b = -ma[6], mb[6]
    scatter(
        velocity, batches.first, first,
        (fma(a, f[0], va[0]), fma(a, f[1], va[1]), fma(a, f[2], va[2]), va[3] - ta[0], va[4] - ta[1], va[5] - ta[2], va[6], va[7]),
    )  # fmt: skip
    scatter(
        velocity, batches.second, first,
        (fma(b, f[0], vb[0]), fma(b, f[1], vb[1]), fma(b, f[2], vb[2]), vb[3] + tb[0], vb[4] + tb[1], vb[5] + tb[2], vb[6], vb[7]),
    )  # fmt: skip


@inlined
def sum_up(t, u, n, along_t, along_u, along_n):
    """along_t t + along_u u + along_n n."""
    return (
        fma(t[0], along_t, fma(u[0], along_u, n[0] * along_n)),
        fma(t[1], along_t, fma(u[1], along_u, n[1] * along_n)),
        fma(t[2], along_t, fma(u[2], along_u, n[2] * along_n)),
    )


@jit
def warm_start(simd, batches, begin, number, velocity, moved, mass):
    """Give bodies the impulses carried over of the batches from `begin` to `number`; moved: since these were made."""
    w = width_of(simd)
    record, zero = batches.record, spread(simd, 0.0)
    for k in range(begin, number):
        o = k * FIELDS * w
        va, vb = gather(simd, velocity, batches.first, k * w), gather(simd, velocity, batches.second, k * w)
        ma, mb = gather(simd, mass, batches.first, k * w), gather(simd, mass, batches.second, k * w)
        xa, xb = gather(simd, moved, batches.first, k * w), gather(simd, moved, batches.second, k * w)
        arm_a, arm_b = _arms(simd, batches, k)
        arm_a, arm_b, _ = _moved_arms(simd, arm_a, arm_b, load(simd, record, o + SHARE * w), xa, xb)
        press, turn_1, turn_2 = zero, zero, zero
        for c in range(batches.points[k]):
            g = o + (POINT + POINT_SIZE * c) * w
            p = load(simd, record, g + PRESS * w)
            press = press + p
            turn_1, turn_2 = fma(p, load(simd, record, g + Y * w), turn_1), fma(-p, load(simd, record, g + X * w), turn_2)
        # Friction without a normal impulse lies outside the cone, so it is not carried over.
        f1 = where_greater(press, zero, load(simd, record, o + PUSH_1 * w), zero)
        f2 = where_greater(press, zero, load(simd, record, o + PUSH_2 * w), zero)
        twist = where_greater(press, zero, load(simd, record, o + TWIST * w), zero)
        store_three(record, o + PUSH_1 * w, w, f1, f2, twist)
        n = three(simd, record, o + NORMAL * w)
        t, u = three(simd, record, o + TANGENT_1 * w), three(simd, record, o + TANGENT_2 * w)
        f, torque = sum_up(t, u, n, f1, f2, press), sum_up(t, u, n, turn_1, turn_2, twist)
        _push(velocity, batches, k * w, (va, vb), (ma, mb), (arm_a, arm_b), (f, torque))


@inlined
def _clamp(simd, x, limit):
    x = where_greater(x, limit, limit, x)
    return where_greater(-limit, x, -limit, x)


@inlined
def _rub(simd, record, o, press, lever, u1, u2, w3):
    """Friction of a patch with slip (u1, u2) and spin w3 about n: the changes of its impulses along t_1, t_2 and about n.

    press, lever: sum of the normal impulses that are expected, and of that times the distances of the points from O.
    """
    w = width_of(simd)
    zero, one = spread(simd, 0.0), spread(simd, 1.0)
    static, dynamic = load(simd, record, o + MU_STATIC * w), load(simd, record, o + MU_DYNAMIC * w)
    old = load(simd, record, o + TWIST * w)
    # The twist first: it is clamped to mu sum p r.
    free = fma(-load(simd, record, o + STEP_N * w), w3, old)
    size, most, slips = where_greater(free, zero, free, -free), static * lever, spread(simd, SLIPS)
    bound = where_greater(size, slips * most, dynamic * lever, most)
    new = where_greater(size, most, _clamp(simd, free, bound), free)
    store(record, o + TWIST * w, new)
    d3 = new - old
    # What the twist did to the slip along t_1 and t_2.
    u1 = fma(load(simd, record, o + TWIST_TO_1 * w), d3, u1)
    u2 = fma(load(simd, record, o + TWIST_TO_2 * w), d3, u2)
    old_1, old_2 = load(simd, record, o + PUSH_1 * w), load(simd, record, o + PUSH_2 * w)
    step = load(simd, record, o + STEP_T * w)
    f1, f2 = fma(-step, u1, old_1), fma(-step, u2, old_2)
    # What slips has dynamic friction, along the same direction.
    square, most = fma(f1, f1, f2 * f2), static * press
    slow = slips * most
    bound = where_greater(square, slow * slow, dynamic * press, most)
    factor = where_greater(square, most * most, bound / root(square + spread(simd, TINY * TINY)), one)
    f1, f2 = f1 * factor, f2 * factor
    store(record, o + PUSH_1 * w, f1)
    store(record, o + PUSH_2 * w, f2)
    return f1 - old_1, f2 - old_2, d3


@inlined
def _press(simd, record, g, speed, gap, relaxing, per_h, spring_of):
    """Normal impulses of the points at g that approach at -speed, in m/s: old and new. spring_of: STIFF, HARD, SOFT, DEPTH."""
    stiff, hard, soft, deepest = spring_of
    w = width_of(simd)
    zero = spread(simd, 0.0)
    mass, old = load(simd, record, g + MASS * w), load(simd, record, g + PRESS * w)
    if relaxing:
        # Relax: k = 1, i = 0, c = max(s, 0) / h.
        new = fma(-mass, fma(where_greater(gap, zero, gap, zero), per_h, speed), old)
    else:
        spring = where_greater(stiff * gap, -deepest, stiff * gap, -deepest)
        # s > 0: free to close the gap, no further; s <= 0: spring and damper.
        bias = where_greater(gap, zero, gap * per_h, spring)
        share = where_greater(gap, zero, spread(simd, 1.0), hard)
        kept = where_greater(gap, zero, zero, soft)
        new = fma(-(mass * share), speed + bias, fma(-kept, old, old))
    return old, where_greater(new, zero, new, zero)


@inlined
def _turned_normal(theta, n, half):
    """G of a body turned by theta."""
    across = cross(theta, n)
    twice = cross(theta, across)
    return fma(half, twice[0], -across[0]), fma(half, twice[1], -across[1]), fma(half, twice[2], -across[2])


@jit
def solve_batches(simd, batches, begin, number, bodies, moved, h, relaxing):
    """One pass over the batches from `begin` to `number`; moved: how far bodies have come since these were made.

    relaxing: the pass with friction and without springs, after the bodies have moved.
    """
    velocity, mass = bodies.velocity, bodies.mass
    w = width_of(simd)
    record, zero, per_h, half = batches.record, spread(simd, 0.0), spread(simd, 1.0 / h), spread(simd, 0.5)
    for k in range(begin, number):
        o, points = k * FIELDS * w, batches.points[k]
        va, vb = gather(simd, velocity, batches.first, k * w), gather(simd, velocity, batches.second, k * w)
        xa, xb = gather(simd, moved, batches.first, k * w), gather(simd, moved, batches.second, k * w)
        n = three(simd, record, o + NORMAL * w)
        t, u = three(simd, record, o + TANGENT_1 * w), three(simd, record, o + TANGENT_2 * w)
        arm_a, arm_b = _arms(simd, batches, k)
        # How the gap has changed: at O, and from there along t_1 and t_2.
        ga, gb = _turned_normal(angular(xa), n, half), _turned_normal(angular(xb), n, half)
        skeleton_a = along(arm_a, -load(simd, record, o + RADIUS_A * w), n)
        skeleton_b = along(arm_b, load(simd, record, o + RADIUS_B * w), n)
        arm_a, arm_b, d = _moved_arms(simd, arm_a, arm_b, load(simd, record, o + SHARE * w), xa, xb)
        at_o = dot(n, d) + (dot(gb, skeleton_b) - dot(ga, skeleton_a))
        between = less(gb, ga)
        slope_1, slope_2 = dot(t, between), dot(u, between)
        # Relative velocity at O and relative spin, along the axes.
        slip = less(add(linear(vb), cross(angular(vb), arm_b)), add(linear(va), cross(angular(va), arm_a)))
        spin = less(angular(vb), angular(va))
        un, w1, w2 = dot(n, slip), dot(t, spin), dot(u, spin)
        f1, f2, f3 = zero, zero, zero
        gaps = (at_o, slope_1, slope_2)
        if relaxing:
            # In the sub-step of an impact the springs have taken only what is too fast for the gap. The rest is taken below: friction in
            # the cone of what the springs took was anything between none and mu p.
            _, _, _, total, lever = _press_points(simd, record, o, points, (un, w1, w2), gaps, per_h, (relaxing, False))
            f1, f2, f3 = _rub(simd, record, o, total, lever, dot(t, slip), dot(u, slip), dot(n, spin))
            un = _coupled(simd, record, o + TO_NORMAL * w, f1, f2, f3, un)
            w1 = _coupled(simd, record, o + TO_TURN_1 * w, f1, f2, f3, w1)
            w2 = _coupled(simd, record, o + TO_TURN_2 * w, f1, f2, f3, w2)
        press, turn_1, turn_2, _, _ = _press_points(simd, record, o, points, (un, w1, w2), gaps, per_h, (relaxing, True))
        ma, mb = gather(simd, mass, batches.first, k * w), gather(simd, mass, batches.second, k * w)
        f, torque = sum_up(t, u, n, f1, f2, press), sum_up(t, u, n, turn_1, turn_2, f3)
        _push(velocity, batches, k * w, (va, vb), (ma, mb), (arm_a, arm_b), (f, torque))


@inlined
def _coupled(simd, record, at, f1, f2, f3, speed):
    c = three(simd, record, at)
    return fma(c[0], f1, fma(c[1], f2, fma(c[2], f3, speed)))


@inlined
def _press_points(simd, record, o, points, speeds, gaps, per_h, how):
    """Normal impulses of the points of a patch.

    Returns the sum of their changes along n and its torque about t_1 and t_2, then the sum of the impulses, and of those times LEVER.
    speeds: at O along n, and of the spin about t_1 and t_2; gaps: how the gap has changed at O, and from there along t_1 and t_2; how:
    whether to relax, and whether they are written down.
    """
    (un, w1, w2), (at_o, slope_1, slope_2), (relaxing, kept) = speeds, gaps, how
    w = width_of(simd)
    zero = spread(simd, 0.0)
    stiff, hard = load(simd, record, o + STIFF * w), load(simd, record, o + HARD * w)
    soft, deepest = load(simd, record, o + SOFT * w), load(simd, record, o + DEPTH * w)
    press, turn_1, turn_2, total, lever = zero, zero, zero, zero, zero
    p0, p1, p2 = zero, zero, zero
    for c in range(points):
        g = o + (POINT + POINT_SIZE * c) * w
        x, y = load(simd, record, g + X * w), load(simd, record, g + Y * w)
        gap = load(simd, record, g + GAP * w) + (at_o + fma(x, slope_1, y * slope_2))
        speed = fma(y, w1, fma(-x, w2, un))
        # Gauss-Seidel within the patch: the impulses already found in this pass change the speed of the next point.
        if c == 1:
            speed = fma(load(simd, record, o + BETWEEN * w), p0, speed)
        elif c == 2:
            speed = fma(load(simd, record, o + (BETWEEN + 1) * w), p0, speed)
            speed = fma(load(simd, record, o + (BETWEEN + 3) * w), p1, speed)
        elif c == 3:
            speed = fma(load(simd, record, o + (BETWEEN + 2) * w), p0, speed)
            speed = fma(load(simd, record, o + (BETWEEN + 4) * w), p1, speed)
            speed = fma(load(simd, record, o + (BETWEEN + 5) * w), p2, speed)
        old, new = _press(simd, record, g, speed, gap, relaxing, per_h, (stiff, hard, soft, deepest))
        if kept:
            store(record, g + PRESS * w, new)
        change = new - old
        total, lever = total + new, fma(new, load(simd, record, g + LEVER * w), lever)
        if c == 0:
            p0 = change
        elif c == 1:
            p1 = change
        elif c == 2:
            p2 = change
        press, turn_1, turn_2 = press + change, fma(change, y, turn_1), fma(-change, x, turn_2)
    return press, turn_1, turn_2, total, lever
