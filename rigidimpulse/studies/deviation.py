"""How far two runs of one scene are apart, frame by frame and body by body.

    distance   |x_a - x_b|, m, of the bodies' origins
    angle      angle of the turn q_a q_b^-1, rad

The time until which runs agree is that of the last frame before the first at which they differ by more than is allowed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import angle_between
from rigidimpulse.recording.recording import Recording


class Deviation(NamedTuple):
    """Distance (f, n) m and angle (f, n) rad between the bodies of two runs, at times (f,) s."""

    times: np.ndarray
    distance: np.ndarray
    angle: np.ndarray


def deviation(a: Recording, b: Recording) -> Deviation:
    """Compare two runs of the same bodies at the same times.

    What is not finite in either run is infinitely far away.

    Raises:
        SceneError: the runs have other bodies or other frame times.

    """
    if a.names != b.names:
        raise SceneError(f"one run has the bodies {', '.join(a.names)}, the other {', '.join(b.names)}", "compare runs of one scene")
    if not np.array_equal(a.times, b.times):
        text = f"one run has {len(a.times)} frames until {a.times[-1]:g} s, the other {len(b.times)} until {b.times[-1]:g} s"
        raise SceneError(text, "give both the same duration and fps")
    distance = np.linalg.norm(a.positions - b.positions, axis=2)
    angle = angle_between(a.orientations, b.orientations)
    return Deviation(a.times, *(np.where(np.isfinite(value), value, np.inf) for value in (distance, angle)))


def agree_until(times: np.ndarray, error: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
    """Times (n,) s until which errors (f, n) stay within a tolerance: that of the last frame before the first excess.

    -inf where the first frame is off already; the last frame's time where nothing ever is.
    """
    off = error > tolerance
    first = np.where(off.any(axis=0), np.argmax(off, axis=0), len(times))
    return np.concatenate([[-np.inf], times])[first]
