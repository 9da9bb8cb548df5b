"""Rotation without torque, in closed form.

Law. I w' = I w x w in the body, q' = q w / 2: angular momentum and kinetic energy are constant in the world.
Tolerance. Nothing is integrated, so the error is the round-off of the phases lambda t, p t and of the Jacobi functions:
ROUND_OFF eps (1 + |w| t), with |w| t the angle turned. The classical method of order 4 with 100 steps a turn is off by
2e-6 after 164 rad; swapped moments, a wrong quadrant or a lost period are off by radians.
"""

from __future__ import annotations

import mpmath
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
    quaternion_from_rotation_vector,
    rotate,
    rotate_inverse,
    rotation_vector,
)
from rigidimpulse.motion import free_rotation

EPS = np.finfo(float).eps
ROUND_OFF = 32.0
TILTED = np.array([0.3, -0.5, 0.7, 0.4]) / np.linalg.norm([0.3, -0.5, 0.7, 0.4])
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class Top:
    """A body that rotates freely, ready to be evaluated."""

    def __init__(self, inertia, q, w_world):
        self.inertia, self.q, self.w = (np.asarray(value, dtype=float) for value in (inertia, q, w_world))
        self.constants = np.zeros(free_rotation.FREE_ROTATION_SIZE)
        free_rotation.prepare(self.inertia, self.q, self.w, self.constants)

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        q, w = np.empty(4), np.empty(3)
        free_rotation.evaluate(self.constants, float(time), q, w)
        return q, w

    @property
    def kind(self) -> float:
        return self.constants[0]


def turned_tolerance(w, time: float) -> float:
    return ROUND_OFF * EPS * (1.0 + np.linalg.norm(w) * time)


def assert_matches_reference(inertia, q, w_world, times, factor: float = 1.0) -> None:
    top = Top(inertia, q, w_world)
    for time, (q_exact, w_exact) in zip(times, reference(inertia, q, w_world, times), strict=True):
        q_now, w_now = top.at(time)
        tolerance = factor * turned_tolerance(w_world, time)
        assert angle_between(q_now, q_exact) < tolerance, time
        assert np.linalg.norm(w_now - w_exact) < tolerance * np.linalg.norm(w_world), time


@pytest.mark.parametrize(
    ("inertia", "w_world"),
    [((3.0, 2.0, 1.0), (0.5, 1.2, -1.0)), ((0.4, 0.9, 1.1), (1.0, -0.3, 0.8)), ((1.0, 0.2, 1.15), (0.2, 1.4, 0.1))],
)
def test_asymmetric_top_over_100_seconds(inertia, w_world):
    """Required: 1e-9 rad. About 150 rad are turned, so 1e-12 is left for round-off."""
    assert_matches_reference(inertia, TILTED, w_world, [1e-3, 0.1, 1.0, 10.0, 100.0])


HARD = {
    "thin rod": ((1e-6, 1.0, 1.0000005), TILTED, (0.4, 0.8, -0.6)),
    "thin rod that tumbles": ((1e-6, 1.0, 1.0000005), UPRIGHT, (1e-6, 1.0, 0.2)),
    "needle": ((1e-13, 1.0, 1.00000000000005), UPRIGHT, (0.3, 1.0, 0.2)),
    "flat disc": ((0.5, 0.500001, 1.0), UPRIGHT, (1.0, 0.5, 0.2)),
    "nearly symmetric about the largest": ((1.0, 1.0 + 1e-12, 2.0), TILTED, (0.4, 0.8, -0.6)),
    "nearly symmetric about the smallest": ((1.0, 2.0, 2.0 * (1.0 + 1e-8)), TILTED, (0.4, 0.8, -0.6)),
    "nearly symmetric, across its axis": ((1.0, 1.0 + 1e-8, 2.0), UPRIGHT, (0.6, 0.8, 1e-9)),
    "nearly spherical": ((1.0, 1.0 + 1e-8, 1.0 + 3e-8), TILTED, (0.4, 0.8, -0.6)),
    "near the largest axis": ((1.0, 2.0, 3.0), UPRIGHT, (1e-9, 5e-10, -1.0)),
    "near the smallest axis": ((1.0, 2.0, 3.0), UPRIGHT, (-1.0, 5e-15, 1e-15)),
    "near the middle axis": ((1.0, 2.0, 3.0), UPRIGHT, (1e-6, 1.0, 5e-7)),
    "on the separatrix": ((2.0, 3.0, 6.0), UPRIGHT, (3.0, 0.5, 1.0)),
    "no triangle inequality": ((0.1, 0.2, 1.0), UPRIGHT, (0.3, 0.2, 0.1)),
    "slow": ((3.0, 2.0, 1.0), TILTED, (0.5e-12, 1.2e-12, -1.0e-12)),
    "fast": ((3.0, 2.0, 1.0), TILTED, (0.5e6, 1.2e6, -1.0e6)),
    "light": ((3e-30, 2e-30, 1e-30), TILTED, (0.5, 1.2, -1.0)),
}


@pytest.mark.parametrize("name", HARD)
def test_hard_cases_against_reference(name):
    inertia, q, w_world = HARD[name]
    spin = np.linalg.norm(w_world)
    # On the separatrix e^(p t) of any perturbation is left, here of the round-off of three steps: p = 1 1/s.
    assert_matches_reference(inertia, q, w_world, np.array([0.01, 1.0, 15.0, 40.0]) / spin)


def test_separatrix_is_hyperbolic():
    """On it sn, cn, dn are tanh, sech, sech of u = p t + u0, and the body ends on its middle axis.

    I1 (I2 - I1) w1^2 = I3 (I3 - I2) w3^2 is the separatrix; the energy gives w2 at the end, Euler's equation for w1 p.
    """
    inertia, w_start = np.array([2.0, 3.0, 6.0]), np.array([3.0, 0.5, 1.0])
    top = Top(inertia, UPRIGHT, w_start)
    w_end = np.sqrt((inertia @ w_start**2) / inertia[1])
    start = np.arctanh(w_start[1] / w_end)
    p = (inertia[2] - inertia[1]) / inertia[0] * w_start[2] / w_start[0] * w_end
    for time in (0.0, 0.3, 2.0, 8.0, 30.0):
        u = start + p * time
        share = np.cosh(start) / np.cosh(u)
        expected = np.array([share * w_start[0], w_end * np.tanh(u), share * w_start[2]])
        q, w = top.at(time)
        assert rotate_inverse(q, w) == pytest.approx(expected, abs=turned_tolerance(w_start, time) * w_end)


@pytest.mark.parametrize("disturbance", [1e-2, 1e-3, 1e-6, 1e-9])
def test_dzhanibekov_flips(disturbance):
    """Moments 1, 2, 3, spin about the middle axis: it flips every half period, 2 K(m) / p.

    Starting with w3 = 0, the moment of greatest change is K / p later, when w2 = 0 while |w2'| = p w2: the error of w2
    there is the error of the phase. m is up to 1 - 1e-18, which takes extended precision to write down.
    """
    low, middle, high = 1, 2, 3
    w = np.array([disturbance, 1.0, 0.0])
    top = Top((low, middle, high), UPRIGHT, w)
    with mpmath.workdps(60):
        spin = mpmath.matrix([float(value) for value in w])
        momentum2 = (low * spin[0]) ** 2 + (middle * spin[1]) ** 2
        energy2 = low * spin[0] ** 2 + middle * spin[1] ** 2
        p2 = (middle - low) * (energy2 * high - momentum2) / (low * middle * high)
        m = (high - middle) * (momentum2 - energy2 * low) / ((middle - low) * (energy2 * high - momentum2))
        quarter = float(mpmath.ellipk(m) / mpmath.sqrt(p2))
    tolerance = turned_tolerance(w, quarter)
    for count, expected in ((2, -1.0), (4, 1.0), (10, -1.0)):
        q, w_crossing = top.at((count - 1) * quarter)
        assert abs(rotate_inverse(q, w_crossing)[1]) < count * tolerance
        q, w_flipped = top.at(count * quarter)
        assert rotate_inverse(q, w_flipped) == pytest.approx([disturbance, expected, 0.0], abs=count * tolerance)


def test_middle_axis_without_disturbance_does_not_flip():
    """Round-off of the spin in the world is no disturbance."""
    w = rotate(TILTED, [0.0, 3.0, 0.0])
    top = Top((1.0, 2.0, 3.0), TILTED, w)
    q, w_later = top.at(1000.0)
    assert np.array_equal(w_later, w)
    assert angle_between(q, multiply(quaternion_from_axis_angle(w, 3000.0), TILTED)) < turned_tolerance(w, 1000.0)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("inertia", [(1.0, 2.0, 3.0), (2.0, 2.0, 3.0), (2.0, 2.0, 2.0)])
def test_principal_axes(inertia, axis):
    w_body = np.zeros(3)
    w_body[axis] = -2.0
    q, w = Top(inertia, UPRIGHT, w_body).at(50.0)
    expected = quaternion_from_axis_angle(np.eye(3)[axis], -100.0)
    assert w == pytest.approx(w_body, abs=turned_tolerance(w_body, 0.0))
    assert angle_between(q, expected) < turned_tolerance(w_body, 50.0)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("ratio", [0.01, 0.5, 1.7, 2.0])
def test_symmetric_top_precesses(axis, ratio):
    """In the body, w turns about the axis at (I3 / I1 - 1) w3; in the world, the axis turns about L at L / I1."""
    inertia = np.full(3, 0.7)
    inertia[axis] *= ratio
    w_start = np.array([0.8, -1.1, 0.6])
    top = Top(inertia, TILTED, rotate(TILTED, w_start))
    assert top.kind == free_rotation.SYMMETRIC
    unit = np.eye(3)[axis]
    momentum = rotate(TILTED, inertia * w_start)
    for time in (0.01, 1.0, 77.0):
        q, w = top.at(time)
        precession = quaternion_from_axis_angle(unit, (ratio - 1.0) * w_start[axis] * time)
        tolerance = turned_tolerance(momentum / inertia.min(), time)
        assert rotate_inverse(q, w) == pytest.approx(rotate(precession, w_start), abs=tolerance)
        nutation = quaternion_from_rotation_vector(momentum / 0.7 * time)
        expected = multiply(multiply(nutation, TILTED), conjugate(precession))
        assert angle_between(q, expected) < tolerance


def test_limits_of_the_asymmetric_form_agree_with_the_elementary_ones():
    """Moments one part in 1e14 apart take the elliptic path, equal ones the elementary: both give the same motion."""
    w = np.array([0.8, -1.1, 0.6])
    for equal in ((1.0, 1.0, 1.8), (1.0, 1.8, 1.8), (1.8, 1.8, 1.8)):
        apart = np.array(equal) * (1.0 + np.array([0.0, 2e-14, 5e-14]))
        assert Top(apart, TILTED, w).kind == free_rotation.ASYMMETRIC
        for time in (0.5, 20.0):
            q_equal, _ = Top(equal, TILTED, w).at(time)
            q_apart, _ = Top(apart, TILTED, w).at(time)
            # Rates differ by the relative difference of the moments.
            assert angle_between(q_equal, q_apart) < turned_tolerance(w, time) + 1e-13 * np.linalg.norm(w) * time


def test_no_spin_keeps_every_bit():
    q = np.array([0.5, -0.5, -0.0, 0.70710678])
    q_later, w_later = Top((1.0, 2.0, 3.0), q, np.zeros(3)).at(1e9)
    assert q_later.tobytes() == q.tobytes()
    assert not w_later.any()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_ends_and_stays_so(bad):
    q, w = Top((1.0, 2.0, 3.0), TILTED, (0.3, bad, 0.1)).at(2.0)
    assert not np.isfinite(np.concatenate([q, w])).all()


ratios = st.floats(-6.0, 0.0).map(lambda exponent: 10.0**exponent)
components = st.one_of(st.floats(-1.0, 1.0), st.sampled_from([0.0, 1e-9, -1e-5, 1e-200]))
vectors = st.tuples(components, components, components).filter(lambda v: max(map(abs, v)) > 1e-3).map(np.array)
quaternions = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: sum(x * x for x in q) > 1e-2).map(np.array)


@st.composite
def tops(draw):
    """Tops of real bodies: the largest moment is at most the sum of the others. Any scale, any order of the axes."""
    low, share = draw(st.one_of(ratios, st.just(1.0))), draw(st.one_of(st.floats(0.0, 1.0), st.just(0.0), st.just(1.0)))
    middle = 1.0 - share * low if low < 0.5 else low + share * (1.0 - low)
    inertia = np.array(draw(st.permutations([low, middle, 1.0]))) * 10.0 ** draw(st.integers(-12, 12))
    q = draw(quaternions)
    return Top(inertia, q / np.linalg.norm(q), draw(vectors) * 10.0 ** draw(st.integers(-12, 6)))


@settings(deadline=None, derandomize=True, max_examples=200)
@given(tops(), st.floats(0.0, 1000.0))
def test_angular_momentum_and_energy_are_constant(top, turned):
    """Both to the round-off of the world spin itself, |w| eps, times the largest moment; however long the flight.

    Much of it is the turn from the world to the body in this test: q has unit length to 2 eps, which enters 16 times.
    """
    spin = np.linalg.norm(top.w)
    states = [top.at(turned * k / spin) for k in (0.0, 0.37, 1.0)]
    w_body = [rotate_inverse(q, w) for q, w in states]
    momenta = np.array([rotate(q, top.inertia * w) for (q, _), w in zip(states, w_body, strict=True)])
    energies = np.array([top.inertia @ w**2 for w in w_body])
    scale = top.inertia.max() * spin
    assert np.abs(momenta - momenta[0]).max() <= 2.0 * ROUND_OFF * EPS * scale
    assert np.abs(energies - energies[0]).max() <= 2.0 * ROUND_OFF * EPS * scale * spin
    assert all(abs(np.linalg.norm(q) - 1.0) < 6.0 * EPS for q, _ in states)


@settings(deadline=None, derandomize=True, max_examples=200)
@given(tops(), st.floats(0.01, 100.0))
def test_orientation_follows_the_spin(top, turned):
    """q' = w q / 2, by a central difference over 2h = 2e-4 / |w|: error of order (h |w|)^2 = 1e-8 and eps / h."""
    spin = np.linalg.norm(top.w)
    time, h = turned / spin, 1e-4 / spin
    before, (_, w), after = top.at(time - h), top.at(time), top.at(time + h)
    measured = rotation_vector(multiply(after[0], conjugate(before[0]))) / (2.0 * h)
    assert np.abs(measured - w).max() < 1e-7 * spin


@settings(deadline=None, derandomize=True, max_examples=200)
@given(tops(), st.floats(0.0, 30.0))
def test_start_is_reproduced_and_signs_are_continuous(top, turned):
    spin = np.linalg.norm(top.w)
    q, w = top.at(0.0)
    assert np.abs(q - top.q).max() < ROUND_OFF * EPS
    assert np.abs(w - top.w).max() < ROUND_OFF * EPS * spin
    assert top.at(turned / spin)[0] @ top.at((turned + 0.1) / spin)[0] > 0.99
