"""Reference motion of rigid bodies under forces: the equations of motion as they stand, by scipy's DOP853 at 1e-12.

    x' = v,  m v' = F,  q' = w q / 2,  L' = tau,  w = R J^-1 R' L

It shares nothing with the library: bodies are mass and inertia, forces are functions written in the tests.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

Wrench = Callable[[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


class Start(NamedTuple):
    """A body at the start: kg, (3, 3) kg m2 about the centre of mass in body axes, m, (w, x, y, z), m/s, rad/s."""

    mass: float
    inertia: np.ndarray
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angular_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Motion(NamedTuple):
    """At f times: positions (f, n, 3), rotations (f, n, 3, 3), velocities and spins (f, n, 3)."""

    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray


def box_inertia(mass: float, size: tuple[float, float, float]) -> np.ndarray:
    """Inertia (3, 3) of a full box."""
    x, y, z = np.square(size)
    return mass / 12.0 * np.diag([y + z, x + z, x + y])


def matrices(orientation: np.ndarray) -> np.ndarray:
    """Rotations (..., 3, 3) of quaternions (..., 4), (w, x, y, z)."""
    q = np.asarray(orientation, float)
    flat = Rotation.from_quat(q.reshape(-1, 4)[:, [1, 2, 3, 0]])
    return flat.as_matrix().reshape(*q.shape[:-1], 3, 3)


def reference(bodies: list[Start], wrench: Wrench, times: np.ndarray) -> Motion:
    """Motion under wrench(t, x, R, v, w) -> (n, 6), force and torque about the centres of mass, in the world."""
    n = len(bodies)
    mass = np.array([b.mass for b in bodies])[:, None]
    inertia = np.array([b.inertia for b in bodies])
    inverse = np.linalg.inv(inertia)
    x, v, w = (np.array([getattr(b, field) for b in bodies], float) for field in ("position", "velocity", "angular_velocity"))
    q = np.array([np.asarray(b.orientation, float) / np.linalg.norm(b.orientation) for b in bodies])
    turn = matrices(q)
    momentum = np.einsum("nij,njk,nlk,nl->ni", turn, inertia, turn, w)

    def parts(y: np.ndarray):
        x, q, v, momentum = np.split(y.reshape(n, 13), [3, 7, 10], axis=1)
        turn = matrices(q)
        return x, q, turn, v, momentum, np.einsum("nij,njk,nlk,nl->ni", turn, inverse, turn, momentum)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        x, q, turn, v, _, w = parts(y)
        total = wrench(t, x, turn, v, w)
        spun = 0.5 * np.column_stack([-(w * q[:, 1:]).sum(1), q[:, :1] * w + np.cross(w, q[:, 1:])])
        return np.hstack([v, spun, total[:, :3] / mass, total[:, 3:]]).ravel()

    start = np.hstack([x, q, v, momentum]).ravel()
    span = (float(times[0]), float(times[-1]))
    found = solve_ivp(rate, span, start, "DOP853", t_eval=times, rtol=1e-12, atol=1e-12)
    assert found.success
    states = [parts(y) for y in found.y.T]
    return Motion(*(np.array([state[k] for state in states]) for k in (0, 2, 3, 5)))
