"""Arrays in a checkpoint: types of their elements as plain lists, arrays with memory of their own, and views of others.

Arrays that share memory share it again when they are read: a view is written as its base, and where and how it lies in it.
"""

from __future__ import annotations

import re
from math import prod
from typing import Any, NamedTuple

import numpy as np

LINE = 64
"""Bytes of a line of the processor's cache."""
DEEPEST_TYPE = 8
"""How deep records may lie in records."""
PLAIN_TYPE = re.compile(r"[<>|][biufcSUV][0-9]{1,6}")


class Damaged(ValueError):
    """The bytes of a checkpoint are not what `encode` writes."""


class Layout(NamedTuple):
    """Element type and shape of an array, and whether it may be written to."""

    dtype: np.dtype
    shape: tuple[int, ...]
    writeable: bool

    @property
    def size(self) -> int:
        """Bytes of its elements."""
        return prod(self.shape) * self.dtype.itemsize


def described(dtype: np.dtype) -> Any:
    """Return a type of elements as texts, numbers and lists.

    Raises:
        TypeError: elements of this type are no plain data.

    """
    if dtype.subdtype is not None:
        base, shape = dtype.subdtype
        return ["rows", described(base), list(shape)]
    if dtype.names is not None and dtype.fields is not None:
        by_name: Any = dtype.fields
        fields = [[name, described(by_name[name][0]), by_name[name][1]] for name in dtype.names]
        return ["record", fields, dtype.itemsize, dtype.isalignedstruct]
    if not PLAIN_TYPE.fullmatch(dtype.str):
        raise TypeError(f"an array of {dtype}")
    return dtype.str


def typed(description: Any, depth: int = 0) -> np.dtype:
    """Return the type of elements that `described` wrote.

    Raises:
        Damaged: it is none.

    """
    if isinstance(description, str) and PLAIN_TYPE.fullmatch(description):
        return np.dtype(description)
    if not isinstance(description, list) or depth > DEEPEST_TYPE:
        raise Damaged(f"the type of elements {str(description)[:60]!r}")
    if description[0] == "rows":
        _, base, shape = description
        return np.dtype((typed(base, depth + 1), whole_numbers(shape)))
    kind, fields, size, aligned = description
    if kind != "record" or type(aligned) is not bool:
        raise Damaged(f"the type of elements {str(description)[:60]!r}")
    names, formats, offsets = zip(*((name, typed(each, depth + 1), offset) for name, each, offset in fields), strict=True)
    table: Any = {"names": list(names), "formats": list(formats), "offsets": list(whole_numbers(offsets)), "itemsize": whole_number(size)}
    return np.dtype(table, align=aligned)


def whole_number(value: Any, least: int = 0) -> int:
    """Return a number of a file that has to be a whole one.

    Raises:
        Damaged: it is none, or a smaller one than allowed.

    """
    if type(value) is not int or value < least:
        raise Damaged(f"the number {str(value)[:60]}")
    return value


def whole_numbers(values: Any) -> tuple[int, ...]:
    """Return a list of whole numbers of a file; see `whole_number` for what it raises."""
    return tuple(map(whole_number, values))


def address(array: np.ndarray) -> int:
    """Where the elements of an array begin in memory."""
    return array.__array_interface__["data"][0]


def own_array(layout: Layout, order: Any, residue: int, data: memoryview) -> np.ndarray:
    """Return an array with these bytes that lies as the one that was written does to the lines of the processor's cache.

    Kernels count on where an array lies.

    Raises:
        Damaged: order or place are none.

    """
    if order not in ("C", "F") or not 0 <= residue < LINE:
        raise Damaged(f"an array in order {str(order)[:20]} at {residue}")
    memory = bytearray(len(data) + LINE)  # no array: else this one would be a view when it is written again
    begin = (residue - address(np.frombuffer(memory, np.uint8))) % LINE
    memory[begin : begin + len(data)] = data
    array = np.ndarray(layout.shape, layout.dtype, buffer=memory, offset=begin, order=order)
    array.flags.writeable = layout.writeable
    return array


def view_of(base: Any, layout: Layout, offset: int, strides: tuple[int, ...]) -> np.ndarray:
    """Return the view of `base` that lies in it like this.

    Raises:
        Damaged: the base is no array of plain data, or the view does not lie inside it.

    """
    if type(base) is not np.ndarray or base.dtype.hasobject or not (base.flags.c_contiguous or base.flags.f_contiguous):
        raise Damaged("a view of something that is no array in one piece")
    if len(strides) != len(layout.shape):
        raise Damaged(f"a view of {len(layout.shape)} axes with {len(strides)} strides")
    low = high = offset
    if prod(layout.shape):
        steps = [(count - 1) * stride for count, stride in zip(layout.shape, strides, strict=True)]
        low += sum(min(step, 0) for step in steps)
        high += sum(max(step, 0) for step in steps) + layout.dtype.itemsize
    if low < 0 or high > base.nbytes:
        raise Damaged(f"a view of bytes {low} to {high} of an array of {base.nbytes}")
    if layout.writeable and not base.flags.writeable:
        raise Damaged("a view that writes to an array that is only read")
    array = np.ndarray(layout.shape, layout.dtype, buffer=base if base.flags.c_contiguous else base.T, offset=offset, strides=strides)
    array.flags.writeable = layout.writeable
    return array
