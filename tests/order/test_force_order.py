"""Order of the steps under forces that depend on velocity and orientation: 4 in flight, 2 in contact.

A loose tolerance lets the steps be those of the run. A box in wind and drag on a spring off its centre, tumbling: halving the step divides
the error by 16, against the reference; by 15 and more is asked once, on average over two halvings, as is 3.6 for order 2. A step of order 3
gives 8; forces taken at the start of a step, 2.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "laws"))
from forced_reference import Start, box_inertia, matrices, reference

LOOSE = 1e-2
MASS, SIZE = 1.2, (0.3, 0.5, 0.8)
WIND = np.array([3.0, -1.0, 0.5])


def in_flight(step: float, tolerance: float = LOOSE) -> ri.Recording:
    """A box off its centre on a spring, in a wind that changes."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("box", ri.Shape.box(SIZE), mass=MASS, velocity=(1, 2, 3), angular_velocity=(1.0, 2.0, -1.0)))
    scene.add(ri.ForceField(lambda t, x, v: 0.9 * (WIND * np.cos(2.0 * t)[:, None] - v)))
    scene.add(ri.Drag(quadratic=0.1))
    scene.add(ri.Spring(None, "box", (0, 0, 2), (0.15, 0.25, 0.4), 12.0, 0.3, rest_length=0.5))
    return ri.simulate(scene, 1.0, fps=20, accuracy=ri.Accuracy(step=step, tolerance=tolerance))


def true_flight(times: np.ndarray):
    arm = np.array([0.15, 0.25, 0.4])

    def wrench(t, x, turn, v, w):
        r = turn[0] @ arm
        d, u = x[0] + r - (0, 0, 2), v[0] + np.cross(w[0], r)
        size = np.linalg.norm(d)
        pull = -(12.0 * (size - 0.5) + 0.3 * (d @ u) / size) * d / size
        rest = 0.9 * (WIND * np.cos(2.0 * t) - v[0]) - 0.1 * np.linalg.norm(v[0]) * v[0] - (0, 0, MASS * 9.81)
        return np.array([[*(pull + rest), *np.cross(r, pull)]])

    return reference([Start(MASS, box_inertia(MASS, SIZE), velocity=(1, 2, 3), angular_velocity=(1.0, 2.0, -1.0))], wrench, times)


def test_flight_is_of_order_four() -> None:
    true = true_flight(np.arange(21) / 20.0)
    errors = []
    for step in (0.05, 0.025, 0.0125):
        run = in_flight(step)
        place = np.abs(run.position("box") - true.position[:, 0]).max()
        turn = np.abs(matrices(run.orientation("box")) - true.rotation[:, 0]).max()
        errors.append((place, turn))
    gain = np.sqrt(np.array(errors[0]) / np.array(errors[2]))
    print(errors, gain)
    assert np.all(gain > 13.0), (errors, gain)
    assert errors[2][0] < 1e-5


def test_the_tolerance_bounds_the_error_of_steps_that_are_too_long() -> None:
    """With steps of 0.1 s tolerances of 1e-5, 1e-9 and 1e-13 allow 1e-4, 1e-6 and 1e-8 of the size inside a step."""
    true = true_flight(np.arange(21) / 20.0)
    tolerances = (1e-5, 1e-9, 1e-13)
    errors = np.array([np.abs(in_flight(0.1, t).position("box") - true.position[:, 0]).max() for t in tolerances])
    assert np.all(errors < 20.0 * 0.03 * np.sqrt(tolerances)), errors
    assert errors[2] < 0.1 * errors[1] < 0.01 * errors[0], errors


def sliding(step: float) -> ri.Recording:
    """A block that slides with friction under drag and a harmonic push, always forward."""
    rough = ri.Material(static_friction=0.2, dynamic_friction=0.2, restitution=0.0)
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=rough))
    scene.add(ri.Body("block", ri.Shape.box((1, 1, 0.2)), mass=2.0, position=(0, 0, 0.1), velocity=(6, 0, 0), material=rough))
    scene.add(ri.Drag(quadratic=0.6))
    scene.add(ri.HarmonicForce("block", 5.0, 1.3, (1, 0, 0.4)))
    return ri.simulate(scene, 1.0, fps=20, accuracy=ri.Accuracy(step=step, tolerance=LOOSE))


def test_contact_is_of_order_two() -> None:
    along = np.array([1, 0, 0.4]) / np.hypot(1, 0.4)

    def wrench(t, x, turn, v, w):
        f = 5.0 * np.sin(2.6 * np.pi * t) * along
        friction = 0.2 * (2.0 * 9.81 - f[2])
        return np.array([[f[0] - friction - 0.6 * v[0, 0] * abs(v[0, 0]), 0, 0, 0, 0, 0]])

    times = np.arange(21) / 20.0
    true = reference([Start(2.0, np.eye(3), velocity=(6, 0, 0))], wrench, times).position[:, 0, 0]
    errors = [np.abs(sliding(step).position("block")[:, 0] - true).max() for step in (0.05, 0.025, 0.0125)]
    gain = np.sqrt(errors[0] / errors[2])
    assert gain > 3.6, (errors, gain)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-13])
def test_an_elastic_ball_on_a_spring_between_walls(tolerance: float) -> None:
    """x'' = -w^2 x between walls at +- d: phases in closed form, v changes sign at the wall: |x| keeps to the arcs, one impact each.

    From the middle with v0: x = (v0 / w) sin(w t) until it is d, t_1 = asin(w d / v0) / w; it is back in the middle at 2 t_1, and so on.
    """
    m, k, d, v0, r = 0.5, 30.0, 0.4, 5.0, 0.1
    scene, smooth = ri.Scene(gravity=(0, 0, 0)), ri.Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
    for sign, name in ((1, "right"), (-1, "left")):
        wall = ri.Shape.box((0.2, 2, 2))
        scene.add(ri.Body(name, wall, motion="static", position=(sign * (d + r + 0.1), 0, 0), material=smooth))
    scene.add(ri.Body("ball", ri.Shape.sphere(r), mass=m, velocity=(v0, 0, 0), material=smooth))
    scene.add(ri.Spring(None, "ball", (0, 0, 0), (0, 0, 0), k, rest_length=0.0))
    run = ri.simulate(scene, 3.0, accuracy=ri.Accuracy(tolerance=tolerance))
    assert run.status.ok, run.status.message
    w = np.sqrt(k / m)
    first = np.arcsin(w * d / v0) / w
    hits = first * np.arange(1, 2 * len(run.impacts), 2)
    assert len(run.impacts) == int((3.0 / first + 1) // 2)
    # A step that an impact cuts short is left at the speed of its line, off by some 12 E / h for a path off by E; 18 of them add up.
    # Impacts at the end of their steps would be off by v h, 7e-2 m.
    speed = np.sqrt(v0**2 - w**2 * d**2)
    slow = 18 * 12.0 * 60.0 * 0.03 * np.sqrt(tolerance) * r
    np.testing.assert_allclose(run.impacts["time"], hits, rtol=0, atol=slow / w / speed)
    np.testing.assert_allclose(run.impacts["impulse"], 2.0 * m * speed, rtol=0, atol=m * slow)
    phase = (run.times + first) % (2.0 * first) - first
    side = np.where(((run.times + first) // (2.0 * first)) % 2 == 0, 1.0, -1.0)
    np.testing.assert_allclose(run.position("ball")[:, 0], side * v0 / w * np.sin(w * phase), rtol=0, atol=slow / w)
    total = run.ledger.total + sum(run.ledger.dissipated.values())
    np.testing.assert_allclose(total, total[0], rtol=0, atol=1e-12 * total[0])
