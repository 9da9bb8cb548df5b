"""Recoil of a rifle (B5): the momentum of the ball is that of the rifle, M V = m v.

A steel ball of 5.588 mm leaves two rifles, of 2.5 and 5 kg, with 305 m/s. The powder is an impact that feeds energy
in: ball and breech come together with a small speed u, total momentum zero, and part with e u, for e far above 1
(allowed by `any_restitution`). With the reduced masses of the two, e = (v / u)(1 + m / M) gives the ball the speed v.
The bore is open: the ball flies out along it.

The centre of mass lies on the bore line, as the law has it: no muzzle rise. A backstop with e = 0 catches the balls,
and so measures their momentum.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

BALL_RADIUS = 0.5 * 5.588e-3
BALL_DENSITY = 7860.0
BALL_MASS = BALL_DENSITY * 4.0 / 3.0 * math.pi * BALL_RADIUS**3
MUZZLE_SPEED = 305.0
RIFLES = {"light rifle": 2.5, "heavy rifle": 5.0}
"""Masses, kg."""
PRINTED_RECOIL = {"light rifle": 0.0877, "heavy rifle": 0.0438}
"""m/s, as printed in the source, which rounds the mass of the ball."""
PRINTED_DIGITS = 1e-4
DISTANCE = 0.5
APPROACH_SPEED = 0.5
"""u, m/s."""
APPROACH_GAP = 1e-3
BORE_RADIUS, BARREL_RADIUS, BARREL_LENGTH, BORE_SIDES = 3.0e-3, 9.0e-3, 0.6, 24
BACKSTOP = 2.0
"""m, its distance from the breech."""
DURATION = 1.0
BOUND = 1e-12


def scene() -> Scene:
    """Return the two rifles side by side, along x, and the backstop."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    shape = _rifle()
    ball = Shape.sphere(BALL_RADIUS)
    smooth: dict[str, Any] = {"static_friction": 0.0, "dynamic_friction": 0.0}
    soft = Material(restitution=0.0, restitution_combine="minimum", **smooth)
    wall, place = Shape.box((0.1, 2.5 * DISTANCE, 0.5)), (BACKSTOP + 0.05, 0.5 * DISTANCE, 0.0)
    scene.add(Body("backstop", wall, motion="static", position=place, material=soft))
    for k, (name, mass) in enumerate(RIFLES.items()):
        total = BALL_MASS + mass
        e = MUZZLE_SPEED / APPROACH_SPEED * total / mass
        powder = Material(
            density=BALL_DENSITY, restitution=e, restitution_combine="minimum", any_restitution=True, **smooth
        )
        own: dict[str, Any] = {"mass": mass, "center_of_mass": (0.0, 0.0, 0.0), "material": Material(**smooth)}
        y = k * DISTANCE
        back, forth = (-APPROACH_SPEED * mass / total, 0.0, 0.0), (APPROACH_SPEED * BALL_MASS / total, 0.0, 0.0)
        scene.add(Body(name, shape, position=(0.0, y, 0.0), velocity=forth, **own))
        start = (BALL_RADIUS + APPROACH_GAP, y, 0.0)
        scene.add(Body(f"ball of the {name}", ball, position=start, velocity=back, material=powder))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare with the balance of momentum."""
    law = "M V = m v"
    checks = [equal("impacts", len(run.impacts), 2 * len(RIFLES), "shot and stop; balls never touch the bore")]
    for name, mass in RIFLES.items():
        recoil = -run.velocity(name)[-1, 0]
        momentum = _caught(run, f"ball of the {name}")
        expected = BALL_MASS * MUZZLE_SPEED
        checks += [
            at_most(f"{name}: momentum of the ball, relative error", abs(momentum / expected - 1.0), BOUND, law),
            at_most(f"{name}: momentum of the rifle, relative error", abs(mass * recoil / expected - 1.0), BOUND, law),
            at_most(
                f"{name}: recoil, m/s from {PRINTED_RECOIL[name]}",
                abs(recoil - PRINTED_RECOIL[name]),
                PRINTED_DIGITS,
                "as printed in the dynamics notes",
            ),
        ]
    across = np.abs(run.velocities[-1, :, 1:]).max() / MUZZLE_SPEED
    spin = np.abs(run.angular_velocities[-1]).max() * BALL_RADIUS / MUZZLE_SPEED
    checks.append(
        at_most("motion across and spin, over v", max(across, spin), BOUND, "all impulses are along the bore")
    )
    return checks


def _caught(run: Recording, name: str) -> float:
    """Return the momentum that a ball leaves in the backstop, N s."""
    stop, ball = run.index("backstop"), run.index(name)
    impacts = run.impacts
    of_both = ((impacts["body_a"] == stop) & (impacts["body_b"] == ball)) | (
        (impacts["body_a"] == ball) & (impacts["body_b"] == stop)
    )
    return float(impacts["impulse"][of_both].sum())


def _rifle() -> Shape:
    """Return barrel, breech, stock and grip; the bore runs along x, its closed end at the origin."""
    upright = (1.0, 0.0, 0.0, 0.0)
    stock = [
        (x, y, z) for y in (-0.016, 0.016) for x, z in ((-0.06, 0.012), (-0.06, -0.03), (-0.42, -0.13), (-0.42, -0.01))
    ]
    grip = [
        (x, y, z) for y in (-0.013, 0.013) for x, z in ((-0.05, -0.02), (-0.01, -0.02), (-0.04, -0.12), (-0.075, -0.11))
    ]
    return Shape.compound([
        (_barrel(), (0.0, 0.0, 0.0), upright),
        (Shape.box((0.1, 0.032, 0.04)), (-0.05, 0.0, -0.005), upright),
        (Shape.box((0.3, 0.034, 0.022)), (0.1, 0.0, -0.022), upright),
        (Shape.convex_hull(stock), (0.0, 0.0, 0.0), upright),
        (Shape.convex_hull(grip), (0.0, 0.0, 0.0), upright),
    ])  # fmt: skip


def _barrel() -> Shape:
    """Return a tube along x from 0 to BARREL_LENGTH: four rings of vertices, joined by quads."""
    angle = 2.0 * np.pi * np.arange(BORE_SIDES) / BORE_SIDES
    circle = np.stack([np.zeros(BORE_SIDES), np.cos(angle), np.sin(angle)], axis=1)
    ends = np.array([[0.0, 0.0, 0.0], [BARREL_LENGTH, 0.0, 0.0]])
    rings = [BARREL_RADIUS * circle + ends[0], BARREL_RADIUS * circle + ends[1]]
    rings += [BORE_RADIUS * circle + ends[1], BORE_RADIUS * circle + ends[0]]
    here = np.arange(BORE_SIDES)
    after = np.roll(here, -1)
    faces = []
    for ring in range(4):
        low, high = ring * BORE_SIDES, (ring + 1) % 4 * BORE_SIDES
        faces += [
            np.stack([low + here, low + after, high + after], 1),
            np.stack([low + here, high + after, high + here], 1),
        ]
    return Shape.mesh(np.concatenate(rings), np.concatenate(faces))


SCENES = (GalleryScene("rifle", "Recoil of a rifle of 2.5 and 5 kg", scene, check, DURATION),)
