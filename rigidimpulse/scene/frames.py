"""Frames of bodies: people see a body's own origin and axes, the engine its centre of mass and principal axes.

    q_own = q turn*,    x_own = x - q_own offset

offset: centre of mass in the body's own frame; turn: principal axes there.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.quaternion import conjugate, multiply, rotate


def own_pose(position: np.ndarray, orientation: np.ndarray, offset: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses of a body's own frame from principal ones (f, 3) m, (f, 4); offset (3,) m, turn (4,)."""
    turned = multiply(orientation, conjugate(turn))
    return position - rotate(turned, offset), turned


def own_frames(position: np.ndarray, orientation: np.ndarray, offset: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses of the own frames of n bodies from principal ones (f, n, 3) m, (f, n, 4); offset (n, 3) m, turn (n, 4)."""
    # Where the body frame is the principal frame there is nothing to turn (0 is added since turning makes 0 of -0).
    place, orientation = position.copy(), orientation + 0.0
    turned = np.any(offset != 0.0, axis=1) | np.any(turn != [1.0, 0.0, 0.0, 0.0], axis=1)
    for i in np.flatnonzero(turned).tolist():
        place[:, i], orientation[:, i] = own_pose(position[:, i], orientation[:, i], offset[i], turn[i])
    return place, orientation
