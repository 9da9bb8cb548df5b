"""Wheels of the package and clean virtual environments to install them in, for the scripts of this folder.

`uv` makes the environments: it finds the oldest dependencies that are allowed (`--resolution lowest-direct`) for each Python. Where it is
missing, it is installed from the registry into the folder of the work.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = ("qp", "cache", "usd", "robot", "study", "dask")
"""Optional dependencies of those who use the library."""
OLDEST, NEWEST, PLAIN = "oldest", "newest", "newest, no extras"
RESOLUTIONS = {OLDEST: "lowest-direct", NEWEST: "highest", PLAIN: "highest"}
WHEELS_ONLY = ("--only-binary", ":all:")
"""Nothing is built here but the package."""
HEAR_NOTHING_OF = ("PYTHON", "NUMBA_", "XDG_CACHE_HOME", "VIRTUAL_ENV", "NPY_", "OPENBLAS_", "GLIBC_")
"""Beginnings of names of variables that must not reach a clean environment."""


@dataclass(frozen=True)
class Interpreter:
    """A Python of this machine, and its version."""

    path: Path
    version: str


@dataclass(frozen=True)
class Environment:
    """A virtual environment in which the package is installed.

    Attributes:
        folder: of the environment. python: its Python. version: of Python.
        dependencies: "oldest", "newest" or "newest, no extras". installed: their versions, by name.

    """

    folder: Path
    version: str
    dependencies: str
    installed: dict[str, str]

    @property
    def python(self) -> Path:
        """The Python of the environment."""
        return self.folder / "bin" / "python"


def run(command: list[str | Path], **options: object) -> str:
    """Run a command and return what it prints; the program ends with what it says if it fails."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, **options)  # type: ignore[call-overload]
    if done.returncode:
        sys.exit(f"failed ({done.returncode}): {' '.join(map(str, command))}\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return done.stdout


def find_uv(work: Path) -> Path:
    """The program `uv`: of this machine, or installed into the folder of the work."""
    there = shutil.which("uv")
    if there:
        return Path(there)
    tools = work / "tools"
    if not (tools / "bin" / "uv").is_file():
        run([sys.executable, "-m", "venv", tools])
        run([tools / "bin" / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "uv"])
    return tools / "bin" / "uv"


def oldest_python() -> tuple[int, ...]:
    """The oldest Python that the package allows."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        said = tomllib.load(file)["project"]["requires-python"]
    return tuple(map(int, said.removeprefix(">=").split(".")))


def find_pythons() -> list[Interpreter]:
    """Pythons of this machine that the package allows: of the system, of the search path and of pyenv."""
    least = oldest_python()
    names = ["python3", *(f"python3.{minor}" for minor in range(least[1], least[1] + 10))]
    folders = [Path(folder) for folder in ("/usr/bin", "/usr/local/bin", *os.environ.get("PATH", "").split(os.pathsep))]
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    places = [folder / name for folder in folders for name in names] + sorted(pyenv.glob("*/bin/python"))
    found: dict[str, Interpreter] = {}
    for place in places:
        if place.is_file():
            question = "import sys; print('.'.join(map(str, sys.version_info[:3])), sys.prefix == sys.base_prefix)"
            done = subprocess.run([str(place), "-c", question], capture_output=True, text=True)
            version, _, is_base = done.stdout.strip().partition(" ")
            if done.returncode == 0 and is_base == "True" and tuple(map(int, version.split("."))) >= least:
                found.setdefault(version, Interpreter(place, version))
    return sorted(found.values(), key=lambda python: [int(part) for part in python.version.split(".")])


def build_wheel(uv: Path, folder: Path) -> Path:
    """Build the wheel of the clone, by way of the source distribution, as it is published; return its path."""
    shutil.rmtree(folder, ignore_errors=True)
    run([uv, "build", "--quiet", "--out-dir", folder, ROOT])
    (wheel,) = folder.glob("*.whl")
    return wheel


def make_environment(uv: Path, python: Interpreter, dependencies: str, wheel: Path, folder: Path) -> Environment:
    """Make a clean environment with the wheel and with the oldest or the newest dependencies that it allows."""
    shutil.rmtree(folder, ignore_errors=True)
    run([uv, "venv", "--quiet", "--python", python.path, folder])
    into = ["--quiet", "--python", str(folder)]
    if dependencies == PLAIN:
        # As pip does, with the bytecode of all modules.
        run([uv, "pip", "install", *into, *WHEELS_ONLY, "--compile-bytecode", wheel])
    else:
        # Of a wheel, uv would take the newest: the oldest are asked for by the bounds of the project itself.
        extras = [word for extra in EXTRAS for word in ("--extra", extra)]
        how = ["--resolution", RESOLUTIONS[dependencies], "--python-version", python.version, *WHEELS_ONLY, *extras]
        wanted = folder / "wanted.txt"
        run([uv, "pip", "compile", "--quiet", *how, ROOT / "pyproject.toml", "--output-file", wanted])
        run([uv, "pip", "install", *into, *WHEELS_ONLY, "--requirements", wanted])
        run([uv, "pip", "install", *into, "--no-deps", wheel])
    run([uv, "pip", "check", *into])
    lines = run([uv, "pip", "freeze", *into]).splitlines()
    installed = dict(line.split("==") for line in lines if "==" in line)
    return Environment(folder, python.version, dependencies, installed)


def clean_variables(home: Path | None, **more: str) -> dict[str, str]:
    """Variables for a program in a clean environment: those of this process that say nothing of Python, with another home or none."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(HEAR_NOTHING_OF) and name != "HOME"}
    return {**kept, **({} if home is None else {"HOME": str(home)}), "PYTHONNOUSERSITE": "1", **more}


def said(work: Path) -> str:
    """What was typed to run the script, with WORK for the folder of the work."""
    words = ["WORK" if Path(word).resolve() == work else word for word in sys.argv[1:]]
    return " ".join(["python", Path(sys.argv[0]).resolve().relative_to(ROOT).as_posix(), *words])
