"""Every gallery scene runs without a screen and passes its own check; runs are equal to the last bit."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.gallery.event_driven import DisksInRectangle

REPEATED = (
    "spot", "disks_in_a_box", "pool_break", "superball", "cradle_two", "rifle", "galperin_2",
    "rear_end_crash", "pool_swerve", "backing_up_linear",
)  # fmt: skip
"""Scenes run a second time and at other frame rates."""


@cache
def run_of(name, fps=None):
    """Return the run of a gallery scene."""
    entry = gallery.load(name)
    return ri.simulate(entry.scene(), entry.duration, fps or entry.fps, accuracy=entry.accuracy)


@pytest.mark.parametrize("name", gallery.names())
def test_scene_passes_its_check(name):
    run = run_of(name)
    print(f"{name}: {run.state_hash()}")
    checks = gallery.load(name).check(run)
    failed = [
        f"{check.what}: {check.value:.3e}, bound {check.bound:.3e} ({check.law})"
        for check in checks
        if not check.passed
    ]
    assert checks and not failed, "\n".join(failed)


@pytest.mark.parametrize("name", gallery.names())
def test_scene_runs_without_events(name):
    # An event is something a user should know of; the gallery has no scene that should need one.
    run = run_of(name)
    assert run.status.ok, run.status.message


def test_a_pile_at_rest_stands_still_to_the_bit():
    run = run_of("pile")
    np.testing.assert_array_equal(run.positions[-1], run.positions[-5])


@pytest.mark.parametrize("name", REPEATED)
def test_the_same_scene_gives_the_same_bits(name):
    entry = gallery.load(name)
    again = ri.simulate(entry.scene(), entry.duration, entry.fps, accuracy=entry.accuracy)
    assert again.state_hash() == run_of(name).state_hash()


@pytest.mark.parametrize("name", REPEATED)
def test_the_frame_rate_changes_nothing_that_happens(name):
    slow, fast = run_of(name, 24.0), run_of(name, 240.0)
    assert len(slow.impacts) and slow.impacts.tobytes() == fast.impacts.tobytes()
    # Frames at the same time are the same, too: every tenth of the fast run.
    for field in ("times", "positions", "orientations", "velocities", "angular_velocities"):
        assert np.array_equal(getattr(slow, field), getattr(fast, field)[::10]), field


def test_every_scene_is_made_again_each_time():
    for name in gallery.names():
        entry = gallery.load(name)
        assert entry.name == name and "\n" not in entry.description
        assert entry.scene() is not entry.scene()


def test_unknown_scenes_list_the_known_ones():
    with pytest.raises(ri.SceneError, match="did you mean 'superball'"):
        gallery.load("superbal")


def test_missing_assets_are_named():
    assert gallery.asset_path("spot.obj").is_file()
    with pytest.raises(ri.SceneError, match=r"cow\.obj"):
        gallery.asset_path("cow.obj")


def test_a_check_can_fail():
    # The checks have teeth: against the motion of another frame, or with one impact less, they do not hold.
    from dataclasses import replace

    run = run_of("disks_in_a_box")
    check = gallery.load("disks_in_a_box").check
    moved = replace(run, positions=run.positions + 1e-7)
    fewer = replace(run, impacts=run.impacts[:-1])
    assert [c.what for c in check(moved) if not c.passed] == ["error of final positions, m"]
    assert not all(c.passed for c in check(fewer))


def test_reference_disks_keep_energy_and_reverse_exactly():
    # With e = 1 mechanics is reversible: running back brings every disk home. Each impact of disks costs about two of
    # the 50 digits; a wrong root or a wrong impulse shows at once.
    positions, velocities = [(1, 1), (-1, -1.1), (-3, 3)], [(0, 0), (1, 1), (-0.25, 0.25)]
    disks = DisksInRectangle.of(positions, velocities, 1.0, (5, 5))
    forth = disks.advance(20.0)
    energy = sum(float(u * u + v * v) for u, v in disks.velocities)
    disks.velocities = [(-u, -v) for u, v in disks.velocities]
    back = disks.advance(40.0)
    home = [[float(x) for x in position] for position in disks.positions]
    assert [(e.a, e.b) for e in back] == [(e.a, e.b) for e in forth[::-1]]
    assert abs(energy - 2.125) < 1e-15
    assert np.abs(np.array(home) - positions).max() < 1e-12
