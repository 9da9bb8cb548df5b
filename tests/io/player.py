"""A player of glTF animations for the tests: world matrices of nodes at a time, by matrices alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from gltf_files import values


def rotation(q: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) of a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def sample(times: np.ndarray, keys: np.ndarray, time: float) -> np.ndarray:
    """Value of a LINEAR channel: rotations by the shorter arc."""
    k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, max(len(times) - 2, 0)))
    if len(times) == 1:
        return keys[0]
    s = float(np.clip((time - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0))
    a, b = keys[k], keys[k + 1]
    if len(a) == 3:
        return (1 - s) * a + s * b
    b = -b if a @ b < 0 else b
    angle = np.arccos(min(1.0, float(a @ b)))
    mixed = (1 - s) * a + s * b if angle < 1e-6 else np.sin((1 - s) * angle) * a + np.sin(s * angle) * b
    return mixed / np.linalg.norm(mixed)


class Player:
    """A file, ready to play."""

    def __init__(self, tree: dict[str, Any], data: bytes) -> None:
        """Read the channels."""
        self.nodes = tree["nodes"]
        self.parent = {child: k for k, node in enumerate(self.nodes) for child in node.get("children", [])}
        self.channels = {}
        for animation in tree.get("animations", []):
            for channel in animation["channels"]:
                sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
                assert sampler.get("interpolation", "LINEAR") == "LINEAR"
                keys = values(tree, data, sampler["input"]), values(tree, data, sampler["output"])
                assert self.channels.setdefault((target["node"], target["path"]), keys) is keys, "two channels move the same"

    def index(self, name: str) -> int:
        """Index of the node of a name."""
        return [node.get("name") for node in self.nodes].index(name)

    def local(self, node: int, time: float) -> np.ndarray:
        """Matrix (4, 4) of a node against its parent."""
        entry = self.nodes[node]
        if "matrix" in entry:
            assert not any(key[0] == node for key in self.channels), "an animated node has a matrix"
            return np.array(entry["matrix"], float).reshape(4, 4).T
        parts = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}
        parts = {path: np.array(entry.get(path, rest), float) for path, rest in parts.items()}
        for path in parts:
            if (node, path) in self.channels:
                parts[path] = sample(*self.channels[node, path], time)
        matrix = np.eye(4)
        matrix[:3, :3] = rotation(parts["rotation"] / np.linalg.norm(parts["rotation"])) * parts["scale"]
        matrix[:3, 3] = parts["translation"]
        return matrix

    def world(self, node: int, time: float) -> np.ndarray:
        """Matrix (4, 4) of a node in the world."""
        matrix = self.local(node, time)
        while node in self.parent:
            node = self.parent[node]
            matrix = self.local(node, time) @ matrix
        return matrix


def check_structure(tree: dict[str, Any], data: bytes) -> None:
    """Assert what the glTF validator would refuse: bounds, alignment, indices, unit rotations, keys that increase."""
    views, accessors = tree.get("bufferViews", []), tree.get("accessors", [])
    sizes = {5121: 1, 5123: 2, 5125: 4, 5126: 4}
    widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
    length = tree["buffers"][0]["byteLength"] if tree.get("buffers") else 0
    assert length <= len(data) <= length + 3
    for view in views:
        assert view["buffer"] == 0 and view.get("byteOffset", 0) + view["byteLength"] <= length
    for entry in accessors:
        view, size = views[entry["bufferView"]], sizes[entry["componentType"]]
        assert (view.get("byteOffset", 0) + entry.get("byteOffset", 0)) % size == 0
        assert entry.get("byteOffset", 0) + entry["count"] * widths[entry["type"]] * size <= view["byteLength"]
    count = len(tree["nodes"])
    children = [child for node in tree["nodes"] for child in node.get("children", [])]
    assert len(set(children)) == len(children) and all(0 <= child < count for child in children)
    assert set(children).isdisjoint(tree["scenes"][0]["nodes"])
    for node in tree["nodes"]:
        assert abs(np.linalg.norm(node.get("rotation", [0, 0, 0, 1])) - 1.0) < 1e-6
        assert node.get("children", [0]), "an empty list"
        assert node.get("mesh", 0) < max(len(tree.get("meshes", [])), 1)
    for animation in tree.get("animations", []):
        assert animation["channels"]
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            times, keys = (values(tree, data, sampler[side]) for side in ("input", "output"))
            entry = accessors[sampler["input"]]
            assert len(times) == len(keys) and times[0] >= 0.0 and np.all(np.diff(times) > 0.0) and np.isfinite(keys).all()
            assert entry["min"] == [np.float32(times[0])] and entry["max"] == [np.float32(times[-1])]
            if channel["target"]["path"] == "rotation":
                assert np.abs(np.linalg.norm(keys, axis=1) - 1.0).max() < 1e-6
                assert np.all(np.sum(keys[1:] * keys[:-1], axis=1) >= 0.0), "signs jump"
