"""What a scene keeps of the glTF file that it was read from, so that motion can be written into that file."""

from __future__ import annotations

import copy
import mimetypes
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.gltf.animation import Animations
from rigidimpulse.io.gltf.container import Builder
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.origin import FileOrigin


@dataclass(frozen=True)
class Origin(FileOrigin):
    """A glTF file and what became of it.

    Attributes:
        animations: the hierarchy and the animated nodes; its file is the one read.
        node_of: node of each body, by name. parts: names of bodies that are welded to another and have no node.

    """

    animations: Animations
    node_of: dict[str, int]
    parts: frozenset[str]

    def check_target(self, path: Path) -> None:
        """See `FileOrigin`: motion is written into a copy of this file."""
        if self.animations.hierarchy.file.path.resolve() == path.resolve():
            raise SceneError(f"{path.name!r} is the file that the scene comes from", "give another name: the file stays as it is")

    def as_seen(self, bodies: list[Body]) -> list[Body]:
        """Return bodies with the meshes of their nodes as visuals."""
        from rigidimpulse.io.gltf.looks import as_in_file

        return as_in_file(bodies, self.node_of, self.animations.hierarchy)

    def builder(self) -> Builder:
        """Return a copy of the file to write into: all bytes and images in buffer 0."""
        file = self.animations.hierarchy.file
        tree: dict[str, Any] = copy.deepcopy(file.raw)
        starts, data = [], bytearray()
        for index in range(len(file.document.buffers)):
            data += b"\0" * (-len(data) % 4)
            starts.append(len(data))
            data += file.buffer(index)
        for view in tree.get("bufferViews", []):
            view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
            view["buffer"] = 0
        tree.pop("buffers", None)
        builder = Builder(tree, bytes(data))
        for index, image in enumerate(tree.get("images", [])):
            uri = image.get("uri") if isinstance(image, dict) else None
            if isinstance(uri, str):
                kind = uri[5:].split(";")[0] if uri.startswith("data:") else mimetypes.guess_type(uri)[0]
                image["bufferView"] = builder.view(file.bytes_at(uri, f"image {index}"))
                image["mimeType"] = kind or "image/png"
                del image["uri"]
        return builder
