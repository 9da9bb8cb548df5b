"""Mass properties of bodies of USD files against those of usd-core, `UsdPhysics.RigidBodyAPI.ComputeMassProperties`.

That one is in single precision; volume and inertia of shapes are given to it: colliders are cubes of 1 m.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.scene.mass import body_mass

pytest.importorskip("pxr")
from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdShade
from usd_files import File

TURN = Gf.Quatf(float(np.cos(0.3)), float(np.sin(0.3)), 0.0, 0.0)
MOMENTS = Gf.Vec3f(1.0, 2.0, 2.5)
FULL = {"mass": 3.0, "diagonalInertia": MOMENTS, "centerOfMass": Gf.Vec3f(0.2, 0, 0)}
CASES: dict[str, tuple[dict | None, dict | None, dict | None]] = {
    # MassAPI of the body, of the cube "a" at (1, 0, 0), turned, and of the cube "b" at (0, 2, 0); None: there is none.
    "nothing given": (None, None, None),
    "density of the body": ({"density": 500.0}, None, None),
    "density of body and collider": ({"density": 500.0}, {"density": 2000.0}, None),
    "densities of both": ({"density": 500.0}, {"density": 2000.0}, {"density": 2000.0}),
    "masses of colliders": (None, {"mass": 3.0}, {"mass": 1.0}),
    "mass before density": (None, {"mass": 3.0, "density": 100.0}, {"density": 7.0}),
    "mass of the body": ({"mass": 10.0}, {"mass": 3.0}, {"mass": 1.0}),
    "centre of a collider": (None, {"centerOfMass": Gf.Vec3f(0.2, 0, 0)}, None),
    "mass and centre of a collider": (None, {"mass": 3.0, "centerOfMass": Gf.Vec3f(0.2, 0.1, 0)}, {"density": 5.0}),
    "inertia of a collider": (None, {"diagonalInertia": 100 * MOMENTS}, None),
    "axes of a collider": (None, {"mass": 3.0, "diagonalInertia": MOMENTS, "principalAxes": TURN}, None),
    "all of a collider": (None, FULL, {"density": 5.0}),
    "mass of the body, all of a collider": ({"mass": 10.0}, FULL, {"mass": 2.0}),
    "centre of the body": ({"centerOfMass": Gf.Vec3f(0.5, 0, 0)}, {"density": 5.0}, None),
    "mass and centre of the body": ({"mass": 10.0, "centerOfMass": Gf.Vec3f(0.5, 0, 0)}, FULL, None),
    "inertia of the body": ({"diagonalInertia": MOMENTS, "principalAxes": TURN}, {"density": 5.0}, None),
    "masses below zero": ({"mass": -10.0, "density": -1.0}, {"mass": -3.0}, {"density": -2.0}),
}


def of_usd(stage: Usd.Stage) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of mass and inertia of "/body", as usd-core has them."""
    body, cache = stage.GetPrimAtPath("/body"), UsdGeom.XformCache()

    def shape(prim: Usd.Prim) -> Any:
        told, matrix = UsdPhysics.RigidBodyAPI.MassInformation(), cache.ComputeRelativeTransform(prim, body)[0]
        told.volume, told.centerOfMass, told.inertia = 1.0, Gf.Vec3f(0), Gf.Matrix3f(1 / 6)
        told.localPos, told.localRot = Gf.Vec3f(matrix.ExtractTranslation()), Gf.Quatf(matrix.ExtractRotationQuat())
        return told

    mass, moments, centre, axes = UsdPhysics.RigidBodyAPI(body).ComputeMassProperties(shape)
    turn = np.array(Gf.Matrix3d(Gf.Rotation(Gf.Quatd(axes)))).T
    return mass, np.array(centre), turn @ np.diag(moments) @ turn.T


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("material", [False, True])
def test_masses_are_those_of_usd(tmp_path: Path, case: str, material: bool) -> None:
    """The density of the body counted more than that of the collider (500 kg for 2,000), centre and inertia of colliders for nothing."""
    file = File()
    body, pose = file.body("/body"), {"a": {"at": (1, 0, 0), "turn": (np.cos(0.4), 0, 0, np.sin(0.4))}, "b": {"at": (0, 2, 0)}}
    prims = [body, *(file.collider(f"/body/{name}", "Cube", size=1.0, **where) for name, where in pose.items())]
    for prim, values in zip(prims, CASES[case], strict=True):
        if values is not None:
            file.mass(prim, **values)
    if material:
        wood = UsdShade.Material.Define(file.stage, "/wood")
        UsdPhysics.MaterialAPI.Apply(wood.GetPrim()).CreateDensityAttr(250.0)
        UsdShade.MaterialBindingAPI.Apply(body).Bind(wood, UsdShade.Tokens.weakerThanDescendants, "physics")
    scene = file.load(tmp_path)
    mass, centre, inertia = of_usd(file.stage)
    found = body_mass(scene["body"])
    assert abs(found.mass - mass) < 1e-6 * mass
    assert np.abs(found.center_of_mass - centre).max() < 1e-6
    assert np.abs(found.inertia - inertia).max() < 2e-6 * np.abs(inertia).max()


def test_masses_that_make_no_sense_are_told(tmp_path: Path) -> None:
    """A mass of -10 kg was taken as not given without a word, and so was a density above the body, where it holds for nothing."""
    file = File()
    file.mass(file.prim("/above"), density=70.0)
    body = file.body("/above/body")
    file.mass(body, mass=-10.0, diagonalInertia=Gf.Vec3f(1, 0, 2))
    file.collider("/above/body/shape", "Cube", size=1.0)
    scene = file.load(tmp_path)
    assert body_mass(scene["body"]).mass == 1000.0
    for told in ("prim /above/body: its mass is -10", "prim /above/body: its moments of inertia are 1, 0, 2", "prim /above: no body"):
        assert any(told in line for line in scene.report), told
    assert len(scene.report) == 3


def test_centres_of_colliders_under_scales_and_units(tmp_path: Path) -> None:
    """In centimetres and grams, below a scale of 2: the centre of mass is scaled as the shape is."""
    file = File(unit=0.01, kilograms=0.001)
    file.body("/body", at=(100, 0, 0), scale=(2, 2, 2))
    cube = file.collider("/body/shape", "Cube", size=10.0, at=(10, 0, 0))
    file.mass(cube, mass=2000.0, centerOfMass=Gf.Vec3f(1, 0, 0), diagonalInertia=Gf.Vec3f(1e5, 2e5, 2.5e5))
    found = body_mass(file.load(tmp_path)["body"])
    assert abs(found.mass - 2.0) < 1e-9
    assert np.abs(found.center_of_mass - [0.22, 0, 0]).max() < 1e-9
    assert np.abs(found.inertia - np.diag([1e-2, 2e-2, 2.5e-2])).max() < 1e-9


def test_a_body_of_a_scene_is_unmoved_by_its_density_alone(tmp_path: Path) -> None:
    """One density for all colliders is left to the shape: the material of the body has it."""
    file = File()
    file.mass(file.body("/body"), density=700.0)
    file.collider("/body/shape", "Cube", size=1.0)
    body = file.load(tmp_path)["body"]
    assert body.mass is None and body.inertia is None and body.material == ri.Material(density=700.0)
