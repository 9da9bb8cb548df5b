"""Crowds, which are sub-stepped however high they are, and the size from which islands run away the earlier (`engine.regime`)."""

from __future__ import annotations

import numpy as np
import pytest

from rigidimpulse.engine.pair_table import RUNAWAY, most_solves
from rigidimpulse.engine.regime import crowded


def island(shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Root of each body of a lattice, and the first body of each pair of neighbours, those across corners included."""
    places = np.array(list(np.ndindex(shape)))
    near = np.abs(places[:, None] - places[None]).max(axis=2) == 1
    return np.zeros(len(places), np.int64), np.nonzero(np.triu(near))[0]


@pytest.mark.parametrize(
    ("shape", "is_crowd"),
    [((200, 1, 1), False), ((20, 10, 1), False), ((8, 8, 8), True), ((5, 5, 5), False)],
    ids=["column", "layers of bricks", "crowd", "few"],
)
def test_what_is_a_crowd(shape: tuple[int, ...], is_crowd: bool) -> None:
    root, first = island(shape)
    assert crowded(root, first)[0] == is_crowd


def test_bodies_of_no_island_and_supports_do_not_count() -> None:
    root, first = island((8, 8, 8))
    # Body 512 is in no island, and the first one of as many pairs with supports.
    assert crowded(np.append(root, -1), np.append(first, np.full(10_000, 512)))[0]
    assert not crowded(np.append(root[:100], -1), np.full(10_000, 100)).any()


def test_large_islands_run_away_earlier() -> None:
    assert [most_solves(number) for number in (2, 64, 128, 640)] == [RUNAWAY, RUNAWAY, RUNAWAY / 2.0, RUNAWAY / 10.0]
