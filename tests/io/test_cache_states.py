"""States are written as plain data and read again: the same values, the same types, and what was one object is one again."""

from __future__ import annotations

import collections
import math
import struct
from functools import partial
from typing import Any

import numpy as np
import pytest
from forged_states import again
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import rigidimpulse as ri
from rigidimpulse.io.cache.arrays import LINE, address, described, typed
from rigidimpulse.io.cache.constants import Constants
from rigidimpulse.io.cache.decode import thaw
from rigidimpulse.io.cache.encode import freeze
from rigidimpulse.io.cache.registry import named_function
from rigidimpulse.motion.force_step import Moment

ATOMS = st.none() | st.booleans() | st.integers() | st.floats() | st.complex_numbers() | st.text() | st.binary()
TYPES = arrays.scalar_dtypes().filter(lambda dtype: dtype.kind in "biufc" and dtype.itemsize <= 8)
VALUES = st.recursive(
    ATOMS | arrays.arrays(TYPES, arrays.array_shapes(min_dims=0, max_dims=3, max_side=4)) | TYPES.map(lambda dtype: dtype.type(1)),
    lambda inner: (
        st.lists(inner)
        | st.lists(inner).map(tuple)
        | st.lists(inner).map(collections.deque)
        | st.dictionaries(ATOMS.filter(lambda key: key == key), inner)
        | st.frozensets(st.integers())
        | st.sets(st.text())
    ),
    max_leaves=20,
)


def same(a: Any, b: Any) -> bool:
    """Whether two values are of the same types and bits."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray | np.generic):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, float):
        return struct.pack("<d", a) == struct.pack("<d", b)
    if isinstance(a, complex):
        return same(a.real, b.real) and same(a.imag, b.imag)
    if isinstance(a, dict):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a.items(), b.items(), strict=True))
    if isinstance(a, list | tuple | collections.deque):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return a == b


@settings(max_examples=200, deadline=None)
@given(VALUES)
def test_any_plain_value_comes_back(value: Any) -> None:
    written = freeze(value, Constants([]))
    read = thaw(written, Constants([]))
    assert same(read, value)
    if not isinstance(value, set | frozenset):
        assert same(thaw(freeze(read, Constants([])), Constants([])), value)


NUMBERS = [2**64, -(2**63) - 1, 10**4000, math.inf, -math.nan, -0.0, 5e-324]


@pytest.mark.parametrize("value", [*NUMBERS, "\ud800", np.str_("a"), np.bytes_(b"a")])
def test_atoms_of_all_sizes_come_back(value: Any) -> None:
    assert same(again(value), value)


def test_containers_of_all_kinds_come_back() -> None:
    ordered, queue = collections.OrderedDict(b=1, a=2), collections.deque([1], 3)
    held = [slice(1, None, 2), range(5, 1, -2), bytearray(b"a"), ordered, np.dtype("<f4"), queue]
    read = again(held)
    assert read == held and list(map(type, read)) == list(map(type, held)) and read[-1].maxlen == 3
    counts = again(collections.defaultdict(list, {"a": [1]}))
    assert counts["a"] == [1] and counts["b"] == []
    strength = named_function("strength of constant forces")
    read = again(partial(strength, np.ones(3), time=2.0))
    assert read.func is strength and read.args[0].tolist() == [1.0, 1.0, 1.0] and read.keywords == {"time": 2.0}


def test_what_was_one_object_is_one_again() -> None:
    inner: list[Any] = [1.0]
    outer: dict[str, Any] = {"a": inner, "b": (inner, inner)}
    inner.append(outer)
    read = again(outer)
    assert read["a"] is read["b"][0] is read["b"][1] and read["a"][1] is read
    deep: list[Any] = []
    for _ in range(100_000):
        deep = [deep]
    depth, read = 0, again(deep)
    while read:
        depth, read = depth + 1, read[0]
    assert depth == 100_000


def test_arrays_that_share_memory_share_it_again() -> None:
    whole = np.arange(24.0).reshape(4, 6)
    column, turned, backwards, words = whole[:, 2], whole.T, whole[::-1, ::2], whole.view(np.int64)
    read_only = whole[1:]
    read_only.flags.writeable = False
    views = again([column, whole, turned, backwards, words, read_only])
    views[1][2, 2] = -5.0
    assert views[0][2] == views[2][2, 2] == views[3][1, 1] == -5.0 and views[4][2, 2] == np.float64(-5.0).view(np.int64)
    assert [view.strides for view in views] == [array.strides for array in (column, whole, turned, backwards, words, read_only)]
    assert not views[-1].flags.writeable


@pytest.mark.parametrize("residue", [0, 8, 24, 56])
def test_arrays_lie_as_they_did_to_the_lines_of_the_cache(residue: int) -> None:
    memory = np.zeros(1000, np.uint8)
    begin = (residue - address(memory)) % LINE
    memory.flags.writeable = False
    array = np.frombuffer(bytearray(1000), np.float64, 4)
    for written in (array, np.asfortranarray(np.arange(12.0).reshape(3, 4)), memory[begin : begin + 64].view(np.float64)):
        read = again(written)
        assert address(read) % LINE == address(written) % LINE
        assert read.flags.f_contiguous == written.flags.f_contiguous and read.flags.writeable == written.flags.writeable


def test_records_and_named_tuples_come_back() -> None:
    record = np.dtype([("a", np.float64, (3,)), ("b", "?"), ("c", [("d", np.int8), ("e", "S3")])], align=True)
    assert typed(described(record)) == record and typed(described(record)).isalignedstruct
    rows = np.zeros(2, record).view(np.recarray)
    rows.a[1] = 4.0
    read = again(rows)
    assert type(read) is np.recarray and read.a[1].tolist() == [4.0, 4.0, 4.0] and same(again(rows[0].b), rows[0].b)
    moment = Moment(*(np.full(2, k) for k in range(len(Moment._fields))))
    assert type(again(moment)) is Moment and all(map(np.array_equal, again(moment), moment))


class Own:
    """A class of a user."""


@pytest.mark.parametrize(
    ("thing", "told"),
    [(Own(), "Own"), (len, "builtin"), (Own, "type"), ([].append, "builtin"), (Own().__init__, "method"), (lambda: 0, "function"),
     (np.array([None]), "object"), (collections.defaultdict(Own), "defaultdict"), (partial(print), "builtin"), (1 .__class__, "type")],
)  # fmt: skip
def test_what_is_no_plain_data_is_refused_when_it_is_written(thing: Any, told: str) -> None:
    with pytest.raises(ri.SceneError, match=f"(?s){told}.*simulate it without a cache"):
        freeze([thing], Constants([]))


def test_constants_are_numbers() -> None:
    held, other = Own(), [Own()]
    read = thaw(freeze([held, held, other], Constants([held, other])), Constants([held, other]))
    assert read[0] is read[1] is held and read[2] is other
    with pytest.raises(ri.SceneError, match="another scene"):
        thaw(freeze([held], Constants([held])), Constants([held, other]))
