"""Robots from URDF against closed forms and values by hand. An angle, an axis or a frame taken wrongly is off by all of itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.scene.mass import body_mass

pytest.importorskip("defusedxml")

BALL = '<collision><origin xyz="0 0 -0.5"/><geometry><sphere radius="0.1"/></geometry></collision>'
BOB = f"""<link name="bob"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/><inertia ixx="0.008" iyy="0.008" izz="0.008"/></inertial>
{BALL}</link>"""


def save(folder: Path, inside: str) -> Path:
    """Write a robot."""
    path = folder / "robot.urdf"
    path.write_text(f'<?xml version="1.0"?><robot name="r">{inside}</robot>')
    return path


def joint(kind: str, parent: str, child: str, inside: str = "", name: str = "joint") -> str:
    """A joint; by default at its parent's origin."""
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def link(name: str, mass: float = 1.0, inside: str = "") -> str:
    """A link with the inertia of a ball of 10 cm."""
    inertia = 0.4 * mass * 0.01
    figures = " ".join(f'{key}="{inertia}"' for key in ("ixx", "iyy", "izz"))
    return f'<link name="{name}"><inertial><mass value="{mass}"/><inertia {figures}/></inertial>{inside}</link>'


def pendulum(folder: Path, dynamics: str = "", angle: float = 0.1) -> ri.Scene:
    """A bob on a hinge about y of a world link, turned by an angle."""
    middle = f'<origin xyz="0 0 1" rpy="0 {angle} 0"/><axis xyz="0 1 0"/>{dynamics}'
    return ri.load_scene(save(folder, '<link name="world"/>' + BOB + joint("continuous", "world", "bob", middle)))


def turn_of(run: ri.Recording) -> np.ndarray:
    """Turn of the bob about y."""
    q = run.orientation("bob")
    return 2 * np.arctan2(q[:, 2], q[:, 0])


def test_a_pendulum_swings_with_its_period(tmp_path: Path) -> None:
    """T = 2 pi sqrt((I + m l^2) / (m g l)) (1 + a^2 / 16): at quarters it hangs upright, at halves it is still on the other side.

    A period that is off by 1 % shows as 6 % of the swing at the quarters.
    """
    period = 2 * np.pi * np.sqrt((0.008 + 2 * 0.25) / (2 * 9.81 * 0.5)) * (1 + 0.01 / 16)
    scene = pendulum(tmp_path)
    assert scene.names == ("bob",) and scene.report == ()
    turn = turn_of(ri.simulate(scene, period, fps=1 / (period / 40)))
    assert abs(turn[20] + 0.1) < 1e-5 and abs(turn[40] - 0.1) < 1e-5 and np.abs(turn[[10, 30]]).max() < 3e-4


def test_damping_and_friction_of_joints(tmp_path: Path) -> None:
    """Damping d: the swing decays by exp(-d t / (2 I)). Dry friction f: each half swing is smaller by 2 f / (m g l)."""
    inertia, pull = 0.008 + 0.5, 2 * 9.81 * 0.5
    damping = 0.2
    rate = np.sqrt(pull / inertia - (damping / (2 * inertia)) ** 2)
    half = np.pi / rate
    turn = turn_of(ri.simulate(pendulum(tmp_path, f'<dynamics damping="{damping}"/>', 0.02), 2 * half, fps=1 / (half / 30)))
    assert abs(turn[60] / 0.02 - np.exp(-damping * 2 * half / (2 * inertia))) < 3e-3
    friction = 0.05
    half = np.pi * np.sqrt(inertia / pull)
    turn = turn_of(ri.simulate(pendulum(tmp_path, f'<dynamics friction="{friction}"/>', 0.05), 2 * half, fps=1 / (half / 30)))
    lost = 2 * friction / pull
    assert abs(turn[30] + 0.05 - lost) < 0.03 * lost and abs(turn[60] - (0.05 - 2 * lost)) < 0.06 * lost


def test_frames_masses_and_shapes(tmp_path: Path) -> None:
    """Joint origins chain up; R = R_z R_y R_x; the inertia is turned by its origin."""
    parts = (
        '<link name="a"><inertial><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><mass value="3"/>'
        '<inertia ixx="1" iyy="2" izz="2.5"/></inertial>'
        '<visual><geometry><sphere radius="9"/></geometry></visual>'
        '<collision><origin xyz="0 1 0" rpy="1.5707963267948966 0 0"/>'
        '<geometry><cylinder radius="0.2" length="0.6"/></geometry></collision>'
        '<collision><geometry><box size="1 2 3"/></geometry></collision></link>'
    )
    chain = joint("revolute", "a", "b", '<origin xyz="1 0 0" rpy="0.3 0.4 0.5"/><limit lower="-1" upper="1" effort="0" velocity="0"/>')
    more = joint("fixed", "b", "c", '<origin xyz="0 0 2" rpy="0.1 0 0"/>', name="weld")
    scene = ri.load_scene(save(tmp_path, parts + link("b", 1, BALL) + link("c", 1, BALL) + chain + more))
    mass = body_mass(scene["a"])
    assert mass.mass == 3 and np.allclose(mass.center_of_mass, (0.1, 0, 0)) and np.allclose(mass.inertia, np.diag([2, 1, 2.5]))
    cylinder, box = scene["a"].shape.parts_flat()
    assert (cylinder.shape.kind, box.shape.kind) == ("cylinder", "box") and np.allclose(cylinder.rotation @ [0, 0, 1], [0, -1, 0])

    def about(axis: int, angle: float) -> np.ndarray:
        c, s = np.cos(angle), np.sin(angle)
        return np.roll(np.roll(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), axis, 0), axis, 1)

    turn = about(2, 0.5) @ about(1, 0.4) @ about(0, 0.3)
    assert np.allclose(to_matrix(scene["b"].unit_orientation()), turn) and np.allclose(scene["b"].position, (1, 0, 0))
    assert np.allclose(scene["c"].position, turn @ [0, 0, 2] + [1, 0, 0])
    assert np.allclose(to_matrix(scene["c"].unit_orientation()), turn @ about(0, 0.1))
    run = ri.simulate(scene, 0.5, 10)
    # The weld keeps b and c together.
    held = [to_matrix(q).T @ x for q, x in zip(run.orientation("b"), run.position("c") - run.position("b"), strict=True)]
    assert np.abs(np.array(held) - [0, 0, 2]).max() < 1e-6


def test_limits_hold(tmp_path: Path) -> None:
    """An arm that starts level falls to its limit of 0.5 rad, a slider to its 0.3 m: both hard, to 1e-6."""
    arm = '<axis xyz="0 1 0"/><limit lower="-0.5" upper="0.5" effort="1" velocity="1"/><origin rpy="0 -1.5707963267948966 0"/>'
    scene = ri.load_scene(save(tmp_path, '<link name="world"/>' + BOB + joint("revolute", "world", "bob", arm)))
    run = ri.simulate(scene, 2.0, 30)
    turn = np.abs(turn_of(run) + np.pi / 2)
    assert turn.max() < 0.5 + 1e-6 and abs(turn[-1] - 0.5) < 1e-5
    assert "effort" in "\n".join(scene.report)
    rail = '<axis xyz="0 0 1"/><limit lower="-0.3" upper="0" effort="0" velocity="0"/>'
    scene = ri.load_scene(save(tmp_path, '<link name="world"/>' + BOB + joint("prismatic", "world", "bob", rail)))
    z = ri.simulate(scene, 1.0, 50).position("bob")[:, 2]
    t = np.arange(51) / 50
    assert np.abs(z - np.maximum(-9.81 * t**2 / 2, -0.3)).max() < 1e-4


def test_planar_and_floating(tmp_path: Path) -> None:
    """A planar joint about z holds the height and lets the rest go; a floating one holds nothing."""
    both = joint("planar", "world", "bob", '<axis xyz="0 0 1"/>') + joint("floating", "world", "free", name="loose")
    scene = ri.load_scene(save(tmp_path, '<link name="world"/>' + BOB + link("free") + both), gravity=(1, 2, -9.81))
    run = ri.simulate(scene, 1.0, 10)
    assert np.abs(run.center_of_mass("bob")[-1] - [0.5, 1, -0.5]).max() < 1e-6
    assert np.abs(run.position("free")[-1] - [0.5, 1, -4.905]).max() < 1e-9


def test_the_base(tmp_path: Path) -> None:
    """Free where it has mass; fixed where it is the world, or has no mass and others move against it; as told by fixed_base."""
    box = "<collision><geometry><box size='1 1 0.1'/></geometry></collision>"
    below = joint("continuous", "base", "bob", '<origin xyz="0 0 -1"/><axis xyz="0 1 0"/>')
    heavy = save(tmp_path, link("base", 5.0, box) + BOB + below)
    assert ri.load_scene(heavy)["base"].motion == "dynamic"
    assert ri.load_scene(heavy, fixed_base=True)["base"].motion == "static"
    light = save(tmp_path, f"<link name='base'>{box}</link>" + BOB + below)
    assert ri.load_scene(light)["base"].motion == "static"
    assert ri.load_scene(light, fixed_base=False)["base"].motion == "dynamic"
    # A frame below the robot goes with the link that is fixed to it, and so does one that hangs from it.
    frames = "<link name='base'/><link name='tool'/>" + link("trunk", 5.0, box) + joint("fixed", "base", "trunk")
    scene = ri.load_scene(save(tmp_path, frames + joint("fixed", "trunk", "tool", name="hand")))
    assert scene.names == ("trunk",) and not scene.effects and scene["trunk"].motion == "dynamic"


def test_frames_do_not_free_the_base(tmp_path: Path) -> None:
    """A frame fixed to a base without mass, or to another frame of it, leaves it fixed; a mass that is fixed to them frees it."""
    base = "<link name='base'/><link name='tool0'/><link name='camera'/>"
    frames = joint("fixed", "base", "tool0", name="one") + joint("fixed", "tool0", "camera", '<origin xyz="0 0 0.2"/>', name="two")
    for parent in ("base", "camera"):
        scene = ri.load_scene(save(tmp_path, base + BOB + frames + joint("continuous", parent, "bob", '<axis xyz="0 1 0"/>')))
        assert scene.names == ("bob",)
        run = ri.simulate(scene, 0.5, 10)
        assert np.abs(run.position("bob") - run.position("bob")[0]).max() < 1e-9
    scene = ri.load_scene(save(tmp_path, base + BOB + frames + joint("continuous", "base", "bob")), fixed_base=False)
    assert scene["base"].motion == "dynamic"
    # The trunk, 0.2 m above, carries all frames between it and the root.
    trunk = link("trunk", 5.0, BALL) + joint("fixed", "camera", "trunk", name="three")
    scene = ri.load_scene(save(tmp_path, base + BOB + trunk + frames + joint("continuous", "base", "bob")))
    assert set(scene.names) == {"trunk", "bob"} and scene["trunk"].motion == "dynamic" and len(scene.effects) == 1
    assert "link 'base' is part of 'trunk', to which it is fixed" in scene.report
    assert ri.simulate(scene, 0.5, 10).position("trunk")[-1, 2] < -0.5


def test_a_frame_alone_is_no_base(tmp_path: Path) -> None:
    """Nothing moves against it, so that it is free as before."""
    scene = ri.load_scene(save(tmp_path, "<link name='base'/><link name='tool0'/>" + joint("fixed", "base", "tool0")))
    assert scene.names == ("base",) and scene["base"].motion == "dynamic"


def test_who_collides(tmp_path: Path) -> None:
    """Parent and child never; links that overlap at the start neither, and the report says which."""
    turn = '<axis xyz="0 1 0"/>'
    chain = "".join(link(name, 1.0, BALL) for name in "abc")
    joints = joint("continuous", "a", "b", turn, name="one") + joint("continuous", "b", "c", turn, name="two")
    scene = ri.load_scene(save(tmp_path, chain + joints))
    assert any("'a' and 'c' overlap" in line for line in scene.report)
    assert ri.simulate(scene, 0.2).status.ok


def test_meshes(tmp_path: Path) -> None:
    """Meshes are found by package, scaled along each axis, and only inside the folder unless that is allowed."""
    import trimesh

    folder = tmp_path / "my_robot" / "urdf"
    folder.mkdir(parents=True)
    (folder.parent / "meshes").mkdir()
    trimesh.creation.box((1, 1, 1)).export(folder.parent / "meshes" / "cube.stl")
    mesh = '<collision><geometry><mesh filename="package://my_robot/meshes/cube.stl" scale="1 2 -3"/></geometry></collision>'
    path = save(folder, link("a", 1.0, mesh))
    with pytest.raises(ri.SceneError, match="allow_outside"):
        ri.load_scene(path)
    assert abs(ri.load_scene(path, allow_outside=True)["a"].shape.solid().volume - 6) < 1e-9
    path = save(folder.parent, link("a", 1.0, mesh))
    assert abs(ri.load_scene(path)["a"].shape.solid().volume - 6) < 1e-9
    path = save(folder, link("a", 1.0, mesh.replace("package://my_robot/", "../")))
    with pytest.raises(ri.SceneError, match="outside"):
        ri.load_scene(path)


def test_what_is_not_read_is_told(tmp_path: Path) -> None:
    text = link("a", 1.0, "<visual><geometry><box size='1 1 1'/></geometry></visual><sensor/>") + "<gazebo/><gazebo/>"
    text += "<link name='b'>" + BALL + "</link>" + joint("continuous", "a", "b", '<mimic joint="other"/>')
    report = "\n".join(ri.load_scene(save(tmp_path, text)).report)
    for part in ("what is seen of it collides", "<gazebo>, 2 times", "<sensor>", "mimic", "1,000 kg/m^3"):
        assert part in report, part


def test_inertias_that_are_none(tmp_path: Path) -> None:
    """A largest moment above the sum of the others is of no body: the nearest possible one is taken. None at all: the shape's."""
    bad = '<link name="a"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="9"/></inertial>' \
          "<collision><geometry><sphere radius='0.5'/></geometry></collision></link>"  # fmt: skip
    scene = ri.load_scene(save(tmp_path, bad))
    nearest = np.diag([1, 1, 9]) + 7 / 3 * np.diag([1, 1, -1])
    assert np.allclose(body_mass(scene["a"]).inertia, nearest, rtol=1e-7) and "the nearest that one has" in scene.report[0]
    scene = ri.load_scene(save(tmp_path, bad.replace('"1"', '"0"').replace('"9"', '"0"')))
    assert np.allclose(body_mass(scene["a"]).inertia, 0.4 * 2 * 0.25 * np.eye(3)) and "that of its shape" in scene.report[0]


LOOP = link("a") + link("b") + joint("continuous", "a", "b") + joint("continuous", "b", "a", name="back")
BOMB = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>'


@pytest.mark.parametrize(("text", "match"), [
    ("<robot", "no XML"), (f"{BOMB}<robot name='&b;'/>", "refused"), ("<sdf/>", "<robot>"), ("<robot/>", "no links"),
    (f"<robot>{LOOP}</robot>", "root"), (f"<robot>{link('a')}{link('b')}</robot>", "2 root links"),
    (f"<robot>{link('a')}{link('a')}</robot>", "name of its own"), (f"<robot>{link('a')}{joint('continuous', 'a', 'z')}</robot>", "'z'"),
    (f"<robot>{link('a')}{link('b')}{joint('screw', 'a', 'b')}</robot>", "screw"),
    (f"<robot>{link('a', 1.0, '<collision/>')}</robot>", "geometry"), (f"<robot>{link('a', float('nan'))}</robot>", "mass"),
    ("<robot><link name='a'><collision><geometry><box size='1 1'/></geometry></collision></link></robot>", "size"),
])  # fmt: skip
def test_broken_files(tmp_path: Path, text: str, match: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(ri.SceneError, match=match):
        ri.load_scene(path)
    with pytest.raises(ri.SceneError, match="no such file"):
        ri.load_scene(tmp_path / "gone.urdf")
    with pytest.raises(ri.SceneError, match="fixed_base"):
        ri.load_scene(tmp_path / "room.glb", fixed_base=True)
