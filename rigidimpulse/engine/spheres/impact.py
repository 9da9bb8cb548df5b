"""One simple impact: two bodies that touch at one point and nothing else, fast enough to rebound.

The kernels are those of the loop in Python, called in its order, so the results are the same bits. An impact is simple where the loop
would apply one impulse and do nothing else. With the approach speed c, the speed s at which the bodies part, restitution e, and the speed r
below which contacts are held (`engine/touching.py`),

    c > 2 r,   e c > 2 r,   s > 2 r.

The accelerations alone bound r from above, because the curvature of balls only lessens it. Bodies at rest are left to the loop, and so
are pairs that come back at the same instant or before their gap exceeded the contact margin.
"""

from __future__ import annotations

from math import isfinite, sqrt

import numpy as np

from rigidimpulse.collision.manifold.plane import plane_in_frame
from rigidimpulse.collision.time_of_impact.spheres import DEEPEST
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, dot, moved, relative_pose, scaled, turned
from rigidimpulse.dynamics.energy import kinetic_of
from rigidimpulse.dynamics.impact.point import relative_velocity, resolve_contact, speed_scale
from rigidimpulse.engine.exact.impacts import SLOW
from rigidimpulse.engine.pair_events import INSTANT
from rigidimpulse.engine.pair_table import MARGIN
from rigidimpulse.engine.spheres.layout import PLANE
from rigidimpulse.engine.spheres.motion import begin_free_trajectory, bring_ball, write_frames
from rigidimpulse.engine.spheres.paths import GAP, KIND, MOVES, RADIUS
from rigidimpulse.model.contact_memory import place_of, remember_rebound
from rigidimpulse.recording.events import write_impacts

_APPROACH = TOLERANCES.contact.approach
_CLEAR = 2.0
"""How many times faster than what would be held a simple impact is."""
_ROUND_OFF = TOLERANCES.time_of_impact.curved_pressure
_NONE, _ONE = np.int64(0), np.int64(1)


@jit_making_arrays
def _contact(fixed, motion, contacts, paths, planes, a, b, plane, margin):
    """Write the contact of two balls, or of a ball and a plane, within the margin; returns whether there is one.

    These are the operations of `manifold.pair_contacts` and `touching.fill_contacts`, for balls, whose centres are at 0.
    """
    now, rotation, centre = motion.now, motion.rotation, (0.0, 0.0, 0.0)
    r, t = np.empty((3, 3)), np.empty(3)
    first, second = (b, a) if plane >= 0 and paths[a, KIND] == PLANE else (a, b)
    relative_pose(rotation[first], now.position[first], rotation[second], now.position[second], r, t)
    radius = paths[first, RADIUS]
    if plane >= 0:
        up, offset = plane_in_frame(planes, plane, r, t)
        height = dot(centre, up) - offset
        normal, gap = scaled(up, -1.0), height - radius
        point_first, point_second = along(centre, -radius, up), along(centre, -height, up)
    else:
        between = moved(r, t, centre)
        distance = sqrt(dot(between, between))
        normal = (between[0] / distance, between[1] / distance, between[2] / distance)
        gap = distance - radius - paths[second, RADIUS]
        point_first, point_second = along(centre, radius, normal), along(between, -paths[second, RADIUS], normal)
    # `not <=`, so that a gap that is no number is no contact.
    if not gap <= margin:
        return False
    x, axes = now.position[first], rotation[first]
    point_a, point_b = moved(axes, x, point_first), moved(axes, x, point_second)
    normal = turned(axes, normal)
    # Contacts run from a to b.
    if first == b:
        point_a, point_b, normal = point_b, point_a, scaled(normal, -1.0)
    for k in range(3):
        contacts.arm_a[0, k], contacts.arm_b[0, k] = point_a[k] - now.position[a, k], point_b[k] - now.position[b, k]
        contacts.normal[0, k] = normal[k]
    pair = fixed.coefficients[fixed.material[a], fixed.material[b]]
    contacts.body_a[0], contacts.body_b[0], contacts.gap[0], contacts.restitution[0] = a, b, gap, pair[0]
    contacts.static_friction[0], contacts.dynamic_friction[0], contacts.tangential_restitution[0] = pair[1], pair[2], pair[3]
    return True


@jit
def _slow(fixed, motion, contacts, radius, contact_margin):
    """A speed of approach [m/s] that is surely more than what would be held or counts as none."""
    a, b, n = contacts.body_a[0], contacts.body_b[0], contacts.normal[0]
    press = 0.0
    for k in range(3):
        # What presses the bodies together if both keep their present accelerations.
        press += n[k] * (motion.trajectory.acceleration[a, k] - motion.trajectory.acceleration[b, k])
    # A contact that the support bears is pressed by the whole steady acceleration at least.
    if not (fixed.dynamic[a] and fixed.dynamic[b]):
        for i in (a, b):
            pull = fixed.steady[i]
            press = max(press, sqrt(pull[0] ** 2 + pull[1] ** 2 + pull[2] ** 2))
    scale = speed_scale(motion.now, contacts)
    press = max(press, 0.0) + _ROUND_OFF * scale * scale / radius
    return _CLEAR * sqrt(2.0 * press * contact_margin) * (1.0 + SLOW) + _CLEAR * _APPROACH * scale


@jit
def _has_changed(now, i, before):
    """Whether the velocities of body i are others than before (6,), and numbers."""
    differs, finite = False, True
    for k in range(3):
        differs |= now.velocity[i, k] != before[k] or now.angular_velocity[i, k] != before[3 + k]
        finite &= isfinite(now.velocity[i, k]) and isfinite(now.angular_velocity[i, k])
    return differs and finite


@jit_making_arrays
def _members(fixed, record, a, b):
    """The movable ones of two bodies, in order of index."""
    count = 0
    for i in (min(a, b), max(a, b)):
        if fixed.dynamic[i]:
            record.members[count] = i
            count += 1
    return record.members[:count]


@jit
def _comes_back(rebounds, key, time, contact_margin, instant):
    """Whether a pair rebounded so lately, or so often after less than its contact margin delta, that the loop counts it."""
    last = place_of(rebounds, key)
    if rebounds.key[last] != key:
        return False
    since = time - rebounds.time[last]
    return rebounds.count[last] > 0 or since * rebounds.speed[last] < _CLEAR * contact_margin or since <= _CLEAR * instant


@jit_making_arrays
def simple_impact(fixed, motion, record, rebounds, paths, planes, a, b, plane, time):
    """Let bodies a < b, which come to touch at `time` [s], rebound; returns False, with nothing changed, where that is not simple.

    plane: the number of the one that is a plane, or -1.
    """
    contact_margin, radius = min(paths[a, GAP], paths[b, GAP]), min(paths[a, RADIUS], paths[b, RADIUS])
    key = a * len(paths) + b
    # The loop in Python counts rebounds that follow each other closely.
    if _comes_back(rebounds, key, time, contact_margin, INSTANT * fixed.step):
        return False
    for i in (a, b):
        # Bodies at rest are left to the loop.
        if fixed.dynamic[i] and paths[i, MOVES] == 0.0:
            return False
        bring_ball(motion, i, time)
    if not _contact(fixed, motion, record.contacts, paths, planes, a, b, plane, MARGIN * contact_margin):
        return False
    if record.contacts.gap[0] < -0.5 * DEEPEST * radius:
        return False
    now, contacts, u = motion.now, record.contacts, np.empty(3)
    approach, slow = relative_velocity(now, contacts, _NONE, u), _slow(fixed, motion, contacts, radius, contact_margin)
    e = contacts.restitution[0]
    # c > 2 r and e c > 2 r: see the head of the file.
    if not (-approach > slow and -e * approach > slow):
        return False
    members = _members(fixed, record, a, b)
    before = np.empty((2, 6))
    for m in range(len(members)):
        before[m, :3], before[m, 3:] = now.velocity[members[m]], now.angular_velocity[members[m]]
    energy = kinetic_of(now.velocity, now.angular_velocity, now.orientation, fixed.mass, fixed.inertia, members)
    resolve_contact(now, contacts, _NONE, e, fixed.law, record.log, _NONE)
    # The bodies part faster than 2 r, or the loop would hold the contact.
    if not record.log[0, 6] > slow:
        return False
    for m in range(len(members)):
        # The loop keeps the trajectory of a body whose velocity does not change.
        if not _has_changed(now, members[m], before[m]):
            return False
    at = record.count[0]
    write_impacts(time, contacts, now.position, record.log, _ONE, record.rows, at)
    record.energy[at] = kinetic_of(now.velocity, now.angular_velocity, now.orientation, fixed.mass, fixed.inertia, members) - energy
    record.count[0] = at + 1
    remember_rebound(rebounds, key, time, record.log[0, 6], _NONE)
    for i in members:
        write_frames(motion.trajectory, record, i, i + 1, time)
        begin_free_trajectory(motion, i, time, fixed.steady[i])
    return True
