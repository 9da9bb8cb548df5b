"""glTF files: .glb and .gltf, their buffers and accessors, and writing them.

A .glb file is a header (magic, version, length), a chunk of JSON and at most one of bytes, all little endian, chunks
padded to 4 bytes (glTF 2.0, section 4.4). Everything that is asked of a file is checked against what is there, so a
broken one ends in a `SceneError`.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from pydantic import ValidationError

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.gltf.schema import LARGEST, Accessor, Document
from rigidimpulse.io.named_files import named_file

MAGIC, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
COMPRESSION = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
MOST_VALUES = 2**27
"""Numbers at most in an accessor that no bytes stand behind."""
MOST_ERRORS = 5
"""Errors of the JSON at most that a message lists."""


@dataclass(frozen=True)
class GltfFile:
    """A glTF file that was read.

    Attributes:
        path: where from. raw: its JSON as it is. document: the parts that are read, checked.
        binary: the bytes inside a .glb file. outside: whether its buffers and images may lie outside its folder.
        notes: lines of the report about what was made of it before it became a scene.

    """

    path: Path
    raw: dict[str, Any]
    document: Document
    binary: bytes | None
    outside: bool
    loaded: dict[int, bytes] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def bytes_at(self, uri: str, what: str) -> bytes:
        """Return what a URI stands for: base64 data, or a file beside this one.

        Raises:
            SceneError: it is neither, does not exist, or lies outside the folder of the file.

        """
        if uri.startswith("data:"):
            head, comma, data = uri.partition(",")
            if not comma or not head.endswith(";base64"):
                raise self.error(f"{what} has a data URI that is not base64", "export the file again, as .glb")
            try:
                return base64.b64decode(data, validate=True)
            except (binascii.Error, ValueError):
                raise self.error(f"{what} has broken base64 data", "export the file again, as .glb") from None
        if "://" in uri:
            raise self.error(f"{what} is at {uri!r}", "download it, and name the local file")
        place = named_file(self.path.parent, unquote(uri), self.outside, f"{self.path.name!r}, {what}")
        try:
            return place.read_bytes()
        except OSError:
            raise self.error(f"{what} {uri!r} cannot be read", "keep it beside the scene, or export one .glb file") from None

    def error(self, problem: str, remedy: str, where: str = "") -> SceneError:
        """Return an error that names the file."""
        return SceneError(problem, remedy, f"{self.path.name!r}{', ' + where if where else ''}")

    def entry(self, entries: list[Any], index: int, what: str) -> Any:
        """Return an entry of a list of the document; a `SceneError` if there is none."""
        if index >= len(entries):
            raise self.error(f"there is no {what} {index}, only {len(entries)}", "export the file again: an index is wrong")
        return entries[index]

    def buffer(self, index: int) -> bytes:
        """Return the bytes of a buffer."""
        if index not in self.loaded:
            buffer = self.entry(self.document.buffers, index, "buffer")
            if buffer.uri is not None:
                data = self.bytes_at(buffer.uri, f"buffer {index}")
            elif self.binary is not None and index == 0:
                data = self.binary
            else:
                raise self.error(f"buffer {index} has no bytes", "export the file again, as .glb")
            if len(data) < buffer.byte_length:
                raise self.error(f"buffer {index} ends after {len(data)} of {buffer.byte_length} bytes", "copy or export it again")
            self.loaded[index] = data[: buffer.byte_length]
        return self.loaded[index]

    def view(self, index: int) -> tuple[memoryview, int | None]:
        """Return the bytes of a buffer view and its stride."""
        view = self.entry(self.document.buffer_views, index, "buffer view")
        packed = [name for name in COMPRESSION if name in view.extensions]
        if packed:
            raise self.compressed(packed[0])
        data = self.buffer(view.buffer)
        if view.byte_offset + view.byte_length > len(data):
            raise self.error(f"buffer view {index} ends beyond its buffer", "copy or export the file again")
        return memoryview(data)[view.byte_offset : view.byte_offset + view.byte_length], view.byte_stride

    def compressed(self, name: str) -> SceneError:
        """Return the error for compressed geometry."""
        return self.error(f"its geometry is compressed ({name})", "export it without compression, or unpack it: gltf-transform copy IN OUT")

    def array(self, index: int, kind: str = "") -> np.ndarray:
        """Return an accessor: (count,) of scalars, else (count, width); integers, or float64 where they stand for numbers.

        Raises:
            SceneError: it is not of the `kind` (one of WIDTHS), reaches beyond its bytes, or holds numbers that are not finite.

        """
        accessor: Accessor = self.entry(self.document.accessors, index, "accessor")
        where = f"accessor {index}"
        if accessor.component_type not in COMPONENTS or accessor.type not in WIDTHS or (kind and accessor.type != kind):
            raise self.error(f"it holds {accessor.type} of type {accessor.component_type}, not {kind or 'numbers'}", "export again", where)
        dtype, width = np.dtype(COMPONENTS[accessor.component_type]), WIDTHS[accessor.type]
        if accessor.buffer_view is None:
            if accessor.count * width > MOST_VALUES:
                raise self.error(f"it has {accessor.count} values without bytes", "export the file again", where)
            values = np.zeros((accessor.count, width), dtype)
        else:
            values = self._values(accessor.buffer_view, accessor.byte_offset, accessor.count, dtype, width, where)
        if accessor.sparse is not None:
            values = self._replaced(values, accessor, dtype, width, where)
        if dtype.kind == "f":
            if not (np.isfinite(values).all() and (np.abs(values) <= LARGEST).all()):
                raise self.error("a number in it is not finite, or beyond all bounds", "remove it and export again", where)
            values = values.astype(np.float64)
        elif accessor.normalized:
            values = np.maximum(values / np.iinfo(dtype).max, -1.0)
        return values[:, 0] if width == 1 else values

    def _values(self, view: int, offset: int, count: int, dtype: np.dtype, width: int, where: str) -> np.ndarray:
        data, stride = self.view(view)
        size = dtype.itemsize * width
        step = size if stride is None else stride
        if count and offset + (count - 1) * step + size > len(data):
            raise self.error("it ends beyond its buffer view", "copy or export the file again", where)
        return np.ndarray((count, width), dtype, data, offset, (step, dtype.itemsize)) if count else np.zeros((0, width), dtype)

    def _replaced(self, values: np.ndarray, accessor: Accessor, dtype: np.dtype, width: int, where: str) -> np.ndarray:
        """Values of an accessor with those of its sparse part put in."""
        sparse = accessor.sparse
        assert sparse is not None
        kind = COMPONENTS.get(sparse.indices.component_type, "")
        if kind not in ("<u1", "<u2", "<u4"):
            raise self.error(f"sparse indices of type {sparse.indices.component_type}", "export the file again", where)
        places = self._values(sparse.indices.buffer_view, sparse.indices.byte_offset, sparse.count, np.dtype(kind), 1, where)[:, 0]
        if len(places) and int(places.max()) >= len(values):
            raise self.error("a sparse index is beyond its end", "export the file again", where)
        values = values.copy()
        values[places] = self._values(sparse.values.buffer_view, sparse.values.byte_offset, sparse.count, dtype, width, where)
        return values


def read_file(path: Path, outside: bool = False) -> GltfFile:
    """Read a .glb or .gltf file.

    Args:
        path: the file; its first bytes, not its suffix, say which kind it is.
        outside: let buffers and images lie outside its folder.

    Raises:
        SceneError: there is no such file, or it is broken; with the path of each error in the JSON.

    """
    where = f"scene file {path.name!r}"
    try:
        data = path.read_bytes()
    except OSError:
        raise SceneError(f"it cannot be read (looked for {path.absolute()})", "check the path", where) from None
    text, binary = _chunks(data, where) if data[:4] == struct.pack("<I", MAGIC) else (data, None)
    try:
        raw = json.loads(text.decode("utf-8-sig"), parse_constant=_refuse_constant)
        if not isinstance(raw, dict):
            raise ValueError("it holds no object")
        document = Document.model_validate_json(text.removeprefix(b"\xef\xbb\xbf"))
    except ValidationError as error:
        lines = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors(include_url=False)[:MOST_ERRORS]]
        raise SceneError("; ".join(lines), "correct or export the file again", where) from None
    except (ValueError, RecursionError) as error:
        raise SceneError(f"it is no glTF file: {str(error)[:200]}", "give a complete .glb or .gltf file", where) from None
    if not document.asset.version.startswith("2."):
        raise SceneError(f"it is glTF {document.asset.version[:20]}", "export it as glTF 2.0", where)
    file = GltfFile(path, raw, document, binary, outside)
    for name in COMPRESSION:
        if name in document.extensions_required:
            raise file.compressed(name)
    return file


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no number of JSON")


def _chunks(data: bytes, where: str) -> tuple[bytes, bytes | None]:
    """The JSON and the bytes of a .glb file."""
    broken = SceneError(f"the .glb file is broken or cut off ({len(data)} bytes)", "copy or export it again", where)
    if len(data) < 20:
        raise broken
    _, version, length = struct.unpack_from("<III", data)
    if version != 2:
        raise SceneError(f"it is version {version} of .glb", "export it as glTF 2.0", where)
    chunks: dict[int, bytes] = {}
    place = 12
    if length > len(data):
        raise broken
    while place + 8 <= length:
        size, kind = struct.unpack_from("<II", data, place)
        if place + 8 + size > length:
            raise broken
        chunks.setdefault(kind, data[place + 8 : place + 8 + size])
        place += 8 + size
    if JSON_CHUNK not in chunks:
        raise broken
    return chunks[JSON_CHUNK], chunks.get(BINARY_CHUNK)


class Builder:
    """A file that is being written: its JSON, and bytes that grow at the end of buffer 0."""

    def __init__(self, tree: dict[str, Any], binary: bytes = b"") -> None:
        """Begin with JSON and the bytes of its buffer 0."""
        self.tree = tree
        self.parts = [binary]
        self.length = len(binary)

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        """Append an entry to a list of the file and return its index."""
        entries = self.tree.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def view(self, data: bytes, **more: Any) -> int:
        """Append bytes as a buffer view and return its index."""
        padding = -self.length % 4
        self.parts += [b"\0" * padding, data]
        self.length += padding
        index = self.add("bufferViews", {"buffer": 0, "byteOffset": self.length, "byteLength": len(data), **more})
        self.length += len(data)
        return index

    def array(self, values: np.ndarray, kind: str, *, bounds: bool = False, target: int | None = None) -> int:
        """Append an accessor, float32 or uint32, and return its index; target: 34962 of vertices, 34963 of indices."""
        data = np.ascontiguousarray(values, np.uint32 if values.dtype.kind in "iu" else np.float32)
        entry: dict[str, Any] = {"bufferView": self.view(data.tobytes(), **({"target": target} if target else {}))}
        entry |= {"componentType": 5125 if data.dtype.kind == "u" else 5126, "count": len(data), "type": kind}
        if bounds:
            flat = data.reshape(len(data), -1)
            entry |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        return self.add("accessors", entry)

    def write(self, path: Path) -> None:
        """Write the file: .glb, or .gltf with its bytes inside as base64."""
        data = b"".join(self.parts)
        buffers = self.tree.pop("buffers", [])
        if path.suffix == ".gltf":
            uri = {"uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}
            text = self._text([{"byteLength": len(data), **uri}, *buffers[1:]] if data else buffers)
            path.write_bytes(text)
            return
        text = self._text([{"byteLength": len(data)}, *buffers[1:]] if data else buffers)
        text += b" " * (-len(text) % 4)
        data += b"\0" * (-len(data) % 4)
        chunks = struct.pack("<II", len(text), JSON_CHUNK) + text
        if data:
            chunks += struct.pack("<II", len(data), BINARY_CHUNK) + data
        path.write_bytes(struct.pack("<III", MAGIC, 2, 12 + len(chunks)) + chunks)

    def _text(self, buffers: list[dict[str, Any]]) -> bytes:
        tree = self.tree | ({"buffers": buffers} if buffers else {})
        return json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
