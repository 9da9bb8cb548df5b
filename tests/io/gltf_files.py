"""Small glTF files made by code."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)
TYPES = {np.dtype(kind): code for kind, code in (("f4", 5126), ("u4", 5125), ("u2", 5123), ("u1", 5121), ("i2", 5122))}


class Gltf:
    """A file under construction; `tree` is its JSON."""

    def __init__(self, nodes: list[dict[str, Any]] | None = None, **tree: Any) -> None:
        """With one scene of all nodes that are no child."""
        nodes = nodes or []
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [k for k in range(len(nodes)) if k not in children]
        self.tree: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": roots}], "nodes": nodes, **tree}
        self.data = b""

    def view(self, data: bytes, **more: Any) -> int:
        """Add bytes; returns the index of their buffer view."""
        self.data += b"\0" * (-len(self.data) % 4)
        views = self.tree.setdefault("bufferViews", [])
        views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more})
        self.data += data
        return len(views) - 1

    def accessor(self, values: Any, kind: str, dtype: Any = np.float32, **more: Any) -> int:
        """Add an array; returns the index of its accessor."""
        array = np.ascontiguousarray(values, dtype)
        entry = {"bufferView": self.view(array.tobytes()), "componentType": TYPES[array.dtype], "count": len(array), "type": kind, **more}
        if array.dtype == np.float32:
            flat = array.reshape(len(array), -1)
            entry |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        self.tree.setdefault("accessors", []).append(entry)
        return len(self.tree["accessors"]) - 1

    def mesh(self, vertices: Any = CUBE, faces: Any = CUBE_FACES, **more: Any) -> int:
        """Add a mesh; returns its index."""
        attributes = {"POSITION": self.accessor(vertices, "VEC3")}
        primitive = {"attributes": attributes, "indices": self.accessor(np.ravel(faces), "SCALAR", np.uint16), **more}
        self.tree.setdefault("meshes", []).append({"primitives": [primitive]})
        return len(self.tree["meshes"]) - 1

    def animate(self, node: int, path: str, times: Any, values: Any, join: str = "LINEAR") -> None:
        """Add an animation of one channel."""
        keys = {"input": self.accessor(times, "SCALAR"), "output": self.accessor(values, f"VEC{np.shape(values)[1]}")}
        samplers = [{**keys, "interpolation": join}]
        channels = [{"sampler": 0, "target": {"node": node, "path": path}}]
        self.tree.setdefault("animations", []).append({"channels": channels, "samplers": samplers})

    def glb(self) -> bytes:
        """Return the .glb file."""
        if self.data:
            self.tree["buffers"] = [{"byteLength": len(self.data)}]
        return pack(self.tree, self.data)

    def save(self, path: Path) -> Path:
        """Write it, by its suffix, and return the path."""
        if path.suffix == ".gltf":
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
            path.write_text(json.dumps({**self.tree, "buffers": [{"byteLength": len(self.data), "uri": uri}]} if self.data else self.tree))
        else:
            path.write_bytes(self.glb())
        return path


def pack(tree: Any, data: bytes) -> bytes:
    """Return a .glb file of JSON and bytes."""
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if data:
        data += b"\0" * (-len(data) % 4)
        chunks += struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def unpack(path: Path) -> tuple[dict[str, Any], bytes]:
    """Return JSON and bytes of a .glb file."""
    file = path.read_bytes()
    size = struct.unpack_from("<I", file, 12)[0]
    return json.loads(file[20 : 20 + size]), file[28 + size :]


def values(tree: dict[str, Any], data: bytes, index: int) -> np.ndarray:
    """Return an accessor of floats, (count,) or (count, width)."""
    entry = tree["accessors"][index]
    view = tree["bufferViews"][entry["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[entry["type"]]
    assert entry["componentType"] == 5126
    first = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
    array = np.frombuffer(data, "<f4", entry["count"] * width, first).reshape(-1, width).astype(float)
    return array[:, 0] if width == 1 else array


def channels(tree: dict[str, Any], data: bytes) -> dict[tuple[str, str], tuple[np.ndarray, np.ndarray]]:
    """Return times and values of all channels, by name of node and path."""
    found = {}
    for animation in tree.get("animations", []):
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            key = tree["nodes"][channel["target"]["node"]]["name"], channel["target"]["path"]
            found[key] = values(tree, data, sampler["input"]), values(tree, data, sampler["output"])
    return found


def physics(motion: dict[str, Any] | None = None, collider: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """Return the extensions of a node with physics."""
    parts = {"motion": motion, "collider": collider, **more}
    return {"KHR_physics_rigid_bodies": {key: value for key, value in parts.items() if value is not None}}


def shaped(shape: int = 0, **more: Any) -> dict[str, Any]:
    """Return a collider with an implicit shape."""
    return {"geometry": {"shape": shape}, **more}


def with_physics(nodes: list[dict[str, Any]], shapes: list[dict[str, Any]], **lists: Any) -> Gltf:
    """Return a file with implicit shapes and the lists of the physics extension."""
    extensions = {"KHR_implicit_shapes": {"shapes": shapes}} | ({"KHR_physics_rigid_bodies": lists} if lists else {})
    return Gltf(nodes, extensions=extensions, extensionsUsed=["KHR_physics_rigid_bodies", "KHR_implicit_shapes"])


BOX = {"type": "box", "box": {"size": [1.0, 1.0, 1.0]}}
BALL = {"type": "sphere", "sphere": {"radius": 0.5}}
