"""Animation tracks of a recording: few keys, packed as typed arrays.

meshcat's own tracks store every key as a small dictionary (127 bytes and slow to parse). three.js reads a track just as
well from two flat arrays `times` and `values`; meshcat's msgpack decoder turns the float32 extension into a
Float32Array. A key of position and orientation then costs 36 bytes, 48 as base64.

Between keys three.js interpolates positions linearly and orientations along the shorter great arc, so
 - a key inside a run of equal values can be dropped without changing the motion: bodies at rest cost nothing;
 - the sign of a quaternion must not jump from key to key.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

FLOAT32_EXTENSION, BYTES_EXTENSION = 0x17, 0x12  # meshcat's msgpack extension codes of Float32Array and Uint8Array


def quaternion_keys(orientation: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
    """Return orientations (f, 4) wxyz as keys (f, 4) xyzw whose sign never jumps."""
    from rigidimpulse.core.quaternion import quaternion_continuity

    return quaternion_continuity(np.asarray(orientation, dtype=np.float64))[:, [1, 2, 3, 0]]


def thin_keys(values: npt.NDArray[np.float32]) -> npt.NDArray[np.int64]:
    """Return the indices of the keys of `values` (f, k) to keep: all but those equal to both their neighbours."""
    changes = np.any(values[1:] != values[:-1], axis=1)
    keep = np.ones(len(values), dtype=bool)
    keep[1:-1] = changes[:-1] | changes[1:]
    return np.flatnonzero(keep)


class TypedTrack:
    """One animated property of one node; stands in for `meshcat.animation.AnimationTrack`."""

    def __init__(self, name: str, kind: str, times: npt.ArrayLike, values: npt.ArrayLike) -> None:
        """Keep `times` (k,) in s and `values` (k, d) of the property `name`; `kind` is vector3 or quaternion."""
        self.name = name
        self.kind = kind
        self.times = np.ascontiguousarray(times, dtype=np.float32)
        self.values = np.ascontiguousarray(values, dtype=np.float32)

    def lower(self) -> dict[str, Any]:
        """Return the track as three.js' clip parser reads it."""
        return {
            "name": "." + self.name,
            "type": self.kind,
            "times": pack_float32(self.times),
            "values": pack_float32(self.values),
        }


def pack_float32(values: npt.ArrayLike) -> Any:
    """Return an array as the msgpack extension that the page reads as Float32Array, flat and row by row."""
    import umsgpack

    return umsgpack.Ext(FLOAT32_EXTENSION, np.ascontiguousarray(values, dtype="<f4").tobytes())


def pack_bytes(data: bytes) -> Any:
    """Return bytes as the msgpack extension that the page reads as Uint8Array."""
    import umsgpack

    return umsgpack.Ext(BYTES_EXTENSION, data)


def body_tracks(
    times: npt.NDArray[np.float64], position: npt.NDArray[np.float64], orientation: npt.NDArray[np.float64]
) -> list[TypedTrack]:
    """Return the tracks of one body; a property that never changes has none.

    Args:
        times: (f,) s.
        position: (f, 3) m.
        orientation: (f, 4) wxyz.
    """
    tracks = []
    keys = (("position", "vector3", position), ("quaternion", "quaternion", quaternion_keys(orientation)))
    for name, kind, values in keys:
        stored = np.asarray(values, dtype=np.float32)
        if np.any(stored != stored[0]):
            kept = thin_keys(stored)
            tracks.append(TypedTrack(name, kind, times[kept], stored[kept]))
    return tracks


def animation_message(tracks_by_path: dict[str, list[TypedTrack]], duration: float) -> dict[str, Any]:
    """Return meshcat's `set_animation` message: a clip per body, all as long as the recording, so they stay in step.

    The times are in seconds already, hence one frame per second. `play` must be true: a clip that was never played
    does not follow the time slider; the page stops the clock at once and keeps the time itself.
    """
    from meshcat.animation import Animation, AnimationClip
    from meshcat.commands import SetAnimation
    from meshcat.path import Path

    clips = {}
    for path, tracks in tracks_by_path.items():
        clips[Path(tuple(path.split("/")))] = AnimationClip({track.name: track for track in tracks}, fps=1)
    message = SetAnimation(Animation(clips), play=True, repetitions=1).lower()
    for animation in message["animations"]:
        animation["clip"]["duration"] = float(duration)
    return message
