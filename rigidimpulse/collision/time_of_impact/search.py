"""The search that both safe methods share, bisection and conservative advancement: safe steps until the gap is at `impact_margin`.

Each step asks the bounding spheres, then the shapes (`safe_step`). If the shapes limit the step by features that are at
`impact_margin` already and approach, the pair is in contact. Features at `impact_margin` that hover (they approach by less than
rounding until the end), slide or leave do not count: they may come closer by the slack for rounding, so that neither
lasting contact nor a rebound is taken for an impact. Surfaces that cross are in contact however they move.

Balls, and balls and planes that stand, have their time in closed form (`ball_time`), unless they hover.

With `ahead`, the time at which the limiting features come down to `impact_margin` is found by bisection
(`witness`); the steps then only have to confirm that nothing is earlier. Without it, they are repeated until
they are there (conservative advancement).

A pair is looked at no farther than to its `until`. It is told until when it is clear if that is before the end of the step.
"""

from __future__ import annotations

from math import inf, nan

from rigidimpulse.collision.time_of_impact.free_flight import plane_safe_until, relative_flight, rounding_slack, spheres_safe_until
from rigidimpulse.collision.time_of_impact.motion_bound import MOTION_SIZE, motion_bound, stop_turning
from rigidimpulse.collision.time_of_impact.result import IMPACT, SEPARATE, STALLED, TOUCHING
from rigidimpulse.collision.time_of_impact.safe_step import safe_time
from rigidimpulse.collision.time_of_impact.scratch_layout import GAP, MOTION, WITNESS, PairScratch
from rigidimpulse.collision.time_of_impact.spheres import Pair, ball_time, is_closed_form, write_ball_witness
from rigidimpulse.collision.time_of_impact.witness import closing_speed, witness_root
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import length, row
from rigidimpulse.motion.trajectory import FIXED

_TURN = 0.5  # rad, angle that a body turns at most in one step: beyond it the third derivatives take over
_WORTHWHILE = 0.25  # part of the horizon that bounding spheres must clear to save a look at the shapes
_GROWTH = 4.0  # how much longer a step is tried after a free one
_EPSILON = 2.0**-52


@jit
def _later(t, s):
    """Return t + s rounded down: never later than that."""
    result = t + s
    return result - _EPSILON * abs(result) if result - t > s else result


@jit
def _flight_safe_until(frame, trajectory, scratch, pair, t, threshold, horizon):
    """Return (safe time of the bounding spheres or planes, whether it is exact for the shapes)."""
    a, b, shape_a, shape_b = pair
    flight = relative_flight(trajectory, a, b, t)
    x, v, acceleration, jerk = flight
    plane_a, plane_b = scratch.plane[shape_a], scratch.plane[shape_b]
    if plane_a >= 0 or plane_b >= 0:
        i, plane, other = a if plane_a >= 0 else b, max(plane_a, plane_b), shape_b if plane_a >= 0 else shape_a
        if trajectory.mode[i] != FIXED and length(row(trajectory.angular_velocity, i)) > 0.0:
            # A plane that turns has no closed form.
            return 0.0, False
        sign, ball = 1.0 if plane_a >= 0 else -1.0, scratch.ball[other]
        n0, n1, n2 = sign * frame[plane, 0], sign * frame[plane, 1], sign * frame[plane, 2]
        level = frame[plane, 3] + scratch.reach[other] + threshold
        return plane_safe_until(trajectory, i, ((n0, n1, n2), level), ball, flight, horizon), ball
    reach = scratch.reach[shape_a] + scratch.reach[shape_b] + threshold
    if reach == inf:
        return 0.0, False
    # For two balls the bounding spheres are the shapes.
    exact = scratch.ball[shape_a] and scratch.ball[shape_b]
    return spheres_safe_until(x, v, acceleration, jerk, reach, exact, horizon), exact


@jit
def _bring_motions(trajectory, scratch, pair, t, horizon):
    """Write the motions of a pair at time t, over a horizon in which neither turns too far; returns that horizon."""
    a, b, shape_a, shape_b = pair
    for side in range(2):
        i, shape = b if side else a, shape_b if side else shape_a
        if not scratch.ball[shape] and trajectory.mode[i] != FIXED:
            spin = length(row(trajectory.angular_velocity, i))
            if spin * horizon > _TURN:
                horizon = _TURN / spin
    for side in range(2):
        i, shape = b if side else a, shape_b if side else shape_a
        motion = MOTION + MOTION_SIZE * side
        motion_bound(trajectory, i, t, horizon, scratch.work[motion : motion + MOTION_SIZE])
        if scratch.ball[shape]:
            stop_turning(scratch.work[motion : motion + MOTION_SIZE])
    return horizon


@jit
def _record(result, k, time, status, queries, work):
    """Write answer k; the witness only where contact is made."""
    result.time[k], result.status[k], result.queries[k] = time, status, queries
    if status == IMPACT or status == TOUCHING:
        for i in range(result.witness.shape[1]):
            result.witness[k, i] = work[WITNESS + i]


@jit
def _record_ball(frame, trajectory, scratch, pair, t, interval, result, k):
    """Write answer k for a pair that meets at t [s]; interval: (start, end), s."""
    start, end = interval
    result.time[k], result.status[k], result.queries[k] = t if t < end else inf, SEPARATE, 1
    if t < end:
        result.status[k] = IMPACT if t > start else TOUCHING
        write_ball_witness(frame, trajectory, scratch, pair, t, result.witness[k])


@jit
def first_contacts(geometry, trajectory, scratch, shape_of_body, pairs, end, effort, result):
    """Fill in `result` (`ImpactTimes`); end: of the step, s, scratch: `SweepScratch`, pairs: `PairsToSweep`, effort: `SearchEffort`."""
    start, impact_margin, tolerance = pairs.start, pairs.impact_margin, pairs.tolerance
    ahead, max_queries = effort
    work, pair_scratch = scratch.work, PairScratch(scratch.work, scratch.index)
    for k in range(pairs.a.shape[0]):
        a, b = pairs.a[k], pairs.b[k]
        shape_a, shape_b = shape_of_body[a], shape_of_body[b]
        pair = Pair(a, b, shape_a, shape_b)
        if is_closed_form(trajectory, scratch, a, b, shape_a, shape_b, impact_margin[k]):
            t = ball_time(geometry.frame, trajectory, scratch, pair, start[k])
            if t == t:
                _record_ball(geometry.frame, trajectory, scratch, pair, t, (start[k], end), result, k)
                continue
        slack = rounding_slack(trajectory, scratch.reach, a, b, shape_a, shape_b, end)
        above = max(tolerance[k], slack)
        last = pairs.until[k]
        t, target, trial, floor = start[k], last, last - start[k], impact_margin[k]
        status, queries, is_let_go = STALLED, 0, False
        while queries < max_queries:
            rest = target - t
            horizon = rest if is_let_go else min(rest, trial)
            queries += 1
            s, exact = _flight_safe_until(geometry.frame, trajectory, scratch, pair, t, floor, horizon)
            # The bounding spheres alone may allow a long step; only else the shapes are asked.
            is_free = s >= horizon or (not exact and s > _WORTHWHILE * horizon)
            if not is_free:
                span = _bring_motions(trajectory, scratch, pair, t, horizon)
                safe = safe_time(geometry, shape_a, shape_b, pair_scratch, floor, span)
                is_free = safe >= span
                s = s if exact and not is_free else safe
            if is_free:
                if s >= rest and target == last:
                    t, status = inf, SEPARATE
                    result.clear[k] = last if last < end else nan
                    break
                t, target = target if s >= rest else _later(t, s), last if s >= rest else target
                trial, floor, is_let_go = max(_GROWTH * s, trial), impact_margin[k], False
                continue
            gap, closing = work[WITNESS + GAP], closing_speed(work)
            near = gap <= impact_margin[k] + above
            # In contact: features at the margin that approach by more than rounding.
            if near and closing * (end - t) > slack:
                status = TOUCHING if t == start[k] and gap <= impact_margin[k] else IMPACT
                break
            if near and not is_let_go:
                # They hover, slide or leave: they may come closer by the slack for rounding.
                floor, is_let_go, target = min(gap, impact_margin[k]) - slack, True, last
                continue
            if near and closing < 0.0:
                s *= 0.5  # it leaves: look again half way to its return
            now, t = t, _later(t, s)
            if t <= now:
                status = IMPACT
                break
            trial, floor, is_let_go = 2.0 * s, impact_margin[k], False
            # Look ahead for the root of the limiting features; safe steps then only confirm that nothing is earlier.
            probe = min(target, t + ahead * s)
            if probe > t and not exact:
                root, used = witness_root(geometry, trajectory, pair_scratch, a, b, (t, probe), impact_margin[k], above)
                target, queries = min(target, root), queries + used
        _record(result, k, t, status, queries, work)
