"""Handguns in a hand that gives way like a spring (B6).

A bullet of m leaves with v, the gun of M recoils with m v / M against a spring of k until  k d^2 / 2 = M V^2 / 2:

    d = m v / sqrt(k M),    so  M = (m v)^2 / (k d^2),   after a quarter of a swing, (pi / 2) sqrt(M / k)
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.dynamics.forces.spring import Spring
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

STIFFNESS = 200.0
BULLET_MASS, BULLET_SPEED, CALIBER = 0.0075, 350.0, 0.009
GUNS = {"light gun": 0.7, "heavy gun": 1.4}
"""Masses, kg."""
APART, BACKSTOP, ARM = 0.6, 2.5, 0.45
DURATION, FPS = 0.6, 240.0
BOUND = 1e-6
"""Relative: 36 steps that are off by up to 1e-8 of the size, twice in d^2."""


def scene() -> Scene:
    """Return the guns at the moment at which the bullets leave them, along x."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    soft = Material(restitution=0.0, restitution_combine="minimum")
    wall = Shape.box((0.1, 2.5 * APART, 0.6))
    scene.add(Body("backstop", wall, motion="static", position=(BACKSTOP, 0.5 * APART, 0.0), material=soft))
    for k, (name, mass) in enumerate(GUNS.items()):
        y = k * APART
        recoil = (-BULLET_MASS * BULLET_SPEED / mass, 0.0, 0.0)
        scene.add(Body(name, _gun(), mass=mass, position=(0.0, y, 0.0), velocity=recoil, center_of_mass=(0, 0, 0)))
        ball, start = Shape.sphere(0.5 * CALIBER), (0.12, y, 0.0)
        scene.add(Body(f"bullet of the {name}", ball, mass=BULLET_MASS, position=start, velocity=(BULLET_SPEED, 0, 0), material=soft))
        shoulder = Shape.box((0.06, 0.06, 0.06))
        scene.add(Body(f"shoulder behind the {name}", shoulder, motion="static", position=(-ARM - 0.1, y, 0.0)))
        scene.add(Spring(f"shoulder behind the {name}", name, (-ARM - 0.1, y, 0.0), (0.0, y, 0.0), STIFFNESS))
    return scene


def _gun() -> Shape:
    """Return slide and grip; the bore is along x through the origin."""
    upright = (1.0, 0.0, 0.0, 0.0)
    grip = [(x, y, z) for y in (-0.012, 0.012) for x, z in ((-0.08, -0.02), (-0.03, -0.02), (-0.06, -0.13), (-0.1, -0.12))]
    return Shape.compound([(Shape.box((0.19, 0.026, 0.04)), (0.0, 0.0, 0.0), upright), (Shape.convex_hull(grip), (0.0, 0.0, 0.0), upright)])


def check(run: Recording) -> list[Check]:
    """Weigh the guns by their recoil."""
    checks = [equal("impacts", len(run.impacts), len(GUNS), "each bullet ends in the backstop")]
    for name, mass in GUNS.items():
        x, w = run.position(name)[:, 0], np.sqrt(STIFFNESS / mass)
        d = BULLET_MASS * BULLET_SPEED / np.sqrt(STIFFNESS * mass)
        swing = np.hypot(x, run.velocity(name)[:, 0] / w)
        weighed = (BULLET_MASS * BULLET_SPEED) ** 2 / (STIFFNESS * swing**2)
        checks += [
            at_most(f"{name}: mass from its recoil, relative error", np.abs(weighed / mass - 1.0).max(), BOUND, "M = (m v)^2 / (k d^2)"),
            at_most(f"{name}: motion, in recoils", np.abs(x + d * np.sin(w * run.times)).max() / d, BOUND, "x = -d sin(w t)"),
        ]
    assert run.ledger is not None
    balance = run.ledger.total + sum(run.ledger.dissipated.values())
    return [*checks, at_most("ledger, relative", np.ptp(balance) / balance[0], 1e-10, "energy is conserved or dissipated")]


SCENES = (GalleryScene("handgun", "Two handguns recoil against a spring", scene, check, DURATION, FPS),)
