"""What kernels need of the package, in a folder where a test can change the sources, with a kernel that calls one of another file."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import rigidimpulse

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
known = outer.is_cached()
print(outer(kind(10.0, 3.0)), len(outer.entry.stats.cache_hits), known)
"""
NEEDED = ("kernels.py", "kernel_cache.py", "kernel_places.py", "known_calls.py", "numba_private.py", "processor.py", "ready_kernels.py")


def make_package(place: Path) -> Path:
    """Make the package in a place; return its folder `core`."""
    folder = place / "rigidimpulse" / "core"
    folder.mkdir(parents=True)
    (folder.parent / "__init__.py").touch()
    (folder / "__init__.py").touch()
    for name in NEEDED:
        shutil.copy(Path(rigidimpulse.__file__).parent / "core" / name, folder)
    write(folder, 1, "Pair", "first", "second")
    (folder / "caller.py").write_text(CALLER)
    return folder


def write(folder: Path, number: int, name: str, first: str, second: str) -> None:
    """Write what the called kernel adds, and the tuple that the other one is given."""
    (folder / "callee.py").write_text(CALLEE.format(number=number))
    (folder / "tuples.py").write_text(TUPLES.format(name=name, first=first, second=second))


def run_with(folder: Path, arguments: Sequence[str], before: Sequence[str] = (), **variables: str) -> str:
    """What Python prints that imports the package; `before` stands before the command, variables are all that it has."""
    # Without bytecode: its date is in seconds, and sources change faster.
    command, place = [*before, sys.executable, "-B", *arguments], folder.parent.parent
    environment = {"PYTHONPATH": str(place), **variables}
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=place, env=environment).stdout


def result(folder: Path, before: Sequence[str] = (), **variables: str) -> tuple[float, int]:
    """What the outer kernel returns in a process of its own, and how often it came from a folder; that is known before it is called."""
    value, hits, known = run_with(folder, ["-c", PROGRAM], before, **variables).split()
    assert known == str(int(hits) > 0)
    return float(value), int(hits)
