"""Point instancers of a USD file as prims: each instance an Xform below the instancer that refers to its prototype.

    /shot/crates  PointInstancer          /shot/crates         Xform
      prototypes/box  (rigid body)          prototypes         inactive
                                            box_0, box_1, ...  = prototypes/box, each with its transform

The parser of UsdPhysics leaves out what is below an instancer, and a body needs a prim of its own to move. All this is said in the
session layer of the stage, so the file stays as it is; layers with motion repeat it, and show each instance where it goes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.usd.layer import TYPES, attribute, define, order, valid_name
from rigidimpulse.io.usd.library import Gf, Prim, Sdf, Stage, Usd, UsdGeom, UsdPhysics

MOST_INSTANCES = 100_000
"""Instances at most in a file that become prims."""
MOST_ROUNDS = 8
"""Instancers at most that stand inside each other."""
OPERATION = "xformOp:transform:instance"


def expand_instancers(stage: Stage, code: float) -> list[str]:
    """Put prims in the place of instances with physics, or of all where the file has none; return lines of the report.

    Args:
        stage: it gets opinions in its session layer. code: time code of the scene.

    """
    notes: list[str] = []
    done: set[Any] = set()
    left = MOST_INSTANCES
    for _ in range(MOST_ROUNDS):
        found = [prim for prim in _prims(stage) if prim.IsA(UsdGeom.PointInstancer) and prim.GetPath() not in done]
        if not found:
            break
        # What has no physics beside things that have is looked at only.
        is_plain = not any(map(_has_physics, stage.Traverse())) and not any(map(_makes_bodies, found))
        for prim in found:
            if not prim:  # it was in a prototype, and is in each instance now
                continue
            done.add(prim.GetPath())
            if not is_plain and not _makes_bodies(prim):
                notes.append(f"instancer {prim.GetPath()}: no prototype has physics: its instances are drawn, and collide with nothing")
            elif prim.IsInstanceProxy():
                notes.append(f"instancer {prim.GetPath()} stands in an instance: its instances are drawn, and are no bodies")
            else:
                left -= _expand(prim, code, left, notes)
    return notes


def _prims(stage: Stage) -> list[Prim]:
    return list(stage.Traverse(Usd.TraverseInstanceProxies()))


def _has_physics(prim: Prim) -> bool:
    return prim.HasAPI(UsdPhysics.RigidBodyAPI) or prim.HasAPI(UsdPhysics.CollisionAPI)


def _makes_bodies(prim: Prim) -> bool:
    """Whether there is a body or a collider in a prototype of an instancer."""
    stage = prim.GetStage()
    roots = [stage.GetPrimAtPath(path) for path in UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()]
    return any(_has_physics(inner) for root in roots if root for inner in Usd.PrimRange(root, Usd.PrimAllPrimsPredicate))


def _expand(prim: Prim, code: float, most: int, notes: list[str]) -> int:
    """Put a prim in the place of each instance of an instancer; return how many."""
    instancer = UsdGeom.PointInstancer(prim)
    where = f"instancer {prim.GetPath()}"
    kinds = instancer.GetProtoIndicesAttr().Get(code) or ()
    prototypes = instancer.GetPrototypesRel().GetForwardedTargets()
    both = UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
    transforms = instancer.ComputeInstanceTransformsAtTime(code, code, *both) if kinds else ()
    if len(transforms) != len(kinds) or any(not 0 <= kind < len(prototypes) for kind in kinds):
        raise SceneError("its instances and prototypes do not fit each other", "export it again", f"prim {prim.GetPath()}")
    mask = instancer.ComputeMaskAtTime(code) or [True] * len(kinds)
    if not 0 < len(kinds) <= most:
        notes.append(f"{where} has {len(kinds)} instances (a file may have {MOST_INSTANCES}): they are drawn, and are no bodies")
        return 0
    for attribute_ in (instancer.GetPositionsAttr(), instancer.GetOrientationsAttr(), instancer.GetScalesAttr()):
        if attribute_.ValueMightBeTimeVarying():
            notes.append(f"{where}: the animation of {attribute_.GetName()} is not read: its instances are where they are at the start")
    _write(prim, [(k, prototypes[kind], transforms[k]) for k, kind in enumerate(kinds) if mask[k]])
    notes.append(f"{where}: each of its {sum(mask)} instances is a prim of its own")
    return len(kinds)


def _write(prim: Prim, instances: Sequence[tuple[int, Any, Any]]) -> None:
    """Write the prims of instances (number, path of the prototype, matrix) below their instancer, which becomes an Xform."""
    stage, path = prim.GetStage(), prim.GetPath()
    layer, children = stage.GetSessionLayer(), [child.GetName() for child in prim.GetAllChildren()]
    types = {prototype: str(stage.GetPrimAtPath(prototype).GetTypeName()) for _, prototype, _ in instances}
    with Sdf.ChangeBlock():
        define(layer, path, over=True).typeName = "Xform"
        for child in children:
            define(layer, path.AppendChild(child), over=True).active = False
        used = set(children)
        for number, prototype, matrix in instances:
            made = define(layer, path.AppendChild(valid_name(f"{prototype.name}_{number}", used)), types[prototype] or "Xform")
            made.referenceList.Prepend(Sdf.Reference("", prototype))
            # A prototype that is a child of the instancer is inactive there.
            made.active = True
            attribute(made, OPERATION, TYPES.Matrix4d, Gf.Matrix4d(*np.ravel(matrix).tolist()))
            order(made, [OPERATION])
