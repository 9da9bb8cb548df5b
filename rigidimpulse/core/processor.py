"""The processor that numba compiles for: this machine's, or the one that `NUMBA_CPU_NAME` and `NUMBA_CPU_FEATURES` name."""

from __future__ import annotations

from typing import Any

import llvmlite.binding
import numba

_numba: Any = numba


def machine_features() -> dict[str, bool]:
    """Return what this machine's processor has, by LLVM's names; nothing where LLVM cannot tell."""
    try:
        return dict(llvmlite.binding.get_host_cpu_features())
    except RuntimeError:
        return {}


def target_features() -> frozenset[str]:
    """Return what kernels may use of a processor, by LLVM's names."""
    chosen = _numba.config.CPU_FEATURES
    if chosen is None:
        return frozenset(name for name, there in machine_features().items() if there)
    return frozenset(word[1:] for word in chosen.split(",") if word.startswith("+"))


def target_processor() -> str:
    """Return the processor that kernels are compiled for, in a line: LLVM's name, then its features."""
    name = _numba.config.CPU_NAME or llvmlite.binding.get_host_cpu_name()
    return ",".join([name, *sorted(target_features())])
