"""Runs to open in other programs, and where their bodies are at every frame."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.core.quaternion import from_matrix, to_matrix
from rigidimpulse.recording.recording import Recording
from rigidimpulse.view.camera import stage_rotation, up_axis

sys.path.insert(0, str(Path(__file__).parents[1] / "io"))
from gltf_files import BALL, BOX, physics, shaped, unpack, with_physics
from player import Player
from test_gltf_motion import recorded, smooth

HALF = np.sqrt(0.5)


@dataclass
class Case:
    """One file, and what a program that opens it must show.

    Attributes:
        name: of the case. path: the file. run: the recording. bodies: names of nodes or prims by names of bodies.
        stretch: (3, 3) by name of body, the world matrix at rest without its rotation.
        start_frame: number of the first frame. tolerance: m, what keys that were left out may take.
        cameras: bodies that are cameras, which look along another axis in Blender.

    """

    name: str
    path: Path
    run: Recording
    bodies: dict[str, str]
    stretch: dict[str, np.ndarray]
    start_frame: float = 0.0
    tolerance: float = 0.0
    cameras: tuple[str, ...] = ()

    @property
    def fps(self) -> float:
        """Frames per second."""
        return round(1.0 / float(self.run.times[1] - self.run.times[0]), 6)

    def wanted(self) -> np.ndarray:
        """World matrices (n, f, 4, 4): Y up, in USD files Z up where the scene is."""
        assert self.run.scene is not None
        up = up_axis(self.run.scene.gravity)
        turn = np.eye(3) if self.path.suffix == ".usdc" and up[2] > 0.5 else stage_rotation(up)
        made = np.tile(np.eye(4), (len(self.bodies), len(self.run.times), 1, 1))
        for k, name in enumerate(self.bodies):
            made[k, :, :3, :3] = turn @ to_matrix(self.run.orientation(name)) @ self.stretch[name]
            made[k, :, :3, 3] = self.run.position(name) @ turn.T
        return made

    def speeds(self) -> tuple[np.ndarray, np.ndarray]:
        """Greatest speed of the origin (n,) m/s and of the turn (n,) rad/s between frames or at one."""
        still = np.zeros(len(self.bodies))
        ways, turns = still.copy(), still.copy()
        for k, name in enumerate(self.bodies):
            spin = np.linalg.norm(self.run.angular_velocity(name), axis=1).max()
            q = self.run.orientation(name)
            step = 2.0 * np.linalg.norm(np.diff(q * np.sign(np.sum(q * q[:1], axis=1, keepdims=True)), axis=0), axis=1).max()
            arm = np.linalg.norm(self.run.position(name) - self.run.center_of_mass(name), axis=1).max()
            turns[k] = max(spin, self.fps * min(step, 4.0))
            way = np.linalg.norm(np.diff(self.run.position(name), axis=0), axis=1).max() * self.fps
            ways[k] = max(way, np.linalg.norm(self.run.velocity(name), axis=1).max() + arm * turns[k])
        return ways, turns


@cache
def runs() -> dict[str, tuple[Recording, dict[str, Any]]]:
    """Runs of scenes made by code, by name, with options of their export."""
    spot = gallery.load("spot").scene()
    thrown, fallen = ri.simulate(spot, 4.0, 60), ri.simulate(boxes(), 2.0, 24)
    made: dict[str, tuple[Recording, dict[str, Any]]] = {
        "spot on the torus": (thrown, {}),
        "spot, frame 1001": (thrown, {"start_frame": 1001}),
        "spot, 4 keys a frame": (thrown, {"samples": 4, "impact_keys": True}),
        "40 boxes": (fallen, {}),
        "40 boxes, tolerance 1e-4": (fallen, {"tolerance": 1e-4}),
        "a cloth on a ball": (ri.simulate(gallery.load("cloth_on_ball").scene(), 1.0, 30), {}),
    }
    spins = ri.Scene(gravity=(0, -9.81, 0))
    hammer = ri.Shape.compound([(ri.Shape.box((1.0, 0.1, 0.1)), (0.3, 0, 0), (1, 0, 0, 0)), (ri.Shape.box(0.3), (0.8, 0, 0), (1, 0, 0, 0))])
    for k, spin in enumerate((50.0, 76.0, 100.0, 300.0)):
        spins.add(ri.Body(f"hammer {spin:g}", hammer, position=(3.0 * k, 0, 0), velocity=(0, 4, 0), angular_velocity=(0.1 * spin, spin, 0)))
    made["fast spin"] = ri.simulate(spins, 1.0, 24), {}
    odd = ri.Scene(gravity=(-9.81, 0, 0))
    for k, name in enumerate(("a.b", "ab", "crate/[1]", "größe", "with space", "world", "position", "x" * 60)):
        odd.add(ri.Body(name, ri.Shape.box((1, 0.5, 0.25)), position=(0, 0, 2 * k), velocity=(3, 1, 0), angular_velocity=(1, 2, 3 + k)))
    made["X up, odd names"] = ri.simulate(odd, 1.0, 25), {}
    return made


def boxes() -> ri.Scene:
    """40 boxes that fall on a floor."""
    rng = np.random.default_rng(5)
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for k in range(40):
        place = (0.8 * (k % 4), 0.8 * (k // 4 % 3), 0.6 + 0.8 * (k // 12))
        q = rng.normal(size=4)
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.6, 0.4, 0.3)), position=place, orientation=q / np.linalg.norm(q)))
    return scene


def room() -> Any:
    """A glTF file with scales, a mirror, a matrix, cameras, and parents that move by each kind of key, in animations of their own."""
    turned = [0, 2, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]
    nodes: list[dict[str, Any]] = [
        {"name": "room", "translation": [1, 2, 3], "rotation": [HALF, 0, 0, HALF], "scale": [2, 2, 2], "children": [1, 4], "camera": 0},
        {"name": "crate", "scale": [0.5, 0.5, 0.5], "children": [2, 3], "extensions": physics({"mass": 1}, shaped())},
        {"name": "sticker", "mesh": 0, "translation": [0, 0.5, 0]},
        {"name": "rider", "mesh": 0, "translation": [0, 4, 0], "scale": [1, 2, 1], "extensions": physics({"mass": 1}, shaped())},
        {"name": "mirror", "scale": [-1, 1, 1], "children": [5]},
        {"name": "seen", "mesh": 0, "translation": [3, 0, 0], "extensions": physics({"mass": 1}, shaped())},
        {"name": "odd", "mesh": 0, "matrix": turned, "extensions": physics({"mass": 1}, shaped())},
        {"name": "cart", "children": [8, 9]},
        {"name": "load", "mesh": 0, "translation": [0, 1, 0], "extensions": physics({"mass": 1}, shaped(1))},
        {"name": "eye", "camera": 0, "translation": [0, 2, 5]},
        {"name": "lamp", "mesh": 0, "translation": [0, 8, 0]},
        {"name": "door", "mesh": 0, "translation": [-9, 0, 0], "extensions": physics(None, shaped())},
        {"name": "lift", "children": [13]},
        {"name": "cage", "translation": [20, 0, 0], "children": [14]},
        {"name": "guest", "mesh": 0, "translation": [0, 1, 0], "extensions": physics({"mass": 1}, shaped(1))},
        {"name": "witness", "camera": 0, "translation": [0, 9, 9], "extensions": physics({"mass": 1}, shaped())},
    ]  # fmt: skip
    file = with_physics(nodes, [BOX, BALL])
    file.mesh()
    file.tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]
    file.animate(10, "translation", [0, 1], [[0, 8, 0], [0, 9, 0]])
    file.animate(7, "translation", [0, 1, 2], [[0, 0, 0], [2, 0, 1], [4, 1, 0]])
    file.animate(7, "rotation", [0, 1, 2], [[0, 0, 0, 1], [0, HALF, 0, HALF], [0, 1, 0, 0]])
    file.animate(11, "translation", [0, 1], [[-9, 0, 0], [-9, 3, 0]])
    file.animate(12, "translation", [0, 0.51, 1.2], [[0, 0, 0], [0, 2, 0], [0, 3, 0]], "STEP")
    turns = [[0, 0, 0, 0], [0, 0, 0, 1], [1, 0, 0, 0], [1, 0, 0, 0], [HALF, 0, 0, HALF], [0, 0, 0, 0]]
    file.animate(13, "rotation", [0, 1.7], turns, "CUBICSPLINE")
    return file


def gltf_cases(folder: Path) -> list[Case]:
    """Write all .glb files into a folder."""
    cases = []
    for number, (name, (run, options)) in enumerate(runs().items()):
        path = run.export(folder / f"case{number}.glb", **options)
        same = {body: body for body in run.names}
        eye = {body: np.eye(3) for body in run.names}
        cases.append(Case(name, path, run, same, eye, options.get("start_frame", 0.0), options.get("tolerance", 0.0)))
    source = room().save(folder / "room.glb")
    scene = ri.load_scene(source)
    tree, data = unpack(source)
    rest = Player({**tree, "animations": []}, data)
    poses = {}
    for k, name in enumerate(("crate", "rider", "seen", "odd", "load", "guest", "witness")):
        x, q = smooth(49, scene[name].position, 1.0 + k)
        poses[name] = x, np.array([from_matrix(matrix) for matrix in to_matrix(q) @ to_matrix(scene[name].unit_orientation())])
    times = np.arange(49) / 24.0
    door = np.column_stack([0 * times - 9.0, 3.0 * np.minimum(times, 1.0), 0 * times])
    poses["door"] = door, np.tile([1.0, 0, 0, 0], (49, 1))
    run = recorded(scene, poses)
    stretch = {name: to_matrix(scene[name].unit_orientation()).T @ rest.world(rest.index(name), 0.0)[:3, :3] for name in scene.names}
    same = {name: name for name in scene.names}
    cases.append(Case("into a file", run.export(folder / "room_moving.glb"), run, same, stretch, cameras=("witness",)))
    shifted = run.export(folder / "room_1001.glb", start_frame=1001)
    cases.append(Case("into a file, frame 1001", shifted, run, same, stretch, 1001.0, cameras=("witness",)))
    return cases


def usd_cases(folder: Path) -> list[Case]:
    """Write all USD files into a folder; prims have the names of bodies as far as identifiers can be."""
    from pxr import Usd

    cases = []
    for number, (name, (run, options)) in enumerate(runs().items()):
        path = run.export(folder / f"case{number}.usdc", **options)
        stage = Usd.Stage.Open(str(path))
        prims = stage.GetPrimAtPath("/World").GetChildren()
        bodies = {prim.GetDisplayName(): prim.GetName() for prim in prims if prim.GetDisplayName() in run.names}
        eye = {body: np.eye(3) for body in run.names}
        cases.append(Case(name, path, run, bodies, eye, options.get("start_frame", 0.0), options.get("tolerance", 0.0)))
    return cases
