"""The file below an HDF5 file that is written.

HDF5 reports an error of the disk that it meets while it closes a table as text on the error stream, and may end the process. So it is
given a file object whose writes always succeed: the first error is kept here, what comes after it is dropped, and `check` raises the error.
"""

from __future__ import annotations

import io
import os
from pathlib import Path

try:
    import fcntl
except ImportError:  # no POSIX
    fcntl = None


class Disk:
    """A file that only this process writes to, as HDF5 asks for one."""

    def __init__(self, path: Path, *, new: bool) -> None:
        """Open a file; new: an empty one.

        Raises:
            OSError: that cannot be done. BlockingIOError: another process has locked it, or reads it with a lock.

        """
        self._file = path.open("x+b" if new else "r+b", buffering=0)
        self._error: OSError | None = None
        try:
            if fcntl is not None:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise
        except OSError:
            pass  # a disk without locks

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a byte; see `io.IOBase`."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Return the number of the next byte."""
        return self._file.tell()

    def read(self, size: int = -1) -> bytes:
        """Return the next bytes; h5py knows a file object by this."""
        return self._file.read(size) or b""

    def readinto(self, buffer: memoryview) -> int:
        """Fill a buffer from the file; return the number of bytes."""
        count, view = 0, memoryview(buffer).cast("B")
        while count < len(view) and (more := self._file.readinto(view[count:])):
            count += more
        return count

    def write(self, data: memoryview) -> int:
        """Write all bytes, or keep the error."""
        view, done = memoryview(data).cast("B"), 0
        try:
            while self._error is None and done < len(view):
                done += self._file.write(view[done:]) or 0
        except OSError as error:
            self._error = error
        return len(view)

    def truncate(self, size: int) -> int:
        """Make the file as long as that, or keep the error."""
        try:
            if self._error is None:
                self._file.truncate(size)
        except OSError as error:
            self._error = error
        return size

    def flush(self) -> None:
        """Nothing waits here: see `sync`."""

    def check(self) -> None:
        """Raise the OSError of the first thing that the disk did not take."""
        if self._error is not None:
            raise self._error

    def sync(self) -> None:
        """Have all that was written on disk.

        Raises:
            OSError: the disk does not take it.

        """
        self.check()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file, and let go of its lock."""
        self._file.close()
