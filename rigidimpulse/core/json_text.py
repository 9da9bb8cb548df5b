"""JSON that every reader takes: it has no NaN and no infinity (RFC 8259, section 6), so those stand in it as texts."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any


def json_text(value: Any, *, indent: int | None = None, default: Callable[[Any], Any] | None = None) -> str:
    """Return a value as JSON; a number that is not finite is the text "NaN", "Infinity" or "-Infinity", which `float` reads.

    Args:
        value: what `json.dumps` takes. indent: spaces; None: all in one line.
        default: called with what is none of JSON's kinds, for something that is.

    """
    separators = (",", ":") if indent is None else None
    return json.dumps(_in_words(value, default), ensure_ascii=False, indent=indent, separators=separators, allow_nan=False)


def _in_words(value: Any, default: Callable[[Any], Any] | None) -> Any:
    """The same value with texts for numbers that are not finite."""
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0.0 else "-Infinity"
    if isinstance(value, Mapping):
        return {key: _in_words(entry, default) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_in_words(entry, default) for entry in value]
    if default is None or value is None or isinstance(value, str | int | float):
        return value
    return _in_words(default(value), default)
