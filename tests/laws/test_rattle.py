"""Bodies caught between others, and contacts that are pressed by motion alone."""

import numpy as np
import pytest

import rigidimpulse as ri

HEAVY, LIGHT, RADIUS = 10.0, 0.01, 0.1


def three_balls(space: float, restitution: float) -> ri.Recording:
    """Run a light ball between two heavy ones that close on it at 2 m/s, `space` m from each, without gravity."""
    smooth = ri.Material(density=1000, restitution=restitution, static_friction=0.0, dynamic_friction=0.0)
    scene = ri.Scene(gravity=(0, 0, 0))
    for k, (name, mass, speed) in enumerate((("left", HEAVY, 1.5), ("light", LIGHT, 0.0), ("right", HEAVY, -0.5))):
        place = ((k - 1) * (2.0 * RADIUS + space), 0.0, 0.0)
        scene.add(ri.Body(name, ri.Shape.sphere(RADIUS), position=place, velocity=(speed, 0, 0), mass=mass, material=smooth))
    return ri.simulate(scene, 0.1)


@pytest.mark.parametrize(("space", "restitution"), [(0.0, 0.2), (0.0, 0.6), (1e-3, 0.2), (1e-3, 0.6)])
def test_a_light_body_between_heavy_ones_collapses(space: float, restitution: float) -> None:
    """With c = (1 + m/M)^-2 > 4 e / (1 + e)^2 the impacts never end, in finite time (McNamara and Young 1992): all go on together.

    c = 0.998, the other side at most 0.9375. The common velocity is that of the momentum, within what the finish may be off by: 1e-3 of
    the closing speed. Pair after pair the light ball passes m v (1 + e) at an impact: a thousand impacts, and the status says so.
    """
    run = three_balls(space, restitution)
    together = (1.5 - 0.5) * HEAVY / (2.0 * HEAVY + LIGHT)
    last = [float(run.velocity(name)[-1, 0]) for name in ("left", "light", "right")]
    assert run.status.ok, run.status.message
    assert len(run.impacts) < 150
    assert np.abs(np.subtract(last, together)).max() < 2e-3
    momentum = HEAVY * (last[0] + last[2]) + LIGHT * last[1]
    assert abs(momentum - HEAVY) < 1e-12 * HEAVY


def test_elastic_impacts_do_not_collapse() -> None:
    """With e = 1 every impact counts: energy is kept to round-off, 20 J; one inelastic impact would take them all."""
    run = three_balls(0.0, 1.0)
    assert run.ledger is not None
    assert abs(run.ledger.kinetic[-1] - run.ledger.kinetic[0]) < 1e-12 * run.ledger.kinetic[0]


def test_a_ball_on_a_turning_paddle_is_held_by_its_motion() -> None:
    """A smooth ball that slides out on a paddle turning at w: seen from the paddle x'' = w^2 x, so x = x0 exp(w t), without gravity.

    What presses the ball on, 2 w x' - w^2 y, is the turning of the face: neither body has an acceleration of its own. Without that term
    the ball was let go at every sub-step and hit again, thousands of times. Sub-steps leave 1e-4 of x.
    """
    w, first = 2.0, 0.2
    smooth = ri.Material(density=1000, restitution=0.5, static_friction=0.0, dynamic_friction=0.0)
    scene = ri.Scene(gravity=(0, 0, 0))
    paddle = ri.Shape.box((4.0, 0.1, 0.4))
    scene.add(ri.Body("paddle", paddle, motion="kinematic", angular_velocity=(0, 0, w), material=smooth))
    place = np.array([first, 0.05 + RADIUS, 0.0])
    speed = w * np.array([first - place[1], first, 0.0])
    scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), position=place, velocity=speed, material=smooth))
    run = ri.simulate(scene, 0.7)
    away = np.linalg.norm(run.position("ball"), axis=1)
    along = np.sqrt(away**2 - place[1] ** 2)
    assert run.status.ok, run.status.message
    assert len(run.impacts) <= 10
    assert np.abs(along / (first * np.exp(w * run.times)) - 1.0).max() < 1e-4
