"""Positions, velocities and inverse masses of all bodies at one instant."""

from typing import NamedTuple

import numpy as np


class BodyState(NamedTuple):
    """All bodies at one instant, in the world frame."""

    position: np.ndarray  # (n, 3) m, centre of mass
    orientation: np.ndarray  # (n, 4) wxyz, principal frame
    velocity: np.ndarray  # (n, 3) m/s
    angular_velocity: np.ndarray  # (n, 3) rad/s
    inv_mass: np.ndarray  # (n,) 1/kg, 0 for immovable
    inv_inertia: np.ndarray  # (n, 3, 3) 1/(kg m2), world axes
