"""Files by suffix, and files that are there as a whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

ANIMATED_SUFFIXES = (".glb", ".gltf", ".usda", ".usdc", ".usd", ".usdz")
"""Of files with animated bodies."""


def write_renamed(path: Path, write: Callable[[Path], object]) -> Path:
    """Write to a temporary name beside the target, then rename: nobody ever sees half a file. Returns the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        write(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    return path
