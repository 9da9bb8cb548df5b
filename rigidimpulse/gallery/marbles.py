"""Marbles fill a convex and a concave solid, fall and scatter: point in polyhedron (A6, A7).

`contains` tells which points of a lattice lie in an octahedron and in a cross of seven cubes:

    octahedron    |x| + |y| + |z| < c
    cross         the largest of |x|, |y|, |z| below 3 s / 2, the other two below s / 2

A point is in a convex polyhedron if it is behind all face planes, in a concave one if a ray from it crosses the surface an odd number of
times. Many points are in line with vertices and edges of the octahedron; a parity that counts those twice is wrong for half of them.
There is a marble where a point is inside, and only there. How they fall has no law here: the soft sub-stepped solver computes it, quickly.
"""

from __future__ import annotations

import itertools

import numpy as np

from rigidimpulse.collision.containment import contains
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

PITCH, RADIUS = 0.25, 0.1
"""m between marbles, and their radius."""
REACH, SIDE = 2.5 * PITCH, 2.0 * PITCH
"""m: c of the octahedron, s of the cross."""
PLACES = {"octahedron": (-0.9, 0.0, 1.4), "cross": (0.9, 0.0, 1.6)}
SKIN = TOLERANCES.sub_stepping.skin * RADIUS
NUDGE = 0.15
"""m/s, sideways: columns of marbles that fall straight stay columns."""
DURATION = 1.5
CELLS = np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
_STEPS = np.arange(-4, 5)
LATTICES = {"octahedron": PITCH * _STEPS, "cross": PITCH * (_STEPS[:-1] + 0.5)}
"""Coordinates of the points asked for, m: none of them lies on a surface."""


def solids() -> dict[str, Shape]:
    """Return the two solids, about the origin."""
    corners = REACH * np.concatenate([np.eye(3), -np.eye(3)])
    return {"octahedron": Shape.convex_hull(corners), "cross": _cross()}


def scene() -> Scene:
    """Return the floor, and a marble at every point of the lattices that is in its solid."""
    scene = Scene()
    scene.add(Body("floor", Shape.half_space(), motion="static"))
    glass, marble = Material(density=2400.0, restitution=0.3, static_friction=0.3), Shape.sphere(RADIUS)
    rng = np.random.default_rng(1)
    for name, solid in solids().items():
        points = _lattice(name)
        for k in np.flatnonzero(contains(solid, points)):
            velocity = [*rng.normal(scale=NUDGE, size=2), 0.0]
            scene.add(Body(f"{name} {k}", marble, position=PLACES[name] + points[k], velocity=velocity, material=glass))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare the marbles with the closed forms of the solids."""
    checks = []
    for name in PLACES:
        points = np.abs(_lattice(name))
        sorted_points = np.sort(points, axis=1)
        inside = points.sum(axis=1) < REACH if name == "octahedron" else (sorted_points < [0.5 * SIDE, 0.5 * SIDE, 1.5 * SIDE]).all(axis=1)
        expected = {f"{name} {k}" for k in np.flatnonzero(inside)}
        found = {body for body in run.names if body.startswith(name)}
        checks.append(equal(f"{name}: marbles", len(found), len(expected), "number of lattice points inside"))
        checks.append(equal(f"{name}: points taken for the other side", len(found ^ expected), 0, "closed form of the solid"))
    lowest = RADIUS - run.positions[:, 1:, 2].min()
    return [*checks, at_most("deepest marble in the floor, m", lowest, SKIN, "soft contacts use up the skin of a pile")]


def _lattice(name: str) -> np.ndarray:
    """Return the points (k, 3) that are asked for, m, about the middle of the solid."""
    return np.array(list(itertools.product(LATTICES[name], repeat=3)))


def _cross() -> Shape:
    """Return seven cubes as one solid: the squares between a cell and what is none."""
    filled, vertices, faces = {tuple(cell) for cell in CELLS}, [], []
    for cell in CELLS:
        for axis in range(3):
            for side in (-1, 1):
                out = np.zeros(3, dtype=int)
                out[axis] = side
                if tuple(cell + out) in filled:
                    continue
                u, v = np.roll([1, 0, 0], axis + 1), np.roll([1, 0, 0], axis + 2)
                square = [cell + 0.5 * (out + i * u + j * v) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
                first = len(vertices)
                vertices += square if side > 0 else square[::-1]
                faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return Shape.mesh(SIDE * np.array(vertices), np.array(faces))


SCENES = (
    GalleryScene(
        "marbles", "Marbles fill a convex and a concave solid, and scatter (animation notes A6, A7)", scene, check, DURATION,
        accuracy=Accuracy(contact_solver="substepped"),
    ),
)  # fmt: skip
