"""The kernels that a first run of rigid bodies may call, compiled before it. Those of flexible bodies and of the penalty method are not.

Each part (see `warm_up_parts.py`) is compiled in a process of its own, several at a time on all cores. A note beside the kernels
says that a part is done; its name has the digest of all sources that a part is compiled from. A part without a note whose kernels lie in
the cache, because runs have compiled them, takes some seconds.
"""

from __future__ import annotations

import math
import os
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, sleep
from typing import IO

from rigidimpulse.core.kernel_cache import note_beside, source_digest
from rigidimpulse.core.kernels import INTERPRETED
from rigidimpulse.engine.warm_up import (
    ANY_SHAPES,
    CONTACTS,
    EVENTS,
    JOINTS,
    LOOP,
    NUMBER_OF_PARTS,
    SECONDS,
    STEPPED_JOINTS,
    SUBSTEPPED,
    UNDER_FORCES,
    start_process,
)

PARTS = Path(__file__).with_name("warm_up_parts.py")
LOOK = 0.1
"""s between two looks at the processes."""
LOOP_SECONDS = 90
"""s that compiling the order of events takes, about, on one core."""


@dataclass(frozen=True)
class KernelPart:
    """What one process compiles: a kind, and the number of its part."""

    kind: str
    number: int = 0

    @property
    def seconds(self) -> float:
        """How long that takes, s, about."""
        return LOOP_SECONDS if self.kind == LOOP else SECONDS[self.kind] / NUMBER_OF_PARTS[self.kind]

    def __str__(self) -> str:
        """Return its kind."""
        return self.kind

    def note(self) -> Path:
        """The file that says that it is compiled."""
        words = [source_digest(PARTS), self.kind, str(self.number)]
        return note_beside(start_process, "-".join(words).replace(" ", "_"))


@dataclass(frozen=True)
class Failed:
    """A part whose process failed, and the last line that it said."""

    part: KernelPart
    reason: str


ORDER = (CONTACTS, SUBSTEPPED, JOINTS, STEPPED_JOINTS, ANY_SHAPES, UNDER_FORCES, EVENTS)
ALL_PARTS = (
    *(KernelPart(kind, number) for kind in ORDER for number in range(NUMBER_OF_PARTS[kind])),
    KernelPart(LOOP),
)
"""All there are. The order of events comes last: runs go without it."""


def missing_parts() -> list[KernelPart]:
    """Parts that are not compiled yet on this machine, for these sources."""
    return [] if INTERPRETED else [part for part in ALL_PARTS if not part.note().exists()]


def seconds_for(parts: Sequence[KernelPart], processes: int) -> float:
    """How long compiling parts takes with this number of processes, s, about."""
    return max(sum(part.seconds for part in parts) / processes, max((part.seconds for part in parts), default=0.0))


def compile_parts(parts: Sequence[KernelPart], processes: int, progress: Callable[[float], None]) -> list[Failed]:
    """Compile parts in processes of their own; when this is left, by an exception too, none of them is there any more.

    Args:
        parts: what to compile.
        processes: how many at a time.
        progress: called several times a second with what is done, about: a part of 1.

    Returns:
        The parts that could not be compiled.

    """
    left, running, failed = list(parts), [], []
    total, done = sum(part.seconds for part in parts), 0.0
    with ExitStack() as stack:
        while left or running:
            while left and len(running) < processes:
                running.append(stack.enter_context(_Compiling(left.pop(0))))
            sleep(LOOK)
            for compiling in [each for each in running if each.process.poll() is not None]:
                running.remove(compiling)
                done += compiling.part.seconds
                if compiling.process.returncode == 0:
                    compiling.part.note().touch()
                else:
                    failed.append(Failed(compiling.part, compiling.last_line()))
            progress((done + sum(each.estimate() for each in running)) / total)
    return failed


class _Compiling:
    """A part that is being compiled: its process ends with the context."""

    def __init__(self, part: KernelPart) -> None:
        self.part = part
        self._begin = perf_counter()
        self._said: IO[bytes] = tempfile.TemporaryFile()
        self.process: subprocess.Popen = start_process(part.kind, str(part.number), errors=self._said)

    def __enter__(self) -> _Compiling:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._said.close()

    def estimate(self) -> float:
        """What of its seconds is done, about: never all of them."""
        return self.part.seconds * (1.0 - math.exp(-(perf_counter() - self._begin) / self.part.seconds))

    def last_line(self) -> str:
        """The last line that the process said, or how it ended."""
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"its process ended with {self.process.returncode}"


def most_processes() -> int:
    """How many parts this process may have compiled at a time."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
