"""What varies in a run: trajectories, the state at the instant being worked on, and the memory of contacts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.model.contact_memory import grown, has_capacity, make_memory
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.trajectory import Trajectories, make_trajectories

GAIN = TOLERANCES.contact_forces.energy_gain


class EnergyLimiter(NamedTuple):
    """What is known of n bodies under contact forces, to see whether these make energy."""

    under_contact: np.ndarray
    """(n,) bool, bodies whose trajectory carries contact forces"""
    sharing: np.ndarray
    """(n,) first body of the island whose forces bodies under contact share"""
    closed: np.ndarray
    """(n,) bool, whether those make no energy"""
    ground_velocity: np.ndarray
    """(n, 3) m/s, by that first body: velocity of all that stands by the island, seen from where it does no work"""
    ground_rank: np.ndarray
    """(n,) in how many independent directions what stands may push"""
    ground_axis: np.ndarray
    """(n, 3) that direction where there is one, the one across them where there are two"""
    energy_at_start: np.ndarray
    """(n,) J, when the trajectory began"""
    end_energy: np.ndarray
    """(n,) J, when it ended; nan where the work of its contact forces is not to be accounted for"""
    correction: np.ndarray
    """(n, 6) change of velocity and spin that a body got at the end of its sub-step"""
    gain: float
    """part of their kinetic energy that bodies may gain by rounding"""


def make_energy_limiter(num_bodies: int) -> EnergyLimiter:
    """For bodies that nothing presses yet."""
    n = num_bodies
    return EnergyLimiter(
        under_contact=np.zeros(n, bool),
        sharing=np.zeros(n, np.int64),
        closed=np.zeros(n, bool),
        ground_velocity=np.zeros((n, 3)),
        ground_rank=np.zeros(n, np.int64),
        ground_axis=np.zeros((n, 3)),
        energy_at_start=np.zeros(n),
        end_energy=np.full(n, np.nan),
        correction=np.zeros((n, 6)),
        gain=GAIN,
    )


class State:
    """The varying arrays of a run.

    Attributes:
        time: s, every body's trajectory is known from here on.
        trajectory: path of every body since something last acted on it.
        now: velocities and poses at the instant being worked on, valid for bodies with `stamp[i] == time` of that instant.
        limiter: of bodies under contact forces, what shows whether these make energy. under_contact, sharing, correction: its arrays.
        memory: rebounds of pairs, and the forces of held contacts (`contact_memory`).
        by_joints: (n,) bool, bodies whose present trajectory is one of an island that joints alone hold together.
        sub_step: (n,) s, length of the last one of an island whose contacts turn, at its first body.
    """

    def __init__(self, world: World, time: float) -> None:
        n = world.num_bodies
        self.time = time
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
        self.memory = make_memory(n)
        self.by_joints = np.zeros(n, bool)
        self.sub_step = np.full(n, np.inf)
        self.limiter = make_energy_limiter(n)
        self.under_contact, self.sharing, self.correction = self.limiter.under_contact, self.limiter.sharing, self.limiter.correction

    def remember(self, contacts: int) -> None:
        """Make space for `contacts` more in the memory."""
        if not has_capacity(self.memory, contacts):
            self.memory = grown(self.memory, contacts)
