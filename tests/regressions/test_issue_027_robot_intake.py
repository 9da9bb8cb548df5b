"""Issue 27: every link and geom of a robot is a body, part of one, or in the report."""

from __future__ import annotations

from pathlib import Path

import pytest

import rigidimpulse as ri

pytest.importorskip("mujoco")

MASS = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
BALL = '<geometry><sphere radius="0.1"/></geometry>'


def test_every_link_of_a_urdf_file_is_simulated_or_reported(tmp_path: Path) -> None:
    """Frames without mass were lost in silence."""
    links = {
        "base": "",
        "arm": f"{MASS}<collision>{BALL}</collision><visual>{BALL}</visual>",
        "tool": f"<collision>{BALL}</collision>",
        "tip": "",
    }
    joints = [("base", "arm", "continuous"), ("arm", "tool", "fixed"), ("tool", "tip", "fixed")]
    text = "".join(f'<link name="{name}">{inside}</link>' for name, inside in links.items())
    text += "".join(f'<joint name="{b}" type="{kind}"><parent link="{a}"/><child link="{b}"/></joint>' for a, b, kind in joints)
    (tmp_path / "it.urdf").write_text(f'<robot name="it">{text}</robot>')
    scene = ri.load_scene(tmp_path / "it.urdf")
    assert scene.names == ("arm",)
    for name in links:
        assert name in scene.names or any(f"link {name!r}" in line for line in scene.report), (name, scene.report)
    # What is seen is its very collider.
    assert scene["arm"].visual is None


def test_every_body_and_geom_of_an_mjcf_file_is_simulated_or_reported(tmp_path: Path) -> None:
    (tmp_path / "it.xml").write_text(
        '<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><geom name="sign" type="box" size="1 1 1" contype="0" '
        'conaffinity="0"/><body name="frame"/><body name="ball"><freejoint/><geom name="hit" size="0.1"/><geom name="shell" size="0.2" '
        'contype="0" conaffinity="0"/><body name="mark"/></body></worldbody></mujoco>'
    )
    scene = ri.load_scene(tmp_path / "it.xml")
    assert scene.names == ("floor", "ball")
    for name in ("frame", "ball", "mark"):
        assert name in scene.names or any(f"link {name!r}" in line for line in scene.report), (name, scene.report)
    assert any("geoms" in line and "'sign'" in line for line in scene.report), scene.report
    # A geom on a body that collides with nothing is seen.
    visual = scene["ball"].visual
    assert visual is not None and visual.shape is not None
    assert sorted(part.shape.radius for part in visual.shape.parts_flat()) == [0.1, 0.2]
