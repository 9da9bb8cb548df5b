"""Types of the public names reach mypy, pyright and jedi: a correct program passes, slips are found, signatures complete."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import jedi
import pytest

import rigidimpulse as ri

ROOT = Path(__file__).resolve().parents[2]
CORRECT = """\
import rigidimpulse as ri

scene = ri.Scene(gravity=(0, 0, -9.81))
floor: ri.Body = scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
ball = scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0, 0, 1), material=ri.Material(restitution=0.5)))
run: ri.Recording = ri.simulate(scene, duration=1.0, accuracy="preview")
print(ball.name, len(run.impacts), run.position("ball")[-1], run.status.message)
"""
SLIPS = (
    'ri.Body("a", box, positon=3)',
    'ri.Body("a", box, mass="heavy")',
    'ri.Body("a", box, motion="statik")',
    'ri.Body("a")',
    "ri.Material(densty=3)",
    'scene.add("a ball")',
    "ri.simulate(scene)",
    'ri.simulate(scene, 1.0, accuracy="exakt")',
    "run.ledger.kinetik",
    "run.impact",
    "run.export(3)",
    "run.position(0)",
    "ri.Scen()",
    'ri.Shape.sphere("1")',
    'ri.HingeJoint("a", axle=(0, 0, 1))',
)
HEAD = """\
import rigidimpulse as ri

scene = ri.Scene()
box = ri.Shape.box((1, 1, 1))
run = ri.simulate(scene, 1.0)
"""
FIRST_SLIP = HEAD.count("\n") + 1


def found_by_mypy(folder: Path) -> dict[str, set[int]]:
    """Lines with errors by file; the package is seen as it is by its users, installed."""
    (folder / "mypy.ini").write_text(f"[mypy]\nmypy_path = {ROOT}\n[mypy-rigidimpulse.*]\nignore_errors = True\n")
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file", "mypy.ini", "correct.py", "slips.py"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode in (0, 1), result.stdout + result.stderr
    found: dict[str, set[int]] = {"correct.py": set(), "slips.py": set()}
    for name, line in re.findall(r"^(\S+?):(\d+): error", result.stdout, re.MULTILINE):
        found[name].add(int(line))
    return found


def found_by_pyright(folder: Path) -> dict[str, set[int]]:
    """Lines with errors by file."""
    settings = {"include": ["correct.py", "slips.py"], "extraPaths": [str(ROOT)], "typeCheckingMode": "standard"}
    (folder / "pyrightconfig.json").write_text(json.dumps(settings))
    command = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "--outputjson"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    found: dict[str, set[int]] = {"correct.py": set(), "slips.py": set()}
    for entry in json.loads(result.stdout)["generalDiagnostics"]:
        if entry["severity"] == "error":
            found[Path(entry["file"]).name].add(entry["range"]["start"]["line"] + 1)
    return found


@pytest.mark.parametrize("checker", [found_by_mypy, found_by_pyright])
def test_a_correct_program_passes_and_every_slip_is_found(checker, tmp_path: Path) -> None:
    (tmp_path / "correct.py").write_text(CORRECT)
    (tmp_path / "slips.py").write_text(HEAD + "\n".join(SLIPS) + "\n")
    found = checker(tmp_path)
    assert found["correct.py"] == set()
    assert found["slips.py"] == set(range(FIRST_SLIP, FIRST_SLIP + len(SLIPS)))


def pages() -> dict[str, str]:
    """Programs by file name: the demos, and of each page of the docs all blocks of Python together, as its reader would type them."""
    programs = {path.name: path.read_text(encoding="utf-8") for path in sorted((ROOT / "demos").glob("*.py"))}
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        blocks = re.findall(r"^```python\n(.*?)^```", path.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        if blocks:
            programs[path.relative_to(ROOT).with_suffix("").as_posix().replace("/", "_") + ".py"] = "\n".join(blocks)
    return programs


def test_demos_and_examples_of_the_docs_are_strictly_typed(tmp_path: Path) -> None:
    """What people copy passes `mypy --strict` as it is."""
    programs = pages()
    assert len(programs) > 25
    for name, text in programs.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "mypy.ini").write_text(
        f"[mypy]\nmypy_path = {ROOT}\n[mypy-rigidimpulse.*]\nignore_errors = True\n[mypy-pxr.*]\nignore_missing_imports = True\n"
    )
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file", "mypy.ini", *programs]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(
    ("call", "names"),
    [("ri.Body(", {"name", "shape", "position", "mass"}), ("ri.simulate(", {"scene", "duration", "fps", "accuracy"})],
)
def test_jedi_shows_signatures(call: str, names: set[str]) -> None:
    code = "import rigidimpulse as ri\n" + call
    (signature,) = jedi.Script(code, project=jedi.Project(ROOT)).get_signatures()
    assert names <= {parameter.name for parameter in signature.params}


def test_jedi_completes_a_run() -> None:
    code = HEAD + "run."
    names = {completion.name for completion in jedi.Script(code, project=jedi.Project(ROOT)).complete()}
    assert {"impacts", "position", "status", "export", "plan"} <= names


def test_the_stub_has_every_public_name() -> None:
    stub = (ROOT / "rigidimpulse" / "__init__.pyi").read_text(encoding="utf-8")
    listed = {alias: home for home, alias in re.findall(r"^from (\S+) import \w+ as (\w+)$", stub, re.MULTILINE)}
    assert sorted(listed) == ri.__all__
    for name, home in listed.items():
        __import__(home)
        assert getattr(sys.modules[home], name) is getattr(ri, name)
