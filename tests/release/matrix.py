"""The release matrix: the wheel, installed and run in clean environments on every Python of this machine.

    python tests/release/matrix.py WORK                        all; WORK: a folder for what is built, some GB
    python tests/release/matrix.py WORK --python 3.12.1        one Python; may be repeated
    python tests/release/matrix.py WORK --keep                 the result goes to docs/results/data/, for the results page "Release"

Each Python gets an environment with the oldest dependencies that the package allows and one with the newest. In each, outside of the clone,
`smoke.py` makes the first picture and uses the main parts. The hashes of all runs must be the same everywhere. On one Python the same is
done for other processors, without a home, where nothing can be written, and with two first runs at once. Takes a quarter of an hour.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from environments import (
    NEWEST,
    OLDEST,
    PLAIN,
    ROOT,
    Environment,
    Interpreter,
    build_wheel,
    clean_variables,
    find_pythons,
    find_uv,
    make_environment,
    run,
    said,
)

SMOKE, HASHES = Path(__file__).with_name("smoke.py"), ROOT / "tests" / "bench" / "state_hashes.py"
RESULTS = ROOT / "docs" / "results"
PINNED = ROOT / "tests" / "determinism" / "gallery_hashes.txt"
DURATION = "0.2"
"""s of motion of a scene whose hash is pinned."""
FEW = ("spot", "tumbling_box", "wing_nut")
"""Scenes whose pinned hashes are compared in every environment: they need few kernels."""
GENERIC = {"NUMBA_CPU_NAME": "generic"}
OLD_PROCESSOR = {
    **GENERIC, "OPENBLAS_CORETYPE": "Prescott", "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-AVX,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable",
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V3 X86_V4",
}  # fmt: skip
"""A processor without AVX: for kernels, for the libraries of linear algebra and of functions, and for numpy."""
COLUMNS = ("python", "dependencies", "conditions", "seconds", "processor_seconds", "compiled", "loaded", "hashes", "result")
LIMIT = 1500
"""s for one run."""
WITHOUT_RIGHTS = ("setpriv", "--bounding-set", "-dac_override,-dac_read_search", "--inh-caps", "-dac_override,-dac_read_search")
"""Before a command of the administrator, who could write everywhere else."""


@dataclass
class Row:
    """What became of one run: where, on what conditions, what the smoke test told, and the hashes by name."""

    environment: Environment
    conditions: str
    told: dict[str, Any]
    hashes: dict[str, str] = field(default_factory=dict)

    @property
    def wrong(self) -> list[str]:
        """What failed."""
        return [f"{step}: {said}" for step, said in self.told.get("steps", {"run": self.told.get("error", "")}).items() if said != "ok"]


@dataclass(frozen=True)
class Conditions:
    """On what conditions a run goes: words for the table, variables, what stands before the command, and whether it has a home."""

    words: str
    variables: dict[str, str] = field(default_factory=dict)
    before: tuple[str, ...] = ()
    home: bool = True
    first_only: bool = False


class Matrix:
    """All runs, and the hashes that they must have."""

    def __init__(self, work: Path) -> None:
        self.work, self.rows = work, list[Row]()
        self._runs = 0

    def _place(self) -> Path:
        """An empty folder for a run."""
        self._runs += 1
        place = self.work / "runs" / str(self._runs)
        shutil.rmtree(place, ignore_errors=True)
        (place / "home").mkdir(parents=True)
        return place

    def start(self, environment: Environment, conditions: Conditions) -> subprocess.Popen:
        """Start the smoke test in an environment."""
        place = self._place()
        variables = clean_variables(place / "home" if conditions.home else None, **conditions.variables)
        command = [*conditions.before, str(environment.python), str(SMOKE), *(["first"] if conditions.first_only else [])]
        # In a session of its own: what compiles in the background ends with it.
        return subprocess.Popen(
            command, cwd=place, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
        )

    def end(self, process: subprocess.Popen, environment: Environment, conditions: Conditions) -> Row:
        """Wait for the smoke test, keep and print what became of it."""
        try:
            out, errors = process.communicate(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            out, errors = "", f"not done in {LIMIT} s"
        finally:
            end_session(process)
        try:
            told: dict[str, Any] = json.loads(out.splitlines()[-1])
            if str(ROOT) in told["package"]:
                told["steps"]["package"] = "the clone was imported"
        except (IndexError, ValueError):
            told = {"error": errors.strip()[-500:]}
        row = Row(environment, conditions.words, told, {**told.get("hashes", {})})
        self.rows.append(row)
        print(f"{environment.version}, {environment.dependencies}, {conditions.words}: {told}", flush=True)
        return row

    def run(self, environment: Environment, conditions: Conditions, names: tuple[str, ...] = FEW) -> Row:
        """Run the smoke test, and then the scenes whose hashes are pinned."""
        row = self.end(self.start(environment, conditions), environment, conditions)
        if names and not row.wrong:
            row.hashes |= self.hashes(environment, conditions, names)
        return row

    def hashes(self, environment: Environment, conditions: Conditions, names: tuple[str, ...]) -> dict[str, str]:
        """Hashes of the beginnings of scenes in an environment."""
        place = self._place()
        variables = clean_variables(place / "home" if conditions.home else None, **conditions.variables)
        command = [*conditions.before, str(environment.python), str(HASHES), *names, "--duration", DURATION, "--limit", str(LIMIT)]
        process = subprocess.Popen(command, cwd=place, env=variables, stdout=subprocess.PIPE, text=True, start_new_session=True)
        out, _ = process.communicate()
        end_session(process)
        return {line.split()[0]: line.split()[1] for line in out.splitlines()}

    def wanted(self) -> dict[str, str]:
        """The hash that each run must have: the pinned one, or that of the first row."""
        first = next((row.hashes for row in self.rows if row.hashes), {})
        return {**first, **dict(line.split() for line in PINNED.read_text().splitlines())}

    def differing(self, row: Row) -> list[str]:
        """Names of runs of a row that have other hashes."""
        wanted = self.wanted()
        return sorted(name for name, found in row.hashes.items() if found != wanted.get(name, found))

    def table(self) -> Iterator[tuple[object, ...]]:
        """Cells of the rows."""
        for row in self.rows:
            numbers = [row.told.get(name, "") for name in ("seconds", "processor seconds", "compiled", "loaded")]
            differing, number = self.differing(row), len(row.hashes)
            hashes = f"{number} of {number} the same" if not differing else f"other: {', '.join(differing)}"
            dependencies = f"{row.environment.dependencies}: {versions(row.environment)}"
            yield (row.environment.version, dependencies, row.conditions, *numbers, hashes, "; ".join(row.wrong) or "ok")


def versions(environment: Environment) -> str:
    """Versions of the dependencies that compute."""
    return ", ".join(f"{name} {environment.installed[name]}" for name in ("numpy", "scipy", "numba", "trimesh"))


def end_session(process: subprocess.Popen) -> None:
    """End a process and all that it has started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    process.wait()


def close(folder: Path, closed: bool) -> None:
    """Take the right to write in a folder, and in those in it, or give it back."""
    for place in (folder, *(path for path in folder.rglob("*") if path.is_dir() and not path.is_symlink())):
        place.chmod(0o555 if closed else 0o755)


def run_on_all(matrix: Matrix, pythons: list[Interpreter], uv: Path, wheel: Path) -> None:
    """Every Python with the oldest and with the newest dependencies; they share one folder of kernels, which is empty at first."""
    shared = {"NUMBA_CACHE_DIR": str(matrix.work / "shared")}
    shutil.rmtree(matrix.work / "shared", ignore_errors=True)
    environments = [
        make_environment(uv, python, dependencies, wheel, matrix.work / f"{python.version}-{dependencies}")
        for python in pythons for dependencies in (OLDEST, NEWEST)
    ]  # fmt: skip
    for environment in environments:
        matrix.run(environment, Conditions("a cold cache, shared by all", shared))
    for environment in environments:
        row = matrix.run(environment, Conditions("the shared cache, warm", shared, first_only=True), ())
        if row.told.get("compiled", 1):
            row.told["steps"]["cache"] = "kernels were compiled again"


def run_on_conditions(matrix: Matrix, python: Interpreter, uv: Path, wheel: Path) -> None:
    """One environment as `pip install` makes it: nothing can be written, two first runs at once, other processors, no home, read-only."""
    before = WITHOUT_RIGHTS if os.geteuid() == 0 else ()
    environment = make_environment(uv, python, PLAIN, wheel, matrix.work / "plain")
    close(environment.folder, True)
    matrix.run(environment, Conditions("cold, without a home, nothing can be written but the current folder", {}, before, home=False), ())
    close(environment.folder, False)
    cold = Conditions("for a generic processor, one of two first runs at once", GENERIC, first_only=True)
    both = [matrix.start(environment, cold) for _ in range(2)]
    for process in both:
        matrix.end(process, environment, cold)
    matrix.run(environment, Conditions("for a generic processor, warm", GENERIC))
    matrix.run(environment, Conditions("the same, with libraries as on a processor without AVX and FMA", OLD_PROCESSOR))
    close(environment.folder, True)
    read_only = Conditions(
        "the same kernels in a package that cannot be written, without a home", GENERIC, before, home=False, first_only=True
    )
    row = matrix.run(environment, read_only, ())
    close(environment.folder, False)
    if row.told.get("compiled", 1):
        row.told["steps"]["cache"] = "kernels of the read-only package were not used"


def main() -> int:
    """Run and print the matrix; the exit code is 1 where something failed or a hash differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", type=Path, help="a folder for what is built")
    parser.add_argument("--python", action="append", help="versions; all that this machine has if none is named")
    parser.add_argument("--keep", action="store_true", help="keep the result as data of the results page")
    options = parser.parse_args()
    work = options.work.resolve()
    work.mkdir(parents=True, exist_ok=True)
    pythons = [python for python in find_pythons() if not options.python or python.version in options.python]
    if not pythons:
        sys.exit("there is no such Python on this machine")
    uv = find_uv(work)
    wheel = build_wheel(uv, work / "dist")
    matrix = Matrix(work)
    run_on_all(matrix, pythons, uv, wheel)
    run_on_conditions(matrix, pythons[0], uv, wheel)
    rows = list(matrix.table())
    for row in rows:
        print(*row, sep=" | ")
    if options.keep:
        keep(rows, said(work))
    failed = [row for row in matrix.rows if row.wrong or matrix.differing(row)]
    print(f"{len(matrix.rows) - len(failed)} passed, {len(failed)} failed")
    return bool(failed)


def keep(rows: list[tuple[object, ...]], command: str) -> None:
    """Write the table to the data of the results pages, with machine, commit and command."""
    path = RESULTS / "data" / "release_matrix.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])
    run([sys.executable, RESULTS / "provenance.py", path, command])


if __name__ == "__main__":
    sys.exit(main())
