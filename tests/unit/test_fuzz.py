"""The search for faults (`tests/bench/fuzz.py`) finds a planted one, makes it simple, and writes a test that fails until it is mended."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bench"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "invariants"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "io"))

import fuzz
from choices import Recorded, Replayed, simpler, smallest
from fuzz_kinds import KINDS, Kind
from scene_plans import make_plan


def draw(seed: int) -> list[float]:
    """A list of numbers, the first of which says how many follow."""
    source = Recorded(seed)
    for _ in range(source.integer(2, 9)):
        source.real(-10.0, 10.0)
    return source.chosen


def faults(chosen: list[float]) -> list[str]:
    """Whether one of the numbers is beyond 3; a big one ends the process."""
    source = Replayed(chosen)
    numbers = [source.real(-10.0, 10.0) for _ in range(source.integer(2, 9))]
    if max(numbers) > 9.5:
        sys.exit(3)
    return [f"there is {max(numbers):g}"] if max(numbers) > 3.0 else []


TESTS = Path(__file__).resolve().parent.parent
PLANTED = Kind("planted", draw, faults, has_choices=True, seconds=5)


def test_planted_fault_is_found_and_kept(tmp_path: Path) -> None:
    """Each test has the case that failed, or a simpler one, and says what is wrong."""
    tests = fuzz.search([PLANTED], 1.5, 0, tmp_path)
    assert tests
    for path in tests:
        space: dict[str, object] = {}
        exec(compile(path.read_text().replace("from fuzz_kinds import KINDS", ""), str(path), "exec"), space)
        case = space["CASE"]
        assert isinstance(case, list)
        assert fuzz.faults_apart(PLANTED, case)
        assert "there is" in path.read_text() or "crashed" in path.read_text()


def test_what_is_left_is_as_simple_as_can_be() -> None:
    """A length, and one number that is just too large."""
    case = smallest([5, 2.5, -7.25, 8.255, 1.0, 6.0], lambda chosen: bool(faults(chosen)), lambda: True)
    assert len(case) <= 3
    assert sum(value > 0.0 for value in case[1:]) == 1


def test_written_tests_run(tmp_path: Path) -> None:
    """A test that is written for a case that is right passes; for one that is wrong it fails. Both from any folder."""
    kind = KINDS["gltf"]
    good, bad = fuzz.write_test(kind, 1, kind.draw(1), ['planted "quotes" \\ and more'], tmp_path), tmp_path / "test_wrong.py"
    bad.write_text(good.read_text().replace("== []", "== ['planted']"))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", str(TESTS.parent / "pyproject.toml")]
    done = subprocess.run([*command, str(good), str(bad)], capture_output=True, text=True, check=False)
    assert "1 failed, 1 passed" in done.stdout, done.stdout


def test_replayed_choices_make_the_same_case() -> None:
    """A list of choices stands for its scene, and any part of it for a simpler one."""
    for seed in range(20):
        source = Recorded(seed)
        plan = make_plan(source)
        assert make_plan(Replayed(source.chosen)) == plan
        assert len(make_plan(Replayed([])).bodies) == 2
        for other in list(simpler(source.chosen))[:30]:
            make_plan(Replayed(other))


def test_smallest_stops_in_time() -> None:
    """What is simplest is looked for only as long as it may be."""
    tries = iter(range(5))
    assert smallest([4.0, 5.0, 6.0], lambda chosen: len(chosen) > 0, lambda: next(tries, None) is not None)


@pytest.mark.parametrize("name", KINDS)
def test_first_cases_have_no_faults(name: str) -> None:
    """One case of each kind, whole."""
    KINDS[name].warm()
    assert fuzz.faults_apart(KINDS[name], KINDS[name].draw(3)) == []
