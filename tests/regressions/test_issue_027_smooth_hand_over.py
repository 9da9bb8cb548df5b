"""Impacts hand over to lasting contact smoothly: launches on a line give poses on a line.

A motion that depends on its launch speed v smoothly is a line in v over a small range, up to round-off: the curvature adds
v''^2 (1e-8)^2 / 8, far below 1e-12 m here. What departs from the line is noise that a rule of the loop makes.
"""

import numpy as np
import pytest

import rigidimpulse as ri

LAUNCHES = 9
APART = 5e-9  # m/s
MOST = 1e-12  # m

CUBE = (0.1, 0.1, 0.1)
BRICK = (0.1, 0.07, 0.04)


def _launch(size, e, mu, tilt, extra):
    """Poses (f, 3) of a box thrown on a floor that is tilted by an angle [rad]."""
    material = ri.Material(density=1000, restitution=e, static_friction=mu, dynamic_friction=mu)
    scene = ri.Scene(gravity=(9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt)))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    turn = np.array([0.9, 0.3, 0.2, 0.1])
    place = {"position": (0.0, 0.0, 0.3), "orientation": turn / np.linalg.norm(turn)}
    motion = {"velocity": (0.3, -0.1, -2.0 + extra), "angular_velocity": (1.0, 2.0, 0.5)}
    scene.add(ri.Body("box", ri.Shape.box(size), material=material, **place, **motion))
    return ri.simulate(scene, duration=0.5, fps=100).position("box")


def departure(size, e, mu, tilt=0.0):
    """Largest distance [m] of a coordinate from its line over launches that differ by the same speed each."""
    extra = APART * (np.arange(LAUNCHES) - LAUNCHES // 2)
    poses = np.array([_launch(size, e, mu, tilt, x) for x in extra]).reshape(LAUNCHES, -1)
    lines = np.column_stack([np.ones(LAUNCHES), extra / extra[-1]])
    return float(np.abs(poses - lines @ np.linalg.lstsq(lines, poses, rcond=None)[0]).max())


@pytest.mark.parametrize(
    ("size", "e", "mu", "tilt"),
    [
        (CUBE, 0.2, 0.5, 0.0),
        (CUBE, 0.0, 0.5, 0.0),
        (CUBE, 0.5, 0.5, 0.0),
        (CUBE, 0.2, 0.1, 0.0),
        (CUBE, 0.0, 1.0, 0.0),
        (CUBE, 0.2, 0.0, 0.0),
        (CUBE, 0.0, 0.5, 0.2),
        (BRICK, 0.2, 0.5, 0.0),
        (BRICK, 0.0, 0.5, 0.0),
    ],
)
def test_poses_of_close_launches_lie_on_a_line(size, e, mu, tilt):
    assert departure(size, e, mu, tilt) <= MOST
