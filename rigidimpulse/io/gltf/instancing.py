"""Nodes that draw their mesh many times (EXT_mesh_gpu_instancing) as one node for each time.

    node with mesh and instances    a node without mesh, and below it a node with the mesh for each instance
    collider with the node's mesh   one on each of the new nodes
    other colliders, motion         stay: the instances are drawn with the node and move with it

So instances are bodies like others in a file without physics, and motion is written for each by itself. What is drawn stays the same.
"""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from typing import Any

import numpy as np

from rigidimpulse.io.gltf.container import GltfFile
from rigidimpulse.io.gltf.schema import INSTANCING, RIGID_BODIES, Document, Instancing

ATTRIBUTES = (("TRANSLATION", "translation", "VEC3"), ("ROTATION", "rotation", "VEC4"), ("SCALE", "scale", "VEC3"))
MOST_INSTANCES = 100_000
"""Instances at most in a file that become nodes."""


def with_instances(file: GltfFile) -> GltfFile:
    """Return a file with a node for each instance; the file itself if it has none.

    Raises:
        SceneError: the attributes of instances are broken, or do not fit each other.

    """
    nodes = file.document.nodes
    wanted = [k for k, node in enumerate(nodes) if node.extensions.instancing is not None]
    if not wanted:
        return file
    raw, left = copy.deepcopy(file.raw), MOST_INSTANCES
    first: dict[int, int] = {}
    for index in wanted:
        name, instancing = nodes[index].name or f"node{index}", nodes[index].extensions.instancing
        assert instancing is not None
        if nodes[index].mesh is None or nodes[index].skin is not None:
            file.notes.append(f"node {name!r} has instances, and no mesh for them, or one with bones: its instances are not read")
            continue
        values = _values(file, instancing, f"node {name!r}")
        count = len(next(iter(values.values()), ()))
        if not 0 < count <= left:
            file.notes.append(f"node {name!r} has {count} instances (a file may have {MOST_INSTANCES}): they are drawn, and are no bodies")
            continue
        left -= count
        first[index] = len(raw["nodes"])
        _expand(raw["nodes"], index, name, values)
        file.notes.append(f"node {name!r} draws its mesh {count} times: each instance is a node of its own, {name + ' 1'!r} and so on")
    for entry in raw["nodes"]:
        _rename(entry, first)
    return replace(file, raw=raw, document=Document.model_validate_json(json.dumps(raw)))


def _values(file: GltfFile, instancing: Instancing, where: str) -> dict[str, np.ndarray]:
    """Translations, rotations xyzw and scales of instances, as far as they are given, by their keys in nodes."""
    values = {
        key: np.asarray(file.array(instancing.attributes[name], kind), float)
        for name, key, kind in ATTRIBUTES if name in instancing.attributes
    }  # fmt: skip
    if len({len(array) for array in values.values()}) > 1:
        raise file.error("its instances have attributes of unequal number", "export the file again", where)
    return values


def _expand(entries: list[dict[str, Any]], index: int, name: str, values: dict[str, np.ndarray]) -> None:
    """Move the mesh of a node, and the collider that is this mesh, to new nodes below it."""
    node = entries[index]
    del node["extensions"][INSTANCING]
    shared = {key: node.pop(key) for key in ("mesh", "weights") if key in node}
    if "extras" in node:
        shared["extras"] = node["extras"]
    physics = node["extensions"].get(RIGID_BODIES) or {}
    collider = physics.get("collider")
    is_own = collider is not None and collider.get("geometry", {}).get("node") == index
    own_collider = json.dumps(collider) if is_own else ""
    if is_own:
        del physics["collider"]
    if node["extensions"].get(RIGID_BODIES) == {}:
        del node["extensions"][RIGID_BODIES]
    if not node["extensions"]:
        del node["extensions"]
    for k in range(len(next(iter(values.values())))):
        entry: dict[str, Any] = {"name": f"{name} {k + 1}", **copy.deepcopy(shared)}
        entry |= {key: array[k].tolist() for key, array in values.items()}
        if is_own:
            own = json.loads(own_collider)
            own["geometry"]["node"] = len(entries)
            entry["extensions"] = {RIGID_BODIES: {"collider": own}}
        node.setdefault("children", []).append(len(entries))
        entries.append(entry)


def _rename(entry: dict[str, Any], first: dict[int, int]) -> None:
    """Let colliders and triggers that name a node with instances name the first of the new ones, which has its mesh."""
    physics = (entry.get("extensions") or {}).get(RIGID_BODIES) or {}
    for part in (physics.get("collider"), physics.get("trigger")):
        geometry = (part or {}).get("geometry") or {}
        if geometry.get("node") in first:
            geometry["node"] = first[geometry["node"]]
