"""A light body between two heavy ones that close in on it: thousands of impacts in a step, each of them as it must be.

Masses m << M, restitution 1, no gravity, all along x. Between two impacts all move uniformly. An impact of bodies i and j reverses their
relative speed,

    v_i <- v_i - 2 m_j / (m_i + m_j) (v_i - v_j),

so the motion is known from impact to impact (`expected`). The product of the light body's speed and its space is nearly kept (an adiabatic
invariant): it gets fast before it turns the heavy ones back.
"""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri

ELASTIC = ri.Material(density=1000, restitution=1, static_friction=0, dynamic_friction=0)


def expected(x: np.ndarray, v: np.ndarray, m: np.ndarray, size: float, duration: float) -> tuple[np.ndarray, np.ndarray, int]:
    """Positions and velocities (3,) after `duration` s, and how many impacts there were; neighbours meet at a distance of `size` m."""
    x, v, time, count = x.copy(), v.copy(), 0.0, 0
    while True:
        closing = v[:-1] - v[1:]
        wait = np.where(closing > 0.0, (np.diff(x) - size) / np.where(closing > 0.0, closing, 1.0), np.inf)
        k = int(np.argmin(wait))
        step = min(float(wait[k]), duration - time)
        x, time = x + v * step, time + step
        if time >= duration:
            return x, v, count
        both = v[k] - v[k + 1]
        v[k] -= 2.0 * m[k + 1] / (m[k] + m[k + 1]) * both
        v[k + 1] += 2.0 * m[k] / (m[k] + m[k + 1]) * both
        count += 1


def test_the_light_body_turns_the_heavy_ones_back() -> None:
    """Mass ratio 1e5, 0.5 m/s each: 702 impacts, most of them within a few steps of 1/60 s, 1e-4 s apart.

    Each impact takes place at a gap of 6e-11 m: positions agree to 2e-11 m. An impact that was missed would let the bodies pass.
    """
    x, v, m = np.array([-0.2, 0.02, 0.2]), np.array([0.5, 0.1, -0.5]), np.array([100.0, 1e-3, 100.0])
    scene = ri.Scene(gravity=(0, 0, 0))
    for k in range(3):
        scene.add(ri.Body(f"{k}", ri.Shape.box(0.1), position=(x[k], 0, 0), velocity=(v[k], 0, 0), mass=m[k], material=ELASTIC))
    run = ri.simulate(scene, 0.5)
    assert run.status.ok, run.status.message
    place, speed, count = expected(x, v, m, 0.1, 0.5)
    assert count == 702
    np.testing.assert_allclose(run.positions[-1, :, 0], place, atol=1e-9)
    np.testing.assert_allclose(run.velocities[-1, :, 0], speed, atol=1e-9)


def test_a_body_too_fast_for_sub_steps_is_said() -> None:
    """A smooth rod of 8 cm spins at 1e5 rad/s between two others: its ends pass 8 m in 1/480 s, and contacts are looked for within 5 mm.

    It is stepped with the sub-steps of 1,024 looks, and named; at 2e4 rad/s these are enough. Nothing sinks into the floor.
    """
    smooth = ri.Material(density=500, restitution=0, static_friction=0, dynamic_friction=0)
    for spin in (2e4, 1e5):
        scene = ri.Scene()
        scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=smooth))
        for k in range(3):
            place, turning = (0, 0, 0.01 + 0.02 * k), (0, 0, spin if k == 1 else 0)
            scene.add(ri.Body(f"rod {k}", ri.Shape.box((0.08, 0.02, 0.02)), position=place, angular_velocity=turning, material=smooth))
        run = ri.simulate(scene, 0.05, accuracy=ri.Accuracy(contact_solver="substepped"))
        named = [event.bodies for event in run.status.events if event.kind == "too fast for sub-steps"]
        assert named == ([("rod 1",)] if spin == 1e5 else [])
        assert run.positions[:, 1:, 2].min() > 0.0099
