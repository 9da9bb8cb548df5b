"""Random scenes that change in the middle of a run keep what a changed scene must keep (`late_changes`)."""

from __future__ import annotations

from pathlib import Path

import pytest
from late_changes import CHANGES, broken_promises_later, make_late_change
from scene_plans import Dice

SEEDS = (12, 84, 46, 0, 5, 14, 23, 31)
"""Regressions: in seed 12 a body was inside the floor at the frame, and all others were put elsewhere with it (issue 30). In seed 84 the
books were off by 2e-7 where a body that flew came to touch one whose sub-step ended; in seed 46 by what happened at the time of the change
(issue 27)."""


@pytest.mark.parametrize("seed", SEEDS)
def test_random_change_keeps_what_it_must(seed: int, tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    assert broken_promises_later(make_late_change(Dice(seed)), tmp_path) == []


def test_all_changes_are_tried() -> None:
    assert {make_late_change(Dice(seed)).change for seed in range(100)} == set(CHANGES)
