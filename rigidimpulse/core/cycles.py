"""The processor's own clock inside kernels: where the time of a long kernel goes.

On x86 it counts at a constant rate and is read in some 20 cycles. Elsewhere a program may not be allowed to read such a counter, so there
it stands at 0.
"""

from __future__ import annotations

import platform
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

READABLE = platform.machine().lower() in ("x86_64", "amd64")
"""Whether the counter may be read."""


@intrinsic
def _cycles(_typing: Any) -> Any:
    """Return the counter, an int64."""

    def write(_target: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        word = ir.IntType(64)
        if not READABLE:
            return ir.Constant(word, 0)
        return builder.call(builder.module.declare_intrinsic("llvm.readcyclecounter", (), ir.FunctionType(word, ())), ())

    return types.int64(), write


cycles: Any = _cycles
"""The counter, an int64: a function for kernels."""
