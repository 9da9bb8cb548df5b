"""What the package takes of numba beside its public parts: in one file, and each part still does what it is for.

If a test here fails after numba has moved, its message names the part. `rigidimpulse/core/numba_private.py` says what each is for.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder

import rigidimpulse
from rigidimpulse.core import numba_private
from rigidimpulse.core.kernels import jit

PACKAGE = Path(rigidimpulse.__file__).parent
PRIVATE = re.compile(r"\b(from|import) numba\.(core|np|misc|typed|_)|\b_nrt\b|\b_cache_file\b|\._impl_keys|\._lookup_global")


@jit
def _inner(vector):
    return vector[0] * vector[1] + vector[0]


@jit
def _outer(vector):
    return _inner(vector) - vector[1]


def test_private_parts_are_used_in_one_file_only() -> None:
    users = {path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py") if PRIVATE.search(path.read_text(encoding="utf-8"))}
    assert users == {"core/numba_private.py", "core/compilation.py"}  # the second one only listens


def test_version_of_numba_has_an_upper_bound_that_this_one_is_below() -> None:
    with (PACKAGE.parent / "pyproject.toml").open("rb") as file:
        dependencies = tomllib.load(file)["project"]["dependencies"]
    (numba_is,) = (line for line in dependencies if line.startswith("numba"))
    bound = re.fullmatch(r"numba>=[\d.]+,<(\d+)\.(\d+)", numba_is)
    assert bound, f"{numba_is} has no upper bound"
    version = tuple(int(part) for part in numba.__version__.split(".")[:2])
    assert version < tuple(map(int, bound.groups())), f"numba {numba.__version__} has not been tested: run this file, then raise the bound"


@pytest.mark.parametrize(
    ("owner", "name", "what"),
    [
        (JITCodeLibrary, "_optimize_final_module", "parts are no longer optimised by this method"),
        (JITCodeLibrary, "_finalize_final_module", "parts are no longer turned into machine code by this method"),
        (JITCodeLibrary, "_finalize_dynamic_globals", "parts do not know their globals"),
        (JITCodeLibrary, "get_pointer_to_function", "parts may be turned into machine code after all"),
        (CompilerBase, "define_pipelines", "a compiler's passes can no longer be chosen"),
        (DefaultPassBuilder, "define_nopython_pipeline", "numba's list of passes has another name"),
    ],
    ids=lambda value: value if isinstance(value, str) and value.isidentifier() else None,
)
def test_what_is_replaced_is_there(owner: type, name: str, what: str) -> None:
    assert callable(getattr(owner, name, None)), f"numba {numba.__version__} has no {owner.__name__}.{name}: {what}"


def test_a_part_stays_without_machine_code_and_types_are_remembered() -> None:
    _outer.part.compile((numba.float64[::1],))
    for kernel in (_outer, _inner):
        (compiled,) = kernel.part.overloads.values()
        assert isinstance(compiled.library, numba_private._PartLibrary), "numba gives parts another library: `_PartCompiler` is passed over"
        assert compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name) == 0, "a part has been turned into machine code"
    known = {arguments for _, arguments, _ in numba_private._RememberedTypes._known}
    assert any(numba.float64[::1] in arguments for arguments in known), "no type is remembered: numba asks another method"


def test_kernels_that_make_no_arrays_do_not_count_who_holds_them() -> None:
    @jit
    def first(pair):
        return pair[0][0]

    first.part.compile((numba.typeof((np.ones(1), np.ones(1))),))
    (compiled,) = first.part.overloads.values()
    body = compiled.library.get_llvm_str()
    assert "NRT_incref" not in body, "option `_nrt` has lost its meaning: kernels take twice as long"
