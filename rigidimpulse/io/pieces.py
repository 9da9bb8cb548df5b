"""Colliders of a body in its frame, from files of all kinds: joined to one shape, weighed, and points whose hulls stand for shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import from_matrix, rotate
from rigidimpulse.scene.collision_filter import CollisionFilter
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.shape import Shape

GHOST_RADIUS = 0.05
"""m, of the sphere that stands for a body without colliders, which touches nothing."""
DENSITY = 1000.0
"""kg/m^3, of bodies whose mass is not given."""
NOTHING = CollisionFilter(collide_with=())
EQUAL = 1e-6
"""Scales, radii and shears that differ by less, relative to the largest, are equal: files have single precision."""
RIM = 48
STATIC_WORDS = {"floor", "ground", "static", "wall", "walls", "terrain", "room", "ceiling", "plane", "ramp", "stairs"}
"""Words of names of things that stand, in files without physics."""


class Piece(NamedTuple):
    """A collider in the frame of its body."""

    shape: Shape
    position: np.ndarray
    orientation: np.ndarray
    material: Material
    collision_filter: CollisionFilter | None


GHOST = Piece(Shape.sphere(GHOST_RADIUS), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), Material(), NOTHING)
"""What stands for the colliders of a body that has none."""


def joined(pieces: list[Piece]) -> Shape:
    """The shape of a body: that of its only collider where it is not moved, else a compound."""
    first = pieces[0]
    if len(pieces) == 1 and not np.any(first.position) and np.array_equal(first.orientation, [1.0, 0.0, 0.0, 0.0]):
        return first.shape
    if len(pieces) == 1 and first.shape.kind == "half_space":
        normal, offset = first.shape.plane()
        turned = rotate(first.orientation, normal)
        return Shape.half_space(turned, offset + float(turned @ first.position))
    return Shape.compound([(piece.shape, piece.position, piece.orientation) for piece in pieces])


def _hull(shape: Shape) -> Shape:
    return Shape.convex_hull(shape) if shape.kind == "mesh" else shape


def fill_mass(name: str, shape: Shape, values: dict[str, Any], notes: list[str], density: float = DENSITY) -> None:
    """Where colliders enclose no volume, take what is not given of the mass properties from their hulls.

    Args:
        name: of the body. shape: its shape. values: arguments of the `Body`, which may have mass [kg], inertia [kg m^2] and
            center_of_mass [m]; those missing are added. notes: where a line of the report goes. density: kg/m^3, of a body without mass.

    Raises:
        SceneError: the hulls have no volume either.

    """
    given = [values.get(key) is not None for key in ("mass", "inertia", "center_of_mass")]
    try:
        if not all(given):
            shape.solid()
        return
    except SceneError as error:
        problem = error.problem
    hulls = Shape.compound([(_hull(part.shape), part.position, from_matrix(part.rotation)) for part in shape.parts_flat()])
    try:
        solid = hulls.solid()
    except SceneError as error:
        raise error.within(f"body {name!r}") from None
    notes.append(f"body {name!r} encloses no volume ({problem}): its mass properties are those of the convex hull")
    values.setdefault("mass", density * solid.volume)
    values.setdefault("center_of_mass", solid.centroid)
    off = np.asarray(values["center_of_mass"]) - solid.centroid
    moved = solid.inertia + solid.volume * moved_unit(off)
    values.setdefault("inertia", values["mass"] / solid.volume * moved)


class Weight(NamedTuple):
    """Mass properties of a body: mass kg, center_of_mass (3,) m and inertia (3, 3) kg m^2 about it, in its frame."""

    mass: float
    center_of_mass: np.ndarray
    inertia: np.ndarray


def weight_of(piece: Piece, mass: float | None, density: float) -> Weight:
    """Return the mass properties of a piece, of its hull if it is open; mass: kg, None where density [kg/m^3] says.

    Raises:
        SceneError: it has no volume.

    """
    try:
        solid = Shape.compound([(piece.shape, piece.position, piece.orientation)]).solid()
    except SceneError:
        solid = Shape.compound([(_hull(piece.shape), piece.position, piece.orientation)]).solid()
    density = density if mass is None else mass / solid.volume
    return Weight(density * solid.volume, solid.centroid, density * solid.inertia)


def summed(parts: Sequence[Weight]) -> Weight:
    """Return the mass properties of parts together."""
    total = sum(part.mass for part in parts)
    centre = sum((part.mass * part.center_of_mass for part in parts), np.zeros(3)) / total
    inertia = np.zeros((3, 3))
    for part in parts:
        inertia += part.inertia + part.mass * moved_unit(part.center_of_mass - centre)
    return Weight(total, centre, inertia)


def moved_unit(way: np.ndarray) -> np.ndarray:
    """Return the inertia (3, 3) that a unit of mass gains when it is moved by `way` (3,) off the axes (Steiner)."""
    return way @ way * np.eye(3) - np.outer(way, way)


def rim_points() -> np.ndarray:
    """Return 48 points (48, 3) of the unit circle about Y."""
    angle = 2.0 * np.pi * np.arange(RIM) / RIM
    return np.column_stack([np.cos(angle), np.zeros(RIM), np.sin(angle)])


def sphere_points() -> np.ndarray:
    """Return 162 points (162, 3) of the unit sphere, even: an icosahedron whose edges are halved twice."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    signs = [(a, b) for a in (-1.0, 1.0) for b in (-golden, golden)]
    points = np.array([np.roll([0.0, a, b], k) for a, b in signs for k in range(3)])
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    for _ in range(2):
        distance = np.linalg.norm(points[:, None] - points, axis=2)
        np.fill_diagonal(distance, np.inf)
        # Edges are at most 1.2 times as long as the shortest; the next distance is 1.6 times as long.
        i, j = np.nonzero(np.triu(distance < 1.3 * distance.min()))
        middle = points[i] + points[j]
        points = np.concatenate([points, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
    return points
