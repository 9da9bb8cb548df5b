"""Point attractors against Kepler's laws.

Laws, a = -s r / |r|^3. Period 2 pi sqrt(a^3 / s), a the half axis; energy v^2 / 2 - s / r and angular momentum stay. A body a as the
centre feels the force on b the other way: b goes round it with the period of s (1 + m_b / m_a), and total momentum stays.
Tolerance: inside each step a path is off by at most 1e-8 of the size R of the body; a Kepler orbit lets an error of the half axis grow with
time, by 3 pi an orbit: with N steps 1e-8 R N 10 orbits. Bodies here have R = 0.05, orbits some 150 steps: 1e-6 m, and
more where the body passes the centre faster by (1 + e) / (1 - e). One power off, or the force on the centre left out, is off by the orbit.
"""

from __future__ import annotations

import numpy as np
import pytest
from forced_reference import Start, reference

import rigidimpulse as ri

PATH = 1e-6
RADIUS = 0.05


def assert_ledger_balances(run: ri.Recording, relative: float) -> None:
    """An attractor stores what it takes: kinetic and potential energy together stay, and nothing is said to be dissipated."""
    scale = np.abs(run.ledger.kinetic).max()
    np.testing.assert_allclose(run.ledger.total, run.ledger.total[0], rtol=0, atol=relative * scale)
    np.testing.assert_allclose(run.ledger.dissipated["attractor"], 0.0, rtol=0, atol=relative * scale)


@pytest.mark.parametrize("eccentricity", [0.0, 0.4, 0.9])
def test_an_orbit_closes_after_its_period(eccentricity: float) -> None:
    s, a, center = 3.0, 1.2, np.array([5.0, -3.0, 2.0])
    period = 2.0 * np.pi * np.sqrt(a**3 / s)
    axis, along = np.array([2.0, 1.0, 2.0]) / 3.0, np.array([1.0, 2.0, -2.0]) / 3.0
    speed = np.sqrt(s * (1.0 - eccentricity) / (a * (1.0 + eccentricity)))
    scene = ri.Scene(gravity=(0, 0, 0))
    start = center + a * (1.0 + eccentricity) * axis
    scene.add(ri.Body("moon", ri.Shape.sphere(RADIUS), mass=17.0, position=start, velocity=speed * along))
    scene.add(ri.PointAttractor(center, s))
    run = ri.simulate(scene, 3.0 * period, fps=60.0 / period)
    assert run.status.ok, run.status.message
    orbits = run.position("moon")[::60]
    assert len(orbits) == 4
    np.testing.assert_allclose(orbits, np.broadcast_to(start, (4, 3)), rtol=0, atol=PATH)
    near = center - a * (1.0 - eccentricity) * axis
    faster = (1.0 + eccentricity) / (1.0 - eccentricity)
    np.testing.assert_allclose(run.position("moon")[30::60], np.broadcast_to(near, (3, 3)), rtol=0, atol=PATH * faster)
    spun = np.cross(run.position("moon") - center, run.velocity("moon"))
    np.testing.assert_allclose(spun, np.broadcast_to(spun[0], spun.shape), rtol=0, atol=PATH)
    assert_ledger_balances(run, PATH)


def test_two_bodies_go_round_their_centre_of_mass() -> None:
    s, masses, distance = 2.0, (3.0, 1.5), 1.0
    whole = s * (1.0 + masses[1] / masses[0])
    speed = np.sqrt(whole / distance)
    period = 2.0 * np.pi * distance / speed
    scene = ri.Scene(gravity=(0, 0, 0))
    drift = np.array([0.3, 0.1, -0.2])
    shares = [-masses[1] / sum(masses), masses[0] / sum(masses)]
    for name, mass, share in zip(("sun", "moon"), masses, shares, strict=True):
        scene.add(
            ri.Body(
                name, ri.Shape.sphere(RADIUS), mass=mass, position=(share * distance, 0, 0), velocity=drift + (0, share * speed, 0),
            )
        )  # fmt: skip
    scene.add(ri.PointAttractor("sun", s))
    run = ri.simulate(scene, 4.0 * period, fps=40.0 / period)
    angle = speed / distance * run.times
    for name, share in zip(("sun", "moon"), shares, strict=True):
        circle = share * distance * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle]) + run.times[:, None] * drift
        np.testing.assert_allclose(run.position(name), circle, rtol=0, atol=PATH)
    np.testing.assert_allclose(run.ledger.momentum, np.broadcast_to(sum(masses) * drift, (len(run.times), 3)), rtol=0, atol=1e-12)
    turned = run.ledger.angular_momentum
    np.testing.assert_allclose(turned, np.broadcast_to(turned[0], turned.shape), rtol=0, atol=PATH)
    assert_ledger_balances(run, PATH)


@pytest.mark.parametrize(("power", "softening"), [(-1.0, 0.0), (0.0, 0.3), (1.0, 0.0), (1.0, 0.4), (2.0, 0.5), (3.5, 0.2)])
def test_other_powers_and_softening_against_the_reference(power: float, softening: float) -> None:
    s, start, velocity = 1.4, (0.9, -0.4, 0.7), (0.2, 1.1, 0.3)
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), mass=2.5, position=start, velocity=velocity))
    scene.add(ri.PointAttractor((0.1, 0, 0), s, power, softening))
    run = ri.simulate(scene, 6.0)

    def pull(t, x, turn, v, w):
        r = x[0] - (0.1, 0, 0)
        return np.array([[*(-2.5 * s * r * (r @ r + softening**2) ** (-0.5 * (power + 1.0))), 0, 0, 0]])

    motion = reference([Start(2.5, np.eye(3), start, velocity=velocity)], pull, run.times)
    np.testing.assert_allclose(run.position("ball"), motion.position[:, 0], rtol=0, atol=PATH)
    assert_ledger_balances(run, PATH)


def test_three_bodies_that_all_attract_each_other() -> None:
    """Momentum is kept to rounding, energy by the steps; against the reference as long as the motion is not chaotic."""
    masses = {"a": 3.0, "b": 4.0, "c": 5.0}
    places, speeds = [(1, 3, 0), (-2, -1, 0.5), (1, -1, -0.5)], [(0.6, 0, 0.1), (0, -0.5, 0), (0.2, 0.3, 0)]
    scene = ri.Scene(gravity=(0, 0, 0))
    for (name, mass), x, v in zip(masses.items(), places, speeds, strict=True):
        scene.add(ri.Body(name, ri.Shape.sphere(RADIUS), mass=mass, position=x, velocity=v))
    g = 0.5
    scene.add(ri.PointAttractor("a", g * 3.0, name="on b and c"))
    scene.add(ri.PointAttractor("b", g * 4.0, bodies=["c"], name="on c"))
    run = ri.simulate(scene, 4.0)
    m = np.array(list(masses.values()))

    def pull(t, x, turn, v, w):
        r = x[None] - x[:, None]
        cube = (np.linalg.norm(r, axis=2) + np.eye(3)) ** 3
        return np.hstack([(g * m[:, None, None] * m[None, :, None] * r / cube[..., None]).sum(1), np.zeros((3, 3))])

    motion = reference([Start(mass, np.eye(3), x, velocity=v) for mass, x, v in zip(m, places, speeds, strict=True)], pull, run.times)
    for k, name in enumerate(masses):
        np.testing.assert_allclose(run.position(name), motion.position[:, k], rtol=0, atol=PATH)
    np.testing.assert_allclose(run.ledger.momentum, np.broadcast_to(run.ledger.momentum[0], (len(run.times), 3)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.ledger.total, run.ledger.total[0], rtol=0, atol=PATH * run.ledger.kinetic.max())


def test_a_negative_strength_repels() -> None:
    """From rest at d: the speed far away is sqrt(2 s / d), energy tells it at any distance."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), mass=0.4, position=(0.3, 0, 0)))
    scene.add(ri.PointAttractor((0, 0, 0), -2.0))
    run = ri.simulate(scene, 2.0)
    x = run.position("ball")[1:, 0]
    np.testing.assert_allclose(run.velocity("ball")[1:, 0], np.sqrt(4.0 * (1.0 / 0.3 - 1.0 / x)), rtol=0, atol=PATH)
    assert x[-1] > 5.0


def test_a_fall_into_the_centre_is_reported() -> None:
    """Without softening the force has no bound; the run goes on with finite numbers and says so."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), mass=0.4, position=(1.0, 0, 0)))
    scene.add(ri.PointAttractor((0, 0, 0), 5.0))
    run = ri.simulate(scene, 1.5)
    assert "forces change too fast" in {event.kind for event in run.status.events} and not run.status.ok
    assert np.all(np.isfinite(run.positions))
