"""The demos run, and the README shows what they are."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DEMOS = ROOT / "demos"


def test_every_demo_has_a_test():
    assert {path.name for path in DEMOS.glob("*.py")} == {"environment.py", "first_program.py", "shapes.py", "start.py"}


def test_first_program(tmp_path):
    program = [sys.executable, str(DEMOS / "first_program.py")]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "impacts, finished" in done.stdout
    assert (tmp_path / "first_program.html").stat().st_size > 500_000


def test_the_readme_shows_the_first_program():
    program = (DEMOS / "first_program.py").read_text(encoding="utf-8").split("\n\n", 1)[1]
    assert program in (ROOT / "README.md").read_text(encoding="utf-8")


def test_shapes(tmp_path):
    command = [sys.executable, "-m", "rigidimpulse", "simulate", str(DEMOS / "shapes.py"), "--duration", "1.5"]
    out = tmp_path / "shapes.npz"
    subprocess.run([*command, "-o", str(out)], cwd=tmp_path, check=True)
    from rigidimpulse import load_recording

    recording = load_recording(out)
    assert recording.positions[:, 1:, 2].min() > 0.0  # the origins lie inside the bodies, which stay above the floor
    touched = {int(k) for k in recording.impacts["body_b"]} | {int(k) for k in recording.impacts["body_a"]}
    assert touched == set(range(len(recording.names)))


@pytest.fixture
def prepared(monkeypatch):
    """Let the scripts that make an environment find this one in its place; return the extras they ask for."""
    monkeypatch.syspath_prepend(str(DEMOS))
    import environment

    asked = []

    def prepare(extras=""):
        asked.append(extras)
        return Path(sys.executable)

    monkeypatch.setattr(environment, "prepare", prepare)
    return asked


def test_start_writes_a_page_and_says_where(prepared, monkeypatch, tmp_path, capfd):
    monkeypatch.chdir(tmp_path)
    start = runpy.run_path(str(DEMOS / "start.py"))["main"]
    assert start(["two_spheres"]) == 0
    page = tmp_path / "two_spheres.html"
    assert page.stat().st_size > 500_000
    assert page.as_uri() in capfd.readouterr().out
    assert prepared == [""]


def test_run_returns_the_exit_code_of_pytest(prepared, tmp_path):
    run = runpy.run_path(str(ROOT / "tests" / "run.py"))["main"]
    good, bad = tmp_path / "test_good.py", tmp_path / "test_bad.py"
    good.write_text("def test_good():\n    assert True\n")
    bad.write_text("def test_bad():\n    assert False\n")
    assert run(["-q", "-p", "no:cacheprovider", str(good)]) == 0
    assert run(["-q", "-p", "no:cacheprovider", str(bad)]) == 1
    assert prepared == ["test", "test"]


def test_an_old_python_is_told_so(monkeypatch):
    monkeypatch.syspath_prepend(str(DEMOS))
    import environment

    monkeypatch.setattr(environment, "OLDEST_PYTHON", (99, 0))
    with pytest.raises(SystemExit, match=r"Python 99\.0 or newer"):
        environment.prepare()


def test_the_environment_is_installed_once_for_each_change(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(DEMOS))
    import environment

    commands = []

    def fake(command, remedy):
        commands.append(command[1:3])
        if "venv" in command:
            (tmp_path / ".venv" / "bin").mkdir(parents=True)
            (tmp_path / ".venv" / "bin" / "python").touch()

    (tmp_path / "pyproject.toml").write_text("one")
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    monkeypatch.setattr(environment, "FOLDER", tmp_path / ".venv")
    monkeypatch.setattr(environment, "run", fake)
    environment.prepare()
    assert commands == [["-m", "venv"], ["-m", "pip"]]
    environment.prepare()
    assert len(commands) == 2
    (tmp_path / "pyproject.toml").write_text("two")
    environment.prepare()
    environment.prepare("test")
    assert commands[2:] == [["-m", "pip"], ["-m", "pip"]]
