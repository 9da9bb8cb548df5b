"""Flexible bodies in glTF files: a mesh with a morph target for each frame after the first, one of them on at each.

    vertex = base + sum_k w_k d_k,    d_k: frame k less frame 0,    w_k: 1 at frame k, 0 at the frames before and after

Between frames weights change evenly, so vertices are on straight lines, as the recording has them. With a tolerance frames are left out
that no vertex misses by more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rigidimpulse.io.gltf.draw import INDICES, VERTICES, Drawing, stage
from rigidimpulse.view.materials import soft_body_surface
from rigidimpulse.view.soft_bodies import is_closed

if TYPE_CHECKING:
    from rigidimpulse.dynamics.soft_body.track import FlexibleTrack
    from rigidimpulse.io.gltf.container import Builder


def add_soft_bodies(builder: Builder, tracks: list[FlexibleTrack], gravity: Any, colour: int, tolerance: float | None) -> list[Any]:
    """Add the nodes of flexible bodies; returns for each its node, the frames it has and their weights (k, targets).

    colour: number of the first one's colour. tolerance: m; None: all frames.
    """
    roots, _ = stage(builder, gravity, "flexible bodies")
    drawing, made = Drawing(builder, 0.0), []
    for number, track in enumerate(tracks):
        frames = kept_frames(track.vertices, tolerance)
        shapes = track.vertices[frames]
        normals = np.array([_normals(vertices, track.faces) for vertices in shapes])
        primitive = {
            "attributes": _target(builder, shapes[0], normals[0]),
            "indices": builder.array(np.ravel(track.faces).astype(np.uint32), "SCALAR", target=INDICES),
            "material": drawing.paint(soft_body_surface(colour + number, is_closed(track.faces)), track.name),
        }
        mesh: dict[str, Any] = {"name": track.name, "primitives": [primitive]}
        if len(frames) > 1:
            primitive["targets"] = [_target(builder, *pair) for pair in zip(shapes[1:] - shapes[0], normals[1:] - normals[0], strict=True)]
            mesh["weights"] = [0.0] * (len(frames) - 1)
        node = builder.add("nodes", {"name": track.name, "mesh": builder.add("meshes", mesh)})
        roots.append(node)
        made.append((node, frames, np.eye(len(frames))[:, 1:]))
    return made


def kept_frames(vertices: np.ndarray, tolerance: float | None) -> np.ndarray:
    """Frames of (f, v, 3) m between which no vertex leaves straight lines by more than the tolerance (Douglas, Peucker 1973); None: all."""
    last = len(vertices) - 1
    if tolerance is None or last < 1:
        return np.arange(last + 1) if np.any(vertices != vertices[0]) else np.arange(1)
    kept, waiting = {0, last}, [(0, last)]
    while waiting:
        low, high = waiting.pop()
        if high - low < 2:
            continue
        share = (np.arange(low + 1, high) - low)[:, None, None] / (high - low)
        straight = (1.0 - share) * vertices[low] + share * vertices[high]
        off = np.linalg.norm(vertices[low + 1 : high] - straight, axis=2).max(axis=1)
        if off.max() > tolerance:
            middle = low + 1 + int(off.argmax())
            kept.add(middle)
            waiting += [(low, middle), (middle, high)]
    return np.array(sorted(kept)) if len(kept) > 2 or np.abs(vertices[last] - vertices[0]).max() > tolerance else np.arange(1)


def _target(builder: Builder, positions: np.ndarray, normals: np.ndarray) -> dict[str, int]:
    return {
        "POSITION": builder.array(positions, "VEC3", bounds=True, target=VERTICES),
        "NORMAL": builder.array(normals, "VEC3", target=VERTICES),
    }


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals (v, 3), means of those of the faces about each vertex by their areas."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, faces[:, k], normal)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    unit = np.where(length > 0.0, total / np.where(length > 0.0, length, 1.0), [0.0, 0.0, 1.0])
    single = unit.astype(np.float32).astype(float)
    return single / np.linalg.norm(single, axis=1, keepdims=True)
