"""The command line: what it prints, writes and returns, in process and as a program."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.cli.cli import BAD_SCENE, CHECK_FAILED, main

SCENE_FILE = """
import rigidimpulse as ri

def scene():
    made = ri.Scene()
    made.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    made.add(ri.Body("ball", ri.Shape.sphere(0.5), position=(0, 0, 1), material=ri.Material(restitution=0.5)))
    return made
"""


def call(*arguments):
    """Run a command in this process."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture
def scene_file(tmp_path):
    """Return a file that defines scene(): a ball falls on a floor."""
    path = tmp_path / "falling_ball.py"
    path.write_text(SCENE_FILE)
    return path


def test_help_imports_nothing_heavy():
    # `--help` answers in 0.3 s only if nothing beyond click is imported.
    code = (
        "import sys\n"
        "from rigidimpulse.cli.cli import main\n"
        "try:\n"
        "    main(['--help'])\n"
        "except SystemExit:\n"
        "    pass\n"
        "heavy = {'numpy', 'numba', 'scipy', 'trimesh', 'meshcat', 'pydantic', 'fcl', 'tqdm'}\n"
        "print(sorted(heavy & set(sys.modules)))\n"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.splitlines()[-1] == "[]"
    for command in ("demo", "hardcases", "simulate", "view", "explain"):
        assert command in out


def test_runs_as_a_module():
    out = subprocess.run(
        [sys.executable, "-m", "rigidimpulse", "--version"], capture_output=True, text=True, check=True
    )
    assert ri.__version__ in out.stdout


def test_demo_without_a_name_lists_all_scenes():
    result = call("demo")
    assert result.exit_code == 0
    listed = [line.split()[0] for line in result.stdout.splitlines() if line.startswith("  ")]
    assert listed == [*gallery.names(), *gallery.hard_names()]


def test_demo_runs_checks_and_writes_what_is_asked_for(tmp_path):
    page, arrays = tmp_path / "run.html", tmp_path / "run.npz"
    result = call("demo", "two_spheres", "-o", page, "-o", arrays, "--fps", 24)
    assert result.exit_code == 0, result.output
    assert "FAILED" not in result.stdout and "1 impact," in result.stdout
    assert page.read_text(encoding="utf-8").lstrip().lower().startswith("<!doctype html")
    recording = ri.load_recording(arrays)
    assert len(recording.times) == round(gallery.load("two_spheres").duration * 24) + 1


def test_a_failed_check_is_the_exit_code():
    # Its law is that of exact impact times, which this accuracy does not find.
    result = call("demo", "kinematic_bounce", "--accuracy", "preview")
    assert result.exit_code == CHECK_FAILED
    assert "FAILED" in result.stdout


def test_checks_are_left_out_where_the_duration_is_another():
    result = call("demo", "two_spheres", "--duration", 0.1)
    assert result.exit_code == 0
    assert "checks left out" in result.stdout


def test_simulate_runs_a_scene_file(scene_file, tmp_path):
    out = tmp_path / "ball.npz"
    result = call("simulate", scene_file, "-o", out, "--duration", 1, "--fps", 100, "--accuracy", "preview", "--profile")
    assert result.exit_code == 0, result.output
    assert "sweep" in result.stdout and "loading or compiling kernels" in result.stdout
    recording = ri.load_recording(out)
    # Free fall until the first impact at sqrt(2 h / g) = 0.319 s, h = 0.5 m: z = 1 - g t^2 / 2 up to rounding.
    early = recording.times < 0.3
    fall = 1.0 - 0.5 * 9.81 * recording.times[early] ** 2
    assert np.abs(recording.position("ball")[early, 2] - fall).max() < 1e-14
    assert recording.position("ball")[:, 2].min() > 0.49


def test_explain_needs_no_run_and_with_a_duration_shows_shares(scene_file):
    for arguments in (("explain", scene_file), ("explain", scene_file, "--duration", 0.5), ("explain", "wing_nut")):
        result = call(*arguments)
        assert result.exit_code == 0, result.output
        assert "why" in result.stdout
    assert "nothing can collide" in result.stdout


def test_view_of_arrays_needs_the_scene(scene_file, tmp_path, monkeypatch):
    arrays = tmp_path / "ball.npz"
    assert call("simulate", scene_file, "-o", arrays, "--duration", 0.1).exit_code == 0
    shown = []
    viewer = SimpleNamespace(fetched=SimpleNamespace(is_set=lambda: True))

    def show(recording):
        shown.append(recording)
        return viewer

    monkeypatch.setattr(ri.Recording, "show", show)
    assert call("view", arrays, "--scene", scene_file).exit_code == 0
    assert shown[0].scene.names == ("floor", "ball")
    assert "--scene" in call("view", arrays).stderr
    assert "its bodies are floor, ball" in call("view", arrays, "--scene", "two_spheres").stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("demo", "sppt"), "did you mean 'spot'"),
        (("demo", "two_spheres", "-o", "run.obj"), ".npz, .csv, .glb, .gltf"),
        (("demo", "two_spheres", "--fps", "0"), "fps"),
        (("demo", "two_spheres", "--duration", "-1"), "duration"),
        (("demo", "two_spheres", "--accuracy", "perfect"), "'preview', 'standard', 'exact', 'classic'"),
        (("simulate", "room.obj", "-o", "run.npz"), "a file.py that defines scene()"),
        (("simulate", "room.glb", "-o", "run.npz"), "check the path"),
        (("simulate", "missing.py", "-o", "run.npz"), "no such file"),
        (("explain", "nothing"), "unknown gallery scene"),
        (("view", "missing.html"), "no file 'missing.html'"),
        (("view", __file__), "ends in .html or .npz"),
    ],
)
def test_mistakes_get_a_message_with_the_remedy_and_no_traceback(arguments, words):
    result = call(*arguments)
    assert result.exit_code == BAD_SCENE
    assert isinstance(result.exception, SystemExit)
    assert result.stderr.startswith("Error: ") and words in result.stderr
    assert "Traceback" not in result.output


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1", "defines no function scene()"),
        ("def scene():\n    return 3", "scene() returned a int"),
        ("def scene(:", "line 1: SyntaxError"),
        ("def scene():\n    return 1 / 0", "line 2: ZeroDivisionError"),
        (SCENE_FILE.replace("sphere(0.5)", "sphere(-0.5)"), "body 'ball'"),
    ],
)
def test_mistakes_in_scene_files_are_named(tmp_path, text, words):
    path = tmp_path / "bad.py"
    path.write_text(text)
    result = call("simulate", path, "-o", tmp_path / "run.npz")
    assert result.exit_code == BAD_SCENE
    assert words in result.stderr, result.stderr
    assert not (tmp_path / "run.npz").exists()


def test_study_of_a_scene_says_its_sentence_and_writes_one_page(scene_file, tmp_path):
    result = call("study", scene_file, "--duration", 0.5, "--budget", 6, "--peer", "mujoco", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "Standard stays within" in result.stdout and "of the truth for 0.5 s" in result.stdout
    assert "MuJoCo with steps of 1/" in result.stdout and 'Recommended: accuracy="' in result.stdout
    assert "Bullet" not in result.stdout
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["study.html"]


def test_a_full_study_prints_a_table_and_writes_its_files(scene_file, tmp_path):
    arguments = ("study", scene_file, "--full", "--duration", 0.2, "--budget", 6, "-o", tmp_path / "out")
    result = call(*arguments)
    assert result.exit_code == 0, result.output
    assert "falling_ball, 0.2 s; reference: self-converged, until 0.2 s" in result.stdout
    assert "bisection, step 1/30" in result.stdout and "no time for" not in result.stdout
    files = {"study.html", "study.csv", "study.png", "settings.html", "reference.npz"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == files
    table = (tmp_path / "out" / "study.csv").read_text()
    assert call(*arguments).exit_code == 0
    # Gone on with: what was there is there to the last digit.
    assert (tmp_path / "out" / "study.csv").read_text().startswith(table)


def test_study_wants_one_thing():
    for arguments in ((), ("bounce", "--scaling")):
        result = call("study", *arguments)
        assert result.exit_code == BAD_SCENE and "SCENE, or --scaling" in result.stderr


def test_accuracy_targets_on_the_command_line(scene_file, tmp_path):
    result = call("simulate", scene_file, "--duration", 0.5, "--within", 1e-3, "-o", tmp_path / "run.npz")
    assert result.exit_code == 0, result.output
    assert "chose step" in result.stdout and "estimated error" in result.stdout
    assert call("simulate", scene_file, "--duration", 0.1, "--per-frame", 10, "-o", tmp_path / "run.npz").exit_code == 0
    both = call("simulate", scene_file, "--within", 1e-3, "--accuracy", "exact", "-o", tmp_path / "run.npz")
    assert both.exit_code == BAD_SCENE and "give one of them" in both.stderr


def test_study_prints_exponents_of_cost():
    result = call("study", "--scaling", "--most", 300)
    assert result.exit_code == 0, result.output
    assert "gas: elastic balls in a box" in result.stdout and "pile: boxes that fall" in result.stdout
    assert len([line for line in result.stdout.splitlines() if line.startswith("exponent of the cost")]) == 2
    result = call("study", "--scaling", "--most", 100)
    assert result.exit_code == BAD_SCENE and "give at least 300" in result.stderr


def test_a_study_without_charts_says_what_they_need(scene_file, tmp_path, monkeypatch):
    monkeypatch.setattr("rigidimpulse.studies.work_precision.find_spec", lambda name: None)
    result = call("study", scene_file, "--full", "--duration", 0.1, "--budget", 3, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "rigidimpulse[study]" in result.stdout
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"study.html", "study.csv", "reference.npz"}
