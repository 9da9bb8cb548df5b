"""Where the numbers of a results page come from: machine, date, commit and command, kept beside the data as JSON."""

from __future__ import annotations

import json
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

from rigidimpulse.studies.hard_cases import machine

ROOT = Path(__file__).resolve().parent.parent.parent
DATA = Path(__file__).resolve().parent / "data"


def git(*arguments: str) -> str:
    """Answer of git in the clone."""
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def note(data: Path, command: str) -> None:
    """Write machine, date and commit of data that have just been measured to a file beside them, with the suffix .json.

    Args:
        data: the file with the numbers.
        command: what was typed to measure them.

    """
    about = {
        **machine(),
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "commit": git("rev-parse", "--short", "HEAD"),
        "command": command,
    }
    data.with_suffix(".json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


def origin(data: Path, command: str) -> str:
    """Say in Markdown where the numbers of a file come from.

    Args:
        data: the file with the numbers.
        command: what measures them again, where no note beside the file says so.

    """
    beside = data.with_suffix(".json")
    if beside.is_file():
        about = json.loads(beside.read_text(encoding="utf-8"))
        versions = ", ".join(f"{name} {about[name]}" for name in ("python", "numpy", "numba"))
        where = f"{about['processor']}, {about['cores']} cores; {versions}"
        date, commit, command = about["date"], about["commit"], about["command"]
    else:
        date, commit = git("log", "--follow", "--diff-filter=AM", "-1", "--format=%cs %h", "--", str(data)).split()
        named = data.parent.name
        where = named.replace("-", " ") if "cores" in named else "not recorded with the data (x86-64)"
    rows = [("machine", where), ("date", date), ("commit", f"`{commit}`"), ("command", f"`{command}`"), ("data", f"`{data.relative_to(ROOT)}`")]
    return "\n".join(["| measured | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)]) + "\n"


def generated(script: str) -> str:
    """First line below the title of a generated page."""
    return f"<!-- Written by `python docs/results/{Path(script).name}`. Change the script, not this page. -->\n"


if __name__ == "__main__":
    sys.exit("this module is imported by the scripts beside it")
