"""Digests of values by their content: functions by their code, objects by their fields."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
from functools import partial
from types import CodeType
from typing import Any

import numpy as np


def digest_of(value: Any) -> str:
    """Hash of a value, such as a shape: equal for equal ones."""
    digest = hashlib.sha256()
    feed(digest, value)
    return digest.hexdigest()


def feed(digest: Any, value: Any, within: tuple[int, ...] = ()) -> None:
    """Add a value: numbers and texts as they are, arrays by their bytes, objects by the names and values of their fields.

    within: identities of what the value is a part of.
    """
    if id(value) in within:  # a function that names itself
        return
    within = (*within, id(value))
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, str | bytes | int | float | complex | np.generic | type(None)):
        digest.update(repr(value).encode())
    elif isinstance(value, list | tuple | set | frozenset):
        digest.update(f"{type(value).__name__}{len(value)}".encode())
        for item in sorted(value, key=repr) if isinstance(value, set | frozenset) else value:
            feed(digest, item, within)
    elif isinstance(value, dict):
        for key in sorted(value, key=repr):
            feed(digest, key, within)
            feed(digest, value[key], within)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        digest.update(type(value).__qualname__.encode())
        for item in dataclasses.fields(value):
            feed(digest, item.name, within)
            feed(digest, getattr(value, item.name), within)
    elif inspect.ismethod(value):
        feed(digest, [value.__func__, value.__self__], within)
    elif inspect.isfunction(value):
        inside = [cell.cell_contents for cell in value.__closure__ or ()]
        feed(digest, [value.__code__, value.__defaults__, value.__kwdefaults__, inside], within)
    elif isinstance(value, CodeType):
        feed(digest, [value.co_code, value.co_consts, value.co_names], within)
    elif isinstance(value, partial):
        feed(digest, [value.func, value.args, value.keywords], within)
    elif isinstance(value, type) or inspect.isroutine(value):
        feed(digest, f"{value.__module__}.{value.__qualname__}", within)
    elif hasattr(value, "__dict__"):
        feed(digest, {name: each for name, each in vars(value).items() if not name.startswith("_cached")}, within)
    else:
        digest.update(repr(value).encode())
