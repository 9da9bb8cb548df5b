"""Meshes of a glTF file at rest: triangles of all primitives, morphed by their weights, bent by their bones.

Morphing: x = x0 + sum w_k d_k. Skinning: X = sum_j w_j B_j I_j x with the world matrices B of the bones and their inverse
bind matrices I: X is a place in the world, whatever the node of the mesh does (glTF 2.0, sections 3.7.2 and 3.7.3).
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.io.gltf.colors import Colors
from rigidimpulse.io.gltf.container import COMPRESSION, GltfFile
from rigidimpulse.io.gltf.nodes import Hierarchy
from rigidimpulse.io.gltf.schema import LARGEST, Primitive

TRIANGLES, STRIP, FAN = 4, 5, 6


class Meshes:
    """Triangles of the nodes of a file; notes: what is left out of them."""

    def __init__(self, hierarchy: Hierarchy) -> None:
        """Nothing is read before it is asked for."""
        self.hierarchy, self.file = hierarchy, hierarchy.file
        self.notes: list[str] = []
        self.colors = Colors(self.file)
        self._known: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def of_node(self, node: int) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (v, 3) in the space of a node and faces (f, 3) of its mesh.

        Raises:
            SceneError: the node has no mesh, the mesh no triangles, or it is broken or compressed.

        """
        entry = self.hierarchy.nodes[node]
        if entry.mesh is None:
            raise self.file.error("it has no mesh to collide with", "name a node with a mesh", f"node {node}")
        mesh = self.file.entry(self.file.document.meshes, entry.mesh, "mesh")
        weights = entry.weights or mesh.weights
        plain = not any(weights) and entry.skin is None
        if plain and entry.mesh in self._known:
            return self._known[entry.mesh]
        pieces = []
        for number, primitive in enumerate(mesh.primitives):
            where = f"mesh {entry.mesh}, primitive {number}"
            faces = self._faces(primitive, where)
            if faces is not None:
                pieces.append((self._vertices(primitive, weights, entry.skin, where), faces, where))
        for vertices, faces, where in pieces:
            if len(faces) and int(faces.max()) >= len(vertices):
                raise self.file.error("an index is beyond its vertices", "export the file again", where)
        if not sum(len(faces) for _, faces, _ in pieces):
            raise self.file.error("there are no triangles in it", "export the surface as triangles", f"mesh {entry.mesh}")
        starts = np.cumsum([0] + [len(vertices) for vertices, _, _ in pieces[:-1]])
        vertices = np.concatenate([vertices for vertices, _, _ in pieces])
        faces = np.concatenate([faces + start for (_, faces, _), start in zip(pieces, starts, strict=True)])
        if entry.skin is not None:
            name = self.hierarchy.names[node]
            self.notes.append(f"the mesh of node {name!r} is as its bones have it at rest; players draw it there whatever its body does")
            back = self._inverse(self.hierarchy.world[node], f"node {node}")
            vertices = vertices @ back[:3, :3].T + back[:3, 3]
        if plain:
            self._known[entry.mesh] = vertices, faces
        return vertices, faces

    def colors_of_node(self, node: int) -> np.ndarray | None:
        """Colours (f, 3, 3) of the corners of the faces of a node's mesh, uint8, None if it has none. `of_node` has read it."""
        index = self.hierarchy.nodes[node].mesh
        assert index is not None
        mesh, pieces = self.file.entry(self.file.document.meshes, index, "mesh"), []
        for number, primitive in enumerate(mesh.primitives):
            faces = self._faces(primitive, f"mesh {index}, primitive {number}")
            if faces is not None:
                pieces.append((faces, self.colors.of(primitive, faces)))
        if all(colors is None for _, colors in pieces):
            return None
        return np.concatenate([np.full((len(faces), 3, 3), 255, np.uint8) if colors is None else colors for faces, colors in pieces])

    def _faces(self, primitive: Primitive, where: str) -> np.ndarray | None:
        """Triangles (f, 3), None for points and lines."""
        packed = [name for name in COMPRESSION if name in primitive.extensions]
        if packed:
            raise self.file.compressed(packed[0])
        if primitive.mode not in (TRIANGLES, STRIP, FAN):
            self.notes.append(f"{where}: points and lines are not read")
            return None
        if "POSITION" not in primitive.attributes:
            raise self.file.error("it has no positions", "export the file again", where)
        if primitive.indices is not None:
            index = self.file.array(primitive.indices, "SCALAR")
            if index.dtype.kind != "u":
                raise self.file.error("indices are no whole numbers", "export the file again", where)
            index = index.astype(np.int64)
        else:
            index = np.arange(len(self.file.array(primitive.attributes["POSITION"], "VEC3")))
        if primitive.mode == TRIANGLES:
            return index[: len(index) // 3 * 3].reshape(-1, 3)
        if len(index) < 3:
            return np.zeros((0, 3), np.int64)
        if primitive.mode == FAN:
            faces = np.column_stack([np.full(len(index) - 2, index[0]), index[1:-1], index[2:]])
        else:
            faces = np.column_stack([index[:-2], index[1:-1], index[2:]])
            faces[1::2] = faces[1::2, [1, 0, 2]]
        distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
        return faces[distinct]

    def _vertices(self, primitive: Primitive, weights: list[float], skin: int | None, where: str) -> np.ndarray:
        vertices = np.asarray(self.file.array(primitive.attributes["POSITION"], "VEC3"), float)
        for weight, target in zip(weights, primitive.targets):
            if weight and "POSITION" in target:
                moved = self.file.array(target["POSITION"], "VEC3")
                if len(moved) != len(vertices):
                    raise self.file.error("a morph target has another number of vertices", "export the file again", where)
                vertices = vertices + weight * moved
        if skin is not None:
            vertices = self._bent(vertices, primitive, skin, where)
        return vertices

    def _bent(self, vertices: np.ndarray, primitive: Primitive, skin: int, where: str) -> np.ndarray:
        """Vertices (v, 3) in the world, where the bones are at rest."""
        entry = self.file.entry(self.file.document.skins, skin, "skin")
        for joint in entry.joints:
            self.file.entry(self.hierarchy.nodes, joint, "node")
        bones = self.hierarchy.world[entry.joints]
        if entry.inverse_bind_matrices is not None:
            inverse = self.file.array(entry.inverse_bind_matrices, "MAT4")
            if len(inverse) < len(bones):
                raise self.file.error(f"skin {skin} has {len(bones)} bones but {len(inverse)} matrices", "export again", where)
            bones = bones @ inverse[: len(bones)].reshape(-1, 4, 4).transpose(0, 2, 1)
        if not {"JOINTS_0", "WEIGHTS_0"} <= set(primitive.attributes):
            raise self.file.error("it has a skin but no weights", "export the file again", where)
        total, bent = np.zeros(len(vertices)), np.zeros((len(vertices), 3))
        level = 0
        while f"JOINTS_{level}" in primitive.attributes and f"WEIGHTS_{level}" in primitive.attributes:
            joints = self.file.array(primitive.attributes[f"JOINTS_{level}"], "VEC4")
            weights = np.asarray(self.file.array(primitive.attributes[f"WEIGHTS_{level}"], "VEC4"), float)
            if not (len(joints) == len(weights) == len(vertices)) or joints.dtype.kind != "u" or int(joints.max(initial=0)) >= len(bones):
                raise self.file.error("its bones do not fit its skin", "export the file again", where)
            for k in range(4):
                matrices = bones[joints[:, k]]
                placed = np.einsum("vij,vj->vi", matrices[:, :3, :3], vertices) + matrices[:, :3, 3]
                bent += weights[:, k, None] * placed
                total += weights[:, k]
            level += 1
        if not total.min(initial=1.0) > 1e-3 or not np.abs(bent).max(initial=0.0) <= LARGEST:
            raise self.file.error("weights of its bones add up to nothing", "export the file again", where)
        return bent / total[:, None]

    def _inverse(self, matrix: np.ndarray, where: str) -> np.ndarray:
        if abs(np.linalg.det(matrix[:3, :3] / max(float(np.abs(matrix[:3, :3]).max()), 1e-300))) < 1e-12:
            raise self.file.error("its scale flattens space", "give the node a scale", where)
        return np.linalg.inv(matrix)


def stays_finite(file: GltfFile, points: np.ndarray, where: str) -> np.ndarray:
    """Return points, or raise a `SceneError` where a scale has carried them beyond all bounds."""
    if not np.abs(points).max(initial=0.0) <= LARGEST:
        raise file.error("it is beyond all bounds", "correct the scale of its nodes", where)
    return points
