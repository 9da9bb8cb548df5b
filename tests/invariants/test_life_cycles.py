"""Issue 27: random life cycles of joints keep what mechanics promises (`life_cycles`)."""

from __future__ import annotations

import pytest
from life_cycles import broken_promises, make_life_cycle
from scene_plans import Dice

import rigidimpulse as ri

SEEDS = (0, 1, 2, 3, 5, 6, 7, 9, 11, 14, 16, 24)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_life_cycle_keeps_its_promises(seed: int) -> None:
    """No error, no number that is not finite, no energy out of nothing, no body through the floor."""
    assert broken_promises(ri.simulate(make_life_cycle(Dice(seed)), 0.75)) == []
