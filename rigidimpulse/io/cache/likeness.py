"""Whether a state that was read is one of this run: made of the same things as the run that has been prepared again.

A checkpoint may be well formed and still hold a text where the run needs an array. While a run goes on, numbers change and arrays get
longer. Classes, types of elements, numbers of axes and constants do not. What is None at the start may be anything later.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from rigidimpulse.io.cache.arrays import Damaged
from rigidimpulse.io.cache.constants import Constants
from rigidimpulse.io.cache.registry import held_by, schema_of

NUMBERS = (bool, int, float, np.bool_, np.number)


def check_alike(known: Any, fresh: Any, constants: Constants) -> None:
    """Compare a state that was read with a fresh one.

    Raises:
        Damaged: something in it is of another kind; the message says where.

    """
    waiting, seen = [("the state", known, fresh)], set()
    while waiting:
        where, mine, other = waiting.pop()
        if other is None or (id(mine), id(other)) in seen:
            continue
        seen.add((id(mine), id(other)))
        if constants.number(other) is not None:
            if mine is not other:
                raise Damaged(f"{where} is another constant")
        elif isinstance(other, NUMBERS):
            if not isinstance(mine, NUMBERS):
                raise Damaged(f"{where} is a {type(mine).__name__}, and should be a number")
        elif type(mine) is not type(other):
            raise Damaged(f"{where} is a {type(mine).__name__}, and should be a {type(other).__name__}")
        elif isinstance(other, np.ndarray):
            if mine.dtype != other.dtype or mine.ndim != other.ndim:
                raise Damaged(f"{where} is an array of {mine.ndim} axes of {mine.dtype}, and should be of {other.ndim} of {other.dtype}")
        else:
            waiting.extend(_pairs(where, mine, other))


def _pairs(where: str, mine: Any, other: Any) -> Iterator[tuple[str, Any, Any]]:
    """What two things of one type hold, side by side; nothing for collections that have become longer or shorter."""
    schema = schema_of(type(other))
    if schema is not None:
        held = held_by(mine, schema)
        yield from ((f"{schema.label}.{name}", held[name], value) for name, value in held_by(other, schema).items() if name in held)
    elif isinstance(other, list | tuple) and len(mine) == len(other):
        yield from ((where, *pair) for pair in zip(mine, other, strict=True))
    elif isinstance(other, dict) and mine.keys() == other.keys():
        yield from ((where, mine[key], value) for key, value in other.items())
