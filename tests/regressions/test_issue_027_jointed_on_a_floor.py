"""Bodies with joints that are drawn a micrometre inside the floor stand, and the run is ok: the joint lifts what the floor does not touch.

The lift of what hangs on the body that touches was booked as energy that the joint gave: "energy made", 69 % of what moves.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

GRAVITY = 9.81


def legs(depth: float) -> ri.Scene:
    """A trunk on one leg, which is `depth` [m] inside the floor."""
    scene = ri.Scene(gravity=(0, 0, -GRAVITY))
    scene.add(ri.Body("floor", ri.Shape.box((4, 4, 0.2)), position=(0, 0, -0.1), motion="static"))
    scene.add(ri.Body("leg", ri.Shape.capsule(0.05, 0.4), position=(0, 0, 0.25 - depth)))
    scene.add(ri.Body("trunk", ri.Shape.box((0.2, 0.2, 0.5)), position=(0, 0, 0.8 - depth)))
    scene.add(ri.BallJoint("leg", "trunk", (0, 0, 0.5 - depth)))
    return scene


@pytest.mark.parametrize("depth", [0.0, 1e-9, 1e-7, 1e-6, 3e-6])
def test_it_stands_and_its_books_say_how_far_it_was_lifted(depth: float) -> None:
    """Lifted by x, the weight w has w x more: all of that is a position correction."""
    scene = legs(depth)
    run = ri.simulate(scene, 0.3)
    assert run.status.ok, run.status.message
    lift = np.array([run.position(name)[-1, 2] - run.position(name)[0, 2] for name in ("leg", "trunk")])
    assert np.all((lift >= 0.0) & (lift <= depth + 1e-5 * 0.5))
    ledger = run.ledger
    gained = ledger.total[-1] - ledger.total[0]
    corrected = -ledger.dissipated.get("position correction", np.zeros(1))[-1]
    assert abs(gained - corrected) <= 1e-9 * (1.0 + abs(ledger.total[0]))
