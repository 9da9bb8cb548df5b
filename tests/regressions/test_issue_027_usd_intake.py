"""Issue 27: instances of a USD point instancer are bodies, and no prim is lost in silence."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdSkel

import rigidimpulse as ri

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "io"))
from usd_files import File

PLACES = np.array([[0.0, 0.0, 3.0], [4.0, 0.0, 5.0], [8.0, 0.0, 7.0]])
TURN = (0.5, 0.5, 0.5, 0.5)
"""Quaternion wxyz, exact in half precision."""


def instancer(file: File, path: str, prototype: str, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> UsdGeom.PointInstancer:
    """An instancer at three places, the second instance turned, the third twice as large."""
    made = UsdGeom.PointInstancer.Define(file.stage, path)
    made.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*at))
    made.GetPrototypesRel().SetTargets([prototype])
    made.GetPositionsAttr().Set([Gf.Vec3f(*map(float, place)) for place in PLACES])
    made.GetProtoIndicesAttr().Set([0, 0, 0])
    made.GetOrientationsAttr().Set([Gf.Quath(1.0), Gf.Quath(*TURN), Gf.Quath(1.0)])
    made.GetScalesAttr().Set([Gf.Vec3f(1.0), Gf.Vec3f(1.0), Gf.Vec3f(2.0)])
    return made


def crates(file: File) -> UsdGeom.PointInstancer:
    """Three rigid bodies of one prototype, below their instancer, on a floor."""
    file.collider("/floor", "Cube", scale=(50.0, 50.0, 0.5), at=(0.0, 0.0, -0.5))
    made = instancer(file, "/crates", "/crates/prototypes/box", (0.0, 1.0, 0.0))
    file.body("/crates/prototypes/box")
    file.collider("/crates/prototypes/box/surface", "Cube", size=1.0)
    return made


def test_rigid_bodies_of_a_point_instancer_are_bodies(tmp_path: Path) -> None:
    """Three vanished, and the report was empty. Place, turn and scale are those of the instance below its instancer."""
    file = File()
    crates(file)
    scene = file.load(tmp_path)
    assert scene.names == ("floor", "box_0", "box_1", "box_2")
    for k, place in enumerate(PLACES):
        body = scene[f"box_{k}"]
        assert body.motion == "dynamic" and np.allclose(body.position, place + [0, 1, 0])
        assert body.shape.solid().volume == pytest.approx(8.0 if k == 2 else 1.0)
    assert np.allclose(scene["box_1"].unit_orientation(), TURN)
    assert any("/crates" in line and "3 instances" in line for line in scene.report)


def test_their_motion_is_in_the_written_file(tmp_path: Path) -> None:
    """Each prim falls by g t^2 / 2. The file itself, opened again, has its instancer as before."""
    file = File()
    crates(file)
    scene = file.load(tmp_path)
    ri.simulate(scene, 0.25, fps=4).export(tmp_path / "out.usda")
    stage = Usd.Stage.Open(str(tmp_path / "out.usda"))
    last = UsdGeom.XformCache(Usd.TimeCode(stage.GetEndTimeCode()))
    shown = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Gprim)]
    assert sorted(str(prim.GetPath()) for prim in shown) == [*(f"/crates/box_{k}/surface" for k in range(3)), "/floor"]
    for k, place in enumerate(PLACES):
        matrix = np.array(last.GetLocalToWorldTransform(stage.GetPrimAtPath(f"/crates/box_{k}")))
        assert np.allclose(matrix[3, :3], place + [0, 1, -0.5 * 9.81 * 0.25**2], atol=1e-6)
    assert np.allclose(np.array(last.GetLocalToWorldTransform(stage.GetPrimAtPath("/crates/box_2")))[:3, :3], 2 * np.eye(3), atol=1e-6)
    assert Usd.Stage.Open(str(tmp_path / "in.usda")).GetPrimAtPath("/crates").IsA(UsdGeom.PointInstancer)


def test_instances_that_are_hidden_are_none_and_those_without_physics_are_drawn(tmp_path: Path) -> None:
    file = File()
    made = crates(file)
    made.GetInvisibleIdsAttr().Set([1])
    instancer(file, "/grass", "/grass/blade", (0.0, 30.0, 0.0))
    file.prim("/grass/blade", "Cube", size=1.0)
    scene = file.load(tmp_path)
    assert scene.names == ("floor", "box_0", "box_2")
    assert any("/grass" in line and "drawn" in line for line in scene.report)


def test_an_instancer_of_a_file_without_physics(tmp_path: Path) -> None:
    """Every prim with a surface is a body there, and so is every instance; instancers inside instances, too."""
    file = File()
    file.prim("/floor", "Cube", scale=(50.0, 50.0, 0.5), at=(0.0, 0.0, -0.5))
    instancer(file, "/outer", "/outer/cluster")
    file.prim("/outer/cluster", "Xform")
    inner = UsdGeom.PointInstancer.Define(file.stage, "/outer/cluster/inner")
    inner.GetPrototypesRel().SetTargets(["/outer/cluster/inner/ball"])
    inner.GetPositionsAttr().Set([Gf.Vec3f(0.0, 10.0, 0.0), Gf.Vec3f(0.0, 20.0, 0.0)])
    inner.GetProtoIndicesAttr().Set([0, 0])
    file.prim("/outer/cluster/inner/ball", "Sphere", radius=0.5)
    scene = file.load(tmp_path)
    places = sorted(tuple(np.round(body.position, 6).tolist()) for body in scene.bodies if body.name != "floor")
    wanted = [place + [0.0, far * (2 if k == 2 else 1), 0.0] for k, place in enumerate(PLACES) for far in (10.0, 20.0)]
    wanted[2], wanted[3] = PLACES[1] + [0.0, 0.0, 10.0], PLACES[1] + [0.0, 0.0, 20.0]
    assert np.allclose(places, sorted(map(tuple, wanted)))


def test_colliders_of_an_instancer_below_a_body_are_its_shape(tmp_path: Path) -> None:
    file = File()
    file.body("/rack")
    instancer(file, "/rack/rods", "/rack/rods/rod")
    file.collider("/rack/rods/rod", "Cube", size=1.0)
    scene = file.load(tmp_path)
    assert scene.names == ("rack",) and scene["rack"].shape.solid().volume == pytest.approx(10.0)


def crate(file: File, path: str, at: tuple[float, float, float], **more: str) -> None:
    """An object as Blender writes it: an Xform with the transform, and a mesh in it."""
    prim = file.prim(path, at=at)
    for name, value in more.items():
        prim.CreateAttribute(f"userProperties:{name}", Sdf.ValueTypeNames.String).Set(value)
    file.collider(f"{path}/mesh", "Mesh").RemoveAPI(UsdPhysics.CollisionAPI)


def test_an_object_below_another_is_part_of_it(tmp_path: Path) -> None:
    """A crate on a crate came apart. It is one body now, unless it says that it moves by itself."""
    file = File()
    file.prim("/World", "Xform")
    crate(file, "/World/low", (0.0, 0.0, 5.0))
    crate(file, "/World/low/high", (0.0, 0.0, 1.0))
    crate(file, "/World/low/high/top", (0.0, 0.0, 1.0))
    crate(file, "/World/low/loose", (0.0, 3.0, 0.0), motion="dynamic")
    crate(file, "/World/beside", (5.0, 0.0, 5.0))
    scene = file.load(tmp_path)
    assert sorted(scene.names) == ["beside", "loose", "low"]
    assert scene["low"].shape.solid().volume == pytest.approx(3.0) and scene["low"].shape.solid().centroid[2] == pytest.approx(1.0)
    for path in ("/World/low/high/mesh", "/World/low/high/top/mesh"):
        assert any(f"{path} is part of body /World/low" in line for line in scene.report)


@pytest.mark.parametrize("moving", [True, False])
def test_a_mesh_whose_bones_move_is_drawn_and_no_lump(moving: bool, tmp_path: Path) -> None:
    file = File()
    file.prim("/floor", "Cube", scale=(50.0, 50.0, 0.5), at=(0.0, 0.0, -0.5))
    UsdSkel.Root.Define(file.stage, "/hero")
    crate(file, "/hero/skin", (0.0, 0.0, 2.0))
    skeleton = UsdSkel.Skeleton.Define(file.stage, "/hero/bones")
    skeleton.GetJointsAttr().Set(["a"])
    for attribute in (skeleton.GetBindTransformsAttr(), skeleton.GetRestTransformsAttr()):
        attribute.Set([Gf.Matrix4d(1.0)])
    animation = UsdSkel.Animation.Define(file.stage, "/hero/walk")
    animation.GetJointsAttr().Set(["a"])
    animation.GetRotationsAttr().Set([Gf.Quatf(1.0)])
    animation.GetScalesAttr().Set([Gf.Vec3h(1.0)])
    for code in (0.0, 24.0) if moving else (0.0,):
        animation.GetTranslationsAttr().Set([Gf.Vec3f(0.0, code, 0.0)], code)
    mesh = file.stage.GetPrimAtPath("/hero/skin/mesh")
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(["/hero/walk"])
    binding = UsdSkel.BindingAPI.Apply(mesh)
    binding.CreateSkeletonRel().SetTargets(["/hero/bones"])
    binding.CreateJointIndicesPrimvar(False, 1).Set([0] * 8)
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 8)
    scene = file.load(tmp_path)
    assert ("skin" in scene.names) is not moving
    assert any("bones" in line and "/hero/skin/mesh" in line and "collides with nothing" in line for line in scene.report) is moving


def test_every_prim_is_simulated_drawn_or_reported(tmp_path: Path) -> None:
    """Walks files of both kinds: a prim with a surface is a body, below one, or in the report by its path."""
    first = File()
    first.collider("/floor", "Plane")
    first.body("/box", at=(0.0, 0.0, 2.0))
    first.collider("/box/hull", "Cube", size=1.0)
    first.prim("/box/look", "Mesh")
    first.prim("/tree", "Sphere", radius=0.5)
    off = first.collider("/off", "Sphere", radius=0.5)
    UsdPhysics.CollisionAPI(off).CreateCollisionEnabledAttr(False)
    first.prim("/hair", "BasisCurves")
    second = File()
    second.prim("/thing", "Cube", at=(0.0, 0.0, 2.0))
    second.prim("/hair", "BasisCurves")
    second.prim("/dots", "Points")
    UsdGeom.Imageable(second.prim("/unseen", "Cube")).MakeInvisible()
    UsdGeom.Imageable(second.prim("/helper", "Cube")).CreatePurposeAttr(UsdGeom.Tokens.guide)
    for number, file in enumerate((first, second)):
        path = file.save(tmp_path / f"{number}.usda")
        scene = ri.load_scene(path)
        stage = Usd.Stage.Open(str(path))
        for prim in stage.Traverse():
            if prim.IsA(UsdGeom.Gprim):
                inside = any(name in str(prim.GetPath()).split("/") for name in scene.names)
                assert inside or any(str(prim.GetPath()) in line for line in scene.report), (prim.GetPath(), scene.report)
