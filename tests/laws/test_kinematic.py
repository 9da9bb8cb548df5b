"""Kinematic response: v' = v - (1 + k) (v.n) n at the root of E(p(t)) = 0, whatever mass and spin (animation notes A1).

Bounds: roots and products of sixteen digits, 1e-12 of the speed and of the time. Impulses would divide the change by the masses' share,
off by tens of percent, and friction would turn spin into speed.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

KINEMATIC = ri.Accuracy(response="kinematic")


@pytest.mark.parametrize("seed", range(5))
def test_a_particle_is_reflected_by_any_plane(seed: int) -> None:
    """Thrown under gravity at a plane of any slope: E(p) = n.p - d - r has its first root where the parabola meets it."""
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3) * [0.5, 0.5, 0.0] + [0.0, 0.0, 1.0]
    n /= np.linalg.norm(n)
    k, r, g = rng.uniform(0.2, 0.9), rng.uniform(0.01, 0.5), np.array([0.0, 0.0, -9.81])
    x, v = (1.0 + r + rng.uniform()) * n, rng.normal(size=3) - 2.0 * n
    mass, spin = 10.0 ** rng.uniform(-3, 3), rng.normal(size=3) * 20.0
    scene = ri.Scene(gravity=g)
    scene.add(ri.Body("plane", ri.Shape.half_space(normal=n), motion="static"))
    material = ri.Material(restitution=k, static_friction=0.8)
    scene.add(ri.Body("ball", ri.Shape.sphere(r), position=x, velocity=v, angular_velocity=spin, mass=mass, material=material))
    run = ri.simulate(scene, 1.0, accuracy=KINEMATIC)
    time = min(t.real for t in np.roots([0.5 * n @ g, n @ v, n @ x - r]) if t.real > 0.0)
    hit = v + g * time
    assert run.impacts["time"][0] == pytest.approx(time, rel=1e-12)
    after = hit - (1.0 + k) * (hit @ n) * n
    frame = np.flatnonzero(run.times > time)[0]
    np.testing.assert_allclose(run.velocity("ball")[frame], after + g * (run.times[frame] - time), atol=1e-12 * np.linalg.norm(hit))
    np.testing.assert_allclose(run.angular_velocity("ball")[frame], spin, rtol=1e-14)


def test_speeds_fall_by_k_at_every_bounce() -> None:
    """To and fro between two walls, k = 0.8: after j bounces 0.8^j, bounce j + 1 after (gap / v) 0.8^-j more seconds."""
    scene, k, gap = ri.Scene(gravity=(0, 0, 0)), 0.8, 0.7
    for name, normal in (("left", (1, 0, 0)), ("right", (-1, 0, 0))):
        scene.add(ri.Body(name, ri.Shape.half_space(normal=normal, offset=-0.5 * gap - 0.1), motion="static"))
    material = ri.Material(restitution=k)
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), velocity=(3.0, 0.4, 0), mass=7.0, material=material))
    run = ri.simulate(scene, 3.0, accuracy=KINEMATIC)
    bounces = len(run.impacts)
    assert bounces > 5
    np.testing.assert_allclose(run.impacts["separation_speed"], 3.0 * k ** np.arange(1, bounces + 1), rtol=1e-13)
    wait = gap / 3.0 * k ** -np.arange(bounces, dtype=float)
    np.testing.assert_allclose(run.impacts["time"], np.cumsum(wait) - 0.5 * gap / 3.0, rtol=1e-12)
    np.testing.assert_array_equal(run.velocity("ball")[:, 1], 0.4)
