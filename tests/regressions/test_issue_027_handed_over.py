"""Issue 27: contact that costs more than it advances is handed to sub-steps in the middle of a step, and no pair is left alone."""

from __future__ import annotations

from collections.abc import Callable

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


ELASTIC = ri.Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
RUBBER = ri.Material(restitution=0.9, static_friction=0.0, dynamic_friction=0.0)


def elastic_tower() -> ri.Scene:
    """A post of 1.4 g on a hinge, with a cap, under 300 kg, all with e = 1: it was stepped by 1e-8 s for ever."""
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    scene.add(ri.Body("post", ri.Shape.cylinder(0.2, 0.68), position=(-0.03, 0, 0.34), mass=0.0014, material=ELASTIC))
    scene.add(ri.Body("cap", ri.Shape.box((0.04, 0.13, 0.04)), position=(0, 0, 0.7), mass=9.4, material=ELASTIC))
    scene.add(ri.Body("load", ri.Shape.box((0.1, 0.3, 0.2)), position=(0.001, 0, 0.82), mass=300.0, material=ELASTIC))
    scene.add(ri.FixedJoint("post", "cap", anchor=(-0.02, 0, 0.68)))
    scene.add(ri.HingeJoint(None, "post", (0.1, 0, 0.3), (0, 0.6, 0.8)))
    return scene


def pressed_roll() -> ri.Scene:
    """A plate of 285 kg falls on a roll of 1.9 g with e = 0.9, which rattled below it by the million times, within one call of a kernel."""
    smooth = ri.Material(static_friction=0.0, dynamic_friction=0.0)
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static", material=smooth)])
    for k, way in enumerate(((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0))):
        scene.add(ri.Body(f"side {k}", ri.Shape.half_space(way, -1.0), motion="static", material=smooth))
    scene.add(ri.Body(
        "plate", ri.Shape.box((0.17748244071026187, 0.17748244071026187, 0.035496488142052376)), mass=285.26055922761617,
        position=(0.2537491251606181, 0.2537491251606181, 0.6343728129015452), material=RUBBER,
        velocity=(-1.0191763009741246, -1.011412137014143, -2.0500989359210235),
    ))  # fmt: skip
    scene.add(ri.Body(
        "stone", ri.Shape.capsule(0.06267493094296828, 0.025069972377187312), position=(0.0, -0.2537491251606181, 0.38062368774092714),
        orientation=(0.5920806479644939, 0.10271537698833964, -0.7280576776397524, -0.32988191169856323), mass=1.9429979334233758,
        velocity=(0.014084342756062984, 1.0128389714948098, -0.8831390187317731), material=RUBBER,
    ))  # fmt: skip
    scene.add(ri.Body(
        "roll", ri.Shape.cylinder(0.05215967544398352, 0.10431935088796704), position=(0.0, 0.0, 0.12687456258030905),
        mass=0.001856553392418058, material=RUBBER, velocity=(0.014919026937541569, -0.020804849730072173, 0.08250964563601788),
    ))  # fmt: skip
    scene.add(ri.ConstantForce("plate", (-2294.9279201180675, 1442.967453615659, 19.515226490121144)))
    return scene


@pytest.mark.parametrize("make", [elastic_tower, pressed_roll])
def test_elastic_bodies_have_a_budget_too(make: Callable[[], ri.Scene]) -> None:
    """These never came back; no energy is made, whatever regime goes on."""
    run = ri.simulate(make(), 0.5)
    assert [event.kind for event in run.status.events] == ["handed to sub-steps"]
    # Without what rising by a contact margin gives.
    total = run.ledger.total + run.ledger.dissipated["position correction"]
    assert (total - np.minimum.accumulate(total)).max() < 1e-3 * run.ledger.kinetic.max() + 1e-6
