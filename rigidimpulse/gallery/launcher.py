"""A launcher of two stages whose payload reaches escape speed (B8).

Each stage gives  u ln(m before / m after), with u = I g; the payload p solves

    g [I_1 ln(M / (M - p_1)) + I_2 ln((m_2 + p) / (m_2 + p - p_2))] = sqrt(2 G M_E / R),    M = m_1 + m_2 + p

The law does not know of time or scale: speeds here are a thousandth of the real ones and each stage burns for 4 s, masses are real.
Stages and payload are bodies of their own, held by fixed joints that let go (`release_time`) when a stage is empty.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rigidimpulse.dynamics.forces.thruster import Thruster
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import FixedJoint
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SLOWER = 1e-3
GRAVITY = 9.81
STAGES = {"stage I": (586_344.0, 504_516.0, 268.8), "stage II": (183_952.0, 163_530.0, 452.1)}
"""Mass kg, propellant kg, specific impulse s, of the Ares I as printed in the dynamics notes."""
ESCAPE = math.sqrt(2.0 * 3.986004418e14 / 6_378_145.0)
PRINTED_PAYLOAD = 8336.65
BURN, COAST = 4.0, 0.5
LENGTHS = (22.0, 10.0, 5.0)
RADII = (2.0, 2.4, 1.6)
GAP = 0.2
DURATION = 11.0


def final_speed(payload: float) -> float:
    """Return the speed after both stages, m/s."""
    (m1, p1, i1), (m2, p2, i2) = STAGES.values()
    whole, upper = m1 + m2 + payload, m2 + payload
    return GRAVITY * (i1 * math.log(whole / (whole - p1)) + i2 * math.log(upper / (upper - p2)))


def payload() -> float:
    """Return the payload that reaches escape speed, kg."""
    from scipy.optimize import brentq

    root: Any = brentq(lambda p: final_speed(p) - ESCAPE, 1e3, 1e5)
    return float(root)


def scene() -> Scene:
    """Return the launcher; z is along it."""
    scene, place = Scene(gravity=(0.0, 0.0, 0.0)), 0.0
    masses = {name: mass for name, (mass, _, _) in STAGES.items()} | {"payload": payload()}
    for (name, mass), length, radius in zip(masses.items(), LENGTHS, RADII, strict=True):
        shape = Shape.cylinder(radius, length) if name != "payload" else _cone(radius, length)
        scene.add(Body(name, shape, mass=mass, position=(0.0, 0.0, place + 0.5 * length), center_of_mass=(0, 0, 0)))
        place += length + GAP
    names = list(masses)
    for k, name in enumerate(STAGES):
        _, propellant, impulse = STAGES[name]
        lit = k * (BURN + COAST)
        thrust: dict[str, Any] = {"exhaust_velocity": SLOWER * impulse * GRAVITY, "mass_flow": propellant / BURN, "propellant": propellant}
        scene.add(Thruster(name, direction=(0.0, 0.0, 1.0), start=lit, **thrust))
        scene.add(FixedJoint(name, names[k + 1], name=f"above {name}", release_time=lit + BURN))
    return scene


def _cone(radius: float, length: float) -> Shape:
    """Return a blunt cone along z."""
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(24, -0.5 * length)])
    return Shape.convex_hull(np.vstack([ring, ring * (0.2, 0.2, -1.0)]))


def check(run: Recording) -> list[Check]:
    """Compare the payload with the printed one and its speed with escape speed."""
    mass = payload()
    per_kilogram = abs(final_speed(mass + 1.0) - final_speed(mass))
    speed = run.velocity("payload")[-1, 2] / SLOWER
    let_go = [event.time for event in run.status.events if event.kind == "joint let go"]
    behind = run.position("stage II")[-1, 2] - run.position("stage I")[-1, 2]
    (m1, p1, i1), (m2, _, _) = STAGES.values()
    whole = m1 + m2 + mass
    dropped = run.velocity("stage I")[-1, 2] / SLOWER / (i1 * GRAVITY * math.log(whole / (whole - p1))) - 1.0
    return [
        equal("stages dropped", len(let_go), 2, "each when it is empty"),
        at_most("payload, kg from 8336.65", abs(mass - PRINTED_PAYLOAD), 0.005, "v_1 + v_2 is the escape speed, 11.18 km/s"),
        at_most("error of the final speed, in kg of payload", abs(speed - ESCAPE) / per_kilogram, 1.0, "Tsiolkovsky, stage by stage"),
        at_most("speed of the dropped stage, relative error", abs(dropped), 1e-5, "it keeps what it has"),
        at_least("way of the dropped stage behind the other, m", behind, 10.0, "it no longer accelerates"),
        at_most("motion across, m", np.abs(run.positions[:, :, :2]).max(), 1e-6, "thrust along the axis"),
    ]


SCENES = (GalleryScene("launcher", "Two stages and a payload that escapes", scene, check, DURATION),)
