"""The same film: a scene must not change with the units, the place, the axes, the names or the order of its bodies.

Mechanics has no length of its own: with all lengths times k and gravity times k, times are the same, positions and velocities
k times as large, spins the same. Nor has it a place, a direction or names. So each case runs the scene as it is (`film`), runs
it again changed, undoes the change and compares all frames.

What may differ is rounding, and what impacts make of it: about a factor of ten each for tumbling bodies of e = 0.5. The scene
has some ten impacts a body in 1.2 s, so 1e-16 grows to 1e-6 at most, the bound, relative to the size of bodies. A shift by 1e4
sizes takes four digits of every position beforehand; there it is compared for 0.8 s, half the impacts. Names do not enter
arithmetic: bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from rigidimpulse.core.portable import dot
from rigidimpulse.core.quaternion import conjugate, multiply, normalize, rotate
from rigidimpulse.engine.simulate import simulate
from rigidimpulse.gallery.hard.parts import GRAVITY, dull, finite
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SIZE = 0.4
SHIFT = 1e4 * SIZE * np.array([1.0, -0.5, 0.0])
TURN = np.array([0.36, 0.48, 0.64, 0.48])
"""A quaternion of length 1, about no axis of the scene."""
BOUND = 1e-6
DURATION, SHORT = 1.2, 0.8
HERE, NONE = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
"""No shift, no turn."""


def scene(scale: float = 1.0, shift: np.ndarray = HERE, turn: np.ndarray = NONE, renamed: bool = False, reordered: bool = False) -> Scene:
    """Return a floor, a box, a ball, a hull and a capsule that fall, bounce and meet; changed as asked for."""
    material = dull(0.4, 0.5)
    q = normalize(turn)
    up = rotate(q, np.array([0.0, 0.0, 1.0]))
    scene = Scene(gravity=-GRAVITY * scale * up)
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.2], [0, 0, -0.8]]) * 0.6 * SIZE * scale
    # name, shape, place and velocity in sizes, spin
    plan: list[tuple[str, Shape, Any, Any, Any]] = [
        ("box", Shape.box(np.array([1.0, 0.7, 0.5]) * SIZE * scale), (0.0, 0.0, 1.5), (1.0, 0.2, 0.0), (1.0, 2.0, 0.5)),
        ("ball", Shape.sphere(0.4 * SIZE * scale), (1.4, 0.1, 2.1), (-1.0, 0.0, 0.0), (0.0, 0.0, 3.0)),
        ("hull", Shape.convex_hull(corners), (-1.1, 0.3, 2.4), (1.5, 0.0, 0.0), (-1.0, 0.3, 0.7)),
        ("capsule", Shape.capsule(0.25 * SIZE * scale, 0.8 * SIZE * scale), (0.2, -0.2, 3.1), (0.0, 0.3, 0.0), (2.0, 0.4, 0.0)),
    ]
    bodies = [Body("floor", Shape.half_space(normal=up, offset=float(dot(up, shift))), motion="static", material=material)]
    for name, shape, place, velocity, spin in plan:
        start = shift + rotate(q, np.array(place)) * SIZE * scale
        bodies.append(
            Body(name, shape, position=start, orientation=q, velocity=rotate(q, np.array(velocity)) * SIZE * scale,
                 angular_velocity=rotate(q, np.array(spin)), material=material)
        )  # fmt: skip
    if renamed:
        bodies = [replace(body, name=new_name(body.name)) for body in bodies]
    for body in bodies[::-1] if reordered else bodies:
        scene.add(body)
    return scene


def new_name(name: str) -> str:
    """Return a name whose place in the alphabet is another."""
    return f"{9 - len(name)} {name}"


def film(run: Recording, name: str, scale: float, shift: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (f, 3) in sizes and orientations (f, 4) of a body, as they would be without the change."""
    back = conjugate(normalize(turn))
    return rotate(back, run.position(name) - shift) / (SIZE * scale), multiply(back, run.orientation(name))


def check(change: dict[str, Any], rename: Callable[[str], str], run: Recording) -> list[Check]:
    """Compare with the film of the scene as it is."""
    original = simulate(scene(), float(run.times[-1]), 60.0)
    unchanged = (1.0, HERE, NONE)
    undo = (change.get("scale", 1.0), change.get("shift", HERE), change.get("turn", NONE))
    moved = turned = 0.0
    for name in ("box", "ball", "hull", "capsule"):
        here, there = film(original, name, *unchanged), film(run, rename(name), *undo)
        moved = max(moved, float(np.linalg.norm(there[0] - here[0], axis=1).max()))
        same = np.minimum(np.abs(there[1] - here[1]).max(axis=1), np.abs(there[1] + here[1]).max(axis=1))
        turned = max(turned, float(same.max()))
    bound = 0.0 if change.get("renamed") else BOUND
    law = "names do not enter arithmetic" if change.get("renamed") else "mechanics knows no units, place or order"
    return [
        finite(run),
        at_most("positions differ by, of a body's size", moved, bound, law),
        at_most("quaternions differ by", turned, bound, law),
        equal("impacts more or less", abs(len(run.impacts) - len(original.impacts)), 0, law),
    ]


def _case(name: str, description: str, duration: float, rename: Callable[[str], str] = str, **change: Any) -> GalleryScene:
    return GalleryScene(name, description, partial(scene, **change), partial(check, change, rename), duration)


SCENES = (
    _case("scale_1e-3", "The same film at a thousandth of the size", DURATION, scale=1e-3),
    _case("scale_1e3", "The same film at a thousand times the size", DURATION, scale=1e3),
    _case("shifted", "The same film 1e4 body sizes away", SHORT, shift=SHIFT),
    _case("rotated", "The same film about other axes", DURATION, turn=TURN),
    _case("renamed", "The same film with other names", DURATION, new_name, renamed=True),
    _case("reordered", "The same film with bodies in the opposite order, so a and b of every pair swapped", DURATION, reordered=True),
)
