"""Files that are there as a whole or not at all, and files of meshes."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from rigidimpulse.core.errors import SceneError

try:
    import fcntl
except ImportError:  # no POSIX
    fcntl = None

if TYPE_CHECKING:
    from trimesh import Trimesh


def write_renamed(path: Path, write: Callable[[Path], object]) -> Path:
    """Write to a temporary name beside the target, then rename: nobody ever sees half a file. Returns the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        write(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def remove_left_over(path: Path) -> None:
    """Remove the temporary files that processes which are gone have left beside the target of `write_renamed`."""
    if fcntl is None:  # elsewhere asking for a process may end it
        return
    for left in path.parent.glob(f".{glob.escape(path.stem)}.*{glob.escape(path.suffix)}"):
        process = left.name.removeprefix(f".{path.stem}.").removesuffix(path.suffix)
        if process.isascii() and process.isdigit() and not _is_alive(int(process)) and not _is_locked(left):
            left.unlink(missing_ok=True)


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


def load_mesh(path: Path, where: str) -> Trimesh:
    """Load a file of any format that trimesh reads as one mesh; a `SceneError` says why not, and `where`."""
    if not path.is_file():
        reason = "it is a folder" if path.is_dir() else "there is no such file"
        raise SceneError(f"{reason} (looked for {path.absolute()})", "check the path", where)
    import trimesh

    try:
        # `process=False` keeps trimesh from joining vertices by an absolute distance, which would spoil small meshes.
        scene = trimesh.load_scene(str(path), process=False)
        mesh = scene.to_mesh()
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
    if len(getattr(mesh, "faces", ())) == 0:
        raise SceneError("there are no triangles in it", "export the surface as triangles", where)
    return mesh
