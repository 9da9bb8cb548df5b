"""Rounds of work that two cores share, with the same bits as on one: what kernels need for it.

A leader goes through rounds in their order; pieces of a round do not touch each other's results, so that it does not matter who works on
which. Whoever adds one to the ticket may take a piece, unless as many have been taken as there are: the leader from the front, its
helper from the back, so that each stays with the same bodies as long as it can. The helper knows from the ticket which round is open, and
says when a piece is done; the leader opens the next round when all pieces are.

The leader waits for a piece that the helper has in hand, else for nothing: a helper that comes late, or is put aside by the system, is
done without. One that finds no work for a while, or that the leader has come to the end, goes home.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import extending, types

from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.simd import machine_function

intrinsic: Any = extending.intrinsic
TICKET, DONE, PLACES = 0, 8, 16
"""Places of the ticket and of the number of pieces that the helper has done, each on a line of the cache of its own."""
BITS = 24
"""Of a ticket that count pieces."""
NONE, LAST = -1, 1 << 32
"""Rounds in which there is nothing to do: before the first, and after the last."""
PATIENCE = 20_000
"""How often the helper looks for work in vain."""
_IS_X86 = llvmlite.binding.get_process_triple().startswith(("x86_64", "i686"))


def empty_work_queue() -> np.ndarray:
    """What leader and helper share, before the first round."""
    work_queue = np.zeros(PLACES, np.int64)
    work_queue[TICKET] = NONE << BITS
    return work_queue


def _pointer(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    data = target.make_array(signature.args[0])(target, builder, arguments[0]).data
    return builder.gep(data, [arguments[1]])


@intrinsic
def _add(_typing, work_queue, place, number):
    """Add to a place at once; returns what was there."""

    def lower(context, builder, signature, arguments):
        return builder.atomic_rmw("add", _pointer(context, builder, signature, arguments), arguments[2], "acq_rel")

    return types.int64(work_queue, types.intp, types.int64), lower


@intrinsic
def _read(_typing, work_queue, place):
    """What is at a place, and all that was written before it came there."""

    def lower(context, builder, signature, arguments):
        return builder.load_atomic(_pointer(context, builder, signature, arguments), "acquire", 8)

    return types.int64(work_queue, types.intp), lower


@intrinsic
def _write(_typing, work_queue, place, number):
    """Put a number to a place, after all that was written before."""

    def lower(context, builder, signature, arguments):
        builder.store_atomic(arguments[2], _pointer(context, builder, signature, arguments), "release", 8)
        return context.get_dummy_value()

    return types.void(work_queue, types.intp, types.int64), lower


@intrinsic
def pause(_typing):
    """Let the core rest for some tens of cycles, where it can."""

    def lower(context, builder, _signature, _arguments):
        if _IS_X86:
            kind = ir.FunctionType(ir.VoidType(), [])
            builder.call(machine_function(builder.module, kind, "llvm.x86.sse2.pause"), [])
        return context.get_dummy_value()

    return types.void(), lower


@inlined
def open_round(work_queue, number):
    """Let pieces of a round be taken."""
    _write(work_queue, DONE, 0)
    _write(work_queue, TICKET, np.int64(number) << BITS)


@inlined
def take_piece(work_queue):
    """Take a piece: returns its round, and how many had been taken before."""
    ticket = _add(work_queue, TICKET, 1)
    return ticket >> BITS, ticket & ((1 << BITS) - 1)


@inlined
def look_at(work_queue):
    """The round that is open, and how many of its pieces have been taken."""
    ticket = _read(work_queue, TICKET)
    return ticket >> BITS, ticket & ((1 << BITS) - 1)


@inlined
def report_piece(work_queue):
    """Say that a piece is done."""
    _add(work_queue, DONE, 1)


@jit
def wait_for(work_queue, number):
    """Wait until the helper has done this number of pieces of a round."""
    while _read(work_queue, DONE) < number:
        pause()
