"""Pairs of random meshes that fly at each other, each made of a seed: sizes, mass ratios, restitution, friction and spins at random.

Convex pairs are hulls of random points. Concave pairs are meshes of `assets/meshes`, stars and rings.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

import rigidimpulse as ri

MESHES = Path(__file__).resolve().parents[2] / "assets" / "meshes"
DURATION = 1.0
KINDS = ("spot", "star", "ring")


def hull(dice: np.random.Generator, size: float) -> ri.Shape:
    """The hull of 5 to 60 random points of a flattened cloud, about `size` m large."""
    points = dice.normal(size=(int(dice.integers(5, 61)), 3)) * dice.uniform(0.2, 1.0, 3)
    return ri.Shape.convex_hull(points * size / np.ptp(points, axis=0).max())


def concave(kind: str, dice: np.random.Generator, size: float) -> ri.Shape:
    """A mesh with hollows, about `size` m large."""
    if kind == "spot":
        return ri.Shape.from_file(MESHES / "spot.obj", scale=0.6 * size)
    if kind == "ring":
        sections = int(dice.integers(12, 30))
        return ri.Shape.from_trimesh(trimesh.creation.torus(0.38 * size, 0.12 * size, major_sections=sections, minor_sections=8))
    ball = trimesh.creation.icosphere(subdivisions=1)
    spikes = np.where(np.arange(len(ball.vertices)) < 12, 0.5, 0.25) * size
    return ri.Shape.mesh(ball.vertices * spikes[:, None], ball.faces)


def pair(shapes: list[ri.Shape], sizes: list[float], dice: np.random.Generator) -> ri.Scene:
    """Two bodies of these shapes that meet within DURATION, if they do not pass each other."""
    axes = dice.normal(size=(4, 3))
    way = axes[0] / np.linalg.norm(axes[0])
    apart, aside = 1.6 * sum(sizes), 0.15 * min(sizes) * axes[1]
    scene = ri.Scene(gravity=tuple(dice.uniform(0.0, 0.3) * apart * axes[2]))
    share = dice.uniform(0.0, 1.0)
    for k, name in enumerate("ab"):
        turn = dice.normal(size=4)
        friction = dice.uniform(0.0, 1.5)
        material = ri.Material(
            density=10.0 ** dice.uniform(1.0, 4.0), restitution=dice.uniform(0.0, 1.0), static_friction=friction,
            dynamic_friction=friction * dice.uniform(0.5, 1.0),
        )  # fmt: skip
        scene.add(
            ri.Body(
                name, shapes[k], position=tuple(k * (apart * way + aside)), orientation=tuple(turn / np.linalg.norm(turn)),
                velocity=tuple((share, share - 1.0)[k] * 2.5 * apart * way), angular_velocity=tuple(dice.uniform(-6.0, 6.0, 3)),
                material=material,
            )
        )  # fmt: skip
    return scene


def convex_pair(seed: int) -> ri.Scene:
    """Two hulls of 1 mm to 100 m, their sizes within 1 : 4."""
    dice = np.random.default_rng(seed)
    size = 10.0 ** dice.uniform(-3.0, 2.0)
    sizes = [size, size * 4.0 ** dice.uniform(-1.0, 1.0)]
    return pair([hull(dice, s) for s in sizes], sizes, dice)


def concave_pair(seed: int) -> ri.Scene:
    """Two meshes with hollows."""
    dice = np.random.default_rng(seed)
    size = 10.0 ** dice.uniform(-2.0, 1.0)
    sizes = [size, size * 2.0 ** dice.uniform(-1.0, 1.0)]
    kinds = dice.choice(KINDS, 2)
    return pair([concave(str(kind), dice, s) for kind, s in zip(kinds, sizes, strict=True)], sizes, dice)
