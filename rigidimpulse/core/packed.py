"""Records that kernels get by address: many arrays in one argument.

A kernel that gets a tuple of arrays gets every number of every array as an argument of its own, and hands them on one by one to the
kernels it calls. For a tuple of 100 arrays, that takes most of its compile time. So a tuple that holds everything is packed into words of
memory, laid out as the compiler does, and kernels get these words as one array:

    packed = Packed(loop)                    # in Python: a tuple of tuples of arrays, integers and floats
    kernel(packed.words)

    motion_of = field("motion")              # in the module of the kernel
    motion = motion_of(words)                # in the kernel: the tuple loop.motion

The type of the words names the layout of the tuple, so that kernels are compiled for each layout once.
"""

from __future__ import annotations

import hashlib
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import typeof
from numba.extending import intrinsic

_LAYOUTS: dict[str, Any] = {}
"""Types of the tuples that have been packed in this process, by the name of their words."""


class Packed:
    """A tuple of tuples of arrays, integers and floats as words of memory.

    Attributes:
        words: (k,) what kernels get.

    """

    def __init__(self, record: NamedTuple) -> None:
        """Pack a record; its arrays are kept alive.

        Raises:
            TypeError: the record holds something else.

        """
        kind = typeof(record)
        name = f"{type(record).__name__}_{hashlib.sha256(str(kind).encode()).hexdigest()[:16]}"
        _LAYOUTS[name] = kind
        self._parts = list(record)
        packed = [_words(part) for part in record]
        self._first = np.cumsum([0, *map(len, packed)])
        self.words = np.array([word for part in packed for word in part], np.int64).view(np.dtype([(name, np.int64)]))

    def replace(self, place: int, part: Any) -> None:
        """Put another part of the same type in the place of one of the record, if it is another."""
        if part is not self._parts[place]:
            self._parts[place] = part
            self.words.view(np.int64)[self._first[place] : self._first[place + 1]] = _words(part)


def _words(value: Any) -> list[int]:
    """The words of a value, as the compiler lays them out."""
    if value is None:
        return [0]
    if isinstance(value, tuple):
        return [word for part in value for word in _words(part)]
    if isinstance(value, np.ndarray):
        # Nobody counts who holds the array, so it has neither a counter nor a parent.
        return [0, 0, value.size, value.itemsize, value.__array_interface__["data"][0], *value.shape, *value.strides]
    if isinstance(value, (float, np.floating)):
        return [int(np.float64(value).view(np.int64))]
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return [int(value)]
    raise TypeError(f"a packed record holds arrays, integers and floats, not {type(value).__name__}")


def field(name: str) -> Any:
    """A function for kernels that takes the words of a record, and returns the field of this name."""

    @intrinsic
    def get(_typing: Any, words: Any) -> Any:
        record = _LAYOUTS[next(iter(words.dtype.fields))]
        place = record.fields.index(name)
        kind = record.types[place]

        def read(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array = target.make_array(signature.args[0])(target, builder, arguments[0])
            pointer = builder.bitcast(array.data, target.get_data_type(record).as_pointer())
            zero, member = ir.Constant(ir.IntType(32), 0), ir.Constant(ir.IntType(32), place)
            return target.unpack_value(builder, kind, builder.gep(pointer, [zero, member]))

        return kind(words), read

    return get
