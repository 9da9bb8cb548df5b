"""What the package takes of numba beside its public parts: in one file, and each part still does what it is for.

If a test here fails after numba has moved, its message names the part. `rigidimpulse/core/numba_private.py` says what each is for.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.lowering import Lower
from numba.core.runtime import _nrt_python, rtsys

import rigidimpulse
from rigidimpulse.core import numba_private
from rigidimpulse.core.kernels import jit, jit_making_arrays

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
        (Lower, "lower_assign", "assignments are lowered by another method"),
        (Lower, "storevar", "variables are stored by another method"),
        (Lower, "delvar", "variables are let go by another method"),
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


class _Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


@jit_making_arrays
def _longer(x):
    longer = np.zeros(len(x) + 1)
    longer[: len(x)] = x
    return longer


@jit_making_arrays
def _rows_of_given(pair):
    """Reads the given in all ways, and makes an array."""
    total = np.zeros(2)
    for row in range(len(pair.first)):
        again = _Pair(pair.first[row], pair.second[1:])
        total += again.first + again.second
    return total.sum()


@jit_making_arrays
def _grown(pair, times):
    """A variable that holds what is given at first, then arrays made here."""
    grown = pair.first[0]
    for _ in range(times):
        grown = _longer(grown)
    return _Pair(grown, pair.second)


@jit_making_arrays
def _given_back(pair, other):
    """What is given is returned, from either of two branches."""
    chosen = pair.first[1] if other else pair.second
    return chosen


def _given() -> Any:
    return _Pair(np.arange(4.0).reshape(2, 2), np.arange(3.0))


def test_what_a_kernel_is_given_is_not_counted_where_it_makes_arrays() -> None:
    assert _rows_of_given(_given()) == pytest.approx(0 + 1 + 1 + 2 + 2 + 3 + 1 + 2)
    _rows_of_given.part.compile((numba.typeof(_given()),))
    (compiled,) = _rows_of_given.part.overloads.values()
    code = compiled.library.get_llvm_str()
    kernel = code[code.index(compiled.fndesc.llvm_func_name) :].split("\n}\n")[0]
    assert "NRT_decref" in kernel, "the array that it makes is never freed"
    assert "NRT_incref" not in kernel, "numba lowers assignments in another way: kernels that make arrays have thrice the code"


@pytest.fixture
def counted_memory() -> Iterator[None]:
    """Numba counts what it allocates and frees."""
    _nrt_python.memsys_enable_stats()
    yield
    _nrt_python.memsys_disable_stats()


@pytest.mark.usefixtures("counted_memory")
def test_what_kernels_make_and_hand_on_lives_as_long_as_it_is_held() -> None:
    _grown(_given(), 1), _given_back(_given(), True)  # Compilers keep what they get.
    before = rtsys.get_allocation_stats()
    for times in (0, 1, 5):
        pair = _given()
        made = [_grown(pair, times) for _ in range(20)]
        back = [_given_back(pair, other) for other in (True, False) for _ in range(20)]
        del pair
        for grown, second in made:
            assert list(grown) == [0.0, 1.0, *[0.0] * times] and list(second) == [0.0, 1.0, 2.0]
        assert all(list(each) in ([2.0, 3.0], [0.0, 1.0, 2.0]) for each in back)
    del made, back, grown, second
    after = rtsys.get_allocation_stats()
    assert after.alloc - before.alloc == after.free - before.free, "arrays are never freed, or freed twice"
    assert after.mi_alloc - before.mi_alloc == after.mi_free - before.mi_free
