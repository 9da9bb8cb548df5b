"""What a pivot carries over full swings, and that it does not drift (dynamics notes B3, animation notes A12).

    T = 4 K(sin(a0 / 2)) sqrt(l / g),    mean reaction m g up, 0 sideways

for a point mass, here on a string that turns freely at both ends (a distance joint through its centre). Joints are of second order: with
steps of 1/240 s and rates a' up to 7 rad/s rates and tensions are off by (a' h)^2 / 12 = 7e-5, tensions being up to 5 m g: 5e-4 of m g. A
reaction that is late by a step of 1/60 s, or lacks l a'^2, is off by 1e-2 and more.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.special import ellipk

import rigidimpulse as ri


@pytest.mark.parametrize(("length", "mass", "degrees", "g"), [(0.4, 12.0, 70.0, 9.81), (2.5, 0.03, 150.0, 9.81), (1.0, 1.0, 45.0, 1.62)])
def test_mean_reaction_over_a_swing_is_the_weight(length: float, mass: float, degrees: float, g: float) -> None:
    a = np.radians(degrees)
    period = 4.0 * ellipk(np.sin(a / 2) ** 2) * np.sqrt(length / g)
    scene = ri.Scene(gravity=(0, 0, -g))
    place = length * np.array([0.6 * np.sin(a), 0.8 * np.sin(a), -np.cos(a)])
    scene.add(ri.Body("bob", ri.Shape.sphere(0.05), position=place, mass=mass))
    scene.add(ri.DistanceJoint(None, "bob", (0, 0, 0), place, name="string"))
    run = ri.simulate(scene, 2.5 * period, fps=240, accuracy=ri.Accuracy(step=1 / 240))
    spline = CubicSpline(run.times[:-1], run.reaction("string")[:-1])
    mean = spline.integrate(0.25 * period, 2.25 * period) / (2.0 * period * mass * g)
    np.testing.assert_allclose(mean, [0, 0, 1], atol=5e-4)
    # The reaction changes the momentum, with gravity: over any part of a swing.
    part = spline.integrate(0.1 * period, 0.7 * period) - [0, 0, mass * g * 0.6 * period]
    velocity = CubicSpline(run.times, run.velocity("bob"))
    change = mass * (velocity(0.7 * period) - velocity(0.1 * period))
    np.testing.assert_allclose(part, change, atol=5e-4 * mass * g * period)


def test_joints_stay_closed_over_many_swings() -> None:
    """Two rods fall from upright: anchors stay one point to 1e-9 of the length; constraints on velocities alone drift by 1e-3."""
    scene, rod = ri.Scene(gravity=(0, 0, -9.81)), ri.Shape.box((0.05, 0.05, 1.0))
    smooth = ri.Material(restitution=1.0, static_friction=0.0)
    for k, name in enumerate(("upper", "lower")):
        scene.add(
            ri.Body(
                name,
                rod,
                position=(0, 0, k + 0.5),
                velocity=(0, 0.2 * (k + 0.5), 0),
                angular_velocity=(-0.2, 0, 0),
                mass=1.0,
                material=smooth,
            )
        )
    scene.add(ri.HingeJoint(None, "upper", (0, 0, 0), (1, 0, 0)))
    scene.add(ri.HingeJoint("upper", "lower", (0, 0, 1), (1, 0, 0)))
    run = ri.simulate(scene, 10.0)
    from rigidimpulse.core.quaternion import rotate

    half = np.array([0, 0, 0.5])
    ends = {name: [run.position(name) + sign * rotate(run.orientation(name), half) for sign in (-1, 1)] for name in ("upper", "lower")}
    assert np.ptp(ends["lower"][1][:, 2]) > 3.0
    np.testing.assert_allclose(ends["upper"][0], 0.0, atol=1e-9)
    np.testing.assert_allclose(ends["lower"][0], ends["upper"][1], atol=1e-9)
