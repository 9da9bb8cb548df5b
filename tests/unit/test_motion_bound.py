"""The motion bound is exact in its first two derivatives and never optimistic in the third.

Law: with y the path of a point of B seen from A, |y(s) - y - y' s - y'' s^2 / 2| <= (J_c + J_r |r|) s^3 / 6 for s <= h, and |w(s)| <= W.
The left side is computed from the poses of the trajectory, which carry rounding of about 1e-13 of the coordinates and of the path length;
a wrong y' or y'' would show as an error of first or second order in s, many orders above it.
"""

import numpy as np
import pytest

from rigidimpulse.collision.time_of_impact.motion_bound import (
    AXES,
    JERK_BOUND,
    MOTION_SIZE,
    ORIENTATION,
    SEEN_ARM_JERK,
    SEEN_JERK,
    SEEN_SIZE,
    SPIN,
    SPIN_BOUND,
    SPIN_RATE_BOUND,
    motion_bound,
    relative_motion,
    seen_motion,
    stop_turning,
)
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.motion.trajectory import FIXED, FORCED, FREE, PRESCRIBED, begin, make_trajectories, pose_at, state_at

ROUND_OFF = 3e-13


@jit
def observe(work, h, arm):
    """Look at body 1 from body 0; returns y' and y'' of the point at `arm`."""
    seen = 2 * MOTION_SIZE
    relative_motion(work, 0 * MOTION_SIZE, MOTION_SIZE, 0 * MOTION_SIZE, h, seen)
    return seen_motion(work, seen, (arm[0], arm[1], arm[2]))


def random_trajectory(rng, modes):
    """Two bodies with magnitudes spread over four decades and any realizable moments of inertia."""
    trajectory = make_trajectories(2)
    for i, mode in enumerate(modes):
        trajectory.mode[i] = mode
        trajectory.position[i] = rng.normal(size=3) * 10 ** rng.uniform(-1, 1)
        orientation = rng.normal(size=4)
        trajectory.orientation[i] = orientation / np.linalg.norm(orientation)
        if mode != FIXED:
            trajectory.velocity[i] = rng.normal(size=3) * 10 ** rng.uniform(-2, 2)
            trajectory.angular_velocity[i] = rng.normal(size=3) * 10 ** rng.uniform(-2, 2) * (rng.random() < 0.9)
        if mode in (FREE, FORCED):
            trajectory.acceleration[i] = rng.normal(size=3) * 10 ** rng.uniform(-1, 2)
            trajectory.jerk[i] = rng.normal(size=3) * 10 ** rng.uniform(-1, 4) * (rng.random() < 0.5)
        split = 10 ** rng.uniform(-1, 1, size=3)
        trajectory.inertia[i] = split.sum() - split
        if rng.random() < 0.3:
            trajectory.inertia[i, : rng.integers(2, 4)] = trajectory.inertia[i, 0]
        if mode == FORCED:
            trajectory.torque[i] = rng.normal(size=3) * 10 ** rng.uniform(-2, 3) * trajectory.inertia[i].min()
            trajectory.torque_rate[i] = rng.normal(size=3) * 10 ** rng.uniform(-1, 5) * trajectory.inertia[i].min() * (rng.random() < 0.5)
        begin(trajectory, i)
    return trajectory


def motions(trajectory, t, h):
    """The scratch array with the motion records of both bodies at time t."""
    work = np.zeros(2 * MOTION_SIZE + SEEN_SIZE)
    for i in range(2):
        motion_bound(trajectory, i, t, h, work[MOTION_SIZE * i : MOTION_SIZE * (i + 1)])
    return work


def seen_point(trajectory, t, r):
    """y(t): the point r of body 1 in the frame of body 0."""
    x, q = np.empty((2, 3)), np.empty((2, 4))
    for i in range(2):
        pose_at(trajectory, i, t, x[i], q[i])
    return to_matrix(q[0]).T @ (x[1] - x[0] + to_matrix(q[1]) @ r)


@pytest.mark.parametrize("seed", range(4))
def test_never_optimistic(seed):
    """4 x 1,000 random motions, five instants each: 20,000 samples."""
    rng = np.random.default_rng(seed)
    tightest = 0.0
    for _ in range(1000):
        trajectory = random_trajectory(rng, rng.choice([FIXED, PRESCRIBED, FREE, FORCED], size=2))
        fastest = np.linalg.norm(trajectory.angular_velocity, axis=1).max()
        h = 10 ** rng.uniform(-4, 0) * min(1.0 / max(fastest, 1e-9), 0.3)
        t = rng.uniform(0.0, 0.1)
        work = motions(trajectory, t, h)
        r = rng.normal(size=3) * 10 ** rng.uniform(-2, 1)
        arm = to_matrix(work[ORIENTATION : ORIENTATION + 4]).T @ to_matrix(work[MOTION_SIZE + ORIENTATION :][:4]) @ r
        velocity, acceleration = map(np.array, observe(work, h, arm))
        seen = work[2 * MOTION_SIZE :]
        jerk = seen[SEEN_JERK] + seen[SEEN_ARM_JERK] * np.linalg.norm(r)
        travelled = np.abs(trajectory.velocity).max() * (t + h) + np.abs(trajectory.jerk).max() * (t + h) ** 3
        rounding = ROUND_OFF * (np.abs(trajectory.position).max() + travelled + np.linalg.norm(r))
        start = seen_point(trajectory, t, r)
        for s in h * np.append(rng.random(4), 1.0):
            error = seen_point(trajectory, t + s, r) - start - velocity * s - 0.5 * acceleration * s * s
            bound = jerk * s**3 / 6.0
            assert np.linalg.norm(error) <= bound + rounding
            if bound > 1e3 * rounding:
                tightest = max(tightest, np.linalg.norm(error) / bound)
    assert tightest > 0.9  # the bound is not loose either: a steady turn reaches it


@pytest.mark.parametrize("mode", [PRESCRIBED, FREE, FORCED])
def test_spin_stays_below_its_bound(mode):
    rng = np.random.default_rng(mode)
    x, q, v, w = np.empty(3), np.empty(4), np.empty(3), np.empty(3)
    for _ in range(500):
        trajectory = random_trajectory(rng, [mode, FIXED])
        h = 10 ** rng.uniform(-3, 0) / max(np.linalg.norm(trajectory.angular_velocity[0]), 1.0)
        work = motions(trajectory, 0.0, h)
        for s in h * rng.random(4):
            state_at(trajectory, 0, s, x, q, v, w)
            assert np.linalg.norm(w) <= work[SPIN_BOUND] * (1.0 + 1e-11)


def test_bodies_that_move_as_one_see_each_other_at_rest():
    """Rotation about a common axis: u = v_b - v_a - w x d = 0, hence y' = y'' = 0 up to rounding of w^2 |d| = 50."""
    trajectory = make_trajectories(2)
    w = np.array([1.0, -2.0, 4.0])
    for i, position in enumerate(([0.3, 0.1, -0.7], [2.0, -1.0, 0.5])):
        trajectory.mode[i] = PRESCRIBED
        trajectory.position[i] = position
        trajectory.velocity[i] = np.cross(w, position)
        trajectory.angular_velocity[i] = w
        begin(trajectory, i)
    work = motions(trajectory, 0.0, 0.01)
    # As a prescribed body moves in a straight line, its acceleration towards the axis is put in by hand.
    for i in range(2):
        work[MOTION_SIZE * i + 9 : MOTION_SIZE * i + 12] = np.cross(w, np.cross(w, trajectory.position[i]))
    velocity, acceleration = observe(work, 0.01, np.array([0.4, 0.5, 0.6]))
    assert np.abs(velocity).max() < 1e-13
    assert np.abs(acceleration).max() < 1e-13


def test_without_rotation_there_is_no_jerk():
    """Two parabolas differ by a parabola."""
    trajectory = random_trajectory(np.random.default_rng(0), [FREE, FREE])
    trajectory.angular_velocity[:] = trajectory.jerk[:] = 0.0
    for i in range(2):
        begin(trajectory, i)
    work = motions(trajectory, 0.0, 1.0)
    observe(work, 1.0, np.ones(3))
    assert work[2 * MOTION_SIZE + SEEN_JERK] == 0.0
    assert work[2 * MOTION_SIZE + SEEN_ARM_JERK] == 0.0


def test_without_rotation_jerk_is_that_of_the_centres():
    """Two cubics differ by a cubic, whose third derivative is the difference of theirs."""
    trajectory = random_trajectory(np.random.default_rng(0), [FREE, FREE])
    trajectory.angular_velocity[:], trajectory.jerk[:] = 0.0, ((1.0, 2.0, 3.0), (4.0, 6.0, 3.0))
    for i in range(2):
        begin(trajectory, i)
    work = motions(trajectory, 0.4, 1.0)
    observe(work, 1.0, np.ones(3))
    assert work[2 * MOTION_SIZE + SEEN_JERK] == pytest.approx(5.0, rel=1e-11)
    assert work[2 * MOTION_SIZE + SEEN_ARM_JERK] == 0.0


def test_a_ball_is_seen_without_rotation():
    trajectory = random_trajectory(np.random.default_rng(1), [FORCED, FREE])
    row = motions(trajectory, 0.0, 0.01)[:MOTION_SIZE]
    stop_turning(row)
    assert not row[SPIN : SPIN + 3].any()
    assert not row[[SPIN_BOUND, SPIN_RATE_BOUND, JERK_BOUND]].any()
    assert np.array_equal(row[AXES : AXES + 9].reshape(3, 3), np.eye(3))
