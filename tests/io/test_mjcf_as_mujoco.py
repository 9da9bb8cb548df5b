"""What welds, cylindrical joints, bodies that are fixed together and ball joints of MJCF files do, against MuJoCo and closed forms."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.scene.collision_filter import may_meet
from rigidimpulse.scene.joint_six_axis import SixAxisJoint

pytest.importorskip("defusedxml")
pytest.importorskip("mujoco")

FLOATING = '<option gravity="0 0 0" timestep="0.001"/>'
BOX = '<geom type="box" size="0.1 0.1 0.1"/>'


def load(folder: Path, inside: str, rest: str = "") -> ri.Scene:
    """Write and read a model; rest: what stands beside its bodies."""
    path = folder / "model.xml"
    path.write_text(f'<mujoco><compiler angle="radian"/>{rest}<worldbody>{inside}</worldbody></mujoco>')
    return ri.load_scene(path)


def mujoco_at(folder: Path, duration: float) -> tuple[Any, Any]:
    """Return MuJoCo's model, and its data after some seconds."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    data = mujoco.MjData(model)
    while data.time < duration - 1e-9:
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return model, data


def equality(inside: str) -> str:
    """Return the element of an equality constraint."""
    return f"<equality>{inside}</equality>"


@pytest.mark.parametrize("sides", ['body1="box"', 'body1="box" body2="world"', 'body1="world" body2="box"', 'body1="box" body2="stand"'])
def test_a_weld_to_the_world_holds(tmp_path: Path, sides: str) -> None:
    """Without body2, with the world on either side, and with a body that stands and has no shape."""
    box = f'<body name="stand" pos="0 0 3"/><body name="box" pos="0.3 0 1" euler="0 0 0.5"><freejoint/>{BOX}</body>'
    scene = load(tmp_path, box, equality(f'<weld name="glue" {sides}/>'))
    assert not any("glue" in line for line in scene.report)
    run = ri.simulate(scene, 0.5, 10)
    assert np.abs(run.position("box") - [0.3, 0, 1]).max() < 1e-6
    assert np.abs(run.reaction("glue")[-1] - [0, 0, 9.81 * 8]).max() < 1e-3


RELPOSE = 'relpose="0.5 0.1 0.2 0.8 0 0.6 0" anchor="0.1 0.2 0.3"'


@pytest.mark.parametrize(("sides", "pair"), [
    ('body1="a" body2="b"', ("a", "b")), ('body1="b"', ("b", "")), ('body1="b" body2="post"', ("b", "post")),
    ('body1="post" body2="b"', ("post", "b")),
])  # fmt: skip
def test_a_weld_with_relpose_holds_that_pose(tmp_path: Path, sides: str, pair: tuple[str, str]) -> None:
    """Body 2 is turned in body 1 by 2 arcsin 0.6 about y, Q, and its anchor s lies at (0.5, 0.1, 0.2): its origin at that - Q s.

    MuJoCo's soft weld to what stands comes to that in 5 s; two that float it sets spinning. The report says that the bodies are moved.
    The bodies do not collide, as in MuJoCo welded ones do.
    """
    box = BOX.replace("/>", ' contype="1" conaffinity="2"/>')
    floating = f'<body name="a"><freejoint/>{box}</body><body name="b" pos="0 0.6 0" euler="0.2 0.1 0"><freejoint/>{box}</body>'
    post = f'<body name="post" pos="1 0 0" euler="0 0 0.3">{box}</body>'
    scene = load(tmp_path, floating + post, FLOATING + equality(f'<weld name="glue" {sides} {RELPOSE}/>'))
    assert any("'glue': relpose" in line for line in scene.report)
    run = ri.simulate(scene, 0.2, 10)
    poses = {name: (run.position(name)[-1], to_matrix(run.orientation(name)[-1])) for name in scene.names} | {"": (np.zeros(3), np.eye(3))}
    (place_1, turn_1), (place_2, turn_2) = poses[pair[0]], poses[pair[1]]
    turn = np.array([[0.28, 0, 0.96], [0, 1, 0], [-0.96, 0, 0.28]])
    assert np.abs(turn_1.T @ turn_2 - turn).max() < 1e-6
    assert np.abs(turn_1.T @ (place_2 - place_1) - [0.5, 0.1, 0.2] + turn @ [0.1, 0.2, 0.3]).max() < 1e-6
    if "a" not in pair:
        _, data = mujoco_at(tmp_path, 5.0)
        assert np.abs(data.body("b").xpos - poses["b"][0]).max() < 1e-4
        assert np.abs(data.body("b").xmat.reshape(3, 3) - poses["b"][1]).max() < 1e-4


def test_a_constraint_of_bodies_that_stand_is_told(tmp_path: Path) -> None:
    """No joint is made, as the scene could not run."""
    bodies = f'<body name="post">{BOX}</body><body name="box" pos="0 0 1"><freejoint/>{BOX}</body>'
    scene = load(tmp_path, bodies, equality('<weld name="idle" body1="post"/><connect name="idle too" body1="post" anchor="0 0 0"/>'))
    assert sum("do not move against each other" in line for line in scene.report) == 2
    assert ri.simulate(scene, 0.1).status.ok


@pytest.mark.parametrize("hinge", ["1 2 -1", "-1 -2 1"])
def test_a_cylindrical_joint_is_one(tmp_path: Path, hinge: str) -> None:
    """A slide and a hinge about its axis, in either direction, with springs and damping, as MuJoCo moves them. No body between."""
    joints = (
        '<joint type="slide" axis="1 2 -1" stiffness="60" springref="0.2" damping="1"/>'
        f'<joint type="hinge" axis="{hinge}" pos="0.1 0 0.3" stiffness="0.5" springref="0.4" damping="0.1"/>'
    )
    bob = '<geom type="box" size="0.1 0.2 0.05" pos="0.1 0.2 0" mass="2"/>'
    scene = load(tmp_path, f'<body name="b" pos="0 0 1">{joints}{bob}</body>', '<option timestep="0.0005" integrator="RK4"/>')
    assert scene.names == ("b",) and not scene.report
    run = ri.simulate(scene, 0.75, 20, accuracy=ri.Accuracy(step=1 / 480))
    _, data = mujoco_at(tmp_path, 0.75)
    turned = 2 * np.arccos(min(abs(data.body("b").xquat[0]), 1.0))
    assert turned > 0.3
    assert np.abs(run.position("b")[-1] - data.body("b").xpos).max() < 2e-3
    assert np.abs(to_matrix(run.orientation("b")[-1]) - data.body("b").xmat.reshape(3, 3)).max() < 4e-3


def test_bounds_of_a_cylindrical_joint(tmp_path: Path) -> None:
    """It falls by 0.3 m and no further, whichever way the axis of its hinge points, and turns by no more than 0.2 rad."""
    joints = '<joint type="slide" axis="0 0 1" range="-0.3 0.1"/><joint type="hinge" axis="0 0 -1" range="-0.2 0.4"/>'
    scene = load(tmp_path, f'<body name="b">{joints}<geom type="sphere" size="0.1" pos="0.5 0 0"/></body>')
    scene.gravity = (0.0, 3.0, -9.81)
    run = ri.simulate(scene, 1.5, 30)
    turn = 2 * np.arctan2(run.orientation("b")[:, 3], run.orientation("b")[:, 0])
    assert abs(run.position("b")[-1, 2] + 0.3) < 1e-5 and run.position("b")[:, 2].min() > -0.3 - 1e-5
    assert abs(turn.max() - 0.2) < 1e-5


GROUPS = f"""<geom name="floor" type="box" size="1 1 0.01"/><body name="post">{BOX}</body>
<body name="A"><freejoint/>{BOX}<body name="B">{BOX}<body name="C"><joint axis="0 0 1"/>{BOX}<body name="D">{BOX}</body>
<body name="E"><joint axis="0 1 0"/>{BOX}<body name="F">{BOX}</body></body></body></body><body name="G">{BOX}</body></body>
<body name="H"><joint type="slide"/>{BOX}<body name="I">{BOX}</body></body>"""


@pytest.mark.parametrize("flag", ["", '<option><flag filterparent="disable"/></option>'])
def test_groups_of_fixed_bodies_collide_as_in_mujoco(tmp_path: Path, flag: str) -> None:
    """All bodies overlap: who may meet are those of whom MuJoCo has contacts. By the flag a group meets that which it hangs from.

    Bodies that a joint connects never meet here.
    """
    scene = load(tmp_path, GROUPS, flag)
    model, data = mujoco_at(tmp_path, 0.0)
    labels = ["world" if name == "floor" else name for name in scene.names]
    theirs = {frozenset(model.body(model.geom_bodyid[geom]).name for geom in pair) for pair in data.contact.geom}
    joined = {frozenset((joint.a, joint.b)) for joint in scene.effects if isinstance(joint, SixAxisJoint)}
    ours = {
        frozenset((a, b))
        for (a, first), (b, second) in combinations(zip(labels, scene.bodies, strict=True), 2)
        if "dynamic" in (first.motion, second.motion) and may_meet(first.collision_filter, second.collision_filter)
    }
    assert len(theirs) > 20 and frozenset("AH") in theirs and frozenset("AE") in theirs and frozenset(("world", "H")) in theirs
    assert ours - joined == theirs - joined
    assert (frozenset("AD") in ours) == bool(flag) and frozenset("BG") not in ours


def test_a_robot_whose_groups_overlap_runs(tmp_path: Path) -> None:
    """A, with B fixed to it, and C on a hinge of B inside of A: it falls as one, without contacts, at g."""
    inside = (
        f'<body name="A" pos="0 0 1"><freejoint/>{BOX}<body name="B" pos="0.12 0 0"><geom type="box" size="0.05 0.05 0.05"/>'
        '<body name="C" pos="0.02 0 0"><joint type="hinge" axis="0 0 1"/><geom type="box" size="0.12 0.02 0.02"/></body></body></body>'
    )
    run = ri.simulate(load(tmp_path, inside), 0.3)
    assert run.status.ok and not run.status.events
    assert np.abs(run.position("C")[-1] - run.position("A")[-1] - [0.14, 0, 0]).max() < 1e-9
    assert abs(run.position("A")[-1, 2] - (1 - 9.81 * 0.09 / 2)) < 1e-9


def test_damping_of_ball_and_free_joints_is_told(tmp_path: Path) -> None:
    """It is left out, with its value in the report, and the body keeps its angular momentum; undamped ones are not in the report."""
    bodies = (
        '<body name="b"><joint name="shoulder" type="ball" damping="0.05" frictionloss="0.25"/>'
        '<geom type="box" size="0.3 0.2 0.1" mass="1"/></body>'
        '<body name="c" pos="3 0 0"><joint type="ball"/><geom type="sphere" size="0.1"/></body>'
        '<body name="d" pos="6 0 0"><joint name="loose" type="free" damping="0.5"/><geom type="sphere" size="0.1"/></body>'
    )
    scene = load(tmp_path, bodies, FLOATING)
    assert [line[: line.index(" of a")] for line in scene.report] == [
        "joint 'shoulder': damping = 0.05, frictionloss = 0.25", "joint 'loose': damping = 0.5",
    ]  # fmt: skip
    spun = ri.Scene(scene.gravity)
    for body in scene.bodies:
        spun.add(replace(body, angular_velocity=(1.0, 0.5, 3.0)))
    for joint in scene.effects:
        spun.add(joint)
    run = ri.simulate(spun, 1.5, 20)
    inertia = np.diag([0.2**2 + 0.1**2, 0.3**2 + 0.1**2, 0.3**2 + 0.2**2]) / 3
    turns = [to_matrix(q) for q in run.orientation("b")]
    momentum = [turn @ inertia @ turn.T @ w for turn, w in zip(turns, run.angular_velocity("b"), strict=True)]
    assert np.abs(np.array(momentum) - inertia @ [1.0, 0.5, 3.0]).max() < 1e-5


def test_torquescale_of_a_weld_is_told(tmp_path: Path) -> None:
    """0 frees the rotation in MuJoCo, and not here."""
    scene = load(tmp_path, f'<body name="box"><freejoint/>{BOX}</body>', equality('<weld name="glue" body1="box" torquescale="0"/>'))
    assert any("torquescale" in line for line in scene.report)
