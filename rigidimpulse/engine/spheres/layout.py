"""What the event kernel reads and writes, as tuples of arrays; n bodies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.engine.spheres.queue import Queue
from rigidimpulse.engine.spheres.tree import BoxTree
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.trajectory import Trajectories

BALL, PLANE, OTHER = (np.int64(kind) for kind in range(3))
"""Kinds of bodies: one sphere about its centre of mass, with equal moments of inertia; one half space that stands; anything else."""


class Fixed(NamedTuple):
    """What does not change in a run. (Few arrays: each costs every kernel that gets them time to compile.)"""

    dynamic: np.ndarray  # (n,) bool
    steady: np.ndarray  # (n, 3) m/s2, of gravity and constant forces
    mass: np.ndarray  # (n,) kg
    inertia: np.ndarray  # (n, 3) kg m2, principal
    material: np.ndarray  # (n,)
    coefficients: np.ndarray  # (k, k, 4) of two materials
    apart: np.ndarray  # (p,) keys a n + b of pairs that do not touch each other, ascending
    static_min: np.ndarray  # (n, 3) m, boxes of bodies that stand
    static_max: np.ndarray
    law: int  # of restitution
    step: float  # s, between boundaries


class Motion(NamedTuple):
    """Paths, and bodies at the instant being worked on."""

    trajectory: Trajectories
    now: BodyState
    rotation: np.ndarray  # (n, 3, 3)


class Table(NamedTuple):
    """Events to come. Entry i < n: body i meets a plane; from n on: pairs, which both bodies have in a list of their own."""

    queue: Queue
    tree: BoxTree
    paths: np.ndarray  # (n, PATH_SIZE), planes (q, PLANE_SIZE), see `paths`
    planes: np.ndarray
    low: np.ndarray  # (n, 3) m, boxes of the paths to the end of the interval
    high: np.ndarray
    first: np.ndarray  # (k,) bodies of the entries, first < second for pairs
    second: np.ndarray
    plane: np.ndarray  # (n,) number of the plane that each body meets first
    leaves: np.ndarray  # (k,) int8: CONTACT, or where the loop in Python takes over: AT_BOUNDARY, AT_ONCE
    after: np.ndarray  # (2 k,) next entry in the list of the first and of the second body, times 2, plus 1 where it is its second; -1: none
    head: np.ndarray  # (n,) where the list of each body starts
    mark: np.ndarray  # (n,) last search that found the body
    found: np.ndarray  # (n,) scratch of searches
    waiting: np.ndarray  # (2 k,) entries to be timed
    count: np.ndarray  # (3,) entries in use, searches made, entries that wait


CONTACT, AT_BOUNDARY, AT_ONCE = (np.int8(kind) for kind in range(3))


class SphereRecord(NamedTuple):
    """What is kept of the run: frames (f, n, ...), impacts; and buffers of one contact."""

    times: np.ndarray  # (f,) s
    written: np.ndarray  # (n,) frames written of each body
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    rows: np.ndarray  # (r, ROW_LENGTH) impacts, see `recording.events`
    energy: np.ndarray  # (r,) J, change of kinetic energy of each impact
    count: np.ndarray  # (1,) impacts written
    contacts: Contacts  # of one contact
    log: np.ndarray  # (1, 7)
    members: np.ndarray  # (2,)
