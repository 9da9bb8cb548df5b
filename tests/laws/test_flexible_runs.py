"""Flexible bodies in runs, through the public surface: momentum and energy between soft and rigid bodies, rest, files, pages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from flexible_scene import cube_mesh, sheet_mesh

import rigidimpulse as ri

GRAVITY = 9.81
ROUGH = ri.Material(static_friction=0.6, dynamic_friction=0.5)


def sheet(name: str, height: float, *, pinned: bool, n: int = 7, **more) -> ri.FlexibleBody:
    """A square sheet of 1 m about the z axis, its rim pinned or free."""
    vertices, faces = sheet_mesh(n)
    vertices = vertices - [0.5, 0.5, 0.0]
    rim = np.flatnonzero(np.abs(vertices[:, :2]).max(axis=1) > 0.499).tolist() if pinned else []
    settings = {"stiffness": 2000.0, "damping": 0.002, "area_density": 1.0, "position": (0.0, 0.0, height)} | more
    return ri.FlexibleBody(name, vertices, faces, pinned=rim, material=ROUGH, **settings)


def trampoline_scene() -> ri.Scene:
    scene = ri.Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(sheet("net", 1.0, pinned=True))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.15), mass=3.0, position=(0.03, 0.02, 1.4), material=ROUGH))
    return scene


@pytest.fixture(scope="module")
def trampoline() -> ri.Recording:
    return ri.simulate(trampoline_scene(), 0.8)


def test_a_ball_bounces_on_a_trampoline_by_the_impulses_of_the_net(trampoline) -> None:
    # m v - m v0 = m g t + J. Without the net's rate the impulse of a step would be off by tenths of it, 0.1 N s and more.
    parts = trampoline.impulses("ball")
    assert set(parts) <= {"gravity", "flexible bodies", "corrections"}
    gained = 3.0 * trampoline.velocity("ball")
    np.testing.assert_allclose(parts["gravity"] + parts["flexible bodies"], gained, atol=1e-11)
    assert trampoline.velocity("ball")[:, 2].max() > 1.0  # it came down with 2.2 m/s
    assert trampoline.position("ball")[:, 2].min() > 0.5
    assert trampoline.status.ok, trampoline.status.message


def test_energy_balances_and_does_not_rise(trampoline) -> None:
    # 3.0 kg fall 0.25 m: 7 J. The balance is round-off; what a step may make is of second order,
    # J (h L - J) / 2 m (docs/theory/soft_bodies.md).
    ledger = trampoline.ledger
    taken = np.sum(list(ledger.dissipated.values()), axis=0)
    assert np.abs(ledger.total + taken - ledger.total[0]).max() < 1e-11
    assert np.diff(ledger.total).max() < 1e-3 * 7.0
    assert ledger.dissipated["flexible bodies"][-1] > 0.1


def test_what_a_free_net_and_a_ball_exchange_cancels() -> None:
    # No gravity, nothing pinned: p and L of both together stay, whatever they exchange (the ball alone loses a tenth of its 6 kg m/s).
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(sheet("net", 0.0, pinned=False))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.15), mass=2.0, position=(0.1, 0.05, 0.3), velocity=(0.2, 0.0, -3.0), material=ROUGH))
    run = ri.simulate(scene, 0.4)
    ledger = run.ledger
    lost = 2.0 * np.linalg.norm(run.velocity("ball")[-1] - run.velocity("ball")[0])
    assert lost > 0.6
    np.testing.assert_allclose(ledger.momentum - ledger.momentum[0], 0.0, atol=1e-11)
    # Frames are ends of steps. The rotation in a step is of second order in what the net gives: without the ball's part it were off by 0.1.
    np.testing.assert_allclose(ledger.angular_momentum - ledger.angular_momentum[0], 0.0, atol=1e-3)


def test_the_same_bits_twice_and_at_any_frame_rate(trampoline) -> None:
    again = ri.simulate(trampoline_scene(), 0.8)
    assert again.state_hash() == trampoline.state_hash()
    coarse = ri.simulate(trampoline_scene(), 0.8, fps=10.0)
    assert np.array_equal(coarse.positions, trampoline.positions[::6])
    assert np.array_equal(coarse.soft_body("net")[0][1:], trampoline.soft_body("net")[0][6::6])


def boxes_scene(*soft_bodies: ri.FlexibleBody) -> ri.Scene:
    scene = ri.Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("box", ri.Shape.box((0.3, 0.2, 0.1)), position=(0, 0, 0.3), angular_velocity=(1.0, 2.0, 0.5)))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0.05, 0.0, 0.6), velocity=(0.5, 0.0, 0.0)))
    for soft_body in soft_bodies:
        scene.add(soft_body)
    return scene


def test_a_net_far_away_leaves_the_bits_of_rigid_bodies_as_they_are() -> None:
    alone = ri.simulate(boxes_scene(), 1.0)
    beside = ri.simulate(boxes_scene(sheet("net", 50.0, pinned=True, n=4)), 1.0)
    assert np.array_equal(alone.positions, beside.positions)
    assert np.array_equal(alone.orientations, beside.orientations)
    assert np.array_equal(alone.velocities, beside.velocities)


def test_a_net_without_load_falls_as_a_stone_does() -> None:
    # Implicit Euler alone would be off by g h t / 2 = 0.04 m.
    scene = ri.Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(ri.Body("stone", ri.Shape.sphere(0.1), position=(0.0, 0.0, 5.0)))
    scene.add(sheet("cloth", 3.0, pinned=False, n=4, position=(3.0, 0.0, 5.0)))
    run = ri.simulate(scene, 0.5)
    heights = run.soft_body("cloth")[0][:, :, 2].mean(axis=1)
    np.testing.assert_allclose(heights, run.position("stone")[:, 2], atol=1e-6)


def test_a_body_at_rest_wakes_when_a_net_falls_on_it() -> None:
    # A cube of jelly of 4 kg comes down on the end of a plank that rests on a block: it tips. Asleep it would stay where it is.
    scene = ri.Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
    scene.add(ri.Body("block", ri.Shape.box((0.1, 0.4, 0.2)), motion="static", position=(0, 0, 0.1), material=ROUGH))
    scene.add(ri.Body("plank", ri.Shape.box((1.0, 0.3, 0.05)), mass=1.0, position=(0, 0, 0.225), material=ROUGH))
    vertices, faces = cube_mesh(3, 0.2)
    scene.add(ri.FlexibleBody(
        "jelly", vertices, faces, stiffness=500.0, inner_stiffness=5e4, damping=0.01, mass=4.0, position=(0.38, 0, 1.2), material=ROUGH,
    ))  # fmt: skip
    # How far it tips by then depends on the step: by 0.29 rad at 1/240 s, by 0.46 rad at 1/960 s.
    run = ri.simulate(scene, 1.0, accuracy=ri.Accuracy(step=1 / 240))
    frame = int(0.3 * 60)
    assert not run.velocities[frame, 2].any()  # at rest before the jelly comes, after 0.41 s
    assert run.orientation("plank")[-1] @ run.orientation("plank")[frame] < 0.999
    assert np.isfinite(run.positions).all()


def test_a_cloth_lies_on_a_light_box_that_stands_on_the_floor() -> None:
    # The box has 0.2 kg, the cloth 0.5 kg. Gap 0.8 mm; a net that gave way to the box as to a free body would sink 0.15 m into it.
    scene = ri.Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
    scene.add(ri.Body("box", ri.Shape.box((0.4, 0.4, 0.3)), mass=0.2, position=(0, 0, 0.15), material=ROUGH))
    scene.add(sheet("cloth", 0.5, pinned=False, n=13, stiffness=100.0, bending=1e-3, area_density=0.5, damping=0.05))
    run = ri.simulate(scene, 1.5)
    depth = (np.array([0.2, 0.2, 0.15]) - np.abs(run.soft_body("cloth")[0] - run.position("box")[:, None])).min(axis=2)
    assert depth.max() < 5e-3
    assert np.abs(run.position("box") - run.position("box")[0]).max() < 1e-3


def test_files_and_pages_bring_nets_back(trampoline, tmp_path: Path) -> None:
    back = ri.load_recording(trampoline.export(tmp_path / "run.npz"))
    vertices, faces = trampoline.soft_body("net")
    assert vertices.shape == (49, 49, 3) and faces.shape == (72, 3)
    assert np.array_equal(back.soft_body("net")[0], vertices) and np.array_equal(back.soft_body("net")[1], faces)
    page = trampoline.export(tmp_path / "run.html").read_text()
    assert 'data-kind="frames"' in page and '"name":"net"' in page
    with pytest.raises(ri.SceneError, match="net"):
        trampoline.soft_body("cloth")


def flat_landing() -> ri.Scene:
    """A sheet that falls flat on a floor: it lands without rebound, and all its motion is gone in a step."""
    scene = ri.Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(sheet("cloth", 0.2, pinned=False, n=9, stiffness=200.0, bending=1e-3, damping=0.01, area_density=0.5))
    return scene


def test_a_cloth_that_is_caught_on_a_rim_does_not_jam() -> None:
    """A cloth on a stool, and a ball on it: friction on the rim takes more than 100 iterations, and in two steps a halved step."""
    x, y = (column.ravel() for column in np.meshgrid(np.linspace(-0.3, 0.3, 9), np.linspace(-0.3, 0.3, 9)))
    corner = np.array([9 * j + i for j in range(8) for i in range(8)])[:, None]
    faces = np.concatenate([corner + (0, 1, 10), corner + (0, 10, 9)])
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("stool", ri.Shape.cylinder(0.15, 0.5), motion="static", position=(0, 0, 0.25)))
    vertices = np.column_stack([x, y, np.full(81, 0.62)])
    scene.add(ri.FlexibleBody("cloth", vertices, faces, stiffness=200, bending=1e-4, damping=0.002, area_density=0.2))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.05), position=(0, 0, 0.9), mass=0.2))
    run = ri.simulate(scene, 1.0, fps=24)
    assert run.status.ok, run.status.message
    apart = np.linalg.norm(run.soft_body("cloth")[0] - run.position("ball")[:, None], axis=2)
    assert apart.min() > 0.05  # it lies on the cloth


def test_round_off_is_no_energy_out_of_nothing() -> None:
    # 1e-15 J of 1 J: reported when it was compared with what was left after the landing, which is nothing.
    run = ri.simulate(flat_landing(), 0.5)
    assert run.status.ok, run.status.message
    heights = run.soft_body("cloth")[0][-1, :, 2]
    edge = (2.0 * 72.0 * 0.125 + 64.0 * 0.125 * np.sqrt(2.0)) / (2.0 * 72.0 + 64.0)
    np.testing.assert_allclose(heights, 0.01 * edge, rtol=1e-4)  # the gap of the guide; solver: 1e-6 of 2 m/s, times the step


def test_a_cloth_needs_no_body(tmp_path: Path) -> None:
    """A pinned sheet alone: the bits are those beside a body that it never meets; files and pages take it, and the cache."""
    alone = ri.Scene(gravity=(0.0, 0.0, -GRAVITY))
    beside = ri.Scene(gravity=(0.0, 0.0, -GRAVITY), bodies=[ri.Body("far", ri.Shape.sphere(0.1), motion="static", position=(0, 0, -1e3))])
    for scene in (alone, beside):
        vertices, faces = sheet_mesh(6)
        scene.add(ri.FlexibleBody("cloth", vertices, faces, stiffness=200.0, bending=1e-3, damping=0.01, area_density=0.2, pinned=[0, 5]))
    run, other = ri.simulate(alone, 0.3), ri.simulate(beside, 0.3)
    assert run.status.ok and run.names == [] and run.positions.shape == (19, 0, 3)
    assert np.array_equal(run.soft_body("cloth")[0], other.soft_body("cloth")[0])
    assert np.array_equal(run.ledger.total, other.ledger.total)
    assert run.soft_body("cloth")[0][-1, :, 2].min() < -0.3  # it swings down
    back = ri.load_recording(run.export(tmp_path / "run.npz"))
    assert np.array_equal(back.soft_body("cloth")[0], run.soft_body("cloth")[0])
    for suffix in ("html", "glb", "csv"):
        assert run.export(tmp_path / f"run.{suffix}").stat().st_size > 0
    assert run.plan.line("flexible bodies").included


def test_a_cloth_alone_in_usd_and_in_a_cache(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    pytest.importorskip("h5py")
    scene = ri.Scene()
    scene.add(sheet("cloth", 0.0, pinned=True, n=4))
    run = ri.simulate(scene, 0.1, cache=tmp_path / "run.h5")
    assert ri.simulate(scene, 0.1, cache=tmp_path / "run.h5").state_hash() == run.state_hash()
    assert "cloth" in run.export(tmp_path / "run.usda").read_text()


def test_nets_can_be_left_out_by_name() -> None:
    run = ri.simulate(trampoline_scene(), 0.5, effects={"flexible bodies": False})
    assert run.soft_bodies == []
    np.testing.assert_allclose(run.position("ball")[-1, 2], 1.4 - 0.5 * GRAVITY * 0.25, atol=1e-12)
    assert not run.status.ok  # it says so


def test_two_bodies_of_one_name_are_refused() -> None:
    scene = trampoline_scene()
    scene.add(sheet("ball", 2.0, pinned=False, n=3))
    with pytest.raises(ri.SceneError, match="'ball'"):
        ri.simulate(scene, 0.1)


def test_scenes_without_nets_load_nothing_of_them() -> None:
    code = (
        "import sys, rigidimpulse as ri; s = ri.Scene(); s.add(ri.Body('b', ri.Shape.sphere(1.0)));"
        "r = ri.simulate(s, 0.1);"
        "print([m for m in sys.modules if m.startswith('rigidimpulse.dynamics.soft_body')], r.plan.line('flexible bodies').included)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().splitlines()[-1] == "[] False"
