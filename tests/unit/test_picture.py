"""Stills drawn without a browser: silhouettes of the right size, the nearer in front, shadows below, and files that others read."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image
from test_view import ball_run, impacts_of, recording

from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.view.contents import page_scene
from rigidimpulse.view.picture import HALF_TALL, SUPERSAMPLING, _camera, draw_picture, png, telling_frame

WIDTH, HEIGHT = 320, 200
CLEAR = 12  # of 255: a change of colour that one sees


def still(*bodies: Body) -> np.ndarray:
    """Picture of bodies in space."""
    scene = Scene(gravity=(0, 0, 0), bodies=bodies)
    positions = np.array([[body.position for body in bodies]], dtype=float)
    return draw_picture(recording(scene, np.zeros(1), positions), WIDTH, HEIGHT).astype(int)


def test_a_ball_is_seen_as_large_as_it_is() -> None:
    # Without gravity there is no ground: what is not sky is the ball. A sphere of radius r at the distance d in the middle of the
    # picture covers a disc of the radius tan(asin(r / d)); 64 corners cut 0.2 % off it, half a pixel at the rim 2 %.
    scene = Scene(gravity=(0, 0, 0), bodies=[Body("ball", Shape.sphere(0.5))])
    run = recording(scene, np.zeros(1), np.zeros((1, 1, 3)))
    picture = draw_picture(run, WIDTH, HEIGHT).astype(int)
    framing, _ = page_scene(run)
    camera = _camera(framing, WIDTH, HEIGHT)
    half = np.tan(np.arcsin(0.5 / np.linalg.norm(camera.eye)))
    radius = 0.5 * HEIGHT * half / HALF_TALL
    sky = np.median(picture[:, :8], axis=1)[:, None]  # its colour changes with height only
    covered = np.abs(picture - sky).max(axis=2) > CLEAR
    assert np.count_nonzero(covered) == pytest.approx(np.pi * radius**2, rel=0.03)
    rows, columns = np.nonzero(covered)
    (column, row), _ = camera.seen(np.zeros(3))
    assert rows.mean() == pytest.approx(row, abs=1.0) and columns.mean() == pytest.approx(column, abs=1.0)


def test_the_nearer_of_two_bodies_hides_the_other_in_any_order() -> None:
    # The camera looks along about (-0.5, 0.8, 0.2) of the recorded frame from the side of the near box, which is the larger.
    far, near = Body("far", Shape.box(0.3), position=(0, 0, 0)), Body("near", Shape.box(1.0), position=(0, 0, 0))
    scene = Scene(gravity=(0, 0, 0), bodies=[far, near])
    framing, _ = page_scene(recording(scene, np.zeros(1), np.zeros((1, 2, 3))))
    towards = np.array([framing.view[0], -framing.view[2], framing.view[1]])  # the turned frame is Y up
    far = Body("far", Shape.box(0.3), position=-2.0 * towards)
    one, other, alone = still(near, far), still(far, near), still(near, Body("gone", Shape.box(1e-6), position=-2.0 * towards))
    # Only the colours change with the order, so the middle is that of the first or second colour of the palette.
    middle = (slice(HEIGHT // 2 - 3, HEIGHT // 2 + 3), slice(WIDTH // 2 - 3, WIDTH // 2 + 3))
    assert np.abs(one[middle] - alone[middle]).max() <= 2
    assert one[middle][..., 2].mean() > one[middle][..., 0].mean()  # blue, the first
    assert other[middle][..., 0].mean() > other[middle][..., 2].mean()  # amber, the second


def test_a_body_casts_its_shadow_on_the_ground() -> None:
    run = ball_run(1)
    with_ball = draw_picture(run, WIDTH, HEIGHT).astype(int)
    light = with_ball.sum(axis=2)[HEIGHT // 2 :]
    # The ball lies on the floor: part of the lower half is darker than the floor far off by most of what shadows take, 30 %.
    floor = np.median(light[-20:])
    grey = np.ptp(with_ball, axis=2)[HEIGHT // 2 :] < 25
    shaded = grey & (light < 0.8 * floor)
    assert 100 < np.count_nonzero(shaded) < 0.3 * shaded.size


def test_png_is_what_was_drawn() -> None:
    picture = np.random.default_rng(5).integers(0, 256, (7, 11, 3)).astype(np.uint8)
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(png(picture)))), picture)
    assert draw_picture(ball_run(2), 40, 24).shape == (24, 40, 3)
    assert SUPERSAMPLING >= 2


def test_the_frame_after_the_strongest_impact_tells_most() -> None:
    run = ball_run(25)
    assert telling_frame(run) == 8
    scene = run.scene
    strong = recording(scene, run.times, run.positions, impacts=impacts_of((0.1, 0, 1, 1.0), (0.5, 0, 1, 9.0), (0.9, 0, 1, 2.0)))
    assert run.times[telling_frame(strong)] == pytest.approx(0.5 + 2 / 24)
