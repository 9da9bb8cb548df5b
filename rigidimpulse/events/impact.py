"""One simple impact: two bodies that touch at one point and nothing else, fast enough to rebound.

The kernels are those of the loop in Python (detect, respond, integrate, observe), called in its order, so the results are
the same bits. An impact is simple where the loop would do nothing but one impulse. With the approach speed c, restitution
e, and the speed r below which contacts are held (detect/touching.py),

    c > 2 r,   e c > 2 r,   and 2 r is exceeded by the speed at which the bodies part.

r is bounded from above by the accelerations alone: what the curvature of balls adds to the gap only lessens r. Bodies
at rest, and pairs that come back at the same instant or after less than the held gap, are left to the loop.
"""

from __future__ import annotations

from math import isfinite, sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.conventions import TOLERANCES
from rigidimpulse.detect.closed_form import round_half_space_contacts, sphere_sphere_contact
from rigidimpulse.detect.features import moved, relative_pose, row
from rigidimpulse.detect.groups import MARGIN
from rigidimpulse.detect.manifold import _rows_to_world
from rigidimpulse.detect.touching import _point_acceleration, bring, fill_contacts
from rigidimpulse.detect.window import INSTANT
from rigidimpulse.events.layout import PLANE
from rigidimpulse.integrate.course import FIXED, FREE, take
from rigidimpulse.observe.energy import _kinetic
from rigidimpulse.observe.events import write_impacts
from rigidimpulse.observe.recorder import sample_path
from rigidimpulse.respond.impulse import relative_velocity, resolve_contact, speed_scale
from rigidimpulse.respond.response import SLOW
from rigidimpulse.sweep.ball_time import DEEPEST

_APPROACH = TOLERANCES.approach
_CLEAR = 2.0
"""How many times faster than what would be held a simple impact is."""
_ROUND_OFF = 1e-9
"""Part of the acceleration on a curved path that rounding may add to what presses a contact."""
_FREE, _NONE, _ONE = np.int64(FREE), np.int64(0), np.int64(1)


@jit
def place_of(rebounds, key):
    """Place of a key, or the free place where it belongs."""
    last = len(rebounds.key) - 1
    at = (key * np.int64(0x9E3779B97F4A7C1) >> 7) & last
    while rebounds.key[at] >= 0 and rebounds.key[at] != key:
        at = (at + 1) & last
    return at


@jit
def remember(rebounds, key, time, speed, count):
    """Keep the last rebound of a pair; there must be a free place."""
    at = place_of(rebounds, key)
    if rebounds.key[at] < 0:
        rebounds.key[at] = key
        rebounds.used[0] += 1
    rebounds.time[at], rebounds.speed[at], rebounds.count[at] = time, speed, count


@jit
def copy_rebounds(source, target):
    """Put all rebounds into a larger, empty table."""
    for at in range(len(source.key)):
        if source.key[at] >= 0:
            remember(target, source.key[at], source.time[at], source.speed[at], source.count[at])


@jit
def _contact(fixed, motion, book, a, b, margin):
    """Write the contact of two balls, or of a ball and a plane, within the margin, as `manifold.pair_contacts` does."""
    geometry, now, rotation = fixed.geometry, motion.now, motion.rotation
    shape_a, shape_b = fixed.shape_of_body[a], fixed.shape_of_body[b]
    p, q = geometry.shape_first[shape_a], geometry.shape_first[shape_b]
    r, t = np.empty((3, 3)), np.empty(3)
    swapped = geometry.kind[q] > geometry.kind[p]
    i, j = (b, a) if swapped else (a, b)
    relative_pose(rotation[i], now.position[i], rotation[j], now.position[j], r, t)
    if fixed.kind[a] == PLANE or fixed.kind[b] == PLANE:
        ball, plane = (q, p) if swapped else (p, q)
        count = round_half_space_contacts(geometry, ball, plane, r, t, margin, book.walk, book.real, book.integer, _NONE)
    else:
        v, w = geometry.vertex_first[p], geometry.vertex_first[q]
        count = sphere_sphere_contact(
            row(geometry.vertex, v), geometry.radius[p], v, moved(r, t, row(geometry.vertex, w)), geometry.radius[q], w, margin,
            book.real, book.integer, _NONE,
        )  # fmt: skip
    if count == 1:
        _rows_to_world(book.real, book.integer, _NONE, count, rotation[i], now.position[i], swapped)
        book.integer[0, 0], book.integer[0, 1] = a, b
        fill_contacts(now, book.real, book.integer, np.zeros(1, np.int64), fixed.material, fixed.coefficients, book.contacts)
    return count == 1


@jit
def _slow(fixed, motion, contacts, delta):
    """A speed of approach [m/s] that is surely more than what would be held or counts as none."""
    a, b, n = contacts.body_a[0], contacts.body_b[0], contacts.normal[0]
    press = _point_acceleration(motion.acceleration, motion.angular_acceleration, a, contacts.arm_a[0], n)
    press -= _point_acceleration(motion.acceleration, motion.angular_acceleration, b, contacts.arm_b[0], n)
    if not (fixed.dynamic[a] and fixed.dynamic[b]):
        for i in (a, b):
            pull = fixed.steady[i]
            press = max(press, sqrt(pull[0] ** 2 + pull[1] ** 2 + pull[2] ** 2))
    scale = speed_scale(motion.now, contacts)
    press = max(press, 0.0) + _ROUND_OFF * scale * scale / min(fixed.radius[a], fixed.radius[b])
    return _CLEAR * sqrt(2.0 * press * delta) * (1.0 + SLOW) + _CLEAR * _APPROACH * scale


@jit
def _depart(fixed, motion, book, i, time):
    """Body i takes a free course at `time`; its frames before are written."""
    first = last = book.written[i]
    while last < len(book.times) and book.times[last] < time:
        last += 1
    if last > first:
        sample_path(
            motion.course, i, book.times, first, last, book.position, book.orientation, book.velocity, book.angular_velocity
        )
        book.written[i] = last
    none = np.zeros(3)
    take(motion.course, i, time, motion.now, fixed.steady[i], none, none, none, _FREE)


@jit
def _has_changed(now, i, before):
    """Whether the velocities of body i are others than before (6,), and numbers."""
    differs, finite = False, True
    for k in range(3):
        differs |= now.velocity[i, k] != before[k] or now.angular_velocity[i, k] != before[3 + k]
        finite &= isfinite(now.velocity[i, k]) and isfinite(now.angular_velocity[i, k])
    return differs and finite


@jit
def _members(fixed, book, a, b):
    """The movable ones of two bodies, in order of index."""
    count = 0
    for i in (min(a, b), max(a, b)):
        if fixed.dynamic[i]:
            book.members[count] = i
            count += 1
    return book.members[:count]


@jit
def _bounces(fixed, motion, book, rebounds, key, a, b, time, delta):
    """Bring both bodies to `time` and tell whether their contact is a simple impact."""
    course, now = motion.course, motion.now
    for i in (a, b):
        if fixed.dynamic[i] and course.mode[i] == FIXED:
            return False
        bring(course, i, time, now, motion.rotation, motion.acceleration, motion.angular_acceleration)
    last = place_of(rebounds, key)
    if rebounds.key[last] == key:
        since = time - rebounds.time[last]
        if rebounds.count[last] > 0 or since * rebounds.speed[last] < _CLEAR * delta or since <= _CLEAR * INSTANT * fixed.step:
            return False
    return _contact(fixed, motion, book, a, b, MARGIN * delta) and book.contacts.gap[0] >= -0.5 * DEEPEST * min(
        fixed.radius[a], fixed.radius[b]
    )


@jit
def simple_impact(fixed, motion, book, rebounds, a, b, time):
    """Let bodies a < b, which come to touch at `time` [s], rebound; returns False, with nothing changed, where that is not simple."""
    delta = fixed.contact_gap * min(fixed.size[a], fixed.size[b])
    key = a * len(fixed.kind) + b
    if not _bounces(fixed, motion, book, rebounds, key, a, b, time, delta):
        return False
    now, contacts, u = motion.now, book.contacts, np.empty(3)
    approach, slow = relative_velocity(now, contacts, _NONE, u), _slow(fixed, motion, contacts, delta)
    e = contacts.restitution[0]
    if not (-approach > slow and -e * approach > slow):
        return False
    members = _members(fixed, book, a, b)
    before = np.empty((2, 6))
    for m in range(len(members)):
        before[m, :3], before[m, 3:] = now.velocity[members[m]], now.angular_velocity[members[m]]
    energy = _kinetic(now.velocity, now.angular_velocity, now.orientation, fixed.mass, fixed.inertia, members)
    resolve_contact(now, contacts, _NONE, e, fixed.law, book.log, _NONE)
    if not book.log[0, 6] > slow:
        return False
    for m in range(len(members)):
        if not _has_changed(now, members[m], before[m]):
            return False
    at = book.count[0]
    write_impacts(time, contacts, now.position, book.log, _ONE, book.rows, at)
    book.energy[at] = _kinetic(now.velocity, now.angular_velocity, now.orientation, fixed.mass, fixed.inertia, members) - energy
    book.count[0] = at + 1
    remember(rebounds, key, time, book.log[0, 6], _NONE)
    for i in members:
        _depart(fixed, motion, book, i, time)
    return True
