"""Rotation under a torque that is constant in the world or changes linearly with time.

Law. L(t) = L0 + tau0 t + tau1 t^2 / 2 in the world, I w' = I w x w + R^T tau in the body, q' = q w / 2.
Tolerance. The series is cut where its terms reach 1e-15; over many segments the error grows as the round-off of the
angle turned. The classical method of order 4 is off by 3e-4 in one step of a tenth of a turn.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from top_reference import reference

from rigidimpulse.core.quaternion import (
    angle_between,
    conjugate,
    multiply,
    quaternion_from_axis_angle,
    rotate,
    rotate_inverse,
    rotation_vector,
)
from rigidimpulse.motion import forced_rotation, free_rotation

EPS = np.finfo(float).eps
ROUND_OFF = 64.0
TILTED = np.array([0.3, -0.5, 0.7, 0.4]) / np.linalg.norm([0.3, -0.5, 0.7, 0.4])
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class Top:
    """A top under torque, ready to be evaluated."""

    def __init__(self, inertia, q, w_world, torque, torque_rate=(0.0, 0.0, 0.0)):
        values = (inertia, q, w_world, torque, torque_rate)
        self.inertia, self.q, self.w, self.torque, self.rate = (np.asarray(value, dtype=float) for value in values)
        self.constants, self.series = np.full(forced_rotation.FORCED_ROTATION_SIZE, np.nan), np.full(forced_rotation.SERIES_SIZE, np.nan)
        assert forced_rotation.prepare(self.inertia, self.q, self.w, self.torque, self.rate, self.constants, self.series)

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        q, w = np.empty(4), np.empty(3)
        forced_rotation.evaluate(self.constants, self.series, float(time), q, w)
        return q, w

    @property
    def kind(self) -> float:
        return self.constants[0]

    @property
    def segment(self) -> float:
        return self.constants[forced_rotation.SEGMENT]


CASES = {
    "weak": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (1e-9, 1e-10, 0.0)),
    "comparable": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1)),
    "strong": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (12.0, 7.0, -3.0)),
    "from rest": ((3.0, 2.0, 1.0), TILTED, (0.0, 0.0, 0.0), (0.3, 0.2, -0.1)),
    "sphere": ((2.0, 2.0, 2.0), TILTED, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1)),
    "disc": ((1.0, 1.0, 2.0), UPRIGHT, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1)),
    "rod of ratio 2000": ((5e-4, 1.0, 1.0), TILTED, (0.5, 0.6, -0.6), (3e-3, 2e-3, -1e-3)),
    "rod of ratio 1e6": ((1e-6, 1.0, 1.0000005), UPRIGHT, (0.5, 0.6, -0.6), (3e-9, 2e-7, -1e-7)),
    "no triangle inequality": ((0.1, 0.2, 1.0), UPRIGHT, (0.5, 0.6, -0.6), (0.03, 0.02, -0.01)),
    "fast": ((3.0, 2.0, 1.0), TILTED, (500.0, 600.0, -600.0), (300.0, 200.0, -100.0)),
    "slow and light": ((3e-20, 2e-20, 1e-20), TILTED, (5e-9, 6e-9, -6e-9), (3e-37, 2e-37, -1e-37)),
}


LINEAR = {
    # the fifth: N m/s
    "grows": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1), (0.2, -0.4, 0.1)),
    "turns back": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1), (-0.15, -0.1, 0.05)),
    "from nothing": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (0.0, 0.0, 0.0), (0.2, -0.4, 0.1)),
    "from nothing, at rest": ((3.0, 2.0, 1.0), TILTED, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.2, -0.4, 0.1)),
    "from next to nothing": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (1e-200, 0.0, 0.0), (0.2, -0.4, 0.1)),
    "next to parallel": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1), (0.3, 0.2 + 1e-9, -0.1)),
    "next to an axis": ((3.0, 2.0, 1.0), UPRIGHT, (0.5, 0.0, 0.0), (0.3, 0.0, 0.0), (0.2, 1e-13, 0.0)),
    "hardly grows": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1), (1e-9, 1e-10, 0.0)),
    "strong growth": ((3.0, 2.0, 1.0), TILTED, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1), (20.0, -40.0, 10.0)),
    "sphere that grows": ((2.0, 2.0, 2.0), TILTED, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1), (0.2, -0.4, 0.1)),
    "sphere from nothing": ((2.0, 2.0, 2.0), TILTED, (0.5, 0.6, -0.6), (0.0, 0.0, 0.0), (0.2, -0.4, 0.1)),
    "disc that grows": ((1.0, 1.0, 2.0), UPRIGHT, (0.5, 0.6, -0.6), (0.3, 0.2, -0.1), (0.2, -0.4, 0.1)),
    "rod that grows": ((5e-4, 1.0, 1.0), TILTED, (0.5, 0.6, -0.6), (3e-3, 2e-3, -1e-3), (2e-3, -4e-3, 1e-3)),
    "slow, light and growing": ((3e-20, 2e-20, 1e-20), TILTED, (5e-9, 6e-9, -6e-9), (3e-37, 2e-37, -1e-37), (2e-45, -4e-45, 1e-45)),
}


@pytest.mark.parametrize("name", CASES | LINEAR)
def test_against_reference(name):
    """Within a step |w| t is 1 at most: 1e-12 is required; five times as long shows how the error grows.

    Euler's equations amplify by |I2 - I3| / I1, which is at most 1 for real bodies. Without its rate, a torque that grows is off
    by tau1 t^2 / 2, 0.2 of L after t = 1.
    """
    inertia, q, w_start, *torques = (CASES | LINEAR)[name]
    top = Top(inertia, q, w_start, *torques)
    spin = max(np.linalg.norm(w_start), *((np.linalg.norm(torques[k]) / max(inertia)) ** (1.0 / (k + 2)) for k in range(len(torques))))
    times = np.array([0.01, 0.3, 1.0, 5.0]) / spin
    coupling = max(1.0, *abs(np.roll(inertia, -1) - np.roll(inertia, -2)) / inertia)
    for time, (q_exact, w_exact) in zip(times, reference(inertia, q, w_start, times, *torques), strict=True):
        q_now, w_now = top.at(time)
        turned = time * (np.linalg.norm(w_start) + np.linalg.norm(w_exact))
        tolerance = ROUND_OFF * EPS * (1.0 + coupling * turned)
        assert angle_between(q_now, q_exact) < tolerance
        assert np.linalg.norm(w_now - w_exact) < tolerance * (np.linalg.norm(w_exact) + spin)


@pytest.mark.parametrize(("spin", "push", "growth"), [(0, 0.4, 0), (-3, 0.4, 0), (0, 0.4, -0.1), (-3, 0, 0.1), (-3, 0.4, 0.1), (0, 0, 0.1)])
def test_axis_that_stays_is_elementary(spin, push, growth):
    """A sphere with torques along its spin, a box about a principal axis: angle w t + a t^2 / 2 + b t^3 / 6 with a, b = tau0, tau1 / I."""
    sphere, box = (2.0, 2.0, 2.0), (1.0, 2.0, 3.0)
    for inertia, direction in ((sphere, np.array([0.6, 0.0, 0.8])), (box, rotate(TILTED, [0, 1, 0]))):
        top = Top(inertia, TILTED, spin * direction, 2.0 * push * direction, 2.0 * growth * direction)
        assert top.kind == forced_rotation.FORCED_AXIS
        for time in (0.02, 30.0):
            q_now, w_now = top.at(time)
            angle = spin * time + push * time**2 / 2.0 + growth * time**3 / 6.0
            w_exact = spin + push * time + growth * time**2 / 2.0
            turned = 1.0 + abs(spin) * time + push * time**2 + abs(growth) * time**3
            assert w_now == pytest.approx(w_exact * direction, abs=ROUND_OFF * EPS * turned)
            assert angle_between(q_now, multiply(quaternion_from_axis_angle(direction, angle), TILTED)) < ROUND_OFF * EPS * turned


def test_a_rate_that_is_none_changes_no_bit():
    """Next to |tau| / t, a rate below 1e-280 rad/s^3 is nothing: the path is that of the constant torque, segment by segment."""
    for name in ("comparable", "disc", "rod of ratio 2000"):
        plain, grown = Top(*CASES[name]), Top(*CASES[name], (1e-290, 0.0, -0.0))
        for time in (0.1, 40.0):
            for one, other in zip(plain.at(time), grown.at(time), strict=True):
                assert one.tobytes() == other.tobytes()


def test_vanishing_torque_is_free_rotation():
    """Two methods that share nothing: series over 127 segments, and elliptic functions."""
    inertia, w_start = np.array([3.0, 2.0, 1.0]), np.array([0.5, 0.6, -0.6])
    top = Top(inertia, TILTED, w_start, (1e-30, 0.0, 0.0))
    constants, q_free, w_free = np.zeros(free_rotation.FREE_ROTATION_SIZE), np.empty(4), np.empty(3)
    free_rotation.prepare(inertia, TILTED, w_start, constants)
    for time in (0.1, 1.0, 50.0):
        free_rotation.evaluate(constants, time, q_free, w_free)
        q_now, w_now = top.at(time)
        assert angle_between(q_now, q_free) < ROUND_OFF * EPS * (1.0 + time)
        assert w_now == pytest.approx(w_free, abs=ROUND_OFF * EPS * (1.0 + time))


def test_no_torque_is_left_to_free_rotation():
    constants, series = np.full(forced_rotation.FORCED_ROTATION_SIZE, 7.0), np.full(forced_rotation.SERIES_SIZE, 7.0)
    assert not forced_rotation.prepare(np.ones(3), UPRIGHT, np.ones(3), np.zeros(3), np.zeros(3), constants, series)
    assert (constants == 7.0).all() and (series == 7.0).all()


def test_endless_turning_is_given_up():
    """A needle under a torque that turns it by 1e10 rad: NaN after a bounded number of segments, no endless loop."""
    q, w = Top((1e-12, 1.0, 1.0), TILTED, (0.0, 0.0, 0.1), (1.0, 0.0, 0.0)).at(0.1)
    assert np.isnan(q).all() and np.isnan(w).all()


def test_order_of_the_series():
    """Cut after t^ORDER, the series errs by t^(ORDER + 1); beyond its segment that is well above round-off."""
    inertia, q, w_start, torque = CASES["comparable"]
    top = Top(inertia, q, w_start, torque)
    times = top.segment * np.array([2.0, 2.5, 3.0, 3.5])
    exact = reference(inertia, q, w_start, times, torque)
    top.constants[forced_rotation.SEGMENT] = np.inf
    errors = [float(angle_between(top.at(t)[0], q_exact)) for t, (q_exact, _) in zip(times, exact, strict=True)]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(times))
    assert np.all(np.abs(slopes - (forced_rotation.ORDER + 1)) < 1.0), slopes


@pytest.mark.parametrize("name", [name for name in CASES | LINEAR if name != "weak"])
def test_segments_join_smoothly(name):
    """Just before and after a joint the path differs by the motion in between and the round-off of the phase."""
    top = Top(*(CASES | LINEAR)[name])
    joint = top.segment
    (q_before, w_before), (q_after, w_after) = top.at(joint), top.at(np.nextafter(joint, np.inf))
    assert angle_between(q_before, q_after) < 1e-13
    assert w_after == pytest.approx(w_before, rel=0, abs=1e-13 * np.linalg.norm(w_before))


def test_a_torque_that_vanishes_where_a_segment_ends():
    """tau1 = -tau0 / segment: there the torque is nothing but round-off, and it turns round."""
    inertia, q, w_start, torque = CASES["comparable"]
    rate = np.zeros(3)
    for _ in range(60):  # fixed point: the segment depends on the rate a little
        top = Top(inertia, q, w_start, torque, rate)
        rate = -top.torque / top.segment
    time = 3.0 * top.segment
    q_exact, w_exact = reference(inertia, q, w_start, [time], top.torque, top.rate)[0]
    q_now, w_now = top.at(time)
    assert angle_between(q_now, q_exact) < ROUND_OFF * EPS * (1.0 + time)
    assert w_now == pytest.approx(w_exact, abs=ROUND_OFF * EPS * (1.0 + time))


components = st.one_of(st.floats(-1.0, 1.0), st.sampled_from([0.0, 1e-9, -1e-5]))
vectors = st.tuples(components, components, components).filter(lambda v: max(map(abs, v)) > 1e-3).map(np.array)
quaternions = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: sum(x * x for x in q) > 1e-2).map(np.array)


@st.composite
def tops(draw):
    """Real bodies of any scale; torques and rates up to those that turn the body as fast as its spin does."""
    low = 10.0 ** draw(st.floats(-6.0, 0.0))
    share = draw(st.floats(0.0, 1.0))
    middle = 1.0 - share * low if low < 0.5 else low + share * (1.0 - low)
    inertia = np.array(draw(st.permutations([low, middle, 1.0]))) * 10.0 ** draw(st.integers(-12, 12))
    q = draw(quaternions)
    spin = 10.0 ** draw(st.integers(-6, 4))
    torque = draw(vectors) * inertia.min() * spin**2 * 10.0 ** draw(st.integers(-12, 0))
    rate = draw(vectors) * inertia.min() * spin**3 * 10.0 ** draw(st.integers(-12, 0))
    torque, rate = draw(st.sampled_from([(torque, 0.0 * rate), (0.0 * torque, rate), (torque, rate)]))
    return Top(inertia, q / np.linalg.norm(q), draw(vectors) * spin, torque, rate), spin


@settings(deadline=None, derandomize=True, max_examples=200)
@given(tops(), st.floats(0.0, 3.0))
def test_angular_momentum_grows_with_the_torque(top_and_spin, turned):
    """To the round-off of the spin, |w| eps, times the largest moment."""
    top, spin = top_and_spin
    time = turned / spin
    q, w = top.at(time)
    start = rotate(top.q, top.inertia * rotate_inverse(top.q, top.w))
    momentum = rotate(q, top.inertia * rotate_inverse(q, w))
    scale = top.inertia.max() * (np.linalg.norm(w) + np.linalg.norm(top.w) + spin)
    impulse = top.torque * time + 0.5 * top.rate * time**2
    assert np.abs(momentum - start - impulse).max() <= ROUND_OFF * EPS * (1.0 + turned) * scale


@settings(deadline=None, derandomize=True, max_examples=200)
@given(tops(), st.floats(0.01, 3.0))
def test_orientation_follows_the_spin(top_and_spin, turned):
    """q' = w q / 2, by a central difference over 2h = 2e-4 / |w|: error of order (h |w|)^2 = 1e-8 and eps / h."""
    top, spin = top_and_spin
    time, h = turned / spin, 1e-4 / spin
    before, (_, w), after = top.at(time - h), top.at(time), top.at(time + h)
    measured = rotation_vector(multiply(after[0], conjugate(before[0]))) / (2.0 * h)
    assert np.abs(measured - w).max() < 1e-7 * (np.linalg.norm(w) + spin)
