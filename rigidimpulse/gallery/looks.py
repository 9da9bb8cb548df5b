"""What things of the gallery look like: dice, dominoes, pool balls, cards. They are drawn, and collide as spheres and boxes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from rigidimpulse.core.colors import seen_of_hex
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual

CLOTH, CUSHION, WOOD, IVORY, INK = "#175a3e", "#0f4630", "#6b4a2f", "#f3ecdc", "#20242a"
STEEL, GOLD, BRICK_COLOR, STONE, CARD_BACK, RED = "#c3c9cf", "#d8a93c", "#b0573f", "#c2b28f", "#2f5d9b", "#b8272f"
POOL_COLORS = ("#e8b71a", "#1f4fa3", "#c3322b", "#5a3a86", "#dd7a24", "#1d7a4c", "#7d2433", "#1b1d20")
"""Of the balls 1 to 8; 9 to 15 are white with a band of the colours of 1 to 7."""
PIP_RADIUS, PIP_HEIGHT, PIP_CORNERS = 0.095, 0.002, 24
"""Of the side of a die; corners of its edge."""
ROUND = 0.09
"""Radius of the edges of a die, of its side."""
PIPS = {
    1: [(0, 0)], 2: [(-1, -1), (1, 1)], 3: [(-1, -1), (0, 0), (1, 1)], 4: [(-1, -1), (-1, 1), (1, -1), (1, 1)],
    5: [(-1, -1), (-1, 1), (0, 0), (1, -1), (1, 1)], 6: [(-1, -1), (-1, 0), (-1, 1), (1, -1), (1, 0), (1, 1)],
}  # fmt: skip
DIE_SIDES = {(2, 1): 1, (0, 1): 2, (1, 1): 3, (1, -1): 4, (0, -1): 5, (2, -1): 6}
"""Pips of the side that looks along an axis (number, sign); opposite sides add up to 7."""


class Painting:
    """Triangles of several colours that become one mesh."""

    def __init__(self) -> None:
        """Empty."""
        self._vertices: list[np.ndarray] = []
        self._faces: list[np.ndarray] = []
        self._colors: list[np.ndarray] = []
        self._count = 0

    def add(self, vertices: np.ndarray, faces: np.ndarray, color: str) -> None:
        """Add triangles (f, 3) of vertices (v, 3) m in a colour."""
        self._vertices.append(np.asarray(vertices, float))
        self._faces.append(np.asarray(faces) + self._count)
        self._colors.append(np.tile(seen_of_hex(color), (len(faces), 1)))
        self._count += len(vertices)

    def disc(self, center: np.ndarray, axes: np.ndarray, radius: float, color: str) -> None:
        """Add a disc about a centre (3,) m, across the last of three axes (3, 3) in rows."""
        angle = 2.0 * np.pi * np.arange(PIP_CORNERS) / PIP_CORNERS
        rim = center + radius * (np.cos(angle)[:, None] * axes[0] + np.sin(angle)[:, None] * axes[1])
        place = np.arange(PIP_CORNERS)
        faces = np.column_stack([np.full(PIP_CORNERS, PIP_CORNERS), place, np.roll(place, -1)])
        self.add(np.vstack([rim, center]), faces, color)

    def box(self, size: Sequence[float], colors: Sequence[str]) -> None:
        """Add a box about the origin, with the colours of its sides -x, +x, -y, +y, -z, +z."""
        for k, color in enumerate(colors):
            axes, half = side_axes(k // 2, 2 * (k % 2) - 1), 0.5 * np.asarray(size)
            corners = [half * (axes[2] + a * axes[0] + b * axes[1]) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            self.add(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]), color)

    def shape(self) -> Shape:
        """Return the mesh."""
        return Shape.mesh(np.concatenate(self._vertices), np.concatenate(self._faces), np.concatenate(self._colors))


def side_axes(axis: int, sign: int) -> np.ndarray:
    """Return right-handed axes (3, 3), in rows, the last of them out of a side of a box."""
    out, across = sign * np.eye(3)[axis], np.eye(3)[(axis + 1) % 3]
    return np.array([across, np.cross(out, across), out])


@cache
def die(size: float) -> Visual:
    """Return a die of a side in m: ivory, with rounded edges and pips."""
    painting, half = Painting(), 0.5 * size
    inner = half - ROUND * size
    ramp = half - ROUND * size * (1.0 - np.tan(np.radians(np.linspace(0.0, 45.0, 6))))
    line = np.concatenate([-ramp[::-1], ramp])
    u, v = (grid.ravel() for grid in np.meshgrid(line, line, indexing="ij"))
    n = len(line)
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.vstack([np.column_stack([first, first + n, first + n + 1]), np.column_stack([first, first + n + 1, first + 1])])
    for (axis, sign), pips in DIE_SIDES.items():
        axes = side_axes(axis, sign)
        flat = np.column_stack([u, v, np.full(len(u), half)]) @ axes
        kernel = np.clip(flat, -inner, inner)
        way = flat - kernel
        painting.add(kernel + ROUND * size * way / np.linalg.norm(way, axis=1, keepdims=True), faces, IVORY)
        for a, b in PIPS[pips]:
            center = np.array([0.25 * size * a, 0.25 * size * b, half + PIP_HEIGHT * size]) @ axes
            painting.disc(center, axes, PIP_RADIUS * size, INK)
    return Visual(shape=painting.shape())


@cache
def domino(size: tuple[float, float, float], low: int, high: int) -> Visual:
    """Return a domino of a size (3,) m that stands along z: black, with pips on both of its large sides, across x."""
    painting, (thick, wide, tall) = Painting(), size
    painting.box(size, [INK] * 6)
    for sign in (-1, 1):
        axes = side_axes(0, sign)
        out = 0.5 * thick + PIP_HEIGHT * wide
        for number, middle in ((low, -0.25 * tall), (high, 0.25 * tall)):
            for a, b in PIPS[number]:
                painting.disc(np.array([sign * out, 0.24 * wide * a, middle + 0.24 * wide * b]), axes, 0.08 * wide, IVORY)
        line = np.array([[sign * out, y, z] for y, z in ((-0.4, -0.01), (0.4, -0.01), (0.4, 0.01), (-0.4, 0.01))]) * [1.0, wide, tall]
        painting.add(line, np.array([[0, 1, 2], [0, 2, 3]])[:, ::sign], IVORY)
    return Visual(shape=painting.shape())


@cache
def card(size: tuple[float, float, float]) -> Visual:
    """Return a playing card, a box of a size (3,) m, thinnest along x: a diamond on one side, the back of the pack on the other."""
    painting, (thick, wide, tall) = Painting(), size
    painting.box(size, [IVORY] * 6)
    square, diamond = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]), np.array([(0, -1), (1, 0), (0, 1), (-1, 0)])
    marks = [(square, 0.41, 0.44, (0.0, 0.0), CARD_BACK, 1), (diamond, 0.16, 0.14, (0.0, 0.0), RED, -1)]
    marks += [(diamond, 0.05, 0.045, (side * 0.36, side * 0.4), RED, -1) for side in (-1.0, 1.0)]
    marks += [(diamond, 0.09, 0.1, (0.17 * i, 0.185 * j), IVORY, 1) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    for corners, across, along, middle, color, sign in marks:
        layer = (2 if color == IVORY else 1) * PIP_HEIGHT * wide
        flat = (corners * [across, along] + middle) * [wide, tall]
        points = np.column_stack([np.full(4, sign * (0.5 * thick + layer)), flat])
        painting.add(points, np.array([[0, 1, 2], [0, 2, 3]])[:, ::sign], color)
    return Visual(shape=painting.shape())


@cache
def pool_ball(number: int, radius: float) -> Visual:
    """Return a pool ball: the cue ball for 0, plain from 1 to 8, with a band from 9 to 15. Rings run about its z axis.

    Args:
        number: of the ball.
        radius: m.

    """
    if number == 0:
        bands = [(0.0, 12.0, POOL_COLORS[2]), (12.0, 168.0, IVORY), (168.0, 180.0, POOL_COLORS[2])]
    elif number <= len(POOL_COLORS):
        bands = [(0.0, 24.0, IVORY), (24.0, 156.0, POOL_COLORS[number - 1]), (156.0, 180.0, IVORY)]
    else:
        bands = [(0.0, 52.0, IVORY), (52.0, 128.0, POOL_COLORS[number - 9]), (128.0, 180.0, IVORY)]
    painting, around = Painting(), np.radians(np.arange(0.0, 360.0, 7.5))
    for begin, end, color in bands:
        tilt = np.radians(np.linspace(begin, end, max(int(np.ceil((end - begin) / 7.5)), 2) + 1))
        ring = np.stack([np.cos(around), np.sin(around)], axis=1)
        height = np.broadcast_to(np.cos(tilt)[:, None, None], (len(tilt), len(around), 1))
        points = np.concatenate([np.sin(tilt)[:, None, None] * ring, height], axis=2)
        place = np.arange(len(tilt) - 1)[:, None] * len(around) + np.arange(len(around))
        after = np.roll(place, -1, axis=1)
        below, after_below = place + len(around), after + len(around)
        faces = np.stack([np.stack([place, below, after_below], 2), np.stack([place, after_below, after], 2)], 2)
        painting.add(radius * points.reshape(-1, 3), faces.reshape(-1, 3), color)
    return Visual(shape=painting.shape())


def shade_of(color: str, k: int, spread: float = 0.12) -> Visual:
    """Return a colour, lighter or darker by up to `spread`, chosen by a number: bricks and stones are never all alike."""
    step = ((k * 0.6180339887498949) % 1.0 - 0.5) * 2.0 * spread
    return Visual(color=tuple(np.clip(seen_of_hex(color) * (1.0 + step), 0.0, 1.0).tolist()))
