"""Impacts of many contacts at one instant.

`solve_block` treats its contacts all at once: find impulses p with u+ = u + W p, where for approaching contacts the
target is u_n+ >= -e u_n (Newton's law), complementary to p_n >= 0, with Coulomb's cone (see constrain/newton.py). If
that made energy (Newton's law with friction can), the fully inelastic answer p0 is taken (1 + e) times: the change of
energy along s p0 is q s (s / 2 - 1) with q = p0.W p0 >= 0, never positive for s <= 2.

`respond_sequential` goes contact pair by contact pair, fastest approach first, one block inside a pair (a box landing
on a face is one impact with four points); what no longer rebounds is finished by one inelastic block. It passes k
balls for k in Newton's cradle. `respond_simultaneous` takes the whole group as one block. Both follow the rules of
Smith et al. 2012 (momentum kept, one-sided impulses, energy bounded); they differ in which of the physically possible
answers a chain of bodies gives.
"""

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.joint_impact import apply_joint_impulses, copy_rows, number_all
from rigidimpulse.constrain.newton import solve_newton
from rigidimpulse.constrain.rows import (
    contact_rows,
    contact_velocity,
    count_contact_rows,
    impulse_along,
    make_rows,
    multiply,
    multiply_transposed,
    number_members,
    rows_of,
)
from rigidimpulse.respond.impulse import apply_impulse, log_impact, relative_velocity, resolve_contact

# Residual asked of the solver and what counts as approaching, relative to the speed of the group.
SOLVE_TOLERANCE = 1e-14
# Impulses per contact before a group is finished without rebound.
IMPULSES_PER_CONTACT = 200


@jit
def _restitution(contacts, c, approach, rest_speed):
    """e, or 0 where the rebound would rise less than the gap the contact is held at (LOOP rule: no speed threshold)."""
    e = contacts.restitution[c]
    return e if e * abs(approach) > rest_speed[c] else 0.0


@jit
def _block_impulses(rows, n, first_row, friction, scale):
    """Solve one block; static friction first, contacts that still slip again with dynamic friction."""
    count = rows.bias.shape[0]
    y, after = np.empty((n, 6)), np.empty(count)
    solve_newton(rows, n, SOLVE_TOLERANCE * scale)
    multiply_transposed(rows, rows.impulse, y)
    multiply(rows, y, after)
    changed = False
    for s in range(first_row.shape[0]):
        i = first_row[s] + 1
        if rows_of(rows, i - 1) < 3 or friction[s] == rows.coefficient[i]:
            continue
        slip = abs(rows.bias[i] + after[i]) + abs(rows.bias[i + 1] + after[i + 1])
        if slip > 1e-9 * scale:
            rows.coefficient[i] = rows.coefficient[i + 1] = friction[s]
            changed = True
    if changed:
        solve_newton(rows, n, SOLVE_TOLERANCE * scale)


@jit
def solve_block(bodies, contacts, subset, rebound, rest_speed, scale, number, joints, log, count):
    """Resolve the contacts of subset together and apply the impulses; `rebound` 1, or 0 for an inelastic one. New log count."""
    m = subset.shape[0]
    members = number_members(bodies, contacts, subset, number) if joints is None else number_all(joints.members, number)
    n, start = members.shape[0], count_contact_rows(contacts, subset)
    rows = make_rows(start + (np.int64(0) if joints is None else joints.rows.bias.shape[0]))
    if joints is not None:
        copy_rows(joints.rows, rows, start)
    first_row, frames = np.empty(m, np.int64), np.empty((m, 3, 3))
    contact_rows(bodies, contacts, subset, number, rows, first_row, frames)
    u, v = np.empty((m, 3)), np.empty(3)
    e, e_t, friction = np.zeros(m), np.zeros(m), np.empty(m)
    largest = 0.0
    for s in range(m):
        c = subset[s]
        contact_velocity(contacts, c, frames[s], bodies.velocity, bodies.angular_velocity, u[s])
        friction[s] = contacts.dynamic_friction[c]
        approach = relative_velocity(bodies, contacts, c, v)
        if approach < 0.0:
            e[s] = rebound * _restitution(contacts, c, approach, rest_speed)
            e_t[s] = contacts.tangential_restitution[c] if e[s] > 0.0 else 0.0
            largest = max(largest, e[s])
    _set_bias(rows, first_row, u, e, e_t)
    _block_impulses(rows, n, first_row, friction, scale)
    if largest > 0.0 and _energy_change(rows, n, first_row, u) > 0.0:
        for s in range(m):
            e[s] = e_t[s] = 0.0
        _set_bias(rows, first_row, u, e, e_t)
        rows.impulse[:] = 0.0
        for s in range(m):
            i = first_row[s] + 1
            if rows_of(rows, first_row[s]) == 3:
                rows.coefficient[i] = rows.coefficient[i + 1] = contacts.static_friction[subset[s]]
        _block_impulses(rows, n, first_row, friction, scale)
        for i in range(rows.bias.shape[0]):
            rows.impulse[i] *= 1.0 + largest
    return _apply(bodies, contacts, members, subset, rows, first_row, frames, u, joints, log, count)


@jit
def _set_bias(rows, first_row, u, e, e_t):
    """b = u + e u_n along the normal, (1 + e_t) u_t along the tangents."""
    for s in range(first_row.shape[0]):
        i = first_row[s]
        rows.bias[i] = u[s, 0] + e[s] * u[s, 0]
        if rows_of(rows, i) == 3:
            rows.bias[i + 1], rows.bias[i + 2] = u[s, 1] * (1.0 + e_t[s]), u[s, 2] * (1.0 + e_t[s])


@jit
def _energy_change(rows, n, first_row, u):
    """p.u + |Jh^T p|^2 / 2, less the round-off of its terms [J]."""
    y = np.empty((n, 6))
    multiply_transposed(rows, rows.impulse, y)
    linear = moved = quadratic = 0.0
    for s in range(first_row.shape[0]):
        i = first_row[s]
        for k in range(rows_of(rows, i)):
            linear += rows.impulse[i + k] * u[s, k]
            moved += abs(rows.impulse[i + k] * u[s, k])
    for i in range(n):
        for k in range(6):
            quadratic += 0.5 * y[i, k] * y[i, k]
    return linear + quadratic - 1e-13 * (moved + quadratic)


@jit
def _apply(bodies, contacts, members, subset, rows, first_row, frames, u, joints, log, count):
    impulse = np.empty(3)
    if joints is not None:
        apply_joint_impulses(bodies, members, rows, joints)
    first = count
    for s in range(subset.shape[0]):
        i = first_row[s]
        impulse_along(rows, i, frames[s], impulse)
        if rows.impulse[i] > 0.0:
            apply_impulse(bodies, contacts, subset[s], impulse[0], impulse[1], impulse[2])
            count = log_impact(bodies, contacts, subset[s], impulse, u[s, 0], log, count)
    v = np.empty(3)
    for i in range(first, count):
        log[i, 6] = relative_velocity(bodies, contacts, int(log[i, 0]), v)
    return count


@jit
def _approaching(bodies, contacts, tolerance, rebounding, rest_speed):
    """The fastest approaching contact, or -1; only contacts that rebound if `rebounding` is 1."""
    u = np.empty(3)
    best, fastest = -1, -tolerance
    for c in range(contacts.gap.shape[0]):
        approach = relative_velocity(bodies, contacts, c, u)
        if approach < fastest and (rebounding == 0.0 or _restitution(contacts, c, approach, rest_speed) > 0.0):
            best, fastest = c, approach
    return best


@jit
def _same_pair(contacts, c):
    count = 0
    for d in range(contacts.gap.shape[0]):
        if contacts.body_a[d] == contacts.body_a[c] and contacts.body_b[d] == contacts.body_b[c]:
            count += 1
    subset = np.empty(count, np.int64)
    count = 0
    for d in range(contacts.gap.shape[0]):
        if contacts.body_a[d] == contacts.body_a[c] and contacts.body_b[d] == contacts.body_b[c]:
            subset[count] = d
            count += 1
    return subset


@jit
def respond_sequential(bodies, contacts, rest_speed, tolerance, scale, number, joints, log):
    """Pair after pair, fastest approach first. Returns (rows written to log, impulses made, whether the cap was reached).

    A full log ends the call early, without the inelastic finish: read it and call again.

    rest_speed (m,): a rebound slower than this is none [m/s]; tolerance: slower approach is none [m/s]; scale: speed of the group;
    joints: None, or the `JointBlock` of the group, whose rows take part in every impulse.
    """
    count = np.int64(0)
    impulses = 0
    cap = IMPULSES_PER_CONTACT * contacts.gap.shape[0]
    u = np.empty(3)
    while impulses < cap and count + contacts.gap.shape[0] < log.shape[0]:
        c = _approaching(bodies, contacts, tolerance, 1.0, rest_speed)
        if c < 0:
            break
        subset = _same_pair(contacts, c)
        if subset.shape[0] == 1 and joints is None:
            e = _restitution(contacts, c, relative_velocity(bodies, contacts, c, u), rest_speed)
            count = resolve_contact(bodies, contacts, c, e, log, count)
        else:
            count = solve_block(bodies, contacts, subset, 1.0, rest_speed, scale, number, joints, log, count)
        impulses += 1
    full = count + contacts.gap.shape[0] >= log.shape[0]
    if not full and _approaching(bodies, contacts, tolerance, 0.0, rest_speed) >= 0:
        count = _finish(bodies, contacts, rest_speed, scale, number, joints, log, count)
        impulses += 1
    return count, impulses, impulses >= cap


@jit
def _finish(bodies, contacts, rest_speed, scale, number, joints, log, count):
    if contacts.gap.shape[0] == 1 and joints is None:
        return resolve_contact(bodies, contacts, np.int64(0), 0.0, log, count)
    subset = np.arange(contacts.gap.shape[0])
    return solve_block(bodies, contacts, subset, 0.0, rest_speed, scale, number, joints, log, count)


@jit
def respond_simultaneous(bodies, contacts, rest_speed, tolerance, scale, number, joints, log):
    """The whole group as one block; same arguments and answer as `respond_sequential`."""
    c = _approaching(bodies, contacts, tolerance, 0.0, rest_speed)
    if c < 0:
        return 0, 0, False
    u = np.empty(3)
    if contacts.gap.shape[0] == 1 and joints is None:
        c = np.int64(0)
        e = _restitution(contacts, c, relative_velocity(bodies, contacts, c, u), rest_speed)
        return resolve_contact(bodies, contacts, c, e, log, c), 1, False
    subset = np.arange(contacts.gap.shape[0])
    count = solve_block(bodies, contacts, subset, 1.0, rest_speed, scale, number, joints, log, np.int64(0))
    impulses = 1
    if _approaching(bodies, contacts, tolerance, 0.0, rest_speed) >= 0:
        count = _finish(bodies, contacts, rest_speed, scale, number, joints, log, count)
        impulses += 1
    return count, impulses, False
