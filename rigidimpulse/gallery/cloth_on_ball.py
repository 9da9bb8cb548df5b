"""A square of cloth falls on a ball and hangs over it.

Laws. Until the cloth touches, its centre follows the parabola. No part of it ever gets into the ball or the floor. Energy never grows. At
the end the cloth hangs still and has no momentum.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.dynamics.soft_body.body import FlexibleBody
from rigidimpulse.gallery.flexible import GRAVITY, laws_of_energy, square_sheet
from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SIDE, CELLS = 1.6, 22
AREA_DENSITY, STIFFNESS, BENDING, DAMPING = 0.3, 150.0, 6e-3, 0.1
RADIUS, CENTRE = 0.4, (0.0, 0.0, 0.75)
START = (0.03, -0.02, 1.6)
DURATION = 4.0


def scene() -> Scene:
    """Return floor, ball and cloth."""
    rough = Material(static_friction=0.8, dynamic_friction=0.7)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static", material=rough))
    scene.add(Body("ball", Shape.sphere(RADIUS), motion="static", position=CENTRE, material=rough))
    vertices, faces = square_sheet(SIDE, CELLS)
    scene.add(FlexibleBody(
        "cloth", vertices, faces, stiffness=STIFFNESS, bending=BENDING, damping=DAMPING, area_density=AREA_DENSITY,
        position=START, material=rough,
    ))  # fmt: skip
    return scene


def check(run: Recording) -> list[Check]:
    """Compare with the laws that hold whatever the folds."""
    vertices, _ = run.soft_body("cloth")
    falling = run.times < np.sqrt(2.0 * (START[2] - CENTRE[2] - RADIUS - 0.03) / GRAVITY)
    parabola = START[2] - 0.5 * GRAVITY * run.times[falling] ** 2
    inside = RADIUS - np.linalg.norm(vertices - np.array(CENTRE), axis=2).min()
    last = np.linalg.norm(vertices[-1] - vertices[-2], axis=1).max() * (1.0 / (run.times[-1] - run.times[-2]))
    return [
        *laws_of_energy(run, 1e-9),
        # Frames between the ends of steps lie on chords: g h^2 / 8 = 3.4e-4 m.
        at_most("height in free fall, error in m", np.abs(vertices[falling][:, :, 2].mean(1) - parabola).max(), 5e-4, "x = x0 - g t^2 / 2"),
        at_most("deepest vertex in the ball, m", inside, 0.0, "bodies stay apart"),
        at_most("deepest vertex below the floor, m", -vertices[:, :, 2].min(), 0.0, "bodies stay apart"),
        at_most("fastest vertex at the end, m/s", last, 0.05, "damping and friction stop it"),
    ]


SCENES = (GalleryScene("cloth_on_ball", "A cloth falls on a ball and hangs over it", scene, check, DURATION),)
