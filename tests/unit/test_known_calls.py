"""Calls whose types are known: whatever a kernel was called with before, it does what its Python does."""

from __future__ import annotations

import gc
import weakref
from typing import Any, NamedTuple

import numpy as np
import pytest

from rigidimpulse.core.kernels import INTERPRETED, forget_calls, jit
from rigidimpulse.core.known_calls import AGAIN, MOST, TRIES, KnownCalls

pytestmark = pytest.mark.skipif(INTERPRETED, reason="nothing is compiled")


class _Columns(NamedTuple):
    first: np.ndarray
    second: np.ndarray
    third: np.ndarray


class _Step(NamedTuple):
    length: float
    number: int


@jit
def _total(columns, weights, scale):
    total = 0.0
    for i in range(columns.first.shape[0]):
        total += scale * weights[i] * (columns.first[i] + 10.0 * columns.second[i] + 100.0 * columns.third[i])
    return total


@jit
def _length_of(step):
    return step.length * step.number


@jit
def _scaled(values, factor=3.0):
    return factor * values[0]


def _columns(kind: Any, step: int = 1) -> _Columns:
    values = np.arange(1, 13).astype(kind)[::step]
    return _Columns(values, values + kind(1), values[::-1].copy() if step == 1 else values[::-1])


def test_a_call_is_that_of_its_own_types() -> None:
    records = [_columns(np.float64), _columns(np.int64), _columns(np.float32), _columns(np.float64, 2)]
    weights = [np.linspace(0.0, 1.0, 12), np.arange(12), np.linspace(0.0, 1.0, 24)[::2], np.linspace(0.0, 1.0, 12).astype(np.float32)]
    locked = np.linspace(0.0, 1.0, 12)
    locked.setflags(write=False)
    for _ in range(3):
        for columns in records:
            for weight in (*weights, locked):
                for scale in (2.0, 2, np.float64(0.5), True):
                    assert _total(columns, weight, scale) == pytest.approx(_total.py_func(columns, weight, scale), rel=1e-6)


def test_what_is_left_out_has_its_default() -> None:
    for _ in range(3):
        assert _scaled(np.ones(1)) == 3.0
        assert _scaled(np.ones(1), 2.0) == 2.0


def test_a_tuple_that_took_the_place_of_another_is_not_taken_for_it() -> None:
    for k in range(400):  # tuples are made at the places of those that are gone
        columns = _columns(np.float64 if k % 2 else np.int64)
        assert _total(columns, columns.first, 1.0) == _total.py_func(columns, columns.first, 1.0)


def test_small_tuples_are_told_by_what_they_hold() -> None:
    known = KnownCalls()
    keys = {known.find((_Step(length, number),))[0] for length, number in ((1.0, 2), (3.0, 4), (5.0, 6))}
    assert len(keys) == 1
    assert known.find((_Step(1, 2),))[0] not in keys
    assert [_length_of(_Step(length, 2)) for length in (1.0, 2.0, 3, 4.0)] == [2.0, 4.0, 6, 8.0]


def test_the_same_tuple_is_found_again() -> None:
    known, columns = KnownCalls(), _columns(np.float64)
    key, call = known.find((columns, 1.0))
    assert call is None
    known.keep(key, (columns, 1.0), len)
    assert known.find((columns, 7.0))[1] is len
    assert known.find((columns, 7))[1] is None
    assert known.find((_columns(np.float64), 7.0))[1] is None


def test_a_kernel_that_gets_other_tuples_each_time_is_not_asked_for_long() -> None:
    known, kept = KnownCalls(), []
    for k in range(TRIES + 2):
        kept.append(_columns(np.float64))
        key, _ = known.find((kept[-1],))
        assert bool(key) == (k <= TRIES)
        known.keep(key, (kept[-1],), len)
    assert len(known._calls) <= MOST
    # After many calls it is tried again, and goes on with tuples that it gets more than once.
    same, tried = (kept[0],), []
    for _ in range(2 * AGAIN):
        key, call = known.find(same)
        tried.append(bool(key))
        if key and call is None:
            known.keep(key, same, len)
    first = tried.index(True)
    assert first == AGAIN - 2 and all(tried[first:])


def test_nothing_is_held_when_a_run_has_ended() -> None:
    columns = _columns(np.float64)
    for _ in range(3):
        _total(columns, columns.first, 1.0)
    held = weakref.ref(columns.first)
    del columns
    forget_calls()
    gc.collect()
    assert held() is None
