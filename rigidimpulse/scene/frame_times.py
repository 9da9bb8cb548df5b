"""Times of the frames of a run."""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.core.errors import SceneError


def frame_times(duration: float, fps: float) -> np.ndarray:
    """Times of round(duration * fps) + 1 frames [s].

    Raises:
        SceneError: duration or fps is not a positive finite number.

    """
    if not (math.isfinite(duration) and duration >= 0.0):
        raise SceneError(f"duration = {duration!r}", "give a finite time in seconds, >= 0")
    if not (math.isfinite(fps) and fps > 0.0):
        raise SceneError(f"fps = {fps!r}", "give a positive number of frames per second")
    return np.arange(round(duration * fps) + 1) / fps
