"""Bodies that start flush stay where they are, whatever rounding did to their places.

Of 40 cubes on tables, rounded to single precision, 16 fell through; a cube of 1 m fell from any depth between 1e-8 and 1e-5 m. A pair
whose contacts were not found was left alone. Here a body moves by at most 1e-5 of its size, and the status is ok.
`tests/bench/flush_starts.py` has a thousand of these.
"""

from __future__ import annotations

import numpy as np
import pytest
from flush_scenes import RISE, check

import rigidimpulse as ri

SEEDS = range(25)
"""Each arrangement five times, with both precisions, flat and tilted."""


@pytest.mark.parametrize("seed", SEEDS)
def test_flush_bodies_stay(seed):
    start, moved, message = check(seed)
    assert not message, start.label
    assert moved <= RISE, start.label


@pytest.mark.parametrize("size", [0.01, 1.0])
@pytest.mark.parametrize("depth", [1e-12, 1e-9, 1e-8, 1e-7, 1e-6, 9e-6])
def test_cube_inside_a_table_by_less_than_a_file_is_off(size, depth):
    scene = ri.Scene()
    scene.add(ri.Body("table", ri.Shape.box((4 * size, 4 * size, size)), motion="static", position=(0, 0, -size / 2)))
    scene.add(ri.Body("cube", ri.Shape.box(size), position=(0, 0, (0.5 - depth) * size)))
    run = ri.simulate(scene, 0.2)
    height = run.position("cube")[:, 2] / size - 0.5
    assert run.status.ok
    assert height[-1] == pytest.approx(1e-6, abs=1e-8), "at the contact margin"
    assert np.ptp(height[1:]) <= 1e-9


def test_five_cubes_inside_each_other_do_not_collapse():
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for level in range(5):
        scene.add(ri.Body(f"cube {level}", ri.Shape.box(1.0), position=(0, 0, 0.5 + level * (1.0 - 1e-7))))
    run = ri.simulate(scene, 0.5)
    assert run.status.ok
    for level in range(5):
        height = run.position(f"cube {level}")[-1, 2]
        assert 0.0 <= height - (0.5 + level) <= 1e-5


@pytest.mark.parametrize("masses", [(0.5, 0.01, 300.0, 500.0, 250.0), (1.0, 0.01, 1.0, 1000.0), (1.0, 0.001, 1e3)])
def test_light_cubes_below_heavy_ones_are_not_entered(masses):
    """An open tower has space for all its contact margins. Light cubes were made smaller, as if it had none, by some 1e-6 of their size."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for level, mass in enumerate(masses):
        scene.add(ri.Body(f"cube {level}", ri.Shape.box(1.0), position=(0, 0, 0.5 + level), mass=mass))
    run = ri.simulate(scene, 0.2)
    assert run.status.ok
    for level in range(len(masses)):
        heights = run.position(f"cube {level}")[:, 2] - (0.5 + level)
        # Each of the contacts below it is held at 1e-6 of the size; nothing is less than flush.
        assert heights.min() >= -1e-12 and heights.max() <= (level + 1.1) * 1e-6


def test_cubes_that_fill_a_box_are_held_by_it():
    """They are a little smaller than the box, by some contact margins; when it is turned they do not come out of it, nor jam."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for x in (-1.25, 1.25):
        scene.add(ri.Body(f"wall {x}", ri.Shape.box((0.5, 1.0, 1.0)), motion="static", position=(x, 0, 0.5)))
    for k in range(2):
        scene.add(ri.Body(f"cube {k}", ri.Shape.box(1.0), position=(k - 0.5, 0, 0.5), velocity=(0, 1.0, 0)))
    run = ri.simulate(scene, 0.5)
    assert run.status.ok
    for k in range(2):
        way = run.position(f"cube {k}") - run.position(f"cube {k}")[0]
        # Friction of the floor stops them: mu g = 4.9 m/s2, v = 1 m/s, 0.102 m, exactly so if the walls press on nothing.
        assert way[-1, 1] == pytest.approx(1.0 / (2 * 0.5 * 9.81), rel=1e-3)
        assert np.abs(way[:, [0, 2]]).max() <= 1e-5
