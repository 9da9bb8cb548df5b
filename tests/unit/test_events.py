"""The parts of the event kernel: its queue, its tree of boxes, and the times of contact in closed form."""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri
from rigidimpulse.engine.spheres.queue import make_queue, schedule
from rigidimpulse.engine.spheres.tree import build_tree, make_tree, overlapping, replace_box


def test_queue_gives_the_earliest_entry_after_any_changes() -> None:
    """Random changes of times, infinite ones and equal ones among them, against a search through all entries."""
    rng, n = np.random.default_rng(1), 40
    queue, times, owners = make_queue(n), np.full(n, np.inf), np.zeros(n, np.int64)
    for _ in range(2000):
        p = int(rng.integers(n))
        times[p] = rng.choice([np.inf, float(rng.integers(20)), rng.uniform(0, 20)])
        owners[p] = 1000 * int(rng.integers(5)) + p
        schedule(queue, p, float(times[p]), int(owners[p]))
        assert queue.size[0] == np.count_nonzero(times < np.inf)
        if queue.size[0]:
            assert queue.order[0] == min(range(n), key=lambda i: (times[i], owners[i]))


def test_tree_finds_the_bodies_that_a_test_of_all_pairs_finds() -> None:
    """Boxes of very different sizes, infinite ones among them, some of which are replaced; bodies that are left out are not found."""
    rng, n = np.random.default_rng(2), 150
    centre, half = rng.uniform(-5, 5, (n, 3)), rng.uniform(0.01, 1.0, (n, 1)) ** 3 * rng.uniform(0.1, 3.0, (n, 3))
    low, high = centre - half, centre + half
    high[7, 2], low[8, 0] = np.inf, -np.inf
    bodies = np.flatnonzero(np.arange(n) % 10 != 3)
    tree, found = make_tree(n), np.empty(n, np.int64)
    build_tree(tree, low, high, bodies)
    for _ in range(2):
        for i in bodies.tolist():
            apart = np.any((low > high[i]) | (low[i] > high), axis=1)
            expected = [j for j in bodies.tolist() if j != i and not apart[j]]
            assert sorted(found[: overlapping(tree, i, low, high, found)].tolist()) == expected
        for i in bodies[::4].tolist():
            move = rng.uniform(-3, 3, 3)
            low[i], high[i] = low[i] + move, high[i] + move
            replace_box(tree, i, low, high)


def test_time_of_contact_with_a_plane_far_away() -> None:
    """A ball thrown up from a height h at v meets the floor at (v + sqrt(v^2 + 2 g h)) / g, to the rounding of the time.

    A sweep in steps of 1/60 s that began each step from the pose at its start would be off by some 1e-15 s a step.
    """
    g, h, v, radius = 9.81, 3.0, 40.0, 0.25
    scene = ri.Scene(gravity=(0, 0, -g))
    smooth = ri.Material(restitution=0.9, static_friction=0, dynamic_friction=0)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=smooth))
    scene.add(ri.Body("ball", ri.Shape.sphere(radius), position=(1, 2, radius + h), velocity=(3, 0, v), material=smooth))
    times = [ri.simulate(scene, 9.0, effects={"event kernel": on}).impacts["time"][0] for on in (True, False)]
    exact = (v + np.sqrt(v * v + 2.0 * g * h)) / g
    assert abs(times[0] - exact) <= 2.0 * np.spacing(exact)
    assert times[0] == times[1]


def test_time_of_contact_of_balls_that_graze() -> None:
    """Two balls pass at a distance just below the sum of their radii: the time follows from the chord that is left.

    With b = 2 r - d the root of (2 r)^2 - b^2 has a relative error of about eps r / d for d = 1e-6 r, so 1e-9 is asked of the time from
    closest approach; taking it from the discriminant of the plain quadratic equation at a distance of 100 r would leave 1e-6.
    """
    radius, d, speed, away = 0.1, 1e-7, 2.0, 10.0
    beside = 2.0 * radius - d
    scene = ri.Scene(gravity=(0, 0, 0))
    smooth = ri.Material(restitution=1.0, static_friction=0, dynamic_friction=0)
    scene.add(ri.Body("a", ri.Shape.sphere(radius), position=(0, 0, 0), material=smooth))
    scene.add(ri.Body("b", ri.Shape.sphere(radius), position=(away, beside, 0), velocity=(-speed, 0, 0), material=smooth))
    before_closest = away / speed - ri.simulate(scene, 6.0).impacts["time"][0]
    exact = np.sqrt(2.0 * radius * d * 2.0 - d * d) / speed
    assert abs(before_closest / exact - 1.0) <= 1e-9
