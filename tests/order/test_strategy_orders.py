"""How the error of whole runs falls with the step, strategy by strategy, as the rows of a study show it.

After the fact: an impact is seen at the end of its step, late by up to h: order 1. By the tangent from the start of the step:
|gap''| t^2 / 2 c with t <= h: order 2. By bisection: no step in it at all, only the tolerance. Two dozen capsules that fall and spin, so
that impacts lie anywhere in their steps; the median error of a first impact follows the law, and a slope over four halvings is known to
some 0.15. (The largest does not: a tip that moves away at the start of its step has no tangent to go down, and is found a step later.)
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import rigidimpulse as ri

NUMBER, DURATION = 24, 0.6
STEPS = (1 / 60, 1 / 120, 1 / 240, 1 / 480, 1 / 960)


def batons() -> ri.Scene:
    """Capsules over a floor, each on a track of its own."""
    random = np.random.default_rng(4)
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for k in range(NUMBER):
        turn = random.normal(size=4)
        scene.add(
            ri.Body(
                f"baton {k}", ri.Shape.capsule(0.07, 0.6), position=(0, 2.0 * k, random.uniform(1.0, 2.0)),
                orientation=turn / np.linalg.norm(turn), velocity=(0, 0, random.uniform(-4, -2)), angular_velocity=random.normal(0, 6, 3),
                material=ri.Material(restitution=0.2),
            )
        )  # fmt: skip
    return scene


@cache
def first_impacts(accuracy: ri.Accuracy) -> np.ndarray:
    """Time of the first impact of each baton, s."""
    impacts = ri.simulate(batons(), DURATION, accuracy=accuracy).impacts
    return np.array([impacts["time"][np.maximum(impacts["body_a"], impacts["body_b"]) == k + 1][0] for k in range(NUMBER)])


@pytest.mark.parametrize(("impact_time", "order"), [("after", 1), ("linear", 2)])
def test_impact_times_have_their_order(impact_time: str, order: int) -> None:
    exact = first_impacts(ri.Accuracy())
    errors = [np.median(np.abs(first_impacts(ri.Accuracy(impact_time=impact_time, step=step)) - exact)) for step in STEPS]
    slope = np.polyfit(np.log(STEPS), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.3)


def test_bisection_has_no_step_in_it() -> None:
    exact = first_impacts(ri.Accuracy())
    for step in STEPS[::2]:
        # Times differ by the tolerance, 1e-13 of 0.7 m over a closing speed of some m/s.
        assert np.abs(first_impacts(ri.Accuracy(step=step)) - exact).max() < 1e-12


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7])
def test_bisection_is_as_early_as_its_tolerance(tolerance: float) -> None:
    exact = first_impacts(ri.Accuracy())
    early = exact - first_impacts(ri.Accuracy(tolerance=tolerance))
    # A gap of tolerance times the size, 0.14 to 0.74 m, over a closing speed of 1 m/s and more.
    assert early.min() > -1e-12
    assert 1e-3 * tolerance < early.max() < 0.74 * tolerance
