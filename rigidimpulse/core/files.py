"""Files that are there as a whole or not at all, and files of meshes."""

from __future__ import annotations

import glob
import hashlib
import os
import platform
import secrets
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.mesh_colors import colors_of_trimesh, joined_colors

try:
    import fcntl
except ImportError:  # no POSIX
    fcntl = None

TOKEN = 8
"""Characters of each mark in a temporary name."""
LONGEST_REASON = 200
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""A spreadsheet takes a cell that begins so for a formula."""
MOST_UNPACKED, LEAST_UNPACKED = 1032, 64
"""zlib packs no more bytes than this into one, and into an empty block."""


def write_renamed(path: Path, write: Callable[[Path], object]) -> Path:
    """Write to a temporary name beside the target, then rename: nobody ever sees half a file. Returns the path.

    Raises:
        SceneError: the folder is missing, or the disk takes no file or not all of it.

    """
    check_target(path)
    remove_left_over(path)
    # A name that nobody can guess, so that no link can wait there; threads and machines with the same disk never share one.
    temporary = path.with_name(f".{path.stem}.{_machine()}.{os.getpid()}.{secrets.token_hex(4)}{path.suffix}")
    try:
        write(temporary)
        temporary.replace(path)
    except OSError as error:
        raise unwritable(error, f"file {str(path)!r}") from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
    return path


def check_target(path: Path) -> None:
    """Check that a file of this name can be there.

    Raises:
        SceneError: its folder is missing, it is a folder itself, or the name is none.

    """
    where = f"file {str(path)!r}"
    try:
        os.fsencode(path)
    except ValueError:
        raise SceneError("its name has letters that are none", "give another name", where) from None
    if "\0" in str(path):
        raise SceneError("its name has a NUL in it", "give another name", where)
    if not path.parent.is_dir():
        raise SceneError(f"there is no folder {str(path.parent)!r}", "make the folder, or correct the path", where)
    if path.is_dir():
        raise SceneError("it is a folder", "give the name of a file", where)


def unwritable(error: Exception, where: str, remedy: str = "make space or give another folder, and write it again") -> SceneError:
    """Return the `SceneError` for a file that the disk does not take; `where` names the file."""
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return SceneError(f"it cannot be written ({reason.splitlines()[0][:LONGEST_REASON]})", remedy, where)


def plain_cell(text: str) -> str:
    """Return a text for a cell of a .csv table: an apostrophe stands before one that a spreadsheet would compute, if it is no number.

    Source: OWASP, CSV Injection.
    """
    try:
        float(text)
    except ValueError:
        return f"'{text}" if text.lstrip(" ").startswith(FORMULA) else text
    return text


def make_folder(folder: Path) -> None:
    """Make a folder for several files, and those above it, if they are missing.

    Raises:
        SceneError: the disk does not take it, or there is a file of that name.

    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SceneError(f"it cannot be made ({reason})", "give another folder", f"folder {str(folder)!r}") from None


def remove_left_over(path: Path) -> None:
    """Remove the temporary files that processes of this machine which are gone have left beside the target of `write_renamed`."""
    if fcntl is None:  # elsewhere asking for a process may end it
        return
    head = f".{path.stem}.{_machine()}."
    for left in path.parent.glob(f"{glob.escape(head)}*{glob.escape(path.suffix)}"):
        process, _, token = left.name.removeprefix(head).removesuffix(path.suffix).partition(".")
        if len(token) == TOKEN and process.isascii() and process.isdigit() and not _is_alive(int(process)) and not _is_locked(left):
            with suppress(OSError):  # another run may be as quick
                left.unlink(missing_ok=True)


@cache
def _machine() -> str:
    """Return a mark of this machine: numbers of processes mean something on their own machine only."""
    return hashlib.sha256(platform.node().encode()).hexdigest()[:TOKEN]


def _is_alive(process: int) -> bool:
    """Whether there is a process of this number."""
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    return True


def _is_locked(path: Path) -> bool:
    """Whether a process holds the file, as one on another machine with the same disk may."""
    assert fcntl is not None
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    return False


class LoadedMesh(NamedTuple):
    """Triangles of a file: vertices (v, 3), faces (f, 3), and colours (f, 3, 3) of their corners in [0, 1], if they have some."""

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray | None


def load_mesh(path: Path, where: str) -> LoadedMesh:
    """Load a file of any format that trimesh reads as one mesh; a `SceneError` says why not, and `where`."""
    if not path.is_file():
        reason = "it is a folder" if path.is_dir() else "there is no such file"
        raise SceneError(f"{reason} (looked for {path.absolute()})", "check the path", where)
    import trimesh

    if not hasattr(trimesh, "load_scene"):
        raise SceneError(f"trimesh {trimesh.__version__} is too old to read it", "pip install --upgrade trimesh (4.6 or newer)", where)
    try:
        # `process=False` keeps trimesh from joining vertices by an absolute distance, which would spoil small meshes.
        scene = trimesh.load_scene(str(path), process=False)
        placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
        # Copies lose colours of vertices beside a material: those of the geometries themselves are read.
        pieces: list[Any] = []
        colors: list[np.ndarray | None] = []
        for piece, (matrix, name) in zip(scene.dump(), placed, strict=True):
            if len(getattr(piece, "faces", ())):
                found = colors_of_trimesh(scene.geometry[name])
                pieces.append(piece)
                colors.append(found[:, ::-1] if found is not None and np.linalg.det(matrix[:3, :3]) < 0.0 else found)
    except ImportError as error:
        raise SceneError(
            f"{path.suffix} files need a package that is missing ({error})", "install it, or convert to .obj", where
        ) from error
    except Exception as error:  # loaders of third parties raise anything on broken files
        raise SceneError(
            f"it could not be read ({type(error).__name__}: {error})",
            "check that it is a complete mesh file and that its suffix says its format, or export it again as .obj",
            where,
        ) from error
    if not pieces:
        raise SceneError("there are no triangles in it", "export the surface as triangles", where)
    starts = np.cumsum([0] + [len(piece.vertices) for piece in pieces[:-1]])
    return LoadedMesh(
        np.concatenate([np.asarray(piece.vertices, np.float64) for piece in pieces]),
        np.concatenate([np.asarray(piece.faces) + start for piece, start in zip(pieces, starts, strict=True)]),
        joined_colors(colors, [len(piece.faces) for piece in pieces]),
    )
