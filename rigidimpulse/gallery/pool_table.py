"""A pool table with six pockets, and balls on it: what the scenes of single shots share.

The cloth is a slab with square holes; a ball whose centre is beyond an edge falls through onto the tray below.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.looks import CLOTH, CUSHION, WOOD, pool_ball
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual

CUE, OBJECT = "cue ball", "object ball"
RADIUS, MASS = 0.5 * 57.15e-3, 0.17
RESTITUTION = 0.95
"""Between balls, and at cushions."""
LENGTH, WIDTH, POCKET = 1.6, 0.8, 0.12
"""m: field of play, side of the square holes."""
BED, RAIL, RAIL_HEIGHT, FRAME, DEPTH = 0.02, 0.05, 0.034, 0.04, 0.07
"""m: thickness of the cloth's slab, width and height of the cushions, width of the frame, height from the tray to the cloth."""
_X, _Y = 0.5 * (LENGTH - POCKET), 0.5 * (WIDTH - POCKET)
POCKETS = {
    f"{column} {row}": np.array([x, y])
    for column, x in (("left", -_X), ("middle", 0.0), ("right", _X))
    for row, y in (("near", -_Y), ("far", _Y))
}
"""Middles (2,) m of the holes, by name."""
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
SMOOTH = {"static_friction": 0.0, "dynamic_friction": 0.0, "friction_combine": "maximum", "restitution_combine": "minimum"}


def table(gravity: float, friction: float) -> Scene:
    """Return the table: cloth of this friction, top at z = 0, smooth cushions, frame and tray, on the floor."""
    scene = Scene(gravity=(0.0, 0.0, -gravity))
    cloth = Material(
        restitution=0.0, static_friction=friction, dynamic_friction=friction, friction_combine="maximum", restitution_combine="minimum"
    )
    rubber, felt = Material(restitution=RESTITUTION, **SMOOTH), Material(restitution=0.0, static_friction=0.5, rolling_friction=0.02)
    scene.add(Body("floor", Shape.half_space(offset=-DEPTH - BED), motion="static", material=felt))
    # Kinematic without a motion, as ever: whatever stands rests on it with the same bits.
    scene.add(Body("cloth", _bed(), motion="kinematic", material=cloth, visual=Visual(color=CLOTH)))
    scene.add(Body("cushions", _rails(), motion="static", material=rubber, visual=Visual(color=CUSHION)))
    scene.add(Body("frame", _frame(), motion="static", material=felt, visual=Visual(color=WOOD)))
    return scene


NUMBERS = {CUE: 0, OBJECT: 1}
"""Of the balls by name; any other is the black one."""


def add_ball(scene: Scene, name: str, place: np.ndarray, velocity: np.ndarray | None = None, rolling: np.ndarray | None = None) -> None:
    """Add a ball on the cloth.

    Args:
        scene: with the table.
        name: of the ball.
        place: (2,) m. velocity: (2,) m/s. rolling: (2,) m/s, at which its spin would roll.

    """
    v = np.zeros(2) if velocity is None else velocity
    q = np.zeros(2) if rolling is None else rolling
    resin = Material(restitution=RESTITUTION, **SMOOTH)
    # q = R w x z
    spin = (-q[1] / RADIUS, q[0] / RADIUS, 0.0)
    scene.add(
        Body(
            name, Shape.sphere(RADIUS), position=(*place, RADIUS), velocity=(*v, 0.0), angular_velocity=spin, mass=MASS, material=resin,
            visual=pool_ball(NUMBERS.get(name, 8), RADIUS),
        )
    )  # fmt: skip


def in_pocket(place: np.ndarray, pocket: str) -> bool:
    """Return whether a ball (3,) m is below the cloth, near the pocket of this name."""
    return bool(place[2] < -RADIUS and np.linalg.norm(place[:2] - POCKETS[pocket]) < 2.0 * POCKET)


def _box(low: tuple[float, float, float], high: tuple[float, float, float]) -> tuple[Shape, tuple[float, ...], tuple[float, ...]]:
    """Return the part of a compound that fills the box between two corners."""
    return Shape.box(np.subtract(high, low)), tuple(0.5 * np.add(low, high)), UPRIGHT


def _bed() -> Shape:
    """Return the slab with its holes: a middle piece, and two pieces on each long side."""
    x, y, inner = 0.5 * LENGTH, 0.5 * WIDTH, 0.5 * WIDTH - POCKET
    parts = [_box((-x, -inner, -BED), (x, inner, 0.0))]
    for low, high in ((-y, -inner), (inner, y)):
        for left, right in ((-x + POCKET, -0.5 * POCKET), (0.5 * POCKET, x - POCKET)):
            parts.append(_box((left, low, -BED), (right, high, 0.0)))
    return Shape.compound(parts)


def _rails() -> Shape:
    """Return the cushions, which leave the pockets open."""
    x, y, top = 0.5 * LENGTH, 0.5 * WIDTH, RAIL_HEIGHT
    parts = [_box((low, POCKET - y, -BED), (high, y - POCKET, top)) for low, high in ((-x - RAIL, -x), (x, x + RAIL))]
    for low, high in ((-y - RAIL, -y), (y, y + RAIL)):
        for left, right in ((-x + POCKET, -0.5 * POCKET), (0.5 * POCKET, x - POCKET)):
            parts.append(_box((left, low, -BED), (right, high, top)))
    return Shape.compound(parts)


def _frame() -> Shape:
    """Return the frame around the cushions, and the tray."""
    x, y = 0.5 * LENGTH + RAIL, 0.5 * WIDTH + RAIL
    low, high = -DEPTH, RAIL_HEIGHT
    parts = [
        _box((-x - FRAME, -y - FRAME, low), (x + FRAME, -y, high)),
        _box((-x - FRAME, y, low), (x + FRAME, y + FRAME, high)),
        _box((-x - FRAME, -y, low), (-x, y, high)),
        _box((x, -y, low), (x + FRAME, y, high)),
        _box((-x - FRAME, -y - FRAME, low - BED), (x + FRAME, y + FRAME, low)),
    ]
    return Shape.compound(parts)
