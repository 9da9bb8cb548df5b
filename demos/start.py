"""The main demo, from a clone and Python alone: throws Spot the cow at a torus and writes the motion as a web page.

    python demos/start.py            then open spot.html in a browser
    python demos/start.py NAME       another gallery scene

Makes the environment `.venv` in the clone on the first run. Standard library only.
"""

import subprocess
import sys
from pathlib import Path

import environment


def main(arguments: list[str]) -> int:
    """Run the demo; return its exit code."""
    name = arguments[0] if arguments else "spot"
    page = Path.cwd() / f"{name}.html"
    python = environment.prepare()
    code = subprocess.call([str(python), "-m", "rigidimpulse", "demo", name, "-o", str(page)])
    if page.is_file():
        print(f"\nopen in a browser: {page.as_uri()}")
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
