"""Impacts of many contacts at one instant.

`respond_sequential` goes contact pair by contact pair, fastest approach first: one contact point as in `point`,
several as one block (a box landing on a face is one impact with four points; see `block`); what no longer rebounds is
finished by one inelastic block. It passes k balls for k in Newton's cradle. Where bodies already bear each other (a ball
that falls on a stack) all contacts are one block, with rebound where they approach: pair after pair, hundreds of
impulses would run to and fro in the stack and eat all energy (compliant references: a ball at 5 m/s on five boxes, e =
0.5, leaves with 1.8 to 2.7 m/s; one block 2.5, pairs 0.8). `respond_simultaneous` takes the whole island as one block.
Both follow the rules of Smith et al. 2012 (momentum kept, one-sided impulses, energy bounded);
they differ in which of the physically possible answers a chain of bodies gives.
"""

from math import inf

import numpy as np

from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.impact.block import rebound_of, solve_block
from rigidimpulse.dynamics.impact.point import relative_velocity, resolve_contact
from rigidimpulse.dynamics.impact.restitution import ImpactRule

# Impulses per contact before an island is finished without rebound.
IMPULSES_PER_CONTACT = 200
# Impulses per contact after which it is asked whether contacts have collapsed, and the part of its approach speed that a collapsed one
# could still have.
IMPULSES_PER_ROUND = 8
COLLAPSED = TOLERANCES.impact.collapsed


@jit_making_arrays
def _approaching(bodies, contacts, tolerance, rebounding, rest_speed):
    """The fastest approaching contact, or -1; only contacts that rebound if `rebounding` is 1."""
    u = np.empty(3)
    best, fastest = np.int64(-1), -tolerance
    for c in range(contacts.gap.shape[0]):
        approach = relative_velocity(bodies, contacts, c, u)
        if approach < fastest and (rebounding == 0.0 or rebound_of(contacts, c, approach, rest_speed) > 0.0):
            best, fastest = c, approach
    return best


@jit_making_arrays
def resolve_singles(bodies, contacts, rule, rebound, cap, log, count):
    """Impacts of pairs with one contact, fastest first, until the fastest is of another pair; `rebound` 1, or 0 for inelastic ones.

    Returns (new count of log, impulses made, the fastest contact left or -1).
    """
    law, rest_speed, tolerance = rule.law, rule.rest_speed, rule.tolerance
    u = np.empty(3)
    made, best = np.int64(0), np.int64(-1)
    while made < cap and count + contacts.gap.shape[0] < log.shape[0]:
        best = _approaching(bodies, contacts, tolerance, rebound, rest_speed)
        if best < 0:
            break
        for d in range(contacts.gap.shape[0]):
            # A pair with several points is one block and not this function's.
            if d != best and contacts.body_a[d] == contacts.body_a[best] and contacts.body_b[d] == contacts.body_b[best]:
                return count, made, best
        e = rebound * rebound_of(contacts, best, relative_velocity(bodies, contacts, best, u), rest_speed)
        count = resolve_contact(bodies, contacts, best, e, law, log, count)
        made += 1
    return count, made, np.int64(-1)


@jit_making_arrays
def respond_sequential(bodies, contacts, rule, together, number, joints, log):
    """Pair after pair, fastest approach first. Returns (rows written to log, impulses made, whether the cap was reached).

    A full log ends the call early, without the inelastic finish: read it and call again. It must have more rows than there are contacts.

    rule: the `ImpactRule` of the m contacts; together: whether bodies press on each other, so that all contacts are one block; number
    (n,): working memory; joints: the `JointBlock` of the island, whose rows take part in every impulse; log (k, 7): see
    `point.log_impact`.
    """
    m, count, impulses = contacts.gap.shape[0], np.int64(0), np.int64(0)
    cap, round_cap = IMPULSES_PER_CONTACT * m, IMPULSES_PER_ROUND * m
    rule, one_block = ImpactRule(rule.law, rule.rest_speed.copy(), rule.tolerance, rule.scale), together and m > 1
    jointed = joints.joint.shape[0] > 0
    while impulses < cap and count + m < log.shape[0]:
        if impulses >= round_cap:
            _let_collapse(contacts, log[:count], rule.rest_speed)
        c = np.int64(-1)
        if not (jointed or one_block):
            count, made, c = resolve_singles(bodies, contacts, rule, 1.0, round_cap, log, count)
            impulses += made
            if made == round_cap:
                continue
        else:
            c = _approaching(bodies, contacts, rule.tolerance, 1.0, rule.rest_speed)
        if c < 0:
            break
        subset = _contacts_of_pair(contacts, c, together)
        count += solve_block(bodies, contacts, subset, 1.0, rule, number, joints, log[count:])
        impulses += 1
    if count + m < log.shape[0] and _approaching(bodies, contacts, rule.tolerance, 0.0, rule.rest_speed) >= 0:
        count = _finish(bodies, contacts, rule, number, joints, log, count)
        impulses += 1
    return count, impulses, impulses >= cap


@jit_making_arrays
def _contacts_of_pair(contacts, best, together):
    """Contacts (k,) of the pair of one of them; all contacts if all are `together`."""
    m, count = contacts.gap.shape[0], 0
    subset = np.empty(m, np.int64)
    for c in range(m):
        if together or (contacts.body_a[c] == contacts.body_a[best] and contacts.body_b[c] == contacts.body_b[best]):
            subset[count] = c
            count += 1
    return subset[:count]


@jit_making_arrays
def _let_collapse(contacts, log, rest_speed):
    """Let contacts that came back so often at this instant that nothing is left of their rebounds not rebound: infinite rest speeds (m,).

    A light body between heavy ones is hit by both in turn. With restitutions e, each round either turns the approach speeds and leaves
    a part e of them, or never ends (McNamara and Young 1992: inelastic collapse) and tends to one inelastic impact of all. After n rounds
    that impact is off by e^n at most, either way.
    """
    hits = np.zeros(contacts.gap.shape[0])
    for row in range(log.shape[0]):
        hits[np.int64(log[row, 0])] += 1.0
    for c in range(hits.shape[0]):
        if hits[c] >= IMPULSES_PER_ROUND and contacts.restitution[c] ** hits[c] < COLLAPSED:
            rest_speed[c] = inf


@jit_making_arrays
def _finish(bodies, contacts, rule, number, joints, log, count):
    """One inelastic impulse of all contacts; returns the new count of log."""
    if joints.joint.shape[0] == 0 and contacts.gap.shape[0] == 1:
        return resolve_singles(bodies, contacts, rule, 0.0, np.int64(1), log, count)[0]
    return count + solve_block(bodies, contacts, np.arange(contacts.gap.shape[0]), 0.0, rule, number, joints, log[count:])


@jit_making_arrays
def respond_simultaneous(bodies, contacts, rule, together, number, joints, log):
    """The whole island as one block; same arguments and answer as `respond_sequential`."""
    count, impulses = np.int64(0), np.int64(0)
    if _approaching(bodies, contacts, rule.tolerance, 0.0, rule.rest_speed) < 0:
        return count, impulses, False
    if joints.joint.shape[0] == 0 and contacts.gap.shape[0] == 1:
        # The only contact, by the law of a single one; inelastic where it is too slow to rebound.
        return respond_sequential(bodies, contacts, rule, together, number, joints, log)
    count = solve_block(bodies, contacts, np.arange(contacts.gap.shape[0]), 1.0, rule, number, joints, log)
    impulses += 1
    if _approaching(bodies, contacts, rule.tolerance, 0.0, rule.rest_speed) >= 0:
        count = _finish(bodies, contacts, rule, number, joints, log, count)
        impulses += 1
    return count, impulses, False
