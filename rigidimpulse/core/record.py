"""Records that kernels get by address: many arrays in one argument.

A kernel that gets a tuple of arrays gets every number of every array as an argument of its own, and hands them on one by one to the
kernels it calls. For a tuple of 100 arrays, that takes most of its compile time. A `Record` holds the same tuple in words of memory, laid
out as the compiler does; kernels get the address of these words, and read a field where they use it:

    record = Record(loop)             # a tuple of tuples of arrays, integers and floats
    kernel(record)                    # the kernel writes loop.motion.trajectory.start[i], as for the tuple itself

A field that is a tuple is a record in its turn. The type of a record names the layout of the tuple, so kernels are compiled for each layout
once, and for a tuple and a record apart.
"""

from __future__ import annotations

import hashlib
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.extending import NativeValue, infer_getattr, lower_getattr_generic, models, register_model, typeof_impl, unbox

from rigidimpulse.core.numba_private import AttributeTemplate, create_struct_proxy


class Record:
    """A tuple of tuples of arrays, integers and floats in words of memory; kernels get its address."""

    def __init__(self, record: NamedTuple) -> None:
        """Lay out a tuple; its arrays are kept alive.

        Raises:
            TypeError: the tuple holds something else.

        """
        self._kind = _kind_of(record)
        self._parts = list(record)
        laid_out = [_words(part) for part in record]
        self._first = list(accumulate(map(len, laid_out), initial=0))
        self._words = np.array([word for part in laid_out for word in part], np.int64)
        self.address = self._words.ctypes.data

    def replace(self, place: int, part: Any) -> None:
        """Put another part of the same type in a place of the tuple, if it is another."""
        if part is not self._parts[place]:
            self._parts[place] = part
            self._words[self._first[place] : self._first[place + 1]] = _words(part)

    @property
    def layout_name(self) -> str:
        """A name of the layout: the same in every process."""
        return str(self._kind)

    @property
    def _numba_type_(self) -> Any:
        return self._kind


_KINDS: dict[tuple, RecordType] = {}
"""Types of records by what decides on them: numba takes ten times as long to find the type of a tuple of hundreds of arrays."""


def _kind_of(record: Any) -> RecordType:
    """The type of the record of a tuple."""
    key = _layout_key(record)
    if key not in _KINDS:
        _KINDS[key] = RecordType(typeof(record))
    return _KINDS[key]


def _layout_key(value: Any) -> tuple:
    """Equal for values that numba has one type for: classes, and of arrays also what they hold, dimensions and order."""
    if isinstance(value, tuple):
        return (type(value), *map(_layout_key, value))
    if isinstance(value, np.ndarray):
        return (type(value), value.dtype, value.ndim, value.flags.num)
    return (type(value),)


def _words(value: Any) -> list[int]:
    """The words of a value, as the compiler lays them out."""
    words: list[int] = []
    _add_words(value, words)
    return words


def _add_words(value: Any, words: list[int]) -> None:
    """Add those of a value to others."""
    if isinstance(value, np.ndarray):
        # Nobody counts who holds the array, so it has neither a counter nor a parent.
        words += (0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides)
    elif isinstance(value, tuple):
        for part in value:
            _add_words(part, words)
    elif isinstance(value, (float, np.floating)):
        words.append(int(np.float64(value).view(np.int64)))
    elif isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        words.append(int(value))
    elif value is None:
        words.append(0)
    else:
        raise TypeError(f"a record holds arrays, integers and floats, not {type(value).__name__}")


class RecordType(types.Type):
    """The type of records with the layout of a tuple."""

    def __init__(self, layout: Any) -> None:
        """layout: numba's type of the tuple."""
        self.layout = layout
        super().__init__(name=f"Record_{layout.instance_class.__name__}_{hashlib.sha256(str(layout).encode()).hexdigest()[:16]}")


@typeof_impl.register(Record)
def _type_of_record(record: Record, _context: Any) -> types.Type:
    return record._kind


@register_model(RecordType)
class _RecordModel(models.OpaqueModel):
    """An address."""


@unbox(RecordType)
def _unbox_record(_kind: Any, record: Any, native: Any) -> NativeValue:
    """The address of a record."""
    address = native.pyapi.object_getattr_string(record, "address")
    word = native.pyapi.long_as_longlong(address)
    native.pyapi.decref(address)
    return NativeValue(native.builder.inttoptr(word, ir.IntType(8).as_pointer()))


def _is_tuple(kind: Any) -> bool:
    return isinstance(kind, types.BaseNamedTuple)


@infer_getattr
class _RecordFields(AttributeTemplate):
    """Types of the fields of records."""

    key = RecordType

    def generic_resolve(self, record: Any, name: str) -> Any:
        """The type of a field."""
        if name not in record.layout.fields:
            return None
        kind = record.layout.types[record.layout.fields.index(name)]
        return RecordType(kind) if _is_tuple(kind) else kind


@lower_getattr_generic(RecordType)
def _read_field(target: Any, builder: Any, record: Any, address: Any, name: str) -> Any:
    """The value of a field; of a tuple, its address."""
    place, word = record.layout.fields.index(name), ir.IntType(32)
    kind = record.layout.types[place]
    pointer = builder.bitcast(address, target.get_data_type(record.layout).as_pointer())
    member = builder.gep(pointer, [ir.Constant(word, 0), ir.Constant(word, place)])
    if _is_tuple(kind):
        return builder.bitcast(member, ir.IntType(8).as_pointer())
    value = target.unpack_value(builder, kind, member)
    return _nobody_counts(target, builder, kind, value) if isinstance(kind, types.Array) else value


def _nobody_counts(target: Any, builder: Any, kind: types.Array, value: Any) -> Any:
    """The same array, of which the compiler knows that nobody counts who holds it: it leaves out what would."""
    array = create_struct_proxy(kind)(target, builder, value)
    array.meminfo, array.parent = (ir.Constant(field.type, None) for field in (array.meminfo, array.parent))
    return array._getvalue()
