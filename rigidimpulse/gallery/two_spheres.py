"""Two smooth equal spheres meet obliquely in space (B13).

    v_a' = v_a + (1 + e)/2 [(v_b - v_a).n] n,   v_b' = v_b - (1 + e)/2 [(v_b - v_a).n] n
    change of energy  -(1 - e^2) m [(v_b - v_a).n]^2 / 4

n from the first root of |x + u t| = r_a + r_b of the relative motion x + u t.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

RADIUS = 0.25
MASS = 2.0
RESTITUTION = 0.7
POSITION_A, VELOCITY_A = np.array([-1.5, 0.0, 0.0]), np.array([2.0, 0.3, 0.1])
POSITION_B, VELOCITY_B = np.array([1.2, 0.6, 0.2]), np.array([-1.0, -0.1, 0.0])
SPIN = np.array([0.0, 0.0, 6.0])
DURATION = 2.0
BOUND = 1e-12
"""Rounding of a root and a handful of products, times a hundred."""


def scene() -> Scene:
    """Return the two spheres, without gravity; the spin of one shows that smooth spheres do not pass it on."""
    smooth = Material(restitution=RESTITUTION, static_friction=0.0, dynamic_friction=0.0)
    ball = Shape.sphere(RADIUS)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(
        Body("a", ball, position=POSITION_A, velocity=VELOCITY_A, angular_velocity=SPIN, mass=MASS, material=smooth)
    )
    scene.add(Body("b", ball, position=POSITION_B, velocity=VELOCITY_B, mass=MASS, material=smooth))
    return scene


def _impact() -> tuple[float, np.ndarray, float]:
    """Return when they meet [s], the change of v_a (3,) [m/s], and the energy lost [J]."""
    x, u = POSITION_B - POSITION_A, VELOCITY_B - VELOCITY_A
    b, a, c = x @ u, u @ u, x @ x - 4.0 * RADIUS**2
    time = (-b - np.sqrt(b * b - a * c)) / a
    normal = (x + u * time) / (2.0 * RADIUS)
    approach = u @ normal
    change = 0.5 * (1.0 + RESTITUTION) * approach * normal
    return float(time), change, float((1.0 - RESTITUTION**2) * MASS * approach**2 / 4.0)


def exact(times: np.ndarray) -> Exact:
    """Return the two straight lines before and after."""
    time, change, lost = _impact()
    since = np.maximum(times - time, 0.0)[:, None]
    a = POSITION_A + VELOCITY_A * times[:, None] + change * since
    b = POSITION_B + VELOCITY_B * times[:, None] - change * since
    turn = np.zeros((len(times), 4))
    turn[:, 0], turn[:, 3] = np.cos(0.5 * SPIN[2] * times), np.sin(0.5 * SPIN[2] * times)
    met = np.array([time]) if time <= times[-1] else np.zeros(0)
    return Exact({"a": a, "b": b}, {"a": turn}, np.where(times >= time, -lost, 0.0), met)


def check(run: Recording) -> list[Check]:
    """Compare with the closed form."""
    time, change, lost = _impact()
    kinetic = run.ledger.kinetic if run.ledger else np.array([np.nan])
    law = "v' = v +- (1 + e)/2 [(v_b - v_a).n] n"
    return [
        equal("impacts", len(run.impacts), 1, "they touch once"),
        at_most(
            "error of the impact time, s", abs(run.impacts["time"][0] - time), BOUND, "first root of |x + u t| = 2 r"
        ),
        at_most("error of v_a, m/s", np.abs(run.velocity("a")[-1] - VELOCITY_A - change).max(), BOUND, law),
        at_most("error of v_b, m/s", np.abs(run.velocity("b")[-1] - VELOCITY_B + change).max(), BOUND, law),
        at_most("error of the energy lost, J", abs(kinetic[0] - kinetic[-1] - lost), BOUND, "(1 - e^2) m (u.n)^2 / 4"),
        at_most(
            "change of spin, rad/s", np.abs(run.angular_velocity("a")[-1] - SPIN).max(), BOUND, "smooth: no torque"
        ),
    ]


SCENES = (
    GalleryScene(
        "two_spheres", "Two smooth spheres meet obliquely in space", scene, check, DURATION, exact=exact
    ),
)
