"""Until when runs can be trusted: the horizon against the time at which a run really leaves the exact one.

Six elastic disks in a box: every impact between disks multiplies an error by some 2 distance / radius, so rounding, 1e-16, reaches a
thousandth of a disk after some ten to fifteen of them. The exact run has 50 digits. An error that is k times as large reaches it earlier by
ln k / (growth rate): of the way from 1e-16 to 1e-3, ln 1e13 = 30, a factor of 30 is a ninth. A horizon that did not look for chaos would be
the end of the run, since no setting changes the motion of balls.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.gallery.event_driven import DisksInRectangle

RADIUS, SIDE, DURATION, FPS = 1.0, 5.0, 120.0, 5.0
TOLERANCE = 1e-3 * 2.0 * RADIUS


def disks(seed: int) -> tuple[ri.Scene, DisksInRectangle]:
    """Six disks at random speeds, for a run and for decimal arithmetic."""
    random = np.random.default_rng(seed)
    places = [(x, y) for x in (-3.0, 0.0, 3.0) for y in (-2.0, 2.0)]
    speeds = random.uniform(-1.0, 1.0, (6, 2)).tolist()
    smooth = ri.Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
    scene = ri.Scene(gravity=(0, 0, 0))
    for name, normal in {"-x": (1, 0, 0), "+x": (-1, 0, 0), "-y": (0, 1, 0), "+y": (0, -1, 0)}.items():
        scene.add(ri.Body(f"wall {name}", ri.Shape.half_space(normal, -SIDE), motion="static", material=smooth))
    for k, (place, speed) in enumerate(zip(places, speeds, strict=True)):
        scene.add(ri.Body(f"disk {k}", ri.Shape.sphere(RADIUS), position=(*place, 0.0), velocity=(*speed, 0.0), material=smooth))
    return scene, DisksInRectangle.of(places, speeds, RADIUS, (SIDE, SIDE))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_horizon_of_disks_is_where_the_run_leaves_the_exact_one(seed: int) -> None:
    scene, exact = disks(seed)
    run = ri.simulate(scene, DURATION, FPS)
    positions, _ = exact.frames(run.times)
    error = np.linalg.norm(run.positions[:, 4:] - positions, axis=2).max(axis=1)
    left = float(run.times[int(np.argmax(error > TOLERANCE))])
    assert 20.0 < left < DURATION
    assert 0.75 * left <= min(run.horizon.values()) <= 1.15 * left
    assert set(run.horizon) == {f"disk {k}" for k in range(6)}


def test_a_run_without_chaos_is_trusted_to_its_end() -> None:
    for name in ("bounce", "incline"):
        entry = gallery.load(name)
        run = ri.simulate(entry.scene(), 2.0)
        assert set(run.horizon.values()) == {2.0}
        assert run.horizon is run.horizon  # made once


def test_bodies_that_part_do_not_take_others_with_them() -> None:
    scene, _ = disks(1)
    scene.add(ri.Body("far", ri.Shape.sphere(RADIUS), position=(0, 0, 50.0), velocity=(0.1, 0, 0)))
    run = ri.simulate(scene, DURATION, FPS)
    assert run.horizon["far"] == DURATION
    assert run.horizon["disk 0"] < DURATION


def test_the_wished_tolerance_is_the_horizons() -> None:
    scene, _ = disks(1)
    loose, tight = (ri.simulate(scene, DURATION, FPS, accuracy=ri.Within(position=target, until=10.0)) for target in (0.1, 1e-9))
    assert min(tight.horizon.values()) < min(loose.horizon.values())


def test_a_loaded_recording_has_no_horizon(tmp_path) -> None:
    run = ri.simulate(gallery.load("two_spheres").scene(), 0.5)
    loaded = ri.load_recording(run.export(tmp_path / "run.npz"))
    with pytest.raises(ri.SceneError, match="cannot be run again"):
        _ = loaded.horizon
