"""What is refused in glTF files, with the place and the remedy."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from gltf_files import BOX, Gltf, physics, shaped, with_physics

import rigidimpulse as ri


def load(file: Gltf, tmp_path: Path) -> ri.Scene:
    return ri.load_scene(file.save(tmp_path / "scene.glb"))


def test_buffers_stay_in_their_folder(tmp_path: Path) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    file = Gltf([{"name": "it", "mesh": 0}])
    file.mesh()
    for place, uri in ((tmp_path / "secret.bin", "../secret.bin"), (folder / "b c.bin", "b%20c.bin")):
        place.write_bytes(file.data)
        tree = {**file.tree, "buffers": [{"byteLength": len(file.data), "uri": uri}]}
        (folder / "scene.gltf").write_text(json.dumps(tree))
        if place.parent == folder:
            assert ri.load_scene(folder / "scene.gltf").names == ("it",)
            continue
        with pytest.raises(ri.SceneError, match="outside the folder"):
            ri.load_scene(folder / "scene.gltf")
        assert ri.load_scene(folder / "scene.gltf", allow_outside=True).names == ("it",)


def test_compressed_geometry_is_refused_with_the_remedy(tmp_path: Path) -> None:
    file = Gltf([{"name": "it", "mesh": 0}])
    file.mesh(extensions={"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}})
    with pytest.raises(ri.SceneError, match="without compression"):
        load(file, tmp_path)


def test_errors_name_their_place(tmp_path: Path) -> None:
    file = with_physics([{"name": "it", "extensions": physics({"mass": "heavy"}, shaped())}], [BOX])
    with pytest.raises(ri.SceneError, match=r"nodes\.0\.extensions\.KHR_physics_rigid_bodies\.motion\.mass"):
        load(file, tmp_path)
    file = with_physics([{"name": "it", "extensions": physics({"mass": 1}, shaped(3))}], [BOX])
    with pytest.raises(ri.SceneError, match="no implicit shape 3"):
        load(file, tmp_path)
    with pytest.raises(ri.SceneError, match="own ancestor"):
        load(Gltf([{"name": "a"}, {"name": "b", "children": [2]}, {"name": "c", "children": [1]}]), tmp_path)
    with pytest.raises(ri.SceneError, match="cannot read a scene"):
        ri.load_scene(tmp_path / "scene.fbx")
    with pytest.raises(ri.SceneError, match="check the path"):
        ri.load_scene(tmp_path / "none.glb")
