"""Files that ended the process, or in an error of another library: found by mutations of good files (tests/bench/fuzz.py, kind files)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri

USDA = b"""#usda 1.0
def Sphere "ball" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsCollisionAPI"]
)
{
    double radius = 1
    def Xform "part" {}
}
"""


def test_bytes_that_are_no_text_in_usd(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    for place in range(0, len(USDA), 3):
        path = tmp_path / f"{place}.usda"
        path.write_bytes(USDA[:place] + b"\xff" + USDA[place:])
        try:
            ri.load_scene(path)
        except ri.SceneError as error:
            assert path.name in str(error)


def test_a_binary_layer_that_lacks_prims(tmp_path: Path) -> None:
    """usd-core ends the process that asks it for a prim which others have for a child and which is not there."""
    sdf = pytest.importorskip("pxr.Sdf")
    source, path = tmp_path / "good.usda", tmp_path / "it.usdc"
    source.write_bytes(USDA)
    sdf.Layer.FindOrOpen(str(source)).Export(str(path))
    content, refused = path.read_bytes(), 0
    assert len(ri.load_scene(path).bodies) == 1
    # The list of fields comes first in the file, and the children of prims are in it.
    for place in range(88, 200):
        other = tmp_path / f"{place}.usdc"
        other.write_bytes(content[:place] + b"\xff" + content[place + 1 :])
        try:
            ri.load_scene(other)
        except ri.SceneError as error:
            refused += "prims that it counts are not in it" in str(error)
    assert refused


def test_a_vertex_as_far_as_numbers_go(tmp_path: Path) -> None:
    """One that no edge closes: points are joined then, which looks at squares of their distances."""
    mesh = trimesh.creation.icosphere(subdivisions=1)
    corners = np.array(mesh.triangles)
    corners[5, 1, 1] = 1e308
    lines = ["solid it", *(
        line for corner in corners for line in (
            "facet normal 0 0 0", "outer loop", *(f"vertex {x} {y} {z}" for x, y, z in corner), "endloop", "endfacet",
        )
    ), "endsolid it"]  # fmt: skip
    path = tmp_path / "far.stl"
    path.write_text("\n".join(lines))
    scene = ri.Scene(bodies=[ri.Body("it", ri.Shape.from_file(path), motion="static")])
    with pytest.raises(ri.SceneError, match=r"'it'.*far\.stl.*farther than 1e\+60 m"):
        ri.simulate(scene, 0.1)


def test_warnings_of_mujoco_are_in_the_report_and_in_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo writes MUJOCO_LOG.TXT to the current folder where nobody takes its warnings."""
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "it.xml"
    body = '<body pos="0 0 {0}"><freejoint/><geom size="0.1"/></body>'
    path.write_text(f"<mujoco><worldbody>{body.format('nan')}</worldbody></mujoco>")
    with pytest.raises(ri.SceneError, match=r"it\.xml.*not finite"):
        ri.load_scene(path)
    path.write_text(f"<mujoco><custom><numeric name='it' data='nan'/></custom><worldbody>{body.format(1)}</worldbody></mujoco>")
    assert any("MuJoCo warns" in line for line in ri.load_scene(path).report)
    assert [entry.name for entry in tmp_path.iterdir()] == ["it.xml"]
