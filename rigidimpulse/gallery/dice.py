"""Five dice are thrown into a tray, and come to rest.

Dice are boxes of 16 mm, drawn with rounded edges and pips. A thrown die has no closed form: it flips from edge to edge, and errors grow
with each impact. What holds for each throw: energy never grows; no die is ever in the tray, or in another; at the end each lies flat on
one of its sides, and nothing moves. Which numbers are thrown is the same in every run: the same bits.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.quaternion import normalize, rotate
from rigidimpulse.gallery.hard.parts import above_floor, apart, energy_never_grows
from rigidimpulse.gallery.looks import CLOTH, DIE_SIDES, WOOD, die
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual

SIDE, NUM_DICE, SEED = 0.016, 5, 4
INNER, RAIL, HEIGHT, CLOTH_THICKNESS = 0.2, 0.01, 0.019, 0.005
"""m: sides of the field, thickness and height of the rails; the cloth as it is drawn."""
FLAT = 1e-6
"""1 - cosine of the tilt of a die that lies flat: contacts may be a margin of 1e-6 of the size apart."""


def scene() -> Scene:
    """Return the tray and the dice in the air."""
    random = np.random.default_rng(SEED)
    felt = Material(restitution=0.3, static_friction=0.5, dynamic_friction=0.45, restitution_combine="minimum")
    resin = Material(density=1180.0, restitution=0.5, static_friction=0.3, dynamic_friction=0.25)
    scene = Scene(gravity=(0.0, 0.0, -9.81))
    scene.add(Body("tray", Shape.half_space(), motion="static", material=felt, visual=_tray()))
    for name, axis, side in (("left", 0, -1), ("right", 0, 1), ("near", 1, -1), ("far", 1, 1)):
        size, place = np.array([RAIL, RAIL, HEIGHT]), np.zeros(3)
        size[1 - axis] = INNER + 2.0 * RAIL
        place[axis], place[2] = side * 0.5 * (INNER + RAIL), 0.5 * HEIGHT
        scene.add(Body(f"{name} rail", Shape.box(size), motion="static", position=place, material=felt, visual=Visual(color=WOOD)))
    for k in range(NUM_DICE):
        place = np.array([-0.085, 0.03 * (k - 2), 0.06 + 0.012 * (k % 2)])
        velocity = np.array([0.6, 0.0, 0.2]) + random.normal(0.0, 0.08, 3)
        turn = normalize(random.normal(size=4))
        scene.add(
            Body(
                f"die {k + 1}", Shape.box(SIDE), position=place, orientation=turn, velocity=velocity,
                angular_velocity=random.normal(0.0, 25.0, 3), material=resin, visual=die(SIDE),
            )
        )  # fmt: skip
    return scene


def _tray() -> Visual:
    """Return the cloth: the floor itself has no end."""
    wide, place = INNER + 2.0 * RAIL, (0.0, 0.0, -0.5 * CLOTH_THICKNESS)
    return Visual(CLOTH, Shape.compound([(Shape.box((wide, wide, CLOTH_THICKNESS)), place, (1.0, 0.0, 0.0, 0.0))]))


def thrown(run: Recording) -> list[int]:
    """Return the numbers that lie on top at the end."""
    numbers = []
    for k in range(NUM_DICE):
        q = run.orientation(f"die {k + 1}")[-1:]
        up = [float(rotate(q, np.eye(3)[axis])[0, 2]) for axis in range(3)]
        axis = int(np.argmax(np.abs(up)))
        numbers.append(DIE_SIDES[axis, 1 if up[axis] > 0.0 else -1])
    return numbers


def check(run: Recording) -> list[Check]:
    """Check the laws that hold for each throw."""
    dice = [f"die {k + 1}" for k in range(NUM_DICE)]
    tilts = []
    for name in dice:
        up = [abs(float(rotate(run.orientation(name)[-1:], axis)[0, 2])) for axis in np.eye(3)]
        tilts.append(1.0 - max(up))
    reach = max(float(np.abs(run.position(name)[:, :2]).max()) for name in dice)
    still = max(float(np.linalg.norm(run.velocity(name)[-1])) for name in dice)
    return [
        energy_never_grows(run, SIDE, NUM_DICE),
        above_floor(run),
        apart(run),
        at_most("farthest from the middle of the tray, m", reach, 0.5 * INNER, "rails hold the dice"),
        at_most("1 - cosine of the tilt at the end", max(tilts), FLAT, "a die comes to rest on a side"),
        at_most("speed at the end, m/s", still, 1e-6, "dice come to rest"),
        equal("problems that the status names", len(run.status.problems), 0, "default settings are enough"),
    ]


SCENES = (GalleryScene("dice", "Five dice are thrown into a tray", scene, check, 1.6),)
