"""Newcomer scenes: things that stand, and things that fall over."""

from __future__ import annotations

import numpy as np
import trimesh
from stage import Stage, height, must, newcomer, rounded, speed, tilt, turn, way

import rigidimpulse as ri

WOOD = ri.Material(density=600.0, restitution=0.2, static_friction=0.5, dynamic_friction=0.4)
STONE = ri.Material(density=2400.0, restitution=0.1, static_friction=0.7, dynamic_friction=0.6)
PAPER = ri.Material(density=800.0, restitution=0.0, static_friction=0.8, dynamic_friction=0.8)
STEEL = ri.Material(density=7800.0, restitution=0.3, static_friction=0.3, dynamic_friction=0.25)


def _table(stage: Stage) -> float:
    """A table on the floor; returns the height of its top."""
    stage.box("table", (1.2, 0.8, 0.04), (0.0, 0.0, 0.72), motion="static", material=WOOD)
    return 0.74


def _stand(names, far: float):
    return lambda run: must(*((way(run, n) < far and tilt(run, n) < 0.02, f"{n} does not stand") for n in names))


TIP = 6.0
"""rad/s, about its lower edge, of the domino that is pushed."""


def _pushed(angle: float = 0.0) -> dict[str, tuple[float, ...]]:
    """Velocities of a domino that tips over about its lower edge, along its own x axis, which is at an angle to that of the world."""
    c, s = np.cos(angle), np.sin(angle)
    return {"velocity": rounded((0.024 * TIP * c, 0.024 * TIP * s, 0.00375 * TIP)), "angular_velocity": rounded((-TIP * s, TIP * c, 0.0))}


def _domino(stage: Stage, k: int, place, angle: float = 0.0, **more) -> str:
    stage.box(f"domino {k}", (0.0075, 0.024, 0.048), (*place, 0.024), material=WOOD, orientation=turn((0, 0, 1), angle), **more)
    return f"domino {k}"


@newcomer(1.0)
def domino_row():
    """The first of ten dominoes is pushed; all fall."""
    stage = Stage()
    stage.floor(material=WOOD)
    names = [_domino(stage, k, (0.024 * k, 0.0), **({} if k else _pushed())) for k in range(10)]
    return stage, lambda run: must(*((tilt(run, n) > 0.8, f"{n} stands") for n in names))


@newcomer(1.5)
def domino_ball():
    """A ball is thrown at the first of some dominoes; all fall, or lean on those that have.

    A domino tips over beyond 9.5 degrees. How they jam is chance: a ball from 1e-9 m further on leaves the first at 39 to 53 degrees.
    """
    stage = Stage()
    stage.floor(material=WOOD)
    stage.ball("ball", 0.015, (-0.06, 0.0, 0.045), velocity=(1.2, 0.0, 0.0), material=STEEL)
    for k in range(8):
        stage.box(f"domino {k}", (0.01, 0.03, 0.06), (0.035 * k, 0.0, 0.03), material=WOOD)
    return stage, lambda run: must(*((tilt(run, f"domino {k}") > 0.5, f"domino {k} stands") for k in range(8)))


@newcomer(1.5)
def domino_spiral():
    """Dominoes along a spiral: all fall, one after the other."""
    stage = Stage()
    stage.floor(material=WOOD)
    names, angle = [], 0.0
    for k in range(24):
        r = 0.08 + 0.012 * angle
        push = {} if k else _pushed(angle + 0.5 * np.pi)
        names.append(_domino(stage, k, (r * np.cos(angle), r * np.sin(angle)), angle + 0.5 * np.pi, **push))
        angle += 0.022 / r
    return stage, lambda run: must(*((tilt(run, n) > 0.7, f"{n} stands") for n in names))


@newcomer(0.5)
def jenga_stands():
    """Six layers of three flush blocks stand."""
    stage = Stage()
    stage.floor(material=WOOD)
    names = _jenga(stage)
    return stage, _stand(names, 1e-4)


def _jenga(stage: Stage, layers: int = 6, pulled: str = "") -> list[str]:
    names = []
    for layer in range(layers):
        for k in range(3):
            name, out = f"block {layer} {k}", 0.0251 * (k - 1)
            size, place = ((0.075, 0.025, 0.015), (0.0, out)) if layer % 2 == 0 else ((0.025, 0.075, 0.015), (out, 0.0))
            more = {"motion": "kinematic", "velocity": (0.1, 0.0, 0.0)} if name == pulled else {}
            stage.box(name, size, (*place, 0.015 * layer + 0.0075), material=WOOD, **more)
            names.append(name)
    return names


@newcomer(1.0)
def jenga_pulled():
    """The middle block of the third layer is pulled out; the others stay up."""
    stage = Stage()
    stage.floor(material=WOOD)
    names = [n for n in _jenga(stage, 5, "block 2 1") if n != "block 2 1"]
    return stage, lambda run: must(*((tilt(run, n) < 0.1 and abs(height(run, n) - height(run, n, 0)) < 2e-3, f"{n} fell") for n in names))


@newcomer(0.7)
def card_house():
    """Two cards lean on each other, 20 degrees off upright, and stand."""
    stage = Stage()
    stage.floor(material=PAPER)
    long, thick, lean = 0.088, 0.002, np.radians(20.0)
    x = 0.5 * long * np.sin(lean) + 0.5 * thick * np.cos(lean)
    z = 0.5 * long * np.cos(lean) + 0.5 * thick * np.sin(lean)
    for name, side in (("left", -1.0), ("right", 1.0)):
        stage.box(name, (thick, 0.063, long), (side * x, 0.0, z), orientation=turn((0, 1, 0), -side * lean), material=PAPER)
    return stage, lambda run: must(*((way(run, n) < 2e-3, f"{n} slides by {way(run, n):.4f} m") for n in ("left", "right")))


@newcomer(0.7)
def coin_stack():
    """Eight coins flush on each other on a table stand."""
    stage = Stage()
    top = _table(stage)
    names = [f"coin {k}" for k in range(8)]
    for k, name in enumerate(names):
        stage.rod(name, 0.012, 0.002, (0.0005 * (k % 2), 0.0, top + 0.002 * k + 0.001), material=STEEL)
    return stage, _stand(names, 1e-4)


@newcomer(0.7)
def coin_shot():
    """A coin slides into the lowest of four: that one flies out, the others drop by at least their thickness or follow."""
    stage = Stage()
    stage.floor(material=STEEL)
    for k in range(4):
        stage.rod(f"coin {k}", 0.012, 0.003, (0.0, 0.0, 0.003 * k + 0.0015), material=STEEL)
    stage.rod("shot", 0.012, 0.003, (-0.08, 0.0, 0.0015), velocity=(2.0, 0.0, 0.0), material=STEEL)
    return stage, lambda run: must(
        (way(run, "coin 0") > 0.02, "the lowest coin stays"), (tilt(run, "coin 3") < 1.6, "the top coin flips over")
    )


@newcomer(0.5)
def brick_wall():
    """A wall of bricks, flush on each other, stands."""
    stage = Stage()
    stage.floor(material=STONE)
    return stage, _stand(_bricks(stage), 1e-4)


def _bricks(stage: Stage, rows: int = 4) -> list[str]:
    names = []
    for row in range(rows):
        for k in range(4 - row % 2):
            name = f"brick {row} {k}"
            stage.box(name, (0.24, 0.115, 0.071), (0.25 * k + 0.125 * (row % 2), 0.0, 0.071 * row + 0.0355), material=STONE)
            names.append(name)
    return names


@newcomer(0.8)
def brick_wall_hit():
    """A heavy ball flies through the wall."""
    stage = Stage()
    stage.floor(material=STONE)
    names = _bricks(stage)
    stage.ball("ball", 0.1, (0.45, -0.6, 0.2), velocity=(0.0, 6.0, 1.0), material=STEEL)
    return stage, lambda run: must((sum(way(run, n) > 0.05 for n in names) >= 2, "the wall does not notice"))


@newcomer(1.0)
def can_pyramid():
    """A ball knocks over a pyramid of six cans on a table."""
    stage = Stage()
    stage.floor(material=WOOD)
    top, names = _table(stage), []
    for row in range(3):
        for k in range(3 - row):
            names.append(f"can {row} {k}")
            stage.rod(names[-1], 0.033, 0.115, (0.0, 0.07 * (k + 0.5 * row - 1.0), top + 0.115 * row + 0.0575), mass=0.1, material=STEEL)
    stage.ball("ball", 0.035, (-0.5, 0.0, top + 0.15), velocity=(5.0, 0.0, 0.4), mass=0.3, material=WOOD)
    return stage, lambda run: must((sum(way(run, n) > 0.05 for n in names) >= 3, "the cans stay"))


@newcomer(1.0)
def books_off_shelf():
    """A hand pushes four books off a shelf; they end on the floor."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.box("shelf", (0.25, 1.0, 0.02), (0.0, 0.0, 0.5), motion="static", material=WOOD)
    for k in range(4):
        stage.box(f"book {k}", (0.15, 0.03, 0.22), (0.04, 0.032 * k, 0.62), material=PAPER)
    stage.box("hand", (0.05, 0.2, 0.1), (-0.07, 0.048, 0.62), motion="kinematic", velocity=(0.6, 0.0, 0.0))
    return stage, lambda run: must(*((height(run, f"book {k}") < 0.5, f"book {k} is still up") for k in range(4)))


@newcomer(0.7)
def cubes_on_table():
    """Five cubes flush on a table stand."""
    stage = Stage()
    stage.floor()
    top = _table(stage)
    names = [f"cube {k}" for k in range(5)]
    for k, name in enumerate(names):
        stage.box(name, (0.1, 0.1, 0.1), (0.01 * (k % 2), 0.0, top + 0.1 * k + 0.05), material=WOOD)
    return stage, _stand(names, 1e-4)


@newcomer(1.5)
def dice():
    """Three dice are thrown and come to rest on a face."""
    stage = Stage()
    stage.floor(material=WOOD)
    for k in range(3):
        stage.box(f"die {k}", (0.016, 0.016, 0.016), (0.04 * k, 0.01 * k, 0.1), material=WOOD, orientation=turn((1, 2, k), 0.7 + k),
                  velocity=(0.5, 0.1 * k, 0.0), angular_velocity=(20.0, 5.0 * k, 3.0))  # fmt: skip
    return stage, lambda run: must(
        *((abs(height(run, f"die {k}") - 0.008) < 1e-5 and speed(run, f"die {k}") < 1e-3, f"die {k} does not rest") for k in range(3))
    )


@newcomer(1.5)
def bowling():
    """A bowling ball runs into ten pins; most fall."""
    stage = Stage()
    stage.floor(material=WOOD)
    names = []
    for row in range(4):
        for k in range(row + 1):
            names.append(f"pin {len(names)}")
            stage.rod(names[-1], 0.05, 0.38, (0.264 * row, 0.305 * (k - 0.5 * row), 0.19), mass=1.5, material=WOOD)
    stage.ball("ball", 0.108, (-0.8, 0.03, 0.108), velocity=(7.0, 0.0, 0.0), mass=6.0, material=WOOD)
    return stage, lambda run: must((sum(tilt(run, n) > 0.5 for n in names) >= 5, "the pins stand"))


@newcomer(1.0)
def ball_pit():
    """Eight balls fall into a crate and stay in it."""
    stage = Stage()
    stage.floor(material=WOOD)
    for k, (x, y) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1))):
        size = (0.02, 0.42, 0.2) if x else (0.38, 0.02, 0.2)
        stage.box(f"side {k}", size, (0.2 * x, 0.2 * y, 0.1), motion="static", material=WOOD)
    for k in range(8):
        stage.ball(f"ball {k}", 0.05, (0.1 * (k % 2) - 0.04, 0.11 * (k // 2 % 2) - 0.05, 0.15 + 0.12 * (k // 2)), material=WOOD)
    return stage, lambda run: must(*((np.abs(run.position(f"ball {k}")[-1, :2]).max() < 0.2, f"ball {k} is out") for k in range(8)))


@newcomer(1.0)
def stones():
    """Six stones fall on the floor and stay there."""
    stage, random = Stage(), np.random.default_rng(3)
    stage.floor(material=STONE)
    for k in range(6):
        stone = trimesh.convex.convex_hull(random.normal(size=(16, 3)) * 0.03)
        stage.mesh(f"stone {k}", stone, (0.16 * (k % 3) - 0.16, 0.16 * (k // 3), 0.15), material=STONE)
    return stage, lambda run: must(*((0.0 < height(run, f"stone {k}") < 0.1, f"stone {k} is not on the floor") for k in range(6)))


@newcomer(0.7)
def desk():
    """A lamp, two books and a cup, as meshes of their own, flush on a desk, stand."""
    stage = Stage()
    top = _table(stage)
    stage.mesh("lower book", trimesh.creation.box((0.15, 0.22, 0.03)), (0.0, 0.0, top + 0.015), material=PAPER)
    stage.mesh("upper book", trimesh.creation.box((0.13, 0.2, 0.02)), (0.0, 0.01, top + 0.04), material=PAPER)
    stage.mesh("cup", trimesh.creation.cylinder(0.04, 0.1, sections=24), (0.2, 0.0, top + 0.05), material=STONE)
    stage.rod("lamp", 0.06, 0.3, (-0.3, 0.1, top + 0.15), material=STEEL)
    return stage, _stand(("lower book", "upper book", "cup", "lamp"), 1e-4)
