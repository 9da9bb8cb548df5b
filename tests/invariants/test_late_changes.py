"""Random scenes that change in the middle of a run keep what a changed scene must keep (`late_changes`)."""

from __future__ import annotations

from pathlib import Path

import pytest
from late_changes import CHANGES, broken_promises_later, make_late_change
from scene_plans import Dice

SEEDS = (12, 0, 5, 14, 23, 31)
"""Seed 12 is a regression (issue 30): a body was inside the floor at the frame; all others were put elsewhere with it."""


@pytest.mark.parametrize("seed", SEEDS)
def test_random_change_keeps_what_it_must(seed: int, tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    assert broken_promises_later(make_late_change(Dice(seed)), tmp_path) == []


def test_all_changes_are_tried() -> None:
    assert {make_late_change(Dice(seed)).change for seed in range(100)} == set(CHANGES)
