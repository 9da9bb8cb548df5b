"""Materials in glTF files with physics: what glTF says of them, and what only our own files say, in `extras`."""

from __future__ import annotations

from typing import Any

from rigidimpulse.scene.material import DEFAULT_FRICTION, DEFAULT_RESTITUTION, Material

NOTE = "rigidimpulse"
"""Key in `extras` of what only we read."""
STATIC = "static"
"""Key there of a node whose colliders below it are one static body."""
ONLY_OURS = ("tangential_restitution", "rolling_friction", "spinning_friction")


def material_entry(material: Material, owner: str) -> tuple[dict[str, Any], list[str]]:
    """Return a material as glTF has it, and lines about what other programs will not see of it.

    Unstated coefficients are written as their defaults, and named in `extras`, where also what glTF has no word for stands.
    """
    static, dynamic = material.frictions()
    stated = {"restitution": material.restitution, "static_friction": static, "dynamic_friction": dynamic}
    entry: dict[str, Any] = {
        "staticFriction": float(DEFAULT_FRICTION if static is None else static),
        "dynamicFriction": float(DEFAULT_FRICTION if dynamic is None else dynamic),
        "restitution": float(DEFAULT_RESTITUTION if material.restitution is None else material.restitution),
    }
    for name in ("friction", "restitution"):
        if getattr(material, f"{name}_combine") != "average":
            entry[f"{name}Combine"] = getattr(material, f"{name}_combine")
    own: dict[str, Any] = {"density": float(material.density)}
    own |= {name: float(getattr(material, name)) for name in ONLY_OURS if getattr(material, name) is not None}
    unstated = [name for name, value in stated.items() if value is None]
    lines = [f"material of body {owner!r}: {name} is read by rigidimpulse alone" for name in ONLY_OURS if name in own]
    if unstated:
        own["unstated"] = unstated
    return {**entry, "extras": {NOTE: own}}, lines


def own_figures(extras: object, restitution: float, static: float, dynamic: float) -> dict[str, Any]:
    """Return fields of a material that only we write: arguments for `Material`, from `extras` of a file.

    What is not a figure of its kind is left alone; a coefficient that was changed since is stated.
    """
    said = extras.get(NOTE) if isinstance(extras, dict) else None
    if not isinstance(said, dict):
        return {}
    fields: dict[str, Any] = {}
    for name in ("density", *ONLY_OURS):
        value = said.get(name)
        least = 1e-12 if name == "density" else 0.0
        greatest = 1.0 if name == "tangential_restitution" else 1e9
        if isinstance(value, int | float) and not isinstance(value, bool) and least <= value <= greatest:
            fields[name] = float(value)
    unstated = said.get("unstated")
    given = {"restitution": (restitution, DEFAULT_RESTITUTION), "static_friction": (static, DEFAULT_FRICTION)}
    given["dynamic_friction"] = (dynamic, DEFAULT_FRICTION)
    for name, (value, default) in given.items():
        if isinstance(unstated, list) and name in unstated and value == default:
            fields[name] = None
    return fields
