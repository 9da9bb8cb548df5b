"""The state of a run from bytes that may come from anywhere: see `encode` for what they are.

Reading makes nothing but plain data and objects of the classes in `registry`, and calls nothing that the bytes name. What is not just as
`encode` writes it is refused: every place in the table is checked to be there, every length to be that of what is there before memory is
taken for it, every field to be one of its class.
"""

from __future__ import annotations

import collections
import json
import struct
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.cache.arrays import Damaged, Layout, own_array, typed, view_of, whole_number, whole_numbers
from rigidimpulse.io.cache.constants import Constants
from rigidimpulse.io.cache.encode import FACTORIES, LENGTHS, MARK
from rigidimpulse.io.cache.registry import FUNCTIONS, Schema, classes, named_function, named_method

REMEDY = "delete the cache, and run again"


class _Decoder:
    """The objects of a table as they are made."""

    def __init__(self, constants: Constants, nodes: list[Any], arrays: memoryview) -> None:
        self.made: list[Any] = []
        self._constants = constants
        self._nodes = nodes
        self._arrays = arrays
        self._read = 0

    def child(self, child: Any) -> Any:
        """What a node holds: an atom, or an object that is made already."""
        if type(child) is not list:
            if type(child) is dict:
                raise Damaged("an object in the place of a value")
            return child
        (place,) = child
        if type(place) is not int or not 0 <= place < len(self.made):
            raise Damaged(f"node {str(place)[:60]} of {len(self.made)}")
        return self.made[place]

    def children(self, children: list[Any]) -> list[Any]:
        """The same of several."""
        return list(map(self.child, children))

    def make(self) -> None:
        """Make all objects, in the order of the nodes, then fill those that can be changed.

        Sets and dictionaries come last: they ask their members whether they are equal, and those have to be whole by then.
        """
        for node in self._nodes:
            self.made.append(_MAKERS[node[0]](self, *node[1:]))
        for fillers in (_FILLERS, _LAST_FILLERS):
            for thing, node in zip(self.made, self._nodes, strict=True):
                if node[0] in fillers:
                    fillers[node[0]](self, thing, *node[1:])

    def end(self) -> None:
        """Check that nothing is left over."""
        if self._read != len(self._arrays):
            raise Damaged(f"{len(self._arrays) - self._read} bytes too many")

    def constant(self, number: Any) -> Any:
        """A constant of the run."""
        if whole_number(number) >= len(self._constants.objects):
            raise Damaged(f"constant {number} of {len(self._constants.objects)}")
        return self._constants.objects[number]

    def array(self, dtype: Any, shape: Any, writeable: Any, order: Any, residue: Any) -> np.ndarray:
        """An array whose bytes come next. No bytes are read twice, so that the arrays take no more memory than the file."""
        layout = _layout(dtype, shape, writeable)
        begin, self._read = self._read, self._read + layout.size
        if self._read > len(self._arrays):
            raise Damaged(f"an array of {layout.size} bytes where {len(self._arrays) - begin} are left")
        return own_array(layout, order, whole_number(residue), self._arrays[begin : self._read])

    def view(self, base: Any, dtype: Any, shape: Any, writeable: Any, offset: Any, strides: Any) -> np.ndarray:
        """A view of another array."""
        steps = tuple(whole_number(stride, -(2**63)) for stride in strides)
        return view_of(self.child(base), _layout(dtype, shape, writeable), whole_number(offset, -(2**63)), steps)

    def scalar(self, dtype: Any, data: str) -> Any:
        """A number of numpy."""
        known, content = typed(dtype), bytes.fromhex(data)
        if len(content) != known.itemsize:
            raise Damaged(f"a number of {len(content)} bytes")
        return np.frombuffer(content, known)[0]

    def function(self, name: Any) -> Any:
        """A function of the table."""
        if name not in FUNCTIONS:
            raise Damaged(f"the function {str(name)[:60]!r}")
        return named_function(name)

    def method(self, owner: Any, name: Any) -> Any:
        """A method of the table."""
        method = named_method(self.child(owner), name)
        if method is None:
            raise Damaged(f"the method {str(name)[:60]!r} of a {type(self.child(owner)).__name__}")
        return method

    def partial(self, function: Any, arguments: list[Any], named: dict[str, Any]) -> Any:
        """A function or method of the tables with some of its arguments; it is not called."""
        called = self.child(function)
        if type(function) is not list or self._nodes[function[0]][0] not in ("function", "method"):
            raise Damaged("arguments of something that is no function of the table")
        return partial(called, *self.children(arguments), **{name: self.child(value) for name, value in named.items()})

    def named(self, label: Any, *items: Any) -> Any:
        """A named tuple."""
        schema = _schema(label, is_tuple=True)
        if len(items) != len(schema.fields):
            raise Damaged(f"{len(items)} fields of a {label}")
        return tuple.__new__(schema.made, self.children(list(items)))

    def object(self, label: Any, _fields: Any) -> Any:
        """An object without its fields; `__init__` is not called."""
        return object.__new__(_schema(label, is_tuple=False).made)

    def fill_object(self, thing: Any, label: Any, fields: dict[str, Any]) -> None:
        """Give an object its fields, which have to be those of its class."""
        schema = _schema(label, is_tuple=False)
        wrong = sorted((fields.keys() - schema.fields - schema.optional) | (schema.fields - fields.keys()))
        if wrong:
            raise Damaged(f"a {label} has other fields than its class says: {str(wrong)[:60]}")
        for name, value in fields.items():
            # Neither runs code of the class, as setting an attribute would that is a property.
            if name in schema.slots:
                object.__setattr__(thing, name, self.child(value))
            else:
                thing.__dict__[name] = self.child(value)

    def fill_dict(self, thing: dict[Any, Any], *items: Any) -> None:
        """Give a dictionary its keys and values."""
        known = self.children(list(items))
        thing.update(zip(known[::2], known[1::2], strict=True))
        if 2 * len(thing) != len(known):
            raise Damaged("a key twice")


def _layout(dtype: Any, shape: Any, writeable: Any) -> Layout:
    if type(writeable) is not bool:
        raise Damaged("an array that is neither written to nor only read")
    return Layout(typed(dtype), whole_numbers(shape), writeable)


def _schema(label: Any, is_tuple: bool) -> Schema:
    """The class of a label."""
    schema = classes().get(label) if isinstance(label, str) else None
    if schema is None or schema.is_tuple is not is_tuple:
        raise Damaged(f"the class {str(label)[:60]!r}")
    return schema


_MAKERS: dict[str, Callable[..., Any]] = {
    "constant": _Decoder.constant,
    "int": lambda _, text: int(text, 16),
    "float": lambda _, text: struct.unpack("<d", bytes.fromhex(text))[0],
    "complex": lambda _, text: complex(*struct.unpack("<dd", bytes.fromhex(text))),
    "bytes": lambda _, text: bytes.fromhex(text),
    "bytearray": lambda _, text: bytearray.fromhex(text),
    "tuple": lambda decoder, *items: tuple(decoder.children(list(items))),
    "frozenset": lambda decoder, *items: frozenset(decoder.children(list(items))),
    "slice": lambda decoder, *parts: slice(*decoder.children(list(parts))),
    "range": lambda decoder, *parts: range(*decoder.children(list(parts))),
    "list": lambda _, *items: [],
    "set": lambda _, *items: set(),
    "dict": lambda _, *items: {},
    "ordered": lambda _, *items: collections.OrderedDict(),
    "deque": lambda _, most, *items: collections.deque(maxlen=most),
    "defaultdict": lambda _, factory, *items: collections.defaultdict(FACTORIES[factory]),
    "dtype": lambda _, description: typed(description),
    "array": _Decoder.array,
    "view": _Decoder.view,
    "records": lambda decoder, base: decoder.child(base).view(np.recarray),
    "scalar": _Decoder.scalar,
    "function": _Decoder.function,
    "method": _Decoder.method,
    "partial": _Decoder.partial,
    "named": _Decoder.named,
    "object": _Decoder.object,
}
"""What makes a node of each kind; containers and objects are empty at first."""
_FILLERS: dict[str, Callable[..., Any]] = {
    "object": _Decoder.fill_object,
    "list": lambda decoder, thing, *items: thing.extend(decoder.children(list(items))),
    "deque": lambda decoder, thing, _, *items: thing.extend(decoder.children(list(items))),
}
_LAST_FILLERS: dict[str, Callable[..., Any]] = {
    "set": lambda decoder, thing, *items: thing.update(decoder.children(list(items))),
    "dict": _Decoder.fill_dict,
    "ordered": _Decoder.fill_dict,
    "defaultdict": lambda decoder, thing, _, *items: decoder.fill_dict(thing, *items),
}


def thaw(data: bytes, constants: Constants) -> Any:
    """Return the state that `freeze` wrote, with these constants.

    Raises:
        SceneError: the bytes are no state, or one with other constants.

    """
    try:
        number, state = _read(data, constants)
    except Exception as error:  # whatever damage does, it is damage
        raise SceneError(f"the checkpoint cannot be read: {type(error).__name__}: {error}", REMEDY) from None
    if number != len(constants.objects):
        raise SceneError("the checkpoint is of another scene", REMEDY)
    return state


def _read(data: bytes, constants: Constants) -> tuple[Any, Any]:
    """The number of constants that the bytes count, and the state."""
    if not data.startswith(MARK):
        raise Damaged("it is none of this version of the library")
    table_size, arrays_size = LENGTHS.unpack_from(data, len(MARK))
    begin = len(MARK) + LENGTHS.size
    end = begin + table_size
    if end + arrays_size != len(data):
        raise Damaged(f"{len(data)} bytes with a table of {table_size} and arrays of {arrays_size}")
    number, root, nodes = json.loads(data[begin:end], parse_constant=_refuse)
    if number != len(constants.objects):
        return number, None
    decoder = _Decoder(constants, nodes, memoryview(data)[end:])
    decoder.make()
    decoder.end()
    return number, decoder.child(root)


def _refuse(text: str) -> Any:
    raise Damaged(f"the number {text}")
