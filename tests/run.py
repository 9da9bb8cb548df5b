"""The test suite, from a clone and Python alone: `python tests/run.py [arguments of pytest]`.

Makes the environment `.venv` in the clone on the first run, and returns pytest's exit code. Two processes, each with whole files, of which
some keep what they have run; `-n 0` for one. Standard library only.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "demos"))

import environment  # noqa: E402


def main(arguments):
    """Run pytest; return its exit code."""
    python = environment.prepare("test")
    return subprocess.call([str(python), "-m", "pytest", "-n", "2", "--dist", "loadfile", *arguments], cwd=ROOT)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
