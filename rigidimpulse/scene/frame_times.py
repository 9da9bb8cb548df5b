"""Times of the frames of a run."""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.numeric import number_of


def frame_times(duration: float, fps: float) -> np.ndarray:
    """Times of round(duration * fps) + 1 frames [s].

    Raises:
        SceneError: duration or fps is not a positive finite number.

    """
    seconds, rate = number_of(duration), number_of(fps)
    if not (math.isfinite(seconds) and seconds >= 0.0):
        raise SceneError(f"duration = {duration!r}", "give a finite time in seconds, >= 0")
    if not (math.isfinite(rate) and rate > 0.0):
        raise SceneError(f"fps = {fps!r}", "give a positive number of frames per second")
    return np.arange(round(seconds * rate) + 1) / rate
