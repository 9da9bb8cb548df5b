"""The hierarchy of a glTF file: parents, transforms at rest, names.

A node's matrix is T R S, its world matrix M that of its parent times its own. Bodies move rigidly, so a node also has a
rigid frame: its world position, and Q, the product of the rotations alone. What is left of M is the scale

    K = Q^T M    (3, 3)

diagonal where no scale is turned by another; `negative` scales count with their sign.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.portable import dot, length, matmul
from rigidimpulse.core.quaternion import from_matrix, multiply, to_matrix
from rigidimpulse.io.gltf.container import GltfFile
from rigidimpulse.io.gltf.schema import LARGEST, Node

SNAP = 1e-12
"""Entries of K nearer to 0 and 1 than this, relative to the largest, are 0 and 1: round-off of rotations."""


class Local(NamedTuple):
    """Transform of a node against its parent: translation (3,), quaternion (4,) wxyz, scale (3,)."""

    translation: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray


class Hierarchy:
    """Nodes of a file.

    Attributes:
        parent: (n,) -1 for roots. order: nodes of the scene, parents first. down: all nodes, parents first.
        local: by node, see `Local`. world: (n, 4, 4) at rest. turn: (n, 4) wxyz, Q. names: by node, unique.

    """

    def __init__(self, file: GltfFile) -> None:
        """Raise a `SceneError` for nodes that are no tree, and transforms that are none."""
        nodes = file.document.nodes
        self.file, self.nodes = file, nodes
        self.parent = _parents(file)
        self.roots = _roots(file, self.parent)
        self.order = self._descend(self.roots)
        self.local = [_local(file, node, index) for index, node in enumerate(nodes)]
        self.down = self._descend([k for k in range(len(nodes)) if self.parent[k] < 0])
        self.world, self.turn = self._placed()
        self.names = _unique_names(nodes)

    def _descend(self, roots: list[int]) -> list[int]:
        """Nodes below the roots, parents first, in the order of the file."""
        order, stack = [], list(reversed(roots))
        while stack:
            index = stack.pop()
            order.append(index)
            stack += reversed(self.nodes[index].children)
        return order

    def _placed(self) -> tuple[np.ndarray, np.ndarray]:
        """World matrices (n, 4, 4) and turns (n, 4) of all nodes."""
        count = len(self.nodes)
        world = np.tile(np.eye(4), (count, 1, 1))
        turn = np.array([local.rotation for local in self.local]).reshape(count, 4)
        world[:, :3, :3] = to_matrix(turn) * np.array([local.scale for local in self.local]).reshape(count, 1, 3)
        world[:, :3, 3] = np.array([local.translation for local in self.local]).reshape(count, 3)
        for index in self.down:
            parent = self.parent[index]
            if parent >= 0:
                world[index] = world[parent] @ world[index]
                turn[index] = multiply(turn[parent], turn[index])
        is_far = ~(np.abs(world).max(axis=(1, 2)) <= LARGEST)
        if is_far.any():
            first = next(index for index in self.down if is_far[index])
            raise self.file.error("its place or scale is beyond all bounds", "correct the transforms", f"node {first}")
        return world, turn

    def position(self, index: int) -> np.ndarray:
        """(3,) m, origin of a node in the world at rest."""
        return self.world[index, :3, 3]

    def axes(self, index: int) -> tuple[np.ndarray, float]:
        """Unit axes (3, 3) of a node in its rigid frame, as columns, and their hand: -1 where nodes above mirror it, else 1."""
        matrix = matmul(to_matrix(self.turn[index]).T, self.world[index, :3, :3])
        if not np.linalg.det(matrix) < 0.0:
            return np.eye(3), 1.0
        x = matrix[:, 0] / length(matrix[:, 0])
        y = matrix[:, 1] - float(dot(matrix[:, 1], x)) * x
        y /= length(y)
        return np.stack([x, y, -np.cross(x, y)], axis=1), -1.0

    def chain(self, index: int) -> list[int]:
        """A node and its ancestors, itself first."""
        chain = []
        while index >= 0:
            chain.append(index)
            index = self.parent[index]
        return chain

    def counted(self, marked: Callable[[int], bool]) -> list[int]:
        """How many marked nodes there are on the way from a root to each node, itself included; in one pass over the nodes."""
        count = [0] * len(self.nodes)
        for index in self.down:
            above = self.parent[index]
            count[index] = int(marked(index)) + (count[above] if above >= 0 else 0)
        return count

    def scale_seen_from(self, node: int, body: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position (3,), quaternion (4,) and K (3, 3) of a node in the rigid frame of another."""
        frame = to_matrix(self.turn[body])
        position = frame.T @ (self.position(node) - self.position(body))
        rotation = multiply(self.turn[body] * [1.0, -1.0, -1.0, -1.0], self.turn[node])
        stretch = to_matrix(self.turn[node]).T @ self.world[node, :3, :3]
        size = float(np.abs(stretch).max())
        near = np.round(stretch)
        return position, rotation, np.where(np.abs(stretch - near) <= SNAP * max(size, 1.0), near, stretch) + 0.0


def _parents(file: GltfFile) -> list[int]:
    nodes = file.document.nodes
    parent = [-1] * len(nodes)
    for index, node in enumerate(nodes):
        for child in node.children:
            file.entry(nodes, child, "node")
            if parent[child] >= 0:
                raise file.error(f"node {child} has two parents, {parent[child]} and {index}", "export the file again")
            parent[child] = index
    seen = [False] * len(nodes)
    stack = [index for index in range(len(nodes)) if parent[index] < 0]
    while stack:
        index = stack.pop()
        seen[index] = True
        stack += nodes[index].children
    if not all(seen):
        raise file.error(f"node {seen.index(False)} is its own ancestor", "export the file again")
    return parent


def _roots(file: GltfFile, parent: list[int]) -> list[int]:
    document = file.document
    if not document.scenes:
        return [index for index, above in enumerate(parent) if above < 0]
    roots = file.entry(document.scenes, document.scene or 0, "scene").nodes
    for index in roots:
        file.entry(document.nodes, index, "node")
        if parent[index] >= 0:
            raise file.error(f"root node {index} has a parent", "export the file again")
    if len(set(roots)) < len(roots):
        raise file.error("a root node is named twice", "export the file again")
    return list(roots)


def _local(file: GltfFile, node: Node, index: int) -> Local:
    where = f"node {index}"
    if node.matrix is not None:
        matrix = np.array(node.matrix).reshape(4, 4).T
        return _decomposed(file, matrix, where)
    x, y, z, w = node.rotation
    quaternion = np.array([w, x, y, z])
    length = float(np.linalg.norm(quaternion))
    if length < 1e-3:
        raise file.error(f"rotation is {list(node.rotation)}", "give a unit quaternion", where)
    return Local(np.array(node.translation), quaternion / length, np.array(node.scale))


def _decomposed(file: GltfFile, matrix: np.ndarray, where: str) -> Local:
    """Translation, rotation and scale of a matrix; a mirrored one has a negative scale along x."""
    columns = matrix[:3, :3]
    scale = np.linalg.norm(columns, axis=0)
    if scale.min() < 1e-9 * max(scale.max(), 1e-9):
        raise file.error("its matrix flattens space", "give the node a thickness", where)
    if np.linalg.det(columns / scale) < 0.0:
        scale[0] = -scale[0]
    u, _, v = np.linalg.svd(columns / scale)
    if np.linalg.det(u @ v) < 0.0 or np.abs(u @ v * scale - columns).max() > 1e-3 * np.abs(scale).max():
        raise file.error("its matrix shears", "use translation, rotation and scale", where)
    return Local(matrix[:3, 3].copy(), from_matrix(u @ v), scale)


def _unique_names(nodes: list[Node]) -> list[str]:
    """Names of nodes; "node3" if unnamed, with the number behind it where two have one name."""
    names: list[str] = []
    used: set[str] = set()
    for index, node in enumerate(nodes):
        name = node.name or f"node{index}"
        while name in used:
            name = f"{name} (node {index})"
        used.add(name)
        names.append(name)
    return names
