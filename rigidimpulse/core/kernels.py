"""The one way kernels are compiled: cached on disk, IEEE division (no exception at a zero divisor), lazily typed.

Numba's cache knows only the file that a function stands in, not those of the functions it calls; here the sources of
all modules that a kernel's module imports, directly or not, are part of the key, so that no kernel ever runs with an
old version of another one inside it.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import re
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property, update_wrapper
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import numba
from numba import types
from numba.core import config
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.errors import NumbaError
from numba.core.typed_passes import InlineOverloads, NopythonRewrites, NopythonTypeInference
from numba.core.untyped_passes import InlineClosureLikes, InlineInlinables, LiteralPropagationSubPipelinePass, LiteralUnroll, WithLifting
from numba.extending import typeof_impl

_PACKAGE = Path(__file__).parent.parent
_njit: Any = numba.njit
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}
_NEEDLESS = {
    InlineClosureLikes, InlineInlinables, InlineOverloads, LiteralPropagationSubPipelinePass, LiteralUnroll, NopythonRewrites, WithLifting,
}  # fmt: skip
_IMPORT = re.compile(rb"^\s*from rigidimpulse\.?([\w.]*) import (?:\(|([\w, ]+))", re.MULTILINE)


@cache
def _imported(path: Path) -> frozenset[Path]:
    """Modules of the package that a module imports."""
    found = set()
    for module, names in _IMPORT.findall(path.read_bytes()):
        base = _PACKAGE.joinpath(*module.decode().split(".")) if module else _PACKAGE
        candidates = [base.with_suffix(".py"), *(base / f"{name.split(' as ')[0].strip()}.py" for name in names.decode().split(","))]
        found.update(candidate for candidate in candidates if candidate.is_file())
    return frozenset(found)


@cache
def source_digest(path: Path) -> str:
    """Digest of a module's source and of all it imports from the package."""
    reached, frontier = {path}, {path}
    while frontier:
        frontier = set().union(*(_imported(module) for module in frontier)) - reached
        reached |= frontier
    digest = hashlib.sha256()
    for module in sorted(reached):
        digest.update(module.read_bytes())
    return digest.hexdigest()


class _KernelCache(FunctionCache):
    """Numba's cache of one function, with the sources that may be inside it in its key."""

    def _index_key(self, sig: Any, codegen: Any) -> tuple:
        return (*super()._index_key(sig, codegen), source_digest(Path(self._py_func.__code__.co_filename)))


class _PartLibrary(JITCodeLibrary):
    """Code that is only ever linked into other kernels: optimised there, and never turned into machine code by itself."""

    def add_linking_library(self, library: Any) -> None:
        """Remember a part that this one calls; what is called from Python links them all."""
        library._ensure_finalized()
        self._linking_libraries.append(library)

    def finalize(self) -> None:
        """Make ready for being linked, without the parts that it calls: numba would copy those into each of their callers in turn."""
        self._raise_if_finalized()
        self._final_module.verify()
        self._finalize_final_module()

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, _name: str) -> int:
        """Null: there is nothing that Python could call."""
        return 0

    @property
    def codegen(self) -> Any:
        """Where numba would store the environment of a function that Python calls."""
        return self

    def set_env(self, _name: str, _environment: Any) -> None:
        """A part has none."""


class _EntryLibrary(JITCodeLibrary):
    """Code that Python calls, with all parts that it needs."""

    def finalize(self) -> None:
        """Link the parts, each of them once, and make machine code.

        LLVM links only what is asked for by what is linked already: each part comes after all that call it.
        """
        order: list[Any] = []
        reached, waiting = {id(self)}, [(self, iter(self._linking_libraries))]
        while waiting:
            library, called = waiting[-1]
            callee = next((part for part in called if id(part) not in reached), None)
            if callee is None:
                order.append(library)
                waiting.pop()
            else:
                reached.add(id(callee))
                waiting.append((callee, iter(callee._linking_libraries)))
        self._linking_libraries = order[-2::-1]
        super().finalize()


def _holds_array(kind: Any) -> bool:
    """Whether values of a type are arrays, or tuples of such."""
    return isinstance(kind, types.Array) or any(map(_holds_array, getattr(kind, "types", ())))


@register_pass(mutates_CFG=False, analysis_only=True)
class _NoArraysMade(AnalysisPass):
    """Refuses kernels that get arrays from others, or return any, without counting who holds them: they would never be freed."""

    _name = "no_arrays_made"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Look at the calls of a kernel whose types are known."""
        if not state.flags.nrt:
            calls = [call for call in state.calltypes if getattr(call, "op", "") == "call"]
            kernels = [call for call in calls if isinstance(state.typemap[call.func.name], types.Dispatcher)]
            results = [state.return_type, *(state.calltypes[call].return_type for call in kernels)]
            if any(map(_holds_array, results)):
                raise NumbaError(f"{state.func_id.func_name} gets or returns arrays that a kernel made: mark it jit_making_arrays")
        return False


class _RememberedTypes:
    """Numba's typing context for one kernel; what `+` or `x[i, k]` makes of the same types is looked up but once.

    Numba asks all overloads of such a function each time, which is a quarter of the time of compiling.
    """

    _known: ClassVar[dict[tuple, tuple]] = {}

    def __init__(self, typing_context: Any, counts: bool) -> None:
        """counts: whether the kernel counts who holds arrays; what is compiled for such is not for others."""
        self._typing = typing_context
        self._counts = counts

    def __getattr__(self, name: str) -> Any:
        """All else is numba's."""
        return getattr(self._typing, name)

    def resolve_function_type(self, function: Any, arguments: tuple, keywords: Any) -> Any:
        """Signature of a call."""
        kind: Any = self._typing._lookup_global(function) or function
        if keywords or not isinstance(kind, types.Function) or any(isinstance(argument, types.Callable) for argument in arguments):
            return self._typing.resolve_function_type(function, arguments, keywords)
        key, chosen = (kind, arguments, self._counts), vars(kind)["_impl_keys"]
        if key not in self._known:
            signature = self._typing.resolve_function_type(function, arguments, keywords)
            if signature is None:
                return None
            self._known[key] = signature, chosen.get(signature.args)
        signature, implementation = self._known[key]
        chosen[signature.args] = implementation
        return signature


class _KernelFlags(Flags):
    """Numba's flags of a kernel, compared by those that are set: numba does it at each look for an overload, and asks for all of them."""

    __slots__ = ()

    def __hash__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Flags) and self._values == other._values


class _KernelCompiler(Compiler):
    """Numba's compiler with these, and without passes for what kernels do not do: `with`, closures, comprehensions, array expressions."""

    def __init__(self, typing_context: Any, target_context: Any, library: Any, arguments: Any, result: Any, flags: Any, local: Any) -> None:
        remembered = _RememberedTypes(typing_context, flags.nrt)
        if not isinstance(library, _PartLibrary):
            library = _EntryLibrary(target_context.codegen(), "kernel")
            library.enable_object_caching()
        super().__init__(remembered, target_context, library, arguments, result, _KernelFlags(flags), local)

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_NoArraysMade, NopythonTypeInference)
        passes.passes[:] = [(kind, name) for kind, name in passes.passes if kind not in _NEEDLESS]
        passes.finalize()
        return [passes]


class _PartCompiler(_KernelCompiler):
    """The same, with the library of a part."""

    def __init__(self, typing_context: Any, target_context: Any, _library: Any, *arguments: Any) -> None:
        library = _PartLibrary(target_context.codegen(), "part")
        super().__init__(typing_context, target_context, library, *arguments)


INTERPRETED = bool(vars(config)["DISABLE_JIT"])
"""Whether kernels run as the Python they are written in (NUMBA_DISABLE_JIT=1): slow, but nothing is compiled. Not those with intrinsics."""
MOST_CORES = 4
"""Cores on which a kernel is worth calling at once."""
KERNELS: list[Kernel] = []
"""All kernels of the modules that have been imported."""


class Kernel:
    """A compiled function: an entry where Python calls it, and a part of other kernels where they do.

    Most kernels are only ever parts. Parts have no wrapper for Python and are not written to the cache (whatever calls
    them is, with the part inside), which saves much of the time of a first run.

    The arrays that a kernel is given are its caller's as long as it runs, so that nobody has to count who holds them. Only kernels that
    make arrays, or get such from others, are compiled with numba's counting: that is an atomic operation, some 5 ns, wherever an array is
    taken from a tuple, and was half of the time of kernels that do little for each pair.

    Attributes:
        name: module and function. calls: how often Python called it.
        seconds: how long that took, s, without `preparing`: the first call for each set of types, in which it is compiled or loaded.

    """

    def __init__(self, function: Callable[..., Any], *, makes_arrays: bool, **options: bool) -> None:
        """Nothing is compiled before the first call; makes_arrays: whether it makes any; options: of numba, for the part."""
        update_wrapper(self, function)
        self.py_func = function
        self.name = f"{function.__module__.removeprefix('rigidimpulse.')}.{function.__name__}"
        self.calls, self.seconds, self.preparing = 0, 0.0, 0.0
        KERNELS.append(self)
        self._options = {**_OPTIONS, "_nrt": makes_arrays}
        self.part = _njit(no_cpython_wrapper=True, pipeline_class=_PartCompiler, **self._options, **options)(function)

    @cached_property
    def entry(self) -> Any:
        """The dispatcher that Python calls."""
        dispatcher = _njit(nogil=True, pipeline_class=_KernelCompiler, **self._options)(self.py_func)
        dispatcher._cache = _KernelCache(self.py_func)
        return dispatcher

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        if INTERPRETED:
            return self.py_func(*arguments)
        entry = self.entry
        known, start = len(entry.overloads), perf_counter()
        result = entry(*arguments)
        spent = perf_counter() - start
        self.calls += 1
        if len(entry.overloads) == known:
            self.seconds += spent
        else:
            self.preparing += spent
        return result

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


def number_of_cores() -> int:
    """Cores that kernels may use: those that numba may (NUMBA_NUM_THREADS, else all of the process), one in a process of a pool."""
    return 1 if multiprocessing.parent_process() else min(int(vars(config)["NUMBA_NUM_THREADS"]), MOST_CORES)


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


def is_cached(kernel: Kernel) -> bool:
    """Whether a kernel of these sources is in use, or lies in the cache on disk, for whatever types."""
    if INTERPRETED or kernel.entry.overloads:
        return True
    digest = source_digest(Path(kernel.py_func.__code__.co_filename))
    return any(key[-1] == digest for key in kernel.entry._cache._cache_file._load_index())
