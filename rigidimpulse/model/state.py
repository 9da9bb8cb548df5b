"""What varies in a run: trajectories, the state at the instant being worked on, and the memory of contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.model.island import NO_FORCE
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.trajectory import Trajectories, make_trajectories


@dataclass(frozen=True)
class PairForce:
    """Contact forces between two bodies over a sub-step.

    Attributes:
        start: s, when it began.
        on_a, on_b: (6,) force [N] and torque about the centre of mass [N m].
        force: (3,) N of each contact in its frame, by its key.
        slides: keys of the contacts that slipped at the start.

    """

    start: float
    on_a: np.ndarray
    on_b: np.ndarray
    force: dict[tuple[int, ...], np.ndarray]
    slides: frozenset[tuple[int, ...]]


@dataclass(frozen=True)
class Ground:
    """What stands by an island.

    Attributes:
        velocity: (3,) m/s of all that stands, seen from where it does no work.
        pushes: (k, 3) directions along which it may push.

    """

    velocity: np.ndarray
    pushes: np.ndarray


class State:
    """The varying arrays of a run.

    Attributes:
        time: s, every body's trajectory is known from here on.
        trajectory: path of every body since something last acted on it.
        now: velocities and poses at the instant being worked on, valid for bodies with `stamp[i] == time` of that instant.
        energy_at_start, end_energy: J, of bodies under contact forces, when their trajectory began and when it ended.
        under_contact: (n,) bool, bodies whose trajectory carries contact forces.
        sharing: (n,) first body of the island whose forces bodies under contact share. closed: (n,) bool, whether those make no
            energy. ground: by that first body, what stands by the island.
        rebounds: by pair, time and speed of the last rebound and how many in a row were short.
        contact_force: last force of a held contact, in its frame [N], and when it began, by its key (`islands.contact_key`).
        sub_step: (n,) s, length of the last one of an island whose contacts turn, at its first body.
        correction: (n, 6) change of velocity and spin that a body got at the end of its sub-step.
        pair_force: what acts in the present sub-step between bodies whose contacts turn (`PairForce`).
    """

    def __init__(self, world: World) -> None:
        n = world.num_bodies
        self.time = 0.0
        self.trajectory: Trajectories = make_trajectories(n)
        self.now = BodyState(
            position=world.position.copy(),
            orientation=world.orientation.copy(),
            velocity=world.velocity.copy(),
            angular_velocity=world.angular_velocity.copy(),
            inv_mass=world.inv_mass,
            inv_inertia=np.zeros((n, 3, 3)),
        )
        self.rotation = np.zeros((n, 3, 3))
        self.contact_force: dict[tuple[int, ...], tuple[np.ndarray, float]] = {}
        self.sub_step = np.full(n, np.inf)
        self.correction = np.zeros((n, 6))
        self.pair_force: dict[tuple[int, int], PairForce] = {}
        self.under_contact = np.zeros(n, bool)
        self.rebounds: dict[tuple[int, int], tuple[float, float, int]] = {}
        self.energy_at_start = np.zeros(n)
        self.sharing = np.zeros(n, np.int64)
        self.closed = np.zeros(n, bool)
        self.ground: dict[int, Ground] = {}
        self.end_energy: dict[int, float] = {}

    def force_of(self, key: tuple[int, ...]) -> np.ndarray:
        """Force (3,) N that a contact carries until now, in its frame; zeros if its bodies have parted since."""
        force, time = self.contact_force.get(key, (NO_FORCE, -np.inf))
        return force if time >= max(self.trajectory.start[key[0]], self.trajectory.start[key[1]]) else NO_FORCE
