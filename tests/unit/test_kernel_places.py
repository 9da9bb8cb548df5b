"""Folders of kernels: one that only an administrator can write to is read, one that everybody can write to is not even that."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from small_package import make_package, result

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="rights of folders")
WITHOUT_RIGHTS = ("setpriv", "--bounding-set", "-dac_override") if os.name == "posix" and os.geteuid() == 0 else ()
"""Before a command of the administrator, whom rights do not bind."""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """The folder `core` of a small package."""
    return make_package(tmp_path / "package")


@pytest.fixture
def closed(package: Path) -> Iterator[list[Path]]:
    """Folders that cannot be written to any more; a test adds to them by `close`, and they are opened again at the end."""
    folders: list[Path] = []
    yield folders
    for folder in folders:
        folder.chmod(0o755)


def close(closed: list[Path], top: Path) -> None:
    """Take the right to write in a folder and in all that it contains."""
    for folder in (top, *(path for path in top.rglob("*") if path.is_dir())):
        folder.chmod(0o555)
        closed.append(folder)


def test_kernels_of_a_package_that_cannot_be_written_are_used(package: Path, closed: list[Path], tmp_path: Path) -> None:
    """As an administrator has compiled them: with a home, and with nothing that can be written."""
    home = tmp_path / "home"
    home.mkdir()
    assert result(package) == (8.0, 0)
    close(closed, package.parent)
    assert result(package, WITHOUT_RIGHTS, HOME=str(home)) == (8.0, 1)
    assert list(home.rglob("*.nbi"))
    close(closed, home)
    assert result(package, WITHOUT_RIGHTS, HOME=str(home), XDG_CACHE_HOME=str(home / "none")) == (8.0, 1)


def test_a_folder_of_this_process_goes_with_it(package: Path, closed: list[Path], tmp_path: Path) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    close(closed, package.parent)
    assert result(package, WITHOUT_RIGHTS, HOME="/nowhere/at/all", TMPDIR=str(temporary)) == (8.0, 0)
    assert list(temporary.iterdir()) == []


def test_kernels_that_everybody_can_write_are_not_used(package: Path, tmp_path: Path) -> None:
    assert result(package, HOME=str(tmp_path)) == (8.0, 0)
    root = package.parent / "__pycache__" / "rigidimpulse_kernels"
    root.chmod(0o777)
    assert result(package, HOME=str(tmp_path)) == (8.0, 0)
    assert list((tmp_path / ".cache" / "rigidimpulse_kernels").iterdir())
    root.chmod(0o755)
    root.parent.chmod(0o777)
    assert result(package, HOME=str(tmp_path / "other")) == (8.0, 0)


def test_a_folder_that_the_user_has_named_is_used_as_it_is(package: Path, tmp_path: Path) -> None:
    """Several users share it: they have said so."""
    shared = tmp_path / "shared"
    shared.mkdir()
    assert result(package, NUMBA_CACHE_DIR=str(shared)) == (8.0, 0)
    (shared / "rigidimpulse_kernels").chmod(0o777)
    assert result(package, NUMBA_CACHE_DIR=str(shared)) == (8.0, 1)


def test_without_a_home_nothing_is_written_to_the_current_folder(package: Path, closed: list[Path]) -> None:
    """Of a user whom the system does not know, nothing is left of the home but the "~"."""
    close(closed, package.parent)
    assert result(package, WITHOUT_RIGHTS, HOME="~") == (8.0, 0)
    assert not (package.parent.parent / "~").exists()
