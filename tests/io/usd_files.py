"""Small USD files made by code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics

import rigidimpulse as ri

CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


class File:
    """A stage under construction."""

    def __init__(self, up: str = "Z", unit: float = 1.0, kilograms: float = 1.0) -> None:
        """Empty, with a physics scene."""
        self.stage = Usd.Stage.CreateInMemory()
        UsdGeom.SetStageUpAxis(self.stage, up)
        UsdGeom.SetStageMetersPerUnit(self.stage, unit)
        UsdPhysics.SetStageKilogramsPerUnit(self.stage, kilograms)
        self.scene = UsdPhysics.Scene.Define(self.stage, "/physics")

    def prim(self, path: str, kind: str = "Xform", at: Any = None, turn: Any = None, scale: Any = None, **values: Any) -> Usd.Prim:
        """Add a prim with a transform (turn: wxyz) and attributes that its schema has."""
        prim = self.stage.DefinePrim(path, kind)
        xform = UsdGeom.Xformable(prim)
        if at is not None:
            xform.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, at)))
        if turn is not None:
            xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(*map(float, turn)))
        if scale is not None:
            xform.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, scale)))
        for name, value in values.items():
            prim.GetAttribute(name).Set(value)
        return prim

    def body(self, path: str, **more: Any) -> Usd.Prim:
        """Add a rigid body."""
        prim = self.prim(path, **more)
        UsdPhysics.RigidBodyAPI.Apply(prim)
        return prim

    def collider(self, path: str, kind: str, approximation: str | None = None, **more: Any) -> Usd.Prim:
        """Add a collider; a mesh is the unit cube, of quads."""
        prim = self.prim(path, kind, **more)
        UsdPhysics.CollisionAPI.Apply(prim)
        if kind == "Mesh":
            mesh = UsdGeom.Mesh(prim)
            mesh.GetPointsAttr().Set([Gf.Vec3f(*map(float, point)) for point in CUBE])
            mesh.GetFaceVertexCountsAttr().Set([4] * 6)
            mesh.GetFaceVertexIndicesAttr().Set(np.ravel(CUBE_FACES).tolist())
        if approximation is not None:
            UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(approximation)
        return prim

    def mass(self, prim: Usd.Prim, **values: Any) -> None:
        """Give a prim mass properties."""
        api = UsdPhysics.MassAPI.Apply(prim)
        for name, value in values.items():
            api.GetPrim().GetAttribute(f"physics:{name}").Set(value)

    def joint(self, path: str, kind: str, a: str | None, b: str | None, **values: Any) -> Usd.Prim:
        """Add a joint between bodies by path."""
        prim = self.stage.DefinePrim(path, kind)
        joint = UsdPhysics.Joint(prim)
        for rel, target in ((joint.CreateBody0Rel(), a), (joint.CreateBody1Rel(), b)):
            if target is not None:
                rel.SetTargets([target])
        for name, value in values.items():
            prim.GetAttribute(f"physics:{name}").Set(value)
        return prim

    def save(self, path: Path) -> Path:
        """Write the stage."""
        self.stage.GetRootLayer().Export(str(path))
        return path

    def load(self, folder: Path) -> ri.Scene:
        """Write the stage and read it as a scene."""
        return ri.load_scene(self.save(folder / "in.usda"))
