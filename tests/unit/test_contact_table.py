"""Pairs and contact points keep what is known of them when they are packed, when the table grows, and when pairs come and go."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigidimpulse.collision.contact_records import UNKNOWN
from rigidimpulse.collision.contact_table import FIRST_POINTS, POINTS_OF_A_BODY, ContactTable
from rigidimpulse.core.memory import reserve

BODIES = 40
fixed = settings(deadline=None, derandomize=True)  # no deadline: the first call compiles


def contacts_of(table: ContactTable) -> list[tuple]:
    """What is known of each pair, its points included."""
    pairs, out = table.pairs, []
    for p in range(len(pairs.first)):
        mine = slice(pairs.start[p], pairs.start[p] + pairs.count[p])
        known = [(name, np.array(column[p]).tolist()) for name, column in pairs._asdict().items() if name not in ("start", "capacity")]
        out.append((known, table.points[mine].tolist(), table.ids[mine].tolist()))
    return out


def filled(seed: int, shares: int, packed_full: bool) -> ContactTable:
    """A table of random pairs, each with points of its own at places that do not depend on its order."""
    random, table = np.random.default_rng(seed), ContactTable(shares, BODIES)
    first, second = np.triu_indices(BODIES, 1)
    some = np.sort(random.choice(len(first), int(random.integers(1, 200)), replace=False))
    table.replace(first[some].astype(np.int32), second[some].astype(np.int32))
    pairs = table.pairs
    pairs.seen[:], pairs.apart[:], pairs.kind[:] = random.normal(size=pairs.seen.shape), random.random(len(some)), 2
    pairs.count[:] = random.integers(0, 5, len(some))
    place = 1
    for p in random.permutation(len(some)):
        place += 0 if packed_full else int(random.integers(0, 2))
        pairs.start[p] = place
        table.points[place : place + pairs.count[p]] = random.normal(size=(pairs.count[p], table.points.shape[1]))
        table.ids[place : place + pairs.count[p]] = random.integers(0, 99, (pairs.count[p], 3))
        place += pairs.count[p]
    table.free[:] = table.taken
    return table


@fixed
@given(st.integers(0, 10_000), st.integers(1, 3))
def test_packing_in_place_keeps_every_point(seed: int, shares: int) -> None:
    table = filled(seed, shares, packed_full=False)
    before, used = contacts_of(table), 1 + int(table.pairs.count.sum())
    table.pack()
    assert contacts_of(table) == before
    # One after the other, in order; what is behind them is free.
    assert np.array_equal(table.pairs.start, np.concatenate([[1], 1 + np.cumsum(table.pairs.count)[:-1]]))
    assert (table.free[0, 0], table.free[-1, 1]) == (used, table.taken)
    assert not table.points[0].any()


def test_points_keep_their_places_where_the_table_grows_beyond_what_was_reserved() -> None:
    table = filled(3, 2, packed_full=True)
    before, reserved = contacts_of(table), len(table.points)
    assert reserved == max(FIRST_POINTS, POINTS_OF_A_BODY * BODIES)
    table.grow(reserved)
    assert contacts_of(table) == before
    assert len(table.points) > reserved
    assert (table.free[:, 1] - table.free[:, 0]).min() >= reserved
    assert np.shares_memory(table.lines, table.points)


@fixed
@given(st.integers(0, 10_000))
def test_pairs_that_stay_keep_what_is_known_of_them(seed: int) -> None:
    random, table = np.random.default_rng(seed), filled(seed, 1, packed_full=True)
    old = {(known[0], known[1]): (known, *rest) for known, *rest in contacts_of(table)}
    first, second = np.triu_indices(BODIES, 1)
    some = np.sort(random.choice(len(first), int(random.integers(1, 400)), replace=False))
    table.replace(first[some].astype(np.int32), second[some].astype(np.int32))
    for known, *rest in contacts_of(table):
        if (known[0], known[1]) in old:
            assert (known, *rest) == old[known[0], known[1]]
        else:
            assert {("kind", UNKNOWN), ("count", 0), ("known", False)} <= set(known[2:-1])


@pytest.mark.parametrize("shape", [(0,), (5,), (3, 4)])
def test_what_is_reserved_is_an_array_of_zeros_like_any_other(shape: tuple[int, ...]) -> None:
    array = reserve(shape, np.float64)
    assert array.shape == shape
    assert not array.any()
    assert array.ctypes.data % 64 == 0 or array.size == 0
    array[...] = 2.0
    assert np.array_equal(pickle.loads(pickle.dumps(array)), np.full(shape, 2.0))
