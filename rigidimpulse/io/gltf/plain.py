"""Files without physics: every node with a mesh is a body, or a part of the one that its node is below.

    animated              kinematic, along its animation
    named like a floor    static: a word of the name is one of `STATIC_WORDS`
    below a body's node   part of that body, unless it is animated by itself or says how it moves
    bones that move       no body: its surface goes where its bones go, which no rigid body does
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
from rigidimpulse.io.gltf.implicit import placed_in_body
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
) -> Iterator[tuple[int, Motion | None, list[Piece]]]:
    """Yield node, motion (None: static or animated) and colliders of every body.

    Args:
        hierarchy, meshes, animations: of the file. notes: where lines of the report go.

    Raises:
        SceneError: a mesh that is broken, or an extra that makes no sense.

    """
    parts = _parts(hierarchy, animations, notes)
    maker = _Maker(hierarchy, meshes, notes)
    for node, others in parts.items():
        motion, pieces = _motion(hierarchy, animations, node), [maker.piece(node)]
        if motion == "dynamic" or release_of(hierarchy, node) is not None:
            is_solid, pieces[0] = maker.solid(node, pieces[0], "it is static")
            motion = "static" if motion == "dynamic" and not is_solid else motion
        for other in others:
            name = hierarchy.names[other]
            notes.append(f"node {name!r} is part of body {hierarchy.names[node]!r} above it; give it the extra motion to make it a body")
            if {"mass", "density"} & set(_flags(hierarchy, other)):
                notes.append(f"mass and density of node {name!r} are not read: it is part of body {hierarchy.names[node]!r}")
            is_solid, piece = True, maker.piece(other)
            if motion == "dynamic":
                is_solid, piece = maker.solid(other, piece, "it is drawn with its body and collides with nothing")
            if is_solid:
                position, turn, _ = hierarchy.scale_seen_from(other, node)
                pieces.append(Piece(*placed_in_body((piece.shape, NO_TURN), position, turn), piece.material, None))
        given = None
        if motion != "static":
            mass = _figure(hierarchy, _flags(hierarchy, node), "mass", hierarchy.names[node])
            given = Motion(is_kinematic=motion == "kinematic", mass=mass)
        yield node, given, pieces


def _parts(hierarchy: Hierarchy, animations: Animations, notes: list[str]) -> dict[int, list[int]]:
    """Nodes of bodies, parents first, each with the nodes below it whose meshes are parts of it."""
    parts: dict[int, list[int]] = {}
    carrier = [-1] * len(hierarchy.nodes)
    for node in hierarchy.order:
        entry, parent, name = hierarchy.nodes[node], hierarchy.parent[node], hierarchy.names[node]
        carrier[node] = above = carrier[parent] if parent >= 0 else -1
        if entry.mesh is None:
            continue
        motion = _word(hierarchy, _flags(hierarchy, node), "motion", MOTIONS, name)
        if motion == "none":
            notes.append(f"node {name!r} is no body, as its extra motion says: it is drawn and collides with nothing")
            continue
        bends = entry.skin is not None and bones_move(hierarchy, animations, entry.skin)
        if bends and motion is not None:
            notes.append(f"the bones of node {name!r} move: it is a body as it is at rest, its animation is not collided with")
        if bends and motion is None:
            notes.append(
                f"the bones of node {name!r} move: it is drawn as they move it and collides with nothing; "
                "with the extra motion it is a body as it is at rest, and its animation is not collided with"
            )
            continue
        says = motion is not None or release_of(hierarchy, node) is not None
        if above >= 0 and not says and not animations.moves_against(node, above):
            parts[above].append(node)
            continue
        parts[node] = []
        carrier[node] = node
    return parts


def bones_move(hierarchy: Hierarchy, animations: Animations, skin: int) -> bool:
    """Whether a bone of a skin is animated, or a node above one."""
    bones = hierarchy.file.entry(hierarchy.file.document.skins, skin, "skin").joints
    return any(animations.moves(bone) for bone in bones if bone < len(hierarchy.nodes))


def _motion(hierarchy: Hierarchy, animations: Animations, node: int) -> str:
    """How a body moves: by what its extras, its animation or its name say."""
    name = hierarchy.names[node]
    motion = _word(hierarchy, _flags(hierarchy, node), "motion", MOTIONS, name)
    if motion is not None:
        return motion
    if animations.moves(node):
        return "kinematic"
    return "static" if set(re.split(r"[^a-z]+", name.lower())) & STATIC_WORDS else "dynamic"


class _Maker:
    """Colliders of nodes, each in the frame of its own node."""

    def __init__(self, hierarchy: Hierarchy, meshes: Meshes, notes: list[str]) -> None:
        self._hierarchy, self._meshes, self._notes = hierarchy, meshes, notes
        self._known: dict[tuple, Shape] = {}

    def piece(self, node: int) -> Piece:
        """Return the mesh of a node, or what stands for it."""
        hierarchy, entry, name = self._hierarchy, self._hierarchy.nodes[node], self._hierarchy.names[node]
        flags, scale = _flags(hierarchy, node), hierarchy.scale_seen_from(node, node)[2]
        own = node if entry.skin is not None or entry.weights else -1
        wanted = _word(hierarchy, flags, "shape", SHAPES, name)
        key = (entry.mesh, own, scale.tobytes(), wanted)
        if key not in self._known:
            self._known[key] = _shape(hierarchy, self._meshes, node, scale, wanted or "mesh")
        material = Material(
            density=_figure(hierarchy, flags, "density", name) or 1000.0, restitution=_figure(hierarchy, flags, "restitution", name),
            static_friction=_figure(hierarchy, flags, "friction", name),
        )  # fmt: skip
        return Piece(self._known[key], np.zeros(3), NO_TURN, material, None)

    def solid(self, node: int, piece: Piece, otherwise: str) -> tuple[bool, Piece]:
        """Return whether a piece is a solid, itself or by its hull, and the solid; otherwise: what is said of a flat one."""
        if piece.shape.kind != "mesh":
            return True, piece
        is_solid, shape = _solid(piece.shape, self._hierarchy.names[node], otherwise, self._notes, self._known)
        return is_solid, piece._replace(shape=shape)


def _flags(hierarchy: Hierarchy, node: int) -> dict:
    extras = hierarchy.nodes[node].extras
    return extras if isinstance(extras, dict) else {}


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


def _solid(shape: Shape, name: str, otherwise: str, notes: list[str], known: dict[tuple, Shape]) -> tuple[bool, Shape]:
    """The mesh of a node where it is a solid, else its hull where that is one; whether either is."""
    try:
        shape.solid()
        return True, shape
    except SceneError as error:
        key = ("hull", shape.key)
        try:
            if key not in known:
                known[key] = Shape.convex_hull(shape)
                known[key].solid()
        except SceneError:
            notes.append(f"node {name!r} is no solid and flat ({error.problem}): {otherwise}")
            return False, shape
        notes.append(f"node {name!r} is no solid ({error.problem}): it collides as its convex hull")
        return True, known[key]
