"""What is seen of bodies of a glTF file: the meshes of their nodes, in the colours that those have. They are read when they are drawn.

A node's vertices v, in its own space, lie in the rigid frame (x, Q) of its body at

    Q^T (M v + p - x)

with M and p the linear part and the origin of the node's world matrix at rest.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.colors import hex_of
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.io.gltf.geometry import Meshes
from rigidimpulse.io.gltf.nodes import Hierarchy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual
from rigidimpulse.view.display import DisplayMesh, display_mesh, has_one_color

ON_SHAPE = 1e-5
"""Distance, relative to the size, up to which the vertices of a mesh are those of another."""
FINER = 0.08
"""The same of a finer one from its nearest vertices: a sphere of 64 segments and one of 32 are alike."""
AREA = 0.02
"""Relative difference of the areas of meshes that are alike."""


class _Piece(NamedTuple):
    """A mesh in the frame of its body."""

    vertices: np.ndarray  # (v, 3) m
    faces: np.ndarray  # (f, 3)
    colors: np.ndarray | None  # (f, 3, 3) uint8 of the corners, None: it has none


def as_in_file(bodies: list[Body], node_of: dict[str, int], hierarchy: Hierarchy) -> list[Body]:
    """Return bodies with what their nodes show as visuals; those that have a visual keep it.

    Args:
        bodies: of a scene. node_of: node of each body of the file, by name. hierarchy: of the file.

    """
    meshes, owners = Meshes(hierarchy), set(node_of.values())
    known: dict[tuple[bytes, bytes], Visual | None] = {}
    seen = []
    for body in bodies:
        pieces = _pieces(meshes, node_of[body.name], owners) if body.visual is None and body.name in node_of else []
        shape = _joined(pieces) if pieces else None
        if shape is not None:
            key = body.shape.key, shape.drawn_key
            if key not in known:
                known[key] = _visual(body.shape, shape)
            body = body if known[key] is None else replace(body, visual=known[key])
        seen.append(body)
    return seen


def _pieces(meshes: Meshes, body: int, others: set[int]) -> list[_Piece]:
    """Return all meshes at and below the node of a body, without those of other bodies."""
    hierarchy, pieces, stack = meshes.hierarchy, [], [body]
    while stack:
        node = stack.pop()
        stack += [child for child in hierarchy.nodes[node].children if child not in others]
        try:
            vertices, faces = meshes.of_node(node)
            colors = meshes.colors_of_node(node)
        except SceneError:  # no mesh, or none that can be read: the loader has said so where it matters
            continue
        position, rotation, stretch = hierarchy.scale_seen_from(node, body)
        linear = to_matrix(rotation) @ stretch
        mirrored = np.linalg.det(linear) < 0.0
        turned = colors[:, ::-1] if mirrored and colors is not None else colors
        pieces.append(_Piece(vertices @ linear.T + position, faces[:, ::-1] if mirrored else faces, turned))
    return pieces


def _joined(pieces: list[_Piece]) -> Shape | None:
    """Return meshes, at least one, as the shape that is drawn; None where no triangle of them can be."""
    parts = []
    for piece in pieces:
        shape = Shape.mesh(piece.vertices, piece.faces)
        try:
            shape.surface()
        except SceneError:
            continue
        parts.append(shape if piece.colors is None else replace(shape, colors=piece.colors))
    if len(parts) == 1:
        return parts[0]
    return Shape.compound([(part, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)) for part in parts]) if parts else None


def _visual(shape: Shape, shown: Shape) -> Visual | None:
    """Return what is seen of a body with this shape, None: the shape and no more."""
    mesh, own = display_mesh(shown), display_mesh(shape)
    if mesh is None or own is None:  # half spaces
        return None
    if not has_one_color(mesh) or not _alike(mesh, own):
        return Visual(shape=shown)
    # The shape's own mesh is finer where that is round.
    return None if mesh.colors is None else Visual(color=hex_of(mesh.colors[0] / 255.0))


def _alike(drawn: DisplayMesh, shape: DisplayMesh) -> bool:
    """Whether a mesh is a shape's own, perhaps with fewer triangles where that is round."""
    from scipy.spatial import KDTree

    size = float(np.ptp(shape.vertices, axis=0).max())
    off, gap = (float(KDTree(a.vertices).query(b.vertices)[0].max()) for a, b in ((shape, drawn), (drawn, shape)))
    return off <= ON_SHAPE * size and gap <= FINER * size and abs(_area(drawn) / _area(shape) - 1.0) <= AREA


def _area(mesh: DisplayMesh) -> float:
    """Area, m^2."""
    corners = mesh.vertices[mesh.faces]
    return 0.5 * float(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum())
