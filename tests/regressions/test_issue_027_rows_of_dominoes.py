"""Issue 27: rows of dominoes that stand flush on the floor fall, however many they are."""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate

THICKNESS, WIDTH, HEIGHT, APART = 0.0075, 0.024, 0.048, 0.024
COUNT = 100
KICK = 6.0
"""Spin of the first domino about its lower edge, rad/s."""


def fall(number: int, duration: float) -> tuple[ri.Recording, np.ndarray]:
    """A row of dominoes, and when each leans beyond the angle from which it falls by itself [s], nan for never."""
    scene, shape = ri.Scene(gravity=(0.0, 0.0, -9.81)), ri.Shape.box((THICKNESS, WIDTH, HEIGHT))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for k in range(number):
        spin = (0.0, KICK if k == 0 else 0.0, 0.0)
        velocity = tuple(np.cross(spin, (-0.5 * THICKNESS, 0.0, 0.5 * HEIGHT)).tolist())
        place = (APART * k, 0.0, 0.5 * HEIGHT)
        scene.add(ri.Body(f"domino {k}", shape, position=place, velocity=velocity, angular_velocity=spin))
    run = ri.simulate(scene, duration)
    up = np.stack([rotate(run.orientation(f"domino {k}"), np.array([0.0, 0.0, 1.0]))[:, 2] for k in range(number)])
    leans = up < HEIGHT / np.hypot(HEIGHT, THICKNESS)
    return run, np.where(leans.any(axis=1), run.times[np.argmax(leans, axis=1)], np.nan)


def test_a_hundred_dominoes_fall_one_after_the_other() -> None:
    """Raising 200 bodies to the skin once took 96 % of the kick off the first; now each pays for itself, and the wave goes on evenly.

    The ledger names what raising those at rest gave: less than the weight of all times the skin, 0.8 % of half a thickness. Two hundred do
    the same in twice the time.
    """
    run, began = fall(COUNT, 3.7)
    assert run.status.ok
    assert np.all(np.isfinite(began)) and np.all(np.diff(began) >= 0.0)
    early, late = (APART * 35 / (began[k + 35] - began[k]) for k in (20, 60))
    # Sixty and fewer, which are stepped finely, run at 0.69 m/s.
    assert 0.65 < late < 0.8 and abs(late - early) < 0.03 * early
    energy, given = run.ledger.total, -run.ledger.dissipated["position correction"][-1]
    weight = COUNT * 1000.0 * THICKNESS * WIDTH * HEIGHT * 9.81
    assert 0.0 < given < weight * 8e-3 * 0.5 * THICKNESS
    assert (energy - np.minimum.accumulate(energy)).max() < 1.01 * given


def test_a_position_correction_costs_nothing_of_what_it_does_not_touch() -> None:
    """Boxes flush on a floor join a sub-stepped island beside one that slides without friction: it keeps its speed."""
    scene, ice = ri.Scene(gravity=(0.0, 0.0, -9.81)), ri.Material(static_friction=0.0, dynamic_friction=0.0)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ice))
    for k in range(100):
        velocity = (0.2, 0.0, 0.0) if k == 0 else (0.0, 0.0, 0.0)
        scene.add(ri.Body(f"box {k}", ri.Shape.box(0.1), position=(0.0, 0.12 * k, 0.05), velocity=velocity, material=ice))
    run = ri.simulate(scene, 0.2)
    assert run.plan.line("sub-stepped islands").counts["largest island"] == 100
    # It pays for its own rise alone: at most its weight times the skin of 0.4 mm.
    speed = run.velocity("box 0")[-1, 0]
    assert 0.2**2 - 2.0 * 9.81 * 4e-4 < speed**2 <= 0.2**2


def slide_on_a_column(number: int, solver: str) -> tuple[ri.Recording, str]:
    """Boxes flush on each other, without friction; the top one slides at 0.2 m/s."""
    scene, ice = ri.Scene(gravity=(0.0, 0.0, -9.81)), ri.Material(static_friction=0.0, dynamic_friction=0.0, restitution=0.0)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ice))
    top = f"box {number - 1}"
    for k in range(number):
        velocity = (0.2, 0.0, 0.0) if k == number - 1 else (0.0, 0.0, 0.0)
        scene.add(ri.Body(f"box {k}", ri.Shape.box(0.1), position=(0.0, 0.0, 0.05 + 0.1 * k), velocity=velocity, material=ice))
    return ri.simulate(scene, 0.1, accuracy=ri.Accuracy(contact_solver=solver)), top


def test_the_top_of_a_column_pays_for_its_own_rise_alone() -> None:
    """Each of 12 boxes is raised by a fifth of the skin, 0.08 mm, above the one below. One that paid for all would stop.

    Springs that raise them further make a little energy, which is taken off what moves: a sixth of the top's.
    """
    run, top = slide_on_a_column(12, "substepped")
    assert run.status.ok
    rise = 12 * 0.2 * 8e-3 * 0.05
    assert abs(run.velocity(top)[1, 0] ** 2 - (0.2**2 - 2.0 * 9.81 * rise)) < 0.17 * 0.2**2


def test_motion_that_is_paid_for_a_rise_is_reported_and_the_remedy_helps() -> None:
    """The springs of the column made an eighth of all that moves beside, once. All contacts solved together make none."""
    run, top = slide_on_a_column(25, "substepped")
    (paid,) = run.status.problems
    assert (paid.kind, paid.bodies) == ("motion taken in a sub-stepped island", (top,))
    run, top = slide_on_a_column(25, "newton")
    assert run.status.ok and abs(run.velocity(top)[-1, 0] - 0.2) < 2e-3
