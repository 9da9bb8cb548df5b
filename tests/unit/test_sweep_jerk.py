"""The sweeps find the first contact of bodies with jerk and torque rates, too: by closed forms and samples."""

import numpy as np
import pytest
from sweep_pairs import Pair, check_random_pairs

from rigidimpulse.collision.time_of_impact import bisection, conservative
from rigidimpulse.collision.time_of_impact.result import IMPACT, SEPARATE
from rigidimpulse.motion.trajectory import FREE

GUARDED = [bisection, conservative]


@pytest.mark.parametrize("seed", range(8))
def test_random_pairs_against_dense_sampling(seed):
    """2,000 pairs of all kinds. Jerks and torque rates move points by centimetres to metres in a step, ten decades more than the rounding
    allowed for.
    """
    swept, impacts = check_random_pairs(np.random.default_rng(seed), 300, rates=True)
    assert swept >= 250
    assert impacts >= 50


@pytest.mark.parametrize("method", GUARDED)
def test_ball_with_jerk_meets_a_plane_at_the_root_of_the_cubic(method):
    """z = z0 + v t + a t^2 / 2 + j t^3 / 6, with three real roots, one, or one that is missed by a little: the first one counts.

    A parabola in its place is off by j t^3 / 6, up to metres.
    """
    rng = np.random.default_rng(6)
    for trial in range(400):
        roots = rng.uniform(-1.0, 2.0, size=3)
        growth = rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-1, 2)
        cubic = np.polynomial.Polynomial.fromroots(roots) * growth
        if trial % 2:
            turns = cubic.deriv().roots()
            cubic += 10 ** rng.uniform(-6, 0) - cubic(turns[np.argmax(cubic.deriv(2)(turns))])  # its valley is above 0
        z, v, a, j = cubic.coef * (1.0, 1.0, 2.0, 6.0)
        if z < 1e-3:
            continue
        pair = Pair("half space", "sphere").set(1, FREE, (0, 0, 0.5 + z), (1, 0, v), acceleration=(0, 2, a), jerk=(3, 0, j))
        time, status, queries, _ = pair.sweep(method, end=2.0, impact_margin=0.0)
        real = [r.real for r in cubic.roots() if abs(r.imag) < 1e-12 and 0.0 < r.real < 2.0]
        assert (status == IMPACT) == bool(real)
        assert queries <= 3
        if real:
            steepness = abs(cubic.deriv()(min(real)))
            assert abs(time - min(real)) < 1e-13 * np.abs(cubic.coef).max() / steepness


@pytest.mark.parametrize("method", GUARDED)
def test_ball_with_jerk_returns_to_a_plane(method):
    """From the very gap of contact it leaves, slower and slower, by v t + a t^2 / 2 - |j| t^3 / 6, and is back at the root of that."""
    pair = Pair("half space", "sphere").set(1, FREE, (0, 0, 0.5), (0, 0, 1.0), acceleration=(0, 0, 2.0), jerk=(0, 0, -30.0))
    back = (1.0 + np.sqrt(1.0 + 4.0 * 5.0)) / 10.0  # 1 + t - 5 t^2 = 0
    assert pair.sweep(method, end=2.0, impact_margin=0.0)[0] == pytest.approx(back, abs=1e-14)
    assert pair.sweep(method, end=0.5 * back, impact_margin=0.0)[1] == SEPARATE


@pytest.mark.parametrize("method", GUARDED)
def test_balls_with_jerk_meet_at_the_root_of_the_sextic(method):
    rng = np.random.default_rng(7)
    for _ in range(100):
        x, v, a, j = rng.normal(size=(4, 3)) * np.array([3.0, 3.0, 6.0, 20.0])[:, None]
        x[2] += 4.0
        pair = Pair("sphere", "sphere").set(1, FREE, x, velocity=v, acceleration=a, jerk=j)
        time, status, _, _ = pair.sweep(method, end=2.0, impact_margin=0.0)
        square = sum(np.polynomial.Polynomial([x[k], v[k], a[k] / 2.0, j[k] / 6.0]) ** 2 for k in range(3)) - 1.0
        roots = [r.real for r in square.roots() if abs(r.imag) < 1e-9 and 0.0 < r.real < 2.0]
        assert (status == IMPACT) == bool(roots)
        if roots:
            assert time == pytest.approx(min(roots), abs=1e-9)
