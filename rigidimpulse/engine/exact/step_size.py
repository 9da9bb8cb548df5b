"""What constant contact forces do to gaps over a sub-step, and how long it may be.

Forces are found such that the loaded contacts have no acceleration at the start, a(0) = 0. At the end of a sub-step of
length h the same forces leave a(h), and a gap that is off by

    error = integral of (h - s) a(s) ds = a(h) h^2 / 6,    a(s) = a(h) s / h.

a(h) is taken at the state at the end of the very trajectories, with the places of contact moved on by their velocities. The
sub-step is so long that the error is a part of the contact margin, h (allowed / error)^(1/3), and what is left of it is closed by the
forces (`dynamics/constraints/contact.py`). A sub-step is also no longer than GROWTH times the one before. How short it may be is not a
question of cost: a heavy body that presses a tilted light disc flat has forces of a million newton for a few microseconds, and they
threw it back up where they lasted ten times longer than they should.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.geometry import Geometry
from rigidimpulse.core.kernels import jit, jit_making_arrays, jit_with_callbacks
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import cross, dot, length
from rigidimpulse.dynamics.constraints.contact import SubStep, hold_contacts
from rigidimpulse.dynamics.constraints.contact_motion import Motion, contact_motion
from rigidimpulse.model.contacts import Contacts, Touching
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import bring_all
from rigidimpulse.motion.trajectory import FORCED, Trajectories, begin, make_trajectories

ALLOWED = 0.1
"""Part of the contact margin by which a gap may be off at the end of a sub-step."""
TURN = 0.01
"""rad, how far arms and normals of contacts may turn in a sub-step."""
MOST_SUB_STEPS = 256.0
"""Sub-steps in a step that turning contacts ask for at most; what their error asks for may be shorter."""
TURN_OF_BODY = 0.1
"""rad, how far bodies may turn in a sub-step where that matters to gaps."""
GROWTH = 1.5
"""How many times longer than the one before a sub-step may be."""
SHORTEST = TOLERANCES.contact_forces.shortest
SHORTEST_STOP = TOLERANCES.contact_forces.shortest_stop
STEADY = TOLERANCES.contact_forces.steady_turn


class ErrorEstimate(NamedTuple):
    """What the error estimate reads of n bodies, and working memory for their state at the end of a sub-step.

    Rows of bodies that touch nothing are never touched, so that they take no memory.
    """

    geometry: Geometry
    shape_of_body: np.ndarray  # (n,)
    rotation: np.ndarray  # (n, 3, 3) of the bodies now
    trajectory: Trajectories
    end: BodyState
    end_rotation: np.ndarray  # (n, 3, 3)
    end_acceleration: np.ndarray  # (n, 3) m/s2
    end_angular_acceleration: np.ndarray  # (n, 3) rad/s2


def make_error_estimate(world: World, rotation: np.ndarray) -> ErrorEstimate:
    """Working memory for the bodies of a world; rotation (n, 3, 3): theirs now, a live array."""
    n = world.num_bodies
    end = BodyState(np.empty((n, 3)), np.empty((n, 4)), np.empty((n, 3)), np.empty((n, 3)), world.inv_mass, np.empty((n, 3, 3)))
    trajectory = make_trajectories(n)._replace(inertia=world.inertia)
    return ErrorEstimate(
        world.geometry, world.shape_of_body, rotation, trajectory, end, np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    )


class Turning(NamedTuple):
    """How m lasting contacts move, and what touches."""

    motion: Motion
    touching: Touching
    contact_margin: np.ndarray  # (m,) m


class StepLimits(NamedTuple):
    """What bounds the length of a sub-step."""

    rest: float  # s, what is left of the step
    step: float  # s
    last: np.ndarray  # (n,) s, length of the last sub-step of an island whose contacts turn, at its first body
    under_contact: np.ndarray  # (n,) bool, bodies whose trajectory carries contact forces


class Forces(NamedTuple):
    """What holds m contacts."""

    force: np.ndarray  # (m, 3) N in (n, t1, t2): those of last time, and then the answer
    wrench: np.ndarray  # (n, 6) N, N m on bodies


@jit
def turns(motion, step):
    """Whether arms or normals of contacts, as `Motion` says, turn in a step [s] so far that it matters."""
    return motion.fastest * step > STEADY


@jit
def sub_step(rate, step, rest):
    """Length of the next sub-step [s], where arms turn at `rate` [rad/s] and the rest of the step is left."""
    piece = step / min(max(np.ceil(rate * step / TURN), 1.0), MOST_SUB_STEPS)
    return piece if rest > piece * (1.0 + SHORTEST) else max(rest, SHORTEST * step)


@jit_with_callbacks
def hold_turning(solve, load, problem, turning, estimate, limits, forces, rolling):
    """Contact forces over a sub-step of at most `limits.rest`, as `Held`.

    solve: as in `slip.solve_rows`; load: None, or h -> h: it loads the bodies for a sub-step of h s and says how long that may be; problem:
    a `ContactProblem`; turning: `Turning`; estimate: `ErrorEstimate`; limits: `StepLimits`; forces: `Forces`; rolling: a `Rolling`.
    """
    step, first, m = limits.step, problem.members[0], turning.contact_margin.shape[0]
    excess, shortest = np.zeros(m), SHORTEST_STOP * step
    h = sub_step(turning.motion.fastest, step, limits.rest)
    if not turns(turning.motion, step):
        return hold_over(solve, load, problem, SubStep(excess, h, shortest), forces, rolling)
    plan = GROWTH * limits.last[first] if limits.under_contact[first] else np.inf
    h = min(h, plan)
    for c in range(m):
        excess[c] = problem.contacts.gap[c] - turning.contact_margin[c]
    held = hold_over(solve, load, problem, SubStep(excess, h, shortest), forces, rolling)
    error, share = estimate_error(problem, turning, estimate, forces, held.length, step)
    if share < 1.0:
        limits.last[first] = share * held.length
        for c in range(m):
            excess[c] += share**3.0 * error[c]
        return hold_over(solve, load, problem, SubStep(excess, share * held.length, shortest), forces, rolling)
    if h >= plan or not limits.under_contact[first]:
        limits.last[first] = max(h, step / MOST_SUB_STEPS)
    return held


@jit_with_callbacks
def hold_over(solve, load, problem, planned, forces, rolling):
    """Contact forces over the `SubStep` that is planned, or a part of it; arguments as in `hold_turning`."""
    h = planned.length
    if load is not None:
        h = load(h)
    for i in problem.members:
        for k in range(6):
            forces.wrench[i, k] = 0.0
    return hold_contacts(solve, problem, SubStep(planned.excess, h, planned.shortest), forces.force, forces.wrench, rolling)


@jit_making_arrays
def estimate_error(problem, turning, estimate, forces, h, step):
    """Errors (m,) of gaps after h [m] under the forces found, and the share of h after which they would be allowed."""
    error, worst, spin = gap_errors(problem, turning, estimate, forces.wrench, h), 0.0, 0.0
    for c in range(error.shape[0]):
        if forces.force[c, 0] == 0.0:
            error[c] = 0.0
        worst = max(worst, abs(error[c]) / (ALLOWED * turning.contact_margin[c]))
    if not worst > 1.0:
        return error, 1.0
    for i in problem.members:
        spin = max(spin, length(problem.bodies.angular_velocity[i]))
    share = worst ** (-1.0 / 3.0)
    if spin > 0.0:
        share = min(share, TURN_OF_BODY / (spin * h))
    return error, min(max(share, SHORTEST * step / h), 1.0)


@jit_making_arrays
def gap_errors(problem, turning, estimate, wrench, h):
    """Errors (m,) of the gaps of the held contacts after h [m] under the wrenches (n, 6)."""
    contacts, acceleration, spin_rate = problem.contacts, estimate.end_acceleration, estimate.end_angular_acceleration
    for c in range(contacts.gap.shape[0]):
        _stand(estimate, problem, contacts.body_a[c], h)
        _stand(estimate, problem, contacts.body_b[c], h)
    for i in problem.members:
        _go_on(estimate.trajectory, problem, wrench, i)
    bring_all(estimate.trajectory, problem.members, h, estimate.end, estimate.end_rotation, acceleration, spin_rate)
    ahead, error = _moved_contacts(contacts, turning.motion, h), np.empty(contacts.gap.shape[0])
    what = turning.touching
    end = contact_motion(
        estimate.geometry, estimate.shape_of_body, estimate.end_rotation, estimate.end, ahead, what.kind, what.feature
    )
    for c in range(error.shape[0]):
        a, b = contacts.body_a[c], contacts.body_b[c]
        at_a, at_b = cross(spin_rate[a], ahead.arm_a[c]), cross(spin_rate[b], ahead.arm_b[c])
        x = (acceleration[b, 0] + at_b[0]) - (acceleration[a, 0] + at_a[0]) + end.turning[c, 0]
        y = (acceleration[b, 1] + at_b[1]) - (acceleration[a, 1] + at_a[1]) + end.turning[c, 1]
        z = (acceleration[b, 2] + at_b[2]) - (acceleration[a, 2] + at_a[2]) + end.turning[c, 2]
        error[c] = dot((x, y, z), ahead.normal[c]) * (h * h / 6.0)
    return error


@jit
def _stand(estimate, problem, i, h):
    """Body i after h s as it is now: those that are no members keep their spin, and prescribed ones their acceleration."""
    end, bodies = estimate.end, problem.bodies
    for k in range(3):
        end.position[i, k] = bodies.position[i, k]
        pull = problem.acceleration[i, k] if bodies.inv_mass[i] == 0.0 else 0.0
        end.velocity[i, k], end.angular_velocity[i, k] = bodies.velocity[i, k] + h * pull, bodies.angular_velocity[i, k]
        estimate.end_acceleration[i, k], estimate.end_angular_acceleration[i, k] = pull, 0.0
        for j in range(3):
            estimate.end_rotation[i, k, j] = estimate.rotation[i, k, j]
    for k in range(4):
        end.orientation[i, k] = bodies.orientation[i, k]


@jit
def _go_on(trajectory, problem, wrench, i):
    """The trajectory of member i from now on, time 0, under constant wrenches (n, 6)."""
    bodies = problem.bodies
    for k in range(3):
        trajectory.position[i, k] = bodies.position[i, k]
        trajectory.velocity[i, k], trajectory.angular_velocity[i, k] = bodies.velocity[i, k], bodies.angular_velocity[i, k]
        trajectory.acceleration[i, k] = problem.acceleration[i, k] + bodies.inv_mass[i] * wrench[i, k]
        trajectory.torque[i, k] = wrench[i, 3 + k]
    for k in range(4):
        trajectory.orientation[i, k] = bodies.orientation[i, k]
    trajectory.mode[i] = FORCED
    begin(trajectory, i)


@jit_making_arrays
def _moved_contacts(contacts, motion, h):
    """Contacts whose arms and normals have moved on for h."""
    m = contacts.gap.shape[0]
    arm_a, arm_b, normal = np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 3))
    for c in range(m):
        for k in range(3):
            arm_a[c, k] = contacts.arm_a[c, k] + h * motion.arm_rate_a[c, k]
            arm_b[c, k] = contacts.arm_b[c, k] + h * motion.arm_rate_b[c, k]
            normal[c, k] = contacts.normal[c, k] + h * motion.normal_rate[c, k]
        size = sqrt(dot(normal[c], normal[c]))
        for k in range(3):
            normal[c, k] /= size
    return Contacts(
        contacts.body_a, contacts.body_b, arm_a, arm_b, normal, contacts.gap, contacts.restitution, contacts.tangential_restitution,
        contacts.static_friction, contacts.dynamic_friction,
    )  # fmt: skip
