"""A still picture of a recording, drawn without a browser: triangles in a depth buffer, a light, the ground with shadows, trails, strings.

A point p of the scene, in the turned frame (Y up) of `camera`, is seen from the eye c with axes right r, over o and back b at

    x = f (p - c).r / w,   y = f (p - c).o / w,   w = -(p - c).b,   f = 1 / tan(half the field of view)

1 / w is linear on the picture, so it is what the depth buffer holds (the nearest has the largest), and what corners are weighted by.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.core.colors import seen_of_hex
from rigidimpulse.scene.shape import rotation_matrix
from rigidimpulse.view.camera import Framing, stage_rotation, up_axis
from rigidimpulse.view.contents import page_scene
from rigidimpulse.view.display import shade
from rigidimpulse.view.joints import fixed_anchors, joint_entries

HALF_TALL = np.tan(np.radians(17.5))
"""Tangent of half the field of view, up and down."""
MARGIN = 1.12
SUPERSAMPLING = 2
LIGHT = np.array([-0.55, 1.0, 0.42]) / np.linalg.norm([-0.55, 1.0, 0.42])
SKY, HORIZON, NADIR = np.array([176, 203, 233]) / 255.0, np.array([244, 240, 233]) / 255.0, np.array([196, 200, 204]) / 255.0
GROUND, LINES = np.array([205, 209, 213]) / 255.0, np.array([150, 160, 170]) / 255.0
STRING = np.array([74, 84, 94]) / 255.0
"""Colour of strings, rods and springs."""
DARKER = 0.75
"""Lines on ground that has a colour of its own, against it."""
CELLS = 12
"""Cells of the ground's grid, about, across the action."""
SOFT_BODY_COLOURS = np.array([[63, 157, 132], [140, 107, 177]]) / 255.0
DRAPE = 1.01
"""How much nearer flexible bodies are drawn: the faces of cloth cut into round bodies between its vertices."""
SHADOW = 0.3
"""Share of the light that shadows on the ground take."""
TRAIL_SECONDS = 1.0
PIXELS_AT_ONCE = 4_000_000


Level = tuple[float, str | None]
"""Level ground: its height in m, and its colour if it has one."""


class Camera(NamedTuple):
    """Eye (3,), axes right, over, back (3, 3) as rows, and pixels of the picture."""

    eye: np.ndarray
    axes: np.ndarray
    width: int
    height: int

    def seen(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels (..., 2) and depths w (...) of points (..., 3)."""
        across, over, back = np.moveaxis((points - self.eye) @ self.axes.T, -1, 0)
        depth = np.where(-back > 1e-9, -back, 1e-9)
        scale = 0.5 * self.height / HALF_TALL
        place = np.stack([0.5 * self.width + scale * across / depth, 0.5 * self.height - scale * over / depth], axis=-1)
        return place, -back


class Mesh(NamedTuple):
    """Triangles to draw in the turned frame: vertices and normals (v, 3), faces (t, 3), colour (3,) or one of each vertex (v, 3).

    `local` (v, 3) are the vertices in the body's frame, of round bodies, which are painted in octants; `nearer` is a factor of 1 / w.
    """

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    colour: np.ndarray
    local: np.ndarray | None = None
    nearer: float = 1.0


def draw_picture(recording: Any, width: int = 640, height: int = 400, frame: int | None = None) -> np.ndarray:
    """Return a picture (height, width, 3) of 0..255.

    Args:
        recording: a run with its scene.
        width: pixels.
        height: pixels.
        frame: index of the frame; None: one after the strongest impact, or after a third of the run.

    Raises:
        ValueError: the recording has no frames, or a pose is not finite.

    """
    frame = telling_frame(recording) if frame is None else frame
    framing, drawn = page_scene(recording, fixed_anchors(recording))
    rotation = stage_rotation(up_axis(recording.scene.gravity))
    if framing.follow:
        middle = np.mean([recording.position(name)[frame] for name in framing.movers], axis=0)
        framing = replace(framing, centre=tuple(float(x) for x in rotation @ middle))
    camera = _camera(framing, SUPERSAMPLING * width, SUPERSAMPLING * height)
    meshes, levels = _meshes(recording, drawn, rotation, frame)
    picture = _background(camera)
    for level in levels:
        _draw_ground(picture, camera, level, framing, [mesh for mesh in meshes if mesh.faces.size])
    depth = np.zeros(camera.width * camera.height)
    for mesh in meshes:
        _draw_mesh(picture, depth, camera, mesh)
    _draw_trails(picture, depth, camera, recording, drawn, rotation, frame)
    _draw_strings(picture, depth, camera, recording, rotation, frame)
    small = picture.reshape(height, SUPERSAMPLING, width, SUPERSAMPLING, 3).mean(axis=(1, 3))
    return np.clip(np.round(255.0 * small), 0, 255).astype(np.uint8)


def telling_frame(recording: Any) -> int:
    """Return the first frame after the strongest impact, or the one after a third of the run."""
    times, impacts = recording.times, recording.impacts
    if len(impacts) and np.isfinite(impacts["impulse"]).all():
        strongest = float(impacts["time"][int(np.argmax(impacts["impulse"]))])
        after = int(np.searchsorted(times, strongest, "right")) + 1
        if after < len(times) - 1:
            return after
    return len(times) // 3


def png(picture: np.ndarray) -> bytes:
    """Return a picture (height, width, 3) of bytes as a .png file."""
    height, width, _ = picture.shape
    change = picture.astype(np.int16)
    change[:, 1:] -= picture[:, :-1]  # filter 1 of PNG: the difference from the left, which packs better
    rows = np.concatenate([np.ones((height, 1), np.uint8), change.astype(np.uint8).reshape(height, -1)], axis=1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 9)) + chunk(b"IEND", b"")


def _camera(framing: Framing, width: int, height: int) -> Camera:
    """Return the nearest camera along the framing's view that sees its outline in the middle, as the page's does."""
    back = np.array(framing.view)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    over = np.cross(back, right)
    outline, wide = np.array(framing.outline), HALF_TALL * width / height
    distance, target = 3.0 * float(np.linalg.norm(framing.half)), np.zeros(3)
    for _ in range(4):
        across, up, near = ((outline - target) @ axis for axis in (right, over, back))
        distance = float(np.max(near + MARGIN * np.maximum(np.abs(across) / wide, np.abs(up) / HALF_TALL)))
        for axis, part in ((right, across), (over, up)):
            angle = part / (distance - near)
            target = target + 0.5 * distance * (angle.min() + angle.max()) * axis
    centre = target + np.array(framing.centre)
    return Camera(centre + distance * back, np.stack([right, over, back]), width, height)


def _meshes(recording: Any, drawn: list[Any], rotation: np.ndarray, frame: int) -> tuple[list[Mesh], list[Level]]:
    """Return what there is to draw at a frame, and the level half spaces."""
    meshes, levels = [], []
    for body, mesh, paint, planes in drawn:
        turn = rotation @ rotation_matrix(recording.orientation(body.name)[frame])
        place = rotation @ recording.position(body.name)[frame]
        levels += [(plane["offset"] + float(place[1]), plane["color"]) for plane in planes if plane["level"]]
        if mesh is not None:
            local = mesh.vertices if paint["octants"] else None
            colour = mesh.colors / 255.0 if paint["painted"] else seen_of_hex(paint["color"])
            meshes.append(Mesh(mesh.vertices @ turn.T + place, mesh.normals @ turn.T, mesh.faces, colour, local))
    for number, track in enumerate(recording.soft_bodies):
        surface = shade(track.vertices[frame] @ rotation.T, track.faces)
        meshes.append(Mesh(surface.vertices, surface.normals, surface.faces, SOFT_BODY_COLOURS[number % 2], nearer=DRAPE))
    return meshes, levels


def _background(camera: Camera) -> np.ndarray:
    """Return the sky (height, width, 3): its colour by the height of the ray above the horizon."""
    rays = _rays(camera)
    above, below = (np.clip(side * rays[..., 1] / 0.35, 0.0, 1.0)[..., None] for side in (1.0, -1.0))
    return HORIZON + (SKY - HORIZON) * above**2 * (3.0 - 2.0 * above) + (NADIR - HORIZON) * below**2 * (3.0 - 2.0 * below)


def _rays(camera: Camera) -> np.ndarray:
    """Return the unit directions (height, width, 3) in which the pixels look."""
    step = 2.0 * HALF_TALL / camera.height
    x = (np.arange(camera.width) + 0.5 - 0.5 * camera.width) * step
    y = (0.5 * camera.height - np.arange(camera.height) - 0.5) * step
    right, over, back = camera.axes
    rays = x[None, :, None] * right + y[:, None, None] * over - back
    return rays / np.linalg.norm(rays, axis=2, keepdims=True)


def _draw_ground(picture: np.ndarray, camera: Camera, ground: Level, framing: Framing, meshes: list[Mesh]) -> None:
    """Draw a level plane with its grid and the shadows on it, into the horizon."""
    from scipy.ndimage import gaussian_filter

    level, chosen = ground
    face, lines = (GROUND, LINES) if chosen is None else (seen_of_hex(chosen), DARKER * seen_of_hex(chosen))
    rays, radius = _rays(camera), float(np.linalg.norm(framing.half))
    down = rays[..., 1] < -1e-6
    way = np.where(down, (level - camera.eye[1]) / np.where(down, rays[..., 1], -1.0), 0.0)
    spacing = 10.0 ** np.floor(np.log10(2.0 * radius / CELLS))
    spacing *= next(step for step in (1.0, 2.0, 5.0, 10.0) if step * spacing >= 1.998 * radius / CELLS)
    place = camera.eye[[0, 2]] + way[..., None] * rays[..., [0, 2]]
    footprint = way * 2.0 * HALF_TALL / camera.height / np.maximum(-rays[..., 1], 0.05)
    off = np.abs((place / spacing + 0.5) % 1.0 - 0.5).min(axis=-1) * spacing
    line = np.clip(1.0 - off / np.maximum(0.006 * spacing + footprint, 1e-12), 0.0, 1.0)
    line *= np.clip(1.5 - 4.0 * footprint / spacing, 0.0, 1.0)
    away = np.linalg.norm(place - np.array(framing.centre)[[0, 2]], axis=-1) / max(8.0 * radius, 1e-12)
    strength = np.where(down & (way > 0.0), np.clip(1.1 - away, 0.0, 1.0) ** 1.5, 0.0)
    colour = face + (lines - face) * (0.55 * line * np.clip(1.0 - 2.0 * away, 0.0, 1.0))[..., None]
    mask = np.zeros(camera.width * camera.height)
    for mesh in meshes:
        height = mesh.vertices[:, 1] - level
        if height.max() > 0.0:
            fallen = mesh.vertices - np.maximum(height, 0.0)[:, None] / LIGHT[1] * LIGHT
            pixels, _, _, _ = _covered(camera, fallen, mesh.faces)
            mask[pixels] = 1.0
    soft = gaussian_filter(mask.reshape(camera.height, camera.width), 1.5 * SUPERSAMPLING)
    colour = colour * (1.0 - SHADOW * soft)[..., None]
    picture += strength[..., None] * (colour - picture)


def _covered(camera: Camera, vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return what triangles cover, in no order: pixels (k,), their corners (k, 3), weights of these (k, 3), and 1 / w (k,)."""
    place, depth = camera.seen(vertices)
    faces = faces[(depth[faces] > 1e-6 * np.abs(depth).max()).all(axis=1)]
    corners, inverse = place[faces], 1.0 / depth[faces]
    low = np.clip(np.floor(corners.min(axis=1)), 0, [camera.width, camera.height]).astype(np.int64)
    high = np.clip(np.ceil(corners.max(axis=1)), 0, [camera.width, camera.height]).astype(np.int64)
    columns, rows = np.maximum(high - low, 0).T
    a, b, c = np.moveaxis(corners, 1, 0)
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    count = np.where(area != 0.0, columns * rows, 0)
    parts, first = [], 0
    ends = np.searchsorted(np.cumsum(count), np.arange(PIXELS_AT_ONCE, count.sum() + PIXELS_AT_ONCE, PIXELS_AT_ONCE), "left") + 1
    for last in np.minimum(ends, len(faces)):
        triangle = np.repeat(np.arange(first, last), count[first:last])
        inside = np.arange(len(triangle)) - np.repeat(np.cumsum(count[first:last]) - count[first:last], count[first:last])
        x = low[triangle, 0] + inside % np.maximum(columns[triangle], 1)
        y = low[triangle, 1] + inside // np.maximum(columns[triangle], 1)
        point = np.stack([x + 0.5, y + 0.5], axis=1)
        weights = np.stack([_cross(b, c, triangle, point), _cross(c, a, triangle, point), _cross(a, b, triangle, point)], axis=1)
        weights /= area[triangle, None]
        kept = (weights >= 0.0).all(axis=1)
        weights, triangle = weights[kept] * inverse[triangle[kept]], triangle[kept]
        near = weights.sum(axis=1)
        parts.append((y[kept] * camera.width + x[kept], triangle, weights / near[:, None], near))
        first = last
    if not parts:
        return np.zeros(0, np.int64), np.zeros((0, 3), np.int64), np.zeros((0, 3)), np.zeros(0)
    pixels, triangles, weights, near = (np.concatenate(list(part)) for part in zip(*parts, strict=True))
    return pixels, faces[triangles], weights, near


def _cross(a: np.ndarray, b: np.ndarray, triangle: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return twice the signed area of the corners a and b (t, 2) of triangles (k,) with points (k, 2)."""
    start, end = a[triangle], b[triangle]
    return (end[:, 0] - start[:, 0]) * (point[:, 1] - start[:, 1]) - (end[:, 1] - start[:, 1]) * (point[:, 0] - start[:, 0])


def _draw_mesh(picture: np.ndarray, depth: np.ndarray, camera: Camera, mesh: Mesh) -> None:
    """Draw what of a mesh is nearer than what is there: a sky above, a warm light, a highlight."""
    pixels, corners, weights, near = _covered(camera, mesh.vertices, mesh.faces)
    near = mesh.nearer * near
    np.maximum.at(depth, pixels, near)
    won = near >= depth[pixels]
    pixels, corners, weights = pixels[won], corners[won], weights[won]
    normal = np.einsum("kc,kcj->kj", weights, mesh.normals[corners])
    ahead = camera.eye - np.einsum("kc,kcj->kj", weights, mesh.vertices[corners])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    normal *= np.where(np.einsum("kj,kj->k", normal, ahead) < 0.0, -1.0, 1.0)[:, None]  # of cloth one sees the inside, too
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    colour = np.tile(mesh.colour, (len(pixels), 1)) if mesh.colour.ndim == 1 else np.einsum("kc,kcj->kj", weights, mesh.colour[corners])
    if mesh.local is not None:
        pale = np.prod(np.einsum("kc,kcj->kj", weights, mesh.local[corners]), axis=1) > 0.0
        colour[pale] += 0.72 * (0.93 - colour[pale])
    half = ahead + LIGHT
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    light = 0.56 + 0.16 * normal[:, 1] + 0.46 * np.maximum(normal @ LIGHT, 0.0)
    shine = 0.22 * np.maximum(np.einsum("kj,kj->k", normal, half), 0.0) ** 40
    picture.reshape(-1, 3)[pixels] = colour * light[:, None] + shine[:, None]


def _draw_trails(
    picture: np.ndarray, depth: np.ndarray, camera: Camera, recording: Any, drawn: list[Any], rotation: np.ndarray, frame: int
) -> None:
    """Draw the paths of the last `TRAIL_SECONDS` of the centres of mass, fainter the longer ago."""
    times = recording.times
    first = int(np.searchsorted(times, times[frame] - TRAIL_SECONDS))
    strength = 0.75 * (1.0 - 0.8 * (times[frame] - times[first : frame + 1]) / TRAIL_SECONDS)
    for body, mesh, paint, _ in drawn:
        path = recording.center_of_mass(body.name)[first : frame + 1]
        if mesh is not None and len(path) > 1 and np.any(path != path[0]):
            _draw_line(picture, depth, camera, path @ rotation.T, seen_of_hex(paint["color"]), strength, SUPERSAMPLING)


def _draw_strings(picture: np.ndarray, depth: np.ndarray, camera: Camera, recording: Any, rotation: np.ndarray, frame: int) -> None:
    """Draw distance joints and springs that hold, as lines between their ends."""
    for entry in joint_entries(recording):
        if entry["kind"] in ("distance", "spring") and (entry["until"] is None or recording.times[frame] <= entry["until"]):
            ends = [_end(recording, entry[side], entry[anchor], frame) for side, anchor in (("a", "anchorA"), ("b", "anchorB"))]
            _draw_line(picture, depth, camera, np.array(ends) @ rotation.T, STRING, np.ones(2), SUPERSAMPLING // 2)


def _end(recording: Any, name: str | None, anchor: list[float], frame: int) -> np.ndarray:
    """Return where an anchor in the frame of a body, or of the world, is at a frame (3,) m."""
    if name is None:
        return np.asarray(anchor)
    return recording.position(name)[frame] + rotation_matrix(recording.orientation(name)[frame]) @ np.asarray(anchor)


def _draw_line(
    picture: np.ndarray, depth: np.ndarray, camera: Camera, path: np.ndarray, colour: np.ndarray, strength: np.ndarray, half: int
) -> None:
    """Draw a line through points (k, 3) of the turned frame, each as strong (k,) as given, where nothing is nearer; half: its width."""
    place, away = camera.seen(path)
    if away.min() <= 0.0:
        return
    flat, disc = picture.reshape(-1, 3), np.arange(-half, half + 1)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))])
    along = np.arange(0.0, length[-1], 1.0)
    x, y, near, shown = (np.interp(along, length, values) for values in (*place.T, 1.0 / away, strength))
    columns = (x[:, None, None] + disc[None, :, None] + 0 * disc).astype(np.int64).ravel()
    rows = (y[:, None, None] + disc[None, None, :] + 0 * disc[:, None]).astype(np.int64).ravel()
    seen = np.repeat(shown, len(disc) ** 2)
    inside = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    pixels = rows[inside] * camera.width + columns[inside]
    seen = np.where(np.repeat(near, len(disc) ** 2)[inside] >= depth[pixels], seen[inside], 0.0)
    most = np.zeros(len(depth))
    np.maximum.at(most, pixels, seen)
    touched = np.flatnonzero(most)
    flat[touched] += most[touched, None] * (colour - flat[touched])
