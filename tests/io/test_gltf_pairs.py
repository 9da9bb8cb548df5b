"""Every shape of a glTF file bears every other one: 36 pairs side by side, each of a static shape and a body that falls on it by 1 cm.

After a second the bodies rest where their lowest point is on the highest of the shape below: heights follow from the figures in
the file. Contacts are held apart by 1e-6 of the size, here up to 4 m. What passes through is off by metres, a figure that is taken
for another one (radius, half height, diameter) or a hull in place of a concave mesh by 0.1 m and more.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from gltf_files import Gltf, physics, with_physics

import rigidimpulse as ri

KINDS = ("sphere", "box", "capsule", "cylinder", "hull", "mesh")
LYING = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
"""A quarter turn about z: capsules lie along x."""
BELOW = {"sphere": 2.0, "box": 0.5, "capsule": 1.5, "cylinder": 0.5, "hull": 0.5, "mesh": 0.25}
"""m, from the origin of each static shape up to where it bears."""
ABOVE = {"sphere": 0.3, "box": 0.2, "capsule": 0.15, "cylinder": 0.2, "hull": 0.25, "mesh": 0.35}
"""m, from the origin of each body down to its lowest point."""
SHAPES = [
    {"type": "sphere", "sphere": {"radius": 2.0}},
    {"type": "box", "box": {"size": [4.0, 1.0, 4.0]}},
    {"type": "capsule", "capsule": {"height": 3.0, "radiusBottom": 1.5, "radiusTop": 1.5}},
    {"type": "cylinder", "cylinder": {"height": 1.0, "radiusBottom": 2.0, "radiusTop": 2.0}},
    {"type": "sphere", "sphere": {"radius": 0.3}},
    {"type": "box", "box": {"size": [0.6, 0.4, 0.5]}},
    {"type": "capsule", "capsule": {"height": 0.6, "radiusBottom": 0.15, "radiusTop": 0.15}},
    {"type": "cylinder", "cylinder": {"height": 0.4, "radiusBottom": 0.3, "radiusTop": 0.3}},
]


LEG = 0.2
"""m, from the middle of the stool to the inner edges of its legs, which alone meet a sphere."""
SECTION = [[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4], [0, 5, 6], [0, 6, 7]]
"""Triangles of a section like a U, see `trough`."""


def extruded(ring: Any, triangles: Any, along: Any) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces, normals outwards, of a prism: a ring (n, 3) and its triangles, moved by -along and +along."""
    ring, n = np.asarray(ring, float), len(ring)
    sides = [[k, (k + 1) % n, n + k] for k in range(n)] + [[(k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    faces = np.array(sides + [face[::-1] for face in triangles] + [[n + k for k in face] for face in triangles])
    vertices = np.concatenate([ring - along, ring + along])
    a, b, c = vertices[faces.T]
    return vertices, faces if np.sum(a * np.cross(b, c)) > 0.0 else faces[:, ::-1]


def prism(radius: float, half: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of an upright prism of eight sides."""
    angle = 0.25 * np.pi * np.arange(8)
    ring = np.column_stack([radius * np.cos(angle), 0.0 * angle, radius * np.sin(angle)])
    return extruded(ring, [[0, k + 1, k] for k in range(1, 7)], [0.0, half, 0.0])


def trough(wide: float, inner: float, heights: Any, half: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a trough along z, its section a U: heights of its bottom, of the floor inside, of its walls."""
    low, floor, high = heights
    ring = [(-wide, low), (wide, low), (wide, high), (inner, high), (inner, floor), (-inner, floor), (-inner, high), (-wide, high)]
    return extruded([(x, y, 0.0) for x, y in ring], SECTION, [0.0, 0.0, half])


def pairs() -> Gltf:
    """36 pairs, 8 m from one to the next: nodes "sphere on box" and the like, each body 1 cm above."""
    nodes: list[dict[str, Any]] = []
    file = with_physics([], SHAPES)
    meshes = {
        ("hull", 0): file.mesh(*prism(2.0, 0.5)), ("mesh", 0): file.mesh(*trough(2.0, 1.5, (-0.5, 0.25, 0.6), 2.0)),
        ("hull", 1): file.mesh(*prism(0.3, 0.25)), ("mesh", 1): file.mesh(*trough(0.4, LEG, (0.2, 0.0, -0.35), 0.25)),
    }  # fmt: skip
    for row, low in enumerate(KINDS):
        for column, high in enumerate(KINDS):
            heights = (0.0, BELOW[low] + ABOVE[high] + 0.01)
            for side, kind, name, motion in ((0, low, f"under {high} {low}", None), (1, high, f"{high} on {low}", {})):
                node: dict[str, Any] = {"name": name, "translation": [8.0 * column, heights[side], 8.0 * row]}
                geometry: dict[str, Any] = {"shape": 4 * side + KINDS.index(kind)} if kind not in ("hull", "mesh") else {"node": len(nodes)}
                if kind in ("hull", "mesh"):
                    node["mesh"], geometry["convexHull"] = meshes[kind, side], kind == "hull"
                if kind == "capsule":
                    node["rotation"] = LYING
                nodes.append({**node, "extensions": physics(motion, {"geometry": geometry})})
    file.tree |= {"nodes": nodes, "scenes": [{"nodes": list(range(len(nodes)))}]}
    return file


def test_every_shape_bears_every_shape(tmp_path: Path) -> None:
    scene = ri.load_scene(pairs().save(tmp_path / "pairs.glb"))
    kinds = [body.shape.parts_flat()[0].shape.kind for body in scene.bodies]
    assert {kind: kinds.count(kind) for kind in kinds} == {"sphere": 12, "box": 12, "capsule": 12, "cylinder": 12, "mesh": 24}
    run = ri.simulate(scene, 1.0, 10)
    assert run.status.ok, run.status.message
    for row, low in enumerate(KINDS):
        for column, high in enumerate(KINDS):
            name, top = f"{high} on {low}", BELOW[low]
            if (low, high) == ("sphere", "mesh"):
                top = np.sqrt(top**2 - LEG**2)
            place = [8.0 * column, top + ABOVE[high], 8.0 * row]
            assert np.allclose(run.position(name)[-1], place, rtol=0, atol=1e-5), (name, run.position(name)[-1] - place)
            assert np.abs(run.velocity(name)[-1]).max() < 1e-6, name
            assert np.abs(run.angular_velocity(name)[-1]).max() < 1e-6, name
