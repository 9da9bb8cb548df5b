"""Copies of the package in which a test changes the source, and programs that run against such a copy.

Kernels run as the Python that they are written in (NUMBA_DISABLE_JIT), so that nothing is compiled; no kernel with SIMD vectors can.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from shutil import copy2, copytree, ignore_patterns

from rules import PACKAGE

TIME_LIMIT = 300.0
"""s for a program: some hundred times what it needs."""


def copy_package(folder: Path) -> Path:
    """Copy the package, without compiled kernels, into a folder; returns the folder."""
    copytree(PACKAGE, folder / PACKAGE.name, ignore=ignore_patterns("*.nbi", "*.nbc"))
    return folder


@contextmanager
def changed(folder: Path, source: str, *changes: tuple[str, str]) -> Iterator[None]:
    """Replace texts, each of which occurs once, in one source of a copy, and put it back at the end."""
    path = folder / PACKAGE.name / source
    text = path.read_text(encoding="utf-8")
    for right, wrong in changes:
        assert text.count(right) == 1, f"{source} has {right!r} {text.count(right)} times"
        text = text.replace(right, wrong)
    path.write_text(text, encoding="utf-8")
    try:
        yield
    finally:
        # With its time, so that Python takes what it has compiled of it.
        copy2(PACKAGE / source, path)


def run_against(folder: Path, arguments: Sequence[str], **variables: str) -> subprocess.CompletedProcess[str]:
    """Run Python with arguments, so that it imports the copy in a folder; variables: of its environment, beside the usual ones."""
    usual = {"NUMBA_DISABLE_JIT": "1", "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(folder)}
    # Python looks for modules in the working directory first.
    command, environment = [sys.executable, *arguments], {**os.environ, **usual, **variables}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=TIME_LIMIT)
