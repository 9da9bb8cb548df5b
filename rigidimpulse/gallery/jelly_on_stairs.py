"""A cube of jelly falls down stairs.

Laws. Until the cube touches, its centre follows the parabola. No part of it ever gets into the stairs. Energy never grows. The struts keep
most of its volume. It comes to rest.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.dynamics.soft_body.body import FlexibleBody
from rigidimpulse.gallery.flexible import GRAVITY, cube_surface, enclosed_volume, laws_of_energy
from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SIDE, CELLS = 0.4, 5
DENSITY, STIFFNESS, INNER, DAMPING = 600.0, 400.0, 4e4, 0.02
TREAD, RISE, STEPS, WIDTH = 0.5, 0.22, 4, 1.4
START, VELOCITY = (0.2, 0.0, 1.35), (0.9, 0.0, 0.0)
SPIN = (0.0, 3.0, 0.5)
DURATION = 6.0


def stairs() -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the centre and the size (3,) m of every step, from the top, each of which stands on the floor."""
    blocks = []
    for k in range(STEPS):
        top = (STEPS - k) * RISE
        blocks.append((np.array([(k + 0.5) * TREAD, 0.0, 0.5 * top]), np.array([TREAD, WIDTH, top])))
    return blocks


def scene() -> Scene:
    """Return floor, stairs and jelly."""
    material = Material(density=DENSITY, static_friction=0.5, dynamic_friction=0.4)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static", material=material))
    for k, (centre, size) in enumerate(stairs()):
        scene.add(Body(f"step {k}", Shape.box(size), motion="static", position=centre, material=material))
    vertices, faces = cube_surface(SIDE, CELLS)
    scene.add(FlexibleBody(
        "jelly", vertices, faces, stiffness=STIFFNESS, inner_stiffness=INNER, damping=DAMPING, position=START, velocity=VELOCITY,
        angular_velocity=SPIN, material=material,
    ))  # fmt: skip
    return scene


def check(run: Recording) -> list[Check]:
    """Compare with the laws that hold whatever the way down."""
    vertices, faces = run.soft_body("jelly")
    volume = enclosed_volume(vertices, faces)
    inside = -np.inf
    for centre, size in stairs():
        depth = (0.5 * size - np.abs(vertices - centre)).min(axis=2)
        inside = max(inside, float(depth.max()))
    last = np.linalg.norm(vertices[-1] - vertices[-2], axis=1).max() * (1.0 / (run.times[-1] - run.times[-2]))
    return [
        *laws_of_energy(run, 1e-9),
        at_most("deepest vertex in the stairs, m", inside, 1e-9, "bodies stay apart"),
        at_most("deepest vertex below the floor, m", -vertices[:, :, 2].min(), 1e-9, "bodies stay apart"),
        at_most("volume lost at the end, share", 1.0 - volume[-1] / volume[0], 0.1, "struts bear the weight"),
        at_most("fastest vertex at the end, m/s", last, 0.05, "damping and friction stop it"),
    ]


SCENES = (GalleryScene("jelly_on_stairs", "A cube of jelly falls down stairs", scene, check, DURATION),)
