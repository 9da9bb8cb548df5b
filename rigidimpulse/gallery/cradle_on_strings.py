"""Newton's cradle as it stands on a table: five steel balls that touch, each on two strings.

Each ball hangs by its middle, so it moves as a point on a pendulum of length L: with w = sqrt(g / L), k = sin(A / 2) for the angle A from
which it is let go, and K = K(k) the quarter of the period times w,

    sin(q / 2) = k cd(w t, k),    T = 4 K / w

The first ball comes down in T / 4, the last goes out and is back at 3 T / 4, the first goes up and is back where it began at T. Equal balls
exchange velocities (B3), and three stand still. As in a real one the balls touch: the impulse runs through the row, pair after pair.

Joints are of second order: at default settings the ball is 4e-6 m off after 3 s, and the energy 1e-6 of the swing. A row that took the
impulse as one body would send four balls out, 7e-2 m off.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.looks import STEEL, WOOD
from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import DistanceJoint
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual

NUM_BALLS, RADIUS, LENGTH, ANGLE, ASIDE, GRAVITY = 5, 0.02, 0.2, 0.7, 0.07, 9.81
"""m and rad; ASIDE: from the middle of the row to the bars that the strings hang from."""
BAR, BASE = 0.004, 0.012
"""m: radius of the bars, thickness of the base."""
DURATION = 3.0
BOUND, ENERGY = 2e-5, 1e-5


def scene() -> Scene:
    """Return the cradle, whose first ball is let go."""
    steel = Material(density=7800.0, restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    wide, up = 2.0 * RADIUS * NUM_BALLS + 0.06, LENGTH
    base = Shape.box((wide + 0.03, 2.0 * ASIDE + 0.03, BASE))
    place = (0.0, 0.0, -0.05)
    scene.add(Body("base", base, motion="static", position=place, material=steel, visual=Visual(color=WOOD)))
    scene.add(Body("frame", _frame(wide, up, place[2]), motion="static", material=steel, visual=Visual(color=STEEL)))
    for k in range(NUM_BALLS):
        name, hook, angle = f"ball {k + 1}", np.array([_home(k), 0.0, up]), ANGLE if k == 0 else 0.0
        place = hook - LENGTH * np.array([np.sin(angle), 0.0, np.cos(angle)])
        scene.add(Body(name, Shape.sphere(RADIUS), position=place, material=steel, visual=Visual(color=STEEL)))
        for side, label in ((-1.0, "near"), (1.0, "far")):
            scene.add(DistanceJoint(None, name, hook + [0.0, side * ASIDE, 0.0], place, name=f"{label} string {k + 1}"))
    return scene


def _home(k: int) -> float:
    """Where ball k hangs, m along the row."""
    return 2.0 * RADIUS * (k - 0.5 * (NUM_BALLS - 1))


def _frame(wide: float, up: float, floor: float) -> Shape:
    """Return two bars on four posts."""
    along, upright = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0), (1.0, 0.0, 0.0, 0.0)
    parts = [(Shape.cylinder(BAR, wide), (0.0, side * ASIDE, up), along) for side in (-1.0, 1.0)]
    tall = up - floor
    for x in (-0.5 * wide, 0.5 * wide):
        parts += [(Shape.cylinder(BAR, tall), (x, side * ASIDE, floor + 0.5 * tall), upright) for side in (-1.0, 1.0)]
    return Shape.compound(parts)


def _outer_balls(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles (f,) rad of the first and of the last ball; one of them hangs."""
    from scipy.special import ellipj, ellipk

    k, w = np.sin(0.5 * ANGLE), np.sqrt(GRAVITY / LENGTH)
    _, cn, dn, _ = ellipj(w * times, k**2)
    swing = 2.0 * np.arcsin(k * cn / dn)
    phase = np.mod(times * w / ellipk(k**2), 4.0)
    first = (phase < 1.0) | (phase > 3.0)
    return np.where(first, swing, 0.0), np.where(first, 0.0, swing)


def exact(times: np.ndarray) -> Exact:
    """Return the motion by closed form."""
    first, last = _outer_balls(times)
    hanging = np.zeros(len(times))
    position = {}
    for k in range(NUM_BALLS):
        q = first if k == 0 else last if k == NUM_BALLS - 1 else hanging
        position[f"ball {k + 1}"] = np.column_stack([_home(k) - LENGTH * np.sin(q), hanging, LENGTH * (1.0 - np.cos(q))])
    return Exact(position=position, energy=hanging)


def check(run: Recording) -> list[Check]:
    """Compare all balls with the closed form."""
    assert run.ledger is not None
    law = exact(run.times).position
    names = [f"ball {k + 1}" for k in range(NUM_BALLS)]
    off = {name: float(np.linalg.norm(run.position(name) - law[name], axis=1).max()) for name in names}
    swing = GRAVITY * LENGTH * (1.0 - np.cos(ANGLE)) * 7800.0 * 4.0 / 3.0 * np.pi * RADIUS**3
    return [
        at_most("error of the first and the last ball, m", max(off[names[0]], off[names[-1]]), BOUND, "sin(q / 2) = k cd(w t, k)"),
        at_most("motion of the other three, m", max(off[name] for name in names[1:-1]), BOUND, "one in, one out"),
        at_most("change of energy, of the swing", np.ptp(run.ledger.total) / swing, ENERGY, "e = 1, strings do no work"),
        equal("problems that the status names", len(run.status.problems), 0, "default settings are enough"),
    ]


SCENES = (GalleryScene("cradle_strings", "Newton's cradle on strings: one ball in, one ball out", scene, check, DURATION, exact=exact),)
