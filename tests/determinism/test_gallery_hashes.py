"""Runs have the bits that are pinned in a file: one hash for all Pythons, versions of the libraries and targets of the compiler.

The file has the hash of the first 0.2 s of every gallery scene. Here some of them are repeated; `tests/release/matrix.py` repeats them
with the oldest and the newest dependencies and for other processors, `tests/release/ready_wheel.py` repeats all. Whoever moves results on
purpose writes the file again:

    python tests/bench/state_hashes.py --duration 0.2 NAMES

What leads to a motion calls no function that chooses its code by the processor and rounds otherwise (`core/portable.py`). LAPACK is left:
the three scenes of energies that are minimised (`MINIMISED`) have other hashes with OpenBLAS's code for other processors. So would soft
bodies that touch movable bodies, and concave meshes in sub-stepped islands.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import rigidimpulse as ri
from rigidimpulse import gallery

HERE = Path(__file__).resolve().parent
PINNED = dict(line.split() for line in (HERE / "gallery_hashes.txt").read_text(encoding="utf-8").splitlines())
DURATION = 0.2
FEW = (
    "spot", "bounce", "tumbling_box", "wing_nut", "disks_in_a_box", "superball", "galperin_1", "rolling", "pile", "pendulum", "arm",
    "penalty_bounce", "planets", "parachute", "trampoline", "emergency_stop",
)  # fmt: skip
MINIMISED = {"smoothed_path", "settled_layout", "pinned_shapes"}
OLD_LIBRARIES = {
    "OPENBLAS_CORETYPE": "Prescott",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-AVX,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable",
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V3 X86_V4",
}
"""BLAS, the library of functions (libm) and numpy choose their code by the processor: this is what they do on one without AVX."""
NEW_LIBRARIES = {"OPENBLAS_CORETYPE": "SkylakeX"}
"""What BLAS does on a processor with AVX-512."""


def test_every_gallery_scene_is_pinned() -> None:
    assert set(PINNED) == set(gallery.names())
    assert all(len(found) == 16 and int(found, 16) for found in PINNED.values())


@pytest.mark.parametrize("name", FEW)
def test_a_scene_has_the_pinned_bits(name: str) -> None:
    entry = gallery.load(name)
    run = ri.simulate(entry.scene(), DURATION, entry.fps, accuracy=entry.accuracy)
    assert run.state_hash()[:16] == PINNED[name]


@pytest.mark.skipif(sys.platform != "linux", reason="variables of Linux")
@pytest.mark.parametrize("libraries", [OLD_LIBRARIES, NEW_LIBRARIES])
def test_the_bits_do_not_depend_on_what_libraries_make_of_the_processor(libraries: dict[str, str]) -> None:
    names = sorted(set(FEW) - MINIMISED)
    program = HERE.parent / "bench" / "state_hashes.py"
    command = [sys.executable, "-W", "ignore", str(program), *names, "--duration", str(DURATION), "--jobs", "1"]
    done = subprocess.run(command, env={**os.environ, **libraries}, capture_output=True, text=True, check=True)
    assert {line.split()[0]: line.split()[1] for line in done.stdout.splitlines()} == {name: PINNED[name] for name in names}
