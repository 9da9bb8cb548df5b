"""Issue 27: contact that costs more than it advances is handed to sub-steps in the middle of a step, and no pair is left alone."""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri


def boxes_on_a_plank() -> ri.Scene:
    """Two boxes fall on a plank that hangs on a hinge over the floor."""
    wood = ri.Material(density=700, restitution=0.2, static_friction=0.5, dynamic_friction=0.4)
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static", material=wood)])
    scene.add(ri.Body("plank", ri.Shape.box((1.0, 0.3, 0.05)), position=(0.0, 0.0, 0.4), material=wood))
    scene.add(ri.HingeJoint("plank", None, (0.0, 0.0, 0.4), (0.0, 1.0, 0.0)))
    for k, x in enumerate((-0.3, 0.1)):
        scene.add(ri.Body(f"box {k}", ri.Shape.box(0.12), position=(x, 0.0, 0.6 + 0.2 * k), material=wood))
    return scene


@pytest.mark.parametrize("solver", ["auto", "newton"])
def test_an_island_that_runs_away_goes_on_in_sub_steps(solver: str) -> None:
    """In a step of 1 s the plank is dealt with more than 300 times: an event says so, nothing is inside anything, no energy is made.

    "newton" forbids it.
    """
    run = ri.simulate(boxes_on_a_plank(), 1.0, accuracy=ri.Accuracy(contact_solver=solver, step=1.0))
    handed = [event for event in run.status.events if event.kind == "handed to sub-steps"]
    assert run.status.ok, run.status.message
    assert bool(handed) == (solver == "auto")
    assert all(not event.is_problem and 0.0 < event.time < 1.0 for event in handed)
    for name in ("plank", "box 0", "box 1"):
        assert run.position(name)[:, 2].min() > 0.0
    total = run.ledger.kinetic + run.ledger.potential
    assert np.diff(total).max() < 1e-3 * run.ledger.kinetic.max()
