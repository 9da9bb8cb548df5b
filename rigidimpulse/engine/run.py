"""A run under way: the world, its state, the plan, what records it, and the participants that the scene calls for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.collision.contact_buffer import ContactBuffer
from rigidimpulse.collision.geometry import Geometry
from rigidimpulse.collision.time_of_impact.safe_step import SweepScratch, make_scratch
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.dynamics.solvers.qp import row_solver
from rigidimpulse.engine.absent import (
    NoCompiledLoop,
    NoFlight,
    NoForces,
    NoJoints,
    NoKeyframes,
    NoSoftBodies,
    NoSubstepping,
    NoTriggers,
)
from rigidimpulse.engine.exact.step_size import ErrorEstimate, make_error_estimate
from rigidimpulse.engine.finder import Finder
from rigidimpulse.engine.narrow_phase import OwnContacts
from rigidimpulse.engine.participants import (
    Compiled,
    Flight,
    Keyframed,
    NarrowPhase,
    Observer,
    RunForces,
    RunJoints,
    RunSoftBodies,
    Substepping,
)
from rigidimpulse.engine.touching import Motion
from rigidimpulse.model.plan import Plan
from rigidimpulse.model.state import State
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import FIXED, FREE, PRESCRIBED, begin, pose_at
from rigidimpulse.recording.contact_log import ContactLog
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.impulses import ImpulseAccounts
from rigidimpulse.recording.recorder import Recorder

LOG_CAPACITY = 4096
NOT_FINITE_REMEDY = "the body's velocity was no finite number; it is frozen: check its mass, inertia and restitution"


@dataclass(frozen=True)
class Detector:
    """What a search for the time of impact needs to know of the scene."""

    geometry: Geometry
    shape_of_body: np.ndarray
    sweep_scratch: SweepScratch
    max_queries: int


class Run:
    """Everything a step needs: world, state, plan, recorder, logs, participants, and buffers that grow when they are too small.

    Attributes:
        joints, forces, substepped, soft_bodies, triggers: participants; what the scene does not call for is one of `absent.py`.
        narrow_phase: who finds contacts and gaps.
        keyframes: paths of kinematic bodies. flight: the kernel of balls. compiled: the compiled order of events.
        solve_rows: the solver of contacts and joints, None for `newton.solve_newton`.

    """

    def __init__(self, world: World, plan: Plan, recorder: Recorder, log: EventLog) -> None:
        """A run at its start, the time of its first frame, without participants."""
        n = world.num_bodies
        self.world = world
        self.plan = plan
        self.state = State(world, float(recorder.times[0]))
        self.recorder = recorder
        self.log = log
        self.impulses = ImpulseAccounts(recorder.times)
        self.contact_log = ContactLog(recorder.times, n, self.impulses)
        self.detector = Detector(world.geometry, world.shape_of_body, make_scratch(world.geometry), world.accuracy.iterations)
        self.finder = Finder(n)
        self.narrow_phase: NarrowPhase = OwnContacts()
        self.contact_buffer = ContactBuffer()
        self.impact_log = np.empty((LOG_CAPACITY, 7))
        self.column = np.zeros(n, np.int64)
        self.acceleration = np.zeros((n, 3))
        self.angular_acceleration = np.zeros((n, 3))
        self.wrench, self.wrench_rate = np.zeros((2, n, 6))
        self.motion = Motion(self.state.trajectory, self.state.now, self.state.rotation, self.acceleration, self.angular_acceleration)
        self.box_min = np.empty((n, 3))
        self.box_max = np.empty((n, 3))
        self.solve_rows = row_solver(world.accuracy.contact_solver)
        self.error_estimate: ErrorEstimate = make_error_estimate(world, self.state.rotation)
        self.joints: RunJoints = NoJoints(world, recorder.times)
        self.forces: RunForces = NoForces(n)
        self.soft_bodies: RunSoftBodies = NoSoftBodies(n)
        self.substepped: Substepping = NoSubstepping(n)
        self.triggers: Observer = NoTriggers()
        self.keyframes: Keyframed = NoKeyframes()
        self.flight: Flight = NoFlight()
        self.compiled: Compiled = NoCompiledLoop()

    def pose_matrix(self, i: int, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) and rotation matrix (3, 3) of body i at `time` on its present trajectory."""
        x, q = np.empty(3), np.empty(4)
        pose_at(self.state.trajectory, i, time, x, q)
        return x, to_matrix(q)

    def keep(self, count: int) -> None:
        """Leave the first `count` frames only: the run ends before its time."""
        for part in (self.recorder, self.impulses, self.contact_log, self.joints.log, self.forces.log, self.soft_bodies):
            part.keep(count)

    def quarantine(self, i: int, time: float) -> None:
        """Freeze a body whose state stopped being finite where its trajectory last was, and report it."""
        now, trajectory = self.state.now, self.state.trajectory
        pose_at(trajectory, i, time, now.position[i], now.orientation[i])
        now.velocity[i] = now.angular_velocity[i] = 0.0
        self.log.report(
            time, "not finite", (self.world.names[i],),
            NOT_FINITE_REMEDY,
        )


def start_trajectories(run: Run) -> None:
    """Give every body its first trajectory."""
    start_bodies(run, np.arange(run.world.num_bodies))


def start_bodies(run: Run, bodies: np.ndarray) -> None:
    """Give bodies (k,) their first trajectories, from the time of the run on."""
    world, trajectory = run.world, run.state.trajectory
    trajectory.start[bodies] = run.state.time
    trajectory.position[bodies], trajectory.orientation[bodies] = world.position[bodies], world.orientation[bodies]
    trajectory.velocity[bodies], trajectory.angular_velocity[bodies] = world.velocity[bodies], world.angular_velocity[bodies]
    dynamic, moving = world.dynamic[bodies], world.moving[bodies]
    trajectory.acceleration[bodies] = np.where(dynamic[:, None], world.steady_acceleration[bodies], 0.0)
    trajectory.inertia[bodies] = world.inertia[bodies]
    trajectory.mode[bodies] = np.where(dynamic, FREE, np.where(moving, PRESCRIBED, FIXED))
    for i in bodies.tolist():
        begin(trajectory, i)
