"""Files without physics: every prim with a surface is a body.

    animated              kinematic, along its animation
    named like a floor    static: a word of its name is one of `STATIC_WORDS`
    any other             dynamic, if its mesh is closed; else as its convex hull; flat ones are static

An Xform that holds nothing but one such prim is the body. What is invisible, or for guides and proxies, is left out.
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
from rigidimpulse.scene.shape import Shape

KINDS = {"Mesh", "Sphere", "Cube", "Capsule", "Capsule_1", "Cylinder", "Cylinder_1", "Cone", "Plane"}
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
    for prim in frames.prims():
        if str(prim.GetTypeName()) not in KINDS or not is_seen(prim):
            continue
        body = _body_of(prim)
        motion = _motion(frames, body)
        if motion == "dynamic" and prim.IsA(UsdGeom.Mesh):
            placed = shapes.of(prim, frames.stretch(prim) * frames.meters_per_unit)
            motion = _solid(prim, placed[0], hulls, found.notes) if placed is not None else motion
        if str(prim.GetTypeName()) == "Plane":
            motion = "static"
        moves = motion != "static"
        common = {"filteredCollisions": [], "isValid": True}
        if moves:
            rigid = {"rigidBodyEnabled": True, "kinematicBody": motion == "kinematic", "startsAsleep": False}
            found.parsed["RigidBody"].append((body.GetPath(), SimpleNamespace(**rigid, **common)))
        owner = body.GetPath() if moves else Sdf.Path.emptyPath
        shape = SimpleNamespace(rigidBody=owner, collisionEnabled=True, collisionGroups=[], materials=[], **common)
        found.parsed["MeshShape"].append((prim.GetPath(), shape))
    return found._replace(hulls=frozenset(hulls))


def is_seen(prim: Prim) -> bool:
    """Return whether a prim is there to be looked at."""
    image = UsdGeom.Imageable(prim)
    return image.ComputeVisibility() != UsdGeom.Tokens.invisible and str(image.ComputePurpose()) in SEEN


def _body_of(prim: Prim) -> Prim:
    """Return the Xform above a prim if it holds nothing else, else the prim."""
    parent = prim.GetParent()
    alone = str(parent.GetTypeName()) == "Xform" and len(parent.GetAllChildren()) == 1 and not parent.IsPseudoRoot()
    return parent if alone else prim


def _motion(frames: Frames, body: Prim) -> str:
    if frames.moves(body):
        return "kinematic"
    words = set(re.split(r"[^a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", body.GetName()).lower()))
    return "static" if words & STATIC_WORDS else "dynamic"


def _solid(prim: Prim, shape: Shape, hulls: set[SdfPath], notes: list[str]) -> str:
    """Return how a mesh moves: as a solid, as its hull, or not at all where it is flat."""
    try:
        shape.solid()
    except SceneError as error:
        try:
            Shape.convex_hull(shape).solid()
        except SceneError:
            notes.append(f"prim {prim.GetPath()} is no solid and flat ({error.problem}): it is static")
            return "static"
        notes.append(f"prim {prim.GetPath()} is no solid ({error.problem}): it collides as its convex hull")
        hulls.add(prim.GetPath())
    return "dynamic"
