"""Quaternions: kernels and array helpers against each other, against scipy, and at the hard ends.

Tolerance. Each helper is a few dozen products and sums of numbers of order one: 16 eps.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rigidimpulse.core import quaternion as rotation

EPS = np.finfo(float).eps
TOLERANCE = 16 * EPS

quaternions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .filter(lambda q: sum(x * x for x in q) > 1e-2)
    .map(lambda q: np.array(q) / np.linalg.norm(q))
)
vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)
once = settings(deadline=None, derandomize=True, max_examples=100)


def scipy_rotation(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


@once
@given(quaternions, quaternions, vectors)
def test_algebra_agrees_with_scipy(a, b, v):
    assert rotation.rotate(a, v) == pytest.approx(scipy_rotation(a).apply(v), abs=10 * TOLERANCE)
    assert rotation.rotate_inverse(a, rotation.rotate(a, v)) == pytest.approx(v, abs=10 * TOLERANCE)
    product = scipy_rotation(a) * scipy_rotation(b)
    assert rotation.to_matrix(rotation.multiply(a, b)) == pytest.approx(product.as_matrix(), abs=TOLERANCE)
    assert rotation.multiply(a, rotation.conjugate(a)) == pytest.approx([1, 0, 0, 0], abs=TOLERANCE)


@once
@given(quaternions, quaternions, vectors)
def test_kernels_agree_with_array_helpers(a, b, v):
    out, matrix, turned = np.empty(4), np.empty((3, 3)), np.empty(3)
    out[:] = rotation.product(*a, *b)
    assert out == pytest.approx(rotation.multiply(a, b), abs=TOLERANCE)
    rotation.quaternion_to_matrix(a, matrix)
    assert matrix == pytest.approx(rotation.to_matrix(a), abs=TOLERANCE)
    turned[:] = rotation.rotated(*a, *v)
    assert turned == pytest.approx(rotation.rotate(a, v), abs=10 * TOLERANCE)
    turned[:] = rotation.rotated(a[0], *-a[1:], *turned)
    assert turned == pytest.approx(v, abs=10 * TOLERANCE)
    out[:] = rotation.exponential(*v)
    expected = rotation.quaternion_from_rotation_vector(v)
    assert out == pytest.approx(expected, abs=10 * TOLERANCE)


@once
@given(quaternions)
def test_matrix_and_back(q):
    matrix = rotation.to_matrix(q)
    for back in (rotation.from_columns(*map(tuple, matrix.T)), rotation.from_matrix(matrix)):
        assert back[0] >= 0.0
        assert abs(np.linalg.norm(back) - 1.0) < 4 * EPS
        assert rotation.angle_between(back, q) < TOLERANCE


def test_matrix_of_half_turns():
    """The trace is -1: the scalar part is 0 and the largest of the others must carry the rest."""
    for axis in (*np.eye(3), [0.6, -0.8, 0.0], [0.1, 0.2, np.sqrt(0.95)]):
        q = rotation.quaternion_from_axis_angle(axis, np.pi)
        for back in (rotation.from_columns(*map(tuple, rotation.to_matrix(q).T)), rotation.from_matrix(rotation.to_matrix(q))):
            assert rotation.angle_between(back, q) < TOLERANCE


@once
@given(quaternions, st.floats(-300.0, 0.0), vectors.filter(lambda v: np.linalg.norm(v) > 0.1))
def test_small_angles_keep_their_digits(q, exponent, axis):
    """A turn by 1e-300 to 1 rad is measured to the round-off of the orientation; relative to upright, of itself."""
    angle = 10.0**exponent
    turn = rotation.quaternion_from_axis_angle(axis, angle)
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    assert rotation.angle_between(upright, turn) == pytest.approx(angle, rel=TOLERANCE)
    assert rotation.angle_between(q, rotation.multiply(q, turn)) == pytest.approx(angle, abs=TOLERANCE, rel=TOLERANCE)
    vector = angle * axis / np.linalg.norm(axis)
    assert rotation.rotation_vector(turn) == pytest.approx(vector, rel=TOLERANCE, abs=1e-310)
    out = np.empty(4)
    out[:] = rotation.exponential(*vector)
    assert out == pytest.approx(turn, rel=TOLERANCE, abs=1e-310)


def test_rotation_vector_takes_the_short_way():
    q = rotation.quaternion_from_axis_angle([0.0, 0.0, 1.0], 1.5 * np.pi)
    assert rotation.rotation_vector(q) == pytest.approx([0.0, 0.0, -0.5 * np.pi], abs=TOLERANCE)
    assert rotation.rotation_vector([1.0, 0.0, 0.0, 0.0]) == pytest.approx(np.zeros(3), abs=0)


def test_no_rotation_is_exact():
    out = np.empty(4)
    out[:] = rotation.exponential(0.0, 0.0, 0.0)
    assert np.array_equal(out, [1.0, 0.0, 0.0, 0.0])
    assert np.array_equal(rotation.quaternion_from_rotation_vector(np.zeros(3)), [1.0, 0.0, 0.0, 0.0])


def test_continuity_removes_sign_flips_and_nothing_else():
    angles = np.linspace(0.0, 40.0, 200)
    smooth = rotation.quaternion_from_axis_angle([1.0, 2.0, -1.0], angles)
    signs = np.where(np.random.default_rng(7).random(200) < 0.5, -1.0, 1.0)
    signs[0] = 1.0
    flipped = smooth * signs[:, None]
    assert np.array_equal(rotation.quaternion_continuity(flipped), smooth)
    assert np.array_equal(flipped, smooth * signs[:, None]), "the input is kept"
    assert rotation.quaternion_continuity(np.empty((0, 4))).shape == (0, 4)


def test_leading_axes():
    rng = np.random.default_rng(3)
    q = rotation.normalize(rng.normal(size=(5, 7, 4)))
    v = rng.normal(size=(7, 3))
    assert rotation.rotate(q, v)[2, 3] == pytest.approx(rotation.rotate(q[2, 3], v[3]), abs=TOLERANCE)
    assert rotation.multiply(q, q[0])[4, 1] == pytest.approx(rotation.multiply(q[4, 1], q[0, 1]), abs=TOLERANCE)
    assert rotation.to_matrix(q).shape == (5, 7, 3, 3)
    assert rotation.angle_between(rotation.from_matrix(rotation.to_matrix(q)), q).max() < TOLERANCE
    assert rotation.quaternion_from_axis_angle(v, 0.3).shape == (7, 4)
    assert rotation.quaternion_from_axis_angle([0, 0, 1], np.zeros((2, 3))).shape == (2, 3, 4)


def test_bad_input_is_refused():
    for bad in ([0.0, 0.0, 0.0, 0.0], [np.nan, 0.0, 0.0, 1.0], [np.inf, 0.0, 0.0, 1.0]):
        with pytest.raises(ValueError, match="finite and not zero"):
            rotation.normalize(bad)
    with pytest.raises(ValueError, match="axis"):
        rotation.quaternion_from_axis_angle([0.0, 0.0, 0.0], 1.0)
    assert rotation.normalize([1e-300, 0.0, 0.0, 0.0]) == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=0)
