"""Galperin's counting balls: a ball between a wall and one 100^k times as heavy makes 3, 31, 314, 3141 impacts.

G. Galperin, Playing pool with pi (the number pi from a billiard point of view), Regular and Chaotic Dynamics 8
(2003). Distances free to travel: s of the light ball m from the wall, b of the heavy one M from the wall with the
light one in between. In the coordinates (X, Y) = (sqrt(M) b, sqrt(m) s) the motion is that of light in the wedge 0 <=
angle <= theta, tan(theta) = sqrt(m / M), and unfolds to a straight line. From rest of the light ball, and speed V of
the heavy one, it is Y = sqrt(m) s0: impact k is where the line crosses the angle k theta,

    t_k = (b0 - sqrt(m / M) s0 / tan(k theta)) / V,   k = 1 .. ceil(pi / theta) - 1

and the heavy ball leaves with V_k = -V cos(2 theta ceil(k / 2)) away from the wall.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

RADIUS = 0.125
GROWTH = 0.0625
"""m by which the heavy ball's radius grows with each power of 100."""
WALL = 0.25
"""m, thickness."""
LIGHT_MASS = 1.0
LIGHT_GAP = 0.75
HEAVY_GAP = 1.5
SPEED = 1.0
COUNTS = (3, 31, 314, 3141)
DURATIONS = (3.0, 3.5, 6.5, 3.5)
"""s, half a second and more after the last impact."""
ROUNDING = 2e-15
"""Of one impact, relative to the speeds; the errors of n impacts add up to n times as much at most."""
TIME_ROUNDING = 3e-13
"""s, of one impact: 1e-13 of the light ball's diameter on either side of it, at the slowest approach, 0.17 m/s."""


def scene(power: int) -> Scene:
    """Return the wall and the balls, the heavy one 100^power times as heavy."""
    elastic = Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    wall = Shape.box((WALL, 8.0 * RADIUS, 8.0 * RADIUS))
    scene.add(Body("wall", wall, motion="static", position=(-0.5 * WALL, 0, 0), material=elastic))
    scene.add(
        Body("light", Shape.sphere(RADIUS), position=(RADIUS + LIGHT_GAP, 0, 0), mass=LIGHT_MASS, material=elastic)
    )
    radius = RADIUS + GROWTH * power
    start = (2.0 * RADIUS + radius + HEAVY_GAP, 0, 0)
    heavy = Shape.sphere(radius)
    mass = LIGHT_MASS * 100.0**power
    scene.add(Body("heavy", heavy, position=start, velocity=(-SPEED, 0, 0), mass=mass, material=elastic))
    return scene


def check(power: int, run: Recording) -> list[Check]:
    """Compare with the unfolded line."""
    ratio = 10.0**-power
    theta = math.atan(ratio)
    number = math.ceil(math.pi / theta) - 1
    angles = theta * np.arange(1, number + 1)
    times = (HEAVY_GAP - ratio * LIGHT_GAP / np.tan(angles)) / SPEED
    late = np.abs(run.impacts["time"] - times).max() if len(run.impacts) == number else np.inf
    leaving = -SPEED * math.cos(2.0 * theta * math.ceil(number / 2))
    kinetic = run.ledger.kinetic if run.ledger else np.array([np.nan])
    bound = ROUNDING * max(number, 10)
    return [
        equal("impacts", len(run.impacts), COUNTS[power], "digits of pi (Galperin 2003)"),
        at_most("error of the impact times, s", late, TIME_ROUNDING * number, "crossings of the unfolded line"),
        at_most(
            "error of the heavy ball's speed, m/s",
            abs(run.velocity("heavy")[-1, 0] - leaving),
            bound * SPEED,
            "V' = -V cos(2 theta ceil(N / 2))",
        ),
        at_most("energy, relative change", np.ptp(kinetic) / kinetic[0], bound, "e = 1 keeps energy"),
    ]


SCENES = tuple(
    GalleryScene(
        f"galperin_{power}",
        f"A ball between a wall and one {'as heavy' if power == 0 else f'{100**power:,} times as heavy'}: "
        f"{count} impacts, digits of pi",
        partial(scene, power),
        partial(check, power),
        DURATIONS[power],
    )
    for power, count in enumerate(COUNTS)
)
