"""The newcomer corpus: all its scenes, by theme."""

from __future__ import annotations

import everyday  # noqa: F401
import machines  # noqa: F401
import piles  # noqa: F401
import tracks  # noqa: F401
from stage import CORPUS

__all__ = ["CORPUS"]
