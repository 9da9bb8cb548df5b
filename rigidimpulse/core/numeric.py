"""Numbers as users give them, as floats: text is no number, though Python and numpy read digits in it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError

KINDS = "fiub"
"""What numpy has numbers of: floats, integers, truth values."""


def number_of(value: object) -> float:
    """Return a value as a float; not a number where it is none."""
    if isinstance(value, str | bytes | bytearray):
        return np.nan
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return np.nan


def is_number(value: object) -> bool:
    """Whether a value is a number, if only one that stands for none."""
    return isinstance(value, float | np.floating) or not math.isnan(number_of(value))


def check_numbers(owner: object, *names: str, optional: tuple[str, ...] = ()) -> None:
    """Raise a SceneError where an attribute of these names is no number; one of the optional ones may be None."""
    given = [name for name in optional if getattr(owner, name) is not None]
    for name in (*given, *names):
        if math.isnan(number_of(getattr(owner, name))):
            raise SceneError(f"{name} = {getattr(owner, name)!r}", "give a number, or leave it out")


def numbers_of(value: ArrayLike) -> np.ndarray:
    """Return a float copy of an array, in order of C; of one value that is not a number where it holds others, or has no one form."""
    try:
        given = np.asarray(value)
        if given.dtype.kind == "O":
            # Objects may be text, which numpy would read.
            given = np.array([number_of(one) for one in given.ravel().tolist()]).reshape(given.shape)
        return np.array(given, np.float64, order="C") if given.dtype.kind in KINDS else np.array(np.nan)
    except (TypeError, ValueError):
        return np.array(np.nan)
