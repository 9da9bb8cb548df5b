"""The force of a joint at the instant of release, away from the centre of mass.

A uniform rod of mass m and length L, hinged at its end and let go at rest at an angle a to the level, has the angular acceleration
3 g cos a / 2 L. Its centre of mass, at L / 2, accelerates by 3/4 g cos a across the rod, so the hinge bears

    R = m (g z - 3/4 g cos a t),    t downwards across the rod,

m g / 4 upwards for a level rod. A row with a wrong lever arm would let the rod fall freely, or turn it the other way.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

G, LENGTH, MASS, FPS = 9.81, 2.0, 3.0, 1000.0


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_a_hinged_rod_begins_to_fall(angle: float) -> None:
    along, across = np.array([np.cos(angle), 0.0, -np.sin(angle)]), np.array([-np.sin(angle), 0.0, -np.cos(angle)])
    scene = ri.Scene(gravity=(0, 0, -G))
    turn = (np.cos(0.5 * angle), 0.0, np.sin(0.5 * angle), 0.0)
    inertia = MASS * LENGTH**2 / 12.0
    body = ri.Body(
        "rod", ri.Shape.box((LENGTH, 0.1, 0.1)), position=0.5 * LENGTH * along, orientation=turn, mass=MASS,
        inertia=(0.01 * inertia, inertia, inertia),
    )  # fmt: skip
    scene.add(body)
    scene.add(ri.HingeJoint(None, "rod", (0, 0, 0), (0, 1, 0), name="hinge"))
    run = ri.simulate(scene, 1.0 / FPS, FPS)
    # In a millisecond the rod turns by 4e-6 rad, and the velocities are those of the acceleration to as much.
    spin = 1.5 * G * np.cos(angle) / LENGTH
    np.testing.assert_allclose(run.angular_velocity("rod")[-1], [0.0, spin / FPS, 0.0], atol=1e-4 * spin / FPS)
    expected = MASS * (np.array([0.0, 0.0, G]) + 0.75 * G * np.cos(angle) * across)
    np.testing.assert_allclose(run.reaction("hinge")[0], expected, atol=1e-3 * MASS * G)
