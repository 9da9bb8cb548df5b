"""Scenes from glTF files: what is in the file is in the scene. Figures are exact, up to single precision in meshes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from gltf_files import BALL, BOX, CUBE, CUBE_FACES, Gltf, physics, shaped, with_physics

import rigidimpulse as ri
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.scene.mass import body_mass

TURN = [0.0, 0.0, 0.6, 0.8]
"""Rotation (x, y, z, w) about Z by 2 atan(3/4)."""
COS, SIN = 0.28, 0.96


def load(file: Gltf, tmp_path: Path, **settings) -> ri.Scene:
    return ri.load_scene(file.save(tmp_path / "scene.glb"), **settings)


def one(shape: dict, tmp_path: Path, **node) -> ri.Shape:
    """Shape of a static body with an implicit shape."""
    return load(with_physics([{"name": "it", "extensions": physics(None, shaped()), **node}], [shape]), tmp_path)["it"].shape


def extent(shape: ri.Shape) -> np.ndarray:
    """Sides of the box about the corners of all meshes of a shape."""
    points = np.concatenate([part.position + part.shape.surface().vertices @ part.rotation.T for part in shape.parts_flat()])
    return np.ptp(points, axis=0)


def test_names_gravity_and_frames(tmp_path: Path) -> None:
    nodes = [
        {"name": "arm", "rotation": TURN, "translation": [1, 2, 3], "children": [1]},
        {"translation": [10, 0, 0], "extensions": physics({"mass": 2}, shaped())},
        {"name": "arm", "extensions": physics(None, shaped())},
    ]
    scene = load(with_physics(nodes, [BOX]), tmp_path)
    assert scene.names == ("node1", "arm (node 2)")
    assert tuple(scene.gravity) == (0.0, -9.81, 0.0)
    body = scene["node1"]
    # x = (1, 2, 3) + R (10, 0, 0); quaternions are (w, x, y, z) on our side.
    assert np.allclose(body.position, [1 + 10 * COS, 2 + 10 * SIN, 3], rtol=0, atol=1e-14)
    assert np.allclose(body.orientation, [0.8, 0, 0, 0.6], rtol=0, atol=1e-15)
    assert body.motion == "dynamic" and body.mass == 2.0 and scene["arm (node 2)"].motion == "static"
    assert tuple(load(with_physics(nodes, [BOX]), tmp_path, gravity=(0, 0, -1)).gravity) == (0, 0, -1)


def test_exact_shapes(tmp_path: Path) -> None:
    box = one({"type": "box", "box": {"size": [1, 2, 3]}}, tmp_path, scale=[2, -1, 0.5])
    assert box.kind == "box" and np.array_equal(box.size, [2, 2, 1.5])
    ball = one({"type": "sphere", "sphere": {"radius": 0.3}}, tmp_path, scale=[-2, 2, 2])
    assert ball.kind == "sphere" and ball.radius == 0.6
    straight = {"height": 1.0, "radiusTop": 0.2, "radiusBottom": 0.2}
    for kind, scale, radius, height in (("capsule", [2, 2, 2], 0.4, 2.0), ("cylinder", [2, 3, 2], 0.4, 3.0)):
        part = one({"type": kind, kind: straight}, tmp_path, scale=scale).parts_flat()[0]
        assert (part.shape.kind, part.shape.radius, part.shape.height) == (kind, radius, height)
        # It stands along Y: its own axis is z.
        assert np.allclose(part.rotation @ [0, 0, 1], [0, 1, 0], rtol=0, atol=1e-15)
    plane = one({"type": "plane", "plane": {}}, tmp_path, rotation=TURN)
    assert plane.kind == "half_space" and np.array_equal(plane.plane()[0], [0, 1, 0])
    quad = one({"type": "plane", "plane": {"sizeX": 4, "sizeZ": 6}}, tmp_path)
    assert np.array_equal(extent(quad), [4, 0, 6])


def test_defaults_of_implicit_shapes(tmp_path: Path) -> None:
    assert one({"type": "sphere"}, tmp_path).radius == 0.5
    assert np.array_equal(one({"type": "box"}, tmp_path).size, [1, 1, 1])
    part = one({"type": "capsule"}, tmp_path).parts_flat()[0].shape
    assert (part.radius, part.height) == (0.25, 0.5)


@pytest.mark.parametrize(("shape", "volume", "short"), [
    ({"type": "sphere", "sphere": {"radius": 1}}, 4 / 3 * math.pi * 2 * 1 * 0.5, 0.035),
    ({"type": "cylinder", "cylinder": {"height": 2, "radiusTop": 0, "radiusBottom": 1}}, math.pi * 2 / 3, 0.003),
    ({"type": "cylinder", "cylinder": {"height": 2, "radiusTop": 1, "radiusBottom": 1}}, math.pi * 2, 0.003),
])  # fmt: skip
def test_hulls_stand_for_other_shapes(shape: dict, volume: float, short: float, tmp_path: Path) -> None:
    """Their points lie on the surface: 162 on a sphere lose 3.4 % of its volume, rims of 48 lose 0.3 %."""
    node = {"name": "it", "scale": [2, 1, 0.5], "extensions": physics(None, shaped())}
    scene = load(with_physics([node], [shape]), tmp_path)
    assert 1 - short < scene["it"].shape.solid().volume / volume < 1.0
    assert any("'it'" in line and "convex hull" in line for line in scene.report)


def test_tapered_capsule_is_a_hull_about_both_spheres(tmp_path: Path) -> None:
    shape = {"type": "capsule", "capsule": {"height": 1, "radiusTop": 0.1, "radiusBottom": 0.4}}
    hull = one(shape, tmp_path)
    assert hull.kind == "mesh" and np.allclose(extent(hull)[1], 1 + 0.5, atol=0.02) and extent(hull)[0] == pytest.approx(0.8, abs=0.02)
    # The wide end is below.
    assert hull.solid().centroid[1] < -0.15


def test_shear_is_exact(tmp_path: Path) -> None:
    nodes = [
        {"name": "up", "scale": [1, 3, 1], "children": [1]},
        {"name": "it", "rotation": TURN, "extensions": physics(None, shaped())},
    ]
    body = load(with_physics(nodes, [BOX]), tmp_path)["it"]
    placed = np.asarray(body.shape.surface().vertices) @ np.array([[COS, SIN, 0], [-SIN, COS, 0], [0, 0, 1]])
    wanted = CUBE @ np.array([[COS, SIN, 0], [-SIN, COS, 0], [0, 0, 1]]) * [1, 3, 1]
    assert np.allclose(np.sort(placed.round(12), axis=0), np.sort(wanted.round(12), axis=0), rtol=0, atol=1e-12)


def test_mesh_and_hull(tmp_path: Path) -> None:
    """Mirrored and twice as large a dented cube has 8 times its volume, and not minus that; its hull has no dent."""
    keep = CUBE.copy()
    keep[7] = -0.25
    notch = {"name": "it", "scale": [-2, 2, 2], "extensions": physics({"mass": 1}, {"geometry": {"node": 0}}), "mesh": 0}
    hull = {"name": "hull", "extensions": physics(None, {"geometry": {"node": 0, "convexHull": True}})}
    file = with_physics([notch, hull], [])
    file.mesh(keep, CUBE_FACES)
    scene = load(file, tmp_path)
    exact = ri.Shape.mesh(keep, CUBE_FACES).solid().volume
    # Single precision holds these vertices exactly.
    assert scene["it"].shape.solid().volume == pytest.approx(8 * exact, rel=1e-12)
    assert scene["hull"].shape.solid().volume > exact * 1.01


def test_compound_of_descendants(tmp_path: Path) -> None:
    nodes = [
        {"name": "car", "extensions": physics({"mass": 3}), "children": [1, 3], "scale": [2, 2, 2], "translation": [5, 0, 0]},
        {"name": "axle", "children": [2], "translation": [0, -1, 0]},
        {"name": "wheel", "extensions": physics(None, shaped(1)), "translation": [1, 0, 0]},
        {"name": "other", "extensions": physics({"mass": 1}, shaped(0))},
    ]
    scene = load(with_physics(nodes, [BOX, BALL]), tmp_path)
    assert scene.names == ("car", "other")
    part = scene["car"].shape.parts_flat()[0]
    assert part.shape.radius == 1.0 and np.array_equal(part.position, [2, -2, 0])


def test_materials(tmp_path: Path) -> None:
    rules = {"frictionCombine": "maximum", "restitutionCombine": "multiply"}
    materials = [
        {"staticFriction": 0.9, "dynamicFriction": 0.3, "restitution": 0.25, **rules},
        {"staticFriction": 0.2, "dynamicFriction": 0.5, "restitution": 1.5},
        {},
    ]
    nodes = [{"name": f"b{k}", "extensions": physics(None, shaped(physicsMaterial=k))} for k in range(3)]
    nodes.append({"name": "bare", "extensions": physics(None, shaped())})
    scene = load(with_physics(nodes, [BOX], physicsMaterials=materials), tmp_path)
    first, second = scene["b0"].material, scene["b1"].material
    assert (first.static_friction, first.dynamic_friction, first.restitution) == (0.9, 0.3, 0.25)
    assert (first.friction_combine, first.restitution_combine) == ("maximum", "multiply")
    assert (second.static_friction, second.restitution, second.any_restitution) == (0.5, 1.5, True)
    assert sum("material 1" in line for line in scene.report) == 2
    for name in ("b2", "bare"):
        material = scene[name].material
        assert (material.static_friction, material.dynamic_friction, material.restitution) == (0.6, 0.6, 0.0)


def test_motion_in_node_space(tmp_path: Path) -> None:
    motion = {
        "mass": 2, "linearVelocity": [1, 0, 0], "angularVelocity": [0, 2, 0], "gravityFactor": -0.5, "centerOfMass": [0.1, 0, 0],
        "inertiaDiagonal": [1, 2, 2.5], "inertiaOrientation": TURN,
    }  # fmt: skip
    node = {"name": "it", "rotation": TURN, "scale": [2, 2, 2], "extensions": physics(motion, shaped())}
    body = load(with_physics([node], [BOX]), tmp_path)["it"]
    assert np.allclose(body.velocity, [COS, SIN, 0], rtol=0, atol=1e-15)
    assert np.allclose(body.angular_velocity, [-2 * SIN, 2 * COS, 0], rtol=0, atol=1e-15)
    assert body.gravity_factor == -0.5 and np.allclose(body.center_of_mass, [0.2, 0, 0], rtol=0, atol=1e-15)
    turn = np.array([[COS, -SIN, 0], [SIN, COS, 0], [0, 0, 1]])
    assert np.allclose(body.inertia, turn @ np.diag([1, 2, 2.5]) @ turn.T, rtol=0, atol=1e-14)


def test_kinematic_and_missing_masses(tmp_path: Path) -> None:
    nodes = [
        {"name": "lift", "extensions": physics({"isKinematic": True, "linearVelocity": [0, 1, 0]}, shaped())},
        {"name": "free", "extensions": physics({}, shaped(1))},
    ]
    scene = load(with_physics(nodes, [BOX, BALL]), tmp_path)
    assert scene["lift"].motion == "kinematic" and np.array_equal(scene["lift"].velocity, [0, 1, 0])
    assert body_mass(scene["free"]).mass == pytest.approx(1000 * 4 / 3 * math.pi / 8, rel=1e-15)


def test_infinite_masses(tmp_path: Path) -> None:
    nodes = [
        {"name": "rail", "extensions": physics({"mass": 0, "linearVelocity": [3, 0, 0]}, shaped())},
        {"name": "wheel", "extensions": physics({"mass": 0, "inertiaDiagonal": [0, 1, 0]}, shaped())},
        {"name": "block", "extensions": physics({"mass": 1, "inertiaDiagonal": [0, 0, 0]}, shaped())},
    ]
    scene = load(with_physics(nodes, [BOX]), tmp_path)
    assert scene["rail"].motion == "kinematic" and np.array_equal(scene["rail"].velocity, [3, 0, 0])
    joints = {joint.b: joint for joint in scene.effects}
    rows = {name: compile_scene(ri.Scene(bodies=[scene[name]]), "standard") for name in ("wheel", "block")}
    assert set(joints) == {"wheel", "block"} and rows["wheel"].gravity[0].tolist() == [0, 0, 0]
    assert [limit.translation or limit.rotation for limit in joints["wheel"].limits] == ["xyz", "xz"]
    assert [limit.rotation for limit in joints["block"].limits] == ["xyz"]


def test_filters(tmp_path: Path) -> None:
    """A pair collides where each side accepts the other; of the six pairs of four filters, by hand:"""
    filters = [
        {"collisionSystems": ["a"], "collideWithSystems": ["a", "b"]}, {"collisionSystems": ["b"]},
        {"collisionSystems": ["b"], "notCollideWithSystems": ["a"]}, {"collideWithSystems": ["b"]},
    ]  # fmt: skip
    nodes = [{"name": f"b{k}", "extensions": physics({"mass": 1}, shaped(collisionFilter=k))} for k in range(4)]
    world = compile_scene(load(with_physics(nodes, [BOX], collisionFilters=filters), tmp_path), "standard")
    a, b = np.triu_indices(4, 1)
    meet = {pair: bool(may) for pair, may in zip(zip(a.tolist(), b.tolist()), world.may_collide(a, b), strict=True)}
    # (0, 3): 3 is in no system, 0 asks for one. (1, 3): 3 asks for b, 1 is b and asks for none.
    assert meet == {(0, 1): True, (0, 2): False, (0, 3): False, (1, 2): True, (1, 3): True, (2, 3): True}


def test_filters_of_parts_are_welded_bodies(tmp_path: Path) -> None:
    filters = [{"collisionSystems": ["a"], "collideWithSystems": ["a"]}, {"collisionSystems": ["b"], "collideWithSystems": ["b"]}]
    nodes = [
        {"name": "it", "extensions": physics({"mass": 3, "linearVelocity": [0, 1, 0], "angularVelocity": [0, 0, 1]}), "children": [1, 2]},
        {"name": "left", "translation": [-2, 0, 0], "extensions": physics(None, shaped(0, collisionFilter=0))},
        {"name": "right", "translation": [1, 0, 0], "scale": [1, 2, 1], "extensions": physics(None, shaped(0, collisionFilter=1))},
    ]
    scene = load(with_physics(nodes, [BOX], collisionFilters=filters), tmp_path)
    assert scene.names == ("it", "it part 2") and scene["it"].mass == pytest.approx(1) and scene["it part 2"].mass == pytest.approx(2)
    # The whole turns about its centre of mass at the origin: v = (0, 1, 0) + w x c.
    assert np.allclose(scene["it"].velocity, [0, -1, 0]) and np.allclose(scene["it part 2"].velocity, [0, 2, 0])
    assert (scene.effects[0].a, scene.effects[0].b) == ("it", "it part 2")


def test_triggers(tmp_path: Path) -> None:
    nodes = [
        {"name": "car", "translation": [1, 0, 0], "extensions": physics({"mass": 1}, shaped()), "children": [1]},
        {"name": "eye", "translation": [0, 2, 0], "extensions": physics(trigger={"geometry": {"shape": 1}})},
        {"name": "gate", "extensions": physics(trigger={"nodes": [3, 4]}), "children": [3, 4]},
        {"name": "left", "translation": [-1, 0, 0], "extensions": physics(trigger={"geometry": {"shape": 0}})},
        {"name": "right", "translation": [1, 0, 0], "extensions": physics(trigger={"geometry": {"shape": 1}})},
    ]
    eye, gate = load(with_physics(nodes, [BOX, BALL]), tmp_path).effects
    assert (eye.name, eye.body, list(eye.position)) == ("eye", "car", [0, 2, 0]) and eye.shape.kind == "sphere"
    assert (gate.name, gate.body, [part.shape.kind for part in gate.shape.parts_flat()]) == ("gate", None, ["box", "sphere"])


def test_joint(tmp_path: Path) -> None:
    joints = [{
        "limits": [{"linearAxes": [2, 0], "min": 0, "max": 0}, {"linearAxes": [1], "min": -1, "max": 2, "stiffness": 5, "damping": 1},
                   {"angularAxes": [0], "max": 0.5}],
        "drives": [{"type": "linear", "mode": "acceleration", "axis": 1, "positionTarget": 1, "stiffness": 3, "maxForce": 9},
                   {"type": "angular", "mode": "force", "axis": 2, "velocityTarget": 1}],
    }]  # fmt: skip
    nodes = [
        {"name": "base", "extensions": physics(None, shaped()), "children": [1]},
        {"name": "hinge", "rotation": TURN, "translation": [0, 1, 0], "extensions": physics(joint={"connectedNode": 3, "joint": 0})},
        {"name": "lid", "translation": [0, 3, 0], "extensions": physics({"mass": 1}, shaped()), "children": [3]},
        {"name": "end", "translation": [0, -1, 0]},
    ]
    scene = load(with_physics(nodes, [BOX], physicsJoints=joints), tmp_path)
    (joint,) = scene.effects
    assert (joint.a, joint.b, joint.name, joint.collide) == ("base", "lid", "hinge", False)
    assert np.array_equal(joint.anchor, [0, 1, 0]) and np.array_equal(joint.anchor_b, [0, 2, 0])
    # Rows are the directions of the joint's x, y, z.
    assert np.allclose(joint.axes, [[COS, SIN, 0], [-SIN, COS, 0], [0, 0, 1]], rtol=0, atol=1e-15)
    locked, soft, twist = joint.limits
    assert (locked.translation, locked.lower, locked.upper) == ("xz", 0, 0)
    assert (soft.translation, soft.lower, soft.upper, soft.stiffness, soft.damping) == ("y", -1, 2, 5, 1)
    assert (twist.rotation, twist.lower, twist.upper) == ("x", None, 0.5)
    (drive,) = joint.drives  # the other one has no strength
    assert (drive.translation, drive.target, drive.stiffness, drive.max_force, drive.mode) == ("y", 1, 3, 9, "acceleration")
    assert any("no strength" in line for line in scene.report)
    assert compile_scene(scene, "standard").apart.tolist() == [1]


@pytest.mark.parametrize(("away", "collides"), [(0.5, False), (1.0, True)])
def test_bodies_that_touch_at_their_joint_do_not_collide(away: float, collides: bool, tmp_path: Path) -> None:
    """Two cubes, one on the other: a ball joint where their faces meet leaves no contact to speak of, one beside them does."""
    joints = [{"limits": [{"linearAxes": [0, 1, 2], "min": 0, "max": 0}]}]
    pin = physics(joint={"connectedNode": 3, "joint": 0, "enableCollision": True})
    nodes = [
        {"name": "low", "extensions": physics(None, shaped()), "children": [1]},
        {"name": "pin", "translation": [away, 0.5, 0], "extensions": pin},
        {"name": "high", "translation": [0, 1, 0], "extensions": physics({"mass": 1}, shaped()), "children": [3]},
        {"name": "end", "translation": [away, -0.5, 0]},
    ]
    scene = load(with_physics(nodes, [BOX], physicsJoints=joints), tmp_path)
    assert scene.effects[0].collide == collides
    assert any("touch at joint 'pin'" in line for line in scene.report) != collides


def test_animated_nodes_are_keyframes(tmp_path: Path) -> None:
    nodes = [
        {"name": "cart", "children": [1]},
        {"name": "block", "translation": [2, 0, 0], "extensions": physics(None, shaped())},
    ]
    file = with_physics(nodes, [BOX])
    file.animate(0, "translation", [0.5, 1.0], [[0, 0, 0], [3, 0, 0]])
    half = math.sqrt(0.5)
    file.animate(0, "rotation", [0.5, 1.5], [[0, 0, 0, 1], [0, 0, half, half]])
    body = load(file, tmp_path)["block"]
    assert body.motion == "kinematic" and body.keyframes is not None
    times, positions, orientations = body.keyframes.arrays()
    assert np.array_equal(body.position, positions[0])
    # x = p(t) + R(t) (2, 0, 0): on the way the block goes round the cart, which two keys alone would cut short.
    for t, x, angle in ((0.5, [2, 0, 0], 0.0), (1.5, [3, 2, 0], math.pi / 2)):
        k = int(np.argmin(np.abs(times - t)))
        assert np.allclose(positions[k], x, atol=1e-6)
        assert abs(orientations[k] @ [math.cos(angle / 2), 0, 0, math.sin(angle / 2)]) == pytest.approx(1, abs=1e-6)
    angle = math.pi / 2 * np.clip(times - 0.5, 0, 1)
    cart = 3 * np.clip(2 * (times - 0.5), 0, 1)
    assert np.allclose(positions[:, 0], cart + 2 * np.cos(angle), atol=1e-5) and len(times) > 50


@pytest.mark.parametrize("join", ["STEP", "CUBICSPLINE"])
def test_interpolations(join: str, tmp_path: Path) -> None:
    """STEP holds the first key until 1/60 s before the second; the cubic spline with no tangents is 3 s^2 - 2 s^3."""
    file = with_physics([{"name": "it", "extensions": physics(None, shaped())}], [BOX])
    keys = [[0, 0, 0], [4, 0, 0]] if join == "STEP" else [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [4, 0, 0], [0, 0, 0]]
    file.animate(0, "translation", [0, 1], keys, join)
    keyframes = load(file, tmp_path)["it"].keyframes
    assert keyframes is not None
    times, x = np.asarray(keyframes.times), np.asarray(keyframes.positions)[:, 0]
    wanted = 4 * np.clip((times - 1) * 60 + 1, 0, 1) if join == "STEP" else 4 * (3 * times**2 - 2 * times**3)
    assert np.allclose(x, wanted, atol=1e-5) and x.max() == 4


def test_skin_and_morph_at_rest(tmp_path: Path) -> None:
    """The bone lifts the cube by 5 m wherever its node is, and morphing widens it by half of 2 along x."""
    nodes = [
        {"name": "skinned", "mesh": 0, "skin": 0, "translation": [100, 0, 0], "extensions": physics(None, {"geometry": {"node": 0}})},
        {"name": "bone", "translation": [0, 5, 0]},
        {"name": "morphed", "mesh": 1, "extensions": physics(None, {"geometry": {"node": 2}})},
    ]
    file = with_physics(nodes, [])
    file.mesh()
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = file.accessor(np.zeros((8, 4)), "VEC4", np.uint8)
    attributes["WEIGHTS_0"] = file.accessor(np.tile([1.0, 0, 0, 0], (8, 1)), "VEC4")
    file.tree["skins"] = [{"joints": [1]}]
    file.mesh(targets=[{"POSITION": file.accessor(2 * CUBE * [1, 0, 0], "VEC3")}])
    file.tree["meshes"][1]["weights"] = [0.5]
    scene = load(file, tmp_path)
    # The body frame is that of its node: 100 m away from where the bone has the cube.
    assert np.allclose(scene["skinned"].shape.surface().vertices.mean(axis=0), [-100, 5, 0], atol=1e-4)
    assert np.allclose(extent(scene["morphed"].shape), [2, 1, 1], atol=1e-6)
    assert any("'skinned'" in line and "bones" in line for line in scene.report)


def test_plain_file(tmp_path: Path) -> None:
    nodes = [
        {"name": "Floor.001", "mesh": 0, "scale": [10, 0.1, 10]},
        {"name": "crate", "mesh": 0, "translation": [0, 2, 0], "extras": {"mass": 3, "friction": 0.2}, "children": [2]},
        {"name": "lid", "mesh": 0, "translation": [0, 1.5, 0], "extras": {"motion": "dynamic"}},
        {"name": "sail", "mesh": 1},
        {"name": "bowl", "mesh": 2},
        {"name": "camera"},
        {"name": "ghost", "mesh": 0, "extras": {"motion": "none"}},
        {"name": "ball", "mesh": 0, "extras": {"shape": "sphere"}},
        {"name": "lift", "mesh": 0},
    ]
    file = Gltf(nodes)
    file.mesh()
    file.mesh(CUBE[:4], [[0, 1, 2]])
    file.mesh(CUBE, CUBE_FACES[:-2])
    file.animate(8, "translation", [0, 1], [[0, 0, 0], [0, 1, 0]])
    scene = load(file, tmp_path)
    motions = {body.name: body.motion for body in scene.bodies}
    wanted = {"Floor.001": "static", "crate": "dynamic", "lid": "dynamic", "sail": "static", "bowl": "dynamic", "ball": "dynamic"}
    assert motions == {**wanted, "lift": "kinematic"}
    assert scene["crate"].mass == 3 and scene["crate"].material.static_friction == 0.2
    assert scene["bowl"].shape.solid().volume == pytest.approx(1) and scene["ball"].shape.radius == pytest.approx(math.sqrt(0.75))
    assert scene["lid"].shape is scene["crate"].shape
    assert any("'bowl'" in line and "hull" in line for line in scene.report) and any("'sail'" in line for line in scene.report)


def test_report_of_what_is_not_read(tmp_path: Path) -> None:
    file = with_physics([{"name": "it", "extensions": physics({"mass": 1}, shaped())}], [BOX])
    file.tree["extensionsUsed"] += ["MSFT_lod", "KHR_materials_unlit"]
    file.animate(0, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    report = load(file, tmp_path).report
    assert any("MSFT_lod" in line for line in report) and not any("unlit" in line for line in report)
    assert any("'it'" in line and "animation is not read" in line for line in report)


def test_a_gltf_with_its_buffer_inside_is_the_same(tmp_path: Path) -> None:
    file = Gltf([{"name": "it", "mesh": 0}])
    file.mesh()
    first, second = (ri.load_scene(file.save(tmp_path / name)) for name in ("a.glb", "a.gltf"))
    assert np.array_equal(first["it"].shape.vertices, second["it"].shape.vertices)


def test_what_is_below_a_mirrored_node_is_mirrored(tmp_path: Path) -> None:
    """Lines of axes, velocities, spins and sliding limits, by the mirror x -> -x of what they are without it; a ball stays a ball."""
    kept = [
        {"linearAxes": [0], "min": -0.1, "max": 0.4}, {"linearAxes": [1, 2], "min": 0, "max": 0.3},
        {"angularAxes": [0], "min": -1, "max": 2},
    ]  # fmt: skip
    scenes = []
    for side in (1, -1):
        moves = {"linearVelocity": [1, 2, 3], "angularVelocity": [3, 0, -1]}
        nodes = [
            {"name": "above", "scale": [side, 1, 1], "children": [1, 2, 3]},
            {"name": "wheel", "rotation": TURN, "extensions": physics(moves, shaped(1)), "children": [4]},
            {"name": "ball", "rotation": TURN, "translation": [4, 0, 0], "extensions": physics({}, shaped())},
            {"name": "slide", "rotation": TURN, "extensions": {"KHR_physics_rigid_bodies": {"joint": {"connectedNode": 4, "joint": 0}}}},
            {"name": "end"},
        ]
        scenes.append(load(with_physics(nodes, [BALL, BOX], physicsJoints=[{"limits": kept}]), tmp_path))
    plain, mirrored = scenes
    mirror = np.array([-1.0, 1.0, 1.0])
    assert np.allclose(mirrored["wheel"].velocity, mirror * plain["wheel"].velocity)
    # A spin is no arrow: its parts along the mirror turn round.
    assert np.allclose(mirrored["wheel"].angular_velocity, -mirror * plain["wheel"].angular_velocity)
    assert mirrored["ball"].shape.kind == "sphere"
    joint, other = mirrored.effects[-1], plain.effects[-1]
    assert np.allclose(joint.axes, -mirror * other.axes)
    assert [(limit.lower, limit.upper) for limit in joint.limits] == [(-0.4, 0.1), (0.0, 0.3), (-1.0, 2.0)]
