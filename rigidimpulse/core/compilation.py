"""Whether kernels are being compiled: numba says when it begins and when it ends (`numba.core.event`, in its manual for developers)."""

from __future__ import annotations

from collections.abc import Callable

from numba.core import event


class CompilationListener(event.Listener):
    """Tells when the first of some kernels, which compile each other, begins to be compiled, and when the last one is."""

    def __init__(self, tell: Callable[[bool], None]) -> None:
        """tell: called with True at the beginning and with False at the end."""
        self._tell, self._depth = tell, 0

    def on_start(self, event: event.Event) -> None:
        """One more."""
        self._depth += 1
        if self._depth == 1:
            self._tell(True)

    def on_end(self, event: event.Event) -> None:
        """One less."""
        self._depth -= 1
        if self._depth == 0:
            self._tell(False)


def watch_compilation(tell: Callable[[bool], None]) -> None:
    """Have `tell` called with True when kernels begin to be compiled in this process, and with False when that is over."""
    event.register("numba:compile", CompilationListener(tell))
