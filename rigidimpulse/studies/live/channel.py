"""Messages between the process that shows a scene and the one that computes it: pickled, each with its length before it, through pipes."""

from __future__ import annotations

import pickle
import struct
import threading
from typing import IO, Any

LENGTH = struct.Struct("<Q")


class Channel:
    """Both ends of a pair of pipes; `send` may be called from any thread, `receive` from one."""

    def __init__(self, incoming: IO[bytes], outgoing: IO[bytes]) -> None:
        """Take over two binary streams."""
        self._incoming, self._outgoing = incoming, outgoing
        self._lock = threading.Lock()

    def send(self, message: Any) -> None:
        """Send a message; raises OSError if the other end is gone."""
        data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
        with self._lock:
            self._outgoing.write(LENGTH.pack(len(data)) + data)
            self._outgoing.flush()

    def receive(self) -> Any:
        """Wait for the next message; raises EOFError if the other end is gone."""
        (length,) = LENGTH.unpack(self._read(LENGTH.size))
        return pickle.loads(self._read(length))

    def _read(self, size: int) -> bytes:
        data = self._incoming.read(size)
        if data is None or len(data) < size:
            raise EOFError("the other end is gone")
        return data
