"""Animated nodes as keyframes: the rigid frame of a node whose own or whose parents' transforms have channels.

Keys are taken at the times of all channels of the chain of nodes; where more than one node turns, or a channel is not
linear, also every `BETWEEN` s and where that is not enough, since what is in between is no even motion there. STEP channels
move over the last `BETWEEN` s before a key: a jump has no velocity to push with.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.quaternion import multiply, quaternion_continuity, to_matrix
from rigidimpulse.io.gltf.nodes import Hierarchy, Local
from rigidimpulse.io.keys import MOST_KEYS, Keys, refined
from rigidimpulse.scene.keyframes import Keyframes

BETWEEN = 1.0 / 60.0
PATHS = {"translation": 3, "rotation": 4, "scale": 3}


class Track(NamedTuple):
    """Keys of one channel: times (k,) s, values (k, w), tangents (k, 2, w) in and out of CUBICSPLINE, how they join."""

    times: np.ndarray
    values: np.ndarray
    tangents: np.ndarray | None
    join: str

    def at(self, times: np.ndarray) -> np.ndarray:
        """Values (t, w) at times, held outside the keys; rotations are not yet unit."""
        keys, values = self.times, self.values
        if len(keys) == 1:
            return np.repeat(values, len(times), axis=0)
        k = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, len(keys) - 2)
        h = keys[k + 1] - keys[k]
        s = np.clip((times - keys[k]) / h, 0.0, 1.0)
        if self.join == "STEP":
            s = np.clip(1.0 - (keys[k + 1] - times) / np.minimum(BETWEEN, h), 0.0, 1.0)
        s, h = s[:, None], h[:, None]
        a, b = values[k], values[k + 1]
        if self.tangents is not None:
            out, into = h * self.tangents[k, 1], h * self.tangents[k + 1, 0]
            return (2 * s**3 - 3 * s**2 + 1) * a + (s**3 - 2 * s**2 + s) * out + (3 * s**2 - 2 * s**3) * b + (s**3 - s**2) * into
        if a.shape[1] == 4:
            return _turned(a, b, s)
        return a + s * (b - a)

    def between(self) -> np.ndarray:
        """Times (t,) s of more keys, with which linear ones do what this channel does."""
        if self.join == "STEP":
            return self.times[1:] - np.minimum(BETWEEN, np.diff(self.times))
        span = self.times[-1] - self.times[0] if self.join == "CUBICSPLINE" else 0.0
        return self.times[0] + BETWEEN * np.arange(1, int(min(span / BETWEEN, MOST_KEYS)) + 1)


def _turned(a: np.ndarray, b: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Quaternions (t, 4) on the shorter arc from a to b."""
    cosine = np.sum(a * b, axis=1, keepdims=True)
    b, cosine = np.where(cosine < 0.0, -b, b), np.minimum(np.abs(cosine), 1.0)
    angle = np.arccos(cosine)
    sine = np.where(angle > 1e-6, np.sin(angle), 1.0)
    near = angle <= 1e-6
    return np.where(near, 1.0 - s, np.sin((1.0 - s) * angle) / sine) * a + np.where(near, s, np.sin(s * angle) / sine) * b


class Animations:
    """All channels of a file that move nodes; where two animations move the same, the first one counts.

    Attributes:
        tracks: by node and path. notes: what is not read.

    """

    def __init__(self, hierarchy: Hierarchy) -> None:
        """Read the channels; raises a `SceneError` for broken ones."""
        file = hierarchy.file
        self.hierarchy = hierarchy
        self.tracks: dict[tuple[int, str], Track] = {}
        self.notes: list[str] = []
        for number, animation in enumerate(file.document.animations):
            for channel in animation.channels:
                node, path = channel.target.node, channel.target.path
                if node is None:
                    continue
                file.entry(file.document.nodes, node, "node")
                name = hierarchy.names[node]
                if path not in PATHS:
                    self.notes.append(f"animation of {path} of node {name!r} is not collided with: as a collider it stays as it is at rest")
                elif (node, path) in self.tracks:
                    self.notes.append(f"animation {animation.name or number} moves {path} of node {name!r}, as another does: left out")
                else:
                    self.tracks[node, path] = self._track(number, channel.sampler, PATHS[path])
                    if path == "scale":
                        self.notes.append(f"animation of the scale of node {name!r} is not read: bodies are rigid")
        self._animated = hierarchy.counted(lambda node: any((node, path) in self.tracks for path in ("translation", "rotation")))

    def _track(self, number: int, index: int, width: int) -> Track:
        file = self.hierarchy.file
        where = f"animation {number}"
        sampler = file.entry(file.document.animations[number].samplers, index, "sampler")
        times = np.asarray(file.array(sampler.input, "SCALAR"), float)
        values = np.asarray(file.array(sampler.output, f"VEC{width}"), float)
        if len(times) == 0 or np.any(np.diff(times) <= 0.0):
            raise file.error("times of keys do not increase", "export the file again", where)
        cubic = sampler.interpolation == "CUBICSPLINE"
        if len(values) != len(times) * (3 if cubic else 1):
            raise file.error(f"{len(times)} times but {len(values)} values", "export the file again", where)
        tangents = None
        if cubic:
            triple = values.reshape(-1, 3, width)
            values, tangents = triple[:, 1], triple[:, [0, 2]]
        if width == 4:
            if np.any(np.linalg.norm(values, axis=1) < 1e-3):
                raise file.error("a rotation is zero", "export the file again", where)
            values = values[:, [3, 0, 1, 2]]
            tangents = None if tangents is None else tangents[:, :, [3, 0, 1, 2]]
        return Track(times, values, tangents, sampler.interpolation)

    def moves(self, node: int) -> bool:
        """Whether a node, or one above it, is animated as a rigid body is."""
        return self._animated[node] > 0

    def moves_against(self, node: int, above: int) -> bool:
        """Whether a node is animated against one above it."""
        return self._animated[node] > self._animated[above]

    def local(self, node: int, times: np.ndarray) -> Local:
        """Transforms of a node against its parent at times: (t, 3), (t, 4), and the scale (3,) at rest."""
        rest = self.hierarchy.local[node]
        place, turn = (self.tracks.get((node, path)) for path in ("translation", "rotation"))
        x = np.tile(rest.translation, (len(times), 1)) if place is None else place.at(times)
        q = np.tile(rest.rotation, (len(times), 1)) if turn is None else turn.at(times)
        length = np.linalg.norm(q, axis=1, keepdims=True)
        return Local(x, q / np.where(length > 0.0, length, 1.0) + np.where(length > 0.0, 0.0, [1.0, 0.0, 0.0, 0.0]), rest.scale)

    def keys(self, node: int, times: np.ndarray, apart: float) -> Keys:
        """Linear keys of a node against its parent: at times (t,) s, and where it needs some to go as its channels say.

        apart: s, least time between keys.
        """
        own = [times]
        for path in ("translation", "rotation"):
            track = self.tracks.get((node, path))
            if track is not None:
                own += [track.times, track.between()]
        extra = np.unique(np.concatenate(own[1:]))
        extra = extra[np.diff(extra, prepend=-np.inf) > apart]
        after = np.searchsorted(times, extra)
        bounds = np.concatenate([[-np.inf], times, [np.inf]])
        extra = extra[np.minimum(extra - bounds[after], bounds[after + 1] - extra) > apart]
        made = np.union1d(times, extra)
        x, q, _ = self.local(node, made)
        return Keys(made, x, quaternion_continuity(q))

    def frames(self, node: int, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rigid frame of a node at times, (t, 3) m and (t, 4) wxyz, and the linear part of its world matrix (t, 3, 3)."""
        x, q = np.zeros((len(times), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))
        linear = np.tile(np.eye(3), (len(times), 1, 1))
        for k in reversed(self.hierarchy.chain(node)):
            local = self.local(k, times)
            x = x + np.einsum("tij,tj->ti", linear, local.translation)
            linear = linear @ (to_matrix(local.rotation) * local.scale)
            q = multiply(q, local.rotation)
        return x, q, linear

    def keyframes(self, node: int) -> Keyframes:
        """Keyframes of the rigid frame of a node that moves."""
        tracks = [(k, path, self.tracks.get((k, path))) for k in self.hierarchy.chain(node) for path in ("translation", "rotation")]
        used = [(path, track) for _, path, track in tracks if track is not None]
        times = np.unique(np.concatenate([track.times for _, track in used]))
        turning = {k for k, path, track in tracks if path == "rotation" and track is not None}
        above = self.hierarchy.chain(node)[1:]
        if any(track.join != "LINEAR" for _, track in used) or len(turning) > 1 or turning.intersection(above):
            count = int((times[-1] - times[0]) / BETWEEN) + 1
            if count > MOST_KEYS:
                raise self.hierarchy.file.error(f"an animation lasts {times[-1] - times[0]:g} s", "shorten it")
            between = times[0] + BETWEEN * np.arange(1, count)
            before = np.concatenate([track.times[1:] - np.minimum(BETWEEN, np.diff(track.times)) for _, track in used])
            times = np.unique(np.concatenate([times, between, before]))
            times = times[np.concatenate([[True], np.diff(times) > 1e-9])]
            return Keyframes(*refined(times, lambda at: self.frames(node, at)[:2]))
        x, q, _ = self.frames(node, times)
        return Keyframes(times, x, quaternion_continuity(q))
