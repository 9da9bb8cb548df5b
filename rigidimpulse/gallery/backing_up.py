"""Backing up time to an impact, by bisection (A3) and by a linear approximation (A4): the same batons thrown at a floor.

A capsule of length L between its ends and radius r, thrown with v_z from the height z0, spinning with w about a level axis through its
middle:

    gap(t) = z0 + v_z t - g t^2 / 2 - (L / 2) |sin(a0 + w t)| - r

Bisection finds its first root, to 1e-13 of a body's size: over the closing speed c, some 1e-14 s, and arithmetic of sixteen digits leaves
1e-13 s of one second. The linear approximation goes down the tangent from the start of the step, t_i:

    t = t_i + gap(t_i) / c(t_i),    c = -gap',    error  1/2 |gap''| (t - t_i)^2 / c

and the run meets this t itself to 1e-11 s. The error is of second order in the step: 3e-6 to 5e-4 s here, millions of times that of
bisection.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from rigidimpulse.core.quaternion import quaternion_from_axis_angle
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY, LENGTH, RADIUS, DENSITY = 9.81, 0.6, 0.07, 700.0
BATONS = {"slow": (1.0, -3.0, 2.0, 0.5), "quick": (1.3, -5.0, 9.0, 0.3), "whirling": (1.6, -4.0, 17.0, 1.0), "fast": (1.9, -12.0, 6.0, 0.2)}
"""z0 m, v_z m/s, w rad/s, a0 rad of each."""
TRACK, ALONG = 0.6, 0.8
"""m between batons, and m/s along the floor."""
STEP = 1.0 / 60.0
DURATION = 1.25
ROOT, TANGENT = 1e-12, 1e-11
"""s."""


def scene() -> Scene:
    """Return the floor and the batons, each in a track of its own."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static"))
    smooth = Material(density=DENSITY, restitution=0.2, static_friction=0.0)
    baton = Shape.capsule(RADIUS, LENGTH)
    for k, (name, (height, speed, spin, angle)) in enumerate(BATONS.items()):
        # A capsule lies along z: a quarter turn about y lays it along x, and `angle` more raises one of its ends.
        turn = quaternion_from_axis_angle((0.0, 1.0, 0.0), 0.5 * math.pi + angle)
        motion: dict[str, Any] = {"velocity": (ALONG, 0.0, speed), "angular_velocity": (0.0, spin, 0.0)}
        scene.add(Body(name, baton, position=(0.0, k * TRACK, height), orientation=turn, material=smooth, **motion))
    return scene


def check_bisection(run: Recording) -> list[Check]:
    """Compare the first impact of each baton with the root."""
    checks = []
    for name in BATONS:
        late = abs(_first(run, name) - _root(partial(_gap, name)))
        checks.append(at_most(f"{name}: error of the impact time, s", late, ROOT, "first root of gap(t) = 0"))
    return checks


def check_linear(run: Recording) -> list[Check]:
    """Compare the first impact of each baton with the tangent's, and its error with the law."""
    checks = []
    for name in BATONS:
        gap = partial(_gap, name)
        root, (start, tangent) = _root(gap), _tangent(name)
        ahead = np.linspace(start, max(root, tangent), 1000)
        bound = 0.5 * np.abs(_bend(name, ahead)).max() * (max(root, tangent) - start) ** 2 / np.min(-_rate(name, ahead))
        found = _first(run, name)
        checks += [
            at_most(f"{name}: impact time from that of the tangent, s", abs(found - tangent), TANGENT, "t_i + gap / c"),
            at_most(f"{name}: error of the impact time, s", abs(found - root), bound, "|gap''| (t - t_i)^2 / 2 c"),
            at_least(f"{name}: error of the impact time, of bisection's bound", abs(found - root) / ROOT, 1e6, "second order in the step"),
        ]
    return checks


def _first(run: Recording, name: str) -> float:
    """Return the time of a body's first impact, s."""
    index = run.index(name)
    times = run.impacts["time"][(run.impacts["body_a"] == index) | (run.impacts["body_b"] == index)]
    return float(times[0]) if len(times) else math.nan


def _gap(name: str, t: Any) -> Any:
    height, speed, spin, angle = BATONS[name]
    return height + speed * t - 0.5 * GRAVITY * t**2 - 0.5 * LENGTH * np.abs(np.sin(angle + spin * t)) - RADIUS


def _rate(name: str, t: Any) -> Any:
    """Return gap', m/s."""
    _, speed, spin, angle = BATONS[name]
    turn = angle + spin * t
    return speed - GRAVITY * t - 0.5 * LENGTH * spin * np.cos(turn) * np.sign(np.sin(turn))


def _bend(name: str, t: Any) -> Any:
    """Return gap'' where the baton is not level, m/s^2."""
    _, _, spin, angle = BATONS[name]
    return -GRAVITY + 0.5 * LENGTH * spin**2 * np.abs(np.sin(angle + spin * t))


def _root(gap: Callable) -> float:
    """Return the first root of a gap, s."""
    from scipy.optimize import root_scalar

    times = np.linspace(0.0, DURATION, 100_000)
    first = int(np.argmax(gap(times) <= 0.0))
    return float(root_scalar(gap, bracket=(times[first - 1], times[first]), xtol=1e-15, rtol=1e-15).root)


def _tangent(name: str) -> tuple[float, float]:
    """Return the start of the step in which the tangent reaches the floor, and when it does, s."""
    start = 0
    while True:
        t = start * STEP
        rate = _rate(name, t)
        if rate < 0.0 and (wait := -_gap(name, t) / rate) <= STEP:
            return t, float(t + wait)
        start += 1


SCENES = (
    GalleryScene("backing_up_bisection", "Batons hit a floor: time is backed up by bisection (A3)", scene, check_bisection, DURATION),
    GalleryScene(
        "backing_up_linear", "The same batons: time is backed up by a tangent (A4)", scene, check_linear, DURATION,
        accuracy=Accuracy(impact_time="linear", step=STEP),
    ),
)  # fmt: skip
