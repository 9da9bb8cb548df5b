"""A short text that is the same for the same scene and the same library, and another for any other: what kept results are known by."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path
from typing import Any

import numpy as np

import rigidimpulse
from rigidimpulse import simulation
from rigidimpulse._jit import source_digest
from rigidimpulse.scene import Scene


def fingerprint(scene: Scene, *more: object) -> str:
    """Hash of the bodies, effects and gravity of a scene, of whatever else is given, and of the library's version and sources."""
    digest = hashlib.sha256()
    for part in (rigidimpulse.__version__, source_digest(Path(simulation.__file__)), scene.gravity, *scene.bodies, *scene.effects, *more):
        _feed(digest, part)
    return digest.hexdigest()[:16]


def _feed(digest: Any, value: Any) -> None:
    """Add a value: numbers and texts as they are, arrays by their bytes, objects by the names and values of their fields."""
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, str | bytes | int | float | bool | type(None)):
        digest.update(repr(value).encode())
    elif isinstance(value, list | tuple | set | frozenset):
        digest.update(f"{type(value).__name__}{len(value)}".encode())
        for item in sorted(value, key=repr) if isinstance(value, set | frozenset) else value:
            _feed(digest, item)
    elif isinstance(value, dict):
        for key in sorted(value, key=repr):
            _feed(digest, key)
            _feed(digest, value[key])
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        digest.update(type(value).__qualname__.encode())
        for item in dataclasses.fields(value):
            _feed(digest, item.name)
            _feed(digest, getattr(value, item.name))
    elif callable(value):
        code = getattr(value, "__code__", None)
        digest.update(code.co_code if code is not None else type(value).__qualname__.encode())
    else:
        _feed(digest, {name: each for name, each in vars(value).items() if not name.startswith("_cached")})
