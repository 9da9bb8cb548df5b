"""Files without physics: every prim with a surface is a body.

    animated              kinematic, along its animation
    named like a floor    static: a word of its name is one of `STATIC_WORDS`
    any other             dynamic, if its mesh is closed; else as its convex hull; flat ones are static

An Xform that holds nothing but one such prim is the body. What is invisible, or for guides and proxies, is left out, and so are meshes
whose bones move: no rigid body goes where they go.

An Xform with a transform and one such prim without is an object, as programs write them. Objects below it are parts of its body, unless
they are animated by themselves or have the attribute `userProperties:motion` ("dynamic", "kinematic", "static"; a custom property).
"""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any, NamedTuple

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.pieces import STATIC_WORDS
from rigidimpulse.io.usd.frames import Frames
from rigidimpulse.io.usd.library import Prim, Sdf, SdfPath, UsdGeom
from rigidimpulse.io.usd.shapes import Shapes
from rigidimpulse.io.usd.skinning import moved_by_bones
from rigidimpulse.scene.shape import Shape

KINDS = {"Mesh", "Sphere", "Cube", "Capsule", "Capsule_1", "Cylinder", "Cylinder_1", "Cone", "Plane"}
MOTIONS = ("dynamic", "kinematic", "static", "none")
PROPERTY = "userProperties:motion"
"""How an object moves; a custom property in Blender."""
SEEN = {"default", "render"}
"""Purposes of prims that are looked at."""


class Plain(NamedTuple):
    """Descriptions by kind, as the parser of UsdPhysics has them; meshes that collide as their hull; lines of the report."""

    parsed: dict[str, list[tuple[SdfPath, Any]]]
    hulls: frozenset[SdfPath]
    notes: list[str]


def plain_bodies(frames: Frames) -> Plain:
    """Return the bodies of a file without physics; there may be none.

    Raises:
        SceneError: a mesh is broken; names the prim.

    """
    found = Plain({"RigidBody": [], "MeshShape": []}, frozenset(), ["the file has no physics: every prim with a surface is a body"])
    shapes, hulls = Shapes(frames.start), set()
    motions: dict[SdfPath, str] = {}
    for prim, body, is_part in _surfaces(frames, found.notes):
        motion = motions[body.GetPath()] if is_part else _motion(frames, body)
        if motion == "dynamic" and prim.IsA(UsdGeom.Mesh):
            placed = shapes.of(prim, frames.stretch(prim) * frames.meters_per_unit)
            if placed is not None and not _solid(prim, placed[0], hulls, found.notes, is_part):
                if is_part:
                    continue
                motion = "static"
        if str(prim.GetTypeName()) == "Plane":
            motion = "static"
        moves = motion != "static"
        common = {"filteredCollisions": [], "isValid": True}
        if moves and not is_part:
            rigid = {"rigidBodyEnabled": True, "kinematicBody": motion == "kinematic", "startsAsleep": False}
            found.parsed["RigidBody"].append((body.GetPath(), SimpleNamespace(**rigid, **common)))
        motions.setdefault(body.GetPath(), motion)
        owner = body.GetPath() if moves else Sdf.Path.emptyPath
        shape = SimpleNamespace(rigidBody=owner, collisionEnabled=True, collisionGroups=[], materials=[], **common)
        found.parsed["MeshShape"].append((prim.GetPath(), shape))
    return found._replace(hulls=frozenset(hulls))


def is_seen(prim: Prim) -> bool:
    """Return whether a prim is there to be looked at."""
    image = UsdGeom.Imageable(prim)
    return image.ComputeVisibility() != UsdGeom.Tokens.invisible and str(image.ComputePurpose()) in SEEN


def _surfaces(frames: Frames, notes: list[str]) -> list[tuple[Prim, Prim, bool]]:
    """Return prims with a surface, the prim of the body of each, and whether it is part of a body above; parts come last."""
    bent = moved_by_bones(frames.stage)
    own: dict[SdfPath, Prim] = {}
    for prim in frames.prims():
        if str(prim.GetTypeName()) not in KINDS or not is_seen(prim):
            continue
        if prim.GetPath() in bent:
            notes.append(f"the bones of prim {prim.GetPath()} move: it is drawn as they move it and collides with nothing")
        elif _said(_object_of(prim)) == "none":
            notes.append(f"prim {prim.GetPath()} is no body, as its property says: it is drawn and collides with nothing")
        else:
            own[prim.GetPath()] = _object_of(prim)
    objects = {body.GetPath() for body in own.values()}
    made = []
    for path, body in own.items():
        whole = _whole(frames, body, objects)
        if whole != body:
            notes.append(f"prim {path} is part of body {whole.GetPath()} above it; give {body.GetPath()} {PROPERTY} to make it a body")
        made.append((frames.stage.GetPrimAtPath(path), whole, whole != body))
    return sorted(made, key=lambda entry: entry[2])


def _object_of(prim: Prim) -> Prim:
    """Return the Xform above a prim with a surface if it holds nothing else, or has the transform that the prim lacks; else the prim."""
    parent = prim.GetParent()
    if str(parent.GetTypeName()) != "Xform" or parent.IsPseudoRoot():
        return prim
    children = parent.GetAllChildren()
    surfaces = [child for child in children if str(child.GetTypeName()) in KINDS]
    is_placed = bool(UsdGeom.Xformable(parent).GetOrderedXformOps()) and not UsdGeom.Xformable(prim).GetOrderedXformOps()
    return parent if len(children) == 1 or (len(surfaces) == 1 and is_placed) else prim


def _whole(frames: Frames, body: Prim, objects: set[SdfPath]) -> Prim:
    """Return the body that an object is part of: itself, or one above against which nothing says that it moves."""
    chain = [body]
    above = body.GetParent()
    while above and not above.IsPseudoRoot():
        if _said(chain[0]) is not None or any(map(frames.is_animated, chain)):
            return body
        if above.GetPath() in objects:
            body, chain = above, [above]
        else:
            chain.append(above)
        above = above.GetParent()
    return body


def _said(prim: Prim) -> str | None:
    """What the property of an object says of its motion.

    Raises:
        SceneError: it is no word for that.

    """
    attribute = prim.GetAttribute(PROPERTY)
    value = attribute.Get() if attribute else None
    if value is not None and value not in MOTIONS:
        raise SceneError(f"{PROPERTY} is {str(value)[:40]!r}", f"give one of {', '.join(MOTIONS)}", f"prim {prim.GetPath()}")
    return value


def _motion(frames: Frames, body: Prim) -> str:
    said = _said(body)
    if said is not None:
        return said
    if frames.moves(body):
        return "kinematic"
    words = set(re.split(r"[^a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", body.GetName()).lower()))
    return "static" if words & STATIC_WORDS else "dynamic"


def _solid(prim: Prim, shape: Shape, hulls: set[SdfPath], notes: list[str], is_part: bool) -> bool:
    """Return whether a mesh is a solid, itself or as its hull; flat ones are neither."""
    try:
        shape.solid()
    except SceneError as error:
        try:
            Shape.convex_hull(shape).solid()
        except SceneError:
            what = "it is drawn with its body and collides with nothing" if is_part else "it is static"
            notes.append(f"prim {prim.GetPath()} is no solid and flat ({error.problem}): {what}")
            return False
        notes.append(f"prim {prim.GetPath()} is no solid ({error.problem}): it collides as its convex hull")
        hulls.add(prim.GetPath())
    return True
