"""Functions that higher layers provide to lower ones.

A module imports nothing from a layer above its own. Some functions of a lower layer still need a function of a higher one: a recording
opens the viewer. The higher layer registers that function here, as "module:function". The module is imported when the function is
first asked for, so registering costs nothing. The `registration` modules of the packages register their functions; `import rigidimpulse` runs them.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

_PROVIDERS: dict[str, str] = {}


def provide(service: str, function: str) -> None:
    """Register the function ("module:function") that does a service."""
    _PROVIDERS[service] = function


def provider(service: str) -> Callable[..., Any]:
    """Return the function that does a service; a KeyError says that nobody provides it."""
    return load_function(_PROVIDERS[service])


def load_function(place: str) -> Callable[..., Any]:
    """Import the function that "module:function" names."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)
