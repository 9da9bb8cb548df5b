"""Things fall in air: a stone, a crate, and a crate on a parachute.

Quadratic drag c v^2: from rest  v = u tanh(g t / u), z = (u^2 / g) ln cosh(g t / u), terminal speed u = sqrt(m g / c). The parachute is a
canopy of its own on a line: the drag is its, the weight that of both, so u = sqrt((m + m_c) g / c) as soon as the line is taut, which it
is at once.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.dynamics.forces.drag import Drag
from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import DistanceJoint
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 9.81
MASSES = {"stone": 8.0, "crate": 6.0, "crate on a parachute": 6.0, "canopy": 0.5}
DRAG = {"stone": 0.5, "crate": 1.0, "canopy": 12.0}
"""N s2/m2."""
LINE, APART = 2.0, 1.5
DURATION = 2.5
BOUND = 1e-8
JOINED = 5e-4
"""m/s and m: joints are of second order, (g h / u)^2 / 12 of u, 1e-3 m/s."""


def scene() -> Scene:
    """Return everything at rest at the same height."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    box = Shape.box((0.5, 0.5, 0.4))
    scene.add(Body("stone", Shape.sphere(0.15), mass=MASSES["stone"], position=(-APART, 0.0, 0.0)))
    scene.add(Body("crate", box, mass=MASSES["crate"]))
    scene.add(Body("crate on a parachute", box, mass=MASSES["crate on a parachute"], position=(APART, 0.0, 0.0)))
    scene.add(Body("canopy", _canopy(), mass=MASSES["canopy"], position=(APART, 0.0, LINE), center_of_mass=(0, 0, 0)))
    scene.add(DistanceJoint("crate on a parachute", "canopy", (APART, 0.0, 0.2), (APART, 0.0, LINE), name="line"))
    for name, c in DRAG.items():
        scene.add(Drag(quadratic=c, bodies=[name], name=f"drag of the {name}"))
    return scene


def _canopy() -> Shape:
    """Return a cap, open below to look at, full to the law."""
    rings = [[(r * math.cos(a), r * math.sin(a), z) for a in np.linspace(0.0, 2.0 * math.pi, 20, endpoint=False)]
             for r, z in ((1.0, 0.0), (0.9, 0.25), (0.6, 0.45), (0.2, 0.55))]  # fmt: skip
    return Shape.convex_hull(np.concatenate(rings))


def check(run: Recording) -> list[Check]:
    """Compare with the closed form of each fall."""
    t, checks = run.times, []
    for name, mass, c, bound in (
        ("stone", MASSES["stone"], DRAG["stone"], BOUND),
        ("crate", MASSES["crate"], DRAG["crate"], BOUND),
        ("crate on a parachute", MASSES["crate on a parachute"] + MASSES["canopy"], DRAG["canopy"], JOINED),
    ):
        u = math.sqrt(mass * GRAVITY / c)
        v, z = u * np.tanh(GRAVITY * t / u), u**2 / GRAVITY * np.log(np.cosh(GRAVITY * t / u))
        checks += [
            at_most(f"{name}: speed, m/s", np.abs(run.velocity(name)[:, 2] + v).max(), bound, "v = u tanh(g t / u)"),
            at_most(f"{name}: height, m", np.abs(run.position(name)[:, 2] + z).max(), bound, "z = (u^2 / g) ln cosh(g t / u)"),
        ]
    assert run.ledger is not None
    balance = run.ledger.total + sum(run.ledger.dissipated.values())
    scale = run.ledger.kinetic.max()
    return [*checks, at_most("ledger, relative", np.ptp(balance) / scale, 1e-6, "what is lost is what the air took")]


SCENES = (GalleryScene("parachute", "A stone, a crate and a crate on a parachute fall", scene, check, DURATION),)
