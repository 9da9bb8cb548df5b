"""Broken glTF files: good ones with bytes cut, flipped or made no numbers, and JSON with wrong types, indices and keys."""

from __future__ import annotations

import copy
import struct
from typing import Any

import numpy as np
from gltf_files import BALL, BOX, CUBE, Gltf, pack, physics, shaped, with_physics

JUNK = [None, -1, 0, 1, 3, 10**6, 2**53, 2**70, 1e300, -1e9, 0.5, True, "", "x", "SCALAR", [], {}, [0], [1e9] * 3, [0, 0, 0, 0], {"0": 0}]
KINDS = ("cut", "flip", "number", "value", "value", "value", "key", "index", "index", "double")


def good_files() -> list[Gltf]:
    """Return files that use every part that is read."""
    hull = {"geometry": {"node": 6, "convexHull": True}}
    nodes: list[dict[str, Any]] = [
        {"name": "floor", "extensions": physics(None, shaped(0, physicsMaterial=0))},
        {"name": "body", "translation": [0, 2, 0], "scale": [1, 2, 1], "children": [2, 3, 4], "extensions": physics({"mass": 1})},
        {"name": "part", "extensions": physics(None, shaped(1, collisionFilter=0)), "rotation": [0, 0, 0.6, 0.8]},
        {"name": "eye", "extensions": physics(trigger={"geometry": {"shape": 2}})},
        {"name": "pin", "extensions": physics(joint={"connectedNode": 5, "joint": 0})},
        {"name": "wall"},
        {"name": "hull", "mesh": 0, "extensions": physics({"inertiaDiagonal": [0, 1, 0], "mass": 0}, hull)},
    ]  # fmt: skip
    tapered = {"type": "capsule", "capsule": {"height": 1, "radiusTop": 0.2, "radiusBottom": 0.3}}
    first = with_physics(
        nodes, [{"type": "plane", "plane": {}}, BOX, BALL, tapered], physicsMaterials=[{"restitution": 0.5}],
        collisionFilters=[{"collisionSystems": ["a"], "collideWithSystems": ["b"]}],
        physicsJoints=[{"limits": [{"linearAxes": [0, 1, 2], "min": 0, "max": 0}], "drives": [
            {"type": "angular", "mode": "force", "axis": 0, "velocityTarget": 1, "damping": 1}]}],
    )  # fmt: skip
    first.mesh()
    second = Gltf([
        {"name": "ground", "mesh": 0, "scale": [9, 0.1, 9]}, {"mesh": 0, "translation": [0, 3, 0], "extras": {"mass": 2}},
        {"name": "lift", "mesh": 0, "children": [3]}, {"name": "bone"}, {"name": "arm", "mesh": 1, "skin": 0},
    ])  # fmt: skip
    second.mesh()
    second.mesh(targets=[{"POSITION": second.accessor(0.1 * CUBE, "VEC3")}])
    second.tree["meshes"][1]["weights"] = [0.5]
    attributes = second.tree["meshes"][1]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = second.accessor(np.zeros((8, 4)), "VEC4", np.uint8)
    attributes["WEIGHTS_0"] = second.accessor(np.tile([1.0, 0.0, 0.0, 0.0], (8, 1)), "VEC4")
    second.tree["skins"] = [{"joints": [3], "inverseBindMatrices": second.accessor(np.eye(4).reshape(1, 16), "MAT4")}]
    second.animate(2, "translation", [0, 1], [[0, 0, 0], [0, 1, 0]])
    second.animate(2, "rotation", [0, 1, 2], np.tile([0, 0, 0, 1], (9, 1)), "CUBICSPLINE")
    return [first, second]


def broken(seed: int) -> bytes:
    """Return a file with one or two things wrong in it, or with none by luck."""
    rng = np.random.default_rng(seed)
    files = good_files()
    file = files[int(rng.integers(len(files)))]
    file.glb()
    tree, data = copy.deepcopy(file.tree), bytearray(file.data)
    kinds = [KINDS[int(k)] for k in rng.integers(len(KINDS), size=rng.integers(1, 3))]
    for kind in kinds:
        if kind == "number":
            place = 4 * int(rng.integers(len(data) // 4))
            data[place : place + 4] = struct.pack("<f", [np.nan, np.inf, -np.inf, 3e38, -1e20][int(rng.integers(5))])
        elif kind not in ("cut", "flip"):
            _spoil(tree, kind, rng)
    whole = bytearray(pack(tree, bytes(data)))
    if "flip" in kinds:
        for place in rng.integers(len(whole), size=rng.integers(1, 20)).tolist():
            whole[place] = int(rng.integers(256))
    return bytes(whole[: int(rng.integers(len(whole)))] if "cut" in kinds else whole)


def _spoil(tree: Any, kind: str, rng: np.random.Generator) -> None:
    """Change one place of the JSON."""
    places = [place for place in _places(tree) if kind != "index" or (isinstance(place[0][place[1]], int))]
    doubles = [place for place in places if isinstance(place[0], list)]
    home, key = (doubles if kind == "double" else places)[int(rng.integers(len(doubles if kind == "double" else places)))]
    if kind == "key":
        del home[key]
    elif kind == "double":
        home.append(copy.deepcopy(home[key]))
    elif kind == "index":
        home[key] = int(rng.integers(12))
    else:
        home[key] = copy.deepcopy(JUNK[int(rng.integers(len(JUNK)))])


def _places(tree: Any) -> list[tuple[Any, Any]]:
    """All places of values in JSON: their homes and keys."""
    found, stack = [], [tree]
    while stack:
        home = stack.pop()
        keys = list(home) if isinstance(home, dict) else range(len(home))
        for key in keys:
            found.append((home, key))
            if isinstance(home[key], dict | list):
                stack.append(home[key])
    return found
