"""Work that one process at a time does: it holds a lock on a file, which the system lets go when the process ends, however it ends."""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

try:
    import fcntl
except ImportError:  # systems without it
    _LOCKS: Any = None
else:
    _LOCKS = fcntl


def claim(path: Path) -> IO[bytes] | None:
    """Lock a file for this process, until what is returned is closed; None where another process has it.

    Raises:
        OSError: the file cannot be made.

    """
    file = path.open("ab")
    if _LOCKS is not None:
        try:
            _LOCKS.flock(file, _LOCKS.LOCK_EX | _LOCKS.LOCK_NB)
        except OSError:
            file.close()
            return None
    return file
