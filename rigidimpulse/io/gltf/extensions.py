"""The lists of extensions of a file that motion is written into.

Readers refuse a file that requires what they do not know. A written file therefore names the extensions that stand in it, and requires
none whose absence only costs the simulation: its motion is in its animation, whatever a reader knows of physics.
"""

from __future__ import annotations

from typing import Any

from rigidimpulse.io.gltf.schema import IMPLICIT_SHAPES, RIGID_BODIES

QUANTIZATION = "KHR_mesh_quantization"
"""An extension without an object of its own: it lets vertices be integers."""
FLOAT = 5126
WHOLE = ("COLOR_", "JOINTS_", "WEIGHTS_")
"""Attributes that may be integers without it."""


def state_extensions(tree: dict[str, Any]) -> None:
    """Keep in `extensionsUsed` and `extensionsRequired` of a file, in place, what it truly uses and needs."""
    found = _named(tree)
    if _is_quantized(tree):
        found.add(QUANTIZATION)
    used = [name for name in tree.pop("extensionsUsed", []) if name in found]
    required = [name for name in tree.pop("extensionsRequired", []) if name in used and name not in (RIGID_BODIES, IMPLICIT_SHAPES)]
    for key, names in (("extensionsUsed", used), ("extensionsRequired", required)):
        if names:
            tree[key] = names


def _named(tree: dict[str, Any]) -> set[str]:
    """Names of all extensions that objects of a file have."""
    found: set[str] = set()
    stack: list[Any] = [tree]
    while stack:
        place = stack.pop()
        if isinstance(place, list):
            stack += place
        elif isinstance(place, dict):
            own = place.get("extensions")
            found.update(own if isinstance(own, dict) else ())
            stack += [value for key, value in place.items() if key != "extras"]
    return found


def _is_quantized(tree: dict[str, Any]) -> bool:
    """Whether an attribute of a mesh is of integers where glTF itself has floats only."""
    whole = {k for k, accessor in enumerate(tree.get("accessors", [])) if accessor["componentType"] != FLOAT}
    for mesh in tree.get("meshes", []):
        for primitive in mesh["primitives"]:
            for attributes in (primitive["attributes"], *primitive.get("targets", [])):
                if any(index in whole for name, index in attributes.items() if not name.startswith(WHOLE)):
                    return True
    return False
