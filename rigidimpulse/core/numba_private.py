"""All that this package takes of numba beside its public parts, and why. A kernel runs without any of it, but slower.

Each line names what numba's manuals do not promise to keep, so that a new version may break it. `pyproject.toml` therefore has an upper
bound of numba's version, and `tests/unit/test_numba_private.py` says which line no longer holds.

| what | for | without it |
|---|---|---|
| option `_nrt` | kernels that do not count who holds an array | narrow phases take twice as long |
| `_NoArraysMade` | refuses such a kernel where it would have to count | memory that is never freed |
| `_PartLibrary`, `_EntryLibrary` | kernels that only kernels call are optimised once, in what Python calls | LLVM takes more of the time |
| `_Lower` | what a kernel is given is its caller's: nobody counts who holds it in kernels that make arrays, either | three times the code |
| `_RememberedTypes`, `_KernelFlags` | the types of `a + b` and the flags of kernels are looked up but once | more of it goes to types |
| `AttributeTemplate` | types of the fields of records (`record.py`); `infer_getattr`, which is public, asks for one | no records |
| `create_struct_proxy` | a field of a record that is an array is known to be nobody's (`record.py`) | records do not run |
| `_NEEDLESS` | leaves out passes for what kernels do not do | the same |

That a compiler and its passes can be replaced (`pipeline_class`, `CompilerBase`, `define_pipelines`, `register_pass`) stands in numba's
manual for developers ("Customizing the compiler"), as a thing for experts.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from llvmlite.binding import Linkage
from numba import types
from numba.core import ir
from numba.core.cgutils import create_struct_proxy as create_struct_proxy
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.errors import NumbaError
from numba.core.lowering import Lower
from numba.core.typed_passes import BaseNativeLowering, InlineOverloads, NativeLowering, NopythonRewrites, NopythonTypeInference
from numba.core.typing.templates import AttributeTemplate as AttributeTemplate
from numba.core.untyped_passes import InlineClosureLikes, InlineInlinables, LiteralPropagationSubPipelinePass, LiteralUnroll, WithLifting

_NEEDLESS = {
    InlineClosureLikes, InlineInlinables, InlineOverloads, LiteralPropagationSubPipelinePass, LiteralUnroll, NopythonRewrites, WithLifting,
}  # fmt: skip


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

    def _optimize_final_module(self) -> None:
        """Optimise, knowing that nobody else calls the parts: what all callers give alike goes into a part, and what it does not use goes.

        Arrays of records are such: without, counting who holds them is a quarter of the time of the loop of events.
        """
        for part in self._final_module.functions:
            if not part.is_declaration and part.linkage == Linkage.linkonce_odr:
                part.linkage = "internal"
        super()._optimize_final_module()


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


_PLACES = types.Integer, types.SliceType, types.EllipsisType, types.NoneType
"""What an array is indexed with where the result is a view of it, and no new array."""


class _Lower(Lower):
    """Numba's way to LLVM, without counting who holds what a kernel is given, and the views and tuples that it makes of this.

    The caller holds its arguments until it returns. Numba counts each array of each tuple up and down again at every use of it: in kernels
    that make arrays this was three quarters of all code.
    """

    def lower_normal_function(self, fndesc: Any) -> None:
        """Lower a kernel."""
        self._given = self._held_by_caller() if self.context.enable_nrt else set()
        super().lower_normal_function(fndesc)

    def lower_assign(self, ty: Any, inst: Any) -> Any:
        """Lower the value of an assignment."""
        with self._counting(inst.target.name not in self._given):
            return super().lower_assign(ty, inst)

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Store a value in a variable."""
        with self._counting(name not in self._given):
            super().storevar(value, name, argidx)

    def delvar(self, name: str) -> None:
        """Let go what a variable holds."""
        if self.context.enable_nrt and self._is_counted(name) and name not in self._given:
            super().delvar(name)

    @contextmanager
    def _counting(self, is_on: bool) -> Iterator[None]:
        """Let code that counts be made as before, or none."""
        before = self.context.enable_nrt
        self.context.enable_nrt = before and is_on
        try:
            yield
        finally:
            self.context.enable_nrt = before

    def _held_by_caller(self) -> set[str]:
        """Names of variables that never hold anything else than what the caller holds: of all variables, those without another value."""
        values: dict[str, list[Any]] = {}
        for block in self.blocks.values():
            for assign in block.find_insts(ir.Assign):
                values.setdefault(assign.target.name, []).append(assign)
        given, others = {name for name in values if self._is_counted(name)}, {""}
        while others:
            others = {name for name in given if not all(self._is_given(assign, given) for assign in values[name])}
            given -= others
        return given

    def _is_counted(self, name: str) -> bool:
        """Whether values of a variable's type are counted at all."""
        return bool(self.context.data_model_manager[self.typeof(name)].contains_nrt_meminfo())

    def _is_given(self, assign: Any, given: set[str]) -> bool:
        """Whether an assignment is of an argument, or a part or a view of such, if the variables named `given` are."""

        def are_given(*read: Any) -> bool:
            return all(variable.name in given or not self._is_counted(variable.name) for variable in read)

        value = assign.value
        if isinstance(value, (ir.Arg, ir.Const, ir.Global, ir.FreeVar)):
            return True
        if isinstance(value, ir.Var):
            return are_given(value)
        match value.op if isinstance(value, ir.Expr) else "":
            case "getattr" | "exhaust_iter" | "getitem" | "static_getitem":
                return are_given(value.value) and self._is_part(assign)
            case "build_tuple":
                return are_given(*value.items)
            case "call":
                makes_tuple = isinstance(self.typeof(value.func.name), types.NamedTupleClass)
                return makes_tuple and not value.kws and value.vararg is None and are_given(*value.args)
        return False

    def _is_part(self, assign: Any) -> bool:
        """Whether reading makes no array that was not there before: parts of tuples and records, rows and other views of arrays."""
        value, source = assign.value, self.typeof(assign.value.value.name)
        if not isinstance(source, types.Array):
            return value.op != "exhaust_iter" or isinstance(source, types.BaseTuple)
        if not isinstance(self.typeof(assign.target.name), types.Array) or value.op == "exhaust_iter":
            return False
        if value.op == "getattr":
            return True
        index = value.index if value.op == "getitem" else value.index_var
        place = self.typeof(index.name) if index is not None else types.undefined
        return all(isinstance(each, _PLACES) for each in getattr(place, "types", (place,)))


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(BaseNativeLowering):
    """The pass that does it."""

    _name = "lower_uncounted"

    @property
    def lowering_class(self) -> type[Lower]:
        """What makes LLVM's code."""
        return _Lower


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


class KernelCompiler(Compiler):
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
        passes.passes[:] = [(_Lowering if kind is NativeLowering else kind, name) for kind, name in passes.passes if kind not in _NEEDLESS]
        passes.finalize()
        return [passes]


class PartCompiler(KernelCompiler):
    """The same, with the library of a part."""

    def __init__(self, typing_context: Any, target_context: Any, _library: Any, *arguments: Any) -> None:
        library = _PartLibrary(target_context.codegen(), "part")
        super().__init__(typing_context, target_context, library, *arguments)


def options_of(compiler: type[KernelCompiler], makes_arrays: bool) -> dict[str, Any]:
    """Numba's options for kernels; makes_arrays: whether they count who holds arrays."""
    return {
        "error_model": "numpy", "no_cfunc_wrapper": True, "no_cpython_wrapper": compiler is PartCompiler, "_nrt": makes_arrays,
        "pipeline_class": compiler,
    }  # fmt: skip
