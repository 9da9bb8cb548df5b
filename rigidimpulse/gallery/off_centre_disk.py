"""A disk hits an equal one off centre (B14).

Disk A moves with V along y, disk B rests, their paths are d apart (d < 2 r). At touch the line of centres is

    n = (d, sqrt(4 r^2 - d^2)) / 2 r,     t = (y_B - sqrt(4 r^2 - d^2)) / V

Equal masses, no friction, restitution e: v_B = (1 + e) / 2 (V.n) n, v_A = V - v_B. For e = 1 they part at a right
angle.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

RADIUS = 0.5
THICKNESS = 0.3
SPEED = 2.0
OFFSET = 0.6
DISTANCE = 3.0
RESTITUTION = 0.9
DURATION = 3.0
BOUND = 1e-9
"""Faces and rims meet at a gap of 1e-10 of their size, which turns the normal by as much."""


def scene() -> Scene:
    """Return two disks, lying in the plane z = 0 without gravity."""
    smooth = Material(restitution=RESTITUTION, static_friction=0.0, dynamic_friction=0.0)
    disk = Shape.cylinder(RADIUS, THICKNESS)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(Body("a", disk, velocity=(0.0, SPEED, 0.0), material=smooth))
    scene.add(Body("b", disk, position=(OFFSET, DISTANCE, 0.0), material=smooth))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare time and velocities with the closed form."""
    reach = np.sqrt(4.0 * RADIUS**2 - OFFSET**2)
    normal = np.array([OFFSET, reach, 0.0]) / (2.0 * RADIUS)
    after_b = 0.5 * (1.0 + RESTITUTION) * SPEED * normal[1] * normal
    after_a = np.array([0.0, SPEED, 0.0]) - after_b
    time = (DISTANCE - reach) / SPEED
    flight = run.times[-1] - time
    law = "v_B' = (1 + e)/2 (V.n) n, v_A' = V - v_B'"
    return [
        equal("instants of impact", len(np.unique(run.impacts["time"])), 1, "they touch once"),
        at_most(
            "error of the impact time, s", abs(run.impacts["time"][0] - time), BOUND, "t = (y - sqrt(4r^2 - d^2))/V"
        ),
        at_most("error of v_A, m/s", np.abs(run.velocity("a")[-1] - after_a).max(), BOUND * SPEED, law),
        at_most("error of v_B, m/s", np.abs(run.velocity("b")[-1] - after_b).max(), BOUND * SPEED, law),
        at_most("spin, rad/s", np.abs(run.angular_velocities[-1]).max(), BOUND, "smooth and through the centres"),
        at_most(
            "error of the final place of B, m",
            np.abs(run.position("b")[-1] - [OFFSET, DISTANCE, 0.0] - after_b * flight).max(),
            BOUND * SPEED * DURATION,
            law,
        ),
    ]


SCENES = (
    GalleryScene(
        "off_centre_disk", "A disk strikes an equal one off centre", scene, check, DURATION
    ),
)
