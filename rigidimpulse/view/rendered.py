"""Meshes that are drawn of bodies whose shape is another one: that of their `Visual`, or those of the file that a scene was read from.

A node's vertices v, in its own space, lie in the rigid frame (x, Q) of its body at

    Q^T (M v + p - x)

with M and p the linear part and the origin of the node's world matrix at rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.view.display import DisplayMesh, display_mesh, has_one_color, shade_pieces

if TYPE_CHECKING:
    from rigidimpulse.io.gltf.geometry import Meshes

ON_SHAPE = 1e-5
"""Distance, relative to the size, up to which the vertices of a mesh are those of another."""
FINER = 0.08
"""The same of a finer one from its nearest vertices: a sphere of 64 segments and one of 32 are alike."""
AREA = 0.02
"""Relative difference of the areas of meshes that are alike."""


def rendered_meshes(scene: Any, collision: dict[str, DisplayMesh], segments: int) -> dict[str, DisplayMesh]:
    """Return what is drawn of bodies, in their frames, by name; bodies that look as they collide are not in it. Equal ones share a mesh.

    Args:
        scene: of the recording.
        collision: what the shapes of bodies look like, by name.
        segments: corners of a full turn of round shapes.

    """
    drawn, shared = _of_file(scene, collision), {}
    for body in scene.bodies:
        if body.drawn_shape is not body.shape:
            key = body.drawn_shape.drawn_key
            if key not in shared:
                shared[key] = display_mesh(body.drawn_shape, segments)
            drawn[body.name] = shared[key]
    return drawn


def _of_file(scene: Any, collision: dict[str, DisplayMesh]) -> dict[str, DisplayMesh]:
    """Return what the file of a scene draws of bodies, where it is something else than their shapes."""
    origin = getattr(scene, "origin", None)
    if origin is None:
        return {}
    from rigidimpulse.io.gltf.geometry import Meshes
    from rigidimpulse.io.gltf.origin import Origin

    if not isinstance(origin, Origin):
        return {}
    hierarchy = origin.animations.hierarchy
    meshes, bodies, drawn = Meshes(hierarchy), set(origin.node_of.values()), {}
    for name, node in origin.node_of.items():
        if name not in collision:
            continue
        pieces = _pieces(meshes, node, bodies)
        if pieces:
            mesh = shade_pieces(pieces)
            if not _alike(mesh, collision[name]) or not has_one_color(mesh):
                drawn[name] = mesh
            elif mesh.colors is not None:
                # The shape's own mesh is finer where that is round.
                drawn[name] = collision[name]._replace(colors=np.tile(mesh.colors[0], (len(collision[name].vertices), 1)))
    return drawn


def _pieces(meshes: Meshes, body: int, bodies: set[int]) -> list[tuple[np.ndarray, np.ndarray, np.ndarray | None]]:
    """Vertices (v, 3) in the frame of a body, faces and colours of all meshes at and below its node, without those of other bodies."""
    hierarchy, pieces, stack = meshes.hierarchy, [], [body]
    while stack:
        node = stack.pop()
        stack += [child for child in hierarchy.nodes[node].children if child not in bodies]
        try:
            vertices, faces = meshes.of_node(node)
            colors = meshes.colors_of_node(node)
        except SceneError:  # no mesh, or none that can be read: the loader has said so where it matters
            continue
        from rigidimpulse.core.quaternion import to_matrix

        position, rotation, stretch = hierarchy.scale_seen_from(node, body)
        linear = to_matrix(rotation) @ stretch
        mirrored = np.linalg.det(linear) < 0.0
        turned = colors[:, ::-1] if mirrored and colors is not None else colors
        pieces.append((vertices @ linear.T + position, faces[:, ::-1] if mirrored else faces, turned))
    return pieces


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
