"""Closest features of segments, triangles and edges against definitions and exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigidimpulse.collision.distance.simplices import arc_miss, closest_on_segments, over_triangle, pierces_triangle
from rigidimpulse.collision.geometry import EDGE_BOUNDARY, EDGE_CAPSULE, EDGE_CONVEX, EDGE_HIDDEN

coordinate = st.floats(-1.0, 1.0, width=32)
point = st.tuples(coordinate, coordinate, coordinate)
EPSILON = np.finfo(float).eps
fixed = settings(deadline=None, derandomize=True)  # no deadline: the first call compiles


def segment_distance(p, d, q, e):
    s, t = closest_on_segments(p, d, q, e)
    assert 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0
    return float(np.linalg.norm(np.array(p) + s * np.array(d) - np.array(q) - t * np.array(e)))


def exact_segment_distance_squared(p, d, q, e):
    """Least squared distance in rational arithmetic: over both interiors, and each end against the other segment."""
    p, d, q, e = ([Fraction(float(c)) for c in v] for v in (p, d, q, e))

    def dot(a, b):
        return sum(x * y for x, y in zip(a, b, strict=True))

    def squared(s, t):
        v = [a + s * b - c - t * f for a, b, c, f in zip(p, d, q, e, strict=True)]
        return dot(v, v)

    def clamp(x):
        return min(Fraction(1), max(Fraction(0), x))

    r = [b - a for a, b in zip(p, q, strict=True)]
    dd, ee, de, dr, er = dot(d, d), dot(e, e), dot(d, e), dot(d, r), dot(e, r)
    found = []
    for s in (Fraction(0), Fraction(1)):
        found.append(squared(s, clamp((s * de - er) / ee) if ee else Fraction(0)))
    for t in (Fraction(0), Fraction(1)):
        found.append(squared(clamp((dr + t * de) / dd) if dd else Fraction(0), t))
    determinant = dd * ee - de * de
    if determinant > 0:
        s, t = (dr * ee - er * de) / determinant, (dr * de - er * dd) / determinant
        if 0 <= s <= 1 and 0 <= t <= 1:
            found.append(squared(s, t))
    return min(found)


@fixed
@given(point, point, point, point)
def test_segment_distance_is_the_least(p, d, q, e):
    # Points have an error of some eps (coordinates below 4); so has the distance.
    exact = float(exact_segment_distance_squared(p, d, q, e)) ** 0.5
    assert abs(segment_distance(p, d, q, e) - exact) <= 32 * EPSILON


@pytest.mark.parametrize("angle", [1e-3, 1e-6, 1e-9, 1e-12, 0.0])
@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-12])
def test_nearly_parallel_segments_lose_no_digits(angle, gap):
    # Error of s: eps / angle; moving both points by it changes their offset by angle * eps / angle = eps. The textbook
    # determinant would give s an error of eps / angle^2 and the distance one of eps / angle (2e-7 at 1e-9).
    p, d = (-0.4, 0.0, 0.0), (1.0, 0.0, 0.0)
    e = (np.cos(angle), np.sin(angle), 0.0)
    q = (-0.5 * e[0], -0.5 * e[1], gap)
    exact = float(exact_segment_distance_squared(p, d, q, e)) ** 0.5
    assert abs(segment_distance(p, d, q, e) - exact) <= 8 * EPSILON


@fixed
@given(point, point, point, st.floats(-0.5, 1.5), st.floats(-0.5, 1.5))
def test_over_triangle_is_barycentric(a, b, c, u, v):
    # p = a + u (b - a) + v (c - a) + h n lies over the triangle where u, v, 1 - u - v are not negative.
    a, b, c = np.array(a), np.array(b), np.array(c)
    area = np.cross(b - a, c - a)
    if np.linalg.norm(area) < 1e-3 or min(abs(u), abs(v), abs(1.0 - u - v)) < 1e-9:
        return
    normal = area / np.linalg.norm(area)
    p = a + u * (b - a) + v * (c - a) + 0.3 * normal
    inside = u > 0.0 and v > 0.0 and u + v < 1.0
    assert over_triangle(tuple(p), tuple(a), tuple(b), tuple(c), tuple(normal), 0.0, 0.0, 0.0) == inside


def test_slack_moves_one_side_of_a_triangle():
    triangle = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    below = (0.25, -0.01, 5.0)
    assert not over_triangle(below, *triangle, 0.0, 0.0, 0.0)
    assert over_triangle(below, *triangle, 0.011, 0.0, 0.0)
    assert not over_triangle(below, *triangle, 0.009, 1.0, 1.0)


@fixed
@given(st.floats(-0.5, 1.5), st.floats(-0.5, 1.5), st.floats(0.01, 1.0), st.floats(-1.0, 1.0))
def test_segment_pierces_the_triangle_it_runs_through(x, y, above, below):
    triangle = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    if min(abs(x), abs(y), abs(1.0 - x - y)) < 1e-9:
        return
    inside = x > 0.0 and y > 0.0 and x + y < 1.0
    assert pierces_triangle((x, y, above), (x, y, below), *triangle) == (inside and below <= 0.0)


@fixed
@given(st.floats(-np.pi, np.pi), st.floats(1e-3, np.pi - 1e-3))
def test_arc_of_a_convex_edge(angle, bend):
    # Edge along y, face 0 with normal z on the side x < 0: the arc turns from z towards x by the bend. A direction next
    # to an end misses the arc by the sine of its angle to that end.
    def direction(a):
        return (np.sin(a), 0.0, np.cos(a))

    if min(abs(angle), abs(angle - bend)) < 1e-9:
        return
    normals = (direction(0.0), direction(bend))
    along = (0.0, 1.0, 0.0)
    miss, end = arc_miss(direction(angle), along, *normals, EDGE_CONVEX)
    assert (miss < 0.0) == (0.0 < angle < bend)
    if -0.1 < angle < 0.0:
        assert miss >= -np.sin(angle) - 4 * EPSILON and end == normals[0]
    if bend < angle < bend + 0.1:
        assert miss >= np.sin(angle - bend) - 4 * EPSILON and end == normals[1]
    assert arc_miss(direction(angle), along, *normals, EDGE_HIDDEN)[0] == np.inf
    assert arc_miss(direction(angle), along, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), EDGE_CAPSULE)[0] < 0.0


@fixed
@given(st.floats(-np.pi, np.pi))
def test_arc_of_a_boundary_is_the_half_circle_beyond_it(angle):
    if min(abs(angle), np.pi - abs(angle)) < 1e-9:
        return
    normal = (0.0, 0.0, 1.0)
    direction = (np.sin(angle), 0.0, np.cos(angle))
    miss, end = arc_miss(direction, (0.0, 1.0, 0.0), normal, normal, EDGE_BOUNDARY)
    assert miss == -np.sin(angle)
    assert end == (0.0, 0.0, np.sign(np.cos(angle)))
