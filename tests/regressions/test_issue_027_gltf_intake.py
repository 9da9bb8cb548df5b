"""Issue 27: no node of a glTF file is lost in silence; instances, parented meshes, moving bones; what a written file requires."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigidimpulse as ri

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "io"))

from gltf_files import BOX, CUBE, Gltf, channels, physics, shaped, unpack, with_physics

PLACES = np.array([[0.0, 3.0, 0.0], [4.0, 5.0, 0.0], [8.0, 7.0, 0.0]])
HALF_TURN = [0.0, 0.0, 1.0, 0.0]


def instanced(file: Gltf, node: int, scale: float = 1.0) -> None:
    """Let a node draw its mesh at the three places."""
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))
    turns[2] = HALF_TURN
    attributes = {"TRANSLATION": file.accessor(PLACES, "VEC3"), "ROTATION": file.accessor(turns, "VEC4")}
    attributes["SCALE"] = file.accessor(scale * np.ones((3, 3)), "VEC3")
    file.tree["nodes"][node].setdefault("extensions", {})["EXT_mesh_gpu_instancing"] = {"attributes": attributes}
    for key in ("extensionsUsed", "extensionsRequired"):
        file.tree.setdefault(key, []).append("EXT_mesh_gpu_instancing")


def floor() -> dict[str, Any]:
    return {"name": "floor", "mesh": 0, "scale": [40, 1, 40], "translation": [0, -0.5, 0]}


def test_instances_of_a_file_without_physics_are_bodies_and_move_in_the_written_file(tmp_path: Path) -> None:
    """They were one body at the origin of the node. Each falls by itself now, by g t^2 / 2, and stays drawn once."""
    file = Gltf([floor(), {"name": "crate", "mesh": 0, "translation": [0, 1, 0]}])
    file.mesh()
    instanced(file, 1, 0.5)
    scene = ri.load_scene(file.save(tmp_path / "in.glb"))
    assert scene.names == ("floor", "crate 1", "crate 2", "crate 3")
    for place, body in zip(PLACES + [0, 1, 0], scene.bodies[1:], strict=True):
        assert body.motion == "dynamic" and np.allclose(body.position, place)
        assert np.allclose(np.ptp(body.shape.surface().vertices, axis=0), 0.5)
    assert any("'crate'" in line and "3 times" in line for line in scene.report)
    run = ri.simulate(scene, 0.25, fps=4)
    run.export(tmp_path / "out.glb", impact_keys=False)
    tree, data = unpack(tmp_path / "out.glb")
    assert "extensionsRequired" not in tree and "extensionsUsed" not in tree
    assert sum(node.get("mesh") == 0 for node in tree["nodes"]) == 4
    found = channels(tree, data)
    for k, place in enumerate(PLACES):
        keys = found[f"crate {k + 1}", "translation"][1]
        assert np.allclose(keys[-1], place - [0, 0.5 * 9.81 * 0.25**2, 0], atol=1e-6)


def test_instances_below_motion_are_drawn_with_their_body_and_collide_as_the_file_says(tmp_path: Path) -> None:
    """A collider that is the node's mesh stands at each instance, a box stands once."""
    nodes = [
        {"name": "rack", "mesh": 0, "extensions": physics({"mass": 6}, {"geometry": {"node": 0}})},
        {"name": "sled", "mesh": 0, "translation": [0, 0, 30], "extensions": physics({"mass": 1}, shaped(0))},
        {"name": "bush", "mesh": 0, "translation": [0, 0, 60]},
        {"name": "copy", "translation": [0, 0, 90], "extensions": physics(None, {"geometry": {"node": 2}})},
    ]
    file = with_physics(nodes, [BOX])
    file.mesh()
    for node in range(3):
        instanced(file, node)
    scene = ri.load_scene(file.save(tmp_path / "in.glb"))
    assert scene.names == ("rack", "sled", "copy")
    parts = scene["rack"].shape.parts_flat()
    assert np.allclose([part.position for part in parts], PLACES) and scene["rack"].shape.solid().volume == pytest.approx(3.0)
    assert scene["sled"].shape.kind == "box" and np.allclose(scene["copy"].shape.surface().vertices.max(axis=0), 0.5)
    assert any("'bush 1'" in line and "collides with nothing" in line for line in scene.report)


def test_a_mesh_below_the_node_of_a_body_is_part_of_it(tmp_path: Path) -> None:
    """A table of a top and two legs came apart into three bodies. It falls and lands as one, unless a part says how it moves."""
    leg = {"mesh": 0, "scale": [0.1, 1, 1]}
    nodes = [
        floor(),
        {"name": "table", "mesh": 0, "translation": [0, 1.2, 0], "scale": [2, 0.1, 1], "children": [2, 3, 5]},
        {"name": "left", **leg, "scale": [0.05, 10, 1], "translation": [-0.45, -5.5, 0]},
        {"name": "empty", "children": [4]},
        {"name": "right", **leg, "scale": [0.05, 10, 1], "translation": [0.45, -5.5, 0]},
        {"name": "cup", "mesh": 0, "scale": [0.1, 2, 0.2], "translation": [0, 1.6, 0], "extras": {"motion": "dynamic"}},
    ]
    file = Gltf(nodes)
    file.mesh()
    scene = ri.load_scene(file.save(tmp_path / "in.glb"))
    assert scene.names == ("floor", "table", "cup")
    assert scene["table"].shape.solid().volume == pytest.approx(2 * 0.1 * 1 + 2 * 0.1 * 1 * 1)
    for name in ("left", "right"):
        assert any(f"{name!r} is part of body 'table'" in line for line in scene.report)
    run = ri.simulate(scene, 0.5, fps=10)
    assert run.status.ok
    run.export(tmp_path / "out.glb")
    tree, data = unpack(tmp_path / "out.glb")
    assert {name for name, _ in channels(tree, data)} <= {"table", "cup"}
    # It has dropped by 0.15 m onto its legs and stands level.
    assert run.positions[-1, run.names.index("table"), 1] == pytest.approx(1.05, abs=1e-4)


def skinned(moving: bool, **extras: Any) -> Gltf:
    """A cube with one bone, which goes up."""
    file = Gltf([floor(), {"name": "hero", "mesh": 1, "skin": 0, "extras": extras}, {"name": "bone", "translation": [0, 2, 0]}])
    file.mesh()
    file.mesh()
    attributes = file.tree["meshes"][1]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = file.accessor(np.zeros((8, 4)), "VEC4", np.uint8)
    attributes["WEIGHTS_0"] = file.accessor(np.tile([1.0, 0, 0, 0], (8, 1)), "VEC4")
    file.tree["skins"] = [{"joints": [2]}]
    if moving:
        file.animate(2, "translation", [0, 1], [[0, 2, 0], [0, 4, 0]])
    return file


def test_a_mesh_whose_bones_move_is_drawn_and_no_lump(tmp_path: Path) -> None:
    """It fell as a rigid body. It keeps its animation in the written file, and the report says that nothing collides with it."""
    scene = ri.load_scene(skinned(True).save(tmp_path / "in.glb"))
    assert scene.names == ("floor",)
    assert any("'hero'" in line and "bones" in line and "collides with nothing" in line for line in scene.report)
    ri.simulate(scene, 0.5, fps=4).export(tmp_path / "out.glb")
    tree, data = unpack(tmp_path / "out.glb")
    assert np.allclose(channels(tree, data)["bone", "translation"][1], [[0, 2, 0], [0, 4, 0]])


def test_a_mesh_whose_bones_move_is_a_body_where_it_says_so(tmp_path: Path) -> None:
    scene = ri.load_scene(skinned(True, motion="static").save(tmp_path / "in.glb"))
    assert scene["hero"].motion == "static" and np.allclose(scene["hero"].shape.surface().vertices.mean(axis=0), [0, 2, 0])
    assert any("'hero'" in line and "animation is not collided with" in line for line in scene.report)
    scene = ri.load_scene(skinned(False).save(tmp_path / "in.glb"))
    assert scene["hero"].motion == "dynamic" and not any("animation" in line for line in scene.report)


def test_colliders_that_change_their_shape_say_so(tmp_path: Path) -> None:
    nodes = [
        {"name": "hero", "mesh": 0, "skin": 0, "extensions": physics({"isKinematic": True}, {"geometry": {"node": 0}})},
        {"name": "bone"},
        {"name": "jelly", "mesh": 1, "translation": [0, 5, 0], "extensions": physics({"mass": 1}, {"geometry": {"node": 2}})},
    ]
    file = with_physics(nodes, [])
    file.mesh()
    attributes = file.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = file.accessor(np.zeros((8, 4)), "VEC4", np.uint8)
    attributes["WEIGHTS_0"] = file.accessor(np.tile([1.0, 0, 0, 0], (8, 1)), "VEC4")
    file.tree["skins"] = [{"joints": [1]}]
    file.mesh(targets=[{"POSITION": file.accessor(CUBE, "VEC3")}])
    file.tree["meshes"][1]["weights"] = [0.0]
    file.animate(1, "translation", [0, 1], [[0, 0, 0], [0, 1, 0]])
    file.animate(2, "weights", [0, 1], [[0.0], [1.0]])
    file.tree["accessors"][-1]["type"] = "SCALAR"
    report = ri.load_scene(file.save(tmp_path / "in.glb")).report
    for name in ("hero", "jelly"):
        assert any(f"{name!r}" in line and "not collided with" in line for line in report), (name, report)


def test_a_written_file_requires_what_it_uses_and_no_physics(tmp_path: Path) -> None:
    """Blender refuses a file that requires an extension which it does not know; motion needs none of them."""
    file = with_physics([{"name": "it", "mesh": 0, "translation": [0, 2, 0], "extensions": physics({"mass": 1}, shaped())}], [BOX])
    file.mesh()
    file.tree["extensionsUsed"] += ["KHR_mesh_quantization", "MSFT_lod", "KHR_materials_unlit", "EXT_texture_webp"]
    file.tree["extensionsRequired"] = list(file.tree["extensionsUsed"])
    file.tree["materials"] = [{"extensions": {"KHR_materials_unlit": {}}, "extras": {"extensions": {"MSFT_lod": 1}}}]
    run = ri.simulate(ri.load_scene(file.save(tmp_path / "in.glb")), 0.1, fps=10)
    run.export(tmp_path / "out.glb")
    tree, _ = unpack(tmp_path / "out.glb")
    assert set(tree["extensionsUsed"]) == {"KHR_physics_rigid_bodies", "KHR_implicit_shapes", "KHR_materials_unlit"}
    assert tree["extensionsRequired"] == ["KHR_materials_unlit"]
    assert ri.load_scene(tmp_path / "out.glb").names == ("it",)


def test_quantized_vertices_stay_required(tmp_path: Path) -> None:
    file = Gltf([{"name": "it", "mesh": 0}], extensionsUsed=["KHR_mesh_quantization"], extensionsRequired=["KHR_mesh_quantization"])
    file.mesh()
    file.tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = file.accessor(2 * CUBE, "VEC3", np.int16)
    ri.simulate(ri.load_scene(file.save(tmp_path / "in.glb")), 0.1, fps=10).export(tmp_path / "out.glb")
    assert unpack(tmp_path / "out.glb")[0]["extensionsRequired"] == ["KHR_mesh_quantization"]


def test_every_node_is_simulated_drawn_or_reported(tmp_path: Path) -> None:
    """Walks files of both kinds: a node with a surface or physics is a body, a part of one, a trigger, a joint, or in the report."""
    parts = [
        {"name": "ground", "extensions": physics(None, shaped())},
        {"name": "box", "mesh": 0, "translation": [0, 3, 0], "extensions": physics({"mass": 1}), "children": [2, 3]},
        {"name": "inner", "mesh": 0, "extensions": physics(None, shaped())},
        {"name": "hidden", "mesh": 0, "extensions": physics(trigger={})},
        {"name": "tree", "mesh": 0, "translation": [9, 0, 0]},
        {"name": "pin", "extensions": physics(joint={"connectedNode": 0, "joint": 0})},
        {"name": "other scene", "mesh": 0, "extensions": physics({"mass": 1}, shaped())},
        {"name": "lent", "mesh": 0},
        {"name": "hull", "translation": [-9, 0, 0], "extensions": physics(None, {"geometry": {"node": 7, "convexHull": True}})},
    ]
    first = with_physics(parts, [BOX], physicsJoints=[{}])
    first.mesh()
    first.tree["scenes"] = [{"nodes": [0, 1, 4, 5, 8]}, {"nodes": [6]}]
    plain = [
        floor(),
        {"name": "body", "mesh": 0, "translation": [0, 3, 0], "children": [2, 3, 4]},
        {"name": "part", "mesh": 0},
        {"name": "flat", "mesh": 1},
        {"name": "free", "mesh": 0, "translation": [0, 4, 0], "extras": {"motion": "dynamic"}},
        {"name": "none", "mesh": 0, "extras": {"motion": "none"}},
        {"name": "other scene", "mesh": 0},
    ]
    second = Gltf(plain)
    second.mesh()
    second.mesh(CUBE[:4], [[0, 1, 3], [0, 3, 2]])
    second.tree["scenes"] = [{"nodes": [0, 1, 5]}, {"nodes": [6]}]
    for number, file in enumerate((first, second)):
        scene = ri.load_scene(file.save(tmp_path / f"{number}.glb"))
        # "inner" is the collider of "box", "lent" the surface of "hull".
        told = {*scene.names, "inner", "lent"} if number == 0 else set(scene.names)
        for node in file.tree["nodes"]:
            name = node["name"]
            assert name in told or any(repr(name) in line for line in scene.report), (name, scene.report)
