"""What constant contact forces do to gaps over a sub-step, and how long it may be.

Forces are found such that the loaded contacts have no acceleration at the start, a(0) = 0. At the end of a sub-step of
length h the same forces leave a(h), and a gap that is off by

    error = integral of (h - s) a(s) ds = a(h) h^2 / 6,    a(s) = a(h) s / h.

a(h) is taken at the state at the end of the very courses, with the places of contact moved on by their velocities. The
sub-step is so long that the error is a part of delta, h (allowed / error)^(1/3), and what is left of it is closed by the
forces (`resting`).
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.constrain.contact_motion import contact_motion
from rigidimpulse.detect.touching import bring_all
from rigidimpulse.integrate.course import FORCED, begin, make_course
from rigidimpulse.respond.impulse import BodyState, Contacts
from rigidimpulse.rotation import cross

ALLOWED = 0.1
"""Part of delta by which a gap may be off at the end of a sub-step."""


class Foresight:
    """Room for the state of the bodies at the end of a sub-step."""

    def __init__(self, world) -> None:
        """As many bodies as the world has."""
        n = world.num_bodies
        self.course = make_course(n)
        self.course.inertia[:] = world.inertia
        self.bodies = BodyState(
            np.empty((n, 3)), np.empty((n, 4)), np.empty((n, 3)), np.empty((n, 3)), world.inv_mass, np.zeros((n, 3, 3))
        )
        self.rotation = np.empty((n, 3, 3))
        self.acceleration = np.empty((n, 3))
        self.angular_acceleration = np.empty((n, 3))

    def gap_errors(self, context, group, contacts: Contacts, subset: np.ndarray, motion, wrench, h: float) -> np.ndarray:
        """Errors (m,) of the gaps of the held contacts after h [m].

        motion: what `contact_motion` said of them; wrench (n, 6): of their forces.
        """
        world, state, now = context.world, context.state, context.state.now
        beside = np.zeros(world.num_bodies, bool)
        beside[contacts.body_a] = beside[contacts.body_b] = True
        beside[group.members] = False
        for i in beside.nonzero()[0].tolist():
            self._copy(state, i)
        self._bring(now, group.members, context.acceleration, wrench, h)
        normal = contacts.normal + h * motion.normal_rate
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        ahead = contacts._replace(
            arm_a=contacts.arm_a + h * motion.arm_rate_a, arm_b=contacts.arm_b + h * motion.arm_rate_b, normal=normal
        )
        turning = contact_motion(
            world.geometry, world.shape_of_body, self.rotation, self.bodies, ahead, group.kinds[subset],
            group.features[subset],
        ).turning
        a, b = contacts.body_a, contacts.body_b
        point_a = self.acceleration[a] + cross(self.angular_acceleration[a], ahead.arm_a)
        point_b = self.acceleration[b] + cross(self.angular_acceleration[b], ahead.arm_b)
        return np.einsum("ij,ij->i", point_b - point_a + turning, normal) * (h * h / 6.0)

    def _bring(self, now: BodyState, members: np.ndarray, acceleration: np.ndarray, wrench: np.ndarray, h: float) -> None:
        """The members after h under constant wrenches (n, 6) and accelerations (n, 3)."""
        course, i = self.course, members
        course.position[i], course.orientation[i] = now.position[i], now.orientation[i]
        course.velocity[i], course.angular_velocity[i] = now.velocity[i], now.angular_velocity[i]
        course.acceleration[i] = acceleration[i] + now.inv_mass[i, None] * wrench[i, :3]
        course.torque[i] = wrench[i, 3:]
        course.mode[i] = FORCED
        for member in members.tolist():
            begin(course, member)
        bring_all(course, i, h, self.bodies, self.rotation, self.acceleration, self.angular_acceleration)

    def _copy(self, state, i: int) -> None:
        """Body i as it is now: its velocity is constant."""
        for ours, theirs in zip(self.bodies[:4], state.now[:4], strict=True):
            ours[i] = theirs[i]
        self.rotation[i] = state.rotation[i]
        self.acceleration[i] = self.angular_acceleration[i] = 0.0
