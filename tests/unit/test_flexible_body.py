"""What flexible bodies refuse, distances from shapes, first touches of moving points, and the messages of a page."""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.collision.distance.point import STACK, first_contact, first_contact_with_triangle, signed_distance
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import rotate_inverse
from rigidimpulse.dynamics.soft_body import FlexibleBody, Flexibles, FlexibleTrack
from rigidimpulse.dynamics.soft_body.track import tracks_in
from rigidimpulse.view.soft_bodies import soft_body_messages

TRIANGLE = {"mesh": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}


def flexible(**change) -> FlexibleBody:
    given = {"name": "cloth", "stiffness": 10.0, "mass": 1.0, **TRIANGLE, **change}
    return FlexibleBody(given.pop("name"), given.pop("mesh"), given.pop("faces"), **given)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"stiffness": 0.0}, "stiffness is 0.0 N/m"),
        ({"stiffness": np.nan}, "stiffness is nan"),
        ({"bending": -1.0}, "bending is -1.0 N m"),
        ({"damping": np.inf}, "damping is inf"),
        ({"mass": 0.0}, "mass is 0.0 kg"),
        ({"mass": None}, "encloses no volume"),
        ({"inner_stiffness": 10.0}, "mesh is open"),
        ({"faces": None}, "without faces"),
        ({"faces": [[0, 1, 3]]}, "there are 3 vertices"),
        ({"mesh": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]]}, "vertex 3 is in no face"),
        ({"mesh": [[0, 0, 0], [1, 0, 0], [2, 0, 0]]}, "face 0 has no area"),
        ({"mesh": ri.Shape.sphere(1.0), "faces": None}, "its shape is a sphere"),
        ({"pinned": [3]}, "vertex 3 is pinned"),
        ({"pinned": [0], "attached": {"ball": [0]}}, "fastened twice"),
        ({"attached": {"bull": [0]}}, "did you mean 'ball'"),
        ({"name": "ball"}, "has a body of this name"),
        ({"velocity": (0, 0)}, "velocity is (0, 0)"),
        ({"orientation": (0, 0, 0, 0)}, "orientation is"),
    ],
)
def test_bad_values_are_refused(change: dict, says: str) -> None:
    scene = ri.Scene(bodies=[ri.Body("ball", ri.Shape.sphere(1.0))])
    scene.add(flexible(**change))
    with pytest.raises(SceneError) as caught:
        Flexibles(ri.compile_scene(scene))
    assert says in str(caught.value)
    assert f"flexible body {change.get('name', 'cloth')!r}" in str(caught.value)


def geometry_of(shape: ri.Shape):
    return ri.compile_scene(ri.Scene(bodies=[ri.Body("b", shape, motion="static")])).geometry


def test_distances_from_shapes() -> None:
    """Against closed forms; a box as a mesh and its rounded relatives, at 200 points inside and outside."""
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (200, 3))
    half = np.array([0.2, 0.3, 0.4])
    beyond = np.abs(points) - half
    box = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
    off, height = np.linalg.norm(points[:, :2], axis=1), np.abs(points[:, 2])
    round_ = np.column_stack([off - 0.3, height - 0.4])
    expected = {
        ri.Shape.box(2.0 * half): box,
        ri.Shape.sphere(0.3): np.linalg.norm(points, axis=1) - 0.3,
        ri.Shape.capsule(0.3, 0.8): np.hypot(off, np.maximum(height - 0.4, 0.0)) - 0.3,
        ri.Shape.cylinder(0.3, 0.8): np.hypot(*np.maximum(round_, 0.0).T) + np.minimum(round_.max(axis=1), 0.0),
        ri.Shape.half_space((0, 0, 1), 0.1): points[:, 2] - 0.1,
    }
    for shape, distance in expected.items():
        world = ri.compile_scene(ri.Scene(bodies=[ri.Body("b", shape, motion="static")]))
        local = [rotate_inverse(world.orientation[0], p - world.position[0]) for p in points]
        found = [signed_distance(world.geometry, np.int64(0), tuple(map(float, p)), 10.0, np.empty(STACK, np.int64)) for p in local]
        np.testing.assert_allclose([d for d, _ in found], distance, rtol=0, atol=1e-14)
        for p, (d, normal) in zip(local, found, strict=True):  # the surface is where the normal says
            place = tuple(float(a) for a in np.asarray(p) - d * np.asarray(normal))
            assert abs(signed_distance(world.geometry, np.int64(0), place, 10.0, np.empty(STACK, np.int64))[0]) < 1e-13


def test_fast_points_touch() -> None:
    """A point through a plate of 1 mm at 1 km a step stops within 2 % of the gap; one that passes by does not touch."""
    geometry = geometry_of(ri.Shape.box((2.0, 2.0, 1e-3)))
    axis = int(np.argmin(np.ptp(geometry.vertex, axis=0)))
    start, end, gap = np.full(3, 0.1), np.full(3, 0.3), 1e-4
    start[axis], end[axis] = 1.0, -999.0
    time, distance, normal, _ = first_contact(geometry, np.int64(0), tuple(start), tuple(end), gap, np.empty(STACK, np.int64))
    assert gap <= distance <= 1.02 * gap
    assert time == pytest.approx((1.0 - 5e-4 - gap) / 1000.0, rel=1e-6)
    assert normal[axis] == 1.0
    start[(axis + 1) % 3] = end[(axis + 1) % 3] = 1.2
    assert first_contact(geometry, np.int64(0), tuple(start), tuple(end), gap, np.empty(STACK, np.int64))[0] == np.inf


def test_fast_ball_touches_a_moving_triangle() -> None:
    corners = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 2.0, 0.0))
    ways = ((0.0, 0.0, 4.0),) * 3
    time, weights, normal, distance = first_contact_with_triangle((0.0, 0.0, 1.0), (0.0, 0.0, -96.0), corners, ways, 0.1, 1e-3)
    assert time == pytest.approx((1.0 - 0.1 - 1e-3) / 100.0, rel=1e-4)
    assert 1e-3 * (1.0 - 1e-12) <= distance <= 1.02e-3
    np.testing.assert_allclose(weights, 1.0 / 3.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(normal, (0, 0, -1), rtol=0, atol=1e-12)


def test_track_of_a_page_and_a_file() -> None:
    track = FlexibleTrack("cloth", np.arange(36.0).reshape(3, 4, 3), np.array([[0, 1, 2], [0, 2, 3]]))
    (kind, mesh), (_, frames) = soft_body_messages(track, 2)
    assert kind == "soft body" and mesh["path"] == frames["path"] == "/softBodies/2"
    assert np.frombuffer(frames["value"].data, "<f4").tolist() == list(range(36))
    (back,) = tracks_in(track.arrays(0))
    np.testing.assert_array_equal(back.vertices, track.vertices)
    with pytest.raises(ValueError, match="'cloth'"):
        soft_body_messages(FlexibleTrack("cloth", np.full((1, 3, 3), np.nan), track.faces[:1]), 0)
