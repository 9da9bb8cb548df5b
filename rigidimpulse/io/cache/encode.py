"""The state of a run as bytes, bit for bit: a table of objects in JSON, and the bytes of its arrays after it.

    bytes       `MARK`; two lengths, 8 bytes each: of the table and of the arrays; the table; the arrays, one after the other
    table       [number of constants, child, nodes]: the child is the state, nodes are its objects
    child       null, true, 1, 0.5 and "text" are what they say; [k] is node k
    node        [kind, ...], as the functions of this module write them

What cannot be changed once it is made (a tuple, a view) names only nodes before it, so that it can be made at once; what can be changed (a
list, an object) is made empty and filled when all nodes are there. So objects that hold each other need no recursion. An object is known by
its identity: it is one node however often it is held.
"""

from __future__ import annotations

import collections
import json
import math
import struct
from collections.abc import Callable
from functools import partial
from types import MethodType
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.cache.arrays import LINE, address, described
from rigidimpulse.io.cache.constants import Constants
from rigidimpulse.io.cache.registry import Schema, function_name, held_by, named_method, schema_of

MARK = b"state 2\n"
LENGTHS = struct.Struct("<QQ")
LARGEST = 2**63
"""Numbers from here on are written in hexadecimal: decimal ones take Python long, and too long ones are refused."""
FACTORIES: dict[str, Callable[[], Any]] = {"list": list, "dict": dict, "set": set, "int": int, "float": float}
"""What a `defaultdict` may make where there is nothing."""


class _Encoder:
    """The table as it grows."""

    def __init__(self, constants: Constants) -> None:
        self.nodes: list[list[Any]] = []
        self.arrays: list[bytes] = []
        self._constants = constants
        # Objects are held until the end: the identity of one that is gone may be that of another.
        self._known: dict[int, tuple[list[int], Any]] = {}
        self._waiting: collections.deque[tuple[list[Any], Any, Schema | None]] = collections.deque()

    def child(self, thing: Any) -> Any:
        """What a node says of something that it holds."""
        kind = type(thing)
        if kind is float and math.isfinite(thing):
            return thing
        if kind in (str, bool, type(None)) or (kind is int and -LARGEST <= thing < LARGEST):
            return thing
        known = self._known.get(id(thing))
        if known is not None:
            return known[0]
        return self._add(thing)

    def fill(self) -> None:
        """Write what lists, objects and the like hold, until nothing waits."""
        while self._waiting:
            node, thing, schema = self._waiting.popleft()
            if schema is not None:
                node.append({name: self.child(value) for name, value in _fields(thing, schema).items()})
            elif isinstance(thing, dict):
                node.extend(self.child(each) for item in thing.items() for each in item)
            else:
                node.extend(map(self.child, thing))

    def _add(self, thing: Any) -> list[int]:
        """Give something a node; returns its place."""
        number = self._constants.number(thing)
        node = ["constant", number] if number is not None else self._node(thing)
        place = [len(self.nodes)]
        self.nodes.append(node)
        self._known[id(thing)] = place, thing
        return place

    def _node(self, thing: Any) -> list[Any]:
        kind = type(thing)
        write = _WRITERS.get(kind)
        if write is not None:
            return write(self, thing)
        if issubclass(kind, np.generic) and not thing.dtype.hasobject:
            return ["scalar", described(thing.dtype), thing.tobytes().hex()]
        if isinstance(thing, np.dtype):
            return ["dtype", described(thing)]
        name = function_name(thing)
        if name is not None:
            return ["function", name]
        schema = schema_of(kind)
        if schema is None:
            raise TypeError(f"it holds a {kind.__module__}.{kind.__qualname__}")
        if schema.is_tuple:
            return ["named", schema.label, *map(self.child, thing)]
        return self.later(["object", schema.label], thing, schema)

    def later(self, node: list[Any], thing: Any, schema: Schema | None = None) -> list[Any]:
        """A node that gets what it holds when its turn comes."""
        self._waiting.append((node, thing, schema))
        return node

    def array(self, array: np.ndarray) -> list[Any]:
        """A view of an array, or an array whose bytes are its own."""
        layout = [described(array.dtype), list(array.shape), array.flags.writeable]
        base = array.base
        if type(base) is np.ndarray:
            return ["view", self.child(base), *layout, address(array) - address(base), list(array.strides)]
        order = "F" if array.flags.f_contiguous else "C"
        self.arrays.append(array.tobytes(order))
        return ["array", *layout, order, address(array) % LINE]

    def partial(self, thing: partial[Any]) -> list[Any]:
        """A function with some of its arguments."""
        arguments = {name: self.child(value) for name, value in thing.keywords.items()}
        return ["partial", self.child(thing.func), [self.child(value) for value in thing.args], arguments]

    def method(self, thing: MethodType) -> list[Any]:
        """A method of the table, with its object."""
        name = thing.__func__.__name__
        if named_method(thing.__self__, name) != thing:
            raise TypeError(f"it holds the method {thing.__func__.__qualname__}")
        return ["method", self.child(thing.__self__), name]

    def default(self, thing: collections.defaultdict[Any, Any]) -> list[Any]:
        """A dictionary with a listed factory."""
        factory = next((name for name, made in FACTORIES.items() if made is thing.default_factory), None)
        if factory is None:
            raise TypeError(f"it holds a defaultdict of {thing.default_factory}")
        return self.later(["defaultdict", factory], thing)


_WRITERS: dict[type, Callable[[_Encoder, Any], list[Any]]] = {
    int: lambda _, thing: ["int", hex(thing)],
    float: lambda _, thing: ["float", struct.pack("<d", thing).hex()],
    complex: lambda _, thing: ["complex", struct.pack("<dd", thing.real, thing.imag).hex()],
    bytes: lambda _, thing: ["bytes", thing.hex()],
    bytearray: lambda _, thing: ["bytearray", thing.hex()],
    tuple: lambda encoder, thing: ["tuple", *map(encoder.child, thing)],
    frozenset: lambda encoder, thing: ["frozenset", *map(encoder.child, thing)],
    slice: lambda encoder, thing: ["slice", *map(encoder.child, (thing.start, thing.stop, thing.step))],
    range: lambda encoder, thing: ["range", *map(encoder.child, (thing.start, thing.stop, thing.step))],
    list: lambda encoder, thing: encoder.later(["list"], thing),
    set: lambda encoder, thing: encoder.later(["set"], thing),
    dict: lambda encoder, thing: encoder.later(["dict"], thing),
    collections.OrderedDict: lambda encoder, thing: encoder.later(["ordered"], thing),
    collections.deque: lambda encoder, thing: encoder.later(["deque", thing.maxlen], thing),
    collections.defaultdict: _Encoder.default,
    np.ndarray: _Encoder.array,
    np.recarray: lambda encoder, thing: ["records", encoder.child(thing.view(np.ndarray))],
    partial: _Encoder.partial,
    MethodType: _Encoder.method,
}
"""How things of just these types are written."""


def _fields(thing: Any, schema: Schema) -> dict[str, Any]:
    """The fields of an object by name."""
    held = held_by(thing, schema)
    wrong = sorted((held.keys() - schema.fields - schema.optional) | (schema.fields - held.keys()))
    if wrong:
        raise TypeError(f"a {schema.label} has other fields than its class says: {', '.join(wrong)}")
    return held


def freeze(state: Any, constants: Constants) -> bytes:
    """Return the bytes of a state.

    Raises:
        SceneError: something in it is no plain data: a force of a class of the user's own that keeps, say, an open file.

    """
    encoder = _Encoder(constants)
    try:
        root = encoder.child(state)
        encoder.fill()
        table = json.dumps([len(constants.objects), root, encoder.nodes], separators=(",", ":"), allow_nan=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise SceneError(f"the state of this run cannot be written: {error}", "simulate it without a cache") from None
    return b"".join([MARK, LENGTHS.pack(len(table), sum(map(len, encoder.arrays))), table, *encoder.arrays])
