"""A rear-end crash, its speed read from the skid marks (B12).

A car of mass m_a that rolls freely runs into one of mass m_b that stands with its brakes on. With e = 0 they go on together, and only the
struck one brakes:

    m_a V = (m_a + m_b) u,    u^2 = 2 d mu m_b g / (m_a + m_b)
    V = (1 + m_b / m_a) sqrt(2 mu g d m_b / (m_a + m_b))

with d the length of the skid marks. While they slide the striking car pushes with m_a mu m_b g / (m_a + m_b). The bumpers meet level with
the centres of mass, so the blow tips nothing and no friction acts in it. Forces are constant until the stop: d and V are exact up to the
contact margin, 1e-6 of a car, and the equations of contact, 1e-12; 1e-6 relative is the bound. A crash with e = 0.01, or friction in
the blow, is off by 1e-2.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.gallery.car import GRAVITY, LENGTH, make_car, road
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.scene import Scene

MASS_A, MASS_B = 1600.0, 1100.0
SPEED, FRICTION = 15.0, 0.7
GAP = 8.0
"""m between the cars at the start."""
TOTAL = MASS_A + MASS_B
COMMON = MASS_A * SPEED / TOTAL
SLOWING = FRICTION * MASS_B * GRAVITY / TOTAL
CRASH, STOP = GAP / SPEED, GAP / SPEED + COMMON / SLOWING
"""s, times of the blow and of the stop."""
DURATION = 4.25
RELATIVE = 1e-6
ROAD = 30.0


def scene() -> Scene:
    """Return the road and the two cars; the first one rolls without friction."""
    scene = road(ROAD)
    scene.add(make_car("striking car", 0.0, SPEED, MASS_A, 0.0))
    scene.add(make_car("struck car", GAP + LENGTH, 0.0, MASS_B, FRICTION))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare the skid, the speed that follows from it and the push with the closed forms."""
    struck, striking = run.position("struck car")[:, 0], run.position("striking car")[:, 0]
    skid = struck[-1] - struck[0]
    found = (1.0 + MASS_B / MASS_A) * math.sqrt(2.0 * FRICTION * GRAVITY * skid * MASS_B / TOTAL)
    t = np.clip(run.times, CRASH, STOP) - CRASH
    error = np.abs(struck - struck[0] - (COMMON * t - 0.5 * SLOWING * t**2)).max()
    after = run.times > CRASH
    apart = (struck - striking - LENGTH)[after]
    sliding = np.searchsorted(run.times, 0.5 * (CRASH + STOP))
    push = run.contact_force("striking car")[sliding, 0]
    return [
        at_most(
            "V from the skid marks, relative error", abs(found / SPEED - 1.0), RELATIVE, "(1 + m_b/m_a) sqrt(2 mu g d m_b / (m_a + m_b))"
        ),
        at_most("error of the skid at any time, of its length", error / skid, RELATIVE, "u t - a t^2 / 2"),
        at_most("error of the time of the blow, relative", abs(run.impacts["time"][0] / CRASH - 1.0), RELATIVE, "gap / V"),
        at_most(
            "error of the push while they slide, relative", abs(-push / (MASS_A * SLOWING) - 1.0), RELATIVE, "m_a mu m_b g / (m_a + m_b)"
        ),
        at_most("cars apart after the blow, of a car", np.abs(apart).max() / LENGTH, 2.0 * RELATIVE, "e = 0"),
        at_least("cars apart at any time, m", (struck - striking - LENGTH).min(), 0.0, "bodies stay apart"),
        at_most("speed at the end, m/s", np.abs(run.velocities[-1]).max(), RELATIVE, "the struck car brakes both"),
    ]


SCENES = (
    GalleryScene("rear_end_crash", "A rear-end crash, its speed read from the skid marks", scene, check, DURATION),
)
