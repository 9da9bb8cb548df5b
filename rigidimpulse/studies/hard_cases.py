"""The hard-case suite: every case in a process of its own, with a time limit, at default settings.

A case that hangs, crashes or is killed is a row of the table that failed, and never the end of the suite. The checks of a
case (value, bound, law) are those of its gallery scene; a scene that names cheaper settings is run with them too, and must
fail there: both sides of the option.
"""

from __future__ import annotations

import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

from rigidimpulse import gallery
from rigidimpulse.core.files import make_folder
from rigidimpulse.core.version import VERSION
from rigidimpulse.gallery.hard import FAMILIES
from rigidimpulse.gallery.record import Check, GalleryScene

LIMIT = 120.0
"""s for a case, all included."""
PASSED, FAILED, HUNG, CRASHED = "passed", "failed", "hung", "crashed"
LAST_WORDS = 300
"""Characters of an error that are kept."""


@dataclass(frozen=True)
class CaseResult:
    """What became of a case.

    Attributes:
        name: of the gallery scene. description: its line. family: title of its family.
        outcome: "passed", "failed" (a check), "hung" (over the limit) or "crashed".
        checks: of each: what, value, bound, relation, passed, law. A value that is not finite is None.
        seconds: s of the simulation and its checks, or until it was ended. duration: s of motion.
        impacts: how many. message: status of the run, or last words of the process.
        state_hash: SHA-256 of all frames and impacts; empty if there was no run.
        elsewhere: what common engines reach, as measured.

    """

    name: str
    description: str
    family: str
    outcome: str
    checks: list[dict[str, Any]] = field(default_factory=list)
    seconds: float = 0.0
    duration: float = 0.0
    impacts: int = 0
    message: str = ""
    state_hash: str = ""
    elsewhere: str = ""

    @property
    def passed(self) -> bool:
        """Whether all checks hold."""
        return self.outcome == PASSED

    @property
    def main_check(self) -> dict[str, Any] | None:
        """The check that says most in one line: the first that failed, else the first error with a bound, else the first."""
        failed = [check for check in self.checks if not check["passed"]]
        errors = [check for check in self.checks if check["relation"] == "at most" and check["bound"]]
        return next(iter(failed + errors + self.checks), None)


def run_suite(
    names: Sequence[str] | None = None, limit: float = LIMIT, report: Callable[[CaseResult], None] | None = None
) -> list[CaseResult]:
    """Run cases, each in a process of its own.

    Args:
        names: of hard cases; None for all.
        limit: s for each.
        report: called with each result as soon as it is there.

    Returns:
        The results in the order of the names.

    Raises:
        SceneError: an unknown name, or a limit that is not above 0.

    """
    from rigidimpulse.core.errors import SceneError, unknown_name

    if not limit > 0.0:
        raise SceneError(f"limit is {limit}", "give seconds for a case, > 0")
    known = gallery.hard_names()
    chosen = known if not names else names
    for name in chosen:
        if name not in known:
            raise unknown_name("hard case", name, known)
    results = []
    for name in chosen:
        results.append(run_apart(name, limit))
        if report is not None:
            report(results[-1])
    return results


def run_apart(name: str, limit: float) -> CaseResult:
    """Run a case in a process of its own that is ended, with all it has started, after `limit` s."""
    entry = gallery.load(name)
    start = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        code, last = run_limited(["rigidimpulse.studies.hard_cases", name, str(answer)], limit)
        seconds = perf_counter() - start
        if code == 0:
            return CaseResult(**json.loads(answer.read_text(encoding="utf-8")))
    return lost_case(entry, family_of(name), code, last, seconds, limit)


def lost_case(entry: GalleryScene, family: str, code: int | None, last: str, seconds: float, limit: float) -> CaseResult:
    """Return the result of a process that brought none: its exit code, None over the limit, and its last words."""
    outcome = HUNG if code is None else CRASHED
    message = f"not done after {limit:g} s" if code is None else f"exit code {code}: {last}"
    return CaseResult(
        entry.name,
        entry.description,
        family,
        outcome,
        seconds=seconds,
        duration=entry.duration,
        message=message,
        elsewhere=entry.elsewhere,
    )


def run_limited(arguments: Sequence[str], limit: float) -> tuple[int | None, str]:
    """Run a module with arguments in a process that is ended, with all it has started, after `limit` s.

    Returns:
        The exit code, None if it was ended, and the last it wrote to standard error.

    """
    with tempfile.TemporaryFile() as words:
        process = subprocess.Popen(
            [sys.executable, "-m", *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=words, start_new_session=True
        )
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            _end(process)
        words.seek(0)
        return code, words.read().decode("utf-8", errors="replace").strip()[-LAST_WORDS:]


def _end(process: subprocess.Popen) -> None:
    """End a process and those it has started."""
    if process.poll() is None:
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
        process.wait()


def run_case(name: str) -> CaseResult:
    """Run a case in this process."""
    from rigidimpulse.engine.simulate import simulate_whole

    entry = gallery.load(name)
    start = perf_counter()
    run = simulate_whole(entry.scene(), entry.duration, entry.fps, accuracy=entry.accuracy)
    checks = [as_plain(check) for check in entry.check(run)]
    seconds = perf_counter() - start
    if entry.cheaper is not None:
        checks.append(as_plain(cheaper_fails(entry)))
    outcome = PASSED if all(check["passed"] for check in checks) else FAILED
    return CaseResult(
        name, entry.description, family_of(name), outcome, checks, seconds, entry.duration, len(run.impacts), run.status.message,
        run.state_hash(), entry.elsewhere,
    )  # fmt: skip


def cheaper_fails(entry: GalleryScene) -> Check:
    """Return the check that the scene's cheaper settings are not enough: the option makes the difference."""
    from rigidimpulse.engine.simulate import simulate_whole
    from rigidimpulse.gallery.record import at_least
    from rigidimpulse.scene.accuracy import Accuracy

    assert entry.cheaper is not None
    run = simulate_whole(entry.scene(), entry.duration, entry.fps, accuracy=entry.cheaper)
    failed = sum(not check.passed for check in entry.check(run))
    default = Accuracy()
    named = ", ".join(f"{key} {value}" for key, value in entry.cheaper if value != getattr(default, key))
    return at_least(f"checks that fail with {named}", failed, 1, "the other side of the option")


def as_plain(check: Check) -> dict[str, Any]:
    """Return a check as JSON takes it; figures that are not finite become None."""
    plain = asdict(check)
    for key in ("value", "bound"):
        if not abs(plain[key]) < float("inf"):
            plain[key] = None
    return plain


def family_of(name: str) -> str:
    """Return the title of a case's family."""
    return next(title for title, cases in FAMILIES.values() if name in cases)


def machine() -> dict[str, str | int | None]:
    """Return what the times depend on."""
    from importlib.metadata import version

    return {
        "system": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "numba": version("numba"),
        "rigidimpulse": VERSION,
    }


def _processor() -> str:
    """Return the name of the processor, as far as the system tells."""
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        for line in listing.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def write_results(results: Sequence[CaseResult], folder: Path, limit: float) -> tuple[Path, Path]:
    """Write hard_cases.json and hard_cases.html into a folder; return their paths."""
    from rigidimpulse.studies.hard_page import page

    make_folder(folder)
    about = machine()
    figures = {"machine": about, "limit": limit, "passed": sum(r.passed for r in results), "cases": [asdict(r) for r in results]}
    arrays, table = folder / "hard_cases.json", folder / "hard_cases.html"
    arrays.write_text(json.dumps(figures, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    table.write_text(page(results, about), encoding="utf-8")
    return arrays, table


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(json.dumps(asdict(run_case(sys.argv[1])), allow_nan=False), encoding="utf-8")
