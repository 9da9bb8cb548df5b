"""A superball thrown under a table comes back (Garwin 1969, Kinematics of an ultraelastic rough ball, Am. J. Phys. 37).

A solid ball with tangential restitution 1 reverses the slip u of the contact point as well as the normal velocity.
With v the velocity along the surface, s = R w the surface speed of the lowest point relative to the centre (positive
along v), I = (2/5) m R^2:

    floor      u = v + s,   v' = v - (4/7) u,   s' = s - (10/7) u
    underside  u = v - s,   v' = v - (4/7) u,   s' = s + (10/7) u

so after floor, underside and floor a ball thrown without spin goes back with -333/343 of its speed. Between impacts
it flies a parabola.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

RADIUS = 0.06
DENSITY = 950.0
GRAVITY = 9.81
START = (-0.75, 0.55)
THROW = (3.0, -4.0)
"""Position and velocity along x and z, m and m/s."""
UNDERSIDE = 0.75
EDGE = -0.5
"""The table's underside is at this height, from this x on, m."""
TABLE_LENGTH, TABLE_WIDTH, TABLE_THICKNESS, LEG = 1.2, 0.8, 0.04, 0.05
GRIP = 5.0
"""Friction that sticks at every bounce of the run (1.1 is needed)."""
DURATION = 1.75
BOUND = 1e-11
"""m, s, m/s: rounding of some twenty roots and products, times a thousand."""


class Bounce(NamedTuple):
    """An impact: time [s] and change of the velocity along the surface [m/s]."""

    time: float
    change: float


def scene() -> Scene:
    """Return floor, table and ball."""
    ball = Material(
        density=DENSITY, restitution=1.0, static_friction=GRIP, dynamic_friction=GRIP, tangential_restitution=1.0
    )
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static"))
    scene.add(Body("table", _table(), motion="static"))
    start, throw = (START[0], 0.0, START[1]), (THROW[0], 0.0, THROW[1])
    scene.add(Body("ball", Shape.sphere(RADIUS), position=start, velocity=throw, material=ball))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare with parabolas and the law of the bounce."""
    bounces, x, z, vx, vz, s = _fly(float(run.times[-1]))
    same = len(run.impacts) == len(bounces)
    mass = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3
    ball = run.index("ball")
    toward = np.where(run.impacts["body_b"] == ball, 1.0, -1.0)
    change = toward * run.impacts["tangent_impulse"][:, 0] / mass
    times = [bounce.time for bounce in bounces]
    late = np.abs(run.impacts["time"] - times).max() if same else np.inf
    kick = np.abs(change - [bounce.change for bounce in bounces]).max() if same else np.inf
    between = run.times[(run.times > times[2]) & (run.times < times[3])]
    back = run.velocity("ball")[np.searchsorted(run.times, between[0]), 0]
    total = run.ledger.total if run.ledger else np.array([np.nan])
    spin = -run.angular_velocity("ball")[-1, 1] * RADIUS
    law = "u reverses: v' = v - (4/7) u, R w' = R w -+ (10/7) u"
    return [
        equal("impacts", len(run.impacts), len(bounces), "parabolas between bounces"),
        at_most("error of the impact times, s", late, BOUND, "roots of parabolas"),
        at_most("error of the change of v at impacts, m/s", kick, BOUND, law),
        at_most("v after floor, table, floor, from -333/343", abs(back / THROW[0] + 333 / 343), BOUND, "Garwin 1969"),
        at_most("error of the final place, m", np.abs(run.position("ball")[-1] - [x, 0.0, z]).max(), BOUND, law),
        at_most("error of the final velocity, m/s", np.abs(run.velocity("ball")[-1] - [vx, 0.0, vz]).max(), BOUND, law),
        at_most("error of the final R w, m/s", abs(spin - s), BOUND, law),
        at_most("energy, relative change", np.ptp(total) / total[0], 1e-12, "both restitutions 1 keep energy"),
    ]


def _table() -> Shape:
    """Return the top and four legs, out of the ball's way; origin on the floor."""
    upright = (1.0, 0.0, 0.0, 0.0)
    middle = EDGE + 0.5 * TABLE_LENGTH
    top = Shape.box((TABLE_LENGTH, TABLE_WIDTH, TABLE_THICKNESS))
    leg = Shape.box((LEG, LEG, UNDERSIDE))
    parts = [(top, (middle, 0.0, UNDERSIDE + 0.5 * TABLE_THICKNESS), upright)]
    for x in (EDGE + LEG, EDGE + TABLE_LENGTH - LEG):
        for y in (-0.5 * TABLE_WIDTH + LEG, 0.5 * TABLE_WIDTH - LEG):
            parts.append((leg, (x, y, 0.5 * UNDERSIDE), upright))
    return Shape.compound(parts)


def _fly(end: float) -> tuple[list[Bounce], float, float, float, float, float]:
    """Return the bounces until `end`, and x, z, v_x, v_z and s there."""
    (x, z), (vx, vz), s = START, THROW, 0.0
    time, bounces = 0.0, []
    while True:
        # z + vz t - g t^2 / 2 = R has one positive root; the underside is met on the way up, by the smaller root.
        floor = (vz + math.sqrt(vz * vz + 2.0 * GRAVITY * max(z - RADIUS, 0.0))) / GRAVITY
        rise = UNDERSIDE - RADIUS - z
        root = vz * vz - 2.0 * GRAVITY * rise
        roof = (vz - math.sqrt(root)) / GRAVITY if vz > 0.0 and root > 0.0 else math.inf
        if roof < math.inf and x + vx * roof < EDGE:
            roof = math.inf
        wait = min(floor, roof)
        step = min(wait, end - time)
        x, z, vz = x + vx * step, z + vz * step - 0.5 * GRAVITY * step * step, vz - GRAVITY * step
        time += step
        if step < wait:
            return bounces, x, z, vx, vz, s
        sign = 1.0 if floor < roof else -1.0
        slip = vx + sign * s
        vx, vz, s = vx - 4.0 / 7.0 * slip, -vz, s - sign * 10.0 / 7.0 * slip
        bounces.append(Bounce(time, -4.0 / 7.0 * slip))


SCENES = (GalleryScene("superball", "A superball thrown under a table comes back (Garwin)", scene, check, DURATION),)
