"""A contact sheet: one page with many runs side by side, which all play at the same time, with their parameters and figures.

The page draws all cells with one renderer and one camera, so that runs compare at a glance. Everything large is one block of bytes
(gzip in base64), which the index (JSON) cuts into arrays: vertices, normals and faces of each different shape; of each run positions
(f, m, 3) float32 and quaternions (f, m, 4) int16, x y z w, of the m bodies that move.
"""

from __future__ import annotations

import base64
import gzip
import html
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from rigidimpulse.core.colors import linear_of
from rigidimpulse.core.content_digest import digest_of
from rigidimpulse.core.json_text import json_text
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.origin import bodies_as_seen
from rigidimpulse.scene.shape import rotation_matrix
from rigidimpulse.view.camera import Path as Way
from rigidimpulse.view.camera import frame_action, up_axis
from rigidimpulse.view.display import DisplayMesh, display_mesh, display_planes
from rigidimpulse.view.materials import surface
from rigidimpulse.view.page import fill_template, viewer_files

SEGMENTS = 24
"""Corners of a full turn of round shapes: cells are small."""
MOST_FRAMES = 300
MOST_BYTES = 32_000_000
"""Of all motion together; where that does not do, frames are left out."""
BYTES_A_KEY = 20
SHORT = 32767
"""What 1 is written as in quaternions."""
SCRIPTS = ("look.js", "block.js", "sheet.js")
STYLES = ("page.css", "sheet.css")


@dataclass(frozen=True)
class Card:
    """One cell of the sheet.

    Attributes:
        name: of the run. recording: None for one that failed. page: file that the cell opens, beside the sheet; empty for none.
        parameters, measures: what is shown below the picture and can be sorted by, by name. outcome: "ok", "reported" or "failed".
        message: what is said of the outcome. final: what is said of the end.

    """

    name: str
    recording: Recording | None
    page: str
    parameters: dict[str, Any]
    measures: dict[str, float]
    outcome: str
    message: str
    final: str = ""


class Block:
    """Bytes that grow by arrays; an array is known by [offset in bytes, number of values]."""

    def __init__(self) -> None:
        self.bytes = bytearray()

    def add(self, array: np.ndarray) -> list[int]:
        """Put an array at the end; return its place."""
        self.bytes.extend(b"\0" * (-len(self.bytes) % 4))
        place = [len(self.bytes), array.size]
        self.bytes.extend(np.ascontiguousarray(array).tobytes())
        return place


class Shapes:
    """Different shapes of all runs."""

    def __init__(self) -> None:
        self.meshes: list[DisplayMesh] = []
        self._number: dict[str, int] = {}

    def number(self, shape: Any) -> int:
        """Number of a shape's mesh, -1 for none."""
        key = digest_of(shape)
        if key not in self._number:
            mesh = display_mesh(shape, SEGMENTS)
            self._number[key] = -1 if mesh is None else len(self.meshes)
            if mesh is not None:
                self.meshes.append(mesh)
        return self._number[key]


def write_sheet(path: Path, cards: Sequence[Card], title: str) -> None:
    """Write the page."""
    block, shapes, ways = Block(), Shapes(), []
    shown = [card for card in cards if card.recording is not None]
    moving = sum(len(movers_of(card.recording)) for card in shown if card.recording is not None)
    frames = int(np.clip(MOST_BYTES / (BYTES_A_KEY * max(moving, 1)), 2, MOST_FRAMES))
    entries = []
    for card in cards:
        entry: dict[str, Any] = {
            "name": card.name, "page": card.page, "parameters": card.parameters, "measures": card.measures, "outcome": card.outcome,
            "message": card.message, "final": card.final,
        }  # fmt: skip
        if card.recording is not None:
            motion, own_ways = motion_entry(card.recording, shapes, block, frames)
            entry["motion"] = motion
            ways += own_ways
        entries.append(entry)
    gravity = shown[0].recording.scene.gravity if shown and shown[0].recording is not None and shown[0].recording.scene else (0, 0, -1)
    index = {
        "framing": asdict(frame_action(ways, up_axis(gravity))),
        "shapes": [
            [block.add(array.astype(kind)) for array, kind in _arrays(mesh)]
            for mesh in shapes.meshes
        ],
        "cards": entries,
    }
    path.write_text(_page(index, bytes(block.bytes), title), encoding="utf-8")


def _arrays(mesh: DisplayMesh) -> list[tuple[np.ndarray, str]]:
    """The arrays of a mesh in the block, and how they are kept."""
    colors = [] if mesh.colors is None else [(linear_of(mesh.colors / 255.0), "f4")]
    return [(mesh.vertices, "f4"), (mesh.normals, "f4"), (mesh.faces, "u4"), *colors]


def _page(index: dict[str, Any], block: bytes, title: str) -> str:
    files, viewer = resources.files("rigidimpulse.view") / "page", viewer_files()
    fields = {
        "title": html.escape(title),
        "style": "\n".join((files / name).read_text(encoding="utf-8") for name in STYLES),
        "license": (viewer / "main.min.js.LICENSE.txt").read_text(encoding="utf-8").replace("--", "- -"),
        "meshcat": (viewer / "main.min.js").read_text(encoding="utf-8"),
        "block": base64.b64encode(gzip.compress(block, compresslevel=6, mtime=0)).decode("ascii"),
        "index": json_text(index).replace("<", "\\u003c"),
        "script": "\n".join((files / name).read_text(encoding="utf-8") for name in SCRIPTS),
    }
    return fill_template((files / "sheet.html").read_text(encoding="utf-8"), fields)


def movers_of(recording: Recording) -> list[int]:
    """Indices of the bodies that are not static."""
    assert recording.scene is not None
    return [i for i, body in enumerate(recording.scene.bodies) if body.motion != "static"]


def motion_entry(recording: Recording, shapes: Shapes, block: Block, frames: int) -> tuple[dict[str, Any], list[Way]]:
    """What the index says of a run, and the ways of its bodies."""
    assert recording.scene is not None
    bodies, movers = bodies_as_seen(recording.scene), movers_of(recording)
    chosen = np.unique(np.linspace(0, len(recording.times) - 1, frames).round().astype(int))
    entries, ways, number_of_movers = [], [], 0
    for i, body in enumerate(bodies):
        number = shapes.number(body.drawn_shape)
        position, orientation = recording.positions[:, i], recording.orientations[:, i]
        paint = None if body.visual is None else body.visual.hex_color()
        planes = [[*normal.tolist(), offset, paint] for normal, offset in display_planes(body.drawn_shape)]
        entries.append({
            "shape": number, "planes": planes, "track": movers.index(i) if i in movers else -1,
            "surface": surface(number_of_movers, body, shapes.meshes[number] if number >= 0 else None), "position": position[0].tolist(),
            "quaternion": orientation[0, [1, 2, 3, 0]].tolist(),
        })  # fmt: skip
        number_of_movers += i in movers
        if number >= 0:
            vertices = shapes.meshes[number].vertices
            still = None if i in movers else position[0] + vertices @ rotation_matrix(orientation[0]).T
            radius = float(np.linalg.norm(vertices, axis=1).max())
            ways.append(Way(f"{len(block.bytes)} {body.name}", position[chosen], radius, i in movers, still))
    shorts = np.round(recording.orientations[chosen][:, movers][..., [1, 2, 3, 0]] * SHORT).astype(np.int16)
    motion = {
        "bodies": entries, "times": recording.times[chosen].round(6).tolist(),
        "position": block.add(recording.positions[chosen][:, movers].astype(np.float32)), "quaternion": block.add(shorts),
    }  # fmt: skip
    return motion, ways
