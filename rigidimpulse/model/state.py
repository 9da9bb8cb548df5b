"""What varies: courses, the state at the instant being worked on, contact memory; and the scratch arrays of a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.collision.contact_buffer import ContactBuffer
from rigidimpulse.collision.geometry import Geometry
from rigidimpulse.collision.time_of_impact.safe_step import SweepScratch, make_scratch
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.dynamics.constraints.energy_limit import Ground, note_end_energy
from rigidimpulse.dynamics.constraints.rattle import PairForce
from rigidimpulse.dynamics.solvers.qp import row_solver
from rigidimpulse.engine.exact.joints import JointState
from rigidimpulse.engine.exact.step_size import ErrorEstimate
from rigidimpulse.engine.islands import NO_FORCE
from rigidimpulse.engine.regime import why_not_substepped
from rigidimpulse.engine.substepped.advance import SubsteppedIslands
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import bring_all
from rigidimpulse.motion.trajectory import Trajectories, make_trajectories, pose_at
from rigidimpulse.recording.contact_log import ContactLog
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.impulses import ImpulseAccounts
from rigidimpulse.recording.recorder import Recorder

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.varying import VaryingForces
    from rigidimpulse.dynamics.soft_body.in_run import RunningSoftBodies
    from rigidimpulse.engine.triggers import Triggers

LOG_CAPACITY = 4096


class State:
    """The varying arrays of a run.

    Attributes:
        time: s, every body's course is known from here on.
        course: path of every body since its last change of course.
        now: velocities and poses at the instant being worked on, valid for bodies with `stamp[i] == time` of that instant.
        energy_at_start, end_energy: J, of bodies under contact forces, when their course began and when it was looked at.
        under_contact: (n,) bool, bodies whose course carries contact forces.
        sharing: (n,) first body of the group whose forces bodies under contact share. closed: (n,) bool, whether those make no
            energy. ground: by that first body, what stands by the group.
        rebounds: by pair, time and speed of the last rebound and how many in a row were short.
        contact_force: last force of a held contact, in its frame [N], and when it began, by its key (`groups.contact_key`).
        sub_step: (n,) s, length of the last one of a group of contacts that turn, at its first body.
        correction: (n, 6) change of velocity and spin that a body got at the end of its sub-step.
        pair_force: what acts in the present sub-step between bodies whose contacts turn (`arrival`).
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


@dataclass(frozen=True)
class Detector:
    """What a sweep needs to know of the scene."""

    geometry: Geometry
    shape_of_body: np.ndarray
    sweep_scratch: SweepScratch
    max_queries: int


class StepContext:
    """Everything a step needs: world, state, recorder, logs, and buffers that grow when they are too small."""

    def __init__(self, world: World, recorder: Recorder, log: EventLog) -> None:
        n = world.num_bodies
        self.world = world
        self.state = State(world)
        self.recorder = recorder
        self.log = log
        self.impulses = ImpulseAccounts(recorder.times)
        self.contact_log = ContactLog(recorder.times, self.impulses)
        self.detector = Detector(world.geometry, world.shape_of_body, make_scratch(world.geometry), world.accuracy.iterations)
        self.contact_buffer = ContactBuffer()
        self.impact_log = np.empty((LOG_CAPACITY, 7))
        self.column = np.zeros(n, np.int64)
        self.acceleration = np.zeros((n, 3))
        self.angular_acceleration = np.zeros((n, 3))
        self.wrench = np.zeros((n, 6))
        self.box_min = np.empty((n, 3))
        self.box_max = np.empty((n, 3))
        self.error_estimate = ErrorEstimate(world)
        self.solve_rows = row_solver(world.accuracy.contact_solver)
        self.joints = JointState(world) if world.joints_of_scene else None
        self.forces: VaryingForces | None = None
        self.soft_bodies: RunningSoftBodies | None = None
        self.triggers: Triggers | None = None
        self.substepped = None if why_not_substepped(world) else SubsteppedIslands(world)

    def bring(self, i: int, time: float) -> None:
        """Bring body i to `time` on its course."""
        state = self.state
        bring_all(state.trajectory, np.array([i]), time, state.now, state.rotation, self.acceleration, self.angular_acceleration)
        note_end_energy(self, [i])

    def pose_matrix(self, i: int, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) and rotation matrix (3, 3) of body i at `time` on its present course."""
        x, q = np.empty(3), np.empty(4)
        pose_at(self.state.trajectory, i, time, x, q)
        return x, to_matrix(q)

    def quarantine(self, i: int, time: float) -> None:
        """Freeze a body whose state stopped being finite where its course last was, and report it."""
        now, trajectory = self.state.now, self.state.trajectory
        pose_at(trajectory, i, time, now.position[i], now.orientation[i])
        now.velocity[i] = now.angular_velocity[i] = 0.0
        self.log.report(
            time, "not finite", (self.world.names[i],),
            "the body's velocity was no finite number; it is frozen: check its mass, inertia and restitution",
        )
