"""Runs that end before their time: by Ctrl-C, or because there is no more memory.

The first Ctrl-C ends the run after the step that it is in, or the steps that a kernel takes at once: what was computed until then is whole.
The second ends it at once, as everywhere. Only the main thread of a program hears of Ctrl-C. A program that deals with it in its own way
keeps its own way.
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from rigidimpulse.core.errors import SceneError

logger = logging.getLogger("rigidimpulse")


class Stopped(Exception):
    """The run is to end before its time. It is between two steps."""


class _Interruption:
    """Whether the run is asked to stop."""

    def __init__(self, progress: Callable[[float], None] | None) -> None:
        """It is not yet; progress: is called after each step."""
        self._asked, self._progress = False, progress

    def hear(self, number: int, frame: FrameType | None) -> None:
        """Take a signal."""
        if self._asked:
            signal.default_int_handler(number, frame)
        self._asked = True
        logger.warning("Ctrl-C: the run ends after this step; once more ends it at once, without a result")

    def look(self, time: float) -> None:
        """Raise `Stopped` if the run is to end at `time` [s]."""
        try:
            if self._progress is not None:
                self._progress(time)
        except KeyboardInterrupt:
            raise Stopped from None
        if self._asked:
            raise Stopped


@contextmanager
def interruptible(progress: Callable[[float], None] | None) -> Iterator[Callable[[float], None]]:
    """Hear Ctrl-C; give what is to be called after each step in the place of `progress`, and may raise `Stopped`."""
    interruption = _Interruption(progress)
    is_free = threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_free:
        signal.signal(signal.SIGINT, interruption.hear)
    try:
        yield interruption.look
    finally:
        if is_free:
            signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def memory_told(num_frames: int, num_bodies: int) -> Iterator[None]:
    """Turn a lack of memory into a `SceneError` that says what the run asks for."""
    try:
        yield
    except MemoryError:
        raise SceneError(
            f"there is not enough memory for {num_frames} frames of {num_bodies} bodies",
            "lower the fps or the duration, use simpler meshes, or close programs; a run with a cache goes on from its last checkpoint",
        ) from None
