"""Compiled kernels are kept by the state of all sources that are in them."""

from __future__ import annotations

from pathlib import Path

import numba
import pytest
from small_package import make_package, result, write

from rigidimpulse.core.kernel_cache import is_in_cache, jit_with_cache
from rigidimpulse.core.kernel_places import writable_root


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """The folder `core` of a small package."""
    return make_package(tmp_path)


def test_a_kernel_is_compiled_again_when_one_that_it_calls_changes(package: Path) -> None:
    assert result(package) == (8.0, 0)
    assert result(package) == (8.0, 1)
    write(package, 2, "Pair", "first", "second")
    assert result(package) == (9.0, 0)


def test_a_kernel_is_compiled_again_when_a_tuple_changes_whose_module_it_does_not_import(package: Path) -> None:
    """Numba's index holds the name of the tuple's class: once that is renamed, the old index cannot be read."""
    assert result(package) == (8.0, 0)
    write(package, 1, "Couple", "first", "second")
    assert result(package) == (8.0, 0)
    write(package, 1, "Couple", "second", "first")
    assert result(package) == (3.0 + 1.0 - 10.0, 0)


def test_a_processor_has_kernels_of_its_own(package: Path) -> None:
    """Two in one folder, as on a disk that machines share: neither takes the place of the other, and it is known which there are."""
    generic = {"NUMBA_CPU_NAME": "generic"}
    assert result(package) == (8.0, 0)
    assert result(package, **generic) == (8.0, 0)
    assert result(package) == result(package, **generic) == (8.0, 1)


def test_folders_of_old_states_are_removed(package: Path) -> None:
    for number in range(1, 7):
        write(package, number, "Pair", "first", "second")
        result(package)
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
    assert writable_root(str(occupied)).is_dir()


def _twice(x: float) -> float:
    return 2.0 * x
