"""Overlapping boxes against the test of every pair, and boxes of paths against samples of them."""

import numpy as np
import pytest

from rigidimpulse.collision.broad_phase import FEW, overlapping_pairs, overlapping_with
from rigidimpulse.engine.pair_table import path_box
from rigidimpulse.motion.trajectory import FIXED, FREE, PRESCRIBED, begin, make_trajectories, pose_at

SIZES = [0, 1, 2, 7, FEW, FEW + 1, 150, 900]


def brute(box_min, box_max, movable):
    meet = np.all((box_min[:, None] <= box_max[None]) & (box_min[None] <= box_max[:, None]), axis=2)
    meet &= movable[:, None] | movable[None]
    return np.argwhere(np.triu(meet, 1))


def found(box_min, box_max, movable):
    out = np.empty((len(movable) ** 2 + 1, 2), dtype=np.int32)
    return out[: overlapping_pairs(box_min, box_max, movable, out)]


def boxes(layout, n, seed=0):
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.1, 0.5, (n, 3))
    if layout == "cube":
        centre = rng.uniform(0.0, max(n, 1) ** (1 / 3), (n, 3))
    elif layout == "line":
        centre = np.column_stack([np.zeros(n), rng.uniform(0.0, 0.4 * n, n), np.zeros(n)])
    elif layout == "same place":
        centre = np.zeros((n, 3))
        half[:] = 0.5
    elif layout == "grid":  # neighbours touch exactly
        side = int(np.ceil(max(n, 1) ** (1 / 3)))
        centre = np.stack(np.unravel_index(np.arange(n), (side, side, side)), axis=1).astype(float)
        half[:] = 0.5
    else:  # sizes from 1e-3 to 1e3, some boxes infinite
        centre = rng.normal(0.0, 30.0, (n, 3))
        half = 10.0 ** rng.uniform(-3.0, 3.0, (n, 1)) * np.ones(3)
        half[rng.random(n) < 0.05] = np.inf
    return centre - half, centre + half


@pytest.mark.parametrize("layout", ["cube", "line", "same place", "grid", "mixed"])
@pytest.mark.parametrize("n", SIZES)
def test_finds_all_pairs_in_ascending_order(layout, n):
    box_min, box_max = boxes(layout, n)
    movable = np.random.default_rng(1).random(n) < 0.7
    np.testing.assert_array_equal(found(box_min, box_max, movable), brute(box_min, box_max, movable).reshape(-1, 2))


@pytest.mark.parametrize("n", [FEW, 500])
def test_half_infinite_boxes(n):
    box_min, box_max = boxes("cube", n)
    box_min[0], box_max[0] = -np.inf, np.inf
    box_min[0, 2], box_max[0, 2] = -np.inf, 0.5
    box_min[1], box_max[1] = (-np.inf, 1.0, -np.inf), (np.inf, np.inf, np.inf)
    movable = np.ones(n, dtype=bool)
    np.testing.assert_array_equal(found(box_min, box_max, movable), brute(box_min, box_max, movable))


def test_only_infinite_boxes():
    box_min, box_max = np.full((FEW + 5, 3), -np.inf), np.full((FEW + 5, 3), np.inf)
    box_max[3] = -1.0
    box_min[4] = 1.0
    movable = np.ones(FEW + 5, dtype=bool)
    np.testing.assert_array_equal(found(box_min, box_max, movable), brute(box_min, box_max, movable))


@pytest.mark.parametrize("n", [FEW, 700])
def test_order_of_the_bodies_does_not_matter(n):
    box_min, box_max = boxes("mixed", n)
    movable = np.ones(n, dtype=bool)
    order = np.random.default_rng(2).permutation(n)
    renamed = np.sort(order[found(box_min[order], box_max[order], movable)], axis=1)
    renamed = renamed[np.lexsort(renamed.T[::-1])]
    np.testing.assert_array_equal(renamed, found(box_min, box_max, movable))


@pytest.mark.parametrize("n", [FEW, 300])
def test_tells_how_much_room_it_needs(n):
    box_min, box_max = boxes("cube", n)
    movable = np.ones(n, dtype=bool)
    needed = len(brute(box_min, box_max, movable))
    assert overlapping_pairs(box_min, box_max, movable, np.empty((needed - 1, 2), dtype=np.int32)) == -needed
    assert overlapping_pairs(box_min, box_max, movable, np.empty((needed, 2), dtype=np.int32)) == needed


def test_one_body_against_all():
    box_min, box_max = boxes("mixed", 300)
    movable = np.random.default_rng(3).random(300) < 0.5
    pairs = brute(box_min, box_max, movable)
    out = np.empty(300, dtype=np.int64)
    for i in range(0, 300, 7):
        expected = np.sort(np.concatenate([pairs[pairs[:, 0] == i, 1], pairs[pairs[:, 1] == i, 0]]))
        np.testing.assert_array_equal(out[: overlapping_with(i, box_min, box_max, movable, out)], expected)
        if len(expected):
            assert overlapping_with(i, box_min, box_max, movable, out[: len(expected) - 1]) == -len(expected)


def test_boxes_hold_the_path_and_no_more():
    """Parabolas and cubics, from any time of the trajectory: the box is that of 10,000 samples, to what a path turns between two of them.

    That is |a| (h / 10,000)^2 / 8 with accelerations of some 1e3 m/s^2: 1e-5 m at most. Boxes that missed the turns of the cubics would be
    off by metres.
    """
    rng = np.random.default_rng(4)
    low, high, centre, q = np.empty((1, 3)), np.empty((1, 3)), np.empty(3), np.empty(4)
    for mode in (FREE, PRESCRIBED, FIXED):
        for _ in range(60):
            trajectory = make_trajectories(1)
            trajectory.mode[0], trajectory.start[0], trajectory.position[0] = mode, rng.normal(), rng.normal(size=3)
            trajectory.velocity[0] = rng.normal(size=3) * 10 ** rng.uniform(-1, 2)
            trajectory.acceleration[0] = rng.normal(size=3) * 10 ** rng.uniform(-1, 2) * (mode == FREE)
            trajectory.jerk[0] = rng.normal(size=3) * 10 ** rng.uniform(-1, 3) * (rng.random(3) < 0.7)
            begin(trajectory, 0)
            t, radius = trajectory.start[0] + np.array([0.0, 1.0]) + rng.random(2), rng.random()
            path_box(trajectory, 0, *t, radius, low, high)
            samples = []
            for time in np.linspace(*t, 10_001):
                pose_at(trajectory, 0, time, centre, q)
                samples.append(centre.copy())
            slack = 1e-13 * (1.0 + np.abs(samples).max())
            least, most = np.min(samples, axis=0) - radius, np.max(samples, axis=0) + radius
            assert np.all(low[0] <= least + slack) and np.all(high[0] >= most - slack)
            assert np.all(low[0] >= least - 1e-4) and np.all(high[0] <= most + 1e-4)
