"""What is seen of robots: visual elements of URDF, geoms of MJCF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri

ROBOT = """<robot name="r"><material name="sky"><color rgba="0.2 0.4 0.6 1"/></material>
<link name="base">{inertia}<visual><geometry><box size="1 1 1"/></geometry><material name="sky"/></visual>
<collision><geometry><box size="1 1 1"/></geometry></collision></link>
<link name="arm">{inertia}<visual><origin xyz="0 0 1"/><geometry><sphere radius="0.2"/></geometry>
<material name="own"><color rgba="1 0 0 1"/></material></visual><collision><geometry><box size="0.4 0.4 0.4"/></geometry></collision></link>
<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0 1"/><axis xyz="1 0 0"/></joint></robot>"""
INERTIA = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def colours_of(shape: ri.Shape) -> set[tuple[int, ...]]:
    assert shape.colors is not None
    return {tuple(color) for color in shape.colors.reshape(-1, 3).tolist()}


class TestRobots:
    def test_urdf_shows_its_visuals(self, tmp_path: Path) -> None:
        (tmp_path / "r.urdf").write_text(ROBOT.format(inertia=INERTIA))
        scene = ri.load_scene(tmp_path / "r.urdf")
        base, arm = scene["base"].visual, scene["arm"].visual
        assert base is not None and base.shape is None and base.hex_color() == "#336699"
        assert arm is not None and arm.shape is not None
        (part,) = arm.shape.parts_flat()
        assert colours_of(part.shape) == {(255, 0, 0)} and np.array_equal(part.position, [0, 0, 1])
        assert not any("visual" in line for line in scene.report)

    def test_a_visual_that_cannot_be_read_is_listed(self, tmp_path: Path) -> None:
        text = ROBOT.format(inertia=INERTIA).replace('<sphere radius="0.2"/>', '<mesh filename="gone.stl"/>')
        (tmp_path / "r.urdf").write_text(text)
        scene = ri.load_scene(tmp_path / "r.urdf")
        assert scene["arm"].visual is None and any("'arm'" in line and "<visual>" in line for line in scene.report)

    def test_mjcf_shows_its_geoms(self, tmp_path: Path) -> None:
        pytest.importorskip("mujoco")
        (tmp_path / "m.xml").write_text(
            '<mujoco><worldbody><geom name="ground" type="plane" size="1 1 1" rgba="0.2 0.4 0.6 1"/>'
            '<body name="ball" pos="0 0 1"><freejoint/><geom size="0.2" rgba="1 0 0 1"/></body>'
            '<body name="dressed" pos="2 0 1"><freejoint/><geom type="box" size="0.2 0.2 0.2" group="3"/>'
            '<geom size="0.3" rgba="0 1 0 1" contype="0" conaffinity="0" mass="0"/></body></worldbody></mujoco>'
        )
        scene = ri.load_scene(tmp_path / "m.xml")
        looks = {body.name: body.visual for body in scene.bodies}
        assert {name: look.hex_color() for name, look in looks.items() if look and look.shape is None} == {
            "ground": "#336699", "ball": "#ff0000"
        }  # fmt: skip
        assert looks["dressed"] is not None and looks["dressed"].shape is not None
        (part,) = looks["dressed"].shape.parts_flat()
        assert colours_of(part.shape) == {(0, 255, 0)}
