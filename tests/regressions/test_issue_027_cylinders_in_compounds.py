"""Issue 27: a body of a cylinder and boxes is borne by its boxes as well, in sub-stepped islands."""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.testing import assert_no_penetration

MATERIAL = ri.Material(density=1200, restitution=0.2, static_friction=0.4, dynamic_friction=0.4)


def gear() -> ri.Shape:
    """A disc of 0.1 m and four boxes through it, the eight teeth."""
    turns = [(np.cos(a), 0.0, 0.0, np.sin(a)) for a in np.arange(4) * np.pi / 8]
    teeth = [(ri.Shape.box((0.26, 0.05, 0.05)), (0.0, 0.0, 0.0), turn) for turn in turns]
    return ri.Shape.compound([(ri.Shape.cylinder(0.1, 0.05), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), *teeth])


@pytest.mark.parametrize("angle", [0.0, 0.06, 0.13])
def test_a_cylinder_that_leans_on_a_tooth_does_not_sink_into_it(angle: float) -> None:
    """Contacts of a cylinder with the boxes of a body that has a cylinder, too, were taken for contacts with that.

    The search is done with smaller bodies, and a contact at the corner of a box lies deeper in it than one on a cylinder. So the leaning
    cylinder lay 0.7 to 1 mm inside the tooth, a part of 5e-3 of its size. It may be the gap of contact inside, 1e-5 of its size.
    """
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=MATERIAL))
    turn = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle))
    scene.add(ri.Body("gear", gear(), position=(0.1056, 0.268, 0.0251), orientation=turn, material=MATERIAL))
    lean = np.array([-0.7612, 0.5408, -0.1377, -0.3305])
    scene.add(
        ri.Body(
            "cylinder", ri.Shape.cylinder(0.08, 0.15), position=(0.0497, 0.0701, 0.1045), orientation=lean / np.linalg.norm(lean),
            material=MATERIAL,
        )
    )  # fmt: skip
    run = ri.simulate(scene, 0.4, accuracy=ri.Accuracy(contact_solver="substepped"))
    assert run.status.ok, run.status.message
    assert_no_penetration(run, 1e-5 * 0.17)


@pytest.mark.parametrize("seed", range(3))
def test_the_rim_of_a_mug_does_not_sink_into_a_floor(seed: int) -> None:
    """The rim of the smaller cylinder of the search lies deeper than its faces, by d along the axis and by d across it, not by d in all.

    Mugs that land on a rim sank 0.3 mm into the floor, two fifths of d = 0.84 mm, and came out of it when they lay flat.
    """
    mug = ri.Shape.compound([
        (ri.Shape.cylinder(0.04, 0.1), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
        (ri.Shape.box((0.02, 0.015, 0.06)), (0.05, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
    ])  # fmt: skip
    scene, turn = ri.Scene(), np.random.default_rng(seed).normal(size=4)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=MATERIAL))
    scene.add(ri.Body("mug", mug, position=(0.0, 0.0, 0.3), orientation=turn / np.linalg.norm(turn), material=MATERIAL))
    run = ri.simulate(scene, 1.5, accuracy=ri.Accuracy(contact_solver="substepped"))
    assert run.status.ok, run.status.message
    assert_no_penetration(run, 1e-4)


@pytest.mark.parametrize("seed", range(12))
def test_cylinders_that_stand_upright_after_any_turn_land_when_they_must(seed: int) -> None:
    """A cylinder whose own axis is turned in its mesh frame, and turned back by the body, falls flat: t = sqrt(2 drop / g), to the margin.

    The axis is a unit vector to round-off. Where the rest of it across the normal was taken for a direction, 14 of 25 landed up to
    12 ms too early, and were thrown up.
    """
    turn = np.random.default_rng(seed).normal(size=4)
    turn /= np.linalg.norm(turn)
    back = turn * (1, -1, -1, -1)
    cylinder = ri.Shape.compound([(ri.Shape.cylinder(0.5, 2.0), (0.0, 0.0, 0.0), tuple(turn))])
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("can", cylinder, position=(0, 0, 6.0), orientation=tuple(back), material=ri.Material(restitution=0.0)))
    run = ri.simulate(scene, 1.2)
    assert run.status.ok, run.status.message
    assert run.impacts["time"][0] == pytest.approx(np.sqrt(2.0 * 5.0 / 9.81), abs=1e-5)
    assert run.position("can")[-1] == pytest.approx((0.0, 0.0, 1.0), abs=1e-4)
