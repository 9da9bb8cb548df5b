"""Run the gallery or the hard cases and keep all their checks: `python docs/results/measure_checks.py gallery|hard [--limit S]`.

Each scene runs in a process of its own, at its own settings. The checks (quantity, value, bound, law) go to
docs/results/data/gallery_checks.csv or hard_checks.csv, machine and commit to the file beside it. `make_results.py` makes
the pages of them.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from provenance import DATA, note

from rigidimpulse import gallery
from rigidimpulse.studies.hard_cases import LIMIT, as_plain, run_apart, run_limited

COLUMNS = ("scene", "what", "value", "relation", "bound", "passed", "law", "seconds", "impacts", "status")


def main() -> None:
    """Run what is asked for and write the table."""
    # Processes of scenes are this script as a module.
    os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).resolve().parent), os.environ.get("PYTHONPATH", "")])
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("which", choices=("gallery", "hard"))
    parser.add_argument("--limit", type=float, default=3.0 * LIMIT, help="s for a scene")
    arguments = parser.parse_args()
    names = gallery.names() if arguments.which == "gallery" else gallery.hard_names()
    rows = []
    for name in names:
        rows += scene_rows(name, arguments.which == "hard", arguments.limit)
        print(name, rows[-1][-3], "s", flush=True)
    path = DATA / f"{arguments.which}_checks.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])
    note(path, f"python docs/results/measure_checks.py {arguments.which}")


def scene_rows(name: str, hard: bool, limit: float) -> list[tuple]:
    """Rows of one scene, a check each; a scene that brings no result has one row that failed.

    Args:
        name: of the scene.
        hard: whether it is a hard case, whose cheaper settings are run, too.
        limit: s for the scene.

    """
    if hard:
        case = run_apart(name, limit)
        checks, seconds, impacts, status = case.checks, case.seconds, case.impacts, case.message
        lost = case.outcome
    else:
        with tempfile.TemporaryDirectory() as folder:
            answer = Path(folder) / "answer.json"
            code, last = run_limited(["measure_checks", name, str(answer)], limit)
            lost = f"exit code {code}: {last}"
            checks, seconds, impacts, status = json.loads(answer.read_text()) if code == 0 else ([], limit, 0, lost)
    if not checks:
        return [(name, lost, "", "", "", False, "", f"{seconds:.2f}", impacts, status.splitlines()[0])]
    keys = ("what", "value", "relation", "bound", "passed", "law")
    return [(name, *(check[key] for key in keys), f"{seconds:.2f}", impacts, status.splitlines()[0]) for check in checks]


def run_here(name: str) -> tuple[list[dict], float, int, str]:
    """Run a gallery scene in this process: checks, s of the simulation and its checks, impacts, status."""
    from rigidimpulse import simulate

    entry = gallery.load(name)
    start = perf_counter()
    run = simulate(entry.scene(), entry.duration, entry.fps, accuracy=entry.accuracy)
    checks = [as_plain(check) for check in entry.check(run)]
    return checks, perf_counter() - start, len(run.impacts), run.status.message


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[2].endswith(".json"):
        Path(sys.argv[2]).write_text(json.dumps(run_here(sys.argv[1])), encoding="utf-8")
    else:
        main()
