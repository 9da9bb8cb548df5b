"""Where the camera looks from: the box of the action, turned so that up is up.

The page is Y up, as three.js is. The recorded frame is turned into it by the shortest rotation that takes `up` to Y;
for Z up that is a quarter turn about X, for Y up nothing. All that is returned here is in the turned frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

FOLLOW_RATIO = 120.0
"""Half diagonal of the action over the largest body's radius from which the camera goes along with the bodies."""
FOLLOW_VIEW = 8.0
"""Half diagonal of what it then sees, in radii."""
RUNAWAY_RATIO = 8.0
"""A body that travels this many times further than most, and than the start is wide, is not framed."""
SURROUNDINGS = 0.25
"""How far static bodies widen the outline at most, as a share of its diagonal, on each side."""
ELEVATION = np.radians(13.0)
TURN = np.radians(32.0)
"""Angle between the camera and the plane across the widest horizontal spread: a three-quarter view."""
_GRID = np.array(np.meshgrid([-1, 0, 1], [-1, 0, 1], [-1, 0, 1]), dtype=np.float64).reshape(3, 27).T
_GRID = np.delete(_GRID, 13, axis=0)  # without the middle
OUTLINE_DIRECTIONS = _GRID / np.linalg.norm(_GRID, axis=1, keepdims=True)
"""Directions in which the outline of the action is measured."""


@dataclass(frozen=True)
class Path:
    """The path of a body: positions (f, 3) of its origin in the recorded frame, and its radius about the origin, m.

    `surface` (p, 3) m are points of a body that does not move, in the recorded frame: its outline is tighter than that of a ball.
    """

    name: str
    position: np.ndarray
    radius: float
    moves: bool
    surface: np.ndarray | None = None


@dataclass(frozen=True)
class Framing:
    """What the camera shows, in the turned frame (Y up).

    Attributes:
        stage: quaternion (x, y, z, w) from the recorded frame to the turned one.
        centre: (3,) m, middle of the action.
        half: (3,) m, half extents of its box.
        outline: (k, 3) m, points about the centre that the camera must see: tighter than the corners of the box.
        view: (3,) unit vector from the centre to the camera.
        body_radius: m, middle radius of the moving bodies.
        follow: whether the camera goes along with the bodies.
        movers: names of the bodies it follows.

    """

    stage: tuple[float, ...]
    centre: tuple[float, ...]
    half: tuple[float, ...]
    outline: list[tuple[float, ...]]
    view: tuple[float, ...]
    body_radius: float
    follow: bool
    movers: list[str] = field(default_factory=list)


def up_axis(gravity: npt.ArrayLike) -> np.ndarray:
    """Return the unit vector (3,) against gravity; Z without gravity."""
    against = -np.asarray(gravity, dtype=np.float64)
    strength = float(np.linalg.norm(against))
    return against / strength if strength > 0.0 else np.array([0.0, 0.0, 1.0])


def stage_rotation(up: np.ndarray) -> np.ndarray:
    """Return the shortest rotation (3, 3) that takes the unit vector `up` to Y."""
    x, y, z = up
    if y < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    # Rodrigues' formula for the axis up x Y = (-z, 0, x), whose length is the sine, with cosine y.
    cross = np.array([[0.0, -x, 0.0], [x, 0.0, z], [0.0, -z, 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + y)


def frame_action(paths: Sequence[Path], up: np.ndarray) -> Framing:
    """Return the framing of the moving bodies over the whole run, of all if none moves; `up` is a unit vector (3,)."""
    rotation = stage_rotation(up)
    movers = [path for path in paths if path.moves] or list(paths)
    outline = _outline(_without_runaways(movers), rotation)
    outline += _surroundings([path for path in paths if path not in movers], rotation, outline)
    points = np.array(outline or [[-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]])
    low, high = points.min(axis=0), points.max(axis=0)
    half, centre = 0.5 * (high - low), 0.5 * (high + low)
    largest = max((path.radius for path in movers), default=0.0)
    follow = bool(np.linalg.norm(half) > FOLLOW_RATIO * largest > 0.0)
    if follow:
        reach = FOLLOW_VIEW * largest
        centre = np.mean([rotation @ path.position[0] for path in movers], axis=0)
        half, points = np.full(3, reach / np.sqrt(3.0)), centre + reach * OUTLINE_DIRECTIONS
    return Framing(
        stage=_stage_quaternion(up),
        centre=_floats(centre),
        half=_floats(half),
        outline=[_floats(point) for point in points - centre],
        view=_floats(_view_direction(half)),
        body_radius=float(np.median([path.radius for path in movers])) if movers else 0.5,
        follow=follow,
        movers=[path.name for path in movers],
    )


def _without_runaways(movers: Sequence[Path]) -> list[Path]:
    """Return the bodies without those that travel far out of the picture that most of them make."""
    if not movers:
        return []
    travel = np.array([np.linalg.norm(np.ptp(path.position, axis=0)) + 2.0 * path.radius for path in movers])
    start = np.array([path.position[0] for path in movers])
    limit = RUNAWAY_RATIO * max(float(np.median(travel)), float(np.linalg.norm(np.ptp(start, axis=0))))
    return [path for path, length in zip(movers, travel, strict=True) if length <= limit]


def _outline(paths: Sequence[Path], rotation: np.ndarray) -> list[np.ndarray]:
    """Return the outermost point of all bodies and frames in each of `OUTLINE_DIRECTIONS`, in the turned frame."""
    if not paths:
        return []
    turned = [path.position @ rotation.T for path in paths]
    points = np.concatenate(turned)
    radii = np.concatenate([np.full(len(part), path.radius) for part, path in zip(turned, paths, strict=True)])
    outer = []
    for direction in OUTLINE_DIRECTIONS:
        k = int(np.argmax(points @ direction + radii))
        outer.append(points[k] + radii[k] * direction)
    return outer


def _surroundings(statics: Sequence[Path], rotation: np.ndarray, outline: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return points of the static bodies that are near the outline, no further off than `SURROUNDINGS`."""
    if not outline:
        return []
    low, high = np.min(outline, axis=0), np.max(outline, axis=0)
    reach = SURROUNDINGS * float(np.linalg.norm(high - low))
    points = []
    for path in statics:
        centre = rotation @ path.position[0]
        if np.all(centre - path.radius < high + reach) and np.all(centre + path.radius > low - reach):
            outer = centre + path.radius * OUTLINE_DIRECTIONS
            if path.surface is not None:
                turned = path.surface @ rotation.T
                outer = turned[np.argmax(turned @ OUTLINE_DIRECTIONS.T, axis=0)]
            points += list(np.clip(outer, low - reach, high + reach))
    return points


def _view_direction(half: np.ndarray) -> np.ndarray:
    """Return the direction to the camera: a three-quarter view across the wider horizontal side of the box."""
    azimuth = TURN if half[0] >= half[2] else 0.5 * np.pi - TURN
    level = np.cos(ELEVATION)
    return np.array([level * np.sin(azimuth), np.sin(ELEVATION), level * np.cos(azimuth)])


def _stage_quaternion(up: np.ndarray) -> tuple[float, ...]:
    """Return the quaternion (x, y, z, w) of `stage_rotation`."""
    if up[1] < -1.0 + 1e-12:
        return (1.0, 0.0, 0.0, 0.0)
    quaternion = np.array([-up[2], 0.0, up[0], 1.0 + up[1]])
    return _floats(quaternion / np.linalg.norm(quaternion))


def _floats(values: np.ndarray) -> tuple[float, ...]:
    """Return plain Python floats, as JSON and msgpack want them."""
    return tuple(float(value) for value in values)
