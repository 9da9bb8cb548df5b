"""What a live page is told: meshcat's messages, each about one run while it is computed.

All hang on the node /live. Text is JSON, numbers are a Float32Array:

    shape      number, number of vertices, whether they have colours, vertices (3 each), their normals (3 each), colours (3 each) if
               they have some, triangles (3 vertices each)
    begin      manifest of a run: number, frames, bodies, framing, controls; its shapes came before it
    frames     first frame, then for each frame and each body that can move its position (3) and its quaternion x y z w
    impacts    first arrow, then the arrows, see `arrows.impulse_rows`; in the place of a card they have the number of the impact
    softBody   number, faces and surface of a flexible body
    softFrames number, first frame, then the vertices (3 each) of each frame
    framing    where the camera looks from, now that more of the motion is known
    state      what the computation does, how far it is, and what is wrong
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from rigidimpulse.core.colors import linear_of
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import normalized_quaternion
from rigidimpulse.view.arrows import LEAST_LENGTH, fade_time, impulse_rows, longest_arrow
from rigidimpulse.view.camera import Framing
from rigidimpulse.view.contents import SOFT_BODY_COLOUR, page_scene
from rigidimpulse.view.display import DisplayMesh
from rigidimpulse.view.materials import soft_body_surface
from rigidimpulse.view.protocol import RecordingLike, SoftBodyLike
from rigidimpulse.view.soft_bodies import is_closed
from rigidimpulse.view.tracks import pack_float32, quaternion_keys

NODE = "live"
AHEAD = 0.25
"""s, how far bodies are thought to fly freely for the first view of a scene of which no frame is computed yet."""
POSE = 7
"""Numbers of a pose."""


@dataclass(frozen=True)
class Motion:
    """Some frames of a scene, as the viewer reads them: positions (f, n, 3) m of body origins, orientations (f, n, 4) wxyz."""

    scene: Scene
    times: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray
    soft_bodies: Sequence[SoftBodyLike] = ()
    impacts: np.ndarray = field(default_factory=lambda: np.zeros(0))
    contacts: np.ndarray = field(default_factory=lambda: np.zeros(0))
    ledger: None = None
    status: None = None

    def position(self, name: str) -> np.ndarray:
        """Origin (f, 3) m of a body."""
        return self.positions[:, self.scene.names.index(name)]

    def orientation(self, name: str) -> np.ndarray:
        """Orientation (f, 4) wxyz of a body."""
        return self.orientations[:, self.scene.names.index(name)]

    def center_of_mass(self, name: str) -> np.ndarray:
        """The origin (f, 3) m: a live page draws no trails."""
        return self.position(name)


def motion_at_start(scene: Scene) -> Motion:
    """Return the poses of a scene as it is written, and those of bodies that fly freely for `AHEAD`."""
    gravity = np.asarray(scene.gravity, float)
    position = np.array([np.asarray(body.position, float) for body in scene.bodies]).reshape(-1, 3)
    orientation = np.array([normalized_quaternion(body.orientation) for body in scene.bodies]).reshape(-1, 4)
    velocity = np.array([np.asarray(body.velocity, float) for body in scene.bodies]).reshape(-1, 3)
    flies = np.array([body.motion == "dynamic" for body in scene.bodies], bool)[:, None]
    later = position + AHEAD * np.where(flies, velocity + 0.5 * AHEAD * gravity, 0.0)
    return Motion(scene, np.array([0.0, AHEAD]), np.stack([position, later]), np.stack([orientation, orientation]))


def movers_of(scene: Scene) -> np.ndarray:
    """Indices of the bodies that can move."""
    return np.flatnonzero([body.motion != "static" for body in scene.bodies])


def begin_messages(number: int, scene: Scene, times: np.ndarray, panel: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the messages of a run at its start: the shapes, then its manifest.

    Args:
        number: of the run.
        scene: what is simulated.
        times: (f,) s, of all frames.
        panel: what can be changed ("controls", see `studies.live.controls`), what was ("chosen", by name), and the number of "throws".

    """
    framing, drawn = page_scene(motion_at_start(scene))
    meshes: dict[int, DisplayMesh] = {id(mesh): mesh for _, mesh, _, _ in drawn if mesh is not None}
    numbers = {key: number for number, key in enumerate(meshes)}
    manifest = {
        "number": number,
        "frames": len(times),
        "duration": float(times[-1]),
        "bodies": [_entry(k, *parts, numbers) for k, parts in enumerate(drawn)],
        "framing": asdict(framing),
        "movers": movers_of(scene).tolist(),
        "dynamic": [body.name for body in scene.bodies if body.motion == "dynamic"],
        "fade": fade_time(float(times[-1])),
        **panel,
        **_arrow_sizes(framing),
    }
    return [_shape_message(number, mesh) for number, mesh in enumerate(meshes.values())] + [text_message("begin", manifest)]


def _entry(
    index: int, body: Any, mesh: DisplayMesh | None, surface: dict[str, Any], planes: list[dict[str, Any]], numbers: dict[int, int]
) -> dict[str, Any]:
    """Return what the manifest says of a body; numbers: of the meshes, by their identity."""
    shape = -1 if mesh is None else numbers[id(mesh)]
    return {
        "name": body.name,
        "folder": "ground" if planes and mesh is None else "bodies",
        "key": str(index),
        "shape": shape,
        "rendered": -1,
        "surface": surface,
        "planes": planes,
        "position": np.asarray(body.position, float).tolist(),
        "quaternion": quaternion_keys(normalized_quaternion(body.orientation)[None])[0].tolist(),
    }


def _shape_message(number: int, mesh: DisplayMesh) -> dict[str, Any]:
    """Return the message with the geometry of a shape."""
    colors = [] if mesh.colors is None else [linear_of(mesh.colors / 255.0)]
    parts = map(np.ravel, (mesh.vertices, mesh.normals, *colors, mesh.faces))
    return number_message("shape", number, np.concatenate([[len(mesh.vertices), len(colors)], *parts]))


def _arrow_sizes(framing: Framing) -> dict[str, float]:
    """Longest and shortest arrow, m, of a page with this framing."""
    longest = longest_arrow(float(np.linalg.norm(framing.half)), framing.body_radius)
    return {"longestArrow": longest, "shortestArrow": LEAST_LENGTH * longest}


def framing_message(recording: RecordingLike) -> dict[str, Any]:
    """Return the message with the camera for the motion as far as it is known."""
    framing = page_scene(recording)[0]
    return text_message("framing", {"framing": asdict(framing), **_arrow_sizes(framing)})


def frames_message(first: int, positions: np.ndarray, orientations: np.ndarray) -> dict[str, Any]:
    """Return the message with the poses of bodies that can move, (f, m, 3) m and (f, m, 4) wxyz, from frame `first` on."""
    rows = np.concatenate([positions, orientations[..., [1, 2, 3, 0]]], axis=-1)
    return number_message("frames", first, rows)


def impacts_message(first: int, first_impact: int, impacts: np.ndarray, dynamic: Sequence[bool]) -> tuple[dict[str, Any], int]:
    """Return the message with the arrows of impacts, and how many arrows they are; first, first_impact: numbers of the first of each."""
    rows = impulse_rows(impacts, dynamic, np.arange(len(impacts)))
    rows[:, 11] += first_impact
    return number_message("impacts", first, rows), len(rows)


def text_message(name: str, value: Any) -> dict[str, Any]:
    """Return a message of which the page gets JSON."""
    return _message(name, json.dumps(value, ensure_ascii=False, allow_nan=False))


def soft_body_message(track: SoftBodyLike, number: int, num_coloured: int) -> dict[str, Any]:
    """Return the message with the faces of a flexible body; num_coloured: how many bodies have a colour of the palette before them."""
    closed = is_closed(track.faces)
    surface = soft_body_surface(num_coloured + SOFT_BODY_COLOUR + number, closed)
    entry = {"number": number, "faces": track.faces.ravel().tolist(), "vertices": track.vertices.shape[1]}
    return text_message("softBody", entry | {"surface": surface, "thin": not closed})


def soft_frames_message(number: int, first: int, vertices: np.ndarray) -> dict[str, Any]:
    """Return the message with the vertices (f, v, 3) m of a flexible body from frame `first` on."""
    return number_message("softFrames", number, np.concatenate([[first], vertices.ravel()]))


def number_message(name: str, first: int, values: np.ndarray) -> dict[str, Any]:
    """Return a message of which the page gets a Float32Array: `first`, then the values."""
    return _message(name, pack_float32(np.concatenate([[first], np.ravel(values)])))


def _message(name: str, value: Any) -> dict[str, Any]:
    return {"type": "set_property", "path": f"/{NODE}", "property": name, "value": value}
