"""Files that a file names: they lie in the folder of the file that was asked for, or below it, unless the caller allows others."""

from __future__ import annotations

import ntpath
from pathlib import Path

from rigidimpulse.core.errors import SceneError


def named_file(folder: Path, name: str, allow_outside: bool, where: str, found: Path | None = None) -> Path:
    """Return the path of a file that another one names; whether there is one is not looked at.

    Args:
        folder: of the file that was asked for. name: as it is written. allow_outside: whether it may lie outside the folder.
        where: what names it, for messages. found: where the rules of the format find it, by default that path in the folder.

    Raises:
        SceneError: the path is absolute, leaves the folder, also by a link, or can be no path.

    """
    place = folder / name if found is None else found
    try:
        is_inside = place.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError) as error:
        raise SceneError(f"{name!r} is no path of a file ({error})", "correct the name", where) from None
    if allow_outside:
        return place
    drive, rest = ntpath.splitdrive(name)  # absolute on other systems, too: what a file may name is the same everywhere
    if drive or rest.startswith(("/", "\\")):
        raise SceneError(f"it names {name!r}, an absolute path", "name it by its path in the folder, or give allow_outside=True", where)
    if not is_inside:
        raise SceneError(f"it names {name!r}, which lies outside the folder", "move it there, or give allow_outside=True", where)
    return place
