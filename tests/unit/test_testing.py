"""The assertions for other projects: each passes on a good run and fails, with names and numbers, on one that breaks its law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse import testing


@pytest.fixture(scope="module")
def settled() -> ri.Recording:
    """Two boxes that fall on a floor and come to rest."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    rough = ri.Material(static_friction=0.6, dynamic_friction=0.5, restitution=0.2)
    for k in range(2):
        scene.add(ri.Body(f"box {k}", ri.Shape.box(0.3), position=(0.02 * k, 0, 0.4 + 0.5 * k), angular_velocity=(1, 2, 0), material=rough))
    return ri.simulate(scene, 4.0)


def test_a_good_run_keeps_everything(settled: ri.Recording) -> None:
    testing.assert_finite(settled)
    testing.assert_energy_never_grows(settled)
    testing.assert_no_penetration(settled)
    testing.assert_comes_to_rest(settled, by=3.9)
    testing.assert_same_motion(settled, settled.state_hash())
    testing.assert_same_motion(settled, replace(settled))


def test_numbers_that_are_not_finite_are_named(settled: ri.Recording) -> None:
    broken = settled.positions.copy()
    broken[30, 2, 1] = np.nan
    with pytest.raises(AssertionError, match=r"positions of 'box 1' are not finite from 0.5 s on"):
        testing.assert_finite(replace(settled, positions=broken))


def test_energy_that_comes_from_nothing_is_found(settled: ri.Recording) -> None:
    assert settled.ledger is not None
    kinetic = settled.ledger.kinetic.copy()
    kinetic[-1] += 1e-3 * kinetic.max()
    with pytest.raises(AssertionError, match=r"energy grew by .* until 4 s"):
        testing.assert_energy_never_grows(replace(settled, ledger=replace(settled.ledger, kinetic=kinetic)))


def test_overlaps_are_found(settled: ri.Recording) -> None:
    sunk = settled.centers.copy()
    sunk[-1, 1:, 2] -= 1e-4
    with pytest.raises(AssertionError, match=r"inside each other by up to 9\.\d+e-05 m, first at 4 s"):
        testing.assert_no_penetration(replace(settled, centers=sunk))
    testing.assert_no_penetration(replace(settled, centers=sunk), depth=2e-4)


def test_what_still_moves_is_named(settled: ri.Recording) -> None:
    with pytest.raises(AssertionError, match=r"'box 0' still moves at 0\.2 s"):
        testing.assert_comes_to_rest(settled, by=0.2)
    with pytest.raises(AssertionError, match="before 5 s"):
        testing.assert_comes_to_rest(settled, by=5.0)
    testing.assert_comes_to_rest(settled, by=0.0, speed=20.0)


def test_motions_that_differ_say_where(settled: ri.Recording) -> None:
    moved = settled.positions.copy()
    moved[10, 1, 0] += 1e-15
    with pytest.raises(AssertionError, match="'box 0'"):
        testing.assert_same_motion(settled, replace(settled, positions=moved))
    with pytest.raises(AssertionError, match="has the hash"):
        testing.assert_same_motion(settled, "0" * 64)


def test_loaded_recordings_are_refused_where_they_cannot_tell(settled: ri.Recording, tmp_path) -> None:
    loaded = ri.load_recording(settled.export(tmp_path / "run.npz"))
    for check in (testing.assert_energy_never_grows, testing.assert_no_penetration, testing.assert_comes_to_rest):
        with pytest.raises(ri.SceneError, match="simulate"):
            check(loaded)
    testing.assert_finite(loaded)
    testing.assert_same_motion(loaded, settled)
