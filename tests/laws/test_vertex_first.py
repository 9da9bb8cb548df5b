"""A cube that lands on a vertex, e = 1, no friction: velocity and spin after the impact against the closed form.

Law. A unit cube has equal moments I = m a^2 / 6, so its spin is constant in flight and its path is known: centre z0 -
g t^2 / 2, orientation exp(w t) q0. The time of impact is the root of the lowest vertex's height (found here by
Brent's method to 1e-16), and with r the arm of that vertex:  j = 2 m |u_z| / (1 + m |r x n|^2 / I),  v_z += j / m,  w
+= r x j n / I.

Tolerance 1e-10 absolute on v and w of O(1 to 5). The time of impact enters through g dt and w x r dt: an error of
1e-10 of the cube's size in the gap would show at 2e-10. Engines with fixed steps are off by 1e-15 to 7e-2 (spin-
free); ignoring rotation is off by O(1).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import rigidimpulse as ri
from rigidimpulse.core.quaternion import multiply, quaternion_from_rotation_vector, rotate

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
ORIENTATIONS = [
    (0.880476235, 0.279848142, -0.364705200, 0.115916878),
    (0.85, 0.35, 0.2, 0.34),
    (0.3, -0.4, 0.7, 0.5),
    (0.92, 0.31, 0.12, -0.2),
    (0.1, 0.5, 0.3, 0.8),
]
MASS, G, HEIGHT = 2.5, 9.81, 2.0
MOMENT = MASS / 6.0


@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (1.3, -0.7, 2.1)])
@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_velocity_and_spin_after_a_vertex_impact(orientation, spin) -> None:
    q0 = np.array(orientation) / np.linalg.norm(orientation)
    w0 = np.array(spin)
    floor = ri.Body("floor", ri.Shape.half_space(), motion="static")
    cube = ri.Body(
        "cube", ri.Shape.box((1, 1, 1)), mass=MASS, position=(0, 0, HEIGHT), orientation=q0, angular_velocity=spin,
        material=ri.Material(restitution=1.0, static_friction=0.0),
    )

    def corners(t: float) -> np.ndarray:
        return rotate(multiply(quaternion_from_rotation_vector(w0 * t), q0), CORNERS)

    def height(t: float) -> float:
        return HEIGHT - 0.5 * G * t * t + corners(t)[:, 2].min()

    times = np.linspace(0.0, 1.0, 2001)
    first = next(k for k, t in enumerate(times) if height(t) < 0.0)
    t = brentq(height, times[first - 1], times[first], xtol=1e-16, rtol=1e-15)
    r = corners(t)[np.argmin(corners(t)[:, 2])]
    n = np.array([0.0, 0.0, 1.0])
    v, w = np.array([0.0, 0.0, -G * t]), w0
    u = v + np.cross(w, r)
    j = -2.0 * (u @ n) / (1.0 / MASS + n @ np.cross(np.cross(r, n), r) / MOMENT)
    v, w = v + j * n / MASS, w + np.cross(r, j * n) / MOMENT

    end = t + 1e-3
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(floor)
    scene.add(cube)
    run = ri.simulate(scene, end, fps=1.0 / end)
    assert len(run.impacts) == 1
    assert run.impacts["time"][0] == pytest.approx(t, abs=1e-12)
    np.testing.assert_allclose(run.velocity("cube")[-1], v - G * (run.times[-1] - t) * n, atol=1e-10, rtol=0)
    np.testing.assert_allclose(run.angular_velocity("cube")[-1], w, atol=1e-10, rtol=0)
