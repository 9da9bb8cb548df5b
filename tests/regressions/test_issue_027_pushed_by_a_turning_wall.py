"""Issue 27: what sub-steps press into a moving wall is not given to the exact regime before that can see it."""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

SPIN = 1.5


@pytest.mark.parametrize("size", [0.02, 0.1])
def test_a_box_that_a_turning_wall_pushes_stays_before_it(size: float) -> None:
    """Without friction and gravity the box slides outwards along the wall, r'' = w^2 r: r = cosh(w t) + h sinh(w t), h half its size.

    It begins with no speed along x, where the wall at its centre would have -w h. At "preview" it is sub-stepped now and then.
    It was 6.5e-6 m inside when its island was given back. Exact contact looks for 1.2e-5 of the size: the box flew through the wall.
    """
    smooth = ri.Material(static_friction=0.0, dynamic_friction=0.0)
    wall = ri.Shape.compound([(ri.Shape.box((8.0, 0.2, 0.2)), (4.0, -0.1, 0.0), (1.0, 0.0, 0.0, 0.0))])
    scene = ri.Scene(gravity=(0, 0, 0))
    turning = {"motion": "kinematic", "angular_velocity": (0, 0, SPIN), "center_of_mass": (0, 0, 0)}
    scene.add(ri.Body("wall", wall, material=smooth, **turning))
    moving = {"velocity": (0, SPIN, 0), "angular_velocity": (0, 0, SPIN)}
    scene.add(ri.Body("box", ri.Shape.box(size), position=(1.0, 0.5 * size, 0.0), material=smooth, **moving))
    run = ri.simulate(scene, 1.2, accuracy="preview")
    angle = SPIN * run.times
    x, y = run.position("box")[:, 0], run.position("box")[:, 1]
    before = y * np.cos(angle) - x * np.sin(angle) - 0.5 * size
    along = x * np.cos(angle) + y * np.sin(angle)
    assert run.status.ok, run.status.message
    assert np.abs(before).max() < 0.008 * 0.5 * size
    assert along == pytest.approx(np.cosh(angle) + 0.5 * size * np.sinh(angle), rel=1e-3)
