"""Where the numbers of a results page come from: machine, date, commit and command, kept beside the data as JSON.

`python docs/results/provenance.py FILE.csv "COMMAND"` notes it for data that another script has just measured.
"""

from __future__ import annotations

import json
import os
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


def note(data: Path, command: str, **more: object) -> None:
    """Write machine, date and commit of data that have just been measured to a file beside them, with the suffix .json.

    Args:
        data: the file with the numbers.
        command: what was typed to measure them.
        more: what else is to be known of the data.

    """
    about = {
        **machine(),
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "commit": git("rev-parse", "--short", "HEAD"),
        "command": command,
        "load": [round(load, 2) for load in os.getloadavg()],
        **more,
    }
    data.with_suffix(".json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


def known(data: Path) -> dict:
    """What is noted beside a file of data."""
    return json.loads(data.with_suffix(".json").read_text(encoding="utf-8"))


def origin(data: Path) -> str:
    """Say in Markdown where the numbers of a file come from, as noted beside it."""
    about = known(data)
    where = str(about["processor"]) + (f", {about['cores']} cores" if "cores" in about else "")
    versions = ", ".join(f"{name} {about[name]}" for name in ("python", "numpy", "numba") if name in about)
    other = f"load {about['load'][0]:g} when it ended" if "load" in about else "not recorded; other work may have run on the machine"
    rows = [
        ("machine", f"{where}; {versions}" if versions else where),
        ("other work", other),
        ("date", about["date"]),
        ("commit", f"`{about['commit']}`"),
        ("command", f"`{about['command']}`"),
        ("data", f"`{data.relative_to(ROOT)}`"),
    ]
    return "\n".join(["| measured | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)]) + "\n"


def generated(script: str) -> str:
    """First line below the title of a generated page."""
    return f"<!-- Written by `python docs/results/{Path(script).name}`. Change the script, not this page. -->\n"


if __name__ == "__main__":
    note(Path(sys.argv[1]).resolve(), sys.argv[2])
