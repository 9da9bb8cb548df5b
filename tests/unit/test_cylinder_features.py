"""Least distances of cylinders to each other and to triangles, segments and points.

A least distance carries its own proof: points p, q of the two solids with |q - p| = d bound it from above, and the
support gap of the normal, min_B n.x - max_A n.x, bounds it from below. Where both agree the answer is the distance,
whatever the algorithm. Round-off of coordinates of size s leaves 1e-16 s in the points; a normal that is off by e
costs up to e s. The tolerance is 1e-12 s. A solver that stops at 1e-6, as general convex ones do, fails by six orders
of magnitude.
"""

from __future__ import annotations

import numpy as np
import pytest
from cylinder_arrangements import Z, outside, support, unit

from rigidimpulse.collision.manifold.cylinder import cylinder_cylinder_distance, cylinder_triangle_distance

CERTAIN = 1e-12  # relative to the size of the arrangement


def distance_to_triangle(triangle, q):
    """Return the distance of a point to a triangle, which may be a segment or a point: to its edges or to its face."""
    normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    sides = np.roll(triangle, -1, axis=0) - triangle
    length = np.maximum(np.sum(sides * sides, axis=1), 1e-300)
    fraction = np.clip(np.sum((q - triangle) * sides, axis=1) / length, 0.0, 1.0)
    distance = np.linalg.norm(q - triangle - fraction[:, None] * sides, axis=1).min()
    if np.linalg.norm(normal) > 0.0 and np.all(np.sum(np.cross(normal, sides) * (q - triangle), axis=1) >= 0.0):
        distance = min(distance, abs((q - triangle[0]) @ normal) / np.linalg.norm(normal))
    return distance


def direction_near(rng, z):
    """A random direction; often along or across z, exactly or nearly so."""
    across = np.cross(z, unit(rng))
    across /= np.linalg.norm(across)
    near = unit(rng) * 10.0 ** rng.uniform(-15, -2)
    v = [unit(rng), z, across, z + near, across + near, np.eye(3)[rng.integers(3)]][rng.integers(6)]
    return v / np.linalg.norm(v)


def test_distance_of_cylinders_is_certain():
    rng = np.random.default_rng(1)
    out, num_apart, num_overlap = np.zeros(9), 0, 0
    for _ in range(4_000):
        scale = 10.0 ** rng.integers(-3, 4)
        half_a, radius_a, half_b, radius_b = scale * 10.0 ** rng.uniform(-1.5, 0.5, 4)
        if rng.random() < 0.2:
            half_b, radius_b = half_a, radius_a
        a = direction_near(rng, Z)
        b, d = direction_near(rng, a), direction_near(rng, a)
        centre_a = scale * rng.normal(size=3) * rng.integers(2)
        gap = scale * (10.0 ** rng.uniform(-10, 0) if rng.random() < 0.9 else -1.0)
        reach = support(a, half_a, radius_a, d) + support(b, half_b, radius_b, d)
        sideways = np.cross(d, unit(rng)) * scale * rng.choice([0.0, 0.1, 1.0])
        centre_b = centre_a + d * (reach + gap) + sideways
        distance = cylinder_cylinder_distance((centre_a, a, half_a, radius_a), (centre_b, b, half_b, radius_b), out)
        swapped = cylinder_cylinder_distance((centre_b, b, half_b, radius_b), (centre_a, a, half_a, radius_a), np.zeros(9))
        p, q, n = out[:3], out[3:6], out[6:]
        size = np.linalg.norm(centre_b - centre_a) + np.linalg.norm(centre_a) + half_a + radius_a + half_b + radius_b
        assert outside(p, centre_a, a, half_a, radius_a) < 1e-14 * size
        assert outside(q, centre_b, b, half_b, radius_b) < 1e-14 * size
        assert abs(np.linalg.norm(q - p) - distance) < 1e-14 * size
        assert abs(distance - swapped) < CERTAIN * size
        if distance > 0.0:
            num_apart += 1
            bound = n @ (centre_b - centre_a) - support(a, half_a, radius_a, n) - support(b, half_b, radius_b, n)
            assert abs(np.linalg.norm(n) - 1.0) < 1e-14
            assert distance - bound < CERTAIN * size
        else:
            num_overlap += 1
    assert num_apart > 3_000 and num_overlap > 50


@pytest.mark.parametrize("corners", [1, 2, 3])
def test_distance_to_points_segments_and_triangles_is_certain(corners):
    rng = np.random.default_rng(corners)
    out, num_apart, num_overlap = np.zeros(9), 0, 0
    for _ in range(2_500):
        scale = 10.0 ** rng.integers(-3, 4)
        half, radius = scale * 10.0 ** rng.uniform(-1.5, 0.5, 2)
        axis = direction_near(rng, Z)
        centre = scale * rng.normal(size=3) * rng.integers(2)
        sides = np.array([np.zeros(3), direction_near(rng, axis), direction_near(rng, axis)])
        triangle = sides * scale * 10.0 ** rng.uniform(-2, 1, 3)[:, None]
        triangle[corners:] = triangle[corners - 1]
        n = direction_near(rng, axis)
        across = np.cross(triangle[1], triangle[2])
        if corners == 3 and rng.random() < 0.4 and np.linalg.norm(across) > 0.0:
            n = across / np.linalg.norm(across)
        gap = scale * (10.0 ** rng.uniform(-10, 0) if rng.random() < 0.9 else -0.1)
        triangle += (
            centre
            - rng.random() * triangle[rng.integers(3)]
            + np.cross(n, unit(rng)) * scale * rng.choice([0.0, 0.1, 1.0])
        )
        triangle += n * (support(axis, half, radius, n) + gap - ((triangle - centre) @ n).min())
        distance = cylinder_triangle_distance(centre, axis, half, radius, triangle, out)
        p, q, n = out[:3], out[3:6], out[6:]
        size = np.abs(triangle - centre).max() + np.linalg.norm(centre) + half + radius
        assert outside(p, centre, axis, half, radius) < 1e-14 * size
        assert distance_to_triangle(triangle, q) < 1e-14 * size
        assert abs(np.linalg.norm(q - p) - distance) < 1e-14 * size
        if distance > 1e-14 * size:
            num_apart += 1
            assert distance - (((triangle - centre) @ n).min() - support(axis, half, radius, n)) < CERTAIN * size
        else:
            num_overlap += 1
    assert num_apart > 1_500 and num_overlap > 20


def test_plane_of_a_large_triangle_through_the_cylinder_overlaps():
    """No edge comes near: only the face tells."""
    out = np.zeros(9)
    triangle = np.array([[-50.0, -40.0, 0.3], [60.0, -40.0, 0.2], [0.0, 70.0, -0.4]])
    assert cylinder_triangle_distance(np.zeros(3), Z, 1.0, 0.5, triangle, out) == 0.0
    assert cylinder_triangle_distance(np.array([0.0, 0.0, 3.0]), Z, 1.0, 0.5, triangle, out) > 1.0
    # a thin rod through both caps, away from the axis: sides, rims and axes are all apart
    rod = (np.array([0.5, 0.2, 0.0]), Z, 9.0, 0.01)
    assert cylinder_cylinder_distance((np.zeros(3), Z, 1.0, 1.0), rod, out) == 0.0
