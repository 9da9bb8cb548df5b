"""The kernels that a first run of rigid bodies may call, compiled before it. Those of flexible bodies and of the penalty method are not.

They are compiled in parts (see `warm_up_parts.py`) by several processes, each of which takes one part after the other. A note beside the
kernels says that a part is done; its name has the digest of all sources that a part is compiled from. A part without a note whose kernels
lie in the cache, because runs have compiled them, takes some seconds.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from time import perf_counter, sleep

from rigidimpulse.core.kernels import INTERPRETED
from rigidimpulse.engine.warm_up import (
    ANY_SHAPES,
    CONTACTS,
    EVENTS,
    JOINED_UNDER_FORCES,
    JOINTS,
    LOOP,
    POLYHEDRA,
    SHARED,
    STEPPED_JOINTS,
    SUBSTEPPED,
    UNDER_FORCES,
    KernelPart,
    parts_of,
    start_process,
)

LOOK = 0.1
"""s between two looks at the processes."""
ALL_PARTS = tuple(
    parts_of(
        (CONTACTS, LOOP, ANY_SHAPES, STEPPED_JOINTS, POLYHEDRA, SHARED, SUBSTEPPED, JOINTS, EVENTS, UNDER_FORCES, JOINED_UNDER_FORCES)
    )
)
"""All there are; those that take long come first, so that at the end no process works alone for long."""


@dataclass(frozen=True)
class Failed:
    """A part that is not compiled, and why."""

    part: KernelPart
    reason: str


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
    number = min(processes, len(parts))
    with ExitStack() as stack:
        said = stack.enter_context(tempfile.TemporaryFile())
        workers = [start_process(parts, errors=said) for _ in range(number)]
        for worker in workers:
            stack.callback(worker.wait)
            stack.callback(worker.kill)
        estimate = _Estimate(parts, number)
        while any(worker.poll() is None for worker in workers):
            sleep(LOOK)
            progress(estimate.done())
        progress(1.0)
        said.seek(0)
        lines = said.read().decode(errors="replace").strip().splitlines()
    codes = [worker.returncode for worker in workers]
    return [Failed(part, _reason(part, lines, codes)) for part in parts if not part.note().exists()]


def _reason(part: KernelPart, lines: list[str], codes: list[int]) -> str:
    """Why a part is not compiled: what was said of it, or the last line that is of no part, or how processes ended."""
    of_part = [line.removeprefix(f"{part}: ") for line in lines if line.startswith(f"{part}: ")]
    of_none = [line for line in lines if not any(line.startswith(f"{each}: ") for each in ALL_PARTS)]
    return next(iter([*of_part, *of_none[-1:], f"processes ended with {', '.join(map(str, codes))}"]))


class _Estimate:
    """How far compiling is."""

    def __init__(self, parts: Sequence[KernelPart], processes: int) -> None:
        self._parts, self._processes = parts, processes
        self._most, self._number_left, self._since = 0.0, len(parts), perf_counter()

    def done(self) -> float:
        """What is done, a part of 1; it never falls. Of parts in work it counts what their time tells, and never all of them."""
        left = [part for part in self._parts if not part.note().exists()]
        if len(left) != self._number_left:
            self._number_left, self._since = len(left), perf_counter()
        elapsed = perf_counter() - self._since
        open_yet = sum(part.seconds for part in left)
        open_yet -= sum(part.seconds * (1.0 - math.exp(-elapsed / part.seconds)) for part in left[: self._processes])
        self._most = max(self._most, 1.0 - open_yet / sum(part.seconds for part in self._parts))
        return self._most
