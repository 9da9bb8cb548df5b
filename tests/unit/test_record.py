"""Records that kernels get by address: what a kernel reads is what the tuple holds."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.numba_private import KernelCompiler, options_of
from rigidimpulse.core.record import Record


class Inner(NamedTuple):
    matrix: np.ndarray
    optional: np.ndarray | None
    number: float
    flags: np.ndarray


class Outer(NamedTuple):
    count: int
    inner: Inner
    rows: np.ndarray


ROW = np.dtype([("a", np.float64), ("b", np.float64, (3,)), ("c", np.bool_)])


@jit
def first_of(optional):
    """Numba removes the branch of an argument that is None before it asks for types."""
    if optional is not None:
        return optional[0]
    return 0.0


@jit_making_arrays
def read_and_write(record, out):
    """Numbers of all fields into out, and a change of each array."""
    inner, rows = record.inner, record.rows
    out[0], out[1] = record.count, inner.number
    out[2], out[3] = inner.matrix[1, 2], rows[1].b[2]
    out[4] = 1.0 if inner.flags[1] else 0.0
    out[5] = first_of(inner.optional)
    inner.matrix[0, 0], rows[0].a = -1.0, -2.0
    return inner.matrix.shape[0] * 10 + inner.matrix.shape[1]


@jit
def through(record, out):
    return read_and_write(record, out)


def make(optional: np.ndarray | None, matrix: np.ndarray) -> Outer:
    """A record."""
    rows = np.zeros(2, ROW).view(np.recarray)
    rows["b"][1, 2] = 7.0
    return Outer(3, Inner(matrix, optional, 0.25, np.array([False, True])), rows)


@pytest.mark.parametrize("optional", [None, np.array([9.0])])
@pytest.mark.parametrize("is_view", [False, True])
def test_kernels_read_and_write_what_the_tuple_holds(optional: np.ndarray | None, is_view: bool):
    """Integers, floats, arrays of numbers and records, views with strides, and a field that may be None."""
    matrix = np.arange(24.0).reshape(4, 6)[::2, ::2] if is_view else np.arange(6.0).reshape(2, 3)
    record, out = make(optional, matrix), np.zeros(6)
    expected = matrix[1, 2]
    assert through(Record(record), out) == 23
    assert through(record, np.zeros(6)) == 23
    np.testing.assert_array_equal(out, [3, 0.25, expected, 7.0, 1.0, 0.0 if optional is None else 9.0])
    assert matrix[0, 0] == -1.0
    assert record.rows["a"][0] == -2.0


def test_a_part_can_be_replaced():
    """Buffers grow: the words then hold the new ones."""
    record, out = make(None, np.zeros((2, 3))), np.zeros(6)
    packed = Record(record)
    larger = np.zeros(5, ROW).view(np.recarray)
    larger["b"][1, 2] = 5.0
    packed.replace(2, larger)
    through(packed, out)
    assert out[3] == 5.0


def test_other_things_are_refused():
    """A bool has a size of its own, so the layout would not be what Python writes."""
    with pytest.raises(TypeError, match="not bool"):
        Record(Outer(True, make(None, np.zeros((2, 3))).inner, np.zeros(1, ROW)))


@jit_making_arrays
def first_of_a_long_row(record):
    """Keeps a part of an array of a record from turn to turn, beside an array that is made here."""
    sums, kept = np.zeros(record.inner.matrix.shape[0]), record.inner.matrix[0]
    for i in range(sums.shape[0]):
        row = record.inner.matrix[i]
        for k in range(row.shape[0]):
            sums[i] += row[k]
        if sums[i] > sums[0]:
            kept = row
    return kept[0] + sums[0]


def test_nobody_counts_who_holds_the_arrays_of_a_record() -> None:
    # Counting them is an atomic operation wherever a field is read: a quarter of the time of the loop of events.
    record = Record(make(None, np.arange(6.0).reshape(2, 3)))
    # What comes from the cache cannot be read.
    kernel: Any = numba.njit(**options_of(KernelCompiler, True))(first_of_a_long_row.py_func)
    assert kernel(record) == 6.0
    (compiled,) = kernel.overloads.values()
    code = compiled.library.get_llvm_str()
    assert "@NRT_incref(" not in code
    # One call lets go of the array that was made; the other place is the function. It was 6 where fields of records were counted.
    assert code.count("@NRT_decref(") == 2


def test_parts_are_known_to_be_called_by_nobody_else() -> None:
    kernel: Any = numba.njit(**options_of(KernelCompiler, True))(first_of_a_long_row.py_func)
    kernel(Record(make(None, np.arange(6.0).reshape(2, 3))))
    (compiled,) = kernel.overloads.values()
    made = [function for function in compiled.library._final_module.functions if not function.is_declaration]
    assert {function.linkage.name for function in made} == {"external", "internal"}
