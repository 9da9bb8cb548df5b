"""Bodies with joints that are drawn a micrometre inside the floor stand, and the run is ok: the joint lifts what the floor does not touch.

The lift of what hangs on the body that touches was booked as energy that the joint gave, or that its forces gave in the next sub-step:
"energy made", 5 to 69 % of what moves.
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


def blocks(depth: float, joint: str) -> ri.Scene:
    """A block on another one, which is `depth` [m] inside the floor; joined by one of two kinds."""
    scene = ri.Scene(gravity=(0, 0, -GRAVITY))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("low", ri.Shape.box((0.05, 0.05, 0.1)), position=(0, 0, 0.05 - depth)))
    scene.add(ri.Body("high", ri.Shape.box((0.04, 0.04, 0.04)), position=(0, 0, 0.12 - depth)))
    anchor = (0, 0, 0.1 - depth)
    scene.add(ri.FixedJoint("low", "high", anchor) if joint == "fixed" else ri.BallJoint("low", "high", anchor))
    return scene


@pytest.mark.parametrize("joint", ["fixed", "ball"])
@pytest.mark.parametrize("part", [1e-9, 1e-8, 1e-7, 1e-6, 3e-6])
def test_a_block_on_a_block_is_ok(joint: str, part: float) -> None:
    run = ri.simulate(blocks(0.1 * part, joint), 0.2)
    assert run.status.ok, run.status.message
    gained = run.ledger.total[-1] - run.ledger.total[0]
    assert abs(gained + sum(taken[-1] for taken in run.ledger.dissipated.values())) <= 1e-9 * run.ledger.total[0]
    given = sum(run.ledger.dissipated.get(cause, np.zeros(1))[-1] for cause in ("joints", "contact"))
    assert given >= -1e-12 * run.ledger.total[0]
