"""Kinematic response: balls that bounce as particles on a plane, their speed damped by k, whatever their mass (A1).

    E(p) = n.p + d,    impact where E changes sign,    v' = v - (1 + k)(v.n) n

A ball that falls from the height h meets the floor with s = sqrt(2 g h), leaves with k s, meets it again after 2 k s / g, and so on:
impact j (from 0) has the speed k^j s and the time

    t_j = s / g + (2 s / g) (k + k^2 + ... + k^j)

Speed along the floor and spin stay. Each track has a light ball and one eight thousand times as heavy side by side: their paths are the
same bits until they rest. Roots and products of sixteen digits, some twenty impacts: 1e-11. Impulses with friction would slow both down
and take the spin.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY, RADIUS, HEIGHT = 9.81, 0.08, 1.2
TRACKS = {"k = 0.5": 0.5, "k = 0.7": 0.7, "k = 0.85": 0.85, "k = 1": 1.0}
"""Restitution of each track."""
DENSITIES = {"light": 30.0, "heavy": 240_000.0}
SPEED, SPIN = 0.9, 6.0
"""m/s along the track, rad/s about the vertical."""
TRACK, PAIR = 0.7, 0.2
"""m between tracks, and between the balls of a track."""
DURATION = 3.5
BOUND = 1e-11
TAIL = 0.999
"""Share of the time of rest, s (1 + k) / (g (1 - k)), up to which impacts are compared: the rest of the infinitely many is one impact."""


def scene() -> Scene:
    """Return the floor and two balls a track."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static"))
    ball = Shape.sphere(RADIUS)
    for track, (name, k) in enumerate(TRACKS.items()):
        for side, (kind, density) in enumerate(DENSITIES.items()):
            place = (0.0, track * TRACK + side * PAIR, RADIUS + HEIGHT)
            motion: dict[str, Any] = {"velocity": (SPEED, 0.0, 0.0), "angular_velocity": (0.0, 0.0, SPIN)}
            material = Material(density=density, restitution=k)
            scene.add(Body(f"{kind}, {name}", ball, position=place, material=material, **motion))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare times and speeds of all impacts with the closed forms, and the balls of each track with each other."""
    checks, along, turn = [], 0.0, 0.0
    for name, k in TRACKS.items():
        light, heavy = (f"{kind}, {name}" for kind in DENSITIES)
        time, approach, leaving = (_impacts(run, light)[field] for field in ("time", "approach_speed", "separation_speed"))
        times = _times(k, float(run.times[-1]))
        known = len(times)
        speeds = math.sqrt(2.0 * GRAVITY * HEIGHT) * k ** np.arange(known)
        enough = len(time) >= known
        late = np.abs(time[:known] - times).max() if enough else math.inf
        error = max(np.abs(approach[:known] - speeds).max(), np.abs(leaving[:known] - k * speeds).max()) if enough else math.inf
        flying = np.ix_(run.times < times[-1], [0, 2])
        same = [np.array_equal(of(light)[flying], of(heavy)[flying]) for of in (run.position, run.velocity)]
        chosen = [run.index(light), run.index(heavy)]
        kept = np.ix_(run.times < times[-1], chosen)
        along = max(along, np.abs(run.velocities[kept][..., 0] - SPEED).max())
        turn = max(turn, np.abs(run.angular_velocities[kept] - [0.0, 0.0, SPIN]).max())
        checks += [
            at_most(f"{name}: error of {known} impact times, s", late, BOUND, "roots of E(p(t)) = 0"),
            at_most(f"{name}: error of their speeds, m/s", error, BOUND, "k^j, v' = -k v"),
            equal(f"{name}: light and heavy ball differ", int(not all(same)), 0, "mass plays no part"),
        ]
    return [
        *checks,
        at_most("change of the speed along the floor, m/s", along, BOUND, "v.n alone changes"),
        at_most("change of the spin, rad/s", turn, BOUND, "only v changes"),
    ]


def _impacts(run: Recording, name: str) -> np.ndarray:
    """Return the impacts of a body, in order of time."""
    index = run.index(name)
    return run.impacts[(run.impacts["body_a"] == index) | (run.impacts["body_b"] == index)]


def _times(k: float, end: float) -> np.ndarray:
    """Return the times of the impacts until `end`, or until the balls almost rest, s."""
    fall = math.sqrt(2.0 * HEIGHT / GRAVITY)
    stop = min(end, TAIL * fall * (1.0 + k) / (1.0 - k)) if k < 1.0 else end
    times, flight = [fall], 2.0 * fall * k
    while times[-1] + flight <= stop:
        times.append(times[-1] + flight)
        flight *= k
    return np.array(times)


SCENES = (
    GalleryScene(
        "kinematic_bounce", "Balls bounce as particles: speeds k^j, whatever the mass (animation notes A1)", scene, check, DURATION,
        accuracy=Accuracy(response="kinematic"),
    ),
)  # fmt: skip
