"""Harmonic forces (B1): on free balls, and on balls on springs, one of them at resonance.

    free from rest: m v = F_0 (1 - cos w t) / w,
    on a spring, w_0^2 = k / m:  x = (F_0 / m) (sin w t - (w / w_0) sin w_0 t) / (w_0^2 - w^2),
    at resonance  x = F_0 (sin w t - w t cos w t) / (2 m w^2), which grows without end
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.dynamics.forces.harmonic import HarmonicForce
from rigidimpulse.dynamics.forces.spring import Spring
from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

MASS, FORCE, STIFFNESS = 1.0, 2.0, 40.0
NATURAL = math.sqrt(STIFFNESS / MASS)
FREE = {"free, 0.5 Hz": 0.5, "free, 1 Hz": 1.0, "free, 2 Hz": 2.0}
DRIVEN = {"below resonance": 0.6 * NATURAL, "at resonance": NATURAL, "above resonance": 1.8 * NATURAL}
"""Frequencies: Hz; rad/s."""
RADIUS, APART, LENGTH = 0.15, 0.5, 1.5
DURATION = 8.0
BOUND = 1e-6
"""m: 480 steps, each off by up to 1e-8 of 0.15 m."""


def scene() -> Scene:
    """Return the balls side by side along y; forces are along x."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    for k, (name, frequency) in enumerate(FREE.items()):
        scene.add(Body(name, Shape.sphere(RADIUS), mass=MASS, position=(0.0, -(k + 1.5) * APART, 0.0)))
        scene.add(HarmonicForce(name, FORCE, frequency, (1.0, 0.0, 0.0)))
    for k, (name, w) in enumerate(DRIVEN.items()):
        y = k * APART
        scene.add(Body(f"post, {name}", Shape.box((0.1, 0.3, 0.3)), motion="static", position=(-LENGTH - 0.05, y, 0.0)))
        scene.add(Body(name, Shape.sphere(RADIUS), mass=MASS, position=(0.0, y, 0.0)))
        scene.add(Spring(f"post, {name}", name, (-LENGTH, y, 0.0), (0.0, y, 0.0), STIFFNESS))
        scene.add(HarmonicForce(name, FORCE, w / (2.0 * math.pi), (1.0, 0.0, 0.0)))
    return scene


def exact(times: np.ndarray) -> Exact:
    """Return the ways of all balls."""
    ways = {name: _free_way(2.0 * math.pi * frequency, times) for name, frequency in FREE.items()}
    ways |= {name: _driven_way(w, times) for name, w in DRIVEN.items()}
    start = scene()
    return Exact({name: np.asarray(start[name].position) + way[:, None] * [1.0, 0.0, 0.0] for name, way in ways.items()})


def _free_way(w: float, t: np.ndarray) -> np.ndarray:
    """Return the way (f,) [m] of a free ball: the integral of its velocity."""
    return FORCE / (MASS * w) * (t - np.sin(w * t) / w)


def _driven_way(w: float, t: np.ndarray) -> np.ndarray:
    """Return the way (f,) [m] of a ball on a spring."""
    if w == NATURAL:
        return FORCE / (2.0 * MASS * w**2) * (np.sin(w * t) - w * t * np.cos(w * t))
    return FORCE / MASS * (np.sin(w * t) - w / NATURAL * np.sin(NATURAL * t)) / (NATURAL**2 - w**2)


def check(run: Recording) -> list[Check]:
    """Compare impulses and motions with the closed forms."""
    t, checks = run.times, []
    for name, frequency in FREE.items():
        w = 2.0 * math.pi * frequency
        error = np.abs(MASS * run.velocity(name)[:, 0] - FORCE * (1.0 - np.cos(w * t)) / w).max()
        checks.append(at_most(f"{name}: momentum, N s", error, BOUND, "I = F_0 (1 - cos w t) / w"))
    for name, w in DRIVEN.items():
        error = np.abs(run.position(name)[:, 0] - _driven_way(w, t)).max()
        checks.append(at_most(f"{name}: way, m", error, BOUND, "driven oscillator from rest"))
    assert run.ledger is not None
    balance = run.ledger.total + sum(run.ledger.dissipated.values())
    return [*checks, at_most("ledger, J", np.ptp(balance), 1e-9, "energy is what the forces did")]


SCENES = (
    GalleryScene(
        "driven_oscillator", "Harmonic forces on free balls and on springs", scene, check, DURATION, exact=exact
    ),
)
