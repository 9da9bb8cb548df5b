"""Where little is left of a step, sub-steps are short; springs that grew stiffer without bound made energy in them, and it was taken back.

A hundred boxes that came to rest had 50 J of nothing in a last step of 1e-8 s, 5e5 J in one of 1e-10 s, and a row of dominoes 1.5e14 J in
one of 4e-16 s, which was the rounding error of 222 / 60. The balance of energy took all of it, and the ledger shows it.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

STEP = 1.0 / 60.0


def boxes(apart: float = 1e-3) -> ri.Scene:
    """Two layers of fifty flat boxes, so far apart [m]."""
    scene = ri.Scene(gravity=(0.0, 0.0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for k in range(100):
        place = (0.15 * (k % 10), 0.15 * (k // 10 % 5), 0.025 + (0.05 + apart) * (k // 50))
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.1, 0.1, 0.05)), position=place))
    return scene


@pytest.mark.parametrize("left", [1e-5, 1e-6, 1e-7, 1e-8, 1e-10])
def test_a_short_last_step_makes_no_energy(left: float) -> None:
    """The upper boxes have fallen by 1 mm, with 0.25 J in all: what is taken back stays below a thousandth of it."""
    run = ri.simulate(boxes(), 10 * STEP + left, fps=1.0 / (10 * STEP + left))
    assert run.plan.line("sub-stepped islands").counts["largest island"] == 100
    assert run.status.ok, run.status.message
    fall = 50 * 1000.0 * 0.1 * 0.1 * 0.05 * 9.81 * 1e-3
    assert abs(run.ledger.dissipated["energy correction"][-1]) < 1e-3 * fall


def test_there_is_no_step_of_the_length_of_a_rounding_error() -> None:
    """23 / 60 s is later than 23 steps of 1/60 s, by a rounding error; the upper boxes landed a twentieth of a second before."""
    steps = 23
    assert 0.0 < steps / 60.0 - steps * STEP < 1e-15
    run = ri.simulate(boxes(apart=0.55), steps / 60.0)
    assert run.times[-1] == steps / 60.0
    assert run.ledger.kinetic[-1] > 0.0
    assert abs(run.ledger.dissipated["energy correction"][-1]) < 1e-3 * np.ptp(run.ledger.potential)
