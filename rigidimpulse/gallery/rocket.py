"""Two rockets (B7): one far from everything, one that lifts off from a moon.

    v(t) = u ln(m_0 / (m_0 - q t)),    x(t) = u [t - (m_0 / q - t) ln(m_0 / (m_0 - q t))],    under gravity  -g t  and  -g t^2 / 2  more

The second rocket's motor is given by the other kind of specific impulse, in seconds: u = I g_0.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.dynamics.forces.thruster import Thruster
from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

MOON_GRAVITY, EARTH_GRAVITY = 1.62, 9.80665
MASS, PROPELLANT, FLOW = 5.0, 3.2, 0.5
"""kg, kg, kg/s; it burns for 6.4 s."""
EXHAUST = {"in space": 4.0, "on a moon": 2.0 * EARTH_GRAVITY}
"""m/s; the second is a specific impulse of 2 s."""
RADIUS, HEIGHT, APART = 0.3, 2.0, 3.0
DURATION = 7.0
BOUND = 1e-8
"""Relative: steps are off by at most 1e-8 of the size."""


def scene() -> Scene:
    """Return both rockets; z is up."""
    scene = Scene(gravity=(0.0, 0.0, -MOON_GRAVITY))
    scene.add(Body("ground", Shape.cylinder(1.5, 0.2), motion="static", position=(APART, 0.0, -0.1)))
    for k, (name, speed) in enumerate(EXHAUST.items()):
        place = (k * APART, 0.0, 0.5 * HEIGHT + 0.001)
        scene.add(Body(name, _rocket(), position=place, mass=MASS, gravity_factor=float(k), center_of_mass=(0, 0, 0)))
        scene.add(Thruster(name, speed, FLOW, (0.0, 0.0, 1.0), PROPELLANT))
    return scene


def _rocket() -> Shape:
    """Return a body, a nose and four fins along z."""
    upright = (1.0, 0.0, 0.0, 0.0)
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = np.column_stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), np.zeros(16)])
    nose = Shape.convex_hull(np.vstack([ring, ring * (0.6, 0.6, 1) + (0, 0, 0.35), [[0, 0, 0.6]]]))
    fin = Shape.convex_hull([(x, y, z) for y in (-0.02, 0.02) for x, z in ((0.25, 0.0), (0.6, 0.0), (0.6, 0.2), (0.25, 0.5))])
    parts = [(Shape.cylinder(RADIUS, HEIGHT - 0.6), (0.0, 0.0, -0.3), upright), (nose, (0.0, 0.0, 0.4), upright)]
    for turn in range(4):
        half = 0.25 * np.pi * turn
        parts.append((fin, (0.0, 0.0, -0.5 * HEIGHT), (np.cos(half), 0.0, 0.0, np.sin(half))))
    return Shape.compound(parts)


def check(run: Recording) -> list[Check]:
    """Compare both rockets with the closed form, and the ledger with the momentum of the mass that is left."""
    t = run.times
    burnt = np.minimum(t, PROPELLANT / FLOW)
    log = np.log(MASS / (MASS - FLOW * burnt))
    checks = []
    for k, (name, u) in enumerate(EXHAUST.items()):
        g = k * MOON_GRAVITY
        v = u * log - g * t
        x = u * (burnt - (MASS / FLOW - burnt) * log) + u * log * (t - burnt) - 0.5 * g * t**2
        speed, height = run.velocity(name)[:, 2], run.position(name)[:, 2] - run.position(name)[0, 2]
        checks += [
            at_most(f"{name}: speed, relative error", np.abs(speed - v).max() / v.max(), BOUND, "v = u ln(m_0 / m) - g t"),
            at_most(f"{name}: way, relative error", np.abs(height - x).max() / x.max(), BOUND, "x = u [t - (m/q) ln(m_0 / m)] - g t^2 / 2"),
        ]
    assert run.ledger is not None
    left = MASS - FLOW * burnt
    momentum = left * (run.velocity("in space")[:, 2] + run.velocity("on a moon")[:, 2])
    error = np.abs(run.ledger.momentum[:, 2] - momentum).max() / momentum.max()
    return [*checks, at_most("momentum of the mass that is left, relative error", error, 1e-12, "m(t) v")]


SCENES = (GalleryScene("rocket", "Two rockets, in space and from a moon", scene, check, DURATION),)
