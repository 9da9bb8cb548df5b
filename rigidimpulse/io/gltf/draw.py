"""Bodies as meshes of a glTF file: what is seen of scenes that come from no file. Half spaces are squares."""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidimpulse.core.colors import linear_of, seen_of_hex
from rigidimpulse.core.quaternion import from_matrix
from rigidimpulse.io.gltf.container import Builder
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.shape import Shape
from rigidimpulse.view.camera import stage_rotation, up_axis
from rigidimpulse.view.display import DisplayMesh, display_mesh, display_planes, display_square, joined_meshes
from rigidimpulse.view.materials import PALETTE, surface

SEGMENTS = 32
"""Corners of a full turn of round shapes."""
VERTICES, INDICES = 34962, 34963


def new_file() -> Builder:
    """Return an empty file with one scene."""
    return Builder({"asset": {"version": "2.0", "generator": "rigidimpulse"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": []})


def stage(builder: Builder, gravity: Any, name: str) -> tuple[list[int], np.ndarray]:
    """Return the list that takes the nodes of bodies, and the quaternion wxyz that turns the scene Y up.

    Where that is a turn the list is the children of a root node with it, of that name.
    """
    turn = from_matrix(stage_rotation(up_axis(gravity)))
    roots = builder.tree["scenes"][0]["nodes"]
    if np.abs(turn[1:]).max() < 1e-12:
        return roots, np.array([1.0, 0.0, 0.0, 0.0])
    children: list[int] = []
    roots.append(builder.add("nodes", {"name": name, "rotation": turn[[1, 2, 3, 0]].tolist(), "children": children}))
    return children, turn


def node_pose(position: np.ndarray, orientation: np.ndarray) -> dict[str, Any]:
    """Return translation and rotation of a node, where they are not those of its parent."""
    pose: dict[str, Any] = {}
    if np.any(position):
        pose["translation"] = np.asarray(position, float).tolist()
    if np.any(orientation[1:]):
        pose["rotation"] = np.asarray(orientation, float)[[1, 2, 3, 0]].tolist()
    return pose


class Drawing:
    """Meshes of shapes in a file; equal shapes share their vertices."""

    def __init__(self, builder: Builder, half: float) -> None:
        """half: m, half side of squares for half spaces."""
        self.builder, self.half = builder, half
        self._geometry: dict[Any, tuple[dict[str, Any], DisplayMesh]] = {}
        self._meshes: dict[Any, int] = {}
        self._paints: dict[str, int] = {}

    def mesh(self, body: Body, index: int, shape: Shape | None = None) -> int:
        """Return the mesh of a body, or of a part of its shape, in the colours of the body, or that of the moving body `index`.

        Mesh and material have the name of the first body that they are made for.
        """
        shape = body.drawn_shape if shape is None else shape
        geometry, drawn = self._geometry_of(shape)
        paint = surface(index % len(PALETTE), body, drawn)
        key = (shape.drawn_key, str(paint))
        if key not in self._meshes:
            attributes = dict(geometry["attributes"])
            if not paint["painted"]:
                attributes.pop("COLOR_0", None)
            primitive = {**geometry, "attributes": attributes, "material": self.paint(paint, body.name)}
            self._meshes[key] = self.builder.add("meshes", {"name": body.name, "primitives": [primitive]})
        return self._meshes[key]

    def _geometry_of(self, shape: Shape) -> tuple[dict[str, Any], DisplayMesh]:
        """Return the triangles of a shape, in the file and as they are."""
        key = shape.drawn_key
        if key not in self._geometry:
            pieces = [display_square(normal, offset, self.half) for normal, offset in display_planes(shape)]
            mesh = display_mesh(shape, SEGMENTS)
            drawn = joined_meshes(pieces if mesh is None else [*pieces, mesh])
            normals = drawn.normals.astype(np.float32).astype(float)
            builder = self.builder
            attributes = {
                "POSITION": builder.array(drawn.vertices, "VEC3", bounds=True, target=VERTICES),
                "NORMAL": builder.array(normals / np.linalg.norm(normals, axis=1, keepdims=True), "VEC3", target=VERTICES),
            }
            if drawn.colors is not None:
                attributes["COLOR_0"] = builder.array(linear_of(drawn.colors / 255.0), "VEC3", target=VERTICES)
            index = builder.array(drawn.faces.ravel().astype(np.uint32), "SCALAR", target=INDICES)
            self._geometry[key] = {"attributes": attributes, "indices": index}, drawn
        return self._geometry[key]

    def paint(self, paint: dict[str, Any], name: str) -> int:
        """Return the material of a surface; name: of a material that is made for it."""
        key = str(paint)
        if key not in self._paints:
            # What is painted has its colours at the vertices, which multiply that of the material.
            linear = np.ones(3) if paint["painted"] else linear_of(seen_of_hex(paint["color"]))
            finish = {"baseColorFactor": [*linear.tolist(), 1.0]}
            finish |= {"metallicFactor": paint["metalness"], "roughnessFactor": paint["roughness"]}
            self._paints[key] = self.builder.add("materials", {"name": name, "pbrMetallicRoughness": finish, "doubleSided": True})
        return self._paints[key]
