"""Colours of meshes that trimesh has read: of vertices, faces, materials and textures.

Programs give every mesh some material. One middle grey all over a file says nothing, and counts as no colour. Colours are no reason to
refuse a mesh: those that cannot be read are left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidimpulse.core.colors import seen_of
from rigidimpulse.core.textures import corner_colors, picture_levels

PLAIN = 0.85
"""Grey of what has no colour in a mesh that has some."""
GREYS = 0.35, 0.9
"""Greys between these are what programs write by themselves: trimesh has 0.4, Blender 0.8."""


def colors_of_trimesh(mesh: Any) -> np.ndarray | None:
    """Return the colours (f, 3, 3) in [0, 1] of the corners of the faces, None where the mesh has none, or none that can be read."""
    visual, faces = getattr(mesh, "visual", None), np.asarray(mesh.faces)
    if visual is None or len(faces) == 0 or not getattr(visual, "defined", False):
        return None
    try:
        corners = _of_corners(visual, faces)
    except Exception:  # pictures and colours of broken files raise anything
        return None
    return np.clip(corners, 0.0, 1.0) if corners.shape == (len(faces), 3, 3) and np.isfinite(corners).all() else None


def _of_corners(visual: Any, faces: np.ndarray) -> np.ndarray:
    if visual.kind == "texture":
        return _textured(visual, faces)
    if visual.kind == "face":
        return np.repeat(np.asarray(visual.face_colors)[:, None, :3], 3, axis=1) / 255.0
    return np.asarray(visual.vertex_colors)[faces][..., :3] / 255.0


def _textured(visual: Any, faces: np.ndarray) -> np.ndarray:
    """Colours of the corners by the picture of a material, or its one colour."""
    material, uv = visual.material, visual.uv
    if "color" in visual.vertex_attributes:
        # Of a glTF file, where they are linear, and multiply the colour of the material.
        linear = np.asarray(visual.vertex_attributes["color"], float)[:, :3] * _factor(material)
        return seen_of(linear)[faces]
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if image is None or uv is None or not np.isfinite(uv).all():
        return np.broadcast_to(_main_color(material), (len(faces), 3, 3))
    # Rows of a picture run down, v of trimesh runs up.
    return seen_of(corner_colors(picture_levels(image), np.asarray(uv, float)[faces] * [1.0, -1.0] + [0.0, 1.0]))


def _factor(material: Any) -> np.ndarray:
    """Linear colour (3,) of a material of a glTF file; trimesh has it as bytes."""
    factor = getattr(material, "baseColorFactor", None)
    return np.ones(3) if factor is None else np.asarray(factor, float)[:3] / 255.0


def _main_color(material: Any) -> np.ndarray:
    """Colour (3,) of a material: those of glTF files are linear, those of others as on the screen."""
    if hasattr(material, "baseColorFactor"):
        return seen_of(_factor(material))
    return np.asarray(material.main_color, float)[:3] / 255.0


def joined_colors(colors: list[np.ndarray | None], counts: list[int]) -> np.ndarray | None:
    """Return the colours of meshes with given counts of faces, None if they say nothing; what has none beside others is light grey."""
    known = [each for each in colors if each is not None]
    if not known or (all(np.all(each == known[0][0, 0, 0]) for each in known) and GREYS[0] < known[0][0, 0, 0] < GREYS[1]):
        return None
    return np.concatenate([np.full((count, 3, 3), PLAIN) if each is None else each for each, count in zip(colors, counts, strict=True)])
