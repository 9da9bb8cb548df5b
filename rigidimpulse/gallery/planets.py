"""Planets, a comet and a double star: Kepler's laws.

    T = 2 pi sqrt(a^3 / s),    s = G M;    two stars that attract each other: s = G (m_1 + m_2)

All planets' periods are those of their half axes, 1 : 2 : 4, so that after the longest everything is where it was.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.dynamics.forces.field import PointAttractor
from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

STRENGTH = 4.0 * math.pi**2
"""m^3/s^2: a planet at 1 m takes 1 s."""
ORBITS = {"inner planet": (1.0, 0.0), "planet": (2.0, 0.1), "outer planet": (4.0, 0.3), "comet": (4.0, 0.8)}
"""Period in s, eccentricity."""
STARS = {"star": 3.0, "companion": 1.0}
STAR_PERIOD, STAR_DISTANCE, STAR_PLACE = 2.0, 1.0, np.array([0.0, 6.0, 0.0])
SIZES = {"inner planet": 0.05, "planet": 0.08, "outer planet": 0.1, "comet": 0.04, "star": 0.2, "companion": 0.13}
DURATION = 4.0
BOUND = 1e-6


def scene() -> Scene:
    """Return the sun at the origin, planets far from it, and the double star."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(Body("sun", Shape.sphere(0.2), motion="static"))
    for k, (name, (period, e)) in enumerate(ORBITS.items()):
        a = period ** (2.0 / 3.0)
        speed = math.sqrt(STRENGTH / a * (1.0 - e) / (1.0 + e))
        turn, tilt = 1.3 * k, 0.15 * k
        far = np.array([math.cos(turn), math.sin(turn), 0.0])
        along = np.array([-math.sin(turn) * math.cos(tilt), math.cos(turn) * math.cos(tilt), math.sin(tilt)])
        scene.add(Body(name, Shape.sphere(SIZES[name]), position=a * (1.0 + e) * far, velocity=speed * along, mass=1.0))
    scene.add(PointAttractor((0.0, 0.0, 0.0), STRENGTH, bodies=list(ORBITS), name="sun"))
    whole = sum(STARS.values())
    strength = 4.0 * math.pi**2 * STAR_DISTANCE**3 / STAR_PERIOD**2
    for name, sign, share in (("star", -1.0, STARS["companion"] / whole), ("companion", 1.0, STARS["star"] / whole)):
        place = STAR_PLACE + (sign * share * STAR_DISTANCE, 0.0, 0.0)
        speed = sign * share * 2.0 * math.pi * STAR_DISTANCE / STAR_PERIOD
        scene.add(Body(name, Shape.sphere(SIZES[name]), position=place, velocity=(0.0, speed, 0.0), mass=STARS[name]))
    # The companion feels the star alone, and the star feels it back.
    scene.add(PointAttractor("star", strength * STARS["star"] / whole, bodies=["companion"], name="double star"))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare everybody's place after each period with the start."""
    checks, t = [], run.times
    for name, period in [*((name, period) for name, (period, _) in ORBITS.items()), ("star", STAR_PERIOD), ("companion", STAR_PERIOD)]:
        home = [int(np.argmin(np.abs(t - n * period))) for n in range(1, round(DURATION / period) + 1)]
        error = np.abs(run.position(name)[home] - run.position(name)[0]).max()
        checks.append(at_most(f"{name}: way from its start after each period, m", error, BOUND, "T = 2 pi sqrt(a^3 / s)"))
    for name in ORBITS:
        x, v = run.position(name), run.velocity(name)
        area = np.cross(x, v)
        change = np.ptp(area, axis=0).max() / np.linalg.norm(area[0])
        checks.append(at_most(f"{name}: areas, relative", change, BOUND, "equal areas in equal times"))
    assert run.ledger is not None
    change = np.ptp(run.ledger.total) / run.ledger.kinetic.max()
    return [*checks, at_most("energy, relative", change, BOUND, "attractors store what they take")]


SCENES = (GalleryScene("planets", "Planets, a comet and a double star", scene, check, DURATION),)
