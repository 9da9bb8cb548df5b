"""Results that are kept as long as what they were asked of lives."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

Thing = TypeVar("Thing")
Result = TypeVar("Result")


def kept_with_argument(function: Callable[[Thing], Result]) -> Callable[[Thing], Result]:
    """Let a function compute its result once for each object that it is asked of; the result must not refer to that object."""
    results: WeakKeyDictionary[Thing, Result] = WeakKeyDictionary()

    @wraps(function)
    def known(thing: Thing) -> Result:
        result = results.get(thing)
        if result is None:
            result = results[thing] = function(thing)
        return result

    return known
