"""Drag, wind and other fields against closed forms.

Laws. Linear: v = v0 exp(-c t / m), way (m / c)(v0 - v). Quadratic: v = v0 / (1 + c v0 t / m), way (m / c) ln(1 + c v0 t / m). Falling
from rest with quadratic drag v = u tanh(g t / u), x = (u^2 / g) ln cosh(g t / u), u = sqrt(m g / c); a terminal speed is kept. With both,
u is the root of c1 v + c2 v^2 = m g. In a wind drag pulls to the wind. Magnet: F = b v x B turns the velocity at the rate b B / m, speed
stays.
Tolerance: 1e-8 m, and 1e-8 m/s over a time m / c of a second: a path is off by at most 1e-8 of the size inside a step. First order would
be off by 1e-2, drag with the square of v left out by 1.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import rigidimpulse as ri

G = 9.81
PATH = 1e-8


def balls(masses: dict[str, float], *forces: object, gravity: float = 0.0, duration: float = 3.0, **start: object) -> ri.Recording:
    """Balls of these masses far from each other, all with the same start."""
    scene = ri.Scene(gravity=(0, 0, -gravity))
    for k, (name, mass) in enumerate(masses.items()):
        scene.add(ri.Body(name, ri.Shape.sphere(0.2), mass=mass, position=(0, 50.0 * k, 0), **start))
    for force in forces:
        scene.add(force)
    run = ri.simulate(scene, duration)
    assert run.status.ok, run.status.message
    return run


def assert_ledger_balances(run: ri.Recording) -> None:
    """What drag took is what is missing: the ledger integrates along the very path."""
    total = run.ledger.total + sum(run.ledger.dissipated.values())
    scale = np.abs(run.ledger.kinetic).max() + np.abs(run.ledger.potential).max()
    np.testing.assert_allclose(total, total[0], rtol=0, atol=1e-9 * scale)


def test_linear_drag() -> None:
    masses, v0, c = {"light": 0.4, "heavy": 7.0}, np.array([3.0, -4.0, 12.0]), 0.9
    run = balls(masses, ri.Drag(linear=c), velocity=v0, angular_velocity=(0, 0, 5))
    for k, (name, m) in enumerate(masses.items()):
        left = np.exp(-c * run.times / m)[:, None]
        np.testing.assert_allclose(run.velocity(name), left * v0, rtol=0, atol=PATH)
        np.testing.assert_allclose(run.position(name), (0, 50.0 * k, 0) + m / c * (1.0 - left) * v0, rtol=0, atol=PATH)
        np.testing.assert_array_equal(run.angular_velocity(name), np.broadcast_to((0.0, 0.0, 5.0), (len(run.times), 3)))
    assert_ledger_balances(run)
    assert run.ledger.dissipated["drag"][-1] > 30.0


def test_quadratic_drag_on_named_bodies() -> None:
    v0, c = np.array([6.0, -8.0, 0.0]), 0.3
    run = balls({"ball": 0.8, "free": 2.0}, ri.Drag(quadratic=c, bodies=["ball"], name="air"), velocity=v0)
    slowed = (1.0 + c * 10.0 * run.times / 0.8)[:, None]
    np.testing.assert_allclose(run.velocity("ball"), v0 / slowed, rtol=0, atol=PATH)
    np.testing.assert_allclose(run.position("ball"), 0.8 / c / 10.0 * np.log(slowed) * v0, rtol=0, atol=PATH)
    np.testing.assert_allclose(run.velocity("free"), np.broadcast_to(v0, (len(run.times), 3)), rtol=0, atol=1e-14)
    assert_ledger_balances(run)
    assert run.ledger.dissipated["air"][-1] > 35.0


def test_fall_to_the_terminal_speed() -> None:
    m, c = 1.3, 0.25
    u = np.sqrt(m * G / c)
    run = balls({"ball": m}, ri.Drag(quadratic=c), gravity=G, duration=6.0)
    np.testing.assert_allclose(run.velocity("ball")[:, 2], -u * np.tanh(G * run.times / u), rtol=0, atol=PATH)
    np.testing.assert_allclose(run.position("ball")[:, 2], -(u**2) / G * np.log(np.cosh(G * run.times / u)), rtol=0, atol=PATH)
    assert_ledger_balances(run)


def test_a_terminal_speed_is_kept() -> None:
    m, c1, c2 = 1.3, 0.8, 0.25
    u = brentq(lambda v: c1 * v + c2 * v**2 - m * G, 0.0, 100.0)
    run = balls({"ball": m}, ri.Drag(c1, c2), gravity=G, velocity=(0, 0, -u))
    np.testing.assert_allclose(run.velocity("ball"), np.broadcast_to((0, 0, -u), (len(run.times), 3)), rtol=0, atol=1e-13 * u)


def test_drags_add_up() -> None:
    one = balls({"ball": 0.7}, ri.Drag(0.5, 0.25), velocity=(1, 2, 3))
    two = balls({"ball": 0.7}, ri.Drag(linear=0.5), ri.Drag(quadratic=0.125), ri.Drag(quadratic=0.125), velocity=(1, 2, 3))
    np.testing.assert_allclose(two.position("ball"), one.position("ball"), rtol=0, atol=1e-14)
    assert {"drag", "drag 2", "drag 3"} <= set(two.ledger.dissipated)


def test_very_strong_drag_stops_without_overshoot() -> None:
    """m / c = 1e-4 s, 1/170 of a step: v falls to 0 and never changes sign; the way is m v0 / c."""
    run = balls({"ball": 0.1}, ri.Drag(linear=1e3), velocity=(5, 0, 0), duration=0.1)
    assert run.velocity("ball")[:, 0].min() > -1e-6
    np.testing.assert_allclose(run.position("ball")[-1], (5e-4, 0, 0), rtol=0, atol=PATH)


def test_wind() -> None:
    """A field that knows the speed: the ball drifts to the wind's, v = u (1 - exp(-c t / m))."""
    wind, c, m = np.array([4.0, 0.0, 1.0]), 1.1, 0.6
    run = balls({"ball": m}, ri.ForceField(lambda t, x, v: c * (wind - v)))
    np.testing.assert_allclose(run.velocity("ball"), (1.0 - np.exp(-c * run.times / m))[:, None] * wind, rtol=0, atol=PATH)
    assert_ledger_balances(run)


@pytest.mark.parametrize("turns", [0.5, 40.0])
def test_a_magnet_turns_the_velocity_and_keeps_the_speed(turns: float) -> None:
    """After `turns` times 2 pi in 3 s, slow and fast beside the steps. The error of the angle is 1e-8 of the size over the radius."""
    m, v0, rate = 0.5, 2.0, 2.0 * np.pi * turns / 3.0
    run = balls({"ball": m}, ri.ForceField(lambda t, x, v: m * rate * np.cross(v, (0, 0, -1.0))), velocity=(v0, 0, 0))
    angle = rate * run.times
    circle = v0 / rate * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle])
    np.testing.assert_allclose(run.position("ball"), circle, rtol=0, atol=10.0 * PATH * max(turns, 1.0))
    np.testing.assert_allclose(np.linalg.norm(run.velocity("ball"), axis=1), v0, rtol=0, atol=10.0 * PATH * rate)


def test_a_field_of_time_and_place() -> None:
    """m x'' = -k x + a t from rest at b: x = a t / k + (b) cos w t - a sin(w t) / (k w); each body feels its own place and time."""
    m, k, a, b = 0.5, 8.0, 3.0, 0.7

    def pull(t: np.ndarray, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.column_stack([a * t - k * x[:, 0], 0.0 * t, 0.0 * t])

    run = _two(m, b, pull)
    w, t = np.sqrt(k / m), run.times
    for name, place in (("one", b), ("two", -2.0 * b)):
        x = a * t / k + place * np.cos(w * t) - a * np.sin(w * t) / (k * w)
        np.testing.assert_allclose(run.position(name)[:, 0], x, rtol=0, atol=10.0 * PATH)


def _two(m: float, b: float, pull) -> ri.Recording:
    """Two balls at b and -2 b in a field."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("one", ri.Shape.sphere(0.1), mass=m, position=(b, 0, 0)))
    scene.add(ri.Body("two", ri.Shape.sphere(0.1), mass=m, position=(-2.0 * b, 5, 0)))
    scene.add(ri.ForceField(pull))
    return ri.simulate(scene, 3.0)
