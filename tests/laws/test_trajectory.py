"""The path of a body between two changes of its trajectory.

Law. x = x0 + v0 s + a s^2 / 2 + j s^3 / 6, v = v0 + a s + j s^2 / 2; rotation by mode. The path is one function of time: asked for
in one go or by way of any times in between, by the sweep or by the integration, it is the same. Forces that vary enter by two moments.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rigidimpulse.core.quaternion import angle_between, multiply, quaternion_from_rotation_vector, rotate, rotate_inverse
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import bring
from rigidimpulse.motion.trajectory import (
    FIXED,
    FORCED,
    FREE,
    LINEAR,
    PRESCRIBED,
    Trajectories,
    begin,
    make_trajectories,
    pose_at,
    state_at,
)

EPS = np.finfo(float).eps
TILTED = np.array([0.3, -0.5, 0.7, 0.4]) / np.linalg.norm([0.3, -0.5, 0.7, 0.4])
INERTIA = np.array([3.0, 2.0, 1.0])


def one_body(mode: int, start: float = 0.25, **columns) -> Trajectories:
    trajectory = make_trajectories(3)
    values = {
        "position": (1.0, -2.0, 0.5),
        "orientation": TILTED,
        "velocity": (0.3, 0.1, 4.0),
        "angular_velocity": (0.5, 1.2, -1.0),
        "acceleration": (0.0, 0.0, -9.81) if mode in (FREE, FORCED) else (0.0, 0.0, 0.0),
        "torque": (0.3, 0.2, -0.1),
        "inertia": INERTIA,
    }
    for name, value in (values | columns).items():
        getattr(trajectory, name)[1] = value
    trajectory.start[1], trajectory.mode[1] = start, mode
    begin(trajectory, 1)
    return trajectory


def state(trajectory: Trajectories, time: float) -> list[np.ndarray]:
    out = [np.empty(3), np.empty(4), np.empty(3), np.empty(3)]
    state_at(trajectory, 1, time, *out)
    return out


@pytest.mark.parametrize("mode", [PRESCRIBED, FREE, FORCED])
@pytest.mark.parametrize("jerk", [(0.0, 0.0, 0.0), (3.0, 0.0, -6.0)])
def test_parabola_or_cubic(mode, jerk):
    """The jerk moves the body by 8 m."""
    trajectory = one_body(mode, jerk=jerk)
    x, _, v, _ = state(trajectory, 2.25)
    acceleration, jerk = trajectory.acceleration[1], np.array(jerk)
    assert v == pytest.approx(trajectory.velocity[1] + 2.0 * acceleration + 2.0 * jerk, abs=32 * EPS)
    assert x == pytest.approx(trajectory.position[1] + 2.0 * trajectory.velocity[1] + 2.0 * acceleration + 4.0 / 3.0 * jerk, abs=64 * EPS)


@pytest.mark.parametrize(("mode", "unread"), [(FIXED, 2), (PRESCRIBED, 1), (LINEAR, 2), (FREE, 1)])
def test_rates_that_a_mode_does_not_read_change_no_bit(mode, unread):
    rates = dict(zip(("torque_rate", "jerk"), ((7.0, 8.0, 9.0), (1.0, 2.0, 3.0)), strict=True))
    length = np.append(np.zeros(12), 10.0)
    plain, other = one_body(mode, linear=length), one_body(mode, linear=length, **dict(list(rates.items())[:unread]))
    for one, two in zip(state(plain, 3.0), state(other, 3.0), strict=True):
        assert one.tobytes() == two.tobytes()


def test_prescribed_spin_is_constant_in_the_world():
    trajectory = one_body(PRESCRIBED)
    w_start = trajectory.angular_velocity[1]
    _, q, _, w = state(trajectory, 50.25)
    assert np.array_equal(w, w_start)
    expected = multiply(quaternion_from_rotation_vector(50.0 * w_start), TILTED)
    assert angle_between(q, expected) < 32 * EPS * (1.0 + 50.0 * np.linalg.norm(w_start))


def test_free_and_forced_momentum():
    torque, rate = np.array([0.3, 0.2, -0.1]), np.array([-0.4, 0.1, 0.5])
    for mode, impulse in ((FREE, np.zeros(3)), (FORCED, 1.5 * torque), (FORCED, 1.5 * torque + 1.125 * rate)):
        trajectory = one_body(mode, torque_rate=rate if impulse[2] > 0.0 else (0.0, 0.0, 0.0))
        start = rotate(TILTED, INERTIA * rotate_inverse(TILTED, trajectory.angular_velocity[1]))
        _, q, _, w = state(trajectory, 1.75)
        momentum = rotate(q, INERTIA * rotate_inverse(q, w))
        assert momentum == pytest.approx(start + impulse, abs=64 * EPS * np.linalg.norm(start))


def test_accelerations_at_a_time_are_the_slopes_of_the_velocities():
    """Central differences over 2h err by h^2 / 6 of the third derivatives, 1e-8, and EPS / h. Those of the start are off by 4 m/s^2."""
    trajectory = one_body(FORCED, jerk=(1.0, -2.0, 0.5), torque_rate=(-0.4, 0.1, 0.5))
    time, h = 2.25, 1e-5
    before, after = state(trajectory, time - h), state(trajectory, time + h)
    bodies = BodyState(*(np.zeros((3, k)) for k in (3, 4, 3, 3)), np.ones(3), np.zeros((3, 3, 3)))
    rotation, acceleration, turning = np.zeros((3, 3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    bring(trajectory, 1, time, bodies, rotation, acceleration, turning)
    assert acceleration[1] == pytest.approx((after[2] - before[2]) / (2.0 * h), abs=1e-8)
    assert turning[1] == pytest.approx((after[3] - before[3]) / (2.0 * h), abs=1e-8)


def test_fixed_body_ignores_its_rates():
    trajectory = one_body(FIXED)
    x, q, v, w = state(trajectory, 17.0)
    assert x.tobytes() == trajectory.position[1].tobytes()
    assert q.tobytes() == trajectory.orientation[1].tobytes()
    assert not v.any() and not w.any()


@pytest.mark.parametrize("mode", [PRESCRIBED, FREE, FORCED])
def test_body_at_rest_keeps_every_bit(mode):
    q = np.array([0.6, -0.0, 0.8000000000000003, -0.0])
    still = dict.fromkeys(("velocity", "angular_velocity", "acceleration", "torque"), (0.0, -0.0, 0.0))
    trajectory = one_body(mode, orientation=q, position=(-0.0, 0.1, 1e300), **still)
    for time in (0.25, 1.0, 1e6):
        x_now, q_now, v, w = state(trajectory, time)
        assert x_now.tobytes() == trajectory.position[1].tobytes()
        assert q_now.tobytes() == q.tobytes()
        assert not v.any() and not w.any()


@pytest.mark.parametrize("mode", [PRESCRIBED, FREE, FORCED])
def test_start_is_reproduced_to_the_bit(mode):
    trajectory = one_body(mode)
    x, q, v, w = state(trajectory, 0.25)
    for now, column in ((x, "position"), (q, "orientation"), (v, "velocity"), (w, "angular_velocity")):
        assert now.tobytes() == getattr(trajectory, column)[1].tobytes()
    # And approached: one unit in the last place of time later nothing has jumped.
    later = state(trajectory, np.nextafter(0.25, 1.0))
    for now, soon in zip((x, q, v, w), later, strict=True):
        assert soon == pytest.approx(now, abs=16 * EPS * (1.0 + np.linalg.norm(now)))


@pytest.mark.parametrize("mode", [FIXED, PRESCRIBED, FREE, FORCED])
def test_pose_and_state_agree_to_the_bit_in_any_order(mode):
    trajectory = one_body(mode)
    times = [7.0, 0.25, 3.1, 0.2500001, 7.0]
    x, q = np.empty(3), np.empty(4)
    seen = {}
    for time in times:
        pose_at(trajectory, 1, time, x, q)
        x_state, q_state, _, _ = state(trajectory, time)
        assert x.tobytes() == x_state.tobytes() and q.tobytes() == q_state.tobytes()
        assert seen.setdefault(time, q.tobytes()) == q.tobytes()


def test_forced_without_torque_is_free():
    free, forced = one_body(FREE), one_body(FORCED, torque=(0.0, 0.0, 0.0))
    for a, b in zip(state(free, 9.0), state(forced, 9.0), strict=True):
        assert a.tobytes() == b.tobytes()


def test_rows_are_independent():
    trajectory = one_body(FREE)
    assert not trajectory.top[0].any() and not trajectory.top[2].any()


STEADY = dict.fromkeys(("jerk", "torque_rate"), (0.0, 0.0, 0.0))
GROWING = {"jerk": (1.0, -2.0, 0.5), "torque_rate": (-0.04, 0.01, 0.05)}


@pytest.mark.parametrize(
    ("mode", "duration", "rates"), [(PRESCRIBED, 100.0, STEADY), (FREE, 100.0, STEADY), (FORCED, 10.0, STEADY), (FORCED, 10.0, GROWING)]
)
def test_new_trajectory_every_frame_is_the_same_trajectory(mode, duration, rates):
    """Begun again every 1/60 s. Required: 1e-9 after 100 s.

    Each of n starts rounds orientation and spin by eps, and an error of the spin turns the body ever further: by
    eps |w| t sqrt(n), 3e-12 after 164 rad in 6000 steps, times the roundings of one. The midpoint rule is off by 7e-3.
    """
    whole, stepped = one_body(mode, **rates), one_body(mode, **rates)
    frames = round(60 * duration)
    for frame in range(1, frames + 1):
        time = 0.25 + frame / 60.0
        x, q, v, w = state(stepped, time)
        stepped.acceleration[1] += (time - stepped.start[1]) * stepped.jerk[1]
        stepped.torque[1] += (time - stepped.start[1]) * stepped.torque_rate[1]
        stepped.start[1] = time
        stepped.position[1], stepped.orientation[1], stepped.velocity[1], stepped.angular_velocity[1] = x, q, v, w
        begin(stepped, 1)
    x, q, v, w = state(whole, 0.25 + duration)
    assert angle_between(q, stepped.orientation[1]) < 5e-11
    assert stepped.angular_velocity[1] == pytest.approx(w, abs=5e-11 * np.linalg.norm(w))
    assert stepped.position[1] == pytest.approx(x, rel=1e-11)
    assert stepped.velocity[1] == pytest.approx(v, rel=1e-11)


def from_moments(whole: np.ndarray, first: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """F0 and F1 of the line F0 + F1 s with M0 = integral of F ds and M1 = integral of (h - s) F ds over [0, h]."""
    return (6.0 * first / h - 2.0 * whole) / h, (6.0 * whole - 12.0 * first / h) / h**2


def runge_kutta(slope, start: np.ndarray, t: float, h: float) -> list[np.ndarray]:
    """The four slopes of a step of the classical method."""
    slopes = [slope(t, start)]
    for share in (0.5, 0.5, 1.0):
        slopes.append(slope(t + share * h, start + share * h * slopes[-1]))
    return slopes


def moments(forces: list[np.ndarray], h: float) -> tuple[np.ndarray, np.ndarray]:
    """M0 and M1 of the forces at the four stages."""
    return h * (forces[0] + 2.0 * forces[1] + 2.0 * forces[2] + forces[3]) / 6.0, h**2 * sum(forces[:3]) / 6.0


def test_the_path_ends_where_a_step_of_runge_kutta_ends():
    """A damped spring and a force of time, to round-off; a force held constant ends h^2 off, 1e-3 m."""
    trajectory, h = one_body(FREE, start=0.0), 0.1

    def slope(t, y):
        return np.concatenate([y[3:], -40.0 * y[:3] - 2.0 * y[3:] + (0.0, np.sin(9.0 * t), 0.0)])

    start = np.concatenate([trajectory.position[1], trajectory.velocity[1]])
    slopes = runge_kutta(slope, start, 0.0, h)
    end = start + h * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3]) / 6.0
    trajectory.acceleration[1], trajectory.jerk[1] = from_moments(*moments([k[3:] for k in slopes], h), h)
    x, _, v, _ = state(trajectory, h)
    assert x == pytest.approx(end[:3], abs=64 * EPS)
    assert v == pytest.approx(end[3:], abs=256 * EPS * 8.0)


def pushed_turn(t: float, q: np.ndarray) -> np.ndarray:
    """A torque that varies with time and with attitude: a needle in a turning field."""
    return np.array([0.5 * np.sin(3.0 * t), np.cos(2.0 * t), 0.3 * t]) + np.cross(rotate(q, [0.0, 0.8, 0.6]), [1.0, np.sin(t), 2.0])


def turning(t: float, y: np.ndarray) -> np.ndarray:
    """Slopes of attitude and angular momentum, world frame."""
    q, momentum = y[:4] / np.linalg.norm(y[:4]), y[4:]
    w = rotate(q, rotate_inverse(q, momentum) / INERTIA)
    return np.concatenate([0.5 * multiply(np.append(0.0, w), y[:4]), pushed_turn(t, q)])


def turned_by_moments(start: np.ndarray, duration: float, steps: int, linear: bool) -> np.ndarray:
    """Attitude after steps of the course under the line (or the constant) with the moments of a Runge-Kutta step."""
    trajectory, h, y = one_body(FORCED), duration / steps, start
    for step in range(steps):
        torques = [slope[4:] for slope in runge_kutta(turning, y, step * h, h)]
        torque, rate = from_moments(*moments(torques, h), h)
        trajectory.start[1], trajectory.orientation[1] = 0.0, y[:4]
        trajectory.angular_velocity[1] = rotate(y[:4], rotate_inverse(y[:4], y[4:]) / INERTIA)
        trajectory.torque[1] = torque if linear else torque + 0.5 * h * rate
        trajectory.torque_rate[1] = rate if linear else 0.0
        begin(trajectory, 1)
        _, q, _, w = state(trajectory, h)
        y = np.concatenate([q, rotate(q, INERTIA * rotate_inverse(q, w))])
    return y[:4]


def test_a_step_of_runge_kutta_by_its_moments_is_of_order_4():
    """The line leaves out what has no first two moments: errors of h^5 a step. A constant torque has the first only: order 2."""
    start, duration = np.concatenate([TILTED, rotate(TILTED, INERTIA * [0.5, 1.2, -1.0])]), 2.0
    exact = solve_ivp(turning, (0.0, duration), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:4, -1]
    for linear, order in ((True, 4.0), (False, 2.0)):
        errors = [angle_between(turned_by_moments(start, duration, steps, linear), exact) for steps in (10, 20, 40, 80)]
        slopes = -np.diff(np.log2(errors))
        assert np.all(np.abs(slopes - order) < 0.3), (errors, slopes)
