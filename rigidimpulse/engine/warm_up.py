"""The first run on a machine: compile kernels on all cores.

Numba compiles one kernel at a time in a process. So the kernels of each kind that a run needs and that are not in the cache on disk are
compiled in parts (`warm_up_parts.py`), by this process and by others, on all cores. Each of them takes one part after the other
that nobody has taken: kernels are made of smaller ones, and what a process has compiled for one part need not be compiled for its next.

The order of events of exact contact (`exact/event_loop.py`) takes about a minute to compile, and runs without it give the same bits. So
nobody waits for it: a process of its own compiles it beside the first runs and after them, and puts it into the cache.

Nothing is compiled twice where two first runs begin at once: the second waits for the first, and finds its kernels in the cache.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from rigidimpulse.core.claim import claim
from rigidimpulse.core.kernel_cache import CLAIM, is_kept, note_beside, source_digest, variables_to_share_kernels
from rigidimpulse.core.kernels import Kernel, number_of_cores
from rigidimpulse.model.world import World

logger = logging.getLogger("rigidimpulse")
LOOP = "order of events"
CONTACTS, EVENTS, SUBSTEPPED, JOINTS = "contacts", "impacts of balls", "sub-stepped islands", "joints"
POLYHEDRA, SHARED = "convex polyhedra in sub-stepped islands", "sub-stepped islands on several cores"
STEPPED_JOINTS, ANY_SHAPES = "joints in sub-stepped islands", "any shapes in sub-stepped islands"
UNDER_FORCES, JOINED_UNDER_FORCES = "contacts under varying forces", "joints under varying forces"
LAST = {
    CONTACTS: ("engine.touching", "find_touching"),
    EVENTS: ("engine.spheres.flight", "fly"),
    SUBSTEPPED: ("engine.sleeping", "advance_sleep_timers"),
    POLYHEDRA: ("engine.substepped.stages", "go_on_with_polyhedra"),
    JOINTS: ("dynamics.constraints.joint_sub_step", "close_at_end"),
    STEPPED_JOINTS: ("dynamics.solvers.time_stepping.solver", "step_island"),
    ANY_SHAPES: ("engine.substepped.stages", "go_on"),
    SHARED: ("engine.substepped.stages", "work_on"),
    UNDER_FORCES: ("dynamics.constraints.contact", "hold_contacts"),
    JOINED_UNDER_FORCES: ("dynamics.constraints.joint_flight", "take_stage"),
}
"""The kernel of each kind that is compiled last."""
_BACKGROUND: list[subprocess.Popen] = []
"""Processes that nobody waits for."""
PARTS_MODULE = "rigidimpulse.engine.warm_up_parts"
SECONDS = {
    CONTACTS: 60, EVENTS: 20, SUBSTEPPED: 15, POLYHEDRA: 30, SHARED: 25, JOINTS: 40, STEPPED_JOINTS: 40, ANY_SHAPES: 50,
    UNDER_FORCES: 15, JOINED_UNDER_FORCES: 15, LOOP: 70,
}  # fmt: skip
"""s that compiling each kind takes, about, on two threads of one core."""
LONGEST_WAIT, LOOK_AGAIN = 10.0, 0.2
"""How many times as long as compiling takes a process waits for another one that compiles; s, how often it looks whether that has ended."""
MANY_BODIES = 100
"""Bodies of which several cores may share the work."""
NUMBER_OF_PARTS = dict.fromkeys(SECONDS, 1) | {CONTACTS: 3, JOINTS: 4}


@dataclass(frozen=True)
class KernelPart:
    """What is compiled at once: a kind, and the number of its part."""

    kind: str
    number: int = 0

    @property
    def seconds(self) -> float:
        """How long that takes, s, about."""
        return SECONDS[self.kind] / NUMBER_OF_PARTS[self.kind]

    def __str__(self) -> str:
        """Return its kind and number."""
        return f"{self.kind} {self.number}"

    def note(self) -> Path:
        """The file that says that it is compiled."""
        words = [source_digest(Path(__file__).with_name("warm_up_parts.py")), self.kind, str(self.number)]
        return note_beside(prepare_kernels, "-".join(words).replace(" ", "_"))

    def claim(self) -> IO[bytes] | None:
        """Claim it, to compile it; None where another process compiles it."""
        note = self.note()
        return claim(note.with_name(f"{note.name}{CLAIM}"))


def prepare_kernels(world: World, with_events: bool, with_substepped: bool) -> None:
    """Compile the kernels that a run needs on several cores, and say so, where this machine has never run these sources."""
    missing = kernels_to_compile(world, with_events, with_substepped)
    if not missing:
        return
    with _alone(sum(SECONDS[kind] for kind in missing)):
        missing = kernels_to_compile(world, with_events, with_substepped)
        if missing:
            kinds, seconds = ", ".join(missing), sum(SECONDS[kind] for kind in missing)
            once = "for the first run on this machine, once" if is_kept() else "for this process alone, as no folder keeps them"
            logger.warning(f"compiling kernels ({kinds}) {once}: this takes about {seconds} s")
            compile_kernels(missing)


@contextmanager
def _alone(seconds: float) -> Iterator[None]:
    """Wait until no other process compiles, and let none begin; not for ever, should it hang. seconds: what compiling takes, about."""
    held, begin, said = None, time.monotonic(), False
    # Where no file can be made, each process compiles for itself.
    with suppress(OSError):
        path = note_beside(prepare_kernels, f"kinds{CLAIM}")
        while (held := claim(path)) is None and time.monotonic() - begin < LONGEST_WAIT * seconds:
            if not said:
                logger.warning("another process compiles kernels for the first run on this machine: waiting for it")
                said = True
            time.sleep(LOOK_AGAIN)
    try:
        yield
    finally:
        if held is not None:
            held.close()


def kernels_to_compile(
    world: World, with_events: bool, with_substepped: bool, is_ready: Callable[[Kernel], bool] = Kernel.is_cached
) -> list[str]:
    """Kinds of kernels that a run of a world needs and that do not lie in the cache: what is compiled last of each tells.

    is_ready: whether a kernel need not be compiled.
    """
    joints, general = bool(world.joints_of_scene), with_substepped and world.has_general_pairs
    needed = {
        CONTACTS: world.can_collide, EVENTS: with_events, SUBSTEPPED: with_substepped, JOINTS: joints,
        POLYHEDRA: with_substepped and not general and (world.can_collide or joints), ANY_SHAPES: general,
        SHARED: with_substepped and world.num_bodies > MANY_BODIES and number_of_cores() > 1,
        STEPPED_JOINTS: with_substepped and joints, UNDER_FORCES: world.can_collide and bool(world.force_tables),
        JOINED_UNDER_FORCES: joints and bool(world.force_tables),
    }  # fmt: skip
    return [kind for kind in LAST if needed[kind] and not is_ready(_last_kernel(kind))]


def _last_kernel(kind: str) -> Any:
    module, name = LAST[kind]
    return getattr(import_module(f"rigidimpulse.{module}"), name)


def parts_of(kinds: Sequence[str]) -> list[KernelPart]:
    """The parts of these kinds."""
    return [KernelPart(kind, number) for kind in kinds for number in range(NUMBER_OF_PARTS[kind])]


def compile_kernels(kinds: list[str]) -> None:
    """Compile kernels of these kinds. Should a part fail, or no file be made, they are compiled when used."""
    parts = parts_of(kinds)
    with ExitStack() as processes, suppress(OSError):
        for _ in range(min(most_processes(), len(parts)) - 1):
            processes.enter_context(start_process(parts))
        import_module(PARTS_MODULE).compile_in_turn(parts)


def compile_loop_in_background() -> None:
    """Start a process that compiles the order of events, unless one does, or no folder would keep it; it goes on by itself.

    Each process starts one at most, so that a compiler that fails is not asked again by every run. What was stopped, its next one starts.
    """
    part = KernelPart(LOOP)
    if not _BACKGROUND and is_kept() and (held := part.claim()) is not None:
        # The process takes the claim itself: this one may end before.
        held.close()
        _BACKGROUND.append(start_process([part]))


def start_process(parts: Sequence[KernelPart], errors: IO[bytes] | None = None) -> subprocess.Popen:
    """Start a process that compiles those of some parts that no other does; what it says of errors goes to a file, or nowhere."""
    quiet = subprocess.DEVNULL
    command = [sys.executable, "-P", "-m", PARTS_MODULE, *(word for part in parts for word in (part.kind, str(part.number)))]
    variables = variables_to_share_kernels()
    return subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet if errors is None else errors, env=variables)


def most_processes() -> int:
    """How many processes may compile at a time: on all cores that this one has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
