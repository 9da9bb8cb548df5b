"""Stacks that are struck: a block thrown sideways into five boxes, a ball dropped onto five boxes.

No closed form is known for the whole motion, but laws hold: energy never grows, bodies stay apart, and all comes to rest,
since friction acts whenever anything slides and restitution is below 1.

Ball at 5 m/s on five resting boxes of the same mass, e = 0.5: the rebound of compliant spheres-and-springs references is
1.8 to 2.7 m/s, whatever their stiffness. A solver that treats the contacts of the pile one after the other, without
the load of the pile, loses all of it and gives 0.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from rigidimpulse.gallery.hard.parts import GRAVITY, above_floor, apart, dull, energy_never_grows, finite, floor_scene, last_speed
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

BOXES = 5
THROWN = 0.6
BALL = 0.5
IMPACT_SPEED = 5.0
"""m/s, of the ball."""
REBOUND = (1.8, 2.7)
"""m/s, of compliant references."""


def thrown(restitution: float) -> Scene:
    """Return five unit cubes and a smaller one on its way into them."""
    material = dull(0.5, restitution)
    scene = _stack(material)
    start, velocity = (-4.0, 0.1, 2.2), (8.0, 0.0, 1.0)
    scene.add(Body("thrown", Shape.box(THROWN), position=start, velocity=velocity, material=material))
    return scene


def check_thrown(run: Recording) -> list[Check]:
    """Check what holds however the stack falls."""
    moved = float(np.linalg.norm(run.position("box 3")[-1] - run.position("box 3")[0]))
    return [
        finite(run),
        at_least("the struck box has moved, m", moved, 1e-3, "momentum was given"),
        energy_never_grows(run, 1.0, BOXES),
        above_floor(run),
        apart(run),
        at_most("speed at the end, m/s", last_speed(run, 1.0), 1e-3, "friction and impacts stop it"),
    ]


def dropped() -> Scene:
    """Return five unit cubes and a ball of the same mass that falls on them, e = 0.5."""
    material = dull(0.5, 0.5)
    scene = _stack(material)
    height = BOXES + BALL + 0.01
    ball = {"position": (0.1, 0.0, height), "velocity": (0.0, 0.0, -math.sqrt(IMPACT_SPEED**2 - 0.02 * GRAVITY)), "mass": 1000.0}
    scene.add(Body("ball", Shape.sphere(BALL), material=material, **ball))
    return scene


def check_dropped(run: Recording) -> list[Check]:
    """Check the rebound against compliant references, and the rest."""
    after = (run.times > 0.03) & (run.times < 0.15)
    # Speed at the instant of the impact, of the flight seen in the frames after it.
    speeds = run.velocity("ball")[after, 2] + GRAVITY * run.times[after]
    rebound = float(np.median(speeds))
    return [
        finite(run),
        at_least("rebound of the ball, m/s", rebound, REBOUND[0], "compliant references: 1.8 to 2.7 m/s"),
        at_most("rebound of the ball, m/s", rebound, REBOUND[1], "compliant references: 1.8 to 2.7 m/s"),
        energy_never_grows(run, 1.0, BOXES),
        above_floor(run),
        apart(run),
        at_most("speed of the boxes at the end, m/s", _boxes_speed(run), 1e-3, "friction and impacts stop them"),
    ]


def _stack(material: Material) -> Scene:
    scene = floor_scene(material)
    for k in range(BOXES):
        scene.add(Body(f"box {k + 1}", Shape.box(1.0), position=(0.0, 0.0, 0.5 + k), material=material))
    return scene


def _boxes_speed(run: Recording) -> float:
    chosen = [run.index(f"box {k + 1}") for k in range(BOXES)]
    return float(np.linalg.norm(run.velocities[-1, chosen], axis=1).max())


SCENES = (
    GalleryScene("block_into_stack", "A block thrown sideways into a stack of five, e = 0", partial(thrown, 0.0), check_thrown, 8.0),
    GalleryScene(
        "block_into_stack_bouncing", "A block thrown sideways into a stack of five, e = 0.5", partial(thrown, 0.5), check_thrown, 8.0
    ),
    GalleryScene("ball_onto_stack", "A ball of 5 m/s onto a resting stack of five, e = 0.5", dropped, check_dropped, 8.0),
)
