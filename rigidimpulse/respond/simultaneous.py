"""Impacts of many contacts at one instant.

`respond_sequential` goes contact pair by contact pair, fastest approach first: one contact point as in impulse.py,
several as one block (a box landing on a face is one impact with four points; block.py); what no longer rebounds is
finished by one inelastic block. It passes k balls for k in Newton's cradle. Where bodies already bear each other (a ball
that falls on a stack) all contacts are one block, with rebound where they approach: pair after pair, hundreds of
impulses would run to and fro in the stack and eat all energy (compliant references: a ball at 5 m/s on five boxes, e =
0.5, leaves with 1.8 to 2.7 m/s; one block 2.5, pairs 0.8). `respond_simultaneous` takes the whole group as one block.
Both follow the rules of Smith et al. 2012 (momentum kept, one-sided impulses, energy bounded);
they differ in which of the physically possible answers a chain of bodies gives.
"""

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.respond.block import rebound_of, solve_block
from rigidimpulse.respond.impulse import relative_velocity, resolve_contact

# Impulses per contact before a group is finished without rebound.
IMPULSES_PER_CONTACT = 200


@jit
def _approaching(bodies, contacts, tolerance, rebounding, rest_speed):
    """The fastest approaching contact, or -1; only contacts that rebound if `rebounding` is 1."""
    u = np.empty(3)
    best, fastest = -1, -tolerance
    for c in range(contacts.gap.shape[0]):
        approach = relative_velocity(bodies, contacts, c, u)
        if approach < fastest and (rebounding == 0.0 or rebound_of(contacts, c, approach, rest_speed) > 0.0):
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
def respond_sequential(bodies, contacts, law, together, rest_speed, tolerance, scale, number, joints, log):
    """Pair after pair, fastest approach first. Returns (rows written to log, impulses made, whether the cap was reached).

    A full log ends the call early, without the inelastic finish: read it and call again.

    law: one of `restitution.LAWS`; together: whether bodies press on each other, so that all contacts are one block; rest_speed
    (m,): a rebound slower than this is none [m/s]; tolerance: slower approach is none [m/s]; scale: speed of the group; joints:
    None, or the `JointBlock` of the group, whose rows take part in every impulse.
    """
    count = np.int64(0)
    impulses = 0
    cap = IMPULSES_PER_CONTACT * contacts.gap.shape[0]
    u = np.empty(3)
    while impulses < cap and count + contacts.gap.shape[0] < log.shape[0]:
        c = _approaching(bodies, contacts, tolerance, 1.0, rest_speed)
        if c < 0:
            break
        subset = np.arange(contacts.gap.shape[0]) if together else _same_pair(contacts, c)
        if subset.shape[0] == 1 and joints is None:
            e = rebound_of(contacts, c, relative_velocity(bodies, contacts, c, u), rest_speed)
            count = resolve_contact(bodies, contacts, c, e, law, log, count)
        else:
            count = solve_block(bodies, contacts, subset, 1.0, law, rest_speed, scale, number, joints, log, count)
        impulses += 1
    full = count + contacts.gap.shape[0] >= log.shape[0]
    if not full and _approaching(bodies, contacts, tolerance, 0.0, rest_speed) >= 0:
        count = _finish(bodies, contacts, law, rest_speed, scale, number, joints, log, count)
        impulses += 1
    return count, impulses, impulses >= cap


@jit
def _finish(bodies, contacts, law, rest_speed, scale, number, joints, log, count):
    if contacts.gap.shape[0] == 1 and joints is None:
        return resolve_contact(bodies, contacts, np.int64(0), 0.0, law, log, count)
    subset = np.arange(contacts.gap.shape[0])
    return solve_block(bodies, contacts, subset, 0.0, law, rest_speed, scale, number, joints, log, count)


@jit
def respond_simultaneous(bodies, contacts, law, _together, rest_speed, tolerance, scale, number, joints, log):
    """The whole group as one block; same arguments and answer as `respond_sequential`."""
    c = _approaching(bodies, contacts, tolerance, 0.0, rest_speed)
    if c < 0:
        return 0, 0, False
    u = np.empty(3)
    if contacts.gap.shape[0] == 1 and joints is None:
        c = np.int64(0)
        e = rebound_of(contacts, c, relative_velocity(bodies, contacts, c, u), rest_speed)
        return resolve_contact(bodies, contacts, c, e, law, log, c), 1, False
    subset = np.arange(contacts.gap.shape[0])
    count = solve_block(bodies, contacts, subset, 1.0, law, rest_speed, scale, number, joints, log, np.int64(0))
    impulses = 1
    if _approaching(bodies, contacts, tolerance, 0.0, rest_speed) >= 0:
        count = _finish(bodies, contacts, law, rest_speed, scale, number, joints, log, count)
        impulses += 1
    return count, impulses, False
