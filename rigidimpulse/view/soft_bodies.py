"""Flexible bodies on a page.

A page shows a flexible body as one mesh whose vertices are written again for each frame. The manifest's entry names it, a `set_object`
message brings its faces, and a `set_property` message hangs the vertices of all frames on the same node, as float32, frame by frame.
Normals are left to the page: smooth ones follow from the faces.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidimpulse.view.protocol import SoftBodyLike
from rigidimpulse.view.tracks import pack_float32


def is_closed(faces: np.ndarray) -> bool:
    """Whether every edge of the faces (t, 3) belongs to two of them."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    return bool(np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2))


def soft_body_messages(track: SoftBodyLike, number: int) -> list[tuple[str, dict[str, Any]]]:
    """Return the messages of a flexible body for `view.contents`, with their kinds: "soft body" (mesh), "frames" (vertices by frame).

    Raises:
        ValueError: a vertex is not finite.

    """
    from meshcat.geometry import pack_numpy_array

    if not np.isfinite(track.vertices).all():
        raise ValueError(f"flexible body {track.name!r}: a vertex is not finite; look at the status of the run")
    geometry, material, path = f"soft body geometry {number}", f"soft body material {number}", f"/softBodies/{number}"
    attributes = {"position": pack_numpy_array(track.vertices[0].T.astype(np.float32))}
    mesh = {
        "type": "set_object",
        "path": path,
        "object": {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [{
                "uuid": geometry,
                "type": "BufferGeometry",
                "data": {"attributes": attributes, "index": pack_numpy_array(track.faces.T.astype(np.uint32))},
            }],
            "materials": [{"uuid": material, "type": "MeshBasicMaterial", "side": 2}],
            "object": {"uuid": f"soft body {number}", "type": "Mesh", "geometry": geometry, "material": material},
        },
    }  # fmt: skip
    frames = {"type": "set_property", "path": path, "property": "frames", "value": pack_float32(track.vertices)}
    return [("soft body", mesh), ("frames", frames)]
