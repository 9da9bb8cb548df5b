"""The first run on a machine: compile kernels on all cores.

Numba compiles one kernel at a time in a process. So the kernels of each kind that a run needs and that are not in the cache on disk are
compiled in parts (`warm_up_parts.py`): the first in this process, each of the others in one of its own, which puts them into the cache.
Parts of one kind take about as long, and share little that would be compiled twice.

The order of events of exact contact (`exact/event_loop.py`) takes about a minute to compile, and runs without it give the same bits. So
nobody waits for it: a process of its own compiles it beside the first runs and after them, and puts it into the cache.

Nothing is compiled twice where two first runs begin at once: the second waits for the first, and finds its kernels in the cache.
"""

from __future__ import annotations

import gc
import logging
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from typing import IO, Any

import numpy as np

from rigidimpulse.collision.manifold.shrunk_shapes import convex_polyhedra, several_polyhedra
from rigidimpulse.core.claim import claim
from rigidimpulse.core.kernel_cache import is_kept, note_beside, variables_to_share_kernels
from rigidimpulse.core.kernels import Kernel, is_cached
from rigidimpulse.model.world import World

logger = logging.getLogger("rigidimpulse")
LOOP = "order of events"
CONTACTS, EVENTS, SUBSTEPPED, JOINTS = "contacts", "impacts of balls", "sub-stepped islands", "joints"
STEPPED_JOINTS, ANY_SHAPES = "joints in sub-stepped islands", "any shapes in sub-stepped islands"
UNDER_FORCES = "contacts under varying forces"
LAST = {
    CONTACTS: ("engine.touching", "find_touching"),
    EVENTS: ("engine.spheres.flight", "fly"),
    SUBSTEPPED: ("dynamics.solvers.tgs_soft.solver", "advance"),
    JOINTS: ("dynamics.constraints.joint_sub_step", "close_at_end"),
    STEPPED_JOINTS: ("dynamics.solvers.time_stepping.solver", "step_island"),
    ANY_SHAPES: ("collision.contact_update", "store_contacts"),
    UNDER_FORCES: ("dynamics.constraints.contact", "hold_contacts"),
}
"""The kernel of each kind that is compiled last."""
_BACKGROUND: list[subprocess.Popen] = []
"""Processes that nobody waits for."""
PARTS_MODULE = "rigidimpulse.engine.warm_up_parts"
SECONDS = {CONTACTS: 60, EVENTS: 20, SUBSTEPPED: 35, JOINTS: 40, STEPPED_JOINTS: 40, ANY_SHAPES: 30, UNDER_FORCES: 15}
"""s that compiling each kind takes, about, on two threads of one core."""
LONGEST_WAIT, LOOK_AGAIN = 10.0, 0.2
"""How many times as long as compiling takes a process waits for another one that compiles; s, how often it looks whether that has ended."""
NUMBER_OF_PARTS = {CONTACTS: 2, EVENTS: 1, SUBSTEPPED: 2, JOINTS: 4, STEPPED_JOINTS: 1, ANY_SHAPES: 1, UNDER_FORCES: 1}


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
        path = note_beside(prepare_kernels, "kinds.lock")
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


def kernels_to_compile(world: World, with_events: bool, with_substepped: bool, is_ready: Callable[[Kernel], bool] = is_cached) -> list[str]:
    """Kinds of kernels that a run of a world needs and that do not lie in the cache: what is compiled last of each tells.

    is_ready: whether a kernel need not be compiled.
    """
    joints = bool(world.joints_of_scene)
    needed = {
        CONTACTS: world.can_collide, EVENTS: with_events, SUBSTEPPED: with_substepped, JOINTS: joints,
        STEPPED_JOINTS: with_substepped and joints, ANY_SHAPES: with_substepped and world.can_collide and _has_other_shapes(world),
        UNDER_FORCES: world.can_collide and bool(world.force_tables),
    }  # fmt: skip
    return [kind for kind in LAST if needed[kind] and not is_ready(_last_kernel(kind))]


def _has_other_shapes(world: World) -> bool:
    """Whether a body is no half space nor made of convex polyhedra, for whose pairs sub-stepped islands have kernels of their own."""
    geometry = world.geometry
    polyhedra = convex_polyhedra(geometry, world.convex_depths) | several_polyhedra(geometry)
    return bool(np.any(~world.half_space & ~polyhedra[world.shape_of_body]))


def _last_kernel(kind: str) -> Any:
    module, name = LAST[kind]
    return getattr(import_module(f"rigidimpulse.{module}"), name)


def compile_kernels(kinds: list[str]) -> None:
    """Compile kernels of these kinds. Should another process fail, its part is compiled when used."""
    mine, *others = [(kind, part) for kind in kinds for part in range(NUMBER_OF_PARTS[kind])]
    with ExitStack() as processes:
        for kind, part in others:
            processes.enter_context(start_process(kind, str(part)))
        with _without_garbage_collection():
            import_module(PARTS_MODULE).compile_part(*mine)


def compile_loop_in_background() -> None:
    """Start a process that compiles the order of events, unless one does; it goes on by itself."""
    if (held := claim_loop()) is not None:
        # The process takes the claim itself: this one may end before.
        held.close()
        _BACKGROUND.append(start_process(LOOP, "0"))


def claim_loop() -> IO[bytes] | None:
    """Claim the order of events, to compile it; None where another process compiles it."""
    return claim(note_beside(prepare_kernels, "loop.lock"))


def start_process(*arguments: str, errors: IO[bytes] | None = None) -> subprocess.Popen:
    """Start a process that compiles one part; what it says of errors goes to a file, or nowhere."""
    quiet = subprocess.DEVNULL
    command = [sys.executable, "-m", PARTS_MODULE, *arguments]
    variables = variables_to_share_kernels()
    return subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet if errors is None else errors, env=variables)


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Compilers make many objects and hardly any garbage: looking for it takes a seventh of their time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
