"""Doors with soft hinges: soft constraints are the damped oscillators they stand for, at a step of a tenth of a second (A13).

A door of moment I about its hinge is held to an angle by a spring k and a damper c, both rows of the joint:

    I a'' = -k (a - a0) - c a',    w = sqrt(k / I),    z = c / (2 sqrt(k I))

Forces of soft rows are found such that the oscillator is solved over a sub-step exactly, whatever w h is; at the ends of steps angle and
rate are the closed form's to rounding, some 1e-13 a step: 1e-10 in fifty. Between them the force is constant. A semi-implicit spring is
off by (w h)^2 / 24 of the phase and explodes at w h = 2; an implicit one damps what has no damper by half in a swing at w h = 0.5.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint_six_axis import Limit, SixAxisJoint
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

DOOR, MASS = (0.9, 0.06, 1.8), 20.0
INERTIA = MASS * (DOOR[0] ** 2 + DOOR[1] ** 2) / 12.0
DOORS = {
    "swings": (5.0, 0.0, 0.0, 4.0),
    "dies down": (5.0, 0.1, 0.0, 5.0),
    "creeps": (5.0, 2.0, 1.2, 0.0),
    "snaps": (100.0, 1.0, 0.9, 0.0),
}
"""w 1/s, z, a0 rad and the rate at the start rad/s of each door."""
PITCH, POST = 1.3, 0.05
STEP = 0.1
DURATION = 5.0
BOUND = 1e-10


def scene() -> Scene:
    """Return the doors in a row, each on a post through its middle, at the angle 0."""
    scene = Scene(gravity=(0.0, 0.0, -9.81))
    scene.add(Body("floor", Shape.half_space(), motion="static"))
    _add_frame(scene)
    held = [Limit(translation="xyz", upper=0.0), Limit(rotation="xy", upper=0.0)]
    for k, (name, (w, z, target, rate)) in enumerate(DOORS.items()):
        place = (k * PITCH, 0.0, 0.5 * DOOR[2] + 0.1)
        scene.add(Body(name, Shape.box(DOOR), position=place, angular_velocity=(0.0, 0.0, rate), mass=MASS))
        stiffness, damping = INERTIA * w * w, 2.0 * z * INERTIA * w
        spring = Limit(rotation="z", lower=target, upper=target, stiffness=stiffness, damping=damping)
        scene.add(SixAxisJoint(None, name, place, limits=[*held, spring], name=f"hinge of {name}"))
    return scene


def _add_frame(scene: Scene) -> None:
    """Add posts between the doors and a beam above them, out of their way."""
    reach, height = (len(DOORS) - 0.5) * PITCH, DOOR[2] + 0.2
    for k in range(len(DOORS) + 1):
        scene.add(Body(f"post {k}", Shape.box((POST, POST, height)), motion="static", position=((k - 0.5) * PITCH, 0.0, 0.5 * height)))
    beam = Shape.box((reach + 0.5 * PITCH + POST, POST, POST))
    scene.add(Body("beam", beam, motion="static", position=(0.5 * (reach - 0.5 * PITCH), 0.0, height + 0.5 * POST)))


def check(run: Recording) -> list[Check]:
    """Compare angles and rates at the ends of steps with the closed form."""
    ends = np.abs(run.times / STEP - np.round(run.times / STEP)) < 1e-6
    checks = []
    for name, (w, z, target, rate) in DOORS.items():
        flow = np.array([[0.0, 1.0], [-w * w, -2.0 * z * w]])
        exact = np.array([expm(flow * t) @ (-target, rate) for t in run.times[ends]]) + [target, 0.0]
        turn = run.orientation(name)[ends]
        angle, speed = 2.0 * np.arctan2(turn[:, 3], turn[:, 0]), run.angular_velocity(name)[ends, 2]
        scale = max(target, rate / w)
        law = f"w h = {w * STEP:.2g}, z = {z:.2g}"
        checks += [
            at_most(f"{name}: error of the angle, of its amplitude", np.abs(angle - exact[:, 0]).max() / scale, BOUND, law),
            at_most(f"{name}: error of the rate, of w times the amplitude", np.abs(speed - exact[:, 1]).max() / (w * scale), BOUND, law),
        ]
    return checks


SCENES = (
    GalleryScene(
        "soft_hinge", "Doors on springs at a step of a tenth of a second (animation notes A13)", scene, check, DURATION,
        accuracy=Accuracy(step=STEP),
    ),
)  # fmt: skip
