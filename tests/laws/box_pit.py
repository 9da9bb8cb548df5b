"""Piles of bodies of any shape in a pit, and which of them are inside each other."""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri
from rigidimpulse.collision.distance.fcl import Narrowphase
from rigidimpulse.core.quaternion import multiply, rotate

STONE = ri.Material(density=900, restitution=0.1, static_friction=0.4, dynamic_friction=0.4)


def pit(shapes: list[ri.Shape], seed: int, size: float = 1.0) -> ri.Scene:
    """96 bodies of about 0.15 m times `size` that fall into a pit in columns."""
    random = np.random.default_rng(seed)
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=STONE))
    for normal in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)):
        scene.add(ri.Body(f"wall {normal}", ri.Shape.half_space(normal=normal, offset=-0.35 * size), motion="static", material=STONE))
    for k in range(96):
        jitter = 0.005 * random.normal(size=2)
        place = size * np.array([0.17 * (k % 4) - 0.255 + jitter[0], 0.17 * (k // 4 % 4) - 0.255 + jitter[1], 0.15 + 0.17 * (k // 16)])
        turn, spin = random.normal(size=4), random.normal(size=3)
        shape = shapes[k % len(shapes)]
        scene.add(ri.Body(f"body {k}", shape, position=place, orientation=turn, angular_velocity=spin, material=STONE))
    return scene


def inside_each_other(scene: ri.Scene, run: ri.Recording, frame: int, bearable: float) -> list[tuple[str, str]]:
    """Pairs of movable bodies that are still inside each other when one of them is moved by `bearable` m, whichever way."""
    world = ri.compile_scene(scene)
    narrowphase = Narrowphase(world.shapes)
    x = run.positions[frame] + rotate(run.orientations[frame], world.offset)
    q = multiply(run.orientations[frame], world.turn)
    ways = np.random.default_rng(0).normal(size=(60, 3))
    ways *= bearable / np.linalg.norm(ways, axis=1)[:, None]
    out = []
    for i, j in zip(*np.triu_indices(len(x), 1), strict=True):
        if not (world.dynamic[i] and world.dynamic[j]) or np.linalg.norm(x[j] - x[i]) > world.bound_radius[i] + world.bound_radius[j]:
            continue
        shapes = int(world.shape_of_body[i]), int(world.shape_of_body[j])
        if all(narrowphase.overlap(shapes[0], (x[i], q[i]), shapes[1], (x[j] + way, q[j])) for way in (np.zeros(3), *ways)):
            out.append((world.names[i], world.names[j]))
    return out
