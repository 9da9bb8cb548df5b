"""The path of a body between two changes of course.

Law. x = x0 + v0 s + a s^2 / 2, v = v0 + a s; rotation by mode. The path is one function of time: asked for in one go or
by way of any times in between, by the sweep or by the integration, it is the same.
"""

from __future__ import annotations

import numpy as np
import pytest

from rigidimpulse.integrate.course import FIXED, FORCED, FREE, PRESCRIBED, Course, begin, make_course, pose_at, state_at
from rigidimpulse.rotation import angle_between, multiply, quaternion_from_rotation_vector, rotate, rotate_inverse

EPS = np.finfo(float).eps
TILTED = np.array([0.3, -0.5, 0.7, 0.4]) / np.linalg.norm([0.3, -0.5, 0.7, 0.4])
INERTIA = np.array([3.0, 2.0, 1.0])


def one_body(mode: int, start: float = 0.25, **columns) -> Course:
    course = make_course(3)
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
        getattr(course, name)[1] = value
    course.start[1], course.mode[1] = start, mode
    begin(course, 1)
    return course


def state(course: Course, time: float) -> list[np.ndarray]:
    out = [np.empty(3), np.empty(4), np.empty(3), np.empty(3)]
    state_at(course, 1, time, *out)
    return out


@pytest.mark.parametrize("mode", [PRESCRIBED, FREE, FORCED])
def test_parabola(mode):
    course = one_body(mode)
    x, _, v, _ = state(course, 2.25)
    acceleration = course.acceleration[1]
    assert v == pytest.approx(course.velocity[1] + 2.0 * acceleration, abs=32 * EPS)
    assert x == pytest.approx(course.position[1] + 2.0 * course.velocity[1] + 2.0 * acceleration, abs=64 * EPS)


def test_prescribed_spin_is_constant_in_the_world():
    course = one_body(PRESCRIBED)
    w_start = course.angular_velocity[1]
    _, q, _, w = state(course, 50.25)
    assert np.array_equal(w, w_start)
    expected = multiply(quaternion_from_rotation_vector(50.0 * w_start), TILTED)
    assert angle_between(q, expected) < 32 * EPS * (1.0 + 50.0 * np.linalg.norm(w_start))


def test_free_and_forced_momentum():
    for mode, torque in ((FREE, np.zeros(3)), (FORCED, np.array([0.3, 0.2, -0.1]))):
        course = one_body(mode)
        start = rotate(TILTED, INERTIA * rotate_inverse(TILTED, course.angular_velocity[1]))
        _, q, _, w = state(course, 1.75)
        momentum = rotate(q, INERTIA * rotate_inverse(q, w))
        assert momentum == pytest.approx(start + 1.5 * torque, abs=64 * EPS * np.linalg.norm(start))


def test_fixed_body_ignores_its_rates():
    course = one_body(FIXED)
    x, q, v, w = state(course, 17.0)
    assert x.tobytes() == course.position[1].tobytes()
    assert q.tobytes() == course.orientation[1].tobytes()
    assert not v.any() and not w.any()


@pytest.mark.parametrize("mode", [PRESCRIBED, FREE, FORCED])
def test_body_at_rest_keeps_every_bit(mode):
    q = np.array([0.6, -0.0, 0.8000000000000003, -0.0])
    still = dict.fromkeys(("velocity", "angular_velocity", "acceleration", "torque"), (0.0, -0.0, 0.0))
    course = one_body(mode, orientation=q, position=(-0.0, 0.1, 1e300), **still)
    for time in (0.25, 1.0, 1e6):
        x_now, q_now, v, w = state(course, time)
        assert x_now.tobytes() == course.position[1].tobytes()
        assert q_now.tobytes() == q.tobytes()
        assert not v.any() and not w.any()


@pytest.mark.parametrize("mode", [PRESCRIBED, FREE, FORCED])
def test_start_is_reproduced_to_the_bit(mode):
    course = one_body(mode)
    x, q, v, w = state(course, 0.25)
    for now, column in ((x, "position"), (q, "orientation"), (v, "velocity"), (w, "angular_velocity")):
        assert now.tobytes() == getattr(course, column)[1].tobytes()
    # And approached: one unit in the last place of time later nothing has jumped.
    later = state(course, np.nextafter(0.25, 1.0))
    for now, soon in zip((x, q, v, w), later, strict=True):
        assert soon == pytest.approx(now, abs=16 * EPS * (1.0 + np.linalg.norm(now)))


@pytest.mark.parametrize("mode", [FIXED, PRESCRIBED, FREE, FORCED])
def test_pose_and_state_agree_to_the_bit_in_any_order(mode):
    course = one_body(mode)
    times = [7.0, 0.25, 3.1, 0.2500001, 7.0]
    x, q = np.empty(3), np.empty(4)
    seen = {}
    for time in times:
        pose_at(course, 1, time, x, q)
        x_state, q_state, _, _ = state(course, time)
        assert x.tobytes() == x_state.tobytes() and q.tobytes() == q_state.tobytes()
        assert seen.setdefault(time, q.tobytes()) == q.tobytes()


def test_forced_without_torque_is_free():
    free, forced = one_body(FREE), one_body(FORCED, torque=(0.0, 0.0, 0.0))
    for a, b in zip(state(free, 9.0), state(forced, 9.0), strict=True):
        assert a.tobytes() == b.tobytes()


def test_rows_are_independent():
    course = one_body(FREE)
    assert not course.top[0].any() and not course.top[2].any()


@pytest.mark.parametrize(("mode", "duration"), [(PRESCRIBED, 100.0), (FREE, 100.0), (FORCED, 10.0)])
def test_new_course_every_frame_is_the_same_course(mode, duration):
    """Begun anew every 1/60 s. Required: 1e-9 after 100 s.

    Each of n starts rounds orientation and spin by eps, and an error of the spin turns the body ever further: by
    eps |w| t sqrt(n), 3e-12 after 164 rad in 6000 steps, times the roundings of one. The midpoint rule is off by 7e-3.
    """
    whole, stepped = one_body(mode), one_body(mode)
    frames = round(60 * duration)
    for frame in range(1, frames + 1):
        time = 0.25 + frame / 60.0
        x, q, v, w = state(stepped, time)
        stepped.start[1] = time
        stepped.position[1], stepped.orientation[1], stepped.velocity[1], stepped.angular_velocity[1] = x, q, v, w
        begin(stepped, 1)
    x, q, v, w = state(whole, 0.25 + duration)
    assert angle_between(q, stepped.orientation[1]) < 5e-11
    assert stepped.angular_velocity[1] == pytest.approx(w, abs=5e-11 * np.linalg.norm(w))
    assert stepped.position[1] == pytest.approx(x, rel=1e-11)
    assert stepped.velocity[1] == pytest.approx(v, rel=1e-11)
