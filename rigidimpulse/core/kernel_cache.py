"""Where compiled kernels are kept: a folder for each state of the sources that are in them.

Numba's own cache knows only the file that a function stands in, not those of the functions it calls, nor those of the tuples it is given.
Here the name of the folder is a digest of the sources of all modules that a kernel's module imports, directly or not, and of all named
tuples of the package. So no kernel ever runs with an old version of another one inside it, and what was kept for an older version of a
tuple is never read. Numba is told of the folder in the public way, by `numba.config.CACHE_DIR`.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba

_numba: Any = numba
_PACKAGE = Path(__file__).parent.parent
_IMPORT = re.compile(rb"^\s*from rigidimpulse\.?([\w.]*) import (?:\(|([\w, ]+))", re.MULTILINE)
_NAMED_TUPLE = re.compile(rb"^class \w+\(NamedTuple\):\n(?:[ \t].*\n|\n)*", re.MULTILINE)
_DIGITS = 16
"""Of a digest that are in the name of a folder."""
_KEPT = 4
"""Folders of a module that are kept: one for each of its latest states."""
OF_THIS_PROCESS = "rigidimpulse_kernels_"
"""Begins the name of a folder that other processes do not know of."""
_configuration = threading.Lock()


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
def _digest_of_tuples(package: Path) -> bytes:
    """Digest of the named tuples of a package: kernels take them without importing their modules, and numba keeps their names."""
    digest = hashlib.sha256()
    for module in sorted(package.rglob("*.py")):
        for text in _NAMED_TUPLE.findall(module.read_bytes()):
            digest.update(module.relative_to(package).as_posix().encode() + text)
    return digest.digest()


@cache
def source_digest(path: Path) -> str:
    """Digest of numba's version, of a module's source, of all it imports from the package, and of the tuples of the package."""
    reached, frontier = {path}, {path}
    while frontier:
        frontier = set().union(*(_imported(module) for module in frontier)) - reached
        reached |= frontier
    digest = hashlib.sha256(numba.__version__.encode() + _digest_of_tuples(_PACKAGE))
    for module in sorted(reached):
        digest.update(module.read_bytes())
    return digest.hexdigest()


@cache
def _root(chosen: str) -> Path:
    """The folder that holds the others: of those that can be written, what the user has chosen for numba, the package's, or the user's."""
    of_user = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or os.path.expanduser("~/.cache")
    for place in (*([chosen] if chosen else []), _PACKAGE / "__pycache__", of_user):
        root = Path(place) / "rigidimpulse_kernels"
        try:
            root.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=root).close()
        except OSError:
            continue
        return root
    return Path(tempfile.mkdtemp(prefix=OF_THIS_PROCESS))


@cache
def _folder(path: Path, chosen: str) -> Path:
    """The folder of the kernels of a module as it is now. Those of its states of long ago are removed when it is made."""
    states = _root(chosen) / f"{path.stem}-{hashlib.sha256(bytes(path)).hexdigest()[:_DIGITS]}"
    folder = states / source_digest(path)[:_DIGITS]
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        with suppress(OSError):  # Another process may remove them at the same time.
            for old in sorted(states.iterdir(), key=os.path.getmtime)[:-_KEPT]:
                shutil.rmtree(old, ignore_errors=True)
    return folder


def jit_with_cache(function: Callable[..., Any], **options: Any) -> Any:
    """Make numba's dispatcher of a function, which keeps what it compiles in the function's folder; options: of numba."""
    with _configuration:
        chosen = _numba.config.CACHE_DIR
        _numba.config.CACHE_DIR = str(_folder(Path(function.__code__.co_filename), chosen))
        try:
            return _numba.njit(cache=True, **options)(function)
        finally:
            _numba.config.CACHE_DIR = chosen


def is_in_cache(function: Callable[..., Any]) -> bool:
    """Whether a kernel of these sources lies in the cache on disk, for whatever types: numba keeps an index (`.nbi`) of each."""
    path = Path(function.__code__.co_filename)
    return any(_folder(path, _numba.config.CACHE_DIR).rglob(f"{path.stem}.{function.__qualname__}-*.nbi"))


def note_beside(function: Callable[..., Any], name: str) -> Path:
    """A file in the folder of a kernel of these sources, for what is to be known of it by other processes."""
    return _folder(Path(function.__code__.co_filename), _numba.config.CACHE_DIR) / name


def is_kept() -> bool:
    """Whether other processes will find what this one compiles."""
    return not _root(_numba.config.CACHE_DIR).name.startswith(OF_THIS_PROCESS)
