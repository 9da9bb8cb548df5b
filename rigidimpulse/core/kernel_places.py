"""Folders that compiled kernels may lie in: one that this process writes to, and others that it only reads.

A compiled kernel is code: who can write to the folder runs programs as whoever reads it. So a folder is used only if no other user can
write to it: it belongs to this user, to the administrator, or to whoever has installed the package. A folder that the user has named for
numba (`NUMBA_CACHE_DIR`) is used as it is, as numba itself uses it: that is how several users share one.
"""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parent.parent
OF_THIS_PROCESS = "rigidimpulse_kernels_"
"""Begins the name of a folder that other processes do not know of."""
NAME = "rigidimpulse_kernels"
FOR_ALL_TO_READ = 0o755


def others_can_write(folder: Path) -> bool:
    """Whether users who are neither this one, nor the administrator, nor the owner of the package can put files into a folder."""
    if os.name == "nt":  # There folders of a user are his own, and no bits say more.
        return False
    status = folder.stat()
    return status.st_uid not in (0, os.geteuid(), PACKAGE.stat().st_uid) or bool(status.st_mode & stat.S_IWOTH)


def _is_safe(root: Path) -> bool:
    """Whether others can neither write to a folder, nor put another one in its place."""
    return not (others_can_write(root) or others_can_write(root.parent))


def _roots(chosen: str) -> list[tuple[Path, bool]]:
    """Folders that may hold kernels, the first before the others, and whether the user has named it for numba."""
    of_user = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or os.path.expanduser("~/.cache")
    named = [(Path(chosen), True)] if chosen else []
    # Of a user without a home, nothing is left but the "~".
    homes = [] if of_user.startswith("~") else [(Path(of_user), False)]
    return [(place / NAME, by_user) for place, by_user in (*named, (PACKAGE / "__pycache__", False), *homes)]


@cache
def writable_root(chosen: str) -> Path:
    """Return the folder that this process writes kernels to: of those that it can, what is chosen, the package's, or the user's.

    chosen: what the user has named for numba, "" for nothing. Where there is none, it is a folder that goes when the process ends.
    """
    for root, by_user in _roots(chosen):
        try:
            root.parent.mkdir(parents=True, exist_ok=True)
            root.mkdir(FOR_ALL_TO_READ, exist_ok=True)
            tempfile.TemporaryFile(dir=root).close()
            if by_user or _is_safe(root):
                return root
        except OSError:
            continue
    made, process = Path(tempfile.mkdtemp(prefix=OF_THIS_PROCESS)), os.getpid()
    atexit.register(lambda: os.getpid() == process and shutil.rmtree(made, ignore_errors=True))
    root = made / NAME
    root.mkdir()
    return root


@cache
def other_roots(chosen: str) -> tuple[Path, ...]:
    """Return the folders that this process only reads kernels from: an administrator may have compiled them for all users."""
    found = []
    for root, by_user in _roots(chosen):
        try:
            if root != writable_root(chosen) and root.is_dir() and (by_user or _is_safe(root)):
                found.append(root)
        except OSError:
            continue
    return tuple(found)
