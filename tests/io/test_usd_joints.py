"""Joints of UsdPhysics against closed forms, and motion written over the file that a scene came from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri

pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from test_gltf_motion import recorded, smooth
from test_usd_motion import off, opened, world
from usd_files import File

SINGLE = 1e-6
HALF = np.sqrt(0.5)


def arm(**joint: object) -> File:
    """A ball of 10 cm on a hinge about Y, 50 cm above it, in a file of centimetres and Z up; it starts 5 degrees off."""
    file, angle = File(unit=0.01), np.radians(5.0)
    place = 50.0 * np.array([np.sin(angle), 0, -np.cos(angle)])
    file.body("/bob", at=place, turn=(np.cos(angle / 2), 0, -np.sin(angle / 2), 0))
    file.collider("/bob/shape", "Sphere", radius=10.0)
    file.joint("/hinge", "PhysicsRevoluteJoint", None, "/bob", axis="Y", localPos1=Gf.Vec3f(0, 0, 50), **joint)
    return file


def angle_of(run: ri.Recording) -> np.ndarray:
    """Angle of the bob from the vertical, towards x."""
    x = run.position("bob")
    return np.arctan2(x[:, 0], -x[:, 2])


def test_a_pendulum_swings_with_its_period(tmp_path: Path) -> None:
    """T = 2 pi sqrt((l^2 + 2 r^2 / 5) / (g l)) (1 + a^2 / 16 + 11 a^4 / 3072); after half of it the bob is on the other side.

    A quarter period later it passes the vertical, where a period that is off by 1 % shows as 6 % of the swing and more; joints are of
    second order, 2e-3 of the swing at steps of 1/60 s.
    """
    length, r, a = 0.5, 0.1, np.radians(5.0)
    period = 2 * np.pi * np.sqrt((length**2 + 0.4 * r**2) / (9.81 * length)) * (1 + a**2 / 16 + 11 * a**4 / 3072)
    run = ri.simulate(arm().load(tmp_path), 1.25 * period, fps=1 / (period / 40))
    angle = angle_of(run)
    assert abs(angle[20] + a) < 1e-4 * a and np.abs(angle[[10, 30, 50]]).max() < 4e-3 * a and abs(angle[40] - a) < 1e-4 * a


def test_limits_in_degrees(tmp_path: Path) -> None:
    """The bob swings about Y: to x is a negative turn. A lower limit of 0 lets it hang, an upper of 2 degrees stops it there."""
    run = ri.simulate(arm(lowerLimit=-10.0, upperLimit=2.0).load(tmp_path), 1.0, 60)
    assert abs(angle_of(run).min() + np.radians(2.0)) < 1e-4


def test_drives_in_degrees(tmp_path: Path) -> None:
    """A drive with stiffness k a degree and target 30 degrees holds the bob where m g l sin(angle) = k (target - turn).

    Files of centimetres have torques of kg cm^2/s^2. Without the factor of 180 / pi the bob hangs 57 times as low.
    """
    file = arm()
    drive = UsdPhysics.DriveAPI.Apply(file.stage.GetPrimAtPath("/hinge"), "angular")
    drive.CreateStiffnessAttr(3e4)
    drive.CreateDampingAttr(6e3)
    drive.CreateTargetPositionAttr(30.0)
    run = ri.simulate(file.load(tmp_path), 6.0, 10)
    turn = -angle_of(run)[-1]
    mass, stiffness = 4 / 3 * np.pi * 0.1**3 * 1000, 3e4 * 1e-4 * 180 / np.pi
    assert abs(mass * 9.81 * 0.5 * np.sin(turn) - stiffness * (np.pi / 6 - turn)) < 1e-3 * stiffness
    assert 0.3 < turn < 0.52


def test_each_kind_of_joint(tmp_path: Path) -> None:
    """What may move moves, the rest stays: two balls, the first held, the second pulled by gravity along x and z."""
    free = {
        "PhysicsFixedJoint": {}, "PhysicsPrismaticJoint": {"axis": "X"}, "PhysicsSphericalJoint": {"axis": "Z"},
        "PhysicsDistanceJoint": {"maxDistance": 1.5},
    }  # fmt: skip
    ends = {}
    for kind, values in free.items():
        file = File()
        file.scene.CreateGravityDirectionAttr((1, 0, -1))
        file.scene.CreateGravityMagnitudeAttr(2.0)
        file.body("/a", at=(0, 0, 3))
        UsdPhysics.RigidBodyAPI(file.stage.GetPrimAtPath("/a")).CreateKinematicEnabledAttr(True)
        file.body("/b", at=(0, 0, 2))
        for name in "ab":
            file.collider(f"/{name}/shape", "Sphere", radius=0.1)
        file.joint("/joint", kind, "/a", "/b", localPos1=Gf.Vec3f(0, 0, 0 if kind == "PhysicsDistanceJoint" else 1), **values)
        run = ri.simulate(file.load(tmp_path), 1.0, 60)
        ends[kind] = run.position("b") - run.position("a")
    assert np.abs(ends["PhysicsFixedJoint"] - [0, 0, -1]).max() < 1e-6
    assert np.abs(ends["PhysicsPrismaticJoint"][-1] - [np.sqrt(2) / 2, 0, -1]).max() < 1e-3
    swung = np.linalg.norm(ends["PhysicsSphericalJoint"], axis=1)
    assert np.abs(swung - 1).max() < 1e-6 and ends["PhysicsSphericalJoint"][-1, 0] > 0.4
    rope = np.linalg.norm(ends["PhysicsDistanceJoint"], axis=1)
    assert 1.49 < rope.max() < 1.5 + 1e-6


def test_six_axes(tmp_path: Path) -> None:
    """Low above high locks, an axis without a limit is free, a range bounds; degrees for turns; two even turns are a cone."""
    file = File(unit=0.01)
    file.body("/b")
    file.collider("/b/shape", "Cube", size=10.0)
    prim = file.joint("/six", "PhysicsJoint", None, "/b", breakForce=500.0)
    for axis, low, high in (("transX", 1, -1), ("transY", -20, 30), ("rotX", 1, -1), ("rotY", -45, 45), ("rotZ", -45, 45)):
        limit = UsdPhysics.LimitAPI.Apply(prim, axis)
        limit.CreateLowAttr(low)
        limit.CreateHighAttr(high)
    drive = UsdPhysics.DriveAPI.Apply(prim, "transZ")
    drive.CreateDampingAttr(7.0)
    drive.CreateTargetVelocityAttr(50.0)
    drive.CreateMaxForceAttr(200.0)
    (joint,) = file.load(tmp_path).effects
    by_axes = {limit.translation or limit.rotation.upper(): (limit.lower, limit.upper) for limit in joint.limits}
    assert by_axes["x"] == (0, 0) and by_axes["X"] == (0, 0) and np.allclose(by_axes["y"], (-0.2, 0.3))
    assert np.allclose(by_axes["YZ"], (0, np.pi / 4)) and len(by_axes) == 4 and abs(joint.break_force - 5) < 1e-9
    (drive,) = joint.drives
    assert (drive.translation, drive.damping) == ("z", 7.0) and np.allclose((drive.velocity, drive.max_force), (0.5, 2.0))


def test_motion_over_the_file(tmp_path: Path) -> None:
    """Parents that are moved, turned and scaled, evenly and not, a body below a body that moves; materials and units stay.

    The file lies below the new layer, its frames begin where those of the run begin, and a thing that no body moves stays animated.
    """
    file = File("Z", unit=0.01)
    file.stage.SetTimeCodesPerSecond(24)
    file.stage.SetStartTimeCode(1001)
    file.stage.SetEndTimeCode(1010)
    file.stage.SetDefaultPrim(file.prim("/room", at=(100, 200, 300), turn=(HALF, 0, 0, HALF), scale=(2, 2, 2)))
    file.body("/room/crate", at=(1, 2, 3), scale=(0.5, 1, 2))
    file.body("/room/crate/rider", at=(0, 0, 50))
    UsdGeom.Xformable(file.stage.GetPrimAtPath("/room/crate/rider")).SetResetXformStack(True)
    file.prim("/squash", scale=(1, 1, 3))
    file.body("/squash/can", at=(0, 0, 50), turn=(HALF, HALF, 0, 0))
    for path in ("/room/crate", "/room/crate/rider", "/squash/can"):
        file.collider(f"{path}/shape", "Cube", size=10.0)
    UsdGeom.Xformable(file.prim("/lamp")).AddTranslateOp().Set((24, 0, 0), 1002)
    UsdGeom.Xformable(file.stage.GetPrimAtPath("/lamp")).GetOrderedXformOps()[0].Set((0, 0, 0), 1001)
    (tmp_path / "sub").mkdir()
    scene = ri.load_scene(file.save(tmp_path / "in.usdc"))
    before = {name: np.array(UsdGeom.XformCache(1001).GetLocalToWorldTransform(file.stage.GetPrimAtPath(path))).T
              for name, path in (("crate", "/room/crate"), ("rider", "/room/crate/rider"), ("can", "/squash/can"))}  # fmt: skip
    scene.add(ri.Body("guest", ri.Shape.sphere(0.1), position=(1, 1, 1)))
    run = recorded(scene, {body.name: smooth(10, body.position, 1.0 + k) for k, body in enumerate(scene.bodies)}, fps=48.0)
    stage = opened(run.export(tmp_path / "sub" / "out.usda", start_frame=500))
    assert stage.GetRootLayer().subLayerPaths[0] == "../in.usdc"
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Z", 0.01)
    assert stage.GetDefaultPrim().GetPath() == Sdf.Path("/room") and stage.GetTimeCodesPerSecond() == 48.0
    from test_gltf_motion import turned

    for name, path in (("crate", "/room/crate"), ("rider", "/room/crate/rider"), ("can", "/squash/can")):
        stretch = turned(scene[name].unit_orientation()).T @ before[name][:3, :3]
        assert off(stage, path, run, name, 500, stretch) < 3 * SINGLE, name
    assert off(stage, "/rigidimpulse/guest", run, "guest", 500, 100.0) < 100 * SINGLE
    lamp = UsdGeom.Xformable(stage.GetPrimAtPath("/lamp")).GetOrderedXformOps()[0]
    assert lamp.GetTimeSamples() == [500.0, 502.0]
    # The file itself is as it was.
    assert not UsdGeom.Xformable(Usd.Stage.Open(str(tmp_path / "in.usdc")).GetPrimAtPath("/room/crate")).GetTimeSamples()


def test_what_does_not_move_is_left_alone(tmp_path: Path) -> None:
    file = File()
    file.body("/a")
    file.body("/b", at=(5, 0, 0))
    for name in "ab":
        file.collider(f"/{name}/shape", "Cube")
    scene = file.load(tmp_path)
    run = recorded(scene, {"a": smooth(3, (0, 0, 0))})
    stage = opened(run.export(tmp_path / "out.usda"))
    assert not stage.GetRootLayer().GetPrimAtPath("/b") and stage.GetRootLayer().GetPrimAtPath("/a")
    assert np.allclose(world(stage, "/b", 2)[:3, 3], (5, 0, 0))
    assert ri.load_scene(tmp_path / "out.usda").names == ("a", "b")
    # The file that the new one refers to is not written over.
    with pytest.raises(ri.SceneError, match="comes from"):
        run.export(tmp_path / "in.usda")
    assert ri.load_scene(tmp_path / "in.usda").names == ("a", "b")
    # A package has both.
    stage = opened(run.export(tmp_path / "out.usdz"))
    assert np.allclose(world(stage, "/b", 2)[:3, 3], (5, 0, 0)) and off(stage, "/a", run, "a") < SINGLE


def test_on_the_command_line(tmp_path: Path) -> None:
    """A file in, a file out, from frame 1001 on, with two samples a frame; what is not read is printed."""
    from click.testing import CliRunner

    from rigidimpulse.cli.cli import main

    file = File("Y", unit=0.01)
    file.body("/ball", at=(0, 100, 0)).AddAppliedSchema("PhysxRigidBodyAPI")
    file.collider("/ball/shape", "Sphere", radius=10.0)
    file.save(tmp_path / "in.usda")
    words = ["simulate", str(tmp_path / "in.usda"), "-o", str(tmp_path / "out.usdc"), "-o", str(tmp_path / "out.csv")]
    more = ["--fps", "24", "--duration", "0.5", "--start-frame", "1001", "--samples", "2"]
    result = CliRunner().invoke(main, words + more)
    assert result.exit_code == 0 and "PhysxRigidBodyAPI of 1 prim is not read" in result.stderr, result.output
    stage = opened(tmp_path / "out.usdc")
    codes = UsdGeom.Xformable(stage.GetPrimAtPath("/ball")).GetTimeSamples()
    assert codes == [1001 + k / 2 for k in range(25)]
    heights = [world(stage, "/ball", code)[1, 3] for code in codes]
    t = np.arange(25) / 48
    assert np.abs(heights - (1 - 9.81 * t**2 / 2)).max() < SINGLE
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 14


def test_a_joint_to_a_prim_that_is_not_there_is_told(tmp_path: Path) -> None:
    """The side without a prim counted as the world without a word."""
    file = File()
    file.body("/a")
    file.collider("/a/shape", "Cube", size=1.0)
    file.joint("/hinge", "PhysicsRevoluteJoint", "/a", "/nowhere")
    assert [line for line in file.load(tmp_path).report if "'hinge'" in line and "/nowhere" in line]
