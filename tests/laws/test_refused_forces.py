"""Contact forces that are no solution: refused where they would make energy, and said in any case.

The solver of rows says how far its impulses are from the laws of contact. Here it is exact, and then its impulses are spoilt: multiplied,
or no numbers at all, with an honest residual. Law: energy never grows by more than contact margins, 2 delta m g, whatever the solver does;
forces of thirty times what is needed would throw a body of 1 kg up with 29 g h, 11 J in one step.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.engine.simulate import complete, frame_times, prepare

G, SIZE, SPEED = 9.81, 0.2, 2.0
GAP = 2.0 * TOLERANCES.contact.margin * SIZE


def spoilt(factor: float, start: float, end: float = np.inf):
    """A row solver whose answers to calls in [start, end) are multiplied by a factor."""
    calls = 0

    def solve(rows, n: int, target: float) -> float:
        nonlocal calls
        calls += 1
        return spoil(rows, n, target, factor) if start <= calls < end else solve_newton(rows, n, target)

    return solve


def spoil(rows, n: int, target: float, factor: float) -> float:
    """Solve rows, and multiply the impulses by a factor."""
    solve_newton(rows, n, target)
    rows.impulse[:] *= factor
    return np.inf


def sliding_box(solver) -> ri.Recording:
    """Run of a box of 1 kg that slides on a floor."""
    run = prepare(sliding_scene(), frame_times(0.5, 60.0), ri.Accuracy())
    run.solve_rows = solver
    return complete(run, 0.5)


def sliding_scene(hinged: bool = False) -> ri.Scene:
    """A box of 1 kg that slides on a floor, maybe with a flap hinged to it."""
    rough = ri.Material(static_friction=0.2, dynamic_friction=0.2, restitution=0.0)
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=rough))
    moves = {"velocity": (SPEED, 0, 0), "mass": 1.0, "material": rough}
    scene.add(ri.Body("box", ri.Shape.box(SIZE), position=(0, 0, 0.5 * SIZE), **moves))
    if hinged:
        scene.add(ri.Body("flap", ri.Shape.box((SIZE, SIZE, 0.02)), position=(0, 0, SIZE + 0.01), **moves))
        scene.add(ri.HingeJoint("box", "flap", (0.5 * SIZE, 0, SIZE), (0, 1, 0), name="hinge"))
    return scene


def rise(run: ri.Recording) -> float:
    """Largest growth of the energy from an earlier frame to a later one, J."""
    total = run.ledger.total
    return float((total - np.minimum.accumulate(total)).max())


@pytest.mark.parametrize("factor", [30.0, 1e6, np.nan])
@pytest.mark.parametrize(("start", "end"), [(1, np.inf), (10, 16)])
def test_energy_never_grows_by_forces_that_are_no_solution(factor, start, end) -> None:
    run = sliding_box(spoilt(factor, start, end))
    assert np.all(np.isfinite(run.positions)) and np.all(np.isfinite(run.velocities))
    assert [event.kind for event in run.status.events] == ["contact forces not solved"]
    assert rise(run) < 2.0 * GAP * G


@pytest.mark.parametrize(
    ("regime", "said"), [("newton", {"contact forces not solved", "joints not closed"}), ("auto", {"handed to sub-steps"})]
)
@pytest.mark.parametrize("factor", [1e6, np.nan])
def test_nor_by_those_of_joints(factor: float, regime: str, said: set[str]) -> None:
    """All of the rounds that close the joints are spoilt, for 30 ms. Joints are of second order: 1e-3 of the energy.

    Where the planner may choose, what has no solution goes to sub-steps at that instant.
    """
    begun = prepare(sliding_scene(hinged=True), frame_times(0.5, 60.0), ri.Accuracy(contact_solver=regime))

    def solve(rows, n: int, target: float) -> float:
        return spoil(rows, n, target, factor) if 0.1 <= begun.state.time < 0.13 else solve_newton(rows, n, target)

    begun.solve_rows = solve
    run = complete(begun, 0.5)
    assert np.all(np.isfinite(run.positions)) and np.all(np.isfinite(run.velocities))
    assert np.all(np.isfinite(run.reaction("hinge")))
    assert said & {event.kind for event in run.status.events}
    assert rise(run) < 1e-3 * run.ledger.kinetic[0]


def test_forces_that_fall_short_are_used_and_said() -> None:
    """Half of what is needed makes no energy: better than nothing. The status tells, and the contacts show what acted."""
    exact = sliding_box(solve_newton)
    assert exact.status.ok
    np.testing.assert_allclose(exact.velocity("box")[:, 0], SPEED - 0.2 * G * exact.times, atol=1e-9)
    run = sliding_box(spoilt(0.5, 1))
    assert [event.kind for event in run.status.events] == ["contact forces not solved"]
    assert "use a smaller step" in run.status.message
    assert rise(run) < 2.0 * GAP * G
    np.testing.assert_allclose(run.contact_force("box")[0], 0.5 * G * np.array([-0.2, 0.0, 1.0]), atol=1e-9)
    assert exact.velocity("box")[-1, 0] < run.velocity("box")[-1, 0] < SPEED
