"""A box tumbles through the air: the free flight that other engines were compared on.

The scene of S. Peters & J. Hsu 2014 (Comparison of rigid body dynamic simulators for robotic simulation in Gazebo): a box of 0.1 x 0.4 x
0.9 m and 10 kg, thrown with v = (-2, 2, 8) m/s and w = (0.1, 5, 0.1) rad/s, near its middle axis, so that it turns over and over.

    x = x0 + v t + g t^2 / 2,    I w' = -w x I w,    q' = (0, w) q / 2

Euler's equations are solved by an eighth-order Runge-Kutta method to rounding, apart from the library's closed form.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from rigidimpulse.core.quaternion import angle_between
from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = np.array([0.0, 0.0, -9.8])
SIZE, MASS = np.array([0.1, 0.4, 0.9]), 10.0
VELOCITY, SPIN = np.array([-2.0, 2.0, 8.0]), np.array([0.1, 5.0, 0.1])
DURATION = 10.0
TOLERANCE = 3e-14
"""Relative, of the reference."""
PLACE_BOUND, TURN_BOUND = 1e-11, 1e-9
"""m: rounding of 400 m; rad: what the reference leaves of 50 rad near a middle axis, times ten."""


def scene() -> Scene:
    """Return the box, alone."""
    scene = Scene(gravity=GRAVITY)
    scene.add(Body("box", Shape.box(SIZE), velocity=VELOCITY, angular_velocity=SPIN, mass=MASS))
    return scene


def exact(times: np.ndarray) -> Exact:
    """Return parabola and attitude."""
    t = times[:, None]
    return Exact({"box": VELOCITY * t + 0.5 * GRAVITY * t**2}, {"box": _attitude(tuple(times.tolist()))}, np.zeros(len(times)))


@cache
def _attitude(times: tuple[float, ...]) -> np.ndarray:
    """Return the orientation (f, 4), wxyz, from spin in body axes and quaternion together."""
    from scipy.integrate import solve_ivp

    inertia = MASS / 12.0 * (np.sum(SIZE**2) - SIZE**2)

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        (a, b, c, d), w = y[:4], y[4:]
        turn = 0.5 * np.array([
            -b * w[0] - c * w[1] - d * w[2], a * w[0] + c * w[2] - d * w[1], a * w[1] + d * w[0] - b * w[2], a * w[2] + b * w[1] - c * w[0],
        ])  # fmt: skip
        return np.concatenate([turn, np.cross(inertia * w, w) / inertia])

    start = np.concatenate([[1.0, 0.0, 0.0, 0.0], SPIN])
    end = max(times[-1], 1e-9)
    return solve_ivp(rate, (0.0, end), start, "DOP853", times, rtol=TOLERANCE, atol=TOLERANCE).y[:4].T


def check(run: Recording) -> list[Check]:
    """Compare with parabola and reference."""
    law = exact(run.times)
    assert run.ledger is not None
    total, turning = run.ledger.total, run.ledger.angular_momentum - np.cross(run.position("box"), run.ledger.momentum)
    return [
        at_most("error of the place, m", np.abs(run.position("box") - law.position["box"]).max(), PLACE_BOUND, "x0 + v t + g t^2 / 2"),
        at_most("error of the attitude, rad", angle_between(run.orientation("box"), law.orientation["box"]).max(), TURN_BOUND, "Euler"),
        at_most("energy, relative change", np.ptp(total) / total[0], 1e-12, "no work but gravity's"),
        at_most("spin about its centre, relative change", np.abs(turning - turning[0]).max() / np.linalg.norm(turning[0]), 1e-11,
            "no torque; rounding of the place, 400 m, times the momentum"),
    ]  # fmt: skip


SCENES = (GalleryScene("tumbling_box", "A box tumbles through the air (Peters & Hsu 2014)", scene, check, DURATION,
    elsewhere="error of the place after 10 s at dt 1e-4: ODE, Bullet and DART 4.9 mm, Simbody 2.5 mm (Peters & Hsu 2014)",
    exact=exact),)  # fmt: skip
