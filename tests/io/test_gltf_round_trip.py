"""A scene written with its physics comes back equal, compiled figure for compiled figure.

JSON holds doubles: figures come back to round-off, 1e-14 of a scene of some metres, inertia to 1e-12 through its principal
axes. Vertices of meshes have single precision, so those of the test are numbers that single precision holds.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from gltf_files import unpack
from player import check_structure

import rigidimpulse as ri
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.model.world import World
from rigidimpulse.scene.material import combine, combine_rolling

TURN = np.array([0.8, 0.1, -0.3, 0.5]) / np.linalg.norm([0.8, 0.1, -0.3, 0.5])
PARTS = [
    (ri.Shape.box(1.0), (0, 0, 1), TURN),
    (ri.Shape.cylinder(0.2, 0.5), (1, 0, 0), TURN),
    (ri.Shape.capsule(0.2, 0.5), (1, 2, 0), (1, 0, 0, 0)),
]
FIGURES = ("mass", "inertia", "offset", "position", "velocity", "angular_velocity", "gravity", "size", "bound_radius", "coefficients")
EQUAL = ("dynamic", "moving", "material_of_body", "apart", "half_space", "ball")


def bodies() -> list[ri.Body]:
    """Bodies of all shapes and motions."""
    points = np.random.default_rng(1).normal(size=(20, 3)).astype(np.float32)
    grip = ri.Material(density=500, restitution=0.3, static_friction=0.5, dynamic_friction=0.4, restitution_combine="maximum")
    roll = ri.Material(restitution=0.2, rolling_friction=0.01, tangential_restitution=0.5, friction_combine="minimum")
    first, second = ri.CollisionFilter(["a"], ["a", "b"]), ri.CollisionFilter(["b"], None, ["b"])
    keys = ri.Keyframes([0, 0.5, 1], [(25, 5, 0), (26, 5, 0), (26, 6, 1)], [(1, 0, 0, 0), TURN, (0, 1, 0, 0)])
    tensor = np.diag([1.0, 2.0, 2.5]) + 0.1
    return [
        ri.Body("floor", ri.Shape.half_space((0, 1, 0)), motion="static"),
        ri.Body("ramp", ri.Shape.half_space((0.1, 1, 0.3), -2), motion="static", orientation=TURN, position=(1, 2, 3)),
        ri.Body("ball", ri.Shape.sphere(0.3), position=(0, 5, 0), velocity=(1, 2, 3), angular_velocity=(3, 2, 1), orientation=TURN,
                material=grip, collision_filter=first),
        ri.Body("box", ri.Shape.box((0.3, 0.4, 0.5)), position=(3, 5, 0), orientation=TURN, material=grip, mass=7, inertia=(1, 1.2, 1.5),
                center_of_mass=(0.1, 0.05, -0.1), collision_filter=second),
        ri.Body("capsule", ri.Shape.capsule(0.1, 0.4), position=(5, 5, 0), orientation=TURN, gravity_factor=0.5, material=roll),
        ri.Body("cylinder", ri.Shape.cylinder(0.1, 0.4), position=(7, 5, 0), angular_velocity=(0, 9, 0)),
        ri.Body("hull", ri.Shape.convex_hull(points), position=(10, 5, 0), inertia=tensor),
        ri.Body("compound", ri.Shape.compound(PARTS), position=(15, 5, 0)),
        ri.Body("stairs", ri.Shape.compound(PARTS), position=(30, 0, 0), motion="static"),
        ri.Body("lift", ri.Shape.box(0.5), motion="kinematic", position=(20, 5, 0), velocity=(1, 0, 0), angular_velocity=(0, 0, 2),
                orientation=TURN),
        ri.Body("door", ri.Shape.box(0.5), motion="kinematic", position=(25, 5, 0), keyframes=keys),
    ]  # fmt: skip


def joints() -> list:
    """Joints of all classes."""
    limits = [ri.Limit("xy", lower=0, upper=1.0), ri.Limit(rotation="xyz", upper=1.0, stiffness=5.0, damping=0.1), ri.Limit("z", lower=-1)]
    return [
        ri.BallJoint("ball", "box", (1, 5, 0), upper=0.5, name="shoulder", collide=True),
        ri.HingeJoint("capsule", None, (5, 5, 0), (0, 1, 1), lower=-1, upper=1, motor=ri.Motor(2.0, damping=3.0, max_force=5.0)),
        ri.SliderJoint("cylinder", "hull", (8, 5, 0), (1, 1, 0), lower=0, upper=0.2,
                       motor=ri.Motor(target=0.1, stiffness=2.0, mode="acceleration")),
        ri.FixedJoint("compound", "hull", stiffness=1e4, damping=10.0),
        ri.DistanceJoint(None, "compound", (15, 9, 0), (15, 6, 0)),
        ri.DistanceJoint("hull", "cylinder", (10, 6, 0), (7, 6, 0), upper=4.0),
        ri.SixAxisJoint("lift", "cylinder", anchor=(18, 5, 0), axes=[(0, 1, 0), (-1, 0, 0), (0, 0, 1)], anchor_b=(17, 5, 0), limits=limits,
                        drives=[ri.Drive(1.0, damping=2.0, translation="z")]),
    ]  # fmt: skip


def check_equal(first: World, second: World) -> None:
    """Assert that two compiled scenes are the same."""
    assert first.names == second.names
    for name in EQUAL:
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
    for name in FIGURES:
        wanted, found = getattr(first, name), getattr(second, name)
        fine = np.isfinite(wanted)
        assert np.array_equal(fine, np.isfinite(found)) and np.allclose(wanted[fine], found[fine], rtol=1e-12, atol=1e-14), name


def test_bodies_come_back(tmp_path: Path) -> None:
    scene = ri.Scene(gravity=(0, -3.7, 0), bodies=bodies())
    back = ri.load_scene(scene.export(tmp_path / "scene.glb"))
    first, second = compile_scene(scene), compile_scene(back)
    check_equal(first, second)
    assert first.rolling is not None and second.rolling is not None and np.array_equal(first.rolling, second.rolling)
    for one in scene.bodies:
        two = back[one.name]
        assert one.motion == two.motion and one.collision_filter == two.collision_filter
        # The materials are the same, stated or not: they combine alike with any other.
        for other in (ri.Material(), ri.Material(restitution=0.9, static_friction=0.1)):
            assert combine(one.material, other) == combine(two.material, other)
            assert combine_rolling(one.material, other) == combine_rolling(two.material, other)
        for a, b in zip(one.shape.parts_flat(), two.shape.parts_flat(), strict=True):
            assert a.shape.kind == b.shape.kind and (a.shape.radius, a.shape.height) == (b.shape.radius, b.shape.height)
    keys = back["door"].keyframes
    assert keys is not None and scene["door"].keyframes is not None
    for one, two in zip(scene["door"].keyframes.arrays(), keys.arrays(), strict=True):
        assert np.allclose(one, two, rtol=0, atol=2e-6)


def test_planes_come_back(tmp_path: Path) -> None:
    scene = ri.Scene(bodies=bodies(), gravity=(0, -1, 0))
    back = ri.load_scene(scene.export(tmp_path / "scene.glb"))
    for name in ("floor", "ramp"):
        (normal, offset), (found, distance) = scene[name].shape.plane(), back[name].shape.plane()
        assert np.allclose(normal, found, rtol=0, atol=1e-15) and distance == pytest.approx(offset, abs=1e-14)


def test_joints_come_back(tmp_path: Path) -> None:
    """Compiled joints agree row for row: coordinates, targets, bounds, springs, drives, anchors and frames."""
    scene = ri.Scene(gravity=(0, -9.81, 0), bodies=bodies())
    for joint in joints():
        scene.add(joint)
    back = ri.load_scene(scene.export(tmp_path / "scene.gltf"))
    first, second = compile_scene(scene), compile_scene(back)
    assert np.array_equal(first.apart, second.apart) and len(first.apart)
    for name in first.joints._fields:
        wanted, found = np.asarray(getattr(first.joints, name), float), np.asarray(getattr(second.joints, name), float)
        assert np.array_equal(np.isfinite(wanted), np.isfinite(found)), name
        fine = np.isfinite(wanted)
        assert np.allclose(wanted[fine], found[fine], rtol=0, atol=1e-13), name


def test_triggers_come_back(tmp_path: Path) -> None:
    scene = ri.Scene(gravity=(0, -9.81, 0), bodies=bodies())
    only = ri.CollisionFilter(["a"])
    scene.add(ri.Trigger("eye", ri.Shape.box(1.0), body="lift", position=(0, 1, 0), orientation=TURN, collision_filter=only))
    scene.add(ri.Trigger("gate", ri.Shape.compound(PARTS), position=(0, 3, 0)))
    eye, gate = ri.load_scene(scene.export(tmp_path / "scene.glb")).effects
    assert (eye.name, eye.body, eye.collision_filter) == ("eye", "lift", only)
    assert np.allclose(eye.position, (0, 1, 0), atol=1e-14) and np.allclose(eye.orientation, TURN, atol=1e-15)
    assert (gate.name, gate.body) == ("gate", None)
    assert [part.shape.kind for part in gate.shape.parts_flat()] == ["box", "cylinder", "capsule"]


def test_z_up_comes_back_y_up(tmp_path: Path) -> None:
    """(x, y, z) comes back as (x, z, -y): places, velocities and gravity."""
    scene = ri.Scene(gravity=(0, 0, -2.0), bodies=[ri.Body("a", ri.Shape.box((1, 2, 3)), position=(1, 2, 3), velocity=(4, 5, 6))])
    back = ri.load_scene(scene.export(tmp_path / "scene.glb"))
    assert np.allclose(back.gravity, (0, -2, 0), atol=1e-15) and np.allclose(back["a"].position, (1, 3, -2), atol=1e-15)
    assert np.allclose(back["a"].velocity, (4, 6, -5), atol=1e-14)


def test_what_cannot_be_said_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    scene = ri.Scene(gravity=(0, -1, 0), bodies=bodies())
    scene.add(ri.Drag(0.1))
    scene.add(ri.BallJoint("ball", "box", (1, 5, 0), break_force=10.0))
    with caplog.at_level(logging.WARNING):
        back = ri.load_scene(scene.export(tmp_path / "scene.glb"))
    for word in ("Drag", "break_force", "rolling_friction"):
        assert word in caplog.text and any(word in line for line in back.report)
    with pytest.raises(ri.SceneError, match="cannot write a scene"):
        scene.export(tmp_path / "scene.obj")


def test_the_file_is_sound(tmp_path: Path) -> None:
    scene = ri.Scene(gravity=(0, 0, -9.81), bodies=bodies())
    for joint in joints():
        scene.add(joint)
    tree, data = unpack(scene.export(tmp_path / "scene.glb"))
    check_structure(tree, data)
    lists = tree["extensions"]["KHR_physics_rigid_bodies"]
    for node in tree["nodes"]:
        parts = node.get("extensions", {}).get("KHR_physics_rigid_bodies", {})
        collider = parts.get("collider", {"physicsMaterial": 0, "geometry": {"shape": 0}})
        assert collider["physicsMaterial"] < len(lists["physicsMaterials"])
        assert collider["geometry"].get("shape", 0) < len(tree["extensions"]["KHR_implicit_shapes"]["shapes"])
        joint = parts.get("joint", {"joint": 0, "connectedNode": 0})
        assert joint["joint"] < len(lists["physicsJoints"]) and joint["connectedNode"] < len(tree["nodes"])
    # Equal materials are one.
    assert len(lists["physicsMaterials"]) == 3
