"""The one way kernels are compiled: cached on disk, IEEE division (no exception at a zero divisor), lazily typed."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property, update_wrapper
from time import perf_counter
from typing import Any

import numba
from numba import types
from numba.extending import typeof_impl

from rigidimpulse.core.kernel_cache import is_in_cache, jit_with_cache
from rigidimpulse.core.known_calls import KnownCalls
from rigidimpulse.core.numba_private import KernelCompiler, PartCompiler, options_of

_numba: Any = numba
_njit: Any = numba.njit
INTERPRETED = bool(_numba.config.DISABLE_JIT)
"""Whether kernels run as the Python they are written in (NUMBA_DISABLE_JIT=1): slow, but nothing is compiled. Not those with intrinsics."""
MOST_CORES = 4
"""Cores on which a kernel is worth calling at once."""
KERNELS: list[Kernel] = []
"""All kernels of the modules that have been imported."""
CALLED: list[Kernel] = []
"""Those that Python has called."""


class Kernel:
    """A compiled function: an entry where Python calls it, and a part of other kernels where they do.

    Most kernels are only ever parts. Parts have no wrapper for Python and are not written to the cache (whatever calls
    them is, with the part inside), which saves much of the time of a first run.

    The arrays that a kernel is given are its caller's as long as it runs, so that nobody has to count who holds them. Only kernels that
    make arrays, or get such from others, are compiled with numba's counting: that is an atomic operation, some 5 ns, wherever an array is
    taken from a tuple, and was half of the time of kernels that do little for each pair.

    Attributes:
        name: module and function. calls: how often Python called it. known: calls whose types need not be looked up.
        seconds: how long that took, s, without `preparing`: the first call for each set of types, in which it is compiled or loaded.

    """

    def __init__(self, function: Callable[..., Any], *, makes_arrays: bool, **options: bool) -> None:
        """Nothing is compiled before the first call; makes_arrays: whether it makes any; options: of numba, for the part."""
        update_wrapper(self, function)
        self.py_func = function
        self.name = f"{function.__module__.removeprefix('rigidimpulse.')}.{function.__name__}"
        self.calls, self.seconds, self.preparing = 0, 0.0, 0.0
        KERNELS.append(self)
        self._makes_arrays, self._lies_in_cache, self.known = makes_arrays, False, KnownCalls()
        self.part = _njit(**options_of(PartCompiler, makes_arrays), **options)(function)

    @cached_property
    def entry(self) -> Any:
        """The dispatcher that Python calls."""
        return jit_with_cache(self.py_func, nogil=True, **options_of(KernelCompiler, self._makes_arrays))

    @cached_property
    def _only_call(self) -> Any:
        """What the dispatcher calls, if it is compiled for one set of types. (Its table of them takes as long as many a call.)"""
        (compiled,) = self.entry.overloads.values()
        return compiled.entry_point

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        if INTERPRETED:
            return self.py_func(*arguments)
        start = perf_counter()
        key, call = self.known.find(arguments)
        if call is not None:
            result = call(*arguments)
            self.calls += 1
            self.seconds += perf_counter() - start
            return result
        entry = self.entry
        number = len(entry.overloads)
        result = entry(*arguments)
        spent = perf_counter() - start
        self.calls += 1
        if self.calls == 1:
            CALLED.append(self)
        if len(entry.overloads) > number:
            self.preparing += spent
            self.known.forget()
        else:
            self.seconds += spent
            # Without values that it has by default a call cannot be made at once.
            if number == 1 and len(arguments) == self.py_func.__code__.co_argcount:
                self.known.keep(key, arguments, self._only_call)
        return result

    def is_cached(self) -> bool:
        """Whether the kernel of these sources is in use, or lies in the cache on disk, for whatever types."""
        self._lies_in_cache = self._lies_in_cache or INTERPRETED or bool(self.entry.overloads) or is_in_cache(self.py_func)
        return self._lies_in_cache

    def together(self, calls: Sequence[tuple]) -> list[Any]:
        """Call it from Python with each of these tuples of arguments at once, on as many cores; results in their order."""
        if INTERPRETED or len(calls) == 1 or not self.entry.overloads:
            return [self(*arguments) for arguments in calls]
        start = perf_counter()
        others = [_threads(os.getpid()).submit(self.entry, *arguments) for arguments in calls[1:]]
        results = [self.entry(*calls[0]), *(other.result() for other in others)]
        self.calls += len(calls)
        self.seconds += perf_counter() - start
        return results


def forget_calls() -> None:
    """Hold no arguments of calls any more: at the end of a run, whose memory is its own again."""
    for kernel in CALLED:
        kernel.known.forget()


def number_of_cores() -> int:
    """Cores that kernels may use: those that numba may (NUMBA_NUM_THREADS, else all of the process), one in a process of a pool."""
    return 1 if multiprocessing.parent_process() else min(int(_numba.config.NUMBA_NUM_THREADS), MOST_CORES)


@cache
def _threads(_process: int) -> ThreadPoolExecutor:
    """The threads of a process; one that is forked off has none of its parent's."""
    return ThreadPoolExecutor(MOST_CORES - 1, "rigidimpulse")


class _KernelWithCallbacks(Kernel):
    """A kernel some of whose arguments are None or functions that it calls; with a Python function it runs as plain Python itself."""

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        return self.py_func(*arguments) if any(map(callable, arguments)) else super().__call__(*arguments)


@typeof_impl.register(Kernel)
def _type_of_kernel(kernel: Kernel, _context: Any) -> types.Type:
    return types.Dispatcher(kernel.part)


def jit(function: Callable[..., Any]) -> Any:
    """Make a kernel of a function that makes no arrays, nor gets any made by others; it is compiled when it is first called."""
    return Kernel(function, makes_arrays=False)


def jit_making_arrays(function: Callable[..., Any]) -> Any:
    """The same of a function that makes arrays, gets such from others, or fills several places of one at once."""
    return Kernel(function, makes_arrays=True)


def jit_with_callbacks(function: Callable[..., Any]) -> Any:
    """The same of a function some of whose arguments are callbacks: None, or functions that it calls.

    Compiled, it gets None for them, and numba removes the branches that would call them. Where Python gives it a function it runs as plain
    Python: what is rare, or belongs to an optional library, needs no second implementation.
    """
    return _KernelWithCallbacks(function, makes_arrays=True)


def inlined(function: Callable[..., Any]) -> Any:
    """Make such a kernel that is written out wherever another calls it: where it is called for each pair, and does little.

    A call passes a tuple of arrays word by word, which takes longer than many a kernel does. The bits stay the same.
    """
    return Kernel(function, makes_arrays=False, forceinline=True)
