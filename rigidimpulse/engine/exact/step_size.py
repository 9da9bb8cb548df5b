"""What constant contact forces do to gaps over a sub-step, and how long it may be.

Forces are found such that the loaded contacts have no acceleration at the start, a(0) = 0. At the end of a sub-step of
length h the same forces leave a(h), and a gap that is off by

    error = integral of (h - s) a(s) ds = a(h) h^2 / 6,    a(s) = a(h) s / h.

a(h) is taken at the state at the end of the very trajectories, with the places of contact moved on by their velocities. The
sub-step is so long that the error is a part of the contact margin, h (allowed / error)^(1/3), and what is left of it is closed by the
forces (`dynamics/constraints/contact.py`).
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.constraints.contact_motion import Motion, contact_motion
from rigidimpulse.engine.run import Run
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.model.island import Island
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import bring_all
from rigidimpulse.motion.trajectory import FORCED, begin, make_trajectories

ALLOWED = 0.1
"""Part of the contact margin by which a gap may be off at the end of a sub-step."""


class ErrorEstimate:
    """The state of some bodies at the end of a sub-step, each in a row of its own."""

    def __init__(self, world: World) -> None:
        """With a capacity of 0 bodies."""
        self._world = world
        self._grow(0)

    def _grow(self, k: int) -> None:
        """Make arrays with a capacity of k bodies."""
        self.trajectory = make_trajectories(k)
        self.bodies = BodyState(
            np.empty((k, 3)), np.empty((k, 4)), np.empty((k, 3)), np.empty((k, 3)), np.empty(k), np.zeros((k, 3, 3))
        )
        self.rotation = np.empty((k, 3, 3))
        self.acceleration = np.empty((k, 3))
        self.angular_acceleration = np.empty((k, 3))

    def gap_errors(self, run: Run, island: Island, contacts: Contacts, subset: np.ndarray, motion: Motion, h: float) -> np.ndarray:
        """Errors (m,) of the gaps of the held contacts after h [m].

        motion: what `contact_motion` said of them; `run.wrench` holds their forces.
        """
        world, wrench = self._world, run.wrench
        touched = np.unique(np.concatenate([island.members, contacts.body_a, contacts.body_b]))
        if len(touched) > len(self.rotation):
            self._grow(2 * len(touched))
        self._take_over(run, touched)
        members, a, b = (np.searchsorted(touched, bodies) for bodies in (island.members, contacts.body_a, contacts.body_b))
        self._bring(members, run.acceleration[island.members], wrench[island.members], h)
        normal = contacts.normal + h * motion.normal_rate
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        ahead = contacts._replace(
            body_a=a, body_b=b, arm_a=contacts.arm_a + h * motion.arm_rate_a, arm_b=contacts.arm_b + h * motion.arm_rate_b, normal=normal
        )
        turning = contact_motion(
            world.geometry, world.shape_of_body[touched], self.rotation, self.bodies, ahead, island.kinds[subset], island.features[subset]
        ).turning
        point_a = self.acceleration[a] + cross_arrays(self.angular_acceleration[a], ahead.arm_a)
        point_b = self.acceleration[b] + cross_arrays(self.angular_acceleration[b], ahead.arm_b)
        return np.einsum("ij,ij->i", point_b - point_a + turning, normal) * (h * h / 6.0)

    def _take_over(self, run: Run, touched: np.ndarray) -> None:
        """Rows of bodies as they are now; the velocities of those that are no members are constant."""
        k, now, world = len(touched), run.state.now, self._world
        for ours, theirs in zip(self.bodies[:4], now[:4], strict=True):
            ours[:k] = theirs[touched]
        self.bodies.inv_mass[:k] = world.inv_mass[touched]
        self.rotation[:k] = run.state.rotation[touched]
        self.acceleration[:k] = self.angular_acceleration[:k] = 0.0
        self.trajectory.inertia[:k] = world.inertia[touched]

    def _bring(self, members: np.ndarray, acceleration: np.ndarray, wrench: np.ndarray, h: float) -> None:
        """The members (m,) rows after h under constant wrenches (m, 6) and accelerations (m, 3)."""
        trajectory, now, i = self.trajectory, self.bodies, members
        trajectory.position[i], trajectory.orientation[i] = now.position[i], now.orientation[i]
        trajectory.velocity[i], trajectory.angular_velocity[i] = now.velocity[i], now.angular_velocity[i]
        trajectory.acceleration[i] = acceleration + now.inv_mass[i, None] * wrench[:, :3]
        trajectory.torque[i] = wrench[:, 3:]
        trajectory.mode[i] = FORCED
        for member in i.tolist():
            begin(trajectory, member)
        bring_all(trajectory, i, h, now, self.rotation, self.acceleration, self.angular_acceleration)
