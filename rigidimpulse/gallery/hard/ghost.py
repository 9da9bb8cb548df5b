"""Internal edges: a floor of triangles, or of tiles, is still flat. Nothing may bump where two of them meet.

A body that moves over a floor made of pieces meets the side of each next piece at the same height. A contact there has a
normal that the surface as a whole does not have; an engine that believes it stops or lifts the body (ghost hits). On a flat
floor without friction a box keeps its velocity, and a ball that rolls without slip keeps both velocity and spin:

    x = x0 + v t,  y = y0,  z = const  (up to one contact margin, 1e-6 of the body's size)

A smooth ball of e = 1 thrown at the very corner of four tiles bounces as on one: z = r + h - g s^2 / 2, s the time since it was
last at the height h it came from. The bound of the issue is 1e-6 m off the path.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from rigidimpulse.gallery.hard.parts import GRAVITY, dull, energy_never_grows, finite, undisturbed
from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

BOX, BALL = 0.3, 0.15
VELOCITY = np.array([4.0, 0.7, 0.0])
"""m/s, at an angle to the edges."""
TILES, TILE, THICK = (14, 5), 0.5, 0.2
START = np.array([0.37, 0.41])
CORNER = np.array([4.0 * TILE, 2.0 * TILE])
"""m, where the thrown ball lands first: the corner of four tiles."""
DROP = 0.4
FALL = math.sqrt(2.0 * DROP / GRAVITY)


def scene(body: str, floor: str) -> Scene:
    """Return a box that slides, a ball that rolls or one that is thrown, on a floor of one mesh or of many boxes."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    if floor == "triangles":
        scene.add(Body("floor", grid(), motion="static", material=Material()))
    else:
        tile = Shape.box((TILE, TILE, THICK))
        for i in range(TILES[0]):
            for j in range(TILES[1]):
                place = ((i + 0.5) * TILE, (j + 0.5) * TILE, -0.5 * THICK)
                scene.add(Body(f"tile {i} {j}", tile, motion="static", position=place, material=Material()))
    if body == "box":
        place = (*START, 0.5 * BOX)
        scene.add(Body("body", Shape.box(BOX), position=place, velocity=VELOCITY, material=dull(0.0)))
    elif body == "thrown ball":
        place = (*(CORNER - FALL * VELOCITY[:2]), BALL + DROP)
        scene.add(Body("body", Shape.sphere(BALL), position=place, velocity=VELOCITY, material=dull(0.0, 1.0)))
    else:
        spin = np.cross((0.0, 0.0, 1.0), VELOCITY) / BALL
        place = (*START, BALL)
        scene.add(Body("body", Shape.sphere(BALL), position=place, velocity=VELOCITY, angular_velocity=spin, material=dull(0.5)))
    return scene


def grid() -> Shape:
    """Return a flat sheet of triangles, two a tile, its upper side z = 0."""
    x, y = np.meshgrid(np.arange(TILES[0] + 1) * TILE, np.arange(TILES[1] + 1) * TILE, indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    i, j = np.meshgrid(np.arange(TILES[0]), np.arange(TILES[1]), indexing="ij")
    here = (i * (TILES[1] + 1) + j).ravel()
    right, ahead = here + TILES[1] + 1, here + 1
    faces = np.concatenate([np.stack([here, right, right + 1], 1), np.stack([here, right + 1, ahead], 1)])
    return Shape.mesh(vertices, faces)


def check(run: Recording) -> list[Check]:
    """Compare with the straight path."""
    start = run.position("body")[0]
    off = run.position("body") - start - run.times[:, None] * VELOCITY
    spin = run.angular_velocity("body")
    return [
        finite(run),
        at_most("off its path along the floor, m", np.linalg.norm(off[:, :2], axis=1).max(), 1e-6, "x = x0 + v t"),
        at_most("off its height, m", np.abs(off[:, 2]).max(), 1e-6, "z is constant"),
        at_most("change of velocity, m/s", np.abs(run.velocity("body") - VELOCITY).max(), 1e-6, "no force along the floor acts"),
        at_most("change of spin, rad/s", np.abs(spin - spin[0]).max(), 1e-6, "no torque acts"),
        energy_never_grows(run, BOX),
        undisturbed(run),
    ]


def check_thrown(run: Recording) -> list[Check]:
    """Compare with the bounces of a smooth ball on one plane."""
    away = run.position("body") - run.position("body")[0] - run.times[:, None] * VELOCITY
    since = (run.times + FALL) % (2.0 * FALL) - FALL
    height = run.position("body")[:, 2] - BALL - DROP + 0.5 * GRAVITY * since**2
    level = run.velocity("body")[:, :2] - VELOCITY[:2]
    return [
        finite(run),
        at_most("off its path along the floor, m", np.linalg.norm(away[:, :2], axis=1).max(), 1e-6, "x = x0 + v t"),
        at_most("off its height, m", np.abs(height).max(), 1e-6, "z = r + h - g s^2 / 2"),
        at_most("change of velocity along the floor, m/s", np.abs(level).max(), 1e-6, "the normal is vertical"),
        at_most("spin, rad/s", np.abs(run.angular_velocity("body")).max(), 1e-6, "smooth"),
        energy_never_grows(run, BALL),
        undisturbed(run),
    ]


SCENES = tuple(
    GalleryScene(
        f"{verb}_over_{floor}",
        f"A {body} {verb}s over a floor of {floor} and keeps its path",
        partial(scene, body, floor),
        check_thrown if verb == "bounce" else check,
        1.4,
    )
    for verb, body in (("slide", "box"), ("roll", "ball"), ("bounce", "thrown ball"))
    for floor in ("triangles", "tiles")
)
