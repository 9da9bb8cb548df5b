"""Settings to run a scene with: the ladder of ever finer ones, and the grid of all strategies.

A setting is an `Accuracy` with a name; settings of a family differ in one knob, so that the family is a line on a chart. A rung of the
ladder has a step of

    h_k = 2^(1 - k) / 60 s,    tolerance_k = max(1e-7 / 100^k, 1e-13),    k = 0, 1, 2, ...

Impacts are found by bisection, which pays for the tolerance with its logarithm; lasting contacts pay for short steps in full, forces that
vary for both: their errors go with the root of the tolerance.
"""

from __future__ import annotations

from typing import NamedTuple

from rigidimpulse.scene.accuracy import LADDER, PRESETS, Accuracy

COARSEST = 1.0 / 30.0
"""s, step of the lowest rung."""
LOOSE, TIGHT = 1e-7, 1e-13
"""Tolerance on the lowest rung, and on all from the fourth on."""
STEPS = tuple(COARSEST / 2**k for k in range(7))
"""s, of families that differ in their steps: 1/30 to 1/1920."""
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-13)
"""Of families that differ in the tolerance of impact times."""
FEW = (0, 2, 4)
"""Members of a family in the default grid; `full` has all."""


class Setting(NamedTuple):
    """A named accuracy: the family it belongs to, and the value of the knob that its members differ in."""

    name: str
    family: str
    knob: float
    accuracy: Accuracy


def rung(level: int) -> Setting:
    """The setting of a rung of the ladder, level >= 0."""
    accuracy = Accuracy(step=COARSEST / 2**level, tolerance=max(LOOSE / 100.0**level, TIGHT))
    return Setting(f"bisection, step {_fraction(accuracy.step)}", "bisection, step", accuracy.step, accuracy)


def grid(full: bool = False) -> list[Setting]:
    """All settings of the grid, the presets first, then family by family.

    Families: impact time by bisection and by conservative advancement at several tolerances; by the tangent ("linear") and after the
    fact ("after") at several steps; responses without impulses ("kinematic", "penalty") and with simultaneous ones; contact solvers;
    steps of the exact integrator and integrators of fixed steps.
    """
    presets = {name: Accuracy(**PRESETS[name]) for name in LADDER}
    settings = [Setting(name, "presets", accuracy.step, accuracy) for name, accuracy in presets.items()]
    for how in ("bisection", "conservative"):
        for tolerance in _chosen(TOLERANCES, full):
            accuracy = Accuracy(impact_time=how, tolerance=tolerance)
            settings.append(Setting(f"{how}, tolerance {tolerance:.0e}", f"{how}, tolerance", tolerance, accuracy))
    families: dict[str, dict] = {
        "bisection, step": {},
        "linear, step": {"impact_time": "linear"},
        "after, step": {"impact_time": "after"},
        "kinematic, step": {"response": "kinematic"},
        "penalty, step": {"response": "penalty"},
        "simultaneous, step": {"response": "simultaneous"},
        "substepped, step": {"contact_solver": "substepped"},
        "newton, step": {"contact_solver": "newton"},
        "semi-implicit, step": {"integrator": "semi_implicit"},
        "Runge-Kutta, step": {"integrator": "runge_kutta"},
    }
    if full:
        families["qp, step"] = {"contact_solver": "qp"}
    for family, values in families.items():
        for step in _chosen(STEPS, full):
            settings.append(Setting(f"{family} {_fraction(step)}", family, step, Accuracy(step=step, **values)))
    return settings


def _chosen(values: tuple[float, ...], full: bool) -> list[float]:
    return [value for k, value in enumerate(values) if full or k in FEW]


def _fraction(step: float) -> str:
    """A step for people, s."""
    return f"1/{round(1.0 / step)}"
