"""The wheel has all that the package needs where there is no clone, and nothing else. `matrix.py` beside this file installs and runs it."""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from email import message_from_string
from email.message import Message
from pathlib import Path

import pytest

from rigidimpulse.core.version import VERSION

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "rigidimpulse"
INFO = f"rigidimpulse-{VERSION}.dist-info"
NEVER = {"__pycache__", "ready_kernels"}
"""Folders of what this machine has compiled."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[zipfile.ZipFile]:
    """The wheel, built from the source distribution, as it is published."""
    folder = tmp_path_factory.mktemp("dist")
    build(ROOT, "sdist", folder)
    (packed,) = folder.glob("*.tar.gz")
    with tarfile.open(packed) as sources:
        sources.extractall(folder, filter="data")
    build(folder / packed.name.removesuffix(".tar.gz"), "wheel", folder)
    (path,) = folder.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        yield archive


@pytest.fixture(scope="module")
def metadata(wheel: zipfile.ZipFile) -> Message:
    """What the wheel says of itself."""
    return message_from_string(wheel.read(f"{INFO}/METADATA").decode())


def build(sources: Path, target: str, folder: Path) -> None:
    """Build a distribution with the backend that `pyproject.toml` names."""
    command = [sys.executable, "-m", "hatchling", "build", "--target", target, "--directory", str(folder)]
    subprocess.run(command, cwd=sources, check=True, capture_output=True)


def project() -> dict:
    """The table of the project."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)["project"]


def test_the_wheel_has_every_file_of_the_package_and_every_asset(wheel: zipfile.ZipFile) -> None:
    """Modules, types, pages of the viewer, styles and data: each with the bytes that it has in the clone."""
    wanted = {path.relative_to(ROOT).as_posix(): path for path in PACKAGE.rglob("*") if path.is_file() and not NEVER & set(path.parts)}
    wanted |= {f"rigidimpulse/{path.relative_to(ROOT).as_posix()}": path for path in (ROOT / "assets").rglob("*") if path.is_file()}
    found = {name for name in wheel.namelist() if not name.startswith(INFO)}
    assert found == set(wanted)
    assert [name for name, path in wanted.items() if wheel.read(name) != path.read_bytes()] == []


@pytest.mark.parametrize(
    "name",
    [
        "py.typed", "__init__.pyi", "assets/meshes/spot.obj", "assets/README.md", "assets/tosses/NOTICE.txt", "studies/site.css",
        "view/page",
    ],
)  # fmt: skip
def test_what_no_import_would_miss_is_there(wheel: zipfile.ZipFile, name: str) -> None:
    """It is missed late: by a type checker, by a page, by a scene."""
    assert any(entry == f"rigidimpulse/{name}" or entry.startswith(f"rigidimpulse/{name}/") for entry in wheel.namelist())


def test_licences_of_the_code_and_of_the_data_are_in_the_wheel(wheel: zipfile.ZipFile, metadata: Message) -> None:
    assert metadata["License-Expression"] == "MIT"
    named = metadata.get_all("License-File", [])
    assert named == project()["license-files"]
    for name in named:
        assert wheel.read(f"{INFO}/licenses/{name}") == (ROOT / name).read_bytes()


def test_metadata_are_those_of_the_project(wheel: zipfile.ZipFile, metadata: Message) -> None:
    said, needed = project(), metadata.get_all("Requires-Dist", [])
    assert (metadata["Name"], metadata["Version"], metadata["Requires-Python"]) == ("rigidimpulse", VERSION, said["requires-python"])
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert {normal(line) for line in needed if "extra ==" not in line} == {normal(line) for line in said["dependencies"]}
    assert set(metadata.get_all("Provides-Extra", [])) == set(said["optional-dependencies"])
    assert b"rigidimpulse = rigidimpulse.cli.cli:main" in wheel.read(f"{INFO}/entry_points.txt")
    assert b"Root-Is-Purelib: true\nTag: py3-none-any" in wheel.read(f"{INFO}/WHEEL")


def normal(requirement: str) -> tuple[str, ...]:
    """Name and bounds of a requirement, in any order."""
    name, bounds = re.fullmatch(r"([\w-]+)\s*(.*)", requirement).groups()  # type: ignore[union-attr]
    return (name, *sorted(bounds.split(",")))


def test_the_record_has_the_digest_of_every_file(wheel: zipfile.ZipFile) -> None:
    rows = list(csv.reader(io.StringIO(wheel.read(f"{INFO}/RECORD").decode())))
    assert {name for name, _, _ in rows} == set(wheel.namelist())
    for name, digest, size in rows:
        if digest:
            data = wheel.read(name)
            right = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            assert (digest, int(size)) == (f"sha256={right}", len(data)), name
