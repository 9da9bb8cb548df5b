"""Where compiled kernels are kept: a folder for each state of the sources that are in them.

Numba's own cache knows only the file that a function stands in, not those of the functions it calls, nor those of the tuples it is given.
Here the name of the folder is a digest of the sources of all modules that a kernel's module imports, directly or not, and of all named
tuples of the package. So no kernel ever runs with an old version of another one inside it, and what was kept for an older version of a
tuple is never read. Numba is told of the folder in the public way, by `numba.config.CACHE_DIR`. Each Python, and each processor that is
compiled for, has folders of its own.

Numba has one folder for reading and writing. Kernels that lie compiled in a folder that is only read, of the package
(`ready_kernels.py`) or of an administrator (`kernel_places.py`), are copied to that one when they are first used.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import shutil
import site
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba

from rigidimpulse.core.kernel_places import FOR_ALL_TO_READ, OF_THIS_PROCESS, PACKAGE, other_roots, writable_root
from rigidimpulse.core.processor import target_processor
from rigidimpulse.core.ready_kernels import compile_for_ready_kernels, ready_folder

_numba: Any = numba
_IMPORT = re.compile(rb"^\s*from rigidimpulse\.?([\w.]*) import (?:\(|([\w, ]+))", re.MULTILINE)
_NAMED_TUPLE = re.compile(rb"^class \w+\(NamedTuple\):\n(?:[ \t].*\n|\n)*", re.MULTILINE)
_DIGITS = 16
"""Of a digest that are in the name of a folder."""
_KEPT = 4
"""Folders of a module that are kept for a Python and a processor: one for each of its latest states."""
_INDEX, _KERNEL = ".nbi", ".nbc"
"""Suffixes of numba's files: which kernels there are of a function, and a kernel."""
CLAIM = ".lock"
"""Suffix of the files that processes lock while they compile."""
_configuration = threading.Lock()
# Before the first kernel: numba asks but once what to compile for.
compile_for_ready_kernels()


@cache
def _imported(path: Path) -> frozenset[Path]:
    """Modules of the package that a module imports."""
    found = set()
    for module, names in _IMPORT.findall(path.read_bytes()):
        base = PACKAGE.joinpath(*module.decode().split(".")) if module else PACKAGE
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
    digest = hashlib.sha256(numba.__version__.encode() + _digest_of_tuples(PACKAGE))
    for module in sorted(reached):
        digest.update(module.read_bytes())
    return digest.hexdigest()


def _name_of_states(path: Path) -> str:
    """Name of the folder with the states of a module, for this Python and the processor that is compiled for."""
    what = "\n".join([str(path), sys.implementation.cache_tag or "", target_processor()])
    return f"{path.stem}-{hashlib.sha256(os.fsencode(what)).hexdigest()[:_DIGITS]}"


@cache
def kernel_folder(path: Path, chosen: str) -> Path:
    """Return the folder of the kernels of a module as it is now. Those of its states of long ago are removed when it is made.

    chosen: the folder that the user has named for numba, "" for none.
    """
    states = writable_root(chosen) / _name_of_states(path)
    folder = states / source_digest(path)[:_DIGITS]
    if not folder.is_dir():
        states.mkdir(FOR_ALL_TO_READ, exist_ok=True)
        folder.mkdir(FOR_ALL_TO_READ, exist_ok=True)
        with suppress(OSError):  # Another process may remove them at the same time.
            for old in sorted(states.iterdir(), key=os.path.getmtime)[:-_KEPT]:
                shutil.rmtree(old, ignore_errors=True)
        for place in _read_only_folders(path, chosen):
            _copy((file for file in place.iterdir() if _is_note(file)), folder)
    return folder


def _read_only_folders(path: Path, chosen: str) -> Iterator[Path]:
    """Folders that are only read, with compiled kernels of a module as it is now."""
    digest = source_digest(path)[:_DIGITS]
    ready = ready_folder(path, digest)
    places = [root / _name_of_states(path) / digest for root in other_roots(chosen)]
    yield from (place for place in (*([ready] if ready else []), *places) if place.is_dir())


def _is_note(file: Path) -> bool:
    """Whether a file was made by `note_beside`, for good."""
    return file.is_file() and file.suffix not in (_INDEX, _KERNEL, CLAIM)


def _compiled(folder: Path, path: Path, function: Callable[..., Any]) -> list[Path]:
    """What numba has put into a folder of a function, kernels before the index that names them."""
    return sorted(folder.rglob(f"{path.stem}.{function.__qualname__}-*.nb[ic]"), key=lambda file: file.suffix)


def _copy(files: Iterator[Path] | list[Path], folder: Path) -> None:
    """Copy files into a folder, whole or not at all; those that are there stay as they are."""
    with suppress(OSError):  # What is not there is compiled.
        for file in files:
            target, part = folder / file.name, folder / f"{file.name}.{secrets.token_hex(4)}"
            if not target.exists():
                shutil.copyfile(file, part)
                part.replace(target)


def jit_with_cache(function: Callable[..., Any], **options: Any) -> Any:
    """Make numba's dispatcher of a function, which keeps what it compiles in the function's folder; options: of numba."""
    with _configuration:
        chosen = _numba.config.CACHE_DIR
        path = Path(function.__code__.co_filename)
        _numba.config.CACHE_DIR = str(kernel_folder(path, chosen))
        try:
            made = _numba.njit(cache=True, **options)(function)
        finally:
            _numba.config.CACHE_DIR = chosen
    for place in _read_only_folders(path, chosen):
        _copy(_compiled(place, path, function), Path(made.stats.cache_path))
    return made


def is_in_cache(function: Callable[..., Any]) -> bool:
    """Whether a kernel of these sources lies compiled on disk, for whatever types: numba keeps an index of each."""
    path, chosen = Path(function.__code__.co_filename), _numba.config.CACHE_DIR
    places = (kernel_folder(path, chosen), *_read_only_folders(path, chosen))
    return any(file.suffix == _INDEX for place in places for file in _compiled(place, path, function))


def note_beside(function: Callable[..., Any], name: str) -> Path:
    """A file in the folder of a kernel of these sources, for what is to be known of it by other processes."""
    return kernel_folder(Path(function.__code__.co_filename), _numba.config.CACHE_DIR) / name


def is_kept() -> bool:
    """Whether other processes will find what this one compiles."""
    return not _root_of_this_process().parent.name.startswith(OF_THIS_PROCESS)


def variables_to_share_kernels() -> dict[str, str]:
    """Return environment variables for a process that is to put its kernels where this one finds them.

    Started with `python -P`, it imports this very package, and no folder of its name in the present one, such as that of a clone.
    """
    variables, root = dict(os.environ), str(Path(__file__).resolve().parents[2])
    if not is_kept():
        variables["NUMBA_CACHE_DIR"] = str(_root_of_this_process().parent)
    # Where Python finds it anyway: before the standard library these packages might hide parts of that.
    if root not in site.getsitepackages():
        variables["PYTHONPATH"] = os.pathsep.join([root, *filter(None, [variables.get("PYTHONPATH")])])
    return variables


def _root_of_this_process() -> Path:
    return writable_root(_numba.config.CACHE_DIR)
