"""Spot the cow bounces on a trampoline, a sheet whose rim is pinned.

Laws. The cow falls freely until it touches the sheet. Its momentum is the sum of the impulses of gravity and of the sheet. Energy never
grows, and some of it comes back: the cow bounces. It never passes through the sheet.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.dynamics.soft_body.body import FlexibleBody
from rigidimpulse.gallery.flexible import GRAVITY, laws_of_energy, square_sheet
from rigidimpulse.gallery.record import Check, GalleryScene, asset_path, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SIDE, CELLS = 2.4, 14
HEIGHT = 1.0
AREA_DENSITY, STIFFNESS, DAMPING = 0.6, 4000.0, 1e-3
SCALE, MASS = 0.35, 8.0
START, VELOCITY = (0.05, 0.5, 2.0), (0.0, -1.1, 0.0)
FRAME = 0.06
DURATION = 2.2
ACCURACY = Accuracy(step=1 / 120)


def scene() -> Scene:
    """Return floor, frame, sheet and cow."""
    rough = Material(static_friction=0.9, dynamic_friction=0.8)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static", material=rough))
    vertices, faces = square_sheet(SIDE, CELLS)
    rim = np.flatnonzero(np.abs(vertices[:, :2]).max(axis=1) > 0.5 * SIDE * (1.0 - 1e-9))
    scene.add(FlexibleBody(
        "sheet", vertices, faces, stiffness=STIFFNESS, damping=DAMPING, area_density=AREA_DENSITY, pinned=rim.tolist(),
        position=(0.0, 0.0, HEIGHT), material=rough,
    ))  # fmt: skip
    for name, x, y in (("left", -1, 0), ("right", 1, 0), ("front", 0, -1), ("back", 0, 1)):
        away = 0.5 * SIDE + FRAME
        size = (FRAME if x else SIDE + 2.5 * FRAME, FRAME if y else SIDE + 2.5 * FRAME, FRAME)
        scene.add(Body(f"{name} rail", Shape.box(size), motion="static", position=(x * away, y * away, HEIGHT)))
    for x in (-1, 1):
        for y in (-1, 1):
            place = (x * (0.5 * SIDE + FRAME), y * (0.5 * SIDE + FRAME), 0.5 * (HEIGHT - 0.5 * FRAME))
            scene.add(Body(f"leg {x} {y}", Shape.box((FRAME, FRAME, HEIGHT - 0.5 * FRAME)), motion="static", position=place))
    cow = Shape.from_file(asset_path("spot.obj"), scale=SCALE)
    upright = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)  # the model is Y up: a quarter turn about x
    scene.add(Body("spot", cow, mass=MASS, position=START, velocity=VELOCITY, orientation=upright, material=rough))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare with momentum, energy and free fall."""
    height, speed = run.center_of_mass("spot")[:, 2], run.velocity("spot")[:, 2]
    falling = run.times < 0.2
    parabola = height[0] - 0.5 * GRAVITY * run.times[falling] ** 2
    low = int(np.argmin(height[run.times < 1.0]))
    checks = laws_of_energy(run, 1e-4)
    if run.by_cause is not None:
        parts = run.impulses("spot")
        gained = MASS * (run.velocity("spot") - run.velocity("spot")[0])
        balance = np.linalg.norm(parts["gravity"] + parts["flexible bodies"] - gained, axis=1).max()
        checks.append(at_most("momentum that neither gravity nor the sheet gave, N s", balance, 1e-9 * MASS, "m v' = m v + sum of J"))
    return [
        *checks,
        at_most("height in free fall, error in m", np.abs(height[falling] - parabola).max(), 1e-12, "x = x0 - g t^2 / 2"),
        at_least("speed after the first bounce over that before, least", speed[low:].max() / -speed.min(), 0.4, "the sheet gives back"),
        at_most("speed after the first bounce over that before, most", speed[low:].max() / -speed.min(), 1.0, "energy"),
        at_least("lowest centre of the cow, m", height.min(), 0.3, "it does not pass the sheet"),
    ]


SCENES = (GalleryScene("trampoline", "Spot the cow bounces on a trampoline", scene, check, DURATION, accuracy=ACCURACY),)
