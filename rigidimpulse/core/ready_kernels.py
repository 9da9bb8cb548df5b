"""Kernels that come compiled with the package, in wheels for one Python, one numba and a class of processors.

They lie in the folder `ready_kernels` of the package, by module and digest of its sources, with a table that says what they fit. Where
they do, this process compiles for that class of processors instead of this very one (`numba.config.CPU_NAME`, as `NUMBA_CPU_NAME` does),
so that numba takes them for its own. Results have the same bits either way. Where the user has named a processor, that counts.

`tests/release/ready_wheel.py` makes such wheels.
"""

from __future__ import annotations

import json
import sys
import sysconfig
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numba

from rigidimpulse.core.kernel_places import PACKAGE, others_can_write
from rigidimpulse.core.processor import machine_features

_numba: Any = numba
FOLDER = PACKAGE / "ready_kernels"
ABOUT = "about.json"
"""The table that says what they fit."""


@dataclass(frozen=True)
class Fit:
    """What compiled kernels fit.

    Attributes:
        python: implementation and version, as in names of bytecode. system: platform. numba: its version.
        processor, features: what they were compiled for, by LLVM's names: "x86-64-v3" and "+avx2,+fma".

    """

    python: str
    system: str
    numba: str
    processor: str
    features: str

    @classmethod
    def here(cls, processor: str, features: str) -> Fit:
        """Return what kernels fit that this process compiles for such a processor."""
        return cls(sys.implementation.cache_tag or "", sysconfig.get_platform(), numba.__version__, processor, features)

    def is_here(self) -> bool:
        """Whether they fit this process and this machine, and the user has not asked for another processor."""
        config, has = _numba.config, machine_features()
        as_asked = config.CPU_NAME in (None, self.processor) and config.CPU_FEATURES in (None, self.features)
        can = all(has.get(word.removeprefix("+"), False) for word in self.features.split(",") if word)
        return as_asked and can and self == Fit.here(self.processor, self.features)


@cache
def fit_of(folder: Path) -> Fit | None:
    """Return what the kernels of a folder fit, if that is this process; None where they do not, or where there are none."""
    try:
        if others_can_write(folder):
            return None
        fit = Fit(**json.loads((folder / ABOUT).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
    return fit if fit.is_here() else None


def compile_for_ready_kernels() -> None:
    """Have numba compile for the processor of the kernels that come with the package, if they fit."""
    fit = fit_of(FOLDER)
    if fit is not None:
        _numba.config.CPU_NAME, _numba.config.CPU_FEATURES = fit.processor, fit.features


def ready_folder(module: Path, digest: str) -> Path | None:
    """Return the folder with the compiled kernels of a module in the state of a digest, if there is one and it fits."""
    if fit_of(FOLDER) is None or not module.is_relative_to(PACKAGE):
        return None
    folder = FOLDER / module.relative_to(PACKAGE).with_suffix("") / digest
    return folder if folder.is_dir() else None
