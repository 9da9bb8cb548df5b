"""Steps in which nothing but members of sub-stepped islands moves are taken without the order of events, and nothing else may come of it.

A trigger that nothing comes near looks at the run between all steps, so that each goes through the order of events: both runs must have
the same bits. That they went different ways is seen from how often contacts were looked for in the order of events.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import rigidimpulse as ri

BOX = ri.Shape.box((0.1, 0.1, 0.1))


def _floor() -> ri.Scene:
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    return scene


def _dominoes() -> ri.Scene:
    scene = _floor()
    for k in range(7):
        scene.add(ri.Body(f"domino {k}", ri.Shape.box((0.02, 0.1, 0.2)), position=(0.1 * k, 0, 0.1)))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.03), position=(-0.2, 0, 0.16), velocity=(1.5, 0, 0)))
    return scene


def _fall(number: int) -> ri.Scene:
    """Boxes that fall in layers of nine, turned at random."""
    scene, random = _floor(), np.random.default_rng(3)
    for k in range(number):
        place = (0.14 * (k % 3), 0.14 * (k // 3 % 3), 0.1 + 0.17 * (k // 9))
        turn = random.normal(size=4)
        scene.add(ri.Body(f"box {k}", BOX, position=place, orientation=turn / np.linalg.norm(turn)))
    return scene


def _piles() -> ri.Scene:
    """A pile sleeps; bodies that fall elsewhere slide into it."""
    scene, smooth = _floor(), ri.Material(static_friction=0.05, dynamic_friction=0.05)
    for k in range(6):
        scene.add(ri.Body(f"rests {k}", BOX, position=(0.1 * (k % 3), 0, 0.05 + 0.1 * (k // 3))))
        scene.add(
            ri.Body(f"slides {k}", BOX, position=(-3.2 - 0.1 * (k % 3), 0, 0.06 + 0.11 * (k // 3)), velocity=(2, 0, 0), material=smooth)
        )
    return scene


def _shot(start: float) -> ri.Scene:
    """A heavy sled hits a light box in the middle of a step; this reaches a box that rests beyond, within the same step."""
    scene = _floor()
    ice = ri.Material(static_friction=0, dynamic_friction=0, restitution=0.5)
    heavy = ri.Material(static_friction=0, dynamic_friction=0, restitution=0.5, density=8000)
    scene.add(ri.Body("rests", BOX, position=(0.3, 0, 0.05)))
    scene.add(ri.Body("light", BOX, position=(0, -0.4 * start / 12, 0.05), velocity=(0, 0.4, 0), material=ice))
    scene.add(ri.Body("sled", BOX, position=(-start, 0, 0.05), velocity=(12, 0, 0), material=heavy))
    return scene


SCENES: dict[str, Callable[[], ri.Scene]] = {
    "dominoes": _dominoes, "few": lambda: _fall(9), "many": lambda: _fall(63), "piles": _piles, "early shot": lambda: _shot(7.13),
    "shot": lambda: _shot(7.15), "late shot": lambda: _shot(7.17),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "accuracy", "fps", "duration"),
    [
        ("dominoes", "preview", 60, 1.5),
        ("few", "preview", 24, 1.0),
        ("many", "preview", 100, 0.6),
        ("many", "standard", 60, 0.6),
        ("piles", "substepped", 24, 2.5),
        ("early shot", "substepped", 60, 0.7),
        ("shot", "substepped", 60, 0.7),
        ("late shot", "substepped", 60, 0.7),
    ],
)
def test_motion_is_that_of_the_order_of_events(name: str, accuracy: str, fps: float, duration: float) -> None:
    settings = ri.Accuracy(contact_solver="substepped") if accuracy == "substepped" else accuracy
    alone = ri.simulate(SCENES[name](), duration, fps=fps, accuracy=settings)
    watched_scene = SCENES[name]()
    watched_scene.add(ri.Trigger("nothing comes here", ri.Shape.box(0.1), position=(0, 0, 90)))
    watched = ri.simulate(watched_scene, duration, fps=fps, accuracy=settings)
    for what in ("positions", "orientations", "velocities", "angular_velocities"):
        assert np.array_equal(getattr(alone, what), getattr(watched, what)), what
    assert alone.impacts.shape == watched.impacts.shape and np.array_equal(alone.ledger.total, watched.ledger.total)
    assert sorted(alone.ledger.dissipated) == sorted(watched.ledger.dissipated)
    for cause, taken in alone.ledger.dissipated.items():
        assert np.array_equal(taken, watched.ledger.dissipated[cause]), cause
    in_order = [run.plan.line("contact detection").calls for run in (alone, watched)]
    assert in_order[0] + 20 < in_order[1], in_order
    counts = [run.plan.line("sub-stepped islands").counts for run in (alone, watched)]
    assert counts[0] == counts[1]


def test_bodies_that_sleep_are_woken_by_what_slides_into_them() -> None:
    """What slept stands still until it is hit, and is pushed on by a centimetre then."""
    run = ri.simulate(_piles(), 2.5, accuracy=ri.Accuracy(contact_solver="substepped"))
    assert run.status.ok
    x = run.position("rests 0")[:, 0]
    assert np.abs(x[:60]).max() < 1e-3 and x[-1] > 0.01
