"""Issue 30: a file names no file outside its folder, in all formats; USD read any path that the reader may read."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest

import rigidimpulse as ri

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "io"))

BALL = """#usda 1.0
(
    defaultPrim = "ball"
)
def Sphere "ball" (
    prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsRigidBodyAPI"]
)
{
}
"""
NOTHING = '<mujoco><worldbody><geom type="sphere" size="1"/></worldbody></mujoco>'


def usd(file: Path, metadata: str = "", inside: str = "", layer: str = "") -> Path:
    """Write a stage of one prim with metadata and attributes, below metadata of the layer."""
    pytest.importorskip("pxr")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f'#usda 1.0\n(\n{layer}\n)\ndef Xform "held" (\n{metadata}\n)\n{{\n{inside}\n}}\n')
    return file


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a ball in it, and one beside it."""
    for place in (tmp_path / "secret.usda", tmp_path / "scene" / "ball.usda"):
        place.parent.mkdir(exist_ok=True)
        place.write_text(BALL)
    return tmp_path / "scene"


WAYS = {
    "reference": ("references = @{}@", "", ""),
    "payload": ("payload = @{}@", "", ""),
    "sublayer": ("", "", "subLayers = [@{}@]"),
    "texture": ("", "asset inputs:file = @{}@", ""),
    "textures in time": ("", "asset inputs:file.timeSamples = {{\n 0: @{}@,\n }}", ""),
    "variant that is not chosen": ('prepend variantSets = "v"', 'variantSet "v" = {{\n "a" (\n references = @{}@\n) {{\n}}\n}}', ""),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("is_absolute", [True, False], ids=["absolute", "above"])
def test_usd_names_nothing_outside(folder: Path, way: str, is_absolute: bool) -> None:
    """The error tells file, path and remedy; allowed, the ball comes in. The same path from a layer below is refused, too."""
    name = str(folder.parent / "secret.usda") if is_absolute else "../secret.usda"
    root = usd(folder / "in.usda", *(part.format(name) for part in WAYS[way]))
    problem = "an absolute path" if is_absolute else "outside the folder"
    with pytest.raises(ri.SceneError, match=f"'in.usda'.*secret.usda', .*{problem}.*allow_outside=True"):
        ri.load_scene(root)
    if way in ("reference", "payload", "sublayer"):
        assert len(ri.load_scene(root, allow_outside=True).bodies) == 1
    below = name if is_absolute else "../../secret.usda"
    usd(folder / "deep" / "below.usda", *(part.format(below) for part in WAYS[way]))
    with pytest.raises(ri.SceneError, match=f"'in.usda', layer 'deep/below.usda'.*{problem}"):
        ri.load_scene(usd(root, layer="subLayers = [@deep/below.usda@]"))


def test_usd_names_files_in_its_folder(folder: Path) -> None:
    """Also by `..` from a folder below. What is missing stays a line of the report."""
    usd(folder / "deep" / "below.usda", "references = @../ball.usda@", "asset inputs:file = @../tex.png@")
    root = usd(folder / "in.usda", "references = [@./ball.usda@, @none.usda@]", layer="subLayers = [@deep/below.usda@]")
    scene = ri.load_scene(root)
    assert scene.names == ("held",) and scene["held"].motion == "dynamic"
    assert any("none.usda" in line for line in scene.report)


def test_usd_looks_at_the_file_as_it_is_on_the_disk(folder: Path) -> None:
    """A layer that is open in the process may have been written again since."""
    from pxr import Sdf

    root = usd(folder / "in.usda", "references = @ball.usda@")
    held = Sdf.Layer.FindOrOpen(str(root))
    usd(root, "references = @../secret.usda@")
    with pytest.raises(ri.SceneError, match="outside the folder"):
        ri.load_scene(root)
    assert held


def test_usd_computes_no_paths_and_packages_stay_inside(folder: Path) -> None:
    """Paths out of variables depend on who refers to them; a package in the folder is read, one beside it is not."""
    root = usd(folder / "in.usda", 'references = @`"${WHERE}/secret.usda"`@', layer='expressionVariables = {\n string WHERE = ".."\n}')
    with pytest.raises(ri.SceneError, match="computes the path"):
        ri.load_scene(root)
    from pxr import Sdf, UsdUtils

    for place in (folder / "pack.usdz", folder.parent / "pack.usdz"):
        assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(folder / "ball.usda")), str(place))
    assert ri.load_scene(folder / "pack.usdz").names == ("ball",)
    assert ri.load_scene(usd(root, "references = @pack.usdz@")).names == ("held",)
    assert ri.load_scene(usd(root, "references = @pack.usdz[ball.usda]@")).names == ("held",)
    with pytest.raises(ri.SceneError, match="outside the folder"):
        ri.load_scene(usd(root, "references = @../pack.usdz[ball.usda]@"))


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="no links")
def test_links_leave_no_folder(folder: Path) -> None:
    """A link in the folder to a file outside."""
    (folder / "link.usda").symlink_to(folder.parent / "secret.usda")
    with pytest.raises(ri.SceneError, match="outside the folder"):
        ri.load_scene(usd(folder / "in.usda", "references = @link.usda@"))


def test_gltf_names_no_absolute_path(folder: Path) -> None:
    """Not even one in its folder: the file could not be moved, and tells who reads it whether a path exists."""
    from gltf_files import Gltf

    file = Gltf([{"name": "it", "mesh": 0}])
    file.mesh()
    (folder / "data.bin").write_bytes(file.data)
    for uri in (str(folder / "data.bin"), "C:/data.bin", "%2E%2E/data.bin", "data.bin"):
        (folder / "in.gltf").write_text(json.dumps({**file.tree, "buffers": [{"byteLength": len(file.data), "uri": uri}]}))
        if uri == "data.bin":
            assert ri.load_scene(folder / "in.gltf").names == ("it",)
            continue
        with pytest.raises(ri.SceneError, match=r"'in\.gltf', buffer 0.*(an absolute path|outside the folder).*allow_outside"):
            ri.load_scene(folder / "in.gltf")


def test_urdf_tells_nothing_of_other_folders(folder: Path) -> None:
    """A path outside is refused before it is looked for: it had said whether there is a file."""
    pytest.importorskip("defusedxml")
    mesh = '<robot name="r"><link name="a"><collision><geometry><mesh filename="{}"/></geometry></collision></link></robot>'
    for name in ("../none.stl", "/none.stl", "file:///none.stl"):
        (folder / "in.urdf").write_text(mesh.format(name))
        with pytest.raises(ri.SceneError, match=r"outside the folder|an absolute path"):
            ri.load_scene(folder / "in.urdf")


def test_mjcf_included_files_stay_inside(folder: Path) -> None:
    """What an included file names was not looked at."""
    pytest.importorskip("mujoco")
    (folder.parent / "world.xml").write_text(NOTHING)
    (folder / "in.xml").write_text('<mujoco><include file="part.xml"/></mujoco>')
    for name in ("../world.xml", str(folder.parent / "world.xml")):
        (folder / "part.xml").write_text(f'<mujoco><include file="{name}"/></mujoco>')
        with pytest.raises(ri.SceneError, match=r"'in\.xml', 'part\.xml', <include>.*allow_outside"):
            ri.load_scene(folder / "in.xml")
    (folder / "part.xml").write_text(NOTHING)
    assert len(ri.load_scene(folder / "in.xml").bodies) == 1
