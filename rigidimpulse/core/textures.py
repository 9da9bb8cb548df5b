"""Textures as colours of triangles: at each corner, as coarse as the triangle is in the picture.

A picture is halved again and again, each time to the means of four texels. A triangle whose corners are 2^k texels apart, up and down or
across, is coloured from the picture halved k - 1 times: its corners then have means over about half of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidimpulse.core.colors import linear_of

SIDE = 512
"""Texels along a side of the finest picture that is used."""


def picture_levels(image: Any) -> list[np.ndarray]:
    """Return a PIL image as linear colours (s, s, 3), s = `SIDE`, and halved down to one texel."""
    from PIL.Image import Resampling

    texels = np.asarray(image.convert("RGB").resize((SIDE, SIDE), Resampling.BOX), float) / 255.0
    levels = [linear_of(texels)]
    while len(levels[-1]) > 1:
        half = len(levels[-1]) // 2
        levels.append(levels[-1].reshape(half, 2, half, 2, 3).mean(axis=(1, 3)))
    return levels


def corner_colors(levels: list[np.ndarray], uv: np.ndarray) -> np.ndarray:
    """Return the linear colours (f, 3, 3) of the corners of triangles with texture coordinates uv (f, 3, 2), v down, which repeat."""
    spread = np.ptp(uv, axis=1).max(axis=1)
    level = np.clip(np.ceil(np.log2(np.maximum(spread * SIDE, 1.0))) - 1.0, 0, len(levels) - 1).astype(np.int64)
    # The far edge of a picture belongs to a triangle that ends there, not to the picture's next repetition.
    inside, out = uv - np.floor(uv.min(axis=1, keepdims=True)), np.empty((len(uv), 3, 3))
    inside = np.where((inside == np.ceil(inside)) & (inside > 0.0), np.nextafter(inside, 0.0), inside)
    for k in np.unique(level).tolist():
        some, size = level == k, len(levels[k])
        place = np.floor(inside[some] * size).astype(np.int64) % size
        out[some] = levels[k][place[..., 1], place[..., 0]]
    return out
