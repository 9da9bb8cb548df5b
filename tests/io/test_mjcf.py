"""Models in MJCF against closed forms, and against MuJoCo's own figures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.scene.mass import body_mass

pytest.importorskip("defusedxml")
pytest.importorskip("mujoco")


def load(folder: Path, inside: str, head: str = "", **options: object) -> ri.Scene:
    """Write and read a model."""
    path = folder / "model.xml"
    path.write_text(f'<mujoco><compiler angle="radian"/>{head}<worldbody>{inside}</worldbody></mujoco>')
    return ri.load_scene(path, **options)  # pyright: ignore[reportArgumentType]


BOB = '<geom type="sphere" size="0.1" pos="0 0 -0.5" mass="2"/>'


def turn_of(run: ri.Recording, name: str) -> np.ndarray:
    """Turn of a body about y."""
    q = run.orientation(name)
    return 2 * np.arctan2(q[:, 2], q[:, 0])


def test_a_pendulum_swings_with_its_period(tmp_path: Path) -> None:
    """T = 2 pi sqrt((I + m l^2) / (m g l)) (1 + a^2 / 16); a period that is off by 1 % shows as 6 % of the swing at the quarters."""
    period = 2 * np.pi * np.sqrt((0.4 * 2 * 0.01 + 2 * 0.25) / (2 * 9.81 * 0.5)) * (1 + 0.01 / 16)
    body = f'<body name="bob" pos="0 0 1" axisangle="0 1 0 0.1"><joint type="hinge" axis="0 1 0"/>{BOB}</body>'
    scene = load(tmp_path, body)
    assert scene.names == ("bob",) and scene.report == () and np.allclose(scene.gravity, (0, 0, -9.81))
    turn = turn_of(ri.simulate(scene, period, fps=1 / (period / 40)), "bob")
    assert abs(turn[20] + 0.1) < 1e-5 and abs(turn[40] - 0.1) < 1e-5 and np.abs(turn[[10, 30]]).max() < 3e-4


def test_a_spring_on_a_slide(tmp_path: Path) -> None:
    """k = 50 N/m with 2 kg and its rest at 0.1 m: x = 0.1 (1 - cos w t), with c = 1 N s/m damped by exp(-c t / (2 m))."""
    joint = '<joint type="slide" axis="1 0 0" stiffness="50" springref="0.1" damping="1"/>'
    run = ri.simulate(load(tmp_path, f'<body name="b">{joint}{BOB}</body>', '<option gravity="0 0 0"/>'), 1.5, 60)
    t, decay = run.times, 1 / 4
    rate = np.sqrt(25 - decay**2)
    wanted = 0.1 * (1 - np.exp(-decay * t) * (np.cos(rate * t) + decay / rate * np.sin(rate * t)))
    assert np.abs(run.position("b")[:, 0] - wanted).max() < 2e-3


def test_figures_are_those_of_mujoco(tmp_path: Path) -> None:
    """Masses, inertias and frames of a body of several geoms, one of them a mesh; capsules by their ends."""
    import mujoco

    tetrahedron = "0 0 0  1 0 0  0 1 0  0 0 1"
    head = f'<asset><mesh name="t" vertex="{tetrahedron}" scale="0.5 0.5 0.5"/></asset>'
    body = (
        '<body name="b" pos="1 2 3" euler="0.3 0.4 0.5"><freejoint/><geom type="mesh" mesh="t" pos="0.2 0 0" density="500"/>'
        '<geom type="capsule" fromto="0 0 0 1 1 0" size="0.1"/><geom type="ellipsoid" size="0.1 0.2 0.3"/>'
        '<geom type="box" size="1 1 1" contype="0" conaffinity="0" mass="0"/></body>'
    )
    scene = load(tmp_path, body, head)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    mass = body_mass(scene["b"])
    assert np.isclose(mass.mass, model.body_mass[1]) and np.allclose(mass.center_of_mass, model.body_ipos[1])
    assert np.allclose(np.sort(mass.moments), np.sort(model.body_inertia[1]))
    mesh, capsule, ellipsoid = scene["b"].shape.parts_flat()
    corners = mesh.position + mesh.shape.surface().vertices @ mesh.rotation.T
    wanted = 0.5 * np.array(tetrahedron.split(), float).reshape(4, 3) + [0.2, 0, 0]
    assert max(np.linalg.norm(corners - point, axis=1).min() for point in wanted) < 1e-6
    assert np.isclose(capsule.shape.height, np.sqrt(2)) and np.allclose(capsule.position, (0.5, 0.5, 0))
    assert np.allclose(ellipsoid.shape.surface().vertices.max(axis=0), (0.1, 0.2, 0.3), atol=5e-3)
    run = ri.simulate(scene, 1.0, 10)
    assert np.abs(run.center_of_mass("b")[-1] - run.center_of_mass("b")[0] - [0, 0, -4.905]).max() < 1e-9


def test_planar_joints_are_one(tmp_path: Path) -> None:
    """Two slides and a hinge across them: x, z and the turn about y are free, y and the other turns are not. No body in between."""
    joints = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 1 0" pos="0 0 0"/>'
    scene = load(tmp_path, f'<body name="b">{joints}{BOB}</body>', '<option gravity="1 2 -9.81"/>')
    assert scene.names == ("b",)
    run = ri.simulate(scene, 0.5, 20)
    assert np.abs(run.center_of_mass("b")[-1] - [0.125, 0, -0.5 - 9.81 / 8]).max() < 1e-6


def test_chains_of_joints_against_mujoco(tmp_path: Path) -> None:
    """Two hinges across each other on one body, and an arm below with a limit, as MuJoCo moves them at steps of 0.5 ms.

    The body in between has 1e-4 of the mass; steps of 1/60 s are of second order. Joints in the other order are off by 0.1 m and more.
    """
    import mujoco

    inside = (
        '<body name="a" pos="0 0 2" axisangle="1 1 0 0.6"><joint type="hinge" axis="1 0 0"/>'
        '<joint type="hinge" axis="0 1 0" damping="0.1"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.05"/>'
        '<body name="b" pos="0 0 -0.5"><joint type="ball"/><geom type="capsule" fromto="0 0 0 0.3 0 -0.3" size="0.05"/></body></body>'
    )
    scene = load(tmp_path, inside, '<option timestep="0.0005" integrator="RK4"/>')
    assert len(scene.names) == 3 and "several joints" in scene.report[0]
    run = ri.simulate(scene, 0.5, 20)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    worst = 0.0
    for k in range(11):
        while data.time < k / 20 - 1e-9:
            mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        worst = max(worst, np.abs(run.position("b")[k] - data.xpos[2]).max())
    assert worst < 3e-3


def test_who_collides_and_with_what(tmp_path: Path) -> None:
    """Geoms of the world are static; contype and conaffinity, and excluded pairs; friction of two bodies is the greater."""
    inside = (
        '<geom name="floor" type="plane" size="5 5 0.1" friction="0.2 0.1 0.1"/>'
        '<body name="rests" pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" friction="0.7 0.1 0.1"/></body>'
        '<body name="falls" pos="1 0 0.1"><freejoint/><geom type="sphere" size="0.1" contype="2" conaffinity="2"/></body>'
        '<body name="left" pos="2 0 0.1"><freejoint/><geom type="sphere" size="0.1" contype="0" conaffinity="0"/></body>'
        '<body name="shut" pos="0 0 0.35"><freejoint/><geom type="sphere" size="0.1"/></body>'
    )
    path = tmp_path / "model.xml"
    path.write_text(f'<mujoco><worldbody>{inside}</worldbody><contact><exclude body1="rests" body2="shut"/></contact></mujoco>')
    scene = ri.load_scene(path, gravity=(2.0, 0, -9.81))
    run = ri.simulate(scene, 0.5, 20)
    # It would slide with the friction of the floor, and stays with its own.
    assert np.abs(run.position("rests")[-1] - [0, 0, 0.1]).max() < 1e-5
    for name in ("falls", "left"):
        assert run.position(name)[-1, 2] < -1
    assert abs(run.position("shut")[-1, 2] - 0.1) < 1e-4
    assert scene["rests"].material.spinning_friction is None and scene["floor"].shape.kind == "half_space"


def test_fixed_bodies_and_welds(tmp_path: Path) -> None:
    """Bodies without joints are static or fixed to the one above; weld and connect hold; what is not read is told."""
    inside = (
        '<body name="post"><geom type="box" size="0.1 0.1 1"/></body><body name="frame"/>'
        '<body name="a" pos="1 0 0" gravcomp="1"><freejoint/><geom type="sphere" size="0.1"/><body name="hand" pos="0 0 0.5">'
        '<geom type="sphere" size="0.1"/></body></body><body name="b" pos="2 0 0"><freejoint/><geom type="sphere" size="0.1"/></body>'
        '<body name="c" pos="3 0 0"><freejoint/><geom type="sphere" size="0.1"/></body>'
    )
    path = tmp_path / "model.xml"
    rest = '<equality><weld body1="post" body2="b"/><connect body1="a" body2="c" anchor="1 0 0"/></equality>'
    keys = '<keyframe><key name="home"/></keyframe>'
    path.write_text(f"<mujoco><worldbody>{inside}</worldbody>{rest}{keys}</mujoco>")
    scene = ri.load_scene(path)
    assert scene["post"].motion == "static" and "frame" not in scene and any("keyframes" in line for line in scene.report)
    run = ri.simulate(scene, 0.5, 10)
    assert np.abs(run.position("b") - [2, 0, 0]).max() < 1e-6
    assert np.abs(np.linalg.norm(run.position("hand") - run.position("a"), axis=1) - 0.5).max() < 1e-6
    # Nothing pulls a, so that c alone would fall by 1.2 m against it.
    ends = [run.position(name) + to_matrix(run.orientation(name)) @ [way, 0, 0] for name, way in (("a", 1), ("c", -1))]
    assert np.abs(ends[0] - ends[1]).max() < 1e-5


@pytest.mark.parametrize(("text", "match"), [
    ("<mujoco", "no XML"), ("<robot/>", "<mujoco>"), ("<mujoco><worldbody><geom type='cube'/></worldbody></mujoco>", "does not compile"),
    ("<mujoco><include file='../other.xml'/></mujoco>", "outside"), ("<mujoco><compiler meshdir='/etc'/></mujoco>", "outside"),
])  # fmt: skip
def test_broken_files(tmp_path: Path, text: str, match: str) -> None:
    path = tmp_path / "model.xml"
    path.write_text(text)
    with pytest.raises(ri.SceneError, match=match):
        ri.load_scene(path)
