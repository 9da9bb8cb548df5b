"""Balls with rolling friction roll to a stop, each in its own track.

A solid ball of radius r that rolls with v on a plane with rolling friction b is slowed by a = (5/7) b g / r (m v' = -F,
(2/5) m r^2 w' = F r - b m g, v = w r), so it stops after v / a at v^2 / (2 a), and its spin about the normal, slowed by
(5/2) s g / r^2, after w_n / that.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 9.81
RADIUS = 0.1
SPEED, SPIN = 0.8, 20.0
ROLLING = {"steel": 0.002, "rubber": 0.004, "felt": 0.01}
"""b of each ball, m."""
SPINNING = 0.003
DURATION = 6.0
BOUND = 1e-6
"""Relative: the forces are found to 1e-12, and sub-steps end where something stops; the contact margin is 1e-6 of a ball."""


def scene() -> Scene:
    """Return a floor and the balls, which roll from the start and spin about the vertical besides."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static"))
    for track, (name, length) in enumerate(ROLLING.items()):
        material = Material(static_friction=0.5, rolling_friction=length, spinning_friction=SPINNING)
        scene.add(
            Body(
                name,
                Shape.sphere(RADIUS),
                position=(0.0, 0.4 * track, RADIUS),
                velocity=(SPEED, 0.0, 0.0),
                angular_velocity=(0.0, SPEED / RADIUS, SPIN),
                material=material,
            )
        )
    return scene


def check(run: Recording) -> list[Check]:
    """Compare ways, spins and the last frame with the closed forms."""
    checks = []
    slow = 2.5 * SPINNING * GRAVITY / RADIUS**2
    for name, length in ROLLING.items():
        a = 5.0 / 7.0 * length * GRAVITY / RADIUS
        t = np.minimum(run.times, SPEED / a)
        way = SPEED * t - 0.5 * a * t * t
        error = np.abs(run.position(name)[:, 0] - way).max() / way[-1]
        spin = np.abs(run.angular_velocity(name)[:, 2] - np.maximum(SPIN - slow * run.times, 0.0)).max() / SPIN
        checks += [
            at_most(f"{name}: error of the way, relative", error, BOUND, "a = (5/7) b g / r"),
            at_most(f"{name}: error of the spin, relative", spin, BOUND, "w' = -(5/2) s g / r^2"),
            at_most(f"{name}: speed at the end, m/s", np.abs(run.velocity(name)[-1]).max(), 0.0, "it rests"),
        ]
    return checks


SCENES = (GalleryScene("rolling", "Balls with rolling friction roll to a stop", scene, check, DURATION),)
