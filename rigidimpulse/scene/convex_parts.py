"""Convex decomposition: a mesh as a few convex hulls that together are nearly the same solid.

A mesh is cut by planes until no piece is more concave than asked, as CoACD does: Wei, Liu, Ling and Su, Approximate convex decomposition
for 3D meshes with collision-aware concavity and tree search, ACM Trans. Graph. 41(4), 2022. The concavity of a piece is the largest
distance between points of it and of its hull, in and on both, over half of the longest side of the mesh.

Cutting takes seconds. So the hulls are kept in a folder of the user's cache, by a digest of the mesh and the settings.
"""

from __future__ import annotations

import os
import tempfile
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidimpulse.core.errors import SceneError

if TYPE_CHECKING:
    from rigidimpulse.scene.surface import Surface

FOLDER = "rigidimpulse/convex_parts"
LEAST, MOST = 0.01, 1.0
"""Concavities that CoACD takes."""
CORNERS = 64
"""Most corners of a hull: kernels try all of them."""
SEED = 0
CONVEX: float = 1e-9
"""Part of the size by which corners may stand out in front of the faces of a mesh that is one convex part."""


def hulls_of(surface: Surface, label: str, concavity: float, most: int | None) -> list[np.ndarray]:
    """Corners (v, 3) m of the hulls of a mesh, see `Shape.convex_parts`; none where the mesh is convex. label: what messages call it.

    Raises:
        SceneError: as there.

    """
    if not LEAST <= concavity <= MOST:
        raise SceneError(f"concavity is {concavity}", f"give a part of the size from {LEAST} to {MOST:g}", label)
    if most is not None and most < 1:
        raise SceneError(f"most is {most}", "give a number of parts, at least 1, or None", label)
    if surface.num_open_edges:
        raise SceneError(
            f"it is open ({surface.num_open_edges} of its edges lack a second face), so it has no inside to be cut into parts",
            "close it, or use it as it is", label,
        )  # fmt: skip
    if _is_convex(surface):
        return []
    library = _library(label)
    number = -1 if most is None else most
    settings = f"{concavity!r} {number} {CORNERS} {SEED}"
    digest = blake2b(settings.encode() + surface.vertices.tobytes() + surface.faces.tobytes(), digest_size=16).hexdigest()
    kept = _folder() / f"{digest}.npz"
    found = _read(kept)
    if found is None:
        mesh = library.Mesh(surface.vertices, surface.faces)
        cut = library.run_coacd(
            mesh, threshold=concavity, max_convex_hull=number, decimate=True, max_ch_vertex=CORNERS, seed=SEED
        )  # fmt: skip
        found = [np.array(corners, float) for corners, _ in cut]
        _write(kept, found)
    return found


def _is_convex(surface: Surface) -> bool:
    """Whether no corner stands out in front of a face."""
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]
    offsets, size = np.einsum("ij,ij->i", normals, a), float(np.ptp(surface.vertices, axis=0).max())
    # Few faces at once: the first ones tell of most meshes that they are not convex.
    return all(
        float((surface.vertices @ normals[first : first + 64].T - offsets[first : first + 64]).max()) <= CONVEX * size
        for first in range(0, len(normals), 64)
    )


def _library(label: str) -> Any:
    """CoACD, without its messages."""
    try:
        import coacd
    except ImportError as error:
        raise SceneError(f"convex parts need the package coacd ({error})", "pip install 'rigidimpulse[parts]'", label) from None
    coacd.set_log_level("error")
    return coacd


def _folder() -> Path:
    """Where hulls are kept."""
    return Path(os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or os.path.expanduser("~/.cache")) / FOLDER


def _read(path: Path) -> list[np.ndarray] | None:
    """Hulls that were kept; None if there are none, or none that can be read."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return [arrays[f"arr_{k}"] for k in range(len(arrays.files))] or None
    except (OSError, ValueError, KeyError, EOFError):
        return None


def _write(path: Path, hulls: list[np.ndarray]) -> None:
    """Keep hulls; where nothing can be written they are found again the next time."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Another process may be writing the same: each writes a file of its own, which takes its place at once.
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".npz", delete=False) as file:
            np.savez(file, *hulls)
        os.replace(file.name, path)
    except OSError:
        return
