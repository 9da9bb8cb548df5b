"""Motion into a glTF file: the file that the scene came from with its nodes animated, or one node a body.

A node of a body has the world pose (x, Q) of the body at each key and the world matrix M_p of its parent then; its own
translation and rotation are those with

    x = x_p + M_p t,        Q K = M_p R S

with K and S, its scales at rest. Where a parent with uneven scale would shear the body there is no such R: the nearest is
written, and logged. Only what moves has keys; channels that the file has for nodes of bodies are replaced.

Programs show the first animation alone, so all that moves in the run is in that one: also the channels of the file that move what
is no body, by the same time s_0 later as the run, s_0 the time of the first frame. Blender turns evenly by components of the
quaternion and splines by rules of its own, so nodes above bodies have linear keys wherever these have some: there M_p is what it was.
"""

from __future__ import annotations

import json
import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import angle_between, conjugate, from_matrix, multiply, quaternion_continuity, to_matrix
from rigidimpulse.io.gltf.container import Builder
from rigidimpulse.io.gltf.draw import Drawing, new_file, node_pose, stage
from rigidimpulse.io.gltf.extensions import state_extensions
from rigidimpulse.io.gltf.morph import add_soft_bodies
from rigidimpulse.io.gltf.nodes import Hierarchy
from rigidimpulse.io.gltf.origin import Origin
from rigidimpulse.io.keys import Keys
from rigidimpulse.io.keys import Path as BodyPath
from rigidimpulse.io.motion import Motion, check_options

if TYPE_CHECKING:
    from pathlib import Path

    from rigidimpulse.recording.exporters import ExportOptions, ExportTarget
    from rigidimpulse.recording.recording import Recording

logger = logging.getLogger("rigidimpulse")

EVEN = 1e-6
"""Unevenness of the scale of parents, relative, that is none."""
ELSEWHERE = 1e-9
"""m and rad, from the place of a node on which a body that stands has a key."""
APART = 4.0
"""Units in the last place of single precision between keys, at least."""
ANIMATION = "rigidimpulse"
"""Name of the animation, and key of the status in the extras of the asset."""
WARNINGS = "rigidimpulse warnings"
"""Key of the warnings in the extras of scenes."""


def check_gltf(path: Path, options: ExportOptions, _scene: Any = None) -> None:
    """See `Exporter.check`."""
    check_options(options)
    if (options.up_axis, options.unit) != (None, 1.0):
        raise SceneError(f"up_axis or unit for {path.name!r}", "glTF is Y up and in metres: leave them out, or write USD")


def write_gltf(run: Recording, target: ExportTarget) -> None:
    """Write a .glb or .gltf file of a run.

    Args:
        run: with its scene. target: where, and the options; the suffix of its path chooses the kind.

    Raises:
        SceneError: an option makes no sense, a pose is not finite, or a file beside the scene is gone.

    """
    options = target.options
    motion = Motion(run, options)
    paths, scene = motion.paths, motion.scene
    origin = scene.origin if isinstance(scene.origin, Origin) else None
    builder, locals_ = _from_origin(origin, motion) if origin else _from_scene(motion)
    shift = options.start_frame * float(run.times[1] - run.times[0]) if len(run.times) > 1 else 0.0
    writer = _Channels(builder, shift, options.only_moved)
    above: dict[int, list[np.ndarray]] = {}
    for name in paths:
        if name in locals_.node_of and locals_.is_keyed(name, motion):
            keys = motion.keys(name)
            writer.add(locals_.node_of[name], locals_.of(name, keys))
            for node in locals_.animated_above(name):
                above.setdefault(node, []).append(keys.times)
    for node, times in above.items():
        assert origin
        writer.add(node, origin.animations.keys(node, np.unique(np.concatenate(times)), writer.apart(float(run.times[-1]))))
    if run.soft_bodies:
        colour = sum(body.motion != "static" for body in scene.bodies)
        for node, frames, weights in add_soft_bodies(builder, run.soft_bodies, scene.gravity, colour, options.tolerance):
            if len(frames) > 1:
                writer.add_weights(node, run.times[frames], weights)
    if locals_.sheared:
        logger.warning("parents of uneven scale: the turn of %s is not exact in the file", ", ".join(sorted(locals_.sheared)))
    if origin:
        _drop_channels(builder.tree, set(writer.nodes))
        writer.take_over(origin)
        state_extensions(builder.tree)
    writer.close()
    _add_status(builder.tree, run)
    builder.write(target.path)


def _add_status(tree: dict[str, Any], run: Recording) -> None:
    """Write the status into the extras of the asset; Blender shows those of the scene, so warnings are there, too."""
    asset = tree["asset"]
    asset["extras"] = _flags(asset) | {ANIMATION: run.status.data()}
    if not run.status.ok:
        for scene in tree.get("scenes", []):
            scene["extras"] = _flags(scene) | {WARNINGS: list(run.status.warnings)}


def _flags(entry: dict[str, Any]) -> dict[str, Any]:
    """The extras of an entry; those that are no table cannot have another key."""
    extras = entry.get("extras")
    return extras if isinstance(extras, dict) else {}


class _Locals:
    """Nodes of bodies, and their transforms against their parents."""

    def __init__(self, node_of: dict[str, int], paths: dict[str, BodyPath], origin: Origin | None) -> None:
        self.node_of, self._paths, self._origin = node_of, paths, origin
        self.sheared: set[str] = set()
        self._name_of = {node: name for name, node in node_of.items()}
        if origin is not None:
            hierarchy = origin.animations.hierarchy
            self._carried = hierarchy.counted(lambda node: self._name_of.get(node) in paths)
            self._mirrored = hierarchy.counted(lambda node: bool(np.any(hierarchy.local[node].scale < 0.0)))

    def is_keyed(self, name: str, motion: Motion) -> bool:
        """Whether a body has keys: it moves, or it is not where its node is in the file, or all have some."""
        node = self.node_of[name]
        if motion.is_keyed(name) or self._origin is None or node >= len(self._origin.animations.hierarchy.nodes):
            return motion.is_keyed(name)
        hierarchy, path = self._origin.animations.hierarchy, self._paths[name]
        way = np.abs(path.positions[0] - hierarchy.position(node)).max()
        return bool(max(way, angle_between(path.orientations[0], hierarchy.turn[node])) > ELSEWHERE)

    def animated_above(self, name: str) -> list[int]:
        """Nodes above a body that the file moves and the run does not."""
        node = self.node_of[name]
        if self._origin is None or node >= len(self._origin.animations.hierarchy.nodes):
            return []
        animations = self._origin.animations
        above = []
        for k in animations.hierarchy.chain(node)[1:]:
            carrier = self._name_of.get(k)
            if carrier is not None and self._paths[carrier].moves:
                break
            if any((k, path) in animations.tracks for path in ("translation", "rotation")):
                above.append(k)
        return above

    def of(self, name: str, keys: Keys) -> Keys:
        """Keys of a body as its node has them."""
        node = self.node_of[name]
        if self._origin is None or node >= len(self._origin.animations.hierarchy.nodes):
            return keys
        hierarchy = self._origin.animations.hierarchy
        parent = hierarchy.parent[node]
        if parent < 0:
            return keys
        x, matrix = self._world(parent, keys.times)
        position = np.linalg.solve(matrix, (keys.positions - x)[:, :, None])[:, :, 0]
        return Keys(keys.times, position, quaternion_continuity(self._turn(name, node, keys, matrix, hierarchy)))

    def _turn(self, name: str, node: int, keys: Keys, matrix: np.ndarray, hierarchy: Hierarchy) -> np.ndarray:
        """Rotations (k, 4) of a node below parents with world matrices (k, 3, 3)."""
        local = hierarchy.local[node]
        scale = np.cbrt(np.abs(np.linalg.det(matrix)))[:, None, None]
        fixed = np.abs(matrix - matrix[0]).max() <= EVEN * float(scale[0, 0, 0])
        even = np.abs(matrix[0] / scale[0] @ (matrix[0] / scale[0]).T - np.eye(3)).max() <= EVEN
        if fixed and even and np.linalg.det(matrix[0]) > 0.0 and not self._mirrored[hierarchy.parent[node]]:
            return multiply(conjugate(from_matrix(matrix[0] / scale[0])), keys.orientations)
        stretch = to_matrix(hierarchy.turn[node]).T @ hierarchy.world[node, :3, :3]
        own = np.linalg.solve(matrix, to_matrix(keys.orientations) @ stretch) / local.scale
        u, _, v = np.linalg.svd(own)
        nearest = u @ v
        if np.abs(nearest - own).max() > EVEN * 10.0:
            self.sheared.add(name)
        return from_matrix(nearest)

    def _world(self, node: int, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Origin (k, 3) and linear part of the world matrix (k, 3, 3) of a node at times: up to what is known, and down again."""
        assert self._origin is not None
        animations = self._origin.animations
        between: list[int] = []
        while node >= 0 and (self._carried[node] or animations.moves(node)) and not self._moves(node):
            between.append(node)
            node = animations.hierarchy.parent[node]
        x, linear = self._known(node, times)
        for k in reversed(between):
            local = animations.local(k, times)
            x, linear = x + np.einsum("kij,kj->ki", linear, local.translation), linear @ (to_matrix(local.rotation) * local.scale)
        return x, linear

    def _moves(self, node: int) -> bool:
        """Whether the run moves the body of a node."""
        name = self._name_of.get(node)
        return name is not None and self._paths[name].moves

    def _known(self, node: int, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Origin and linear part, as `_world`, of a node that stands or that the run moves; of the world for -1."""
        assert self._origin is not None
        hierarchy, shape = self._origin.animations.hierarchy, (len(times), 1, 1)
        if node < 0:
            return np.zeros((len(times), 3)), np.tile(np.eye(3), shape)
        if not self._moves(node):
            return np.tile(hierarchy.position(node), (len(times), 1)), np.tile(hierarchy.world[node, :3, :3], shape)
        path = self._paths[self._name_of[node]].at(times)
        stretch = to_matrix(hierarchy.turn[node]).T @ hierarchy.world[node, :3, :3]
        return path.positions, to_matrix(path.orientations) @ stretch


class _Channels:
    """Channels of one animation, all values in one buffer view."""

    def __init__(self, builder: Builder, shift: float, only_changes: bool) -> None:
        self._builder, self._shift, self._only_changes = builder, shift, only_changes
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        self._data: list[bytes] = []
        self._length = 0
        self._times: dict[bytes, int] = {}
        self._values: list[dict[str, Any]] = []
        self.nodes: list[int] = []

    def add(self, node: int, keys: Keys) -> None:
        """Add the channels of a node, or those of them that change or are not what the node has at rest."""
        entry = self._builder.tree["nodes"][node]
        _use_parts(entry)
        self.nodes.append(node)
        parts = ("translation", keys.positions, [0, 0, 0]), ("rotation", keys.orientations[:, [1, 2, 3, 0]], [0, 0, 0, 1])
        for path, values, rest in parts:
            there = np.array(entry.get(path, rest), float)
            changes = bool(np.any(values != values[0]))
            off = min(np.abs(values[0] - there).max(), np.abs(values[0] + there).max() if path == "rotation" else np.inf)
            if changes or not self._only_changes or off > EVEN * max(1.0, float(np.abs(there).max())):
                count = len(keys.times) if changes or not self._only_changes else 1
                sampler = {"input": self._input(keys.times[:count]), "output": self._accessor(values[:count])}
                self._samplers.append(sampler)
                self._channels.append({"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}})

    def apart(self, last: float) -> float:
        """Return the least time between keys, s, in a run that ends at `last` s."""
        return APART * float(np.spacing(np.float32(last + self._shift)))

    def add_weights(self, node: int, times: np.ndarray, weights: np.ndarray) -> None:
        """Add the channel of the morph targets of a node, weights (k, targets)."""
        self._samplers.append({"input": self._input(times), "output": self._accessor(weights.reshape(-1, 1))})
        self._channels.append({"sampler": len(self._samplers) - 1, "target": {"node": node, "path": "weights"}})

    def _input(self, times: np.ndarray) -> int:
        data = (times + self._shift).astype(np.float32)
        if np.any(np.diff(data) <= 0.0):
            raise SceneError(f"keys near {data[-1]:g} s are too close for single precision", "give a smaller start_frame or fps")
        key = data.tobytes()
        if key not in self._times:
            self._times[key] = self._accessor(data[:, None], bounds=True)
        return self._times[key]

    def _accessor(self, values: np.ndarray, bounds: bool = False) -> int:
        data = values.astype(np.float32)
        if data.shape[1] == 4:
            # Rounded to single precision and made unit again, so that players need not.
            data = (data / np.linalg.norm(data.astype(float), axis=1, keepdims=True)).astype(np.float32)
        entry: dict[str, Any] = {"byteOffset": self._length, "componentType": 5126, "count": len(data)}
        entry["type"] = "SCALAR" if data.shape[1] == 1 else f"VEC{data.shape[1]}"
        if bounds:
            entry |= {"min": [float(data.min())], "max": [float(data.max())]}
        self._data.append(data.tobytes())
        self._length += data.nbytes
        self._values.append(entry)
        return self._builder.add("accessors", entry)

    def take_over(self, origin: Origin) -> None:
        """Move the channels that the file still has here; of two that move the same the first, as in the scene. Others stay."""
        file, tree = origin.animations.hierarchy.file, self._builder.tree
        targets: set[str] = set()
        taken: dict[tuple[int, int], int] = {}
        for number, animation in enumerate(tree.get("animations", [])):
            left = []
            for channel in animation["channels"]:
                target = json.dumps(channel["target"], sort_keys=True)
                if target in targets:
                    left.append(channel)
                    continue
                targets.add(target)
                key = number, channel["sampler"]
                if key not in taken:
                    sampler = animation["samplers"][channel["sampler"]]
                    times = np.asarray(file.array(sampler["input"], "SCALAR"), float)
                    taken[key] = len(self._samplers)
                    self._samplers.append({**sampler, "input": self._input(times)})
                self._channels.append({**channel, "sampler": taken[key]})
            animation["channels"] = left
        _drop_empty(tree)

    def close(self) -> None:
        """Put the animation into the file, before all others."""
        if not self._channels:
            return
        view = self._builder.view(b"".join(self._data))
        for entry in self._values:
            entry["bufferView"] = view
        animation = {"name": ANIMATION, "channels": self._channels, "samplers": self._samplers}
        self._builder.tree.setdefault("animations", []).insert(0, animation)


def _use_parts(entry: dict[str, Any]) -> None:
    """Let a node have translation, rotation and scale for a matrix: animated ones must."""
    if "matrix" in entry:
        matrix = np.array(entry.pop("matrix"), float).reshape(4, 4).T
        scale = np.linalg.norm(matrix[:3, :3], axis=0)
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            scale[0] = -scale[0]
        entry |= {"translation": matrix[:3, 3].tolist(), "scale": scale.tolist()}
        entry["rotation"] = from_matrix(matrix[:3, :3] / scale)[[1, 2, 3, 0]].tolist()


def _from_origin(origin: Origin, motion: Motion) -> tuple[Builder, _Locals]:
    """The file of the scene; bodies that were added since have nodes of their own."""
    builder, paths = origin.builder(), motion.paths
    node_of = {name: node for name, node in origin.node_of.items() if name in paths}
    fresh = [body for body in motion.scene.bodies if body.name not in origin.node_of and body.name not in origin.parts]
    if fresh:
        drawing = Drawing(builder, motion.half())
        scenes = builder.tree.setdefault("scenes", [{"nodes": list(origin.animations.hierarchy.roots)}])
        for number, body in enumerate(fresh):
            pose = node_pose(paths[body.name].positions[0], paths[body.name].orientations[0])
            node_of[body.name] = builder.add("nodes", {"name": body.name, "mesh": drawing.mesh(body, number), **pose})
            scenes[builder.tree.get("scene", 0)].setdefault("nodes", []).append(node_of[body.name])
    return builder, _Locals(node_of, paths, origin)


def _drop_channels(tree: dict[str, Any], nodes: set[int]) -> None:
    """Leave out the channels that move the nodes."""
    for animation in tree.get("animations", []):
        animation["channels"] = [
            channel for channel in animation["channels"]
            if channel["target"].get("node") not in nodes or channel["target"]["path"] not in ("translation", "rotation")
        ]  # fmt: skip
    _drop_empty(tree)


def _drop_empty(tree: dict[str, Any]) -> None:
    """Leave out animations without channels, and their list if it is empty."""
    kept = [animation for animation in tree.pop("animations", []) if animation["channels"]]
    if kept:
        tree["animations"] = kept


def _from_scene(motion: Motion) -> tuple[Builder, _Locals]:
    """A file with a node and a mesh for each body, Y up."""
    builder, root = new_file(), "world"
    while root in motion.paths:
        root += "_"
    parents, _ = stage(builder, motion.scene.gravity, root)
    drawing, node_of, moving = Drawing(builder, motion.half()), {}, 0
    for body in motion.scene.bodies:
        path = motion.paths[body.name]
        entry = {"name": body.name, "mesh": drawing.mesh(body, moving), **node_pose(path.positions[0], path.orientations[0])}
        moving += body.motion != "static"
        node_of[body.name] = builder.add("nodes", entry)
        parents.append(node_of[body.name])
    return builder, _Locals(node_of, motion.paths, None)
