"""What a run leaves of a flexible body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class FlexibleTrack:
    """Frames of one flexible body.

    Attributes:
        name: of the body. vertices: (f, v, 3) m, world. faces: (t, 3).

    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray

    def arrays(self, number: int) -> dict[str, np.ndarray]:
        """What an .npz file keeps of the track with this number."""
        key = f"soft_body{number}"
        return {f"{key}_name": np.array(self.name), f"{key}_vertices": self.vertices, f"{key}_faces": self.faces}


def tracks_in(arrays: Any) -> list[FlexibleTrack]:
    """Tracks kept in the arrays of an .npz file (a mapping), in order of their numbers."""
    tracks = []
    while f"soft_body{len(tracks)}_name" in arrays:
        key = f"soft_body{len(tracks)}"
        tracks.append(FlexibleTrack(str(arrays[f"{key}_name"]), arrays[f"{key}_vertices"], arrays[f"{key}_faces"]))
    return tracks
