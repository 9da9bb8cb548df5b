"""Scenes with UsdPhysics: figures of every part against values by hand.

Figures of files have single precision, 6e-8 relative; a unit that is not converted is off by its factor of 57 or 100.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri

pytest.importorskip("pxr")
from pxr import Gf, UsdGeom, UsdPhysics, UsdShade
from usd_files import File

SINGLE = 1e-6
HALF = np.sqrt(0.5)


def test_a_centimetre_scene_falls_in_metres(tmp_path: Path) -> None:
    """z = z_0 + v t - g t^2 / 2 in metres with g = 981 cm/s^2, and 90 degrees/s are pi / 2 rad/s."""
    file = File(unit=0.01)
    file.collider("/ball", "Sphere", at=(0, 0, 500), radius=20.0)
    api = UsdPhysics.RigidBodyAPI.Apply(file.stage.GetPrimAtPath("/ball"))
    api.CreateVelocityAttr((100, 0, 50))
    api.CreateAngularVelocityAttr((0, 90, 0))
    scene = file.load(tmp_path)
    assert scene["ball"].shape.kind == "sphere" and abs(scene["ball"].shape.radius - 0.2) < 1e-12
    assert abs(ri.simulate(scene, 0.1).ledger.kinetic[0] - 0.5 * 4 / 3 * np.pi * 0.2**3 * 1000 * (1.25 + 0.4 * 0.04 * np.pi**2 / 4)) < 1e-4
    run = ri.simulate(scene, 1.0, 24)
    t = run.times
    wanted = np.column_stack([t, 0 * t, 5 + 0.5 * t - 9.81 * t**2 / 2])
    assert np.abs(run.position("ball") - wanted).max() < SINGLE
    assert np.abs(run.angular_velocity("ball") - [0, np.pi / 2, 0]).max() < SINGLE
    assert scene.report == ()


def test_up_axis_and_gravity(tmp_path: Path) -> None:
    """By default 9.81 m/s^2 down the up axis, whatever the unit; given ones are in units of the file."""
    for up, wanted in (("Y", (0, -9.81, 0)), ("Z", (0, 0, -9.81))):
        file = File(up, unit=0.01)
        file.collider("/box", "Cube")
        assert np.abs(np.array(file.load(tmp_path).gravity) - wanted).max() < 1e-12
        file.scene.CreateGravityDirectionAttr((3, 0, 4))
        file.scene.CreateGravityMagnitudeAttr(162.0)
        assert np.abs(np.array(file.load(tmp_path).gravity) - np.array([0.6, 0, 0.8]) * 1.62).max() < SINGLE
    assert np.array_equal(ri.load_scene(tmp_path / "in.usda", gravity=(1, 2, 3)).gravity, (1, 2, 3))


def test_shapes_under_scales(tmp_path: Path) -> None:
    """Scales of all prims above count; axes stand where they say; unequal scales of round shapes are hulls."""
    file = File(unit=0.5)
    file.body("/b", at=(2, 0, 0), turn=(HALF, 0, 0, HALF), scale=(2, 2, 2))
    file.collider("/b/cube", "Cube", size=3.0, scale=(1, 2, 3), at=(1, 0, 0))
    file.collider("/b/capsule", "Capsule", radius=0.5, height=2.0, axis="X")
    file.collider("/b/cylinder", "Cylinder", radius=0.5, height=2.0, axis="Y", scale=(3, 1, 3))
    file.collider("/b/egg", "Sphere", radius=1.0, scale=(1, 1, 2))
    file.collider("/b/cone", "Cone", radius=1.0, height=3.0, axis="X")
    scene = file.load(tmp_path)
    body = scene["b"]
    assert np.allclose(body.position, (1, 0, 0)) and np.allclose(body.orientation, (HALF, 0, 0, HALF))
    cube, capsule, cylinder, egg, cone = body.shape.parts_flat()
    assert np.allclose(cube.shape.size, (3, 6, 9)) and np.allclose(cube.position, (1, 0, 0))
    assert (capsule.shape.kind, capsule.shape.radius, capsule.shape.height) == ("capsule", 0.5, 2.0)
    assert np.allclose(capsule.rotation @ [0, 0, 1], [1, 0, 0])
    assert np.allclose((cylinder.shape.radius, cylinder.shape.height), (1.5, 2.0)) and np.allclose(abs(cylinder.rotation[1, 2]), 1)
    assert np.allclose(egg.shape.surface().vertices.max(axis=0), (1, 1, 2), atol=0.05) and egg.shape.kind == "mesh"
    tip = cone.shape.surface().vertices
    assert np.allclose(tip[:, 0].max(), 1.5) and np.allclose(tip[:, 0].min(), -1.5) and np.allclose(np.abs(tip[tip[:, 0] > 1.4]).max(), 1.5)
    assert any("egg" in line for line in scene.report) and any("cone" in line for line in scene.report)


@pytest.mark.parametrize(("approximation", "kind", "volume"), [
    (None, "mesh", 6.0), ("none", "mesh", 6.0), ("convexHull", "mesh", 6.0), ("convexDecomposition", "mesh", 6.0),
    ("boundingCube", "compound", 6.0), ("boundingSphere", "compound", 4 / 3 * np.pi * (14 / 4) ** 1.5),
])  # fmt: skip
def test_meshes(tmp_path: Path, approximation: str | None, kind: str, volume: float) -> None:
    """A unit cube under scales 1, 2, 3, of quads; a mirror turns its triangles round, and its volume stays positive."""
    file = File()
    file.body("/b", scale=(-1, 2, 3))
    file.collider("/b/mesh", "Mesh", approximation)
    shape = file.load(tmp_path)["b"].shape
    assert abs(shape.solid().volume - volume) < 1e-5 and kind in (shape.kind, "compound")


def test_meshes_that_change_are_as_at_the_start(tmp_path: Path) -> None:
    """Points with time samples and no default value, as exporters of animation write them."""
    file = File()
    points = UsdGeom.Mesh(file.collider("/mesh", "Mesh")).GetPointsAttr()
    given = np.array(points.Get())
    points.Clear()
    for code, size in ((1.0, 2.0), (2.0, 5.0)):
        points.Set([Gf.Vec3f(*(size * point).tolist()) for point in given], code)
    file.stage.SetStartTimeCode(1)
    file.stage.SetEndTimeCode(2)
    scene = file.load(tmp_path)
    assert abs(scene["mesh"].shape.solid().volume - 8) < 1e-6 and "changes its shape" in scene.report[0]


def test_planes_and_static_colliders(tmp_path: Path) -> None:
    """A plane stands where its prim stands, its normal is its axis; a box falls on it and rests there."""
    file = File("Y", unit=0.01)
    file.collider("/ground", "Plane", axis="Y", at=(0, 100, 0))
    file.body("/box", at=(0, 200, 0))
    file.collider("/box/shape", "Cube", size=20.0)
    scene = file.load(tmp_path)
    assert scene["ground"].motion == "static" and scene["ground"].shape.kind == "half_space"
    run = ri.simulate(scene, 1.5, 24)
    assert abs(run.position("box")[-1, 1] - 1.1) < 1e-5


def test_masses(tmp_path: Path) -> None:
    """Of the body, of its colliders, by densities; centimetres and grams become metres and kilograms."""
    file = File(unit=0.01, kilograms=0.001)
    for name, values in (("given", {"mass": 500.0}), ("density", {"density": 2.0}), ("plain", {}), ("none", None)):
        body = file.body(f"/{name}")
        file.collider(f"/{name}/shape", "Cube", size=10.0)
        if values is not None:
            file.mass(body, **values)
    full = file.body("/full", scale=(2, 2, 2))
    file.collider("/full/shape", "Cube", size=10.0)
    turned = {"diagonalInertia": Gf.Vec3f(1e5, 2e5, 2.5e5), "principalAxes": Gf.Quatf(HALF, 0, 0, HALF)}
    file.mass(full, mass=2000.0, centerOfMass=Gf.Vec3f(1, 0, 0), **turned)
    two = file.body("/two")
    for k, mass in enumerate((1000.0, 3000.0)):
        file.mass(file.collider(f"/two/c{k}", "Cube", size=10.0, at=(20 * k, 0, 0)), mass=mass)
    from rigidimpulse.scene.mass import body_mass

    scene = file.load(tmp_path)
    assert two
    found = {body.name: body_mass(body) for body in scene.bodies}
    assert np.allclose([found[name].mass for name in ("given", "density", "plain", "none")], [0.5, 2.0, 1.0, 1.0])
    assert np.allclose(found["full"].center_of_mass, (0.02, 0, 0)) and abs(found["full"].mass - 2) < 1e-9
    assert np.allclose(found["full"].inertia, np.diag([2e-2, 1e-2, 2.5e-2]), atol=1e-8)
    assert np.allclose(found["two"].center_of_mass, (0.15, 0, 0)) and abs(found["two"].mass - 4) < 1e-6
    own = 4 * 0.01 / 6
    assert np.allclose(found["two"].inertia, np.diag([own, own + 0.03, own + 0.03]), atol=1e-7)


def test_materials(tmp_path: Path) -> None:
    """Frictions, restitution, density and combine modes of the bound material; unbound ones leave all unstated."""
    file = File()
    file.body("/b")
    prim = file.collider("/b/shape", "Cube", size=1.0)
    material = UsdShade.Material.Define(file.stage, "/rubber")
    api = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    for attribute, value in (
        (api.CreateStaticFrictionAttr(), 0.75), (api.CreateDynamicFrictionAttr(), 0.5), (api.CreateRestitutionAttr(), 0.25),
        (api.CreateDensityAttr(), 500.0),
    ):  # fmt: skip
        attribute.Set(value)
    from pxr import Sdf

    material.GetPrim().CreateAttribute("physxMaterial:frictionCombineMode", Sdf.ValueTypeNames.Token).Set("max")
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")
    file.collider("/floor", "Plane")
    scene = file.load(tmp_path)
    found = scene["b"].material
    assert (found.static_friction, found.dynamic_friction, found.restitution, found.density) == (0.75, 0.5, 0.25, 500.0)
    assert (found.friction_combine, found.restitution_combine) == ("maximum", "average")
    assert scene["floor"].material == ri.Material()


def test_keyframed_and_disabled_bodies(tmp_path: Path) -> None:
    """A kinematic body follows its time samples, from the first time code on; one that is not enabled stands."""
    file = File(unit=0.01)
    file.stage.SetTimeCodesPerSecond(24)
    file.stage.SetStartTimeCode(1001)
    file.stage.SetEndTimeCode(1025)
    door = file.body("/door")
    operation = UsdGeom.Xformable(door).AddTranslateOp()
    operation.Set((0, 0, 0), 1001)
    operation.Set((240, 0, 0), 1025)
    UsdPhysics.RigidBodyAPI(door).CreateKinematicEnabledAttr(True)
    file.collider("/door/shape", "Cube", size=20.0)
    off = file.body("/off", at=(0, 0, 500))
    UsdPhysics.RigidBodyAPI(off).CreateRigidBodyEnabledAttr(False)
    file.collider("/off/shape", "Sphere")
    scene = file.load(tmp_path)
    assert scene["off"].motion == "static" and any("'off'" in line for line in scene.report)
    run = ri.simulate(scene, 1.5, 24)
    assert np.abs(run.position("door")[:, 0] - np.minimum(2.4 * run.times, 2.4)).max() < SINGLE


def test_who_collides(tmp_path: Path) -> None:
    """Groups that filter each other and filtered pairs do not collide; all others do. Bodies in a row, each in the next one's way."""
    file = File()
    file.scene.CreateGravityMagnitudeAttr(0.0)
    for k, name in enumerate("abcd"):
        body = file.body(f"/{name}", at=(3 * k, 0, 0))
        file.collider(f"/{name}/shape", "Sphere", radius=0.5)
        UsdPhysics.RigidBodyAPI(body).CreateVelocityAttr((10.0 if k == 0 else 0.0, 0, 0))
    groups = [UsdPhysics.CollisionGroup.Define(file.stage, f"/group{k}") for k in range(2)]
    for group, name in zip(groups, "ab", strict=True):
        group.GetCollidersCollectionAPI().CreateIncludesRel().SetTargets([f"/{name}"])
    groups[0].CreateFilteredGroupsRel().SetTargets(["/group1"])
    UsdPhysics.FilteredPairsAPI.Apply(file.stage.GetPrimAtPath("/c")).CreateFilteredPairsRel().SetTargets(["/a"])
    run = ri.simulate(file.load(tmp_path), 1.0)
    hit = {frozenset((run.names[impact["body_a"]], run.names[impact["body_b"]])) for impact in run.impacts}
    assert hit == {frozenset("ad")}


def test_files_without_physics(tmp_path: Path) -> None:
    """Surfaces are bodies by their names and animation; an open mesh is its hull; what nobody sees is left out."""
    file = File("Y", unit=0.01)
    file.prim("/set/bigFloor", "Cube", size=10.0, scale=(100, 1, 100))
    file.prim("/set/crate", at=(0, 205, 0))
    for path in ("/set/crate/mesh", "/set/flat", "/set/open"):
        UsdPhysics.CollisionAPI(file.collider(path, "Mesh", scale=(100, 100, 100))).GetPrim().RemoveAPI(UsdPhysics.CollisionAPI)
    for path, faces in (("/set/flat", 1), ("/set/open", 5)):
        mesh = UsdGeom.Mesh(file.stage.GetPrimAtPath(path))
        mesh.GetFaceVertexCountsAttr().Set([4] * faces)
        mesh.GetFaceVertexIndicesAttr().Set(list(mesh.GetFaceVertexIndicesAttr().Get())[: 4 * faces])
        UsdGeom.Xformable(mesh).GetOrderedXformOps()[0].Set(Gf.Vec3d(50, 50, 50))
    UsdGeom.Xformable(file.stage.GetPrimAtPath("/set/open")).AddTranslateOp().Set((20, 20, 0))
    UsdGeom.Imageable(file.prim("/set/hidden", "Sphere")).MakeInvisible()
    door = UsdGeom.Xformable(file.prim("/set/door", "Sphere", radius=1.0)).AddTranslateOp()
    door.Set((0, 500, 0), 0)
    door.Set((100, 500, 0), 24)
    scene = file.load(tmp_path)
    motions = {body.name: body.motion for body in scene.bodies}
    assert motions == {"bigFloor": "static", "crate": "dynamic", "flat": "static", "open": "dynamic", "door": "kinematic"}
    assert any("no physics" in line for line in scene.report) and any("convex hull" in line for line in scene.report)
    run = ri.simulate(scene, 0.5, 24)
    t = run.times
    assert np.abs(run.position("crate")[:, 1] - (2.05 - 9.81 * t**2 / 2)).max() < SINGLE


def test_a_file_that_has_changed_is_read_again(tmp_path: Path) -> None:
    """usd-core keeps layers that somebody has open: here the scene that was read before."""
    file = File()
    file.collider("/b", "Cube", size=1.0)
    first = file.load(tmp_path)
    file.stage.GetPrimAtPath("/b").GetAttribute("size").Set(3.0)
    assert file.load(tmp_path)["b"].shape.size[0] == 3.0 and first["b"].shape.size[0] == 1.0


def test_what_is_not_read_is_told(tmp_path: Path) -> None:
    file = File()
    file.body("/b")
    file.collider("/b/shape", "Cube")
    file.stage.GetPrimAtPath("/b").AddAppliedSchema("PhysxRigidBodyAPI")
    UsdPhysics.CollisionAPI(file.collider("/b/off", "Sphere")).CreateCollisionEnabledAttr(False)
    file.joint("/off", "PhysicsFixedJoint", None, "/b", jointEnabled=False)
    file.stage.GetRootLayer().subLayerPaths.append("./gone.usda")
    report = "\n".join(file.load(tmp_path).report)
    for part in ("PhysxRigidBodyAPI of 1 prim", "/b/off is not enabled", "joint 'off'", "gone.usda"):
        assert part in report, part


def test_triggers(tmp_path: Path) -> None:
    """A collider with PhysxTriggerAPI reports and does not push."""
    file = File()
    file.collider("/gate", "Cube", size=1.0).AddAppliedSchema("PhysxTriggerAPI")
    file.body("/ball", at=(0, 0, 3))
    file.collider("/ball/shape", "Sphere", radius=0.25)
    run = ri.simulate(file.load(tmp_path), 1.5)
    begins = [event.time for event in run.status.events if event.kind == "overlap begins"]
    assert np.allclose(begins, np.sqrt(2 * (3 - 0.75) / 9.81), atol=1e-6) and not len(run.impacts)


def test_instances_have_bodies_of_their_own(tmp_path: Path) -> None:
    file = File()
    file.body("/proto/b")
    file.collider("/proto/b/shape", "Mesh")
    from pxr import Sdf

    file.stage.GetPrimAtPath("/proto").SetSpecifier(Sdf.SpecifierClass)
    for k in range(2):
        prim = file.prim(f"/i{k}", at=(5 * k, 0, 0))
        prim.GetReferences().AddInternalReference("/proto")
        prim.SetInstanceable(True)
    scene = file.load(tmp_path)
    assert scene.names == ("b", "/i1/b") and scene["b"].shape is scene["/i1/b"].shape
    assert np.allclose(scene["/i1/b"].position, (5, 0, 0))
    run = ri.simulate(scene, 0.2, 10)
    from test_usd_motion import off, opened

    stage = opened(run.export(tmp_path / "out.usda"))
    assert off(stage, "/i1/b", run, "/i1/b") < SINGLE and off(stage, "/i0/b", run, "b") < SINGLE


@pytest.mark.parametrize(("text", "match"), [
    ('#usda 1.0\ndef Cube "a" (prepend apiSchemas = ["PhysicsCollisionAPI"]) { double size = "x" }', "size|no readable"),
    ("#usda 1.0\ndef Xform \"a\" {", "no readable USD.*in.usda:2"), ("not a file", "no readable USD"), ("#usda 1.0\n", "no surface"),
])  # fmt: skip
def test_broken_files(tmp_path: Path, text: str, match: str) -> None:
    path = tmp_path / "in.usda"
    path.write_text(text)
    with pytest.raises(ri.SceneError, match=match):
        ri.load_scene(path)
    with pytest.raises(ri.SceneError, match="no such file"):
        ri.load_scene(tmp_path / "gone.usdc")


@pytest.mark.parametrize(("change", "match"), [
    (lambda file: file.stage.GetPrimAtPath("/b/shape").GetAttribute("size").Set(-1.0), "size"),
    (lambda file: file.prim("/b", scale=(1, 1, 0)), "flattens"),
    (lambda file: file.prim("/b", at=(np.nan, 0, 0)), "finite"),
    (lambda file: UsdGeom.Mesh(file.collider("/b/m", "Mesh")).GetFaceVertexIndicesAttr().Set([99] * 24), "beyond the points"),
    (lambda file: UsdGeom.SetStageMetersPerUnit(file.stage, 0.0), "metersPerUnit"),
])  # fmt: skip
def test_figures_that_make_no_sense(tmp_path: Path, change: object, match: str) -> None:
    file = File()
    file.body("/b")
    file.collider("/b/shape", "Cube")
    change(file)  # pyright: ignore[reportCallIssue]
    with pytest.raises(ri.SceneError, match=match):
        file.load(tmp_path)
