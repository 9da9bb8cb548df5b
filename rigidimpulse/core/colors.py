"""Colours: as people see them (sRGB, "#rrggbb" or 0..255), and as light adds up (linear, 0..1). IEC 61966-2-1."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def linear_of(seen: ArrayLike) -> np.ndarray:
    """Return linear values of sRGB values in [0, 1]."""
    s = np.asarray(seen, float)
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def seen_of(linear: ArrayLike) -> np.ndarray:
    """Return sRGB values of linear values in [0, 1]."""
    c = np.clip(np.asarray(linear, float), 0.0, 1.0)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1.0 / 2.4) - 0.055)


def bytes_of(seen: ArrayLike) -> np.ndarray:
    """Return sRGB values in [0, 1] as whole numbers of 0..255, uint8."""
    return np.round(255.0 * np.clip(np.asarray(seen, float), 0.0, 1.0)).astype(np.uint8)


def seen_bytes(linear: ArrayLike) -> np.ndarray:
    """Return linear colours as those of the screen, uint8."""
    return bytes_of(seen_of(linear))


def hex_of(seen: ArrayLike) -> str:
    """Return "#rrggbb" of sRGB values (3,) in [0, 1]."""
    return "#" + "".join(f"{part:02x}" for part in bytes_of(seen).tolist())


def seen_of_hex(color: str) -> np.ndarray:
    """Return sRGB values (3,) in [0, 1] of "#rrggbb"."""
    return np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
