"""Look for faults for a while, and write a regression test for each.

    python tests/bench/fuzz.py SECONDS [--cases N] [--seed N] [--kind NAME ...]

Cases of all kinds come in turn, each with a seed of its own, and each in a process of its own. What fails is made simpler for a while. A
test of it is written to tests/regressions (or --output), which fails as long as the fault is there. The exit code is 1 if anything failed.
The same seed gives the same cases; how many there are depends on the machine. `fuzz_kinds.py` says what the kinds are and what counts as a
fault.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bench"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "invariants"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "io"))

from apart import apart
from choices import smallest
from fuzz_kinds import KINDS, Kind

HERE = Path(__file__).resolve().parent
REGRESSIONS = HERE.parent / "regressions"
SHRINKING = 60.0
"""s for which a case is made simpler at most."""
MOST_REASON = 300
"""Letters of what is wrong that a test begins with."""
TEST = '''"""Found by tests/bench/fuzz.py, kind {kind}, seed {seed}: {reason}"""

import sys
from pathlib import Path

TESTS = {tests}
sys.path.extend(str(TESTS / folder) for folder in ("bench", "invariants", "io"))

from fuzz_kinds import KINDS

CASE = {case}


def test_{name}() -> None:
    assert KINDS["{kind}"].faults(CASE) == []
'''


def faults_apart(kind: Kind, case: Any) -> list[str]:
    """What is wrong with a case."""
    found = apart(kind.faults, case, seconds=kind.seconds, memory=kind.memory)
    return [found] if isinstance(found, str) else found


def shrunk(kind: Kind, case: Any, seconds: float) -> Any:
    """The simplest case found in this time that fails as well; as it is where the kind has no choices to leave out."""
    if not kind.has_choices:
        return case
    end = perf_counter() + seconds
    return smallest(case, lambda other: bool(faults_apart(kind, other)), lambda: perf_counter() < end)


def write_test(kind: Kind, seed: int, case: Any, told: list[str], folder: Path) -> Path:
    """Write a test that fails as long as the case does; return its path."""
    name = f"fuzz_{kind.name}_{seed}"
    tests = "Path(__file__).resolve().parent.parent" if folder.resolve() == REGRESSIONS else f"Path({str(HERE.parent)!r})"
    reason = "; ".join(told).replace("\\", "/").replace('"', "'")[:MOST_REASON]
    path = folder / f"test_{name}.py"
    path.write_text(TEST.format(kind=kind.name, seed=seed, reason=reason, tests=tests, case=repr(case), name=name), encoding="utf-8")
    return path


def search(kinds: list[Kind], seconds: float, seed: int, folder: Path, cases: float = math.inf) -> list[Path]:
    """Try cases for some time, or a number of each kind; return the tests that were written."""
    start, count, tests = perf_counter(), Counter[str](), list[Path]()
    for kind in kinds:
        kind.warm()
    first = seed
    while perf_counter() - start < seconds and seed - first < cases:
        for kind in kinds:
            case = kind.draw(seed)
            told = faults_apart(kind, case)
            count[kind.name] += 1
            if told:
                print(f"{kind.name}, seed {seed}: {'; '.join(told)}", flush=True)
                left = max(seconds - (perf_counter() - start), 0.0)
                tests.append(write_test(kind, seed, shrunk(kind, case, min(SHRINKING, left)), told, folder))
                print(f"wrote {tests[-1]}", flush=True)
            if perf_counter() - start >= seconds:
                break
        seed += 1
    tried = ", ".join(f"{number} {name}" for name, number in count.items())
    print(f"{tried}; {len(tests)} failed, {perf_counter() - start:.0f} s; go on with --seed {seed}")
    return tests


def main() -> int:
    """Search; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", type=float)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cases", type=float, default=math.inf, help="of each kind, at most")
    parser.add_argument("--kind", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--output", type=Path, default=REGRESSIONS, help="folder for the tests")
    arguments = parser.parse_args()
    kinds = [KINDS[name] for name in arguments.kind]
    return int(bool(search(kinds, arguments.seconds, arguments.seed, arguments.output, arguments.cases)))


if __name__ == "__main__":
    sys.exit(main())
