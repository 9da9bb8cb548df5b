"""The hard-case suite: cases that hold today, the frame that keeps a bad case from ending the suite, and bounds that have teeth."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import subprocess
import sys
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.cli.cli import BAD_SCENE, CHECK_FAILED, main
from rigidimpulse.gallery.hard import FAMILIES, friction, jointed, stacks
from rigidimpulse.studies import hard_cases
from rigidimpulse.studies.hard_cases import CRASHED, HUNG, PASSED, CaseResult, run_apart, run_case, run_suite, write_results

HOLD = (
    "house_of_cards", "heavy_dropped_1e3", "incline", "table", "bounces_to_rest", "bullet_and_paper", "bullet_and_bullet",
    "fast_spin", "slide_over_triangles", "slide_over_tiles", "roll_over_triangles", "roll_over_tiles",
    "bounce_over_triangles", "bounce_over_tiles", "wedge_in_crack", "stack_10", "stack_30", "stack_100", "brick_wall", "arch",
    "heavy_on_light_1e3", "heavy_on_light_1e6", "heavy_dropped_1e6", "ball_onto_stack", "squeezed_ball", "squeezed_box",
    "plate_of_balls", "motor_hinge", "chain_hanging", "cube_in_hole", "deep_overlap", "ball_in_ball", "renamed", "dirty_mesh",
    "flipped_floor", "inside_out", "needle", "plate", "stopping", "sliding_to_rolling", "ladder", "ball_off_ball",
    "rimless_wheel", "rocking_block", "coin", "spikes", "dominoes", "tetrahedra_in_pit",
)  # fmt: skip
"""Cases that pass and take no more than a few seconds; `rigidimpulse hardcases` runs all."""


@cache
def run_of(name):
    """Return the recording of a case."""
    entry = gallery.load(name)
    return ri.simulate(entry.scene(), entry.duration, entry.fps, accuracy=entry.accuracy)


@pytest.mark.parametrize("name", HOLD)
def test_case_holds(name):
    result = run_case(name)
    print(f"{name}: {result.state_hash}")
    failed = [f"{c['what']}: {c['value']} is not {c['relation']} {c['bound']} ({c['law']})" for c in result.checks if not c["passed"]]
    assert result.outcome == PASSED and result.checks, "\n".join(failed)


@pytest.mark.parametrize(
    "name",
    [
        "table", "house_of_cards", "roll_over_tiles", "bounces_to_rest", "wedge_in_crack", "cube_in_hole", "heavy_dropped_1e3",
        "plate_of_balls", "motor_hinge", "chain_hanging",
    ],
)  # fmt: skip
def test_checks_have_teeth(name):
    # A drift of 1 cm/s that starts after the first tenth breaks every bound on places, which are 1e-3 m and less.
    run = run_of(name)
    drift = 0.01 * np.maximum(run.times - 0.1 * run.times[-1], 0.0)[:, None, None] * np.array([0.6, 0.0, -0.8])
    moving = np.array([run.scene[n].motion == "dynamic" for n in run.names])[None, :, None]
    moved = replace(run, positions=run.positions + drift * moving, velocities=run.velocities + 0.01 * moving)
    assert not all(check.passed for check in gallery.load(name).check(moved))


@pytest.mark.parametrize(
    ("module", "name", "constant", "quantity"),
    [
        (friction, "plate_of_balls", "PUSH_FORCE", "acceleration of the plate"),
        (friction, "plate_of_balls", "PLATE_BALL_MASS", "acceleration of a ball"),
        (jointed, "motor_hinge", "STIFFNESS", "holds: error of the sag"),
        (jointed, "motor_hinge", "DRIVE_DAMPING", "lifts"),
        (jointed, "motor_hinge", "WEAK", "stalls: error of the highest turn"),
        (jointed, "chain_hanging", "BALL_MASS", "last joint's load"),
    ],
)
def test_another_law_fails(module, name, constant, quantity):
    # One part in a hundred of a force, a mass or a gain moves what the law gives by about as much; bounds are 1e-3 and less.
    # The scene is that of a copy of the module; the checks keep the module's own constant.
    entry, spec = gallery.load(name), module.__spec__
    other = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(other)
    setattr(other, constant, 1.01 * getattr(module, constant))
    scene = next(case for case in other.SCENES if case.name == name).scene()
    checks = entry.check(ri.simulate(scene, entry.duration, entry.fps))
    assert any(quantity in check.what and not check.passed for check in checks)


@pytest.mark.parametrize("name", ["fast_spin", "renamed", "deep_overlap", "wedge_in_crack"])
def test_numbers_that_are_not_finite_fail_every_case(name):
    run = run_of(name)
    positions = run.positions.copy()
    positions[-1, -1, 0] = np.nan
    first = gallery.load(name).check(replace(run, positions=positions))[0]
    assert not first.passed and first.value == 1


def test_energy_out_of_nothing_fails():
    # One frame in the middle with 1e-3 more energy: the bound of contact gaps is some 1e-5 of it.
    run = run_of("wedge_in_crack")
    kinetic = run.ledger.kinetic.copy()
    kinetic[len(kinetic) // 2 :] += 1e-3 * run.ledger.total[0]
    grown = replace(run, ledger=replace(run.ledger, kinetic=kinetic))
    failed = [check.what for check in gallery.load("wedge_in_crack").check(grown) if not check.passed]
    assert failed == ["largest rise of energy, J"]


def test_every_case_is_a_scene_of_its_family():
    names = gallery.hard_names()
    assert len(set(names)) == len(names) and not set(names) & set(gallery.names())
    assert tuple(name for _, cases in FAMILIES.values() for name in cases) == names
    for name in names:
        entry = gallery.load(name)
        assert entry.name == name and "\n" not in entry.description
        assert len(entry.scene().bodies) == len(entry.scene().bodies) > 0 and entry.scene() is not entry.scene()


def test_a_case_that_hangs_is_a_row(tmp_path, monkeypatch):
    # The process starts another one, as the first compilation does: both must be gone.
    note = tmp_path / "pid"
    code = f"import os, subprocess; p = subprocess.Popen(['sleep', '60']); open({str(note)!r}, 'w').write(str(p.pid)); p.wait()"
    _replace_program(monkeypatch, code)
    start = time.perf_counter()
    result = run_apart("table", 2.0)
    assert result.outcome == HUNG and "2 s" in result.message and time.perf_counter() - start < 20.0
    time.sleep(0.2)
    assert not _alive(int(note.read_text()))


def test_a_case_that_crashes_is_a_row_with_its_last_words(monkeypatch):
    _replace_program(monkeypatch, "import os, sys; sys.stderr.write('last words'); sys.stderr.flush(); os.abort()")
    result = run_apart("table", 20.0)
    assert result.outcome == CRASHED and "last words" in result.message and not result.checks


def test_the_suite_goes_on_after_a_bad_case(monkeypatch, tmp_path):
    _replace_program(monkeypatch, "import sys; sys.exit(3)")
    seen = []
    results = run_suite(["table", "coin"], 20.0, seen.append)
    assert [r.name for r in results] == ["table", "coin"] and seen == results
    arrays, page = write_results(results, tmp_path / "folder", 20.0)
    assert [case["outcome"] for case in json.loads(arrays.read_text())["cases"]] == [CRASHED, CRASHED]
    assert "exit code 3" in page.read_text()


def test_the_command_writes_table_json_and_page(tmp_path):
    result = CliRunner().invoke(main, ["hardcases", "bullet_and_bullet", "inside_out", "-o", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert "2 of 2 passed" in result.output
    figures = json.loads((tmp_path / "hard_cases.json").read_text())
    case = figures["cases"][0]
    assert figures["passed"] == 2 and figures["machine"]["cores"] >= 1
    assert case["state_hash"] == run_of("bullet_and_bullet").state_hash()
    assert any("impact_time after" in check["what"] for check in case["checks"])
    page = (tmp_path / "hard_cases.html").read_text(encoding="utf-8")
    assert "http" not in page and "src=" not in page and "Two bullets meet" in page


def test_the_exit_code_says_whether_a_case_failed(monkeypatch, tmp_path):
    _replace_program(monkeypatch, "import sys; sys.exit(3)")
    result = CliRunner().invoke(main, ["hardcases", "table", "-o", str(tmp_path)])
    assert result.exit_code == CHECK_FAILED and "CRASHED" in result.output


@pytest.mark.parametrize(
    ("arguments", "words"), [(("tabel",), "did you mean 'table'"), (("table", "--limit", "0"), "limit"), (("spot",), "unknown hard case")]
)
def test_mistakes_get_a_message(arguments, words, tmp_path):
    result = CliRunner().invoke(main, ["hardcases", *arguments, "-o", str(tmp_path)])
    assert result.exit_code == BAD_SCENE and words in result.stderr


def test_the_page_escapes_and_shows_what_is_not_finite():
    check = {"what": "a < b", "value": None, "bound": 1.0, "passed": False, "law": "<law>", "relation": "at most"}
    result = CaseResult("name", "x & y", "family", "failed", [check], message="<status>")
    from rigidimpulse.studies.hard_page import page

    text = page([result], hard_cases.machine())
    assert "a &lt; b" in text and "x &amp; y" in text and "&lt;status&gt;" in text and "<law>" not in text


@pytest.mark.parametrize(("thickness", "stands"), [(0.16, True), (0.11, True), (0.10, False), (0.08, False)])
def test_the_arch_stands_or_falls_by_limit_analysis(thickness, stands):
    # Is there any set of joint forces within the cones that balances every voussoir? A linear program, independent of the
    # engine; for these fifteen voussoirs the answer changes at 0.1061 (the continuous arch: 0.1075).
    from scipy.optimize import linprog

    balance, weights, limits = _arch_program(thickness)
    bounds = [(0.0, None), (None, None)] * (balance.shape[1] // 2)
    program = linprog(np.zeros(balance.shape[1]), A_ub=limits, b_ub=np.zeros(len(limits)), A_eq=balance, b_eq=weights, bounds=bounds)
    assert (program.status == 0) == stands


def _arch_program(thickness, friction=0.7):
    """Return balance of forces and torques, weights, and friction limits; unknowns: normal and tangential force at joint corners."""
    number = stacks.VOUSSOIRS
    angles = math.pi * np.arange(number + 1) / number
    inner, outer = 1.0 - 0.5 * thickness, 1.0 + 0.5 * thickness
    balance, weights = np.zeros((3 * number, 4 * (number + 1))), np.zeros(3 * number)
    for k in range(number):
        corners = np.array([(r * math.cos(a), r * math.sin(a)) for a, r in zip(angles[[k, k, k + 1, k + 1]], (inner, outer, outer, inner))])
        (x, y), (x1, y1) = corners.T, np.roll(corners, -1, axis=0).T
        cross = x * y1 - x1 * y
        center = np.array([((x + x1) * cross).sum(), ((y + y1) * cross).sum()]) / (3.0 * cross.sum())
        weights[3 * k + 1] = 0.5 * abs(cross.sum())
        for joint, sign in ((k, 1.0), (k + 1, -1.0)):
            radial = np.array([math.cos(angles[joint]), math.sin(angles[joint])])
            along = np.array([-radial[1], radial[0]])
            for corner, r in enumerate((inner, outer)):
                arm = r * radial - center
                for part, force in enumerate((sign * along, sign * radial)):
                    balance[3 * k : 3 * k + 3, 4 * joint + 2 * corner + part] = [*force, arm[0] * force[1] - arm[1] * force[0]]
    limits = np.zeros((balance.shape[1], balance.shape[1]))
    for pair in range(balance.shape[1] // 2):
        limits[2 * pair : 2 * pair + 2, 2 * pair : 2 * pair + 2] = [[-friction, 1.0], [-friction, -1.0]]
    return balance, weights, limits


def _replace_program(monkeypatch, code):
    """Let cases run another Python program."""
    start = subprocess.Popen
    monkeypatch.setattr(hard_cases.subprocess, "Popen", lambda command, **settings: start([sys.executable, "-c", code], **settings))


def _alive(process):
    """Return whether a process runs; a dead one that nobody has waited for does not."""
    try:
        os.kill(process, 0)
        with open(f"/proc/{process}/stat") as stream:
            return stream.read().rsplit(")", 1)[1].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False
