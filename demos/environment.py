"""The environment of the clone: `.venv` beside the package, with the package installed in it. Standard library only."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / ".venv"
OLDEST_PYTHON = (3, 11)


def prepare(extras: str = "") -> Path:
    """Make the environment if need be, install the package from the clone, and return the environment's Python.

    Args:
        extras: optional dependencies of the package, such as "test".

    A stamp keeps what was installed last, so that nothing is done until `pyproject.toml` changes.

    """
    if sys.version_info < OLDEST_PYTHON:
        sys.exit(f"Python {'.'.join(map(str, OLDEST_PYTHON))} or newer is needed; this is {sys.version.split()[0]}")
    python = FOLDER / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.is_file():
        print(f"making the environment {FOLDER}", flush=True)
        run([sys.executable, "-m", "venv", str(FOLDER)], "is Python's venv module installed? (Debian: python3-venv)")
    stamp = FOLDER / f"installed-{extras or 'plain'}"
    wanted = hashlib.sha256((ROOT / "pyproject.toml").read_bytes() + str(ROOT).encode()).hexdigest()
    if not stamp.is_file() or stamp.read_text() != wanted:
        print("installing the package and what it needs (a few minutes the first time)", flush=True)
        package = f"{ROOT}[{extras}]" if extras else str(ROOT)
        install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--editable", package]
        run(install, "see the message of pip above; is there a network?")
        stamp.write_text(wanted)
    return python


def run(command: list[str], remedy: str) -> None:
    """Run a command; end the program with the remedy if it fails."""
    code = subprocess.call(command)
    if code:
        sys.exit(f"failed ({code}): {' '.join(command)}\n{remedy}")
