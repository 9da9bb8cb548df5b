"""Scenes of bodies that start flush on each other, as files bring them, each made of a seed.

An arrangement (one body, stack, wall, boxes that fill a box, an open mesh as floor), a kind of shape, a size from 1 mm to 100 m, flat or
tilted, rounded to single precision or not. Rounding puts bodies into each other, or apart, by up to some 1e-7 of their distance from the
origin. The law: along the normal of the table no body moves by more than RISE of its size, and the status says ok.
"""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri

RISE = 1e-5
"""Greatest motion along the normal of the table, in sizes of a body."""
DURATION = 0.25
KINDS = ("cube", "box", "wedge", "cylinder", "bracket", "table", "ball")
ARRANGEMENTS = ("one", "stack", "wall", "filled box", "open mesh")


def bracket(size: float) -> ri.Shape:
    """An L of two arms, one mesh, concave."""
    outline = np.array([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]) / 3.0 - 0.5
    vertices = np.array([(x, y, z) for z in (-0.5, 0.5) for x, y in outline]) * size
    faces = [(0, 5, 4), (0, 4, 3), (0, 3, 1), (1, 3, 2)]
    top = [(6 + c, 6 + b, 6 + a) for a, b, c in faces]
    sides = [face for i in range(6) for face in ((i, (i + 1) % 6, 6 + (i + 1) % 6), (i, 6 + (i + 1) % 6, 6 + i))]
    return ri.Shape.mesh(vertices, np.array([*faces, *top, *sides]))


def four_legs(size: float) -> ri.Shape:
    """A table on four legs, as a compound."""
    leg, top = ri.Shape.box((0.1 * size, 0.1 * size, 0.9 * size)), ri.Shape.box((size, size, 0.1 * size))
    parts = [(leg, (x * size, y * size, -0.05 * size), (1, 0, 0, 0)) for x in (-0.45, 0.45) for y in (-0.45, 0.45)]
    return ri.Shape.compound([*parts, (top, (0, 0, 0.45 * size), (1, 0, 0, 0))])


def shape_of(kind: str, size: float, dice: np.random.Generator) -> tuple[ri.Shape, float]:
    """A shape that stands on its lower side, and its height."""
    if kind == "cube":
        return ri.Shape.box(size), size
    if kind == "box":
        sides = size * dice.uniform((0.7, 0.7, 0.2), (1.0, 1.0, 0.5))
        return ri.Shape.box(sides), sides[2]
    if kind == "wedge":
        foot = [(x, y, -0.4) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
        return ri.Shape.convex_hull(size * np.array([*foot, (-0.3, -0.5, 0.4), (0.3, 0.5, 0.4)])), 0.8 * size
    if kind == "cylinder":
        return ri.Shape.cylinder(0.4 * size, 0.8 * size), 0.8 * size
    if kind == "bracket":
        return bracket(size), size
    if kind == "table":
        return four_legs(size), size
    return ri.Shape.sphere(0.5 * size), size


class Start:
    """The scene of a seed.

    Attributes:
        up: (3,) normal of the table. size: m, of a body.
        scene: the scene. label: arrangement, shape and pose, for the report.
    """

    def __init__(self, seed: int) -> None:
        dice = np.random.default_rng(seed)
        self.arrangement = ARRANGEMENTS[seed % len(ARRANGEMENTS)]
        self.kind = str(dice.choice(KINDS[:5] if self.arrangement == "stack" else KINDS))
        self.size = float(10.0 ** dice.uniform(-3, 2))
        self.single, self.tilted = bool(seed // 5 % 2), bool(seed // 10 % 2) and self.kind != "ball"
        self.turn = self._turn(dice)
        self.up = rotated(self.turn, (0.0, 0.0, 1.0))
        self.origin = self.size * dice.normal(0.0, 2.0, 3)
        self.material = ri.Material(static_friction=0.8, dynamic_friction=0.8)
        self.scene = ri.Scene()
        build = dict(zip(ARRANGEMENTS, (self._one, self._stack, self._wall, self._filled_box, self._open_mesh), strict=True))
        build[self.arrangement](dice)
        pose = f"{'tilted' if self.tilted else 'flat'}, {'single' if self.single else 'double'} precision"
        self.label = f"{seed}: {self.arrangement}, {self.kind}, {self.size:.2g} m, {pose}"

    def _turn(self, dice: np.random.Generator) -> np.ndarray:
        """About the vertical, and by up to 10 degrees from it."""
        about = dice.uniform(0.0, 2.0 * np.pi)
        turn = np.array([np.cos(about / 2), 0.0, 0.0, np.sin(about / 2)])
        lean = np.radians(dice.uniform(1.0, 10.0)) if self.tilted else 0.0
        axis = dice.uniform(0.0, 2.0 * np.pi)
        tilt = np.array([np.cos(lean / 2), np.sin(lean / 2) * np.cos(axis), np.sin(lean / 2) * np.sin(axis), 0.0])
        return product(tilt, turn)

    def _add(self, name: str, shape: ri.Shape, place: tuple[float, float, float], fixed: bool = False) -> None:
        """Add a body at a place given in the frame of the table."""
        position, turn = self.origin + rotated(self.turn, place), self.turn
        if self.single:
            position, turn = np.float32(position).astype(float), np.float32(turn).astype(float)
        motion = "static" if fixed else "dynamic"
        self.scene.add(ri.Body(name, shape, position=position, orientation=turn, motion=motion, material=self.material))

    def _table(self, dice: np.random.Generator) -> None:
        thick = self.size * dice.uniform(0.5, 2.0)
        self._add("table", ri.Shape.box((6 * self.size, 6 * self.size, thick)), (0, 0, -thick / 2), fixed=True)

    def _one(self, dice: np.random.Generator) -> None:
        self._table(dice)
        shape, height = shape_of(self.kind, self.size, dice)
        self._add("body", shape, (*(self.size * dice.uniform(-0.5, 0.5, 2)), height / 2))

    def _stack(self, dice: np.random.Generator) -> None:
        self._table(dice)
        shape, height = shape_of(self.kind, self.size, dice)
        for level in range(3 if self.kind not in ("wedge", "bracket") else 1):
            self._add(f"body {level}", shape, (0, 0, (level + 0.5) * height))

    def _wall(self, dice: np.random.Generator) -> None:
        self._table(dice)
        length, height = self.size, 0.4 * self.size
        brick = ri.Shape.box((length, 0.5 * self.size, height))
        for row in range(3):
            for k in range(4 - row):
                self._add(f"brick {row} {k}", brick, ((k - 1.5 + 0.5 * row) * length, 0, (row + 0.5) * height))

    def _filled_box(self, dice: np.random.Generator) -> None:
        self._table(dice)
        side, thick = self.size, 0.2 * self.size
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            wall = (thick, 2 * side, side) if x else (2 * side, thick, side)
            self._add(f"wall {x} {y}", ri.Shape.box(wall), (x * (side + thick / 2), y * (side + thick / 2), side / 2), fixed=True)
        for x in (-0.5, 0.5):
            for y in (-0.5, 0.5):
                self._add(f"cube {x} {y}", ri.Shape.box(side), (x * side, y * side, side / 2))

    def _open_mesh(self, dice: np.random.Generator) -> None:
        reach = 3 * self.size
        sheet = np.array([(-reach, -reach, 0), (reach, -reach, 0), (reach, reach, 0), (-reach, reach, 0)])
        self._add("sheet", ri.Shape.mesh(sheet, np.array([(0, 1, 2), (0, 2, 3)])), (0, 0, 0), fixed=True)
        shape, height = shape_of(self.kind, self.size, dice)
        self._add("body", shape, (*(self.size * dice.uniform(-0.5, 0.5, 2)), height / 2))


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Product of two quaternions."""
    w, v = p[0] * q[0] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([w, *v])


def rotated(q: np.ndarray, v: tuple[float, float, float]) -> np.ndarray:
    """A vector turned by a quaternion."""
    return np.array(v) + 2.0 * np.cross(q[1:], np.cross(q[1:], v) + q[0] * np.array(v))


def check(seed: int, duration: float = DURATION) -> tuple[Start, float, str]:
    """The start of a seed, the greatest motion along the normal of the table in sizes, and what the status says."""
    start = Start(seed)
    run = ri.simulate(start.scene, duration)
    moved = 0.0
    for body in start.scene.bodies:
        if body.motion == "dynamic":
            way = run.position(body.name) - run.position(body.name)[0]
            moved = max(moved, float(np.abs(way @ start.up).max()) / start.size)
    return start, moved, "" if run.status.ok else run.status.message
