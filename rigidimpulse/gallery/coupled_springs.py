"""Three sliders on four springs between walls: normal modes, and a swing that wanders.

    m x'' = -k A x,   A = tridiag(-1, 2, -1):   w_j^2 = (2 k / m)(1 - cos(j pi / 4)),   modes sin(i j pi / 4)

Three rows begin in one mode each and stay in it; the fourth begins with one slider pushed, a sum of all modes.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.dynamics.forces.spring import Spring
from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

MASS, STIFFNESS, COUNT, SPACING, ROW = 1.0, 30.0, 3, 1.0, 0.6
SIZE = (0.3, 0.3, 0.3)
AMPLITUDE = 0.2
DURATION = 6.0
BOUND = 1e-6
"""m: 360 steps, each off by up to 1e-8 of 0.26 m."""
MODES = np.sin(np.outer(np.arange(1, COUNT + 1), np.arange(1, COUNT + 1)) * np.pi / (COUNT + 1))
"""(sliders, modes)."""
RATES = np.sqrt(2.0 * STIFFNESS / MASS * (1.0 - np.cos(np.arange(1, COUNT + 1) * np.pi / (COUNT + 1))))
STARTS = {**{f"mode {j + 1}": AMPLITUDE * MODES[:, j] for j in range(COUNT)}, "one pushed": AMPLITUDE * np.eye(COUNT)[0] * 1.5}
"""Ways of the sliders at the start, m."""


def scene() -> Scene:
    """Return the rows along x, side by side along y."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    width = (COUNT + 1) * SPACING
    for sign, name in ((-1, "left wall"), (1, "right wall")):
        place = (0.5 * width + sign * (0.5 * width + 0.05), 0.5 * (len(STARTS) - 1) * ROW, 0.0)
        scene.add(Body(name, Shape.box((0.1, len(STARTS) * ROW, 0.4)), motion="static", position=place))
    for r, (row, start) in enumerate(STARTS.items()):
        y, names = r * ROW, [f"{row}, slider {i + 1}" for i in range(COUNT)]
        places = [(i + 1) * SPACING + start[i] for i in range(COUNT)]
        for name, x in zip(names, places, strict=True):
            scene.add(Body(name, Shape.box(SIZE), mass=MASS, position=(x, y, 0.0)))
        ends, at = ["left wall", *names, "right wall"], [0.0, *places, width]
        for k in range(COUNT + 1):
            scene.add(Spring(ends[k], ends[k + 1], (at[k], y, 0.0), (at[k + 1], y, 0.0), STIFFNESS, rest_length=SPACING))
    return scene


def exact(times: np.ndarray) -> Exact:
    """Return the ways of all sliders as sums of modes."""
    ways = {f"{row}, slider {i + 1}": _sum_of_modes(row, times)[:, i] + SPACING * (i + 1) for row in STARTS for i in range(COUNT)}
    sideways = {f"{row}, slider {i + 1}": r * ROW for r, row in enumerate(STARTS) for i in range(COUNT)}
    level = np.zeros(len(times))
    places = {name: np.stack([way, level + sideways[name], level], axis=1) for name, way in ways.items()}
    return Exact(places, energy=level)


def _sum_of_modes(row: str, times: np.ndarray) -> np.ndarray:
    """Return the ways (f, sliders) [m] from where the sliders of a row rest."""
    share = np.linalg.solve(MODES, STARTS[row])
    return (share * np.cos(np.outer(times, RATES))) @ MODES.T


def check(run: Recording) -> list[Check]:
    """Compare every slider with the sum of modes, and the energy with its start."""
    checks = []
    for row in STARTS:
        x = _sum_of_modes(row, run.times)
        found = np.column_stack([run.position(f"{row}, slider {i + 1}")[:, 0] for i in range(COUNT)]) - SPACING * np.arange(1, COUNT + 1)
        checks.append(at_most(f"{row}: way, m", np.abs(found - x).max(), BOUND, "sum of normal modes"))
    assert run.ledger is not None
    checks.append(at_most("energy, relative", np.ptp(run.ledger.total) / run.ledger.total[0], BOUND, "springs store what they take"))
    return checks


SCENES = (
    GalleryScene(
        "coupled_springs", "Sliders on springs in their normal modes, and in all of them", scene, check, DURATION, exact=exact
    ),
)
