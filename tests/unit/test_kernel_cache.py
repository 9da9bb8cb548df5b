"""Compiled kernels are kept by the state of all sources that are in them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import rigidimpulse
from rigidimpulse.core import kernel_cache
from rigidimpulse.core.kernel_cache import is_in_cache, jit_with_cache

CALLEE = "from rigidimpulse.core.kernels import jit\n\n\n@jit\ndef inner(x):\n    return x + {number}\n"
CALLER = (
    "from rigidimpulse.core.kernels import jit\nfrom rigidimpulse.core.callee import inner\n\n\n"
    "@jit\ndef outer(pair):\n    return inner(pair.first) - pair.second\n"
)
TUPLES = "from typing import NamedTuple\n\n\nclass {name}(NamedTuple):\n    {first}: float\n    {second}: float\n"
PROGRAM = """
from rigidimpulse.core import tuples
from rigidimpulse.core.caller import outer

kind = next(value for value in vars(tuples).values() if isinstance(value, type) and issubclass(value, tuple))
print(outer(kind(10.0, 3.0)), len(outer.entry.stats.cache_hits))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """What kernels need of the package, where sources can be changed, with a kernel that calls one of another file."""
    folder = tmp_path / "rigidimpulse" / "core"
    folder.mkdir(parents=True)
    (folder.parent / "__init__.py").touch()
    (folder / "__init__.py").touch()
    for name in ("kernels.py", "kernel_cache.py", "numba_private.py"):
        shutil.copy(Path(rigidimpulse.__file__).parent / "core" / name, folder)
    _write(folder, 1, "Pair", "first", "second")
    (folder / "caller.py").write_text(CALLER)
    return folder


def _write(folder: Path, number: int, name: str, first: str, second: str) -> None:
    (folder / "callee.py").write_text(CALLEE.format(number=number))
    (folder / "tuples.py").write_text(TUPLES.format(name=name, first=first, second=second))


def _result(folder: Path) -> tuple[float, int]:
    """What the outer kernel returns in a process of its own, and how often it came from the cache."""
    command = [sys.executable, "-B", "-c", PROGRAM]  # Without bytecode: its date is in seconds, and sources change faster.
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder.parent.parent, env={})
    value, hits = done.stdout.split()
    return float(value), int(hits)


def test_a_kernel_is_compiled_again_when_one_that_it_calls_changes(package: Path) -> None:
    assert _result(package) == (8.0, 0)
    assert _result(package) == (8.0, 1)
    _write(package, 2, "Pair", "first", "second")
    assert _result(package) == (9.0, 0)


def test_a_kernel_is_compiled_again_when_a_tuple_changes_whose_module_it_does_not_import(package: Path) -> None:
    """Numba's index holds the name of the tuple's class: once that is renamed, the old index cannot be read."""
    assert _result(package) == (8.0, 0)
    _write(package, 1, "Couple", "first", "second")
    assert _result(package) == (8.0, 0)
    _write(package, 1, "Couple", "second", "first")
    assert _result(package) == (3.0 + 1.0 - 10.0, 0)


def test_folders_of_old_states_are_removed(package: Path) -> None:
    for number in range(1, 7):
        _write(package, number, "Pair", "first", "second")
        _result(package)
    (states,) = package.parent.glob("__pycache__/rigidimpulse_kernels/caller-*")
    assert len(list(states.iterdir())) == 4


def test_the_user_s_folder_is_used_and_his_setting_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert not is_in_cache(_twice)
    jit_with_cache(_twice)(1.0)
    assert is_in_cache(_twice)
    assert numba.config.CACHE_DIR == str(tmp_path)
    assert list(tmp_path.rglob("*.nbc"))


def test_a_folder_that_cannot_be_made_is_passed_over(tmp_path: Path) -> None:
    occupied = tmp_path / "file"
    occupied.touch()
    assert kernel_cache._root.__wrapped__(str(occupied)).is_dir()


def _twice(x: float) -> float:
    return 2.0 * x
