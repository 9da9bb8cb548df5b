"""Kernels that come compiled with the package are used where they fit, and in no other place."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from small_package import make_package, result, run_with, write

COLLECT = Path(__file__).resolve().parents[1] / "release" / "collect_kernels.py"
GENERIC = {"NUMBA_CPU_NAME": "generic"}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A package with kernels that were compiled elsewhere, for any processor."""
    folder = make_package(tmp_path_factory.mktemp("built"))
    assert result(folder, **GENERIC) == (8.0, 0)
    run_with(folder, [str(COLLECT), str(folder.parent / "ready_kernels")], **GENERIC)
    shutil.rmtree(folder.parent / "__pycache__")
    return folder


@pytest.fixture
def installed(built: Path, tmp_path: Path) -> Path:
    """The folder `core` of the same, installed in another place."""
    shutil.copytree(built.parent.parent, tmp_path / "installed")
    return tmp_path / "installed" / "rigidimpulse" / "core"


def change_fit(folder: Path, **changes: Any) -> None:
    """Change what the ready kernels of a package are said to fit."""
    about = folder.parent / "ready_kernels" / "about.json"
    about.write_text(json.dumps({**json.loads(about.read_text()), **changes}))


def test_ready_kernels_are_loaded_at_the_first_run_and_later(installed: Path) -> None:
    assert result(installed) == (8.0, 1)
    assert result(installed) == (8.0, 1)


def test_they_are_loaded_where_no_file_can_be_kept(installed: Path) -> None:
    """The place for files of the package, of the user and of nobody are one that is no folder."""
    (installed.parent / "__pycache__").touch()
    assert result(installed, HOME="/dev/null") == (8.0, 1)


@pytest.mark.parametrize(
    "changes",
    [
        {"python": "cpython-27"}, {"numba": "0.1"}, {"system": "plan9-mips"}, {"features": "+avx2,+no_such_feature"}, {"other": 1},
    ],
    ids=["python", "numba", "system", "processor", "fields"],
)  # fmt: skip
def test_kernels_that_do_not_fit_are_compiled(installed: Path, changes: dict[str, Any]) -> None:
    change_fit(installed, **changes)
    assert result(installed) == (8.0, 0)


def test_kernels_of_other_sources_are_compiled(installed: Path) -> None:
    write(installed, 2, "Pair", "first", "second")
    assert result(installed) == (9.0, 0)


def test_the_processor_that_the_user_has_named_counts(installed: Path) -> None:
    assert result(installed, NUMBA_CPU_NAME="x86-64") == (8.0, 0)
    assert result(installed, **GENERIC) == (8.0, 1)


def test_kernels_that_everybody_can_write_are_compiled(installed: Path) -> None:
    (installed.parent / "ready_kernels").chmod(0o777)
    assert result(installed) == (8.0, 0)


def test_a_damaged_table_says_nothing(installed: Path) -> None:
    (installed.parent / "ready_kernels" / "about.json").write_text("{")
    assert result(installed) == (8.0, 0)
