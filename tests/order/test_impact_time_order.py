"""How the error of the impact time depends on the tolerance and on the step: animation notes A3 and A4.

Safe methods: a gap of at most impact_margin + tolerance at a closing speed c means a time early by at most tolerance / c, never late; the
cost is that of bisection, log2(h / (tolerance / c)) evaluations and a few safe steps, or less. Linear approximation: with the gap's
second derivative g'' the estimate is off by g'' t^2 / (2 c), so the error falls with the square of the time to the impact.

The body is a tumbling box over a plane: its gap is no polynomial. The reference is the safe method to rounding, which is checked against
the closed form of a ball in tests/unit/test_sweep.py.
"""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from rigidimpulse.collision.geometry import HALF_SPACE, ROUND, CompiledShape, Primitive, build_geometry
from rigidimpulse.collision.time_of_impact import bisection, conservative, linear
from rigidimpulse.collision.time_of_impact.result import PairsToSweep
from rigidimpulse.collision.time_of_impact.safe_step import make_scratch
from rigidimpulse.motion.trajectory import FREE, begin, make_trajectories, state_at

BOX = trimesh.creation.box((1.0, 0.6, 0.4))
GEOMETRY = build_geometry(
    [
        CompiledShape((Primitive(HALF_SPACE, frame=np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])),)),
        CompiledShape((Primitive(ROUND, vertices=np.array(BOX.vertices), faces=np.array(BOX.faces, dtype=np.int64)),)),
    ]
)
DETECTOR = SimpleNamespace(
    geometry=GEOMETRY, shape_of_body=np.array([0, 1], dtype=np.int64), sweep_scratch=make_scratch(GEOMETRY), max_queries=10_000
)


def trajectory(height=2.0, velocity=(1.0, 0.5, -3.0)):
    """A box that tumbles and falls on the plane z = 0."""
    result = make_trajectories(2)
    result.mode[1] = FREE
    result.position[1], result.velocity[1] = (0.0, 0.0, height), velocity
    result.angular_velocity[1], result.acceleration[1] = (2.0, 3.0, 1.0), (0.0, 0.0, -9.81)
    result.inertia[1] = (0.52, 1.16, 1.36)
    for i in range(2):
        begin(result, i)
    return result


def impact(method, path, start=0.0, end=1.0, tolerance=1e-15):
    """(time, queries, closing speed) of the impact."""
    one = np.ones(1)
    pairs = PairsToSweep(np.array([0]), np.array([1]), start * one, 1e-9 * one, tolerance * one, end * one)
    found = method.sweep(DETECTOR, path, pairs, end)
    x, q, v, w = np.empty(3), np.empty(4), np.empty(3), np.empty(3)
    state_at(path, 1, found.time[0], x, q, v, w)
    speed = v + np.cross(w, found.witness[0, 3:6] - x)
    return found.time[0], found.queries[0], -speed[2]


@pytest.mark.parametrize("method", [bisection, conservative])
def test_guarded_error_is_within_the_tolerance_and_early(method):
    path = trajectory()
    exact, _, closing = impact(method, path)
    for tolerance in 10.0 ** -np.arange(2, 14):
        time, _, _ = impact(method, path, tolerance=tolerance)
        assert 0.0 <= exact - time <= tolerance / closing * (1.0 + 10.0 * tolerance) + 1e-15


@pytest.mark.parametrize("method", [bisection, conservative])
def test_guarded_cost_is_that_of_bisection(method):
    for tolerance in 10.0 ** -np.arange(2, 15):
        _, queries, closing = impact(method, trajectory(), tolerance=tolerance)
        assert queries <= np.log2(1.0 / (tolerance / closing)) + 12


def test_linear_error_is_of_second_order():
    """Started ever closer to the impact: the slope of error against time to go is 2, and at most three queries are made."""
    path = trajectory()
    exact, _, _ = impact(bisection, path)
    ahead = 2.0 ** -np.arange(4.0, 14.0)
    errors = []
    for h in ahead:
        time, queries, _ = impact(linear, path, start=exact - h, end=exact + h)
        errors.append(abs(time - exact))
        assert 1 <= queries <= 3
    slopes = np.diff(np.log(errors)) / np.diff(np.log(ahead))
    assert slopes[-4:] == pytest.approx(2.0, abs=0.02)
