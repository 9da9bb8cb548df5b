"""Heavy on light: a cube of mass M on one of mass m = 1 kg, both of side 1 m, M / m = 1e3 and 1e6.

At rest the lower contact carries (M + m) g and the upper one M g: nothing may move. Iterative solvers pass on a share
m / (M + m) of a load in each iteration, so they let the light cube be crushed. Set down or dropped, the light one must not
be entered by more than 1e-4 of its side (the issue's bound; contacts held at a gap of 1e-6 enter nothing).

Dropped from h = 0.5 m with e = 0: the heavy cube arrives with sqrt(2 g h), both stop at once, as the floor does not give.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from rigidimpulse.gallery.hard.parts import GRAVITY, dull, energy_never_grows, farthest, finite, floor_scene, last_speed, undisturbed
from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

DROP = 0.5
SINK = 1e-4
"""m, of a side of 1 m."""


def scene(ratio: float, drop: float) -> Scene:
    """Return the light cube on the floor and the heavy one `drop` m above it."""
    material = dull(0.5)
    scene = floor_scene(material)
    scene.add(Body("light", Shape.box(1.0), position=(0.0, 0.0, 0.5), mass=1.0, material=material))
    scene.add(Body("heavy", Shape.box(1.0), position=(0.0, 0.0, 1.5 + drop), mass=ratio, material=material))
    return scene


def check(drop: float, run: Recording) -> list[Check]:
    """Check that the light cube is not crushed, and what the impact does."""
    below = run.position("light")[:, 2] - 0.5
    between = run.position("heavy")[:, 2] - run.position("light")[:, 2] - 1.0
    checks = [
        finite(run),
        at_most("light one sinks into the floor, m", -below.min(), SINK, "1e-4 of the side"),
        at_most("heavy one sinks into the light one, m", -between.min(), SINK, "1e-4 of the side"),
        at_most("light one moves, m", farthest(run, ["light"]), SINK, "the floor does not give, so nothing moves it"),
        at_most("speed at the end, m/s", last_speed(run, 1.0), 1e-9, "it lies still"),
        energy_never_grows(run, 1.0, 2),
        undisturbed(run),
    ]
    if drop:
        landing = math.sqrt(2.0 * DROP / GRAVITY)
        falling = run.times < landing
        fall = run.position("heavy")[falling, 2] - 1.5 - DROP + 0.5 * GRAVITY * run.times[falling] ** 2
        checks.append(at_most("error of the fall, m", np.abs(fall).max(), 1e-14 * 4, "z = h - g t^2 / 2"))
        late = np.abs(run.impacts["time"][:1] - landing).max() if len(run.impacts) else math.inf
        # Faces meet at a gap of 1e-10 of the size, passed at 3.1 m/s; the light cube may have been lifted by 1e-6.
        checks.append(at_most("error of the impact's time, s", late, 2e-6, "sqrt(2 h / g), up to the contact margin"))
    return checks


FIGURES = {
    1e3: "penetration at dt 1/60: MuJoCo 0.05 mm, PyBullet 7, Rapier 69, Jolt 0.8, PhysX 1.5, ODE 0.1 mm",
    1e6: "MuJoCo sinks 52 mm, ODE's direct solver 0.12 mm; with PyBullet, Rapier, Jolt, PhysX it falls through",
}
SCENES = tuple(
    GalleryScene(
        f"heavy_{'dropped' if drop else 'on_light'}_1e{round(math.log10(ratio))}",
        f"A cube {ratio:,.0f} times as heavy is {'dropped' if drop else 'set'} on a light one",
        partial(scene, ratio, drop),
        partial(check, drop),
        5.0,
        elsewhere=FIGURES[ratio],
    )
    for drop in (0.0, DROP)
    for ratio in (1e3, 1e6)
)
