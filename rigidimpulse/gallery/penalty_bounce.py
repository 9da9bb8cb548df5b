"""Balls are pushed out of a floor by springs, beside one that an impulse turns back at once. No gravity.

All springs have the same stiffness k. A ball of mass m that comes with v goes in by x'' = -(k / m) x - (c / m) x' until the push ends: by
v / w, w = sqrt(k / m), for pi / w without damping. With the damping ratio z it leaves the push after (pi - 2 asin z) / (w sqrt(1 - z^2))
with e v, e = exp(-z (pi - 2 asin z) / sqrt(1 - z^2)), from where k x = -c e v. The ball beside them has the path of impulses,
z = r + v |t - t0|.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import root_scalar

from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.keyframes import Keyframes
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

RADIUS, HEIGHT, SPEED, STIFFNESS = 0.2, 0.6, 2.0, 2000.0
BALLS = {"1 kg": (1.0, 1.0), "4 kg": (4.0, 1.0), "9 kg": (9.0, 1.0), "4 kg, dull": (4.0, 0.5)}
"""Mass and restitution."""
HIT, DURATION = HEIGHT / SPEED, 1.0
BOUND = 1e-6
"""m and J; steps are off by 1e-8 of the size at most and end where contact does."""


def scene() -> Scene:
    """Return a floor, balls that fly at it, and one on the path that impulses would give it."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    smooth = Material(static_friction=0.0)
    scene.add(Body("floor", Shape.box((3.0, 1.0, 1.0)), position=(0.75, 0.0, -0.5), motion="static", material=smooth))
    for place, (name, (mass, e)) in enumerate(BALLS.items()):
        scene.add(
            Body(
                name,
                Shape.sphere(RADIUS),
                position=(0.5 * place, 0.0, RADIUS + HEIGHT),
                velocity=(0.0, 0.0, -SPEED),
                mass=mass,
                material=Material(restitution=e, static_friction=0.0),
            )
        )
    heights = RADIUS + np.array([HEIGHT, 0.0, SPEED * (DURATION - HIT)])
    path = Keyframes((0.0, HIT, DURATION), [(-0.5, 0.0, z) for z in heights])
    scene.add(Body("impulse", Shape.sphere(RADIUS), motion="kinematic", keyframes=path))
    return scene


def _height(times: np.ndarray, mass: float, e: float) -> np.ndarray:
    """Height (f,) of a ball over the floor by the laws of the head."""
    w = np.sqrt(STIFFNESS / mass)
    z = root_scalar(lambda z: np.log(e) + z * (np.pi - 2.0 * np.arcsin(z)) / np.sqrt(1.0 - z * z), bracket=(0.0, 0.99), xtol=1e-15).root
    damped = w * np.sqrt(1.0 - z * z)
    end = (np.pi - 2.0 * np.arcsin(z)) / damped
    s = times - HIT
    inside = -SPEED / damped * np.exp(-z * w * s) * np.sin(damped * s)
    after = -2.0 * z * e * SPEED / w + e * SPEED * (s - end)
    return np.where(s < 0.0, -SPEED * s, np.where(s < end, inside, after))


def check(run: Recording) -> list[Check]:
    """Compare heights at all frames with the closed forms, and the energy with that of restitution."""
    checks = []
    for name, (mass, e) in BALLS.items():
        error = np.abs(run.position(name)[:, 2] - RADIUS - _height(run.times, mass, e)).max()
        checks.append(at_most(f"{name}: error of the height, m", error, BOUND, "a mass on a spring that does not pull"))
    assert run.ledger is not None
    lost = sum(0.5 * mass * SPEED**2 * (1.0 - e * e) for mass, e in BALLS.values())
    error = abs(run.ledger.dissipated["penalty"][-1] - lost)
    checks.append(at_most("error of the energy lost, J", error, BOUND, "sum of m v^2 (1 - e^2) / 2"))
    return [*checks, equal("impacts", len(run.impacts), 0, "springs give no impulses")]


SCENES = (
    GalleryScene(
        "penalty_bounce",
        "Springs push balls out of a floor, beside one turned back by an impulse",
        scene,
        check,
        DURATION,
        accuracy=Accuracy(response="penalty", penalty_stiffness=STIFFNESS),
        cheaper=Accuracy(response="penalty", penalty_stiffness=STIFFNESS, integrator="semi_implicit"),
    ),
)
