"""Calls in processes of their own: one that hangs, crashes or eats the memory is a failure like others."""

from __future__ import annotations

import multiprocessing
import resource
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

PROCESSES = multiprocessing.get_context("fork")


def apart(work: Callable[..., Any], *arguments: Any, seconds: int, memory: int | None = None) -> Any:
    """What a function returns, or a text that says how its process ended.

    Args:
        work: the function. arguments: its arguments.
        seconds: of processor time, at most. memory: bytes that it may take, beyond what this process has; None: as many as there are.

    """
    receiver, sender = PROCESSES.Pipe(duplex=False)
    process = PROCESSES.Process(target=_answer, args=(sender, work, arguments, seconds, memory))
    process.start()
    sender.close()
    try:
        return receiver.recv()
    except EOFError:
        process.join()
        ended = process.exitcode in (-signal.SIGXCPU, -signal.SIGKILL)
        return f"not done after {seconds} s" if ended else f"crashed, exit code {process.exitcode}"
    finally:
        process.join()


def _answer(sender: Any, work: Callable[..., Any], arguments: tuple, seconds: int, memory: int | None) -> None:
    """Send what the function returns, from a process that the system ends when it takes too much."""
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    if memory is not None:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    sender.send(work(*arguments))
