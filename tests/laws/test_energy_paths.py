"""Paths of least energy against closed forms.

Laws. From rest to rest over a way d in T the least integral of |x''|^2 is 12 d^2 / T^3, on the cubic d (3 s^2 - 2 s^3), s = t / T; that of
frames h apart is 1 + 2 (h / T)^2 times less, in closed form, so energies are right to rounding and positions to second order: halving h
must quarter the error, which is 0.58 d (h / T)^2. Through frames that are held the least is the cubic spline (scipy), natural at free
ends, clamped at given velocities. With `StayNear` of weight a and `Curvature` of weight c a long wave of frequency w comes out
1 / (1 + (c / a) k^4) times as high, k = 2 sin(w h / 2) / h. Rotations: the least squared rate between two held frames is the turn about one
axis at a constant rate, integral angle^2 / T. A rotation about one fixed axis follows the laws of positions. Gradients are the derivatives
of values: central differences leave 1e-9. The system of 2,000 frames loses 6 digits, squared away it would lose 12: bounds of 1e-10 tell.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import rigidimpulse as ri
from rigidimpulse.core.quaternion import angle_between, conjugate, multiply, normalize, quaternion_from_rotation_vector, rotation_vector
from rigidimpulse.dynamics.forces.energy.path import SmoothPath
from rigidimpulse.dynamics.forces.energy.path_rows import Frames, Weights, rotation_terms

REST = (0.0, 0.0, 0.0)
ENDS = [ri.PinFrame(0), ri.PinFrame(-1)]
WAY, TIME = np.array([3.0, 0.0, 1.0]), 2.0


def from_rest_to_rest(frames: int) -> tuple[np.ndarray, SmoothPath]:
    """The path between two places, from a zig-zag, and the share of time that has gone."""
    share = np.linspace(0.0, 1.0, frames)
    zigzag = np.outer(share, WAY) + 0.1 * (-1.0) ** np.arange(frames)[:, None] * (share * (1.0 - share) > 0.0)[:, None]
    energies = [ri.Curvature(2.0, start_velocity=REST, end_velocity=REST), *ENDS]
    return share, ri.smooth_path(TIME * share, zigzag, energies=energies)


@pytest.mark.parametrize("frames", [5, 40, 1001])
def test_the_curvature_falls_to_the_analytic_optimum(frames: int) -> None:
    share, path = from_rest_to_rest(frames)
    discrete = 1.0 / (1.0 + 2.0 / (frames - 1) ** 2)
    np.testing.assert_allclose(path.report.value, 12.0 * WAY @ WAY / TIME**3 * discrete, rtol=1e-10)
    cubic = np.outer(3.0 * share**2 - 2.0 * share**3, WAY)
    # 0.58 of d (h / T)^2 on fine frames, more on coarse ones.
    np.testing.assert_allclose(path.positions, cubic, rtol=0, atol=0.75 * np.linalg.norm(WAY) / (frames - 1) ** 2)


def test_the_discrete_optimum_converges_at_second_order() -> None:
    def error(frames: int) -> float:
        share, path = from_rest_to_rest(frames)
        return float(np.abs(path.positions - np.outer(3.0 * share**2 - 2.0 * share**3, WAY)).max())

    errors = np.array([error(frames) for frames in (21, 41, 81, 161)])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, atol=0.05)


@pytest.mark.parametrize("clamped", [False, True])
def test_through_held_frames_goes_the_cubic_spline(clamped: bool) -> None:
    places = np.random.default_rng(4).normal(0.0, 1.0, (5, 3))
    start, end = np.array([1.0, 2, 3]), np.array([0.0, -1, 2])
    curvature = ri.Curvature(3.0, start_velocity=start, end_velocity=end) if clamped else ri.Curvature(3.0)
    spline = CubicSpline(np.arange(5.0), places, bc_type=((1, start), (1, end)) if clamped else "natural")

    def error(per_key: int) -> float:
        t = np.linspace(0.0, 4.0, 4 * per_key + 1)
        pins = [ri.PinFrame(k * per_key, place) for k, place in enumerate(places)]
        path = ri.smooth_path(t, np.zeros((len(t), 3)), energies=[curvature, *pins])
        np.testing.assert_allclose(path.positions[::per_key], places, rtol=0, atol=1e-15)
        return float(np.abs(path.positions - spline(t)).max())

    coarse, fine = error(20), error(40)
    assert fine < 1e-3 and abs(np.log2(coarse / fine) - 2.0) < 0.1


def test_uneven_frames_hold_straight_lines_and_parabolas() -> None:
    """A steady straight path has no curvature, and the least squared speed."""
    random = np.random.default_rng(0)
    t = np.concatenate([[0.0], np.cumsum(random.uniform(0.01, 0.1, 40))])
    line = np.outer(t, (1.0, -2.0, 0.5)) + (1, 1, 1)
    held = [ri.PinFrame(3, line[3]), ri.PinFrame(30, line[30])]
    path = ri.smooth_path(t, random.normal(size=line.shape), energies=[ri.Curvature(1.0), *held])
    np.testing.assert_allclose(path.positions, line, rtol=0, atol=1e-11)
    assert path.report.value < 1e-18
    ends = [ri.PinFrame(0, line[0]), ri.PinFrame(40, line[40])]
    path = ri.smooth_path(t, random.normal(size=line.shape), energies=[ri.Velocity(1.0), *ends])
    np.testing.assert_allclose(path.positions, line, rtol=0, atol=1e-12)
    speed = np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(path.report.value, 0.5 * speed @ speed * t[-1], rtol=1e-12)


@pytest.mark.parametrize("cycles", [4, 20])
def test_waves_pass_as_the_smoothing_spline_lets_them(cycles: int) -> None:
    frames, stiff = 2001, 1e-6
    t = np.linspace(0.0, 10.0, frames)
    h, frequency = t[1], 2.0 * np.pi * cycles / 10.0
    wave = np.stack([np.sin(frequency * t), np.cos(frequency * t), np.zeros(frames)], axis=1)
    path = ri.smooth_path(t, wave, energies=[ri.StayNear(3.0), ri.Curvature(3.0 * stiff)])
    k = 2.0 * np.sin(0.5 * frequency * h) / h
    # Free ends are felt over some lengths (c / a)^(1/4) = 0.03: none at 2.
    inner = slice(400, -400)
    np.testing.assert_allclose(path.positions[inner], wave[inner] / (1.0 + stiff * k**4), rtol=0, atol=1e-10)


def test_a_thousand_frames_lose_no_digits() -> None:
    """The same path in one piece and in two: where a frame and, by symmetry, the velocity there are known, both must agree."""
    _, path = from_rest_to_rest(2001)
    middle = path.positions[1000]
    np.testing.assert_allclose(middle, 0.5 * WAY, rtol=0, atol=1e-10)
    np.testing.assert_allclose(path.positions + path.positions[::-1], np.broadcast_to(WAY, (2001, 3)), rtol=0, atol=1e-10)


def noisy(frames: int, size: float = 0.1) -> np.ndarray:
    random = np.random.default_rng(frames)
    steady = quaternion_from_rotation_vector(np.outer(np.linspace(0.0, 2.0, frames), (0.3, 0.8, -0.5)))
    return multiply(steady, quaternion_from_rotation_vector(random.normal(0.0, size, (frames, 3))))


@pytest.mark.parametrize("frames", [3, 30, 300])
def test_the_least_rate_is_the_turn_about_one_axis(frames: int) -> None:
    t, q = np.linspace(0.0, TIME, frames), noisy(frames)
    path = ri.smooth_path(t, np.zeros((frames, 3)), q, [ri.Velocity(angular_weight=2.0), *ENDS])
    assert path.report.ok, path.report.message
    turn = rotation_vector(multiply(conjugate(q[0]), q[-1]))
    expected = multiply(q[0], quaternion_from_rotation_vector(t[:, None] / TIME * turn))
    assert angle_between(path.orientations, expected).max() < 1e-9
    np.testing.assert_allclose(path.report.value, turn @ turn / TIME, rtol=1e-10)


def test_turns_about_one_axis_follow_the_laws_of_positions() -> None:
    """All three energies at once: angles in place of the places along a line."""
    random = np.random.default_rng(7)
    t, axis = np.cumsum(random.uniform(0.05, 0.15, 40)), np.array([2.0, -1.0, 2.0]) / 3.0
    angle = np.cumsum(random.normal(0.0, 0.3, 40))
    pins = [ri.PinFrame(5), ri.PinFrame(20)]
    places = ri.smooth_path(t, np.outer(angle, axis), energies=[ri.StayNear(1.0), ri.Velocity(0.1), ri.Curvature(0.01), *pins])
    angular = [ri.StayNear(0.0, 1.0), ri.Velocity(0.0, 0.1), ri.Curvature(0.0, 0.01), *pins]
    turns = ri.smooth_path(t, np.zeros((40, 3)), quaternion_from_rotation_vector(np.outer(angle, axis)), angular)
    assert turns.report.ok, turns.report.message
    assert angle_between(turns.orientations, quaternion_from_rotation_vector(places.positions)).max() < 1e-9
    np.testing.assert_allclose(turns.report.value, places.report.value, rtol=1e-10)
    np.testing.assert_array_equal(turns.positions, 0.0)


@pytest.mark.parametrize("weights", [(2.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 4.0), (1.0, 2.0, 3.0)])
def test_the_gradient_of_rotations_is_the_derivative_of_the_value(weights: tuple[float, float, float]) -> None:
    random = np.random.default_rng(2)
    frames, given = Frames(random.uniform(0.3, 1.0, 8), np.array([], int)), noisy(9, 1.0)
    q = normalize(given + random.normal(0.0, 0.2, (9, 4)))

    def value(step: np.ndarray) -> float:
        return rotation_terms(frames, Weights(*weights), given, multiply(q, quaternion_from_rotation_vector(step.reshape(9, 3)))).value

    found = rotation_terms(frames, Weights(*weights), given, q).gradient
    numeric = np.array([(value(step) - value(-step)) / 2e-6 for step in 1e-6 * np.eye(27)])
    np.testing.assert_allclose(found, numeric, rtol=0, atol=1e-8 * np.abs(numeric).max())


def test_what_has_no_weight_stays_and_what_is_held_holds() -> None:
    t, q = np.linspace(0.0, 1.0, 20), noisy(20)
    x = np.random.default_rng(1).normal(size=(20, 3))
    turn = (0.0, 2.0, 0.0, 0.0)
    path = ri.smooth_path(t, x, q, [ri.Curvature(1.0), ri.PinFrame(3, (1, 2, 3), turn), ri.PinFrame(-2)])
    np.testing.assert_array_equal(path.positions[[3, 18]], [(1, 2, 3), x[18]])
    assert angle_between(np.delete(path.orientations, 3, 0), np.delete(q, 3, 0)).max() < 1e-15
    assert angle_between(path.orientations[3], (0, 1, 0, 0)) < 1e-15
    keys = path.keyframes(t)
    keys.check()
    assert ri.smooth_path(t, x, energies=[ri.StayNear(1.0)]).orientations is None


def test_the_order_of_energies_plays_no_part() -> None:
    t, q, x = np.linspace(0.0, 1.0, 30), noisy(30), np.random.default_rng(1).normal(size=(30, 3))
    energies = [ri.StayNear(1.0, 1.0), ri.PinFrame(7), ri.Curvature(1e-3, 1e-3), ri.Velocity(0.1, 0.1), ri.PinFrame(20)]
    one, other = ri.smooth_path(t, x, q, energies), ri.smooth_path(t, x, q, energies[::-1])
    np.testing.assert_array_equal(one.positions, other.positions)
    np.testing.assert_array_equal(one.orientations, other.orientations)


@pytest.mark.parametrize(
    ("energies", "words"),
    [
        ([], "no energy acts on the path"),
        (ri.Curvature(1.0), "give a list"),
        ([ri.NoOverlap()], "is no energy of paths"),
        ([ri.Curvature(1.0), ri.Curvature(2.0)], "Curvature comes twice"),
        ([ri.Velocity()], "Velocity: neither weight"),
        ([ri.StayNear(-1.0)], "StayNear: weight is -1.0"),
        ([ri.StayNear(1.0, np.nan)], "StayNear: angular_weight is nan"),
        ([ri.Curvature(1.0, start_velocity=(1, 0))], "Curvature: start_velocity is"),
        ([ri.Curvature(0.0, 1.0, end_velocity=(1, 0, 0))], "but no weight"),
        ([ri.Curvature(1.0), ri.PinFrame(0)], "undetermined with 1 frame held; hold 2"),
        ([ri.Velocity(1.0)], "energies of velocities leave the positions undetermined with 0 frames"),
        ([ri.Curvature(angular_weight=1.0), ri.PinFrame(0)], "leave the orientations undetermined"),
        ([ri.StayNear(1.0), ri.PinFrame(9)], "frame is 9; give a whole number from -9 to 8"),
        ([ri.StayNear(1.0), ri.PinFrame(0.5)], "frame is 0.5"),
        ([ri.StayNear(1.0), ri.PinFrame(8), ri.PinFrame(-1)], "frame 8 is held twice"),
        ([ri.StayNear(1.0), ri.PinFrame(0, (0, 0))], r"PinFrame\(0\): position is"),
        ([ri.StayNear(1.0), ri.PinFrame(0, orientation=(0, 0, 0, 0))], r"PinFrame\(0\): orientation is"),
    ],
)
def test_bad_energies_are_refused(energies: list, words: str) -> None:
    with pytest.raises(ri.SceneError, match=words):
        ri.smooth_path(np.arange(9.0), np.zeros((9, 3)), noisy(9), energies)


def test_bad_paths_are_refused() -> None:
    energies = [ri.StayNear(1.0)]
    for arguments, words in (
        (([0.0, 0.0], np.zeros((2, 3))), "times do not increase"),
        (([0.0, 1.0], np.zeros((3, 3))), "2 times but 3 positions"),
        (([0.0], np.zeros((1, 3))), "give two or more"),
        (([0.0, 1.0], [[0, 0, 0], [0, 0, np.nan]]), "finite numbers"),
        (([0.0, 1.0], np.zeros((2, 3)), np.zeros((2, 4))), "all zero"),
    ):
        with pytest.raises(ri.SceneError, match=words):
            ri.smooth_path(*arguments, energies=energies)
    with pytest.raises(ri.SceneError, match="but the path has none"):
        ri.smooth_path([0.0, 1.0], np.zeros((2, 3)), energies=[*energies, ri.PinFrame(0, orientation=(1, 0, 0, 0))])


def test_import_does_not_load_the_minimisers() -> None:
    import subprocess
    import sys

    code = "import sys, rigidimpulse as ri; ri.Scene; ri.simulate; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "rigidimpulse.engine.simulate" in loaded
    assert not [name for name in loaded if name.startswith(("scipy.optimize", "rigidimpulse.dynamics.forces.energy"))]
