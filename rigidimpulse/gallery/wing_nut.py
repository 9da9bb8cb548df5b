"""The wing nut of Dzhanibekov: a body that spins about its middle axis turns over, again and again, without any torque.

Principal moments A > B > C, L^2 = |I w|^2, T2 = w.I w (twice the energy), spin almost about B and no component along
C at the start. With L^2 > T2 B (Landau & Lifshitz, Mechanics, section 37):

    w_A = a dn u,  w_B = b sn u,  w_C = c cn u,   u = p t + K(m)
    a^2 = (L^2 - T2 C) / (A (A - C)),  b^2 = (T2 A - L^2) / (B (A - B)),  c^2 = (T2 A - L^2) / (C (A - C))
    p^2 = (A - B)(L^2 - T2 C) / (A B C),  m = (B - C)(T2 A - L^2) / ((A - B)(L^2 - T2 C))

Near m = 1 the usual algorithms for these functions lose digits; sums over the single turns do not (DLMF 22.12, m' = 1
- m):

    dn u = h sum sech x_n,  cn u = h / sqrt(m) sum (-1)^n sech x_n,  sn u = h / sqrt(m) sum (-1)^n tanh x_n
    h = pi / 2 K(m'),  x_n = h (u - 2 n K(m))

w_B changes sign every 2 K(m) / p, first after K(m) / p. The attitude follows from q' = q (0, w) / 2, integrated here
with these w.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_most, equal, rotations
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

C, B, A = INERTIA = (1.0, 2.0, 3.0)
"""kg m^2, about the handle, the stem, and across both."""
MASS = 10.0
SPIN = (0.0, 5.0, 0.02)
"""rad/s at the start, body axes = world axes."""
DURATION = 20.0
SPIN_BOUND = 1e-12
"""rad/s: rounding of a phase up to 60, times the spin, times ten."""
ATTITUDE_BOUND = 1e-9
"""rad: ten times what the integration of the reference leaves."""
TURNS = 4
"""Terms of the sums on either side: the next are below 1e-20."""
REFERENCE_TOLERANCE = 3e-14


def scene() -> Scene:
    """Return a T-shaped handle in free space, its moments of inertia given."""
    along_x, along_y = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0), (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
    handle = Shape.compound([
        (Shape.capsule(0.09, 1.0), (0.0, -0.2, 0.0), along_x),
        (Shape.cylinder(0.07, 0.6), (0.0, 0.1, 0.0), along_y),
        (Shape.cylinder(0.12, 0.12), (0.0, 0.42, 0.0), along_y),
    ])  # fmt: skip
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    nut = {"mass": MASS, "inertia": INERTIA, "center_of_mass": (0.0, 0.0, 0.0)}
    scene.add(Body("wing nut", handle, angular_velocity=SPIN, **nut))
    return scene


def exact(times: np.ndarray) -> Exact:
    """Return the attitude, in one place."""
    still = np.zeros((len(times), 3))
    return Exact({"wing nut": still}, {"wing nut": _attitude(times)}, np.zeros(len(times)))


def check(run: Recording) -> list[Check]:
    """Compare with elliptic functions."""
    turn = rotations(run.orientation("wing nut"))
    spin = turn.apply(run.angular_velocity("wing nut"), inverse=True)
    expected = _spin(run.times)
    error = (turn * rotations(_attitude(run.times)).inv()).magnitude()
    momentum = run.ledger.angular_momentum if run.ledger else np.full((1, 3), np.nan)
    kinetic = run.ledger.kinetic if run.ledger else np.array([np.nan])
    _, _, rate, quarter, _ = _constants()
    turns = int(np.sum(np.diff(np.sign(spin[:, 1])) != 0))
    law = "Jacobi's elliptic functions"
    return [
        equal(
            "turns over", turns, math.floor(0.5 * float(run.times[-1]) * rate / quarter + 0.5), "one each 2 K(m) / p"
        ),
        at_most("error of the spin in body axes, rad/s", np.abs(spin - expected).max(), SPIN_BOUND, law),
        at_most("error of the attitude, rad", error.max(), ATTITUDE_BOUND, "q' = q (0, w) / 2 with these w"),
        at_most(
            "angular momentum, relative change",
            np.abs(momentum - momentum[0]).max() / np.linalg.norm(momentum[0]),
            1e-12,
            "no torque",
        ),
        at_most("energy, relative change", np.ptp(kinetic) / kinetic[0], 1e-12, "no torque"),
    ]


def _constants() -> tuple[float, float, float, float, float]:
    """Return L^2 - T2 C, T2 A - L^2, p, K(m) and K(1 - m), without cancellation."""
    from scipy.special import ellipk, ellipkm1

    _, y, z = SPIN
    below = B * (B - C) * y * y + A * (A - C) * z * z
    above = B * (A - B) * y * y
    rate = math.sqrt((A - B) * below / (A * B * C))
    complement = A * (A - C) * z * z / below
    return below, above, rate, float(ellipkm1(complement)), float(ellipk(complement))


def _spin(times: np.ndarray) -> np.ndarray:
    """Return the spin in body axes (f, 3) [rad/s]."""
    below, above, rate, quarter, other = _constants()
    scale = 0.5 * np.pi / other
    modulus = math.sqrt((B - C) * above / ((A - B) * below))
    phase = np.mod(rate * np.asarray(times) + 3.0 * quarter, 4.0 * quarter) - 2.0 * quarter
    sn = cn = dn = np.zeros_like(phase)
    for n in range(-TURNS, TURNS + 1):
        bump = scale * (phase - 2.0 * n * quarter)
        sign = -1.0 if n % 2 else 1.0
        sn = sn + sign * np.tanh(bump)
        cn = cn + sign / np.cosh(bump)
        dn = dn + 1.0 / np.cosh(bump)
    amplitude = np.sqrt([above / (C * (A - C)), above / (B * (A - B)), below / (A * (A - C))])
    return scale * np.stack([cn / modulus, sn / modulus, dn], axis=-1) * amplitude


def _attitude(times: np.ndarray) -> np.ndarray:
    """Return the attitude (f, 4), wxyz, by numerical integration."""
    from scipy.integrate import solve_ivp

    def rate(t: float, q: np.ndarray) -> np.ndarray:
        x, y, z = _spin(np.array(t))
        return 0.5 * np.array([
            -q[1] * x - q[2] * y - q[3] * z,
            q[0] * x + q[2] * z - q[3] * y,
            q[0] * y + q[3] * x - q[1] * z,
            q[0] * z + q[1] * y - q[2] * x,
        ])  # fmt: skip

    span = (float(times[0]), float(times[-1]))
    start = np.array([1.0, 0.0, 0.0, 0.0])
    tolerance = REFERENCE_TOLERANCE
    answer = solve_ivp(rate, span, start, "DOP853", times, rtol=tolerance, atol=tolerance)
    return answer.y.T


SCENES = (
    GalleryScene(
        "wing_nut", "A body that spins about its middle axis turns over and over (Dzhanibekov)", scene, check, DURATION, exact=exact
    ),
)
