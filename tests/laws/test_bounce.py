"""A ball under gravity: energy over many elastic bounces, and the fall to rest of an inelastic one.

Laws. With e = 1 the energy m v^2 / 2 + m g z is constant: 1e-12 relative over 20 s (engines with a fixed step are off
by 1e-5 to 1e-2). With e < 1 bounce k rises e^2 of the one before, and rest comes at sqrt(2 h / g) (1 + e) / (1 - e),
infinitely many impacts in finite time. The tail whose rise is below the gap delta is one inelastic impact; leaving it
out ends the bounces early by at most 2 sqrt(2 delta / g) / (1 - e).
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.tolerances import TOLERANCES

RADIUS, HEIGHT, G = 0.5, 2.5, 9.81


def dropped_ball(restitution: float) -> ri.Scene:
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    material = ri.Material(restitution=restitution)
    scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), position=(0, 0, RADIUS + HEIGHT), material=material))
    return scene


def test_elastic_ball_keeps_its_energy() -> None:
    run = ri.simulate(dropped_ball(1.0), 20.0)
    assert len(run.impacts) == 14
    np.testing.assert_allclose(run.ledger.total / run.ledger.total[0], 1.0, atol=1e-12, rtol=0)


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.8])
def test_inelastic_ball_comes_to_rest_in_time(restitution: float) -> None:
    e = restitution
    rest = np.sqrt(2 * HEIGHT / G) * (1 + e) / (1 - e)
    run = ri.simulate(dropped_ball(e), rest + 0.5, fps=240)
    speeds = np.sqrt(2 * G * HEIGHT) * e ** np.arange(len(run.impacts))
    np.testing.assert_allclose(run.impacts["approach_speed"], speeds, rtol=1e-9)
    delta = TOLERANCES.contact.margin * 2 * RADIUS
    assert rest - 2 * np.sqrt(2 * delta / G) / (1 - e) <= run.impacts["time"][-1] <= rest
    at_rest = run.times > rest
    np.testing.assert_array_equal(run.velocity("ball")[at_rest], 0.0)
    np.testing.assert_allclose(run.position("ball")[at_rest, 2], RADIUS + delta, atol=1e-12)
    assert np.diff(run.ledger.total).max() <= 1e-12 * run.ledger.total[0]
