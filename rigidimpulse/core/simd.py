"""Explicit SIMD in kernels: vectors of W doubles, one element for each of W things that are computed at once.

A kernel gets `Simd(W)` and makes its vectors by it. The width is part of its type, so that one source serves all
machines. Vectors have + - * / and negation, and the functions below. No element ever depends on another one, and products are added by
`fma` or not at all, so the same bits come out at every width.

Arrays that are read and written by `load` and `store` may hold single precision; vectors are of doubles always.

Rows of 8 doubles (one for each body) are read and written for W indices at once, as 8 vectors; a row begins at a multiple of
64 bytes (`aligned`), so that it is one line of the cache.
"""

from __future__ import annotations

import operator
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.extending import NativeValue, lower_builtin, models, register_model, type_callable, unbox

from rigidimpulse.core.memory import reserve
from rigidimpulse.core.processor import target_features

ROW = 8
"""Doubles in a row."""
LINE = 64
"""Bytes in a line of the cache."""

intrinsic: Any = extending.intrinsic
_DOUBLE, _SINGLE, _INDEX, _SHORT = ir.DoubleType(), ir.FloatType(), ir.IntType(64), ir.IntType(32)


class Simd:
    """The number of elements of the vectors of a kernel: 2, 4 or 8."""

    def __init__(self, width: int) -> None:
        """width: 2, 4 or 8."""
        self.width = width

    @property
    def _numba_type_(self) -> Any:
        """Numba finds the type of what has this ten times as fast."""
        return _simd_type(self.width)


@cache
def machine_simd() -> Simd:
    """Return the width of the widest vector unit of the processor that is compiled for."""
    features = target_features()
    return Simd(8 if "avx512f" in features else 4 if "avx2" in features else 2)


def aligned(rows: int) -> np.ndarray:
    """Zeros (8 rows,) that begin at a line of the cache."""
    return reserve((rows * ROW,), np.float64)


class _SimdType(types.Type):
    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"Simd({width})")


class _VectorType(types.Type):
    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"Vector({width})")


register_model(_SimdType)(models.OpaqueModel)


@register_model(_VectorType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: _VectorType) -> None:
        super().__init__(manager, kind, ir.VectorType(_DOUBLE, kind.width))


@cache
def _simd_type(width: int) -> _SimdType:
    """The type of a width, made once: each call of a kernel asks for it."""
    return _SimdType(width)


@unbox(_SimdType)
def _unbox_simd(_type: types.Type, _object: Any, context: Any) -> NativeValue:
    return NativeValue(context.context.get_dummy_value())


def _define_operator(python: Any, instruction: str) -> None:
    @type_callable(python)
    def type_of(_context: Any) -> Any:
        return lambda a, b: a if isinstance(a, _VectorType) and a == b else None

    @lower_builtin(python, _VectorType, _VectorType)
    def lower(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return getattr(builder, instruction)(*arguments)


for _python, _instruction in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv")):
    _define_operator(_python, _instruction)


@type_callable(operator.neg)
def _type_of_negated(_context: Any) -> Any:
    return lambda a: a if isinstance(a, _VectorType) else None


@lower_builtin(operator.neg, _VectorType)
def _lower_negated(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
    return builder.fneg(arguments[0])


def machine_function(module: ir.Module, kind: ir.FunctionType, name: str) -> ir.Function:
    """LLVM's function of a name in a module, which may know it already."""
    return module.globals.get(name) or ir.Function(module, kind, name)


def _by_machine(builder: Any, name: str, kind: _VectorType, arguments: Any) -> Any:
    vector = ir.VectorType(_DOUBLE, kind.width)
    function = ir.FunctionType(vector, [vector] * len(arguments))
    return builder.call(machine_function(builder.module, function, f"llvm.{name}.v{kind.width}f64"), arguments)


@intrinsic
def width_of(_typing, simd):
    """W."""
    return types.int64(simd), lambda _context, _builder, _signature, _arguments: ir.Constant(_INDEX, simd.width)


@intrinsic
def fma(_typing, a, b, c):
    """a b + c, rounded once."""
    return a(a, b, c), lambda _context, builder, _signature, arguments: _by_machine(builder, "fma", a, arguments)


@intrinsic
def root(_typing, a):
    """Square roots."""
    return a(a), lambda _context, builder, _signature, arguments: _by_machine(builder, "sqrt", a, arguments)


@intrinsic
def where_greater(_typing, a, b, x, y):
    """x where a > b, else y."""

    def lower(_context, builder, _signature, arguments):
        return builder.select(builder.fcmp_ordered(">", arguments[0], arguments[1]), arguments[2], arguments[3])

    return a(a, b, x, y), lower


@intrinsic
def spread(_typing, simd, x):
    """x in all elements."""
    kind = _VectorType(simd.width)

    def lower(context, builder, signature, arguments):
        value = context.cast(builder, arguments[1], signature.args[1], types.float64)
        empty = ir.Constant(ir.VectorType(_DOUBLE, kind.width), ir.Undefined)
        one = builder.insert_element(empty, value, ir.Constant(_SHORT, 0))
        return builder.shuffle_vector(one, empty, ir.Constant(ir.VectorType(_SHORT, kind.width), [0] * kind.width))

    return kind(simd, x), lower


EIGHT = 8
"""Width of vectors that need no `Simd`: LLVM cuts them into those that the processor has."""


@intrinsic
def eight(_typing):
    """Simd(EIGHT), made where it is used."""

    def lower(context, _builder, _signature, _arguments):
        return context.get_dummy_value()

    return _simd_type(EIGHT)(), lower


@intrinsic
def highest(_typing, values, places):
    """The highest of the elements of a vector, and where it is: places are those of the first elements; of equal ones the lowest place."""
    width, pair = values.width, types.Tuple((types.float64, types.float64))

    def lower(context, builder, _signature, arguments):
        value, place = arguments[0], builder.fadd(arguments[1], ir.Constant(ir.VectorType(_DOUBLE, width), list(map(float, range(width)))))
        half = width // 2
        while half:
            turned = [(k + half) % width for k in range(width)]
            other, there = _mix(builder, value, value, turned), _mix(builder, place, place, turned)
            first = builder.and_(builder.fcmp_ordered("==", other, value), builder.fcmp_ordered("<", there, place))
            wins = builder.or_(builder.fcmp_ordered(">", other, value), first)
            value, place = builder.select(wins, other, value), builder.select(wins, there, place)
            half //= 2
        found = [builder.extract_element(vector, ir.Constant(_SHORT, 0)) for vector in (value, place)]
        return context.make_tuple(builder, pair, found)

    return pair(values, places), lower


def _place(target: Any, builder: Any, kind: types.Type, array: Any, index: Any, vector: ir.Type) -> Any:
    data = target.make_array(kind)(target, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), vector.as_pointer())


def _stored(array: Any, width: int) -> tuple[ir.Type, int]:
    """W values of an array as they lie in memory, and the bytes of one."""
    single = array.dtype == types.float32
    return ir.VectorType(_SINGLE if single else _DOUBLE, width), 4 if single else 8


@intrinsic
def load(_typing, simd, array, index):
    """W neighbouring values of array (m,), of single or double precision, from index on."""
    kind = _VectorType(simd.width)

    def lower(context, builder, signature, arguments):
        vector, size = _stored(array, kind.width)
        read = builder.load(_place(context, builder, signature.args[1], arguments[1], arguments[2], vector))
        read.align = size
        return read if size == 8 else builder.fpext(read, ir.VectorType(_DOUBLE, kind.width))

    return kind(simd, array, types.intp), lower


@intrinsic
def store(_typing, array, index, value):
    """Put a vector to array (m,), of single or double precision, from index on."""

    def lower(context, builder, signature, arguments):
        vector, size = _stored(array, value.width)
        stored = arguments[2] if size == 8 else builder.fptrunc(arguments[2], vector)
        written = builder.store(stored, _place(context, builder, signature.args[0], arguments[0], arguments[1], vector))
        written.align = size
        return context.get_dummy_value()

    return types.void(array, types.intp, value), lower


def _mix(builder: Any, a: Any, b: Any, order: list[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_SHORT, len(order)), order))


def _transposed(builder: Any, rows: list) -> list:
    """n vectors of n, n a power of two: swap blocks of 1, 2, 4 ... off the diagonal."""
    n, block, rows = len(rows), 1, list(rows)
    while block < n:
        fresh = list(rows)
        for i in range(n):
            if i & block:
                continue
            a, b = rows[i], rows[i + block]
            fresh[i] = _mix(builder, a, b, [k if not k & block else n + k - block for k in range(n)])
            fresh[i + block] = _mix(builder, a, b, [k + block if not k & block else n + k for k in range(n)])
        rows, block = fresh, 2 * block
    return rows


def _columns(builder: Any, rows: list) -> list:
    """8 vectors of the W rows of 8."""
    w = len(rows)
    parts = [[_mix(builder, row, row, list(range(first, first + w))) for row in rows] for first in range(0, ROW, w)]
    return [column for part in parts for column in _transposed(builder, part)]


def _rows(builder: Any, columns: list, w: int) -> list:
    """W rows of 8 of the 8 vectors."""
    parts = [_transposed(builder, columns[first : first + w]) for first in range(0, ROW, w)]
    while len(parts) > 1:
        parts = [
            [_mix(builder, a, b, list(range(2 * w))) for a, b in zip(low, high, strict=True)]
            for low, high in zip(parts[::2], parts[1::2], strict=True)
        ]
        w *= 2
    return parts[0]


def _row_place(target: Any, builder: Any, array: tuple[types.Type, Any], index: tuple[types.Type, Any], first: Any, element: int) -> Any:
    array_type, array_value = array
    index_type, index_value = index
    number = target.make_array(index_type)(target, builder, index_value).data
    number = builder.load(builder.gep(number, [builder.add(first, ir.Constant(first.type, element))]))
    start = builder.shl(builder.sext(number, _INDEX), ir.Constant(_INDEX, 3))
    place = _place(target, builder, array_type, array_value, start, ir.VectorType(_DOUBLE, ROW))
    return place


@intrinsic
def gather(_typing, simd, array, index, first):
    """The rows index[first:first + W] of array (8 m,), as 8 vectors. index: int32."""
    kind = types.UniTuple(_VectorType(simd.width), ROW)

    def lower(context, builder, signature, arguments):
        _, array_type, index_type, _ = signature.args
        rows = []
        for element in range(simd.width):
            row = builder.load(_row_place(context, builder, (array_type, arguments[1]), (index_type, arguments[2]), arguments[3], element))
            row.align = LINE
            rows.append(row)
        return context.make_tuple(builder, kind, _columns(builder, rows))

    return kind(simd, array, index, types.intp), lower


@intrinsic
def scatter(_typing, array, index, first, columns):
    """Put 8 vectors to the rows index[first:first + W] of array (8 m,). index: int32."""

    def lower(context, builder, signature, arguments):
        array_type, index_type, _, kind = signature.args
        vectors = [builder.extract_value(arguments[3], column) for column in range(ROW)]
        for element, row in enumerate(_rows(builder, vectors, kind.dtype.width)):
            place = _row_place(context, builder, (array_type, arguments[0]), (index_type, arguments[1]), arguments[2], element)
            builder.store(row, place).align = LINE
        return context.get_dummy_value()

    return types.void(array, index, types.intp, columns), lower
