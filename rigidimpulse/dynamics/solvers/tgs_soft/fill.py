"""Records of patches for the sub-stepped solver, a batch of W at once, and impulses back from them; see `records` for the fields.

With unit normal n, from a to b, tangents t_1, t_2 (t_1 x t_2 = n), points c_a on a and c_b on b, and their gap n.(c_b - c_a), impulses
act at one point s c_a + (1 - s) c_b, so that no torque is left over: on the surface of what can move, so that it rolls; where both can, on
the one that is rounded; else mid-way (s = 1/2). The centre O of a patch is the mean of these points, at the height where they press: the
mean by their impulses of the last sub-step, or the point with the least gap where there were none. r_a and r_b are the arms to it. The
points are taken to lie at O + x t_1 + y t_2.

With M_i the inverse inertia of body i, K = (1 / m_a + 1 / m_b) 1 + sum of -[r_i] M_i [r_i] is how impulses at O change the relative
velocity there, [r] x = r x x; a torque m turns the patch by M m, M = M_a + M_b. An impulse p n at (x, y) is p n at O and the torque
p (y t_1 - x t_2), and moves points along n by u.n + y w.t_1 - x w.t_2.
"""

from __future__ import annotations

from rigidimpulse.collision.contact_records import (
    CARRIER,
    CONTACT_MARGIN,
    DYNAMIC_FRICTION,
    FRICTION,
    IMPULSE,
    ROUND_A,
    ROUND_B,
    SKELETON_A,
    SKELETON_B,
    SKIN,
    STATIC_FRICTION,
)
from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.simd import ROW, fma, gather, load, root, scatter, spread, store, where_greater, width_of
from rigidimpulse.dynamics.solvers.tgs_soft.bodies import INVERSE_MASS
from rigidimpulse.dynamics.solvers.tgs_soft.passes import DEEPEST, TINY, add, along, cross, dot, less, linear, store_three, three, times
from rigidimpulse.dynamics.solvers.tgs_soft.records import (
    ARM_A,
    ARM_B,
    ARM_FIELDS,
    BETWEEN,
    DEPTH,
    FIELDS,
    GAP,
    LEVER,
    MASS,
    MU_DYNAMIC,
    MU_STATIC,
    NORMAL,
    POINT,
    POINT_SIZE,
    POINTS,
    PRESS,
    PUSH_1,
    SHARE,
    STEP_N,
    STEP_T,
    STIFF,
    TANGENT_1,
    TANGENT_2,
    TO_NORMAL,
    TO_TURN_1,
    TO_TURN_2,
    TWIST_TO_1,
    TWIST_TO_2,
    X,
    Y,
)

FAR = 1e30
"""A gap larger than any, m."""
STEEP = 0.57735
"""First component of a normal beyond which its first tangent lies across the third axis."""


@jit
def place_bodies(bodies, places):
    """Lines (8 (n+1),) of position and orientation."""
    for i in range(bodies.part.shape[0]):
        for k in range(3):
            places[8 * i + k] = bodies.position[i, k]
        for k in range(4):
            places[8 * i + 3 + k] = bodies.orientation[i, k]


@inlined
def _rotation(simd, place):
    """Rows of the matrices of the orientations in lines of `place_bodies`."""
    one, two = spread(simd, 1.0), spread(simd, 2.0)
    w, x, y, z = place[3], place[4], place[5], place[6]
    return (
        (one - two * fma(y, y, z * z), two * fma(x, y, -(w * z)), two * fma(x, z, w * y)),
        (two * fma(x, y, w * z), one - two * fma(x, x, z * z), two * fma(y, z, -(w * x))),
        (two * fma(x, z, -(w * y)), two * fma(y, z, w * x), one - two * fma(x, x, y * y)),
    )


@inlined
def _turned(r, a):
    """The matrix r times a."""
    return dot(r[0], a), dot(r[1], a), dot(r[2], a)


@inlined
def _choose(a, b, x, y):
    """Vectors x where a > b, else y."""
    return where_greater(a, b, x[0], y[0]), where_greater(a, b, x[1], y[1]), where_greater(a, b, x[2], y[2])


@inlined
def _normal(simd, first, second, ra, rb, skeleton_a, skeleton_b):
    """World normal of a row's lines: that of two rounded surfaces runs between their centres."""
    zero, tiny = spread(simd, 0.0), spread(simd, TINY)
    own = (first[0], first[1], first[2])
    n = _choose(second[CARRIER - ROW], zero, _turned(rb, own), _turned(ra, own))
    between = less(skeleton_b, skeleton_a)
    square = dot(between, between)
    inverse = spread(simd, 1.0) / root(square + tiny)
    both = first[ROUND_A] * first[ROUND_B]
    return _choose(where_greater(square, tiny, both, zero), zero, (between[0] * inverse, between[1] * inverse, between[2] * inverse), n)


@inlined
def _tangents(simd, n):
    """Two unit vectors with t_1 x t_2 = n."""
    zero, one, tiny = spread(simd, 0.0), spread(simd, 1.0), spread(simd, TINY)
    size = where_greater(n[0], zero, n[0], -n[0])
    steep = spread(simd, STEEP)
    inverse = one / root(fma(n[1], n[1], where_greater(size, steep, n[0] * n[0], n[2] * n[2])) + tiny)
    t = _choose(size, steep, (n[1] * inverse, -(n[0] * inverse), zero), (zero, n[2] * inverse, -(n[1] * inverse)))
    return t, cross(n, t)


@inlined
def _points(simd, batches, k, lines, places, rotations, share, axes):
    """Places, from the first of them, and gaps of the points of batch k into its record; returns the first and the centre from it."""
    (pa, pb), (ra, rb), (n, t, u) = places, rotations, axes
    w = width_of(simd)
    record, zero, one = batches.record, spread(simd, 0.0), spread(simd, 1.0)
    rest, number, base, mean = one - share, zero, (zero, zero, zero), (zero, zero, zero)
    between = less(linear(pb), linear(pa))
    least, lowest, pressed, press = spread(simd, FAR), zero, zero, zero
    for c in range(batches.points[k]):
        g = (k * FIELDS + POINT + POINT_SIZE * c) * w
        at = (POINTS * k + c) * w
        first, second = gather(simd, lines, batches.row, at), gather(simd, lines[ROW:], batches.row, at)
        a = _turned(ra, (first[SKELETON_A], first[SKELETON_A + 1], first[SKELETON_A + 2]))
        b = add(between, _turned(rb, (second[SKELETON_B - ROW], second[SKELETON_B + 1 - ROW], second[SKELETON_B + 2 - ROW])))
        gap = dot(n, less(b, a)) - (first[ROUND_A] + first[ROUND_B]) - second[CONTACT_MARGIN - ROW]
        a, b = along(a, first[ROUND_A], n), along(b, -first[ROUND_B], n)
        x = (fma(share, a[0], rest * b[0]), fma(share, a[1], rest * b[1]), fma(share, a[2], rest * b[2]))
        # A single point lies at the centre of its patch to the bit: with a lever of round-off it would hold a twist, by whatever force.
        if c == 0:
            base = x
        x = less(x, base)
        store(record, g + X * w, dot(t, x))
        store(record, g + Y * w, dot(u, x))
        store(record, g + GAP * w, gap)
        # A lane without this point has no skin.
        here = where_greater(second[SKIN - ROW], zero, one, zero)
        store(record, g + MASS * w, here)
        number, mean, height = number + here, along(mean, here, x), dot(n, x)
        impulse = here * gather(simd, lines[2 * ROW :], batches.row, at)[IMPULSE - 2 * ROW]
        press, pressed = press + impulse, fma(impulse, height, pressed)
        nearer = where_greater(least, gap, here, zero)
        least, lowest = where_greater(nearer, zero, gap, least), where_greater(nearer, zero, height, lowest)
    inverse = one / where_greater(number, zero, number, one)
    mean = (mean[0] * inverse, mean[1] * inverse, mean[2] * inverse)
    # With friction at the mean of their heights a box that landed on a corner, the next one a hand above, left with 0.83 of its speed.
    height = where_greater(press, zero, pressed / where_greater(press, zero, press, one), lowest)
    return base, along(mean, height - dot(n, mean), n)


@inlined
def _impulses(simd, batches, k, lines, middle, t, u):
    """Points from the centre of the patch, `middle` from the first, and impulses carried over, into the record of batch k."""
    w = width_of(simd)
    record, zero = batches.record, spread(simd, 0.0)
    o, x0, y0 = k * FIELDS * w, dot(t, middle), dot(u, middle)
    f1, f2, twist = zero, zero, zero
    for c in range(batches.points[k]):
        g = o + (POINT + POINT_SIZE * c) * w
        third = gather(simd, lines[2 * ROW :], batches.row, (POINTS * k + c) * w)
        here = load(simd, record, g + MASS * w)
        x, y = here * (load(simd, record, g + X * w) - x0), here * (load(simd, record, g + Y * w) - y0)
        store(record, g + X * w, x)
        store(record, g + Y * w, y)
        store(record, g + LEVER * w, root(fma(x, x, y * y)))
        store(record, g + PRESS * w, third[IMPULSE - 2 * ROW])
        f = (third[FRICTION - 2 * ROW], third[FRICTION + 1 - 2 * ROW], third[FRICTION + 2 - 2 * ROW])
        along_1, along_2 = dot(t, f), dot(u, f)
        f1, f2, twist = f1 + along_1, f2 + along_2, twist + fma(x, along_2, -(y * along_1))
    store_three(record, o + PUSH_1 * w, w, f1, f2, twist)


@jit
def fill(simd, batches, begin, number, places, mass, lines, soft):
    """Records of the batches from `begin` to `number`.

    places: lines (8 (n+1),) of `place_bodies`; lines (8 m,) of the pool; soft (2, 3) from `solver.softness`: movable, immovable.
    """
    w = width_of(simd)
    record, zero, one, half = batches.record, spread(simd, 0.0), spread(simd, 1.0), spread(simd, 0.5)
    for k in range(begin, number):
        o = k * FIELDS * w
        pa, pb = gather(simd, places, batches.first, k * w), gather(simd, places, batches.second, k * w)
        ma, mb = gather(simd, mass, batches.first, k * w), gather(simd, mass, batches.second, k * w)
        at = POINTS * k * w
        first, second = gather(simd, lines, batches.row, at), gather(simd, lines[ROW:], batches.row, at)
        ra, rb = _rotation(simd, pa), _rotation(simd, pb)
        on_round = where_greater(first[ROUND_A], zero, one, zero) - where_greater(first[ROUND_B], zero, one, zero)
        share = where_greater(ma[INVERSE_MASS], zero, where_greater(mb[INVERSE_MASS], zero, fma(half, on_round, half), one), zero)
        between = less(linear(pb), linear(pa))
        skeleton_a = _turned(ra, (first[SKELETON_A], first[SKELETON_A + 1], first[SKELETON_A + 2]))
        skeleton_b = add(between, _turned(rb, (second[SKELETON_B - ROW], second[SKELETON_B + 1 - ROW], second[SKELETON_B + 2 - ROW])))
        n = _normal(simd, first, second, ra, rb, skeleton_a, skeleton_b)
        t, u = _tangents(simd, n)
        base, middle = _points(simd, batches, k, lines, (pa, pb), (ra, rb), share, (n, t, u))
        arm_a = add(base, middle)
        arm_b = less(arm_a, between)
        _impulses(simd, batches, k, lines, middle, t, u)
        store_three(record, o + NORMAL * w, w, n[0], n[1], n[2])
        store_three(record, o + TANGENT_1 * w, w, t[0], t[1], t[2])
        store_three(record, o + TANGENT_2 * w, w, u[0], u[1], u[2])
        arms = k * ARM_FIELDS * w
        store_three(batches.arm, arms + ARM_A * w, w, arm_a[0], arm_a[1], arm_a[2])
        store_three(batches.arm, arms + ARM_B * w, w, arm_b[0], arm_b[1], arm_b[2])
        store_three(record, o + SHARE * w, w, share, first[ROUND_A], first[ROUND_B])
        store(record, o + MU_STATIC * w, second[STATIC_FRICTION - ROW])
        store(record, o + MU_DYNAMIC * w, second[DYNAMIC_FRICTION - ROW])
        # Against a body that cannot be moved the spring has twice the frequency.
        both = ma[INVERSE_MASS] * mb[INVERSE_MASS]
        stiff = where_greater(both, zero, spread(simd, soft[0, 0]), spread(simd, soft[1, 0]))
        hard = where_greater(both, zero, spread(simd, soft[0, 1]), spread(simd, soft[1, 1]))
        store_three(record, o + STIFF * w, w, stiff, hard, where_greater(both, zero, spread(simd, soft[0, 2]), spread(simd, soft[1, 2])))
        store(record, o + DEPTH * w, second[SKIN - ROW] * stiff * spread(simd, DEEPEST))
        _couple(simd, record, o, batches.points[k], (ma, mb), (arm_a, arm_b), (n, t, u))


@inlined
def _couple(simd, record, o, points, masses, arms, axes):
    """Effective masses and couplings: entries of K and M along (t_1, t_2, n), turns about them numbered 4 to 6."""
    (ma, mb), (arm_a, arm_b), (n, t, u) = masses, arms, axes
    w = width_of(simd)
    one, tiny, half = spread(simd, 1.0), spread(simd, TINY), spread(simd, 0.5)
    im = ma[INVERSE_MASS] + mb[INVERSE_MASS]
    turning = (ma[0] + mb[0], ma[1] + mb[1], ma[2] + mb[2], ma[3] + mb[3], ma[4] + mb[4], ma[5] + mb[5])
    at_t, at_u, at_n = times(turning, t), times(turning, u), times(turning, n)
    # A torque m turns the patch by M m.
    k44, k45, k55 = dot(t, at_t), dot(t, at_u), dot(u, at_u)
    k46, k56, k66 = dot(t, at_n), dot(u, at_n), dot(n, at_n)
    # Columns of K: impulses along n, t_1 and t_2 at O, and the spins that they make.
    na, nb = cross(arm_a, n), cross(arm_b, n)
    ta, tb = cross(arm_a, t), cross(arm_b, t)
    ua, ub = cross(arm_a, u), cross(arm_b, u)
    ia, ib = times(ma, na), times(mb, nb)
    sum_n = add(ia, ib)
    k33 = im + (dot(na, ia) + dot(nb, ib))
    k31, k32 = dot(ta, ia) + dot(tb, ib), dot(ua, ia) + dot(ub, ib)
    k34, k35, k36 = dot(t, sum_n), dot(u, sum_n), dot(n, sum_n)
    ia, ib = times(ma, ta), times(mb, tb)
    sum_t = add(ia, ib)
    k11, k12 = im + (dot(ta, ia) + dot(tb, ib)), dot(ua, ia) + dot(ub, ib)
    k14, k15, k16 = dot(t, sum_t), dot(u, sum_t), dot(n, sum_t)
    ia, ib = times(ma, ua), times(mb, ub)
    sum_u = add(ia, ib)
    k22 = im + (dot(ua, ia) + dot(ub, ib))
    k24, k25, k26 = dot(t, sum_u), dot(u, sum_u), dot(n, sum_u)
    # Friction steps by the largest eigenvalue of the tangents' part of K: see `solver`.
    uneven = half * (k11 - k22)
    store(record, o + STEP_T * w, one / (half * (k11 + k22) + root(fma(uneven, uneven, k12 * k12)) + tiny))
    store(record, o + STEP_N * w, one / (k66 + tiny))
    store_three(record, o + TO_NORMAL * w, w, k31, k32, k36)
    store_three(record, o + TO_TURN_1 * w, w, k14, k24, k46)
    store_three(record, o + TO_TURN_2 * w, w, k15, k25, k56)
    store(record, o + TWIST_TO_1 * w, k16)
    store(record, o + TWIST_TO_2 * w, k26)
    _couple_points(simd, record, o, points, (k33, k34, k35, k44, k45, k55))


@inlined
def _couple_points(simd, record, o, points, entries):
    """Effective masses of the points along n, and how they push each other; entries: of K and M, numbered as in `_couple`."""
    k33, k34, k35, k44, k45, k55 = entries
    w = width_of(simd)
    tiny = spread(simd, TINY)
    for c in range(points):
        g = o + (POINT + POINT_SIZE * c) * w
        x, y = load(simd, record, g + X * w), load(simd, record, g + Y * w)
        own = k33 + (y + y) * k34 - (x + x) * k35 + y * y * k44 - (x + x) * y * k45 + x * x * k55
        store(record, g + MASS * w, load(simd, record, g + MASS * w) / (own + tiny))
        # Pairs before those of this point: 3 + 2 + 1 of them in all.
        place = o + (BETWEEN + c * (2 * POINTS - 1 - c) // 2) * w
        for d in range(c + 1, points):
            q = o + (POINT + POINT_SIZE * d) * w
            x1, y1 = load(simd, record, q + X * w), load(simd, record, q + Y * w)
            store(record, place, k33 + (y + y1) * k34 - (x + x1) * k35 + y * y1 * k44 - fma(x, y1, x1 * y) * k45 + x * x1 * k55)
            place += w


@jit
def keep_impulses(simd, batches, number, lines):
    """Put the impulses of `number` batches back to their rows: friction as forces at the points with the same sum and twist."""
    w = width_of(simd)
    record, zero, one, tiny = batches.record, spread(simd, 0.0), spread(simd, 1.0), spread(simd, TINY)
    for k in range(number):
        o, square, size = k * FIELDS * w, zero, zero
        f1, f2, twist = three(simd, record, o + PUSH_1 * w)
        t, u = three(simd, record, o + TANGENT_1 * w), three(simd, record, o + TANGENT_2 * w)
        for c in range(batches.points[k]):
            g = o + (POINT + POINT_SIZE * c) * w
            lever = load(simd, record, g + LEVER * w)
            square = fma(lever, lever, square)
            size = size + where_greater(load(simd, record, g + MASS * w), zero, one, zero)
        # The twist becomes forces across the arms from O, in proportion to their lengths.
        turn = where_greater(square, zero, twist / (square + tiny), zero)
        # The friction of the patch is shared equally by its points.
        share = one / where_greater(size, zero, size, one)
        f1, f2 = f1 * share, f2 * share
        for c in range(batches.points[k]):
            g = o + (POINT + POINT_SIZE * c) * w
            mass = load(simd, record, g + MASS * w)
            along_1 = where_greater(mass, zero, fma(-turn, load(simd, record, g + Y * w), f1), zero)
            along_2 = where_greater(mass, zero, fma(turn, load(simd, record, g + X * w), f2), zero)
            gap = where_greater(mass, zero, load(simd, record, g + GAP * w), zero)
            x, y, z = (fma(along_1, t[0], along_2 * u[0]), fma(along_1, t[1], along_2 * u[1]), fma(along_1, t[2], along_2 * u[2]))
            press = load(simd, record, g + PRESS * w)
            scatter(lines[2 * ROW :], batches.row, (POINTS * k + c) * w, (press, x, y, z, gap, zero, zero, zero))
