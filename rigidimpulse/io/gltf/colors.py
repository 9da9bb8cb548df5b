"""Colours of the primitives of a glTF file: base colour of the material, times its texture, times the colours of the vertices.

Figures of materials and vertices are linear, pictures are as on the screen (glTF 2.0, sections 3.9.2 and 3.7.2.1). What of them cannot be
read is left out: colours are no reason to refuse a scene. A primitive without a material and without colours has none.
"""

from __future__ import annotations

import io
from math import cos, sin
from typing import Any

import numpy as np
from pydantic import Field, ValidationError

from rigidimpulse.core.colors import seen_bytes
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.textures import corner_colors, picture_levels
from rigidimpulse.io.gltf.container import GltfFile
from rigidimpulse.io.gltf.schema import Index, Number, Part, Primitive

MOST_PIXELS = 2**26
"""Pixels of a picture that is read, at most."""
WHITE = (1.0, 1.0, 1.0, 1.0)


class TextureTransform(Part):
    """KHR_texture_transform: uv' = offset + R(rotation) (scale uv)."""

    offset: tuple[Number, Number] = (0.0, 0.0)
    rotation: Number = 0.0
    scale: tuple[Number, Number] = (1.0, 1.0)


class TextureInfo(Part):
    """Which texture, and by which coordinates."""

    index: Index
    tex_coord: Index = 0
    extensions: dict[str, Any] = Field(default={})


class Surface(Part):
    """pbrMetallicRoughness of a material."""

    base_color_factor: tuple[Number, Number, Number, Number] = WHITE
    base_color_texture: TextureInfo | None = None


class LookOfMaterial(Part):
    """What a material says of colours."""

    surface: Surface = Field(default=Surface(), alias="pbrMetallicRoughness")


class Texture(Part):
    """Which picture."""

    source: Index


class Image(Part):
    """A picture, in the file or beside it."""

    uri: str | None = None
    buffer_view: Index | None = None


class Colors:
    """Colours of the primitives of one file."""

    def __init__(self, file: GltfFile) -> None:
        """Nothing is read before it is asked for."""
        self._file = file
        self._pictures: dict[int, list[np.ndarray] | None] = {}

    def of(self, primitive: Primitive, faces: np.ndarray) -> np.ndarray | None:
        """Return the colours (f, 3, 3) of the corners of triangles, uint8 as on the screen, None if nothing gives any."""
        found = self._entry("materials", primitive.material, LookOfMaterial)
        surface, said = Surface() if found is None else found.surface, found is not None
        factor, info = np.array(surface.base_color_factor[:3]), surface.base_color_texture
        linear = np.broadcast_to(factor, (len(faces), 3, 3))
        texture = None if info is None else self._textured(primitive, info, faces)
        vertices = self._of_vertices(primitive, "COLOR_0", faces)
        for more in (texture, None if vertices is None else vertices[..., :3]):
            if more is not None:
                linear, said = linear * more, True
        return seen_bytes(linear) if said else None

    def _entry(self, kind: str, index: int, model: Any) -> Any:
        """Return an entry of the file as a model, None if it is none."""
        try:
            return model.model_validate(self._file.raw[kind][index], strict=False) if index >= 0 else None
        except (KeyError, IndexError, TypeError, ValidationError):
            return None

    def _of_vertices(self, primitive: Primitive, name: str, faces: np.ndarray) -> np.ndarray | None:
        """Return an attribute at the corners of triangles, None if there is none."""
        if name not in primitive.attributes:
            return None
        try:
            values = np.asarray(self._file.array(primitive.attributes[name]), float)
        except SceneError:
            return None
        fits = values.ndim == 2 and values.shape[1] >= 2 and int(faces.max(initial=-1)) < len(values)
        return values[faces] if fits else None

    def _textured(self, primitive: Primitive, info: TextureInfo, faces: np.ndarray) -> np.ndarray | None:
        """Return the linear colours that a texture gives."""
        levels, uv = self._picture(info.index), self._of_vertices(primitive, f"TEXCOORD_{info.tex_coord}", faces)
        if levels is None or uv is None:
            return None
        try:
            change = TextureTransform.model_validate(info.extensions.get("KHR_texture_transform", {}), strict=False)
        except ValidationError:
            change = TextureTransform()
        c, s = cos(change.rotation), sin(change.rotation)
        return corner_colors(levels, np.array(change.offset) + uv[..., :2] * change.scale @ np.array([[c, -s], [s, c]]))

    def _picture(self, index: int) -> list[np.ndarray] | None:
        """Return the picture of a texture, None if it cannot be read."""
        if index not in self._pictures:
            texture = self._entry("textures", index, Texture)
            image = None if texture is None else self._entry("images", texture.source, Image)
            self._pictures[index] = None if image is None else self._read(image)
        return self._pictures[index]

    def _read(self, image: Image) -> list[np.ndarray] | None:
        from PIL import Image as Pictures

        try:
            if image.buffer_view is not None:
                data = bytes(self._file.view(image.buffer_view)[0])
            elif image.uri is not None:
                data = self._file.bytes_at(image.uri, "an image")
            else:
                return None
            opened = Pictures.open(io.BytesIO(data), formats=("PNG", "JPEG", "WEBP"))
            return picture_levels(opened) if opened.width * opened.height <= MOST_PIXELS else None
        except Exception:  # a broken picture raises anything
            return None
