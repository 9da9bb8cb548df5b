"""The worker's process: it is started, asked, ended, and started again where it does not come back from people's own code."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from time import perf_counter
from typing import Any

from rigidimpulse.studies.live.channel import Channel
from rigidimpulse.studies.live.request import Request

PATIENCE = 3.0
"""s until a worker that does not take a request is ended and another one is started."""
LONG = ("preparing", "compiling")
"""What a worker is not disturbed in: it compiles kernels, once for all runs to come."""
OF_RUN = ("shape", "begin", "softBody", "softFrames", "frames", "impacts", "framing")
"""Kinds of messages that are of one run; others say what the worker does."""
END_TIMEOUT = 5.0
"""Longest wait, s, for a process that was ended."""

Receive = Callable[[int, str, dict[str, Any]], None]


class WorkerProcess:
    """Has runs computed by one process at a time; `receive` is called, in a thread, with number, kind and message."""

    def __init__(self, receive: Receive) -> None:
        """Start the process."""
        self._receive = receive
        self._lock = threading.Lock()
        self._asked: Request | None = None
        self._asked_at, self._closed = 0.0, False
        self._start()

    def _start(self) -> None:
        self._doing, self._reported = "", False
        arguments = [sys.executable, "-m", "rigidimpulse.studies.live.worker"]
        self._process = subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)
        assert self._process.stdin is not None and self._process.stdout is not None
        channel = Channel(self._process.stdout, self._process.stdin)
        self._channel = channel
        threading.Thread(target=self._listen, args=(channel,), daemon=True).start()

    def _listen(self, channel: Channel) -> None:
        while True:
            try:
                number, kind, message = channel.receive()
            except (EOFError, OSError, ValueError):
                return
            if channel is not self._channel:
                return
            with self._lock:
                if kind not in OF_RUN:
                    self._doing = kind
                if self._asked is not None and number >= self._asked.number:
                    self._asked = None
            self._receive(number, kind, message)

    def ask(self, request: Request) -> None:
        """Have a run computed in the place of the one that is under way."""
        if self._process.poll() is not None and not self._closed:
            self._start_again()
        with self._lock:
            self._asked, self._asked_at = request, perf_counter()
        try:
            self._channel.send(request)
        except OSError:
            pass  # it has just ended: `look` finds that

    def look(self) -> str:
        """Start the process again if it does not take a request for `PATIENCE`; return what is wrong with it if it has ended by itself."""
        with self._lock:
            asked, waits = self._asked, perf_counter() - self._asked_at
            stuck = asked is not None and waits > PATIENCE and self._has_answered() and self._doing not in LONG
        if self._closed:
            return ""
        code = self._process.poll()
        if code is not None and not self._reported:
            self._reported = True
            return f"the process that computes has ended by itself (exit code {code})"
        if stuck and asked is not None and code is None:
            self._start_again()
            self.ask(asked)
        return ""

    def _start_again(self) -> None:
        self._end()
        self._start()

    def _has_answered(self) -> bool:
        """Whether the process has said anything yet: one that only starts is given its time."""
        return self._doing != ""

    def _end(self) -> None:
        end_with_children(self._process)
        self._process.wait(END_TIMEOUT)
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                try:
                    stream.close()
                except OSError:
                    pass

    def close(self) -> None:
        """End the process; a second call does nothing."""
        if not self._closed:
            self._closed = True
            self._end()


def end_with_children(process: subprocess.Popen) -> None:
    """End a process and, where the system has sessions, those that it started: they compile kernels for it."""
    try:
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
    except (ProcessLookupError, PermissionError):
        process.kill()
