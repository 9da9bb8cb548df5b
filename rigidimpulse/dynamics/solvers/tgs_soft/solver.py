"""The sub-stepped solver: soft contacts with a skin, a relaxing pass, friction in a cone (kernels).

A step is cut into sub-steps of length h. In each of them, for every body and every patch of contact points (see `records`) with normal
n, gaps less the skin s, effective masses m = 1 / (n.K n), normal impulses p, and friction f and twist t at its centre carried
over from the sub-step before (a warm start):

    v <- v + h g                                                                gravity
    v <- v + M^-1 J^T (p n + f, t n)                                            warm start
    p <- max(0, (1 - i) p - m k (u_n + c))                                      normal rows, with
         s > 0:   c = s / h,        k = 1,          i = 0                       (free to close the gap, no further)
         s <= 0:  c = s w / a_1,    k = a_2 a_3,    i = a_3                     (spring and damper, implicit)
    x <- x + h v,   q <- exp(h w) q                                             and where no contact pushed: x <- x - h^2 g / 2
    t <- t - w_n / (n.K_w n),     |t| > mu_s sum p r:  t <- mu_k sum p r sign t about n, r the points' distances from the centre
    f <- f - u_t / k_t,           |f| > mu_s sum p:    f <- mu_k sum p f / |f|   friction, before the normal rows
    p once more with k = 1, i = 0, c = max(s, 0) / h                            relax: takes out the speed the spring gave

The p of the cones are those that the relaxing pass would leave without friction: in the sub-step of an impact the springs take only
what is too fast for the gap, and relaxing the rest. Friction is found in the relaxing pass only, from speeds that the spring has no
part in: with it in both passes a stack of three boxes rocks for ever at some cm/s. k_t is the largest eigenvalue of the tangents' part
of K: with the inverse matrix and a radial clamp a block slides where it should hold.

w = 2 pi F / max(h, SHORTEST h_0) is the frequency of the spring for sub-steps of up to h_0, z its damping ratio, a_1 = 2 z + h w, a_2 = h w
a_1, a_3 = 1 / (1 + a_2); twice w against what cannot be moved. Where an impact left 1e-8 s of a step, springs that grew stiffer without
bound gave resting boxes 50 J. Patches are visited colour by colour (Gauss-Seidel), many at once. K is that of the start of the step; gaps
and arms are those of points fixed in the bodies, updated in every sub-step (gaps to second order in the turn); radii are taken along the
normal, so that balls roll, and the normal of two balls is updated too. At the end of a sub-step contacts that were seen at u_n < -sqrt(2 g
skin) / e and are closed by now rebound. Where one point of a patch pushes, the impulses that it has had in the sub-step are taken back, and
it gets that of the impact of a single point (`impact/friction.py`): friction couples to u_n wherever the point is not straight below the
centre, and with the two one after the other boxes that landed on a corner lost a fifth more than they should. So does a point that comes in
HARD_IMPACT times as fast and does not rebound. Points of a patch that rebound together leave at -e u_n, with the friction of each in the
cone of its impulse, point after point and round after round. The torque-free part of rotation keeps the angular momentum: w <- I(q')^-1
I(q) w, with q' from the spin at mid-way.

Method: Macklin et al., Small steps in physics simulation, 2019; the relaxing pass and restitution after E. Catto, Solver2D
(2024). The load of a column of k bodies presses the skin in by k g / w^2; the error is of first order in h.
"""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_records import SKIN, ContactPairs
from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.simd import width_of
from rigidimpulse.core.vector import along, dot, length, row, scaled, subtract
from rigidimpulse.core.workers import LAST, NONE, PATIENCE, look_at, open_round, pause, report_piece, take_piece, wait_for
from rigidimpulse.dynamics.impact.friction import contact_impulse
from rigidimpulse.dynamics.impact.point import add_body
from rigidimpulse.dynamics.impact.restitution import PairLaw
from rigidimpulse.dynamics.solvers.tgs_soft.bodies import INVERSE_MASS, SolverBodies
from rigidimpulse.dynamics.solvers.tgs_soft.body_motion import finish, kick, move
from rigidimpulse.dynamics.solvers.tgs_soft.passes import solve_batches, warm_start
from rigidimpulse.dynamics.solvers.tgs_soft.records import (
    ARM_A,
    ARM_B,
    ARM_FIELDS,
    FIELDS,
    GAP,
    MASS,
    MU_DYNAMIC,
    MU_STATIC,
    NORMAL,
    POINT,
    POINT_SIZE,
    PRESS,
    PUSH_1,
    PUSH_2,
    SHARE,
    STEP_T,
    TANGENT_1,
    TANGENT_2,
    TWIST,
    Batches,
    Patches,
    X,
    Y,
    normal_of,
    point_of,
    tangents,
)

FREQUENCY = 0.25
"""F: frequency of the spring in sub-steps."""
DAMPING = 10.0
"""z: damping ratio."""
SHORTEST = 1.0 / 16.0
"""Length of a sub-step, of the usual one, below which springs get no stiffer."""
KICK, WARM, SOLVE, MOVE, RELAX = range(5)
"""Phases of a sub-step: gravity, warm start, normal rows, motion, relaxing. WARM, SOLVE and RELAX have a round for each colour."""
HARD_IMPACT = 4.0
"""Times the speed below which nothing rebounds, from which the friction of a point that only stops is worth its time."""
STOPS = -1.0
"""Target of a point that comes in fast and does not rebound."""
REBOUND_ROUNDS = 10
"""Times round the points of a patch that rebounds: four corners that land at once are within some per cent of e then."""
BODIES_EACH, BATCHES_EACH = 128, 8
"""Bodies and batches of a piece of a round: a microsecond or two of work."""


class Solve(NamedTuple):
    """What sub-steps work on."""

    bodies: SolverBodies
    pairs: ContactPairs
    patches: Patches
    batches: Batches
    rows: np.ndarray  # the pool of contact rows
    edges: np.ndarray  # (c+1,) where the batches of colours begin
    steady: int
    """Colours that were made before contacts were last looked for; how far bodies have come since they were made is in `drift`."""


class SpecialPatches(NamedTuple):
    """Patches that need more than the passes give, see `special_patches`."""

    balls: np.ndarray  # patches of two balls
    rebounds: np.ndarray  # patches with points that rebound
    supports: np.ndarray  # patches on moving supports
    target: np.ndarray  # (m, 4) m/s, speeds at which points leave after they have closed, STOPS where they only stop, 0 for slow ones
    coefficients: np.ndarray  # (k, k, 4), see material.combine
    law: int  # one of `restitution.LAWS`
    given: np.ndarray  # (n+1,) J, work of moving supports on each body, added up


def softness(h: float, usual: float) -> np.ndarray:
    """Rows (w / a_1 [1/s], a_2 a_3, a_3): between movable bodies, against immovable ones, (2, 3); usual: h_0, s."""
    out = np.zeros((2, 3))
    for k, factor in enumerate((1.0, 2.0)):
        w = factor * 2.0 * pi * FREQUENCY / max(h, SHORTEST * usual)
        a_1 = 2.0 * DAMPING + h * w
        a_2 = h * w * a_1
        a_3 = 1.0 / (1.0 + a_2)
        out[k] = w / a_1, a_2 * a_3, a_3
    return out


@inlined
def _field(record, at):
    """A field of the record, in double precision."""
    return np.float64(record[at])


@jit
def _vector(record, at, width):
    return _field(record, at), _field(record, at + width), _field(record, at + 2 * width)


@jit
def _cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inlined
def _first_arm(s, width):
    """Place of the first field of the arms of slot s."""
    return s // width * ARM_FIELDS * width + s % width


@jit
def _arms_along(bodies, batches, s, o, width, place, k):
    """Component k of the arms to the place (x, y) of a patch; see `_arms_to`."""
    record, moved, q = batches.record, bodies.moved, _first_arm(s, width)
    share, d = _field(record, o + SHARE * width), moved[8 * batches.second[s] + k] - moved[8 * batches.first[s] + k]
    along = place[0] * _field(record, o + (TANGENT_1 + k) * width) + place[1] * _field(record, o + (TANGENT_2 + k) * width)
    arm = batches.arm
    return arm[q + (ARM_A + k) * width] + (1.0 - share) * d + along, arm[q + (ARM_B + k) * width] - share * d + along


@jit
def _arms_to(bodies, batches, s, o, width, c):
    """Bodies of slot s, and the arms from them to its point c (to its centre for c < 0) as they are now."""
    place = (0.0, 0.0)
    if c >= 0:
        g = o + (POINT + POINT_SIZE * c) * width
        place = _field(batches.record, g + X * width), _field(batches.record, g + Y * width)
    xa, xb = _arms_along(bodies, batches, s, o, width, place, 0)
    ya, yb = _arms_along(bodies, batches, s, o, width, place, 1)
    za, zb = _arms_along(bodies, batches, s, o, width, place, 2)
    return batches.first[s], batches.second[s], (xa, ya, za), (xb, yb, zb)


@jit
def _velocity_at(bodies, i, arm):
    v = bodies.velocity
    o = 8 * i
    x, y, z = _cross(v[o + 3], v[o + 4], v[o + 5], arm[0], arm[1], arm[2])
    return v[o] + x, v[o + 1] + y, v[o + 2] + z


@jit
def _push(bodies, i, arm, x, y, z):
    """The impulse (x, y, z) on body i at the end of the arm; returns the work that it does if it cannot be moved, J."""
    v, m, o = bodies.velocity, bodies.mass, 8 * i
    if m[o + INVERSE_MASS] == 0.0:
        ux, uy, uz = _velocity_at(bodies, i, arm)
        return -(x * ux + y * uy + z * uz)
    v[o] += m[o + INVERSE_MASS] * x
    v[o + 1] += m[o + INVERSE_MASS] * y
    v[o + 2] += m[o + INVERSE_MASS] * z
    tx, ty, tz = _cross(arm[0], arm[1], arm[2], x, y, z)
    v[o + 3] += m[o] * tx + m[o + 1] * ty + m[o + 2] * tz
    v[o + 4] += m[o + 1] * tx + m[o + 3] * ty + m[o + 4] * tz
    v[o + 5] += m[o + 2] * tx + m[o + 4] * ty + m[o + 5] * tz
    return 0.0


@jit
def _slip_at(bodies, a, b, arm_a, arm_b):
    ax, ay, az = _velocity_at(bodies, a, arm_a)
    bx, by, bz = _velocity_at(bodies, b, arm_b)
    return bx - ax, by - ay, bz - az


@jit
def _approach(width, bodies, batches, s, o):
    """How fast the patch in slot s closes at its centre, m/s, and how much faster at points along t_1 and t_2, 1/s."""
    record = batches.record
    a, b, arm_a, arm_b = _arms_to(bodies, batches, s, o, width, -1)
    u, n = _slip_at(bodies, a, b, arm_a, arm_b), _vector(record, o + NORMAL * width, width)
    t1, t2 = _vector(record, o + TANGENT_1 * width, width), _vector(record, o + TANGENT_2 * width, width)
    w1, w2 = 0.0, 0.0
    for k in range(3):
        w = bodies.velocity[8 * b + 3 + k] - bodies.velocity[8 * a + 3 + k]
        w1, w2 = w1 + w * t1[k], w2 + w * t2[k]
    return -(u[0] * n[0] + u[1] * n[1] + u[2] * n[2]), w2, -w1


@jit_making_arrays
def special_patches(width, solve, begin, count, coefficients, gravity, lists, target):
    """Patches from `begin` to `count` that need more than the passes give: of two balls, of rebounds, of moving supports.

    Writes them to lists (3, m), and returns their numbers. coefficients (k, k, 4) of two materials; gravity: its strength, m/s2; target
    (m, 4): see `SpecialPatches`.
    """
    bodies, pairs, patches, rows, batches = solve.bodies, solve.pairs, solve.patches, solve.rows, solve.batches
    balls, rebounds, supports = 0, 0, 0
    for m in range(begin, count):
        p, s = patches.pair[m], patches.slot[m]
        a, b = pairs.first[p], pairs.second[p]
        # Two balls: the normal turns as they roll, so it is updated in every sub-step.
        if bodies.reach[a] == 0.0 and bodies.reach[b] == 0.0:
            lists[0, balls] = m
            balls += 1
        for i in (a, b):
            if bodies.mass[8 * i + INVERSE_MASS] == 0.0 and np.any(bodies.velocity[8 * i : 8 * i + 6] != 0.0):
                lists[2, supports] = m
                supports += 1
        e, mu, _, _ = coefficients[bodies.material[a], bodies.material[b]]
        o = (s // width) * FIELDS * width + s % width
        if e == 0.0 and mu == 0.0:
            continue
        # A speed that would rise less than the skin is none.
        slow, some = sqrt(2.0 * gravity * rows[patches.row[m, 0], SKIN]), False
        at_o, along_x, along_y = _approach(width, bodies, batches, s, o)
        for c in range(patches.size[m]):
            g = o + (POINT + POINT_SIZE * c) * width
            approach = at_o + _field(batches.record, g + X * width) * along_x + _field(batches.record, g + Y * width) * along_y
            target[m, c] = e * approach if e * approach > slow else (STOPS if approach > HARD_IMPACT * slow else 0.0)
            some = some or target[m, c] != 0.0
        if some:
            lists[1, rebounds] = m
            rebounds += 1
    return balls, rebounds, supports


@jit
def _turn_balls(width, bodies, pairs, patches, chosen, rows, batches):
    """Normals, arms and gaps of two balls where they are now; friction stays across the normal."""
    record = batches.record
    for m in chosen:
        p, s = patches.pair[m], patches.slot[m]
        a, b = pairs.first[p], pairs.second[p]
        o = (s // width) * FIELDS * width + s % width
        r, share, q = patches.row[m, 0], _field(record, o + SHARE * width), _first_arm(s, width)
        f1, f2 = _field(record, o + PUSH_1 * width), _field(record, o + PUSH_2 * width)
        t, u = _vector(record, o + TANGENT_1 * width, width), _vector(record, o + TANGENT_2 * width, width)
        # Friction keeps its direction in the world while the tangents turn.
        f = (f1 * t[0] + f2 * u[0], f1 * t[1] + f2 * u[1], f1 * t[2] + f2 * u[2])
        n = normal_of(bodies.position, bodies.rotation, rows, r, a, b, pairs.carrier[p])
        ux, uy, uz, vx, vy, vz = tangents(n[0], n[1], n[2])
        x, y, z, gap = point_of(bodies.position, bodies.rotation, rows, r, (a, b), n, share)
        record[o + PUSH_1 * width] = ux * f[0] + uy * f[1] + uz * f[2]
        record[o + PUSH_2 * width] = vx * f[0] + vy * f[1] + vz * f[2]
        arm, t, u = (x, y, z), (ux, uy, uz), (vx, vy, vz)
        for k in range(3):
            d = bodies.moved[8 * b + k] - bodies.moved[8 * a + k]
            # Gaps and arms of the record count from the start of the step; the solver adds what has moved since.
            gap -= n[k] * d
            record[o + (NORMAL + k) * width] = n[k]
            record[o + (TANGENT_1 + k) * width], record[o + (TANGENT_2 + k) * width] = t[k], u[k]
            batches.arm[q + (ARM_A + k) * width] = arm[k] - (1.0 - share) * d
            between = bodies.position[b, k] - bodies.position[a, k]
            batches.arm[q + (ARM_B + k) * width] = arm[k] - between + share * d
        record[o + (POINT + GAP) * width] = gap


@jit
def _push_point(width, bodies, batches, s, c, direction, given):
    """Push point c of the patch in slot s: impulses on b along a direction (3,), and against it on a; adds up the work of supports."""
    o = (s // width) * FIELDS * width + s % width
    a, b, arm_a, arm_b = _arms_to(bodies, batches, s, o, width, c)
    x, y, z = direction
    # The work of one body's support is done on the other body.
    given[a] += _push(bodies, b, arm_b, x, y, z)
    given[b] += _push(bodies, a, arm_a, -x, -y, -z)


@jit
def _slip_of(width, bodies, batches, s, c):
    """Velocity of b against a at point c of the patch in slot s, m/s."""
    a, b, arm_a, arm_b = _arms_to(bodies, batches, s, (s // width) * FIELDS * width + s % width, width, c)
    return _slip_at(bodies, a, b, arm_a, arm_b)


@jit
def _take_back(width, bodies, batches, s, points, sign, given):
    """Give the impulses of the patch in slot s once more, times sign: -1 takes them back."""
    record = batches.record
    o = (s // width) * FIELDS * width + s % width
    n = _vector(record, o + NORMAL * width, width)
    t, u = _vector(record, o + TANGENT_1 * width, width), _vector(record, o + TANGENT_2 * width, width)
    for c in range(points):
        p = sign * _field(record, o + (POINT + POINT_SIZE * c + PRESS) * width)
        if p != 0.0:
            _push_point(width, bodies, batches, s, c, (p * n[0], p * n[1], p * n[2]), given)
    f1, f2 = sign * _field(record, o + PUSH_1 * width), sign * _field(record, o + PUSH_2 * width)
    f3 = sign * _field(record, o + TWIST * width)
    f = (f1 * t[0] + f2 * u[0], f1 * t[1] + f2 * u[1], f1 * t[2] + f2 * u[2])
    _push_point(width, bodies, batches, s, -1, f, given)
    for i, other, turn in ((batches.first[s], batches.second[s], -f3), (batches.second[s], batches.first[s], f3)):
        v, m, q = bodies.velocity, bodies.mass, 8 * i
        if m[q + INVERSE_MASS] == 0.0:
            given[other] -= turn * (n[0] * v[q + 3] + n[1] * v[q + 4] + n[2] * v[q + 5])
        v[q + 3] += turn * (m[q] * n[0] + m[q + 1] * n[1] + m[q + 2] * n[2])
        v[q + 4] += turn * (m[q + 1] * n[0] + m[q + 3] * n[1] + m[q + 4] * n[2])
        v[q + 5] += turn * (m[q + 2] * n[0] + m[q + 4] * n[1] + m[q + 5] * n[2])


@jit_making_arrays
def _inverse_effective_mass(bodies, i, arm, k):
    """Add the part of body i to K (3, 3) of a point at the end of the arm."""
    m, o, inv_inertia = bodies.mass, 8 * i, np.empty((3, 3))
    places = ((0, 1, 2), (1, 3, 4), (2, 4, 5))
    for a in range(3):
        for b in range(3):
            inv_inertia[a, b] = m[o + places[a][b]]
    add_body(m[o + INVERSE_MASS], inv_inertia, arm, k)


@jit_making_arrays
def _strike(width, bodies, patches, batches, special, m, c):
    """Replace the impulses of a patch by that of the impact of its point c, if it comes in without them; returns whether it does."""
    s, points, n = patches.slot[m], patches.size[m], np.empty(3)
    o = (s // width) * FIELDS * width + s % width
    _take_back(width, bodies, batches, s, points, -1.0, special.given)
    a, b, arm_a, arm_b = _arms_to(bodies, batches, s, o, width, c)
    slip, u = _slip_at(bodies, a, b, arm_a, arm_b), np.empty(3)
    for k in range(3):
        n[k], u[k] = _field(batches.record, o + (NORMAL + k) * width), slip[k]
    if not u[0] * n[0] + u[1] * n[1] + u[2] * n[2] < 0.0:
        _take_back(width, bodies, batches, s, points, 1.0, special.given)
        return False
    inverse, impulse = np.zeros((3, 3)), np.empty(3)
    _inverse_effective_mass(bodies, a, arm_a, inverse)
    _inverse_effective_mass(bodies, b, arm_b, inverse)
    e, mu_s, mu_k, e_t = special.coefficients[bodies.material[a], bodies.material[b]]
    if special.target[m, c] == STOPS:
        e = e_t = 0.0
    contact_impulse(inverse, n, u, PairLaw(special.law, e, e_t, mu_s, mu_k), np.empty(3), np.empty(3), impulse)
    _push_point(width, bodies, batches, s, c, (impulse[0], impulse[1], impulse[2]), special.given)
    return True


@jit_making_arrays
def _rebound(width, bodies, patches, chosen, batches, special):
    """Give points that came in fast and are closed their rebound, with friction; adds up the work of supports."""
    record, target, given, single = batches.record, special.target, special.given, np.int64(-1)
    gained, closed, rubbed = np.empty(target.shape[1]), np.empty(target.shape[1], np.bool_), np.empty((target.shape[1], 3))
    for m in chosen:
        s, points = patches.slot[m], patches.size[m]
        o = (s // width) * FIELDS * width + s % width
        n = _vector(record, o + NORMAL * width, width)
        gained[:points], rubbed[:points], pushing, rebounding = 0.0, 0.0, 0, 0
        for c in range(points):
            # Only points that came in fast and did close.
            pushes = record[o + (POINT + POINT_SIZE * c + PRESS) * width] != 0.0
            closed[c] = target[m, c] != 0.0 and pushes
            pushing, rebounding = pushing + pushes, rebounding + closed[c]
            single = c if closed[c] else single
        alone = pushing == 1 and rebounding == 1 and _strike(width, bodies, patches, batches, special, m, single)
        for c in range(points):
            # Points that stop together have done so.
            if closed[c] and target[m, c] == STOPS and not alone:
                target[m, c], closed[c] = 0.0, False
        # A box that lands flat turns with each of its corners, and with the friction of each, in turn: once round corners leave with half
        # of what they should, and with friction after all rounds a box that slides tumbles.
        for _ in range(0 if alone else REBOUND_ROUNDS):
            for c in range(points):
                if closed[c]:
                    u = _slip_of(width, bodies, batches, s, c)
                    mass = _field(record, o + (POINT + POINT_SIZE * c + MASS) * width)
                    p = max(gained[c] + mass * (target[m, c] - dot(u, n)), 0.0)
                    change, gained[c] = p - gained[c], p
                    _push_point(width, bodies, batches, s, c, scaled(n, change), given)
                    _rub(width, bodies, batches, s, c, gained[c], rubbed, given)
        for c in range(points):
            if closed[c]:
                # A rebound happens once, and nothing of it is carried over to the next sub-step.
                target[m, c] = record[o + (POINT + POINT_SIZE * c + PRESS) * width] = 0.0
                record[o + PUSH_1 * width] = record[o + PUSH_2 * width] = record[o + TWIST * width] = 0.0


@jit
def _rub(width, bodies, batches, s, c, pressed, rubbed, given):
    """Bring the friction rubbed (p, 3) of point c, N s, to what stops its slip or to the cone of the impulse that has pressed it."""
    record, o = batches.record, (s // width) * FIELDS * width + s % width
    n, step = _vector(record, o + NORMAL * width, width), _field(record, o + STEP_T * width)
    u, before = _slip_of(width, bodies, batches, s, c), row(rubbed, c)
    f = along(along(before, -step, u), step * dot(u, n), n)
    size = length(f)
    if size > _field(record, o + MU_STATIC * width) * pressed:
        f = scaled(f, _field(record, o + MU_DYNAMIC * width) * pressed / size)
    for k in range(3):
        rubbed[c, k] = f[k]
    _push_point(width, bodies, batches, s, c, subtract(f, before), given)


@jit
def _add_work(width, bodies, patches, chosen, batches, given):
    """Add the work that moving supports did by the impulses of a sub-step to what is given (n+1,) J to each body."""
    record = batches.record
    for m in chosen:
        s = patches.slot[m]
        o = (s // width) * FIELDS * width + s % width
        n = _vector(record, o + NORMAL * width, width)
        t, u = _vector(record, o + TANGENT_1 * width, width), _vector(record, o + TANGENT_2 * width, width)
        f1, f2, f3 = _vector(record, o + PUSH_1 * width, width)
        press, turn_1, turn_2 = 0.0, 0.0, 0.0
        for c in range(patches.size[m]):
            g = o + (POINT + POINT_SIZE * c) * width
            p = _field(record, g + PRESS * width)
            press = press + p
            turn_1, turn_2 = turn_1 + p * _field(record, g + Y * width), turn_2 - p * _field(record, g + X * width)
        a, b, arm_a, arm_b = _arms_to(bodies, batches, s, o, width, -1)
        # Impulses act on b and their opposites on a: the support works with the impulse on the other body, at its own speed.
        support, other, sign, arm = (b, a, -1.0, arm_b) if bodies.mass[8 * b + INVERSE_MASS] == 0.0 else (a, b, 1.0, arm_a)
        ux, uy, uz = _velocity_at(bodies, support, arm)
        v = bodies.velocity[8 * support + 3 : 8 * support + 6]
        for k in range(3):
            force, torque = press * n[k] + f1 * t[k] + f2 * u[k], turn_1 * t[k] + turn_2 * u[k] + f3 * n[k]
            given[other] += sign * (force * (ux if k == 0 else (uy if k == 1 else uz)) + torque * v[k])


@jit
def _round(number, colours):
    """Phase and colour of a round."""
    k = number % (3 * colours + 2)
    if k == 0:
        return KICK, 0
    if k == 2 * colours + 1:
        return MOVE, 0
    if k > 2 * colours + 1:
        return RELAX, k - 2 * colours - 2
    return (WARM, k - 1) if k <= colours else (SOLVE, k - 1 - colours)


@jit
def _extent(bodies, edges, phase, colour):
    """Begin and end of the bodies or batches of a round, how many of them make a piece, and the number of pieces."""
    begin, end, each = 0, bodies.part.shape[0], BODIES_EACH
    if phase not in (KICK, MOVE):
        begin, end, each = edges[colour], edges[colour + 1], BATCHES_EACH
    return begin, end, each, (end - begin + each - 1) // each


@jit
def _work_on(simd, solve, h, phase, colour, begin, end):
    """Work on a piece of a round."""
    bodies, batches = solve.bodies, solve.batches
    moved = bodies.drift if colour < solve.steady else bodies.moved
    if phase == KICK:
        kick(bodies, begin, end, h)
    elif phase == WARM:
        warm_start(simd, batches, begin, end, bodies.velocity, moved, bodies.mass)
    elif phase == MOVE:
        move(bodies, begin, end, h)
    else:
        solve_batches(simd, batches, begin, end, bodies, moved, h, phase == RELAX)


@jit
def _lead(simd, solve, h, work_queue, is_shared, number):
    """Work on a round until it is done."""
    phase, colour = _round(number, solve.edges.shape[0] - 1)
    begin, end, each, pieces = _extent(solve.bodies, solve.edges, phase, colour)
    # A round of one piece is not worth the wait for a helper.
    if not is_shared or pieces < 2:
        _work_on(simd, solve, h, phase, colour, begin, end)
        return
    open_round(work_queue, number)
    mine = 0
    while True:
        _, taken = take_piece(work_queue)
        if taken >= pieces:
            break
        first = begin + mine * each
        _work_on(simd, solve, h, phase, colour, first, min(first + each, end))
        mine += 1
    wait_for(work_queue, pieces - mine)


@jit
def _help(simd, solve, h, work_queue):
    """Work on every round that is open, to the last."""
    bodies, edges = solve.bodies, solve.edges
    waited, colours, mine, last = 0, edges.shape[0] - 1, 0, NONE
    while waited < PATIENCE:
        number, taken = look_at(work_queue)
        if number >= 0 and number != LAST and taken < _extent(bodies, edges, *_round(number, colours))[3]:
            # Another round may be open by now.
            number, taken = take_piece(work_queue)
        if number == LAST:
            return
        waited += 1
        if number >= 0:
            phase, colour = _round(number, colours)
            begin, end, each, pieces = _extent(bodies, edges, phase, colour)
            if taken < pieces:
                mine = mine + 1 if number == last else 1
                last, waited = number, 0
                first = begin + (pieces - mine) * each
                _work_on(simd, solve, h, phase, colour, first, min(first + each, end))
                report_piece(work_queue)
        pause()


@jit
def advance(simd, solve, special, sub_steps, h, work_queue, share, shares):
    """Make `sub_steps` sub-steps of length h; adds up the work of moving supports.

    share: 0 for the thread that leads, 1 for the one that helps, if `shares` is 2; see `workers`.
    """
    width, colours = width_of(simd), solve.edges.shape[0] - 1
    bodies, patches, batches = solve.bodies, solve.patches, solve.batches
    if share > 0:
        _help(simd, solve, h, work_queue)
        return
    for s in range(sub_steps):
        first = s * (3 * colours + 2)
        for k in range(2 * colours + 2):
            _lead(simd, solve, h, work_queue, shares > 1, first + k)
        _turn_balls(width, bodies, solve.pairs, patches, special.balls, solve.rows, batches)
        for k in range(2 * colours + 2, 3 * colours + 2):
            _lead(simd, solve, h, work_queue, shares > 1, first + k)
        # The work is counted first: a rebound sets impulses to zero that have acted already.
        _add_work(width, bodies, patches, special.supports, batches, special.given)
        _rebound(width, bodies, patches, special.rebounds, batches, special)
    open_round(work_queue, LAST)
    finish(bodies)
