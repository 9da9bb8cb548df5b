r"""Momentum of sets of bodies that nothing outside acts on.

Bodies that gave each other impulses in the run, by impacts, lasting contacts or joints, are one set. A set is free if all of its bodies are
dynamic from the start, none met a body that is not or the world, and no force that varies acts on one. Then, with steady forces m a,

    P(t) = sum of m v - t sum of m a
    L(t) = sum of (x - X) x m (v - V) + I w,    X, V: of the centre of mass

are constant; L where all bodies have the same a. They are compared with what moves,

    |P(t) - P(0)| <= MOMENTUM (max over t of sum |m v| + m u, + t |sum m a|)
    |L(t) - L(0)| <= ANGULAR max over t of sum |x - X| |m (v - V)| + |I w| + m u s

with the size s of a body, and the speed u up to which it stands still (`RunRecord.unseen_speed`): where nothing moves, or a body flies
alone without spin, all else is round-off.

Contacts of sub-stepped islands are in no table: where there were any, all bodies without joints count as one set, with all that are not
dynamic, so only bodies with joints are looked at. Kinematic impacts (`response="kinematic"`) do not keep momentum by design.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.core.quaternion import rotate, rotate_inverse
from rigidimpulse.core.union_find import roots
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.engine.measure.record import Fault, RunRecord

KIND = "momentum not kept"
MOMENTUM: float = 1e-7
"""Drift of the momentum of a free set of bodies, of what moves, from which a run is not ok."""
ANGULAR: float = 1e-5
"""The same of its angular momentum: forces of joints and contacts turn with the bodies from frame to frame."""
MOST_FRAMES: int = 240
"""Frames that are looked at, at most, evenly chosen."""
MOST_NAMES: int = 3
"""Bodies that a message names at most."""
REMEDY_OF_JOINTS = "give joints limits, so that motors do not press bodies of a chain on each other"
"""Tried on a free chain of four boxes whose motors fold it: L changes by 5.6e-4 of what moves, by 1.4e-7 with limits of 1 rad."""
REMEDY = "use a smaller step"
"""Tried on free bodies that tumble and stay in touch: L changes by 1.3e-5 at 1/60 s, by 1.9e-7 at 1/240 s; and on a chain of eleven bodies
that is thrown, at "preview": by 2.4e-5 at 1/60 s, by 4.9e-6 at 1/120 s. It does not help where two bodies meet hundreds of times: a
position correction moves them by a contact margin each time."""


@dataclass(frozen=True, eq=False)
class Drifts:
    """Of k free sets of bodies, over what moves."""

    members: list[np.ndarray]
    momentum: np.ndarray  # (f, k) of the frames that are looked at
    angular: np.ndarray  # (f, k), 0 where the bodies of the set are pulled differently


def free_sets(record: RunRecord) -> np.ndarray:
    """Number (n,) of the set of each body, that of its lowest body; -1 of bodies that something outside acts on, see the head."""
    world = record.world
    n = world.num_bodies
    free = world.dynamic & (record.release == 0.0) & ~record.forced
    a, b = record.touched[:, 0], record.touched[:, 1]
    inside = (a >= 0) & (b >= 0)
    free[np.maximum(a, b)[~inside]] = False
    root = roots(n, a[inside], b[inside])
    if record.may_be_sub_stepped:
        free &= record.jointed
    if world.accuracy.response == "kinematic":
        free[record.touched[inside].ravel()] = False
    held = np.zeros(n, bool)
    held[root[~free]] = True
    return np.where(held[root], -1, root)


def momentum_faults(record: RunRecord) -> list[Fault]:
    """A fault for each free set whose momentum or angular momentum was not kept, with the first time at which it was not."""
    faults, names, drifts = [], record.world.names, momentum_drifts(record)
    times = record.frames.times[_looked_at(record)]
    for k, members in enumerate(drifts.members):
        found = ("momentum", drifts.momentum[:, k], MOMENTUM), ("angular momentum", drifts.angular[:, k], ANGULAR)
        for what, drift, bound in found:
            if np.any(drift > bound):
                time = float(times[int(np.argmax(drift > bound))])
                more = f" and {len(members) - MOST_NAMES} more" if len(members) > MOST_NAMES else ""
                text = f"the {what} of these bodies{more} changed by {drift.max():.2g} of what moves, though nothing else acts on them"
                bodies = tuple(names[i] for i in members[:MOST_NAMES].tolist())
                remedy = REMEDY_OF_JOINTS if _are_driven(record, members) else REMEDY
                faults.append(Fault(time, KIND, bodies, float(drift.max()), f"{text}; {remedy}"))
                break
    return faults


def _are_driven(record: RunRecord, members: np.ndarray) -> bool:
    """Whether a motor or a spring acts at one of the members (k,)."""
    if not record.jointed[members].any():
        return False
    joints = record.world.joints
    mine = np.isin(joints.body_a, members) | np.isin(joints.body_b, members)
    return bool(np.any(np.isfinite(joints.stiffness[np.repeat(mine, np.diff(joints.first))])))


def momentum_drifts(record: RunRecord) -> Drifts:
    """Drifts of all free sets."""
    number = free_sets(record)
    order = np.argsort(number, kind="stable")
    order = order[np.count_nonzero(number < 0) :]
    looked_at = _looked_at(record)
    since = record.frames.times[looked_at, None] - record.frames.times[0]
    if not len(order):
        return Drifts([], np.zeros((len(since), 0)), np.zeros((len(since), 0)))
    first = np.flatnonzero(np.diff(number[order], prepend=-1))
    x, q, v, w = (part[np.ix_(looked_at, order)] for part in record.frames[1:])
    world = record.world
    mass, inertia, pull = world.mass[order], world.inertia[order], world.steady_acceleration[order]
    momenta = mass[:, None] * v
    steady = np.add.reduceat(mass[:, None] * pull, first)
    total = np.add.reduceat(momenta, first, axis=1)
    still = mass * record.unseen_speed[order]
    moves = np.add.reduceat(np.linalg.norm(momenta, axis=2), first, axis=1).max(axis=0) + since * np.linalg.norm(steady, axis=1)
    moves += np.add.reduceat(still, first)
    momentum = np.linalg.norm(total - total[:1] - since[:, :, None] * steady, axis=2)
    whole = np.add.reduceat(mass, first)
    count = np.diff(np.append(first, len(order)))
    centre = np.add.reduceat(mass[:, None] * x, first, axis=1) / whole[:, None]
    arm = x - np.repeat(centre, count, axis=1)
    relative = mass[:, None] * (v - np.repeat(total / whole[:, None], count, axis=1))
    spin = rotate(q, inertia * rotate_inverse(q, w))
    sums = np.add.reduceat(spin + cross_arrays(arm, relative), first, axis=1)
    parts = np.linalg.norm(spin, axis=2) + np.linalg.norm(arm, axis=2) * np.linalg.norm(relative, axis=2)
    turns = np.add.reduceat(parts, first, axis=1).max(axis=0) + np.add.reduceat(still * world.size[order], first)
    alike = ~np.logical_or.reduceat(np.any(pull != np.repeat(pull[first], count, axis=0), axis=1), first)
    angular = np.where(alike, np.linalg.norm(sums - sums[:1], axis=2), 0.0)
    return Drifts(np.split(order, first[1:]), _share(momentum, moves), _share(angular, turns))


def _looked_at(record: RunRecord) -> np.ndarray:
    """The frames that are looked at."""
    number = len(record.frames.times)
    return np.unique(np.linspace(0, number - 1, min(number, MOST_FRAMES)).astype(int))


def _share(drift: np.ndarray, moves: np.ndarray | float) -> np.ndarray:
    """Drift (f,) over what moves; 0 where nothing does."""
    moves = np.broadcast_to(moves, drift.shape)
    return np.divide(drift, moves, out=np.zeros_like(drift), where=moves > 0.0)
