"""How cost grows with the number of bodies: an elastic gas, impact by impact, and a pile of boxes, step by step.

An impact of a gas concerns two bodies, so its cost should not depend on how many others fly elsewhere: exponent 0 of the cost per impact. A
step of a pile handles all bodies: exponent 1 of the cost per step. Exponents are slopes of log(cost) over log(n) by least squares from
FEWEST bodies on. Costs are times of the stages of the loop (`Recording.profile`); what a run costs before it starts is not in them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.engine.simulate import simulate_whole
from rigidimpulse.gallery.pile import pile
from rigidimpulse.model.effect import STAGES
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SIZES = (10, 30, 100, 300, 1_000, 3_000, 10_000, 20_000)
FEWEST = 100
FILLED = 0.05
"""Part of the box that the balls of a gas fill."""
BALL_SECONDS = 6_000.0
"""Duration of a run of gas times the number of balls, s, and of 4 s at least."""
PILED, LAYERS = 2.0, 10
"""s in which boxes fall and pile up, and layers they fall in."""


class Point(NamedTuple):
    """One size: bodies, s in all, impacts or steps, and s for each."""

    number: int
    seconds: float
    count: int
    cost: float


class Scaling(NamedTuple):
    """A kind of scene: what it is, what is counted, and how a size is measured."""

    description: str
    unit: str
    measure: Callable[[int], Point]


def gas(number: int) -> Scene:
    """Return balls of 0.5 m and 1 kg that fill a twentieth of a closed box, elastic and smooth, without gravity, speeds about 1 m/s."""
    random, radius = np.random.default_rng(0), 0.5
    smooth = Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
    side = (number * 4.0 / 3.0 * math.pi * radius**3 / FILLED) ** (1.0 / 3.0)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    for axis in range(3):
        for sign in (-1.0, 1.0):
            side_plane = Shape.half_space(tuple(-sign * np.eye(3)[axis]), -0.5 * side)
            scene.add(Body(f"side {'xyz'[axis]}{sign:+.0f}", side_plane, motion="static", material=smooth))
    rows = math.ceil(number ** (1.0 / 3.0) - 1e-9)
    ticks = (np.arange(rows) + 0.5) * (side - 2.0 * radius) / rows - 0.5 * side + radius
    places = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    ball = Shape.sphere(radius)
    for k, place in enumerate(places[random.permutation(len(places))[:number]]):
        scene.add(Body(f"ball {k}", ball, position=tuple(place), velocity=tuple(random.normal(size=3)), mass=1.0, material=smooth))
    return scene


def _gas_point(number: int) -> Point:
    run = simulate_whole(gas(number), max(4.0, BALL_SECONDS / number), fps=1.0)
    return _point(number, run, len(run.impacts))


def _point(number: int, run: Recording, count: int) -> Point:
    """A size whose loop did `count` things."""
    profile = run.profile
    assert profile is not None
    return Point(number, profile.seconds, count, sum(profile.stages[stage] for stage in STAGES if stage in profile.stages) / count)


def _pile_point(number: int) -> Point:
    steps: list[float] = []
    run = simulate_whole(pile(number, LAYERS), PILED, fps=1.0, progress=steps.append)
    return _point(number, run, len(steps))


SCENES = {
    "gas": Scaling("elastic balls in a box", "impact", _gas_point),
    "pile": Scaling("boxes that fall into a pit and pile up", "step", _pile_point),
}


def sizes(kind: str, most: int) -> list[int]:
    """Numbers of bodies of up to `most`: piles begin at 100, since fewer bodies make no pile.

    Raises:
        SceneError: fewer than two sizes are left to compare.

    """
    least = FEWEST if kind == "pile" else SIZES[0]
    out = [number for number in SIZES if least <= number <= most]
    if len([number for number in out if number >= FEWEST]) < 2:
        raise SceneError(f"most = {most}", f"an exponent needs two sizes: give at least {SIZES[SIZES.index(FEWEST) + 1]}")
    return out


def measure_scaling(kind: str, numbers: Sequence[int]) -> Iterator[Point]:
    """Measure a kind of SCENES at each number of bodies, one after the other; the kernels are compiled before."""
    SCENES[kind].measure(min(numbers))
    for number in numbers:
        yield SCENES[kind].measure(number)


def exponent(points: Sequence[Point]) -> float:
    """Slope of log(cost) over log(number) from FEWEST bodies on."""
    kept = [point for point in points if point.number >= FEWEST]
    return float(np.polyfit(np.log([point.number for point in kept]), np.log([point.cost for point in kept]), 1)[0])
