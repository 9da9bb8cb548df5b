"""Calls of a kernel from Python whose arguments have types that are known.

numba looks up the types of all arguments at each call, of a tuple of a hundred arrays one by one: that takes 20 to 40 us, where the call
takes three. A tuple cannot change, so that the very tuple of an earlier call has the types it had. Those of arrays and numbers are seen at
once.
"""

from __future__ import annotations

from collections.abc import Callable
from types import NoneType
from typing import Any

import numpy as np

MOST, TRIES, AGAIN = 32, 64, 512
"""Calls that are kept of a kernel; calls after which a kernel that is mostly called with other tuples is looked up by numba only; calls
after which it is tried again: ragdolls that fly are looked at once in a step, and those that lie on a stair many times."""
MOST_ARRAYS = 2
"""Arrays in a tuple up to which it is told by what it holds, and not by being the same."""
_NUMBERS = frozenset({int, float, bool, NoneType, np.float64, np.float32, np.int64, np.int32, np.bool_})
_SMALL: dict[type, bool] = {tuple: True}


class KnownCalls:
    """Calls of a kernel that is compiled for one set of types."""

    def __init__(self) -> None:
        """None yet."""
        # The arguments are kept too: another object cannot take the place of one of them in memory, and pass for it.
        self._calls: dict[tuple, tuple[Callable[..., Any], tuple]] = {}
        self._found = self._kept = self._passed = 0

    def find(self, arguments: tuple) -> tuple[tuple, Callable[..., Any] | None]:
        """What tells these arguments, empty where this is not asked any more; and what to call with them, None if that is not known."""
        if self._kept > TRIES and self._kept > self._found:
            self._passed += 1
            if self._passed < AGAIN:
                return (), None
            self._found = self._kept = self._passed = 0
        key = tuple([_told_by(argument) for argument in arguments])
        call = self._calls.get(key)
        if call is None:
            return key, None
        self._found += 1
        return key, call[0]

    def keep(self, key: tuple, arguments: tuple, call: Callable[..., Any]) -> None:
        """Know from now on what to call with such arguments."""
        if not key:
            return
        if len(self._calls) == MOST:
            self._calls.clear()
        self._calls[key] = call, arguments
        self._kept += 1

    def forget(self) -> None:
        """Know none any more, and hold no arguments."""
        self._calls.clear()
        self._found = self._kept = self._passed = 0


def _told_by(argument: Any) -> Any:
    """What tells the type of an argument."""
    kind = type(argument)
    if kind is np.ndarray:
        return argument.dtype, argument.ndim, argument.flags.num
    if kind in _NUMBERS:
        return kind
    if isinstance(argument, tuple) and _is_small(kind, argument):
        return kind, *[_told_by(value) for value in argument]
    return id(argument)


def _is_small(kind: type, example: tuple) -> bool:
    """Whether tuples of a kind hold few arrays and no tuples."""
    if kind not in _SMALL:
        arrays = sum(type(value) is np.ndarray for value in example)
        _SMALL[kind] = arrays <= MOST_ARRAYS and not any(isinstance(value, tuple) for value in example)
    return _SMALL[kind]
