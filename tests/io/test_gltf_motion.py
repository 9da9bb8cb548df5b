"""Motion into glTF files: a player of its own (`player.py`) shows every body where the run has it.

Keys have single precision: places of up to 10 m are good to 10 * 2^-24 = 6e-7 m, rotations to 1e-7 rad. Left-out parents,
exchanged quaternion components or a wrong root show as errors of the size of the scene.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_files import BOX, CUBE, Gltf, channels, physics, shaped, unpack, with_physics
from player import Player, check_structure, rotation

import rigidimpulse as ri
from rigidimpulse.core.quaternion import multiply
from rigidimpulse.recording.events import IMPACT_DTYPE
from rigidimpulse.recording.recording import Recording

SINGLE = 2e-6
HALF = np.sqrt(0.5)


def recorded(scene: ri.Scene, poses: dict[str, tuple[np.ndarray, np.ndarray]], fps: float = 24.0, spins: Any = None) -> Recording:
    """A run with given positions (f, 3) and orientations (f, 4) of some bodies; the others stand."""
    frames = len(next(iter(poses.values()))[0])
    shape = (frames, len(scene.names))
    positions, orientations = np.zeros((*shape, 3)), np.zeros((*shape, 4))
    for k, body in enumerate(scene.bodies):
        x, q = poses.get(body.name, (np.tile(body.position, (frames, 1)), np.tile(body.unit_orientation(), (frames, 1))))
        positions[:, k], orientations[:, k] = x, q
    rates = np.zeros((*shape, 3))
    for name, spin in (spins or {}).items():
        rates[:, scene.names.index(name)] = spin
    times = np.arange(frames) / fps
    names, still, none = list(scene.names), np.zeros((*shape, 3)), np.zeros(0, IMPACT_DTYPE)
    return Recording(times, names, positions, orientations, still, rates, positions.copy(), none, scene=scene)


def smooth(frames: int, start: Any, turn: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """A path that begins at a place, unturned."""
    s = np.linspace(0, 1, frames)
    angle = 0.5 * turn * s
    axis = np.array([0.6, 0.0, 0.8])
    positions = np.asarray(start) + np.column_stack([3 * s, -4 * s**2, np.sin(2 * s)])
    return positions, np.column_stack([np.cos(angle), np.sin(angle)[:, None] * axis])


def turned(q: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) of a quaternion (w, x, y, z)."""
    return rotation(np.asarray(q)[[1, 2, 3, 0]])


def test_the_input_file_moves(tmp_path: Path) -> None:
    """Parents that are moved, turned, scaled and mirrored, a matrix, a child, and a body below a body that moves."""
    nodes: list[dict[str, Any]] = [
        {"name": "room", "translation": [1, 2, 3], "rotation": [HALF, 0, 0, HALF], "scale": [2, 2, 2], "children": [1, 4], "camera": 0},
        {"name": "crate", "scale": [0.5, 0.5, 0.5], "children": [2, 3], "extensions": physics({"mass": 1}, shaped())},
        {"name": "sticker", "mesh": 0, "translation": [0, 0.5, 0]},
        {"name": "rider", "translation": [0, 4, 0], "scale": [1, 2, 1], "extensions": physics({"mass": 1}, shaped())},
        {"name": "mirror", "scale": [-1, 1, 1], "children": [5]},
        {"name": "seen", "translation": [3, 0, 0], "extensions": physics({"mass": 1}, shaped())},
        {"name": "odd", "matrix": [0, 2, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1], "extensions": physics({"mass": 1}, shaped())},
        {"name": "still", "extensions": physics(None, shaped()), "extras": {"kept": True}},
    ]  # fmt: skip
    file = with_physics(nodes, [BOX])
    file.mesh()
    file.tree |= {"cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}], "materials": [{"name": "paint"}]}
    scene = ri.load_scene(file.save(tmp_path / "in.glb"))
    poses = {}
    for k, name in enumerate(("crate", "rider", "seen", "odd")):
        x, q = smooth(9, scene[name].position, 1.0 + k)
        poses[name] = x, multiply(q, scene[name].unit_orientation())
    run = recorded(scene, poses)
    tree, data = unpack(run.export(tmp_path / "out.glb"))
    check_structure(tree, data)
    player, rest = Player(tree, data), Player(*unpack(tmp_path / "in.glb"))
    for name in poses:
        before = rest.world(rest.index(name), 0.0)
        carried = turned(scene[name].unit_orientation()).T @ before[:3, :3]
        for frame, time in enumerate(run.times):
            now = player.world(player.index(name), time)
            assert np.abs(now[:3, 3] - run.position(name)[frame]).max() < SINGLE
            assert np.abs(now[:3, :3] - turned(run.orientation(name)[frame]) @ carried).max() < SINGLE
    # All else is as it was.
    assert {key: tree[key] for key in ("cameras", "materials", "meshes", "scenes", "extensions")} == {
        key: file.tree[key] for key in ("cameras", "materials", "meshes", "scenes", "extensions")
    }
    assert tree["nodes"][0] == nodes[0] and tree["nodes"][7] == nodes[7] and tree["nodes"][1] == nodes[1]
    assert {target for target, _ in channels(tree, data)} == set(poses)


def test_a_parent_that_shears_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """No rotation of the node makes the body rigid there: its place is right, its turn the nearest, and the log says so."""
    nodes = [
        {"name": "squash", "scale": [1, 0.5, 1], "children": [1]},
        {"name": "crate", "translation": [0, 2, 0], "extensions": physics({"mass": 1}, shaped())},
    ]
    scene = ri.load_scene(with_physics(nodes, [BOX]).save(tmp_path / "in.glb"))
    run = recorded(scene, {"crate": smooth(9, (0, 1, 0))})
    player = Player(*unpack(run.export(tmp_path / "out.glb")))
    assert "uneven scale" in caplog.text and "crate" in caplog.text
    for frame, time in enumerate(run.times):
        assert np.abs(player.world(1, time)[:3, 3] - run.position("crate")[frame]).max() < SINGLE


def test_channels_of_bodies_are_replaced_and_others_stay(tmp_path: Path) -> None:
    file = with_physics([{"name": "door", "extensions": physics(None, shaped())}, {"name": "lamp"}], [BOX])
    file.animate(0, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    file.animate(1, "translation", [0, 1], [[0, 0, 0], [0, 7, 0]])
    scene = ri.load_scene(file.save(tmp_path / "in.glb"))
    x = np.linspace([0, 0, 0], [1, 0, 0], 5)
    run = recorded(scene, {"door": (x, np.tile([1.0, 0, 0, 0], (5, 1)))})
    tree, data = unpack(run.export(tmp_path / "out.glb"))
    found = channels(tree, data)
    assert len(found["door", "translation"][0]) == 5 and np.array_equal(found["lamp", "translation"][1][-1], [0, 7, 0])


def test_all_that_moves_is_in_the_first_animation(tmp_path: Path) -> None:
    """Blender shows the first animation of a file and no other, so bodies stood there. What moves a thing a second time stays apart."""
    file = with_physics([{"name": "crate", "extensions": physics({"mass": 1}, shaped())}, {"name": "lamp"}], [BOX])
    file.animate(1, "translation", [0, 1], [[0, 0, 0], [0, 7, 0]])
    file.animate(1, "translation", [0, 1], [[0, 0, 0], [0, 0, 9]])
    scene = ri.load_scene(file.save(tmp_path / "in.glb"))
    run = recorded(scene, {"crate": smooth(5, (0, 0, 0))})
    tree, data = unpack(run.export(tmp_path / "out.glb", start_frame=24))
    first, second = ({**tree, "animations": [animation]} for animation in tree["animations"])
    found = channels(first, data)
    assert set(found) == {("crate", "translation"), ("crate", "rotation"), ("lamp", "translation")}
    assert np.array_equal(found["lamp", "translation"][0], [1, 2]) and np.array_equal(found["lamp", "translation"][1][1], [0, 7, 0])
    assert np.array_equal(channels(second, data)["lamp", "translation"][1][1], [0, 0, 9])


@pytest.mark.parametrize("join", ["LINEAR", "STEP", "CUBICSPLINE"])
def test_parents_that_move_do_so_at_their_time(tmp_path: Path, join: str) -> None:
    """A body below a cart is where the run has it at every frame, at frame 1001 too, whatever the cart's keys are like.

    The cart has linear keys at the frames, since programs differ in what they make of others in between. With its own times the
    cart would have arrived, 4 m away, when the run begins. Read at the keys themselves: no error of times in single precision.
    """
    file = with_physics(
        [{"name": "cart", "children": [1]}, {"name": "load", "translation": [0, 1, 0], "extensions": physics({"mass": 1}, shaped())}], [BOX]
    )
    places, turns = [[0, 0, 0], [4, 0, 1]], [[0, 0, 0, 1], [0, HALF, 0, HALF]]
    if join == "CUBICSPLINE":
        places, turns = ([[0] * len(keys[0]), keys[0], [3] * len(keys[0]), [0] * len(keys[0]), keys[1], [0] * len(keys[0])]
                         for keys in (places, turns))  # fmt: skip
    file.animate(0, "translation", [0, 0.31], places, join)
    file.animate(0, "rotation", [0, 0.31], turns, join)
    scene = ri.load_scene(file.save(tmp_path / "in.glb"))
    run = recorded(scene, {"load": smooth(13, (0, 1, 0))})
    tree, data = unpack(run.export(tmp_path / "out.glb", start_frame=1001))
    check_structure(tree, data)
    player, found = Player(tree, data), channels(tree, data)
    times = found["load", "translation"][0]
    assert len(times) == 13 and set(times) <= set(found["cart", "rotation"][0])
    for frame, time in enumerate(times):
        now = player.world(1, time)
        assert np.abs(now[:3, 3] - run.position("load")[frame]).max() < SINGLE
        assert np.abs(now[:3, :3] - turned(run.orientation("load")[frame])).max() < SINGLE


def test_bodies_that_stand_elsewhere_have_a_key(tmp_path: Path) -> None:
    """A body that was moved apart from another one before the run, and a turn that the file holds all the time: both were lost."""
    file = with_physics(
        [{"name": "crate", "extensions": physics({"mass": 1}, shaped())}, {"name": "door", "extensions": physics(None, shaped())}], [BOX]
    )
    file.animate(1, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    file.animate(1, "rotation", [0, 1], [[0, HALF, 0, HALF]] * 2)
    scene = ri.load_scene(file.save(tmp_path / "in.glb"))
    still, aside = np.tile([1.0, 0, 0, 0], (5, 1)), np.tile([HALF, 0, HALF, 0], (5, 1))
    poses = {"crate": (np.tile([0, 2.0, 0], (5, 1)), still), "door": (np.linspace([0, 0, 0], [1, 0, 0], 5), aside)}
    tree, data = unpack(recorded(scene, poses).export(tmp_path / "out.glb"))
    player = Player(tree, data)
    assert np.allclose(player.world(0, 0.1)[:3, 3], [0, 2, 0], rtol=0, atol=SINGLE)
    assert np.allclose(player.world(1, 0.1)[:3, :3], turned(aside[0]), rtol=0, atol=SINGLE)


def test_the_root_is_named_unlike_all_bodies(tmp_path: Path) -> None:
    """Programs rename one of two nodes of one name: the body "world" would be "world.001"."""
    scene = ri.Scene(gravity=(0, 0, -9.81), bodies=[ri.Body("world", ri.Shape.box(1))])
    tree, _ = unpack(recorded(scene, {"world": smooth(3, (0, 0, 0))}).export(tmp_path / "out.glb"))
    assert sorted(node["name"] for node in tree["nodes"]) == ["world", "world_"]


def test_a_scene_from_code_stands_y_up(tmp_path: Path) -> None:
    """Z up turns to Y up: (x, y, z) is at (x, z, -y). Equal shapes share vertices, a half space is a square in its plane."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", position=(0, 0, 1)))
    box = ri.Shape.box((1, 2, 3))
    scene.add(ri.Body("a", box, position=(1, 2, 3)))
    scene.add(ri.Body("b", box, position=(5, 6, 7)))
    run = recorded(scene, {"a": smooth(9, (1, 2, 3)), "b": smooth(9, (5, 6, 7))})
    tree, data = unpack(run.export(tmp_path / "out.glb"))
    check_structure(tree, data)
    player, up = Player(tree, data), np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    for name in ("a", "b", "floor"):
        for frame, time in enumerate(run.times):
            now = player.world(player.index(name), time)
            assert np.abs(now[:3, 3] - up @ run.position(name)[frame]).max() < SINGLE
            assert np.abs(now[:3, :3] - up @ turned(run.orientation(name)[frame])).max() < SINGLE
    meshes = [tree["meshes"][player.nodes[player.index(name)]["mesh"]]["primitives"][0] for name in ("a", "b", "floor")]
    assert meshes[0]["attributes"] == meshes[1]["attributes"] and meshes[0]["material"] != meshes[1]["material"]
    # Without names, programs call them all "GLTF".
    for kind in ("meshes", "materials"):
        assert sorted(one["name"] for one in tree[kind]) == ["a", "b", "floor"]
    corners = tree["accessors"][meshes[2]["attributes"]["POSITION"]]
    assert corners["min"][2] == corners["max"][2] == 0.0 and corners["max"][0] >= 10.0


def test_only_what_moves_has_keys_and_frames_begin_where_they_are_told_to(tmp_path: Path) -> None:
    scene = ri.Scene(bodies=[ri.Body("a", ri.Shape.box(1)), ri.Body("b", ri.Shape.box(1), position=(9, 0, 0))])
    x = np.linspace([0, 0, 0], [1, 0, 0], 5)
    run = recorded(scene, {"a": (x, np.tile([1.0, 0, 0, 0], (5, 1)))}, fps=25.0)
    found = channels(*unpack(run.export(tmp_path / "out.glb", start_frame=1001)))
    assert set(found) == {("a", "translation")}
    # Times near 40 s in single precision.
    assert np.abs(found["a", "translation"][0] * 25 - np.arange(1001, 1006)).max() < 25 * 40 * 2**-23


def test_fast_spin_does_not_alias(tmp_path: Path) -> None:
    """100 rad/s at 24 fps are 4.17 rad a frame: keys of frames alone play backwards, at 2.1 rad a frame the other way."""
    spin, frames = 100.0, 13
    scene = ri.Scene(bodies=[ri.Body("top", ri.Shape.box(1)), ri.Body("slow", ri.Shape.box(1), position=(5, 0, 0))])
    angle = 0.5 * spin * np.arange(frames) / 24.0
    q = np.column_stack([np.cos(angle), 0 * angle, 0 * angle, np.sin(angle)])
    run = recorded(scene, {"top": (np.zeros((frames, 3)), q), "slow": smooth(frames, (5, 0, 0))}, spins={"top": (0, 0, spin)})
    tree, data = unpack(run.export(tmp_path / "out.glb"))
    check_structure(tree, data)
    times, keys = channels(tree, data)["top", "rotation"]
    assert np.abs(np.sum(keys[1:] * keys[:-1], axis=1)).min() > np.cos(0.8) and set(np.float32(run.times)) <= set(np.float32(times))
    player = Player(tree, data)
    for time in np.linspace(0, run.times[-1], 200):
        # z-up root aside, the node turns about its own z at a constant rate: the slerp between keys is exact.
        own = player.local(player.index("top"), time)[:3, :3]
        assert np.abs(own - turned([np.cos(spin * time / 2), 0, 0, np.sin(spin * time / 2)])).max() < 1e-4
    assert len(channels(tree, data)["slow", "translation"][0]) == frames


def test_fast_spin_about_a_centre_of_mass(tmp_path: Path) -> None:
    """The origin goes round the centre of mass in between, and not straight from frame to frame."""
    spin, frames, arm = 90.0, 7, 0.5
    shape = ri.Shape.compound([(ri.Shape.box(0.2), (arm, 0, 0), (1, 0, 0, 0))])
    scene = ri.Scene(gravity=(0, -1, 0), bodies=[ri.Body("hammer", shape)])
    times = np.arange(frames) / 24.0
    angle = spin * times
    q = np.column_stack([np.cos(angle / 2), 0 * angle, np.sin(angle / 2), 0 * angle])
    centre = np.column_stack([arm + 2 * times, 0 * times, 0 * times])
    x = centre - arm * np.column_stack([np.cos(angle), 0 * angle, -np.sin(angle)])
    run = recorded(scene, {"hammer": (x, q)}, spins={"hammer": (0, spin, 0)})
    run.centers[:, 0] = centre
    found = channels(*unpack(run.export(tmp_path / "out.glb")))
    t, keys = found["hammer", "translation"]
    wanted = np.column_stack([arm + 2 * t, 0 * t, 0 * t]) - arm * np.column_stack([np.cos(spin * t), 0 * t, -np.sin(spin * t)])
    # Times in single precision: 0.25 s * 2^-24 * 45 m/s.
    assert len(t) > frames and np.abs(keys - wanted).max() < 5e-6


def test_left_out_keys_are_not_missed(tmp_path: Path) -> None:
    """With a tolerance d every corner is within d of its place at all frames, with fewer keys; without, all are there."""
    frames, tolerance = 97, 2e-3
    scene = ri.Scene(gravity=(0, -1, 0), bodies=[ri.Body("a", ri.Shape.box(1))])
    run = recorded(scene, {"a": smooth(frames, (0, 0, 0))})
    full = channels(*unpack(run.export(tmp_path / "full.glb")))["a", "rotation"][0]
    tree, data = unpack(run.export(tmp_path / "few.glb", tolerance=tolerance))
    few = channels(tree, data)["a", "rotation"][0]
    assert len(full) == frames and 4 < len(few) < frames / 2
    player, worst = Player(tree, data), 0.0
    for frame, time in enumerate(run.times):
        now = player.world(0, time)
        there = CUBE @ now[:3, :3].T + now[:3, 3]
        wanted = CUBE @ turned(run.orientation("a")[frame]).T + run.position("a")[frame]
        worst = max(worst, float(np.linalg.norm(there - wanted, axis=1).max()))
    assert tolerance / 10 < worst < tolerance + SINGLE


def test_impacts_between_frames(tmp_path: Path) -> None:
    """A ball with e = 1 falls by h: after sqrt(2 h / g), between frames, its centre is at its radius, and not above.

    The line from frame to frame stays above by up to v dt / 2 = 0.09 m here.
    """
    h, radius, fps = 1.0, 0.1, 24.0
    bouncy = ri.Material(restitution=1.0, static_friction=0.0)
    scene = ri.Scene(gravity=(0, -9.81, 0))
    scene.add(ri.Body("floor", ri.Shape.half_space((0, 1, 0)), motion="static", material=bouncy))
    scene.add(ri.Body("ball", ri.Shape.sphere(radius), position=(0, radius + h, 0), angular_velocity=(0, 0, 5), material=bouncy))
    run = ri.simulate(scene, 2.0, fps)
    assert len(run.impacts) == 2
    found = {}
    for name, keys in (("plain", False), ("split", True)):
        tree, data = unpack(run.export(tmp_path / f"{name}.glb", impact_keys=keys))
        check_structure(tree, data)
        found[name] = channels(tree, data)["ball", "translation"]
    times, places = found["split"]
    assert len(times) == len(found["plain"][0]) + 2 and found["plain"][1][:, 1].min() > radius + 0.01
    for impact in run.impacts["time"]:
        k = int(np.argmin(np.abs(times - impact)))
        assert abs(times[k] - impact) < 1e-6 and abs(places[k, 1] - radius) < SINGLE
    with pytest.raises(ri.SceneError, match="only"):
        run.export(tmp_path / "out.html", impact_keys=True)


def test_a_thousand_bodies(tmp_path: Path) -> None:
    """240 frames of 1,000 bodies take 7.2 MB, 28 bytes a pose: three and four single numbers, and half a megabyte of names."""
    rng, frames, count = np.random.default_rng(1), 240, 1000
    box = ri.Shape.box(1)
    scene = ri.Scene(bodies=[ri.Body(f"b{k}", box, position=(k, 0, 0)) for k in range(count)])
    q = rng.normal(size=(frames, count, 4))
    x = rng.normal(size=(frames, count, 3)) + [body.position for body in scene.bodies]
    still = np.zeros((frames, count, 3))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    run = Recording(np.arange(frames) / 24, list(scene.names), x, q, still, still, x, np.zeros(0, IMPACT_DTYPE), scene=scene)
    path = run.export(tmp_path / "out.glb")
    assert frames * count * 28 < path.stat().st_size < 8e6
    tree, _ = unpack(path)
    assert len(tree["meshes"]) == 10


def test_images_and_buffers_come_along(tmp_path: Path) -> None:
    """A .gltf with a buffer and an image beside it becomes one file."""
    import json

    file = Gltf([{"name": "crate", "mesh": 0}])
    file.mesh()
    (tmp_path / "data.bin").write_bytes(file.data)
    (tmp_path / "skin.png").write_bytes(b"\x89PNG not really")
    tree = {**file.tree, "buffers": [{"byteLength": len(file.data), "uri": "data.bin"}], "images": [{"uri": "skin.png"}]}
    (tmp_path / "in.gltf").write_text(json.dumps(tree))
    scene = ri.load_scene(tmp_path / "in.gltf")
    (tmp_path / "there").mkdir()
    out = recorded(scene, {"crate": smooth(3, (0, 0, 0))}).export(tmp_path / "there" / "out.glb")
    tree, data = unpack(out)
    check_structure(tree, data)
    view = tree["bufferViews"][tree["images"][0]["bufferView"]]
    assert data[view["byteOffset"] :][: view["byteLength"]] == b"\x89PNG not really" and tree["images"][0]["mimeType"] == "image/png"
    assert tree["buffers"] == [{"byteLength": tree["buffers"][0]["byteLength"]}]
    # The same in text: it reads back.
    again = recorded(scene, {"crate": smooth(3, (0, 0, 0))}).export(tmp_path / "there" / "out.gltf")
    assert ri.load_scene(again)["crate"].keyframes is not None


def test_what_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    scene = ri.Scene(bodies=[ri.Body("a", ri.Shape.box(1))])
    x, q = smooth(3, (0, 0, 0))
    run = recorded(scene, {"a": (x, q)})
    for name, value in (("start_frame", -1.0), ("tolerance", 0.0), ("tolerance", np.nan)):
        with pytest.raises(ri.SceneError, match=name):
            run.export(tmp_path / "out.glb", **{name: value})
    with pytest.raises(ri.SceneError, match="single precision"):
        run.export(tmp_path / "out.glb", start_frame=1e9)
    with pytest.raises(ri.SceneError, match=r"only"):
        run.export(tmp_path / "out.npz", start_frame=1)
    x[1, 0] = np.nan
    with pytest.raises(ri.SceneError, match="not finite"):
        recorded(scene, {"a": (x, q)}).export(tmp_path / "out.glb")
    assert not list(tmp_path.iterdir())
