"""Files without physics: every node with a mesh is a body.

    animated              kinematic, along its animation
    named like a floor    static: a word of the name is one of `STATIC_WORDS`
    any other             dynamic, if its mesh is closed; else as its convex hull; flat ones are static

`extras` of a node (custom properties in Blender) say otherwise: "motion" ("dynamic", "kinematic", "static", "none": no body),
"mass" [kg], "density" [kg/m^3], "shape" ("mesh", "convex_hull", "box", "sphere"), "restitution", "friction".
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.gltf.animation import Animations
from rigidimpulse.io.gltf.bodies import Piece, release_of
from rigidimpulse.io.gltf.geometry import Meshes, stays_finite
from rigidimpulse.io.gltf.nodes import Hierarchy
from rigidimpulse.io.gltf.schema import LARGEST, Motion
from rigidimpulse.io.pieces import STATIC_WORDS
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.shape import Shape

MOTIONS = ("dynamic", "kinematic", "static", "none")
SHAPES = ("mesh", "convex_hull", "box", "sphere")
NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])


def plain_pieces(
    hierarchy: Hierarchy, meshes: Meshes, animations: Animations, notes: list[str]
) -> Iterator[tuple[int, Motion | None, Piece]]:
    """Yield node, motion (None: static or animated) and collider of every body.

    Args:
        hierarchy, meshes, animations: of the file. notes: where lines of the report go.

    Raises:
        SceneError: a mesh that is broken, or an extra that makes no sense.

    """
    known: dict[tuple, Shape] = {}
    for node in hierarchy.order:
        if hierarchy.nodes[node].mesh is None:
            continue
        name, extras = hierarchy.names[node], hierarchy.nodes[node].extras
        flags = extras if isinstance(extras, dict) else {}
        motion = _word(hierarchy, flags, "motion", MOTIONS, name)
        if motion == "none":
            continue
        entry = hierarchy.nodes[node]
        scale = hierarchy.scale_seen_from(node, node)[2]
        own = node if entry.skin is not None or entry.weights else -1
        wanted = _word(hierarchy, flags, "shape", SHAPES, name)
        key = (entry.mesh, own, scale.tobytes(), wanted)
        if key not in known:
            known[key] = _shape(hierarchy, meshes, node, scale, wanted or "mesh")
        shape = known[key]
        if motion is None:
            words = set(re.split(r"[^a-z]+", name.lower()))
            motion = "static" if words & STATIC_WORDS else "dynamic"
            if animations.moves(node):
                motion = "kinematic"
        if (motion == "dynamic" or release_of(hierarchy, node) is not None) and shape.kind == "mesh":
            kept, (motion, shape) = motion, _solid(shape, name, notes, known)
            motion = kept if motion == "dynamic" else motion
        material = Material(
            density=_figure(hierarchy, flags, "density", name) or 1000.0, restitution=_figure(hierarchy, flags, "restitution", name),
            static_friction=_figure(hierarchy, flags, "friction", name),
        )  # fmt: skip
        given = None
        if motion != "static":
            given = Motion(is_kinematic=motion == "kinematic", mass=_figure(hierarchy, flags, "mass", name))
        yield node, given, Piece(shape, np.zeros(3), NO_TURN, material, None)


def _word(hierarchy: Hierarchy, flags: dict, key: str, words: tuple[str, ...], name: str) -> str | None:
    value = flags.get(key)
    if value is not None and value not in words:
        raise hierarchy.file.error(f"{key} is {str(value)[:40]!r}", f"give one of {', '.join(words)}", f"extras of node {name!r}")
    return value


def _figure(hierarchy: Hierarchy, flags: dict, key: str, name: str) -> float | None:
    value = flags.get(key)
    if value is not None and not (isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value <= LARGEST):
        raise hierarchy.file.error(f"{key} is {str(value)[:40]!r}", "give a number >= 0", f"extras of node {name!r}")
    return value


def _shape(hierarchy: Hierarchy, meshes: Meshes, node: int, scale: np.ndarray, wanted: str) -> Shape:
    vertices, faces = meshes.of_node(node)
    vertices = stays_finite(hierarchy.file, vertices @ scale.T, f"node {hierarchy.names[node]!r}")
    if wanted == "convex_hull":
        return Shape.convex_hull(vertices)
    if wanted in ("box", "sphere"):
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        middle = 0.5 * (low + high)
        reach = float(np.linalg.norm(vertices - middle, axis=1).max())
        shape = Shape.box(high - low) if wanted == "box" else Shape.sphere(reach)
        return shape if not np.any(middle) else Shape.compound([(shape, middle, NO_TURN)])
    return Shape.mesh(vertices, faces[:, ::-1] if np.linalg.det(scale) < 0.0 else faces)


def _solid(shape: Shape, name: str, notes: list[str], known: dict[tuple, Shape]) -> tuple[str, Shape]:
    """The mesh of a dynamic body where it is a solid, else its hull; a flat one makes the body static."""
    try:
        shape.solid()
        return "dynamic", shape
    except SceneError as error:
        key = ("hull", shape.key)
        try:
            if key not in known:
                known[key] = Shape.convex_hull(shape)
                known[key].solid()
        except SceneError:
            notes.append(f"node {name!r} is no solid and flat ({error.problem}): it is static")
            return "static", shape
        notes.append(f"node {name!r} is no solid ({error.problem}): it collides as its convex hull")
        return "dynamic", known[key]
