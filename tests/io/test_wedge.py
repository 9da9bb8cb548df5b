"""Wedges: every combination is one take, the same whoever runs it, and no take stops another."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import wedge_scenes
from click.testing import CliRunner
from wedge_scenes import drop, fragile

import rigidimpulse as ri
from rigidimpulse.cli.cli import BAD_SCENE, CHECK_FAILED, main
from rigidimpulse.studies.wedges.vary import combinations, parse_vary, with_parameter, with_seed

pytest.importorskip("h5py")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("material.restitution=0.1:0.9:9", ("material.restitution", np.linspace(0.1, 0.9, 9).tolist())),
        ("seed=0:3", ("seed", [0, 1, 2, 3])),
        ("ball.mass=1,2.5,4:6", ("ball.mass", [1, 2.5, 4, 5, 6])),
        ("accuracy=preview, exact", ("accuracy", ["preview", "exact"])),
        ("gravity.z=-9.81:-1.62:2", ("gravity.z", [-9.81, -1.62])),
    ],
)
def test_values_are_read(text, expected):
    assert parse_vary(text) == expected


@pytest.mark.parametrize("text", ["", "mass", "mass=", "=1", "mass=1,,2", "mass=1:2:x", "mass=1:2:0", "seed=0.5:2", "mass=1:2:3:4"])
def test_what_is_no_value_is_refused(text):
    with pytest.raises(ri.SceneError, match="--vary"):
        parse_vary(text)


def test_all_combinations_once():
    takes = combinations({"a": [1, 2], "b": np.array([0.5, 0.6, 0.7])})
    assert [(take["a"], take["b"]) for take in takes] == [(1, 0.5), (1, 0.6), (1, 0.7), (2, 0.5), (2, 0.6), (2, 0.7)]
    for bad in ({}, {"a": []}, {"a": "preview"}, {"a": range(1000), "b": range(1000)}):
        with pytest.raises(ri.SceneError):
            combinations(bad)


def room():
    scene = ri.Scene(bodies=[
        ri.Body("floor", ri.Shape.half_space(), motion="static", material=ri.Material(restitution=0.9)),
        ri.Body("ball.001", ri.Shape.sphere(0.1), position=(0, 0, 1), velocity=(1, 2, 3)),
        ri.Body("ball.002", ri.Shape.sphere(0.2), position=(0, 0, 2)),
        ri.Body("wall", ri.Shape.box((1, 1, 1)), motion="static", position=(5, 0, 0)),
    ])  # fmt: skip
    scene.add(ri.Spring("ball.001", None, (0, 0, 1), (0, 0, 3), stiffness=10.0, name="rope"))
    return scene


def test_parameters_reach_what_they_name():
    scene = room()
    changed = with_parameter(scene, "material.restitution", 0.25)
    assert {body.material.restitution for body in changed.bodies} == {0.25}
    changed = with_parameter(scene, "mass", 2.0)
    assert [body.mass for body in changed.bodies] == [None, 2.0, 2.0, None]
    changed = with_parameter(scene, "ball.001.velocity.z", -7.0)
    assert tuple(changed["ball.001"].velocity) == (1, 2, -7)
    changed = with_parameter(scene, "ball*.material.density", 5.0)
    assert [body.material.density == 5.0 for body in changed.bodies] == [False, True, True, False]
    assert with_parameter(scene, "rope.stiffness", 99.0).effects[0].stiffness == 99.0
    assert tuple(with_parameter(scene, "gravity.z", -1.62).gravity) == (0, 0, -1.62)
    assert scene["ball.001"].velocity == (1, 2, 3) and scene.effects[0].stiffness == 10.0  # the scene itself stays
    for bad in ("bounce", "ball.003.mass", "ball.001.weight", "ball.001.velocity.w", "rope.colour", "material", "name"):
        with pytest.raises(ri.SceneError):
            ri.compile_scene(with_parameter(scene, bad, 1.0))


def test_seeds_nudge_by_two_percent_of_the_scale_of_speeds():
    # Speeds of normal deviates: each component has the deviation 0.02 sqrt(g L); over 200 seeds the sample's own is right to 5 sigma, 25 %.
    scene = room()
    assert with_seed(scene, 0) is scene
    nudges = np.array([np.asarray(with_seed(scene, seed)["ball.002"].velocity) for seed in range(1, 201)])
    assert np.unique(nudges).size == nudges.size
    np.testing.assert_allclose(nudges.std(axis=0), 0.02 * np.sqrt(9.81 * 0.4), rtol=0.25)
    np.testing.assert_array_equal(with_seed(scene, 7)["ball.001"].velocity, with_seed(scene, 7)["ball.001"].velocity)
    with pytest.raises(ri.SceneError, match="seed"):
        with_seed(scene, 1.5)


def test_takes_are_the_scene_with_its_parameters(tmp_path):
    # A ball that falls h without loss has v^2 = 2 g h at the floor, whatever the worker.
    heights = [0.5, 1.0, 2.0]
    vary = {"height": heights, "accuracy": ["standard", "preview"]}
    result = ri.wedge(drop, vary, tmp_path, duration=0.8, workers=ri.Workers(processes=1))
    assert [take.parameters["height"] for take in result.takes] == [0.5, 0.5, 1.0, 1.0, 2.0, 2.0]
    assert not result.failed
    for take, height in zip(result.takes[::2], heights, strict=True):
        impact = result.recording(take.number).impacts[0]
        assert impact["approach_speed"] == pytest.approx(np.sqrt(2 * 9.81 * height), rel=1e-9)
        assert (tmp_path / f"take_{take.number:04d}.html").is_file()
    rows = list(csv.reader((tmp_path / "wedge.csv").read_text().splitlines()))
    assert rows[0][:4] == ["take", "height", "accuracy", "outcome"]
    assert len(rows) == 7
    with pytest.raises(ri.SceneError, match="give one of 0 to 5"):
        result.recording(6)


def test_failing_takes_stop_no_others(tmp_path, monkeypatch):
    monkeypatch.setenv("WEDGE_TEST_FOLDER", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(wedge_scenes.__file__).parent), os.environ.get("PYTHONPATH", "")]))
    vary = {"height": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]}
    result = ri.wedge(fragile, vary, tmp_path / "takes", duration=0.2, workers=ri.Workers(processes=2, retries=2))
    outcomes = [take.outcome for take in result.takes]
    assert outcomes == ["ok", "failed", "ok", "failed", "failed", "ok"]
    assert "radius" in result.takes[1].message
    assert result.takes[3].message == "its process died"
    assert "no such height" in result.takes[4].message


def test_a_first_take_that_fails_stops_no_others(tmp_path):
    result = ri.wedge(fragile, {"height": [5.0, 2.0, 1.0]}, tmp_path, duration=0.1, workers=ri.Workers(processes=1))
    assert [take.outcome for take in result.takes] == ["failed", "failed", "ok"]


def test_a_killed_wedge_goes_on(tmp_path):
    program = [sys.executable, str(Path(wedge_scenes.__file__)), "2", str(tmp_path)]
    assert subprocess.run(program).returncode == -signal.SIGKILL
    done = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("take_*.h5")}
    assert len(done) == 2
    result = ri.wedge(drop, {"height": [1.0, 2.0, 3.0]}, tmp_path, duration=0.3, workers=ri.Workers(processes=1))
    assert [take.outcome for take in result.takes] == ["ok"] * 3
    assert all((tmp_path / name).stat().st_mtime_ns == time for name, time in done.items())


def test_a_folder_of_another_wedge_is_refused(tmp_path):
    ri.wedge(drop, {"height": [1.0]}, tmp_path, duration=0.1)
    for vary, duration in (({"height": [2.0]}, 0.1), ({"height": [1.0]}, 0.2)):
        with pytest.raises(ri.SceneError, match="another wedge"):
            ri.wedge(drop, vary, tmp_path, duration=duration)
    with pytest.raises(ri.SceneError, match="nothing to vary"):
        ri.wedge(drop, {"depth": [2.0]}, tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_dask_gives_the_same_bits_though_a_worker_is_killed(tmp_path):
    pytest.importorskip("distributed")
    vary = {"material.restitution": [0.3, 0.6, 0.9], "height": [0.5, 1.0], "seed": range(2)}
    serial = ri.wedge(drop, vary, tmp_path / "serial", duration=0.5, workers=ri.Workers(processes=1))
    where = tmp_path / "scheduler.json"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(wedge_scenes.__file__).parent), *sys.path])}
    begin = [sys.executable, "-m"]
    quiet = {"stderr": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "env": environment, "cwd": tmp_path}
    options = ["--scheduler-file", str(where), "--port", "0", "--no-dashboard", "--host", "127.0.0.1"]
    processes = [subprocess.Popen([*begin, "distributed.cli.dask_scheduler", *options], **quiet)]
    try:
        for _ in range(600):
            # The file is there before it is written.
            if where.is_file() and where.read_text().rstrip().endswith("}"):
                break
            time.sleep(0.1)
        address = json.loads(where.read_text())["address"]
        worker = [*begin, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        processes += [subprocess.Popen(worker, **quiet) for _ in range(2)]
        done = []

        def progress(take):
            done.append(take)
            if len(done) == len(serial.takes) // 2:
                processes[1].kill()

        result = ri.wedge(drop, vary, tmp_path / "dask", duration=0.5, workers=ri.Workers(scheduler=address), progress=progress)
    finally:
        for process in processes:
            process.kill()
            process.wait()
    assert not result.failed
    assert [take.state_hash for take in result.takes] == [take.state_hash for take in serial.takes]


def test_the_command_line(tmp_path):
    def call(*arguments):
        common = ["bounce", "-o", str(tmp_path / "takes"), "--duration", "0.2", "--processes", "1"]
        return CliRunner().invoke(main, ["wedge", *common, *arguments])

    done = call("--vary", "material.restitution=0.2,0.4", "--vary", "seed=0:1")
    assert done.exit_code == 0, done.output
    assert "4 of 4 takes done" in done.output
    failing = call("--vary", "material.restitution=0.2,4")
    assert failing.exit_code == BAD_SCENE and "another wedge" in failing.output
    failing = call("--vary", "material.restitution=0.2,4", "-o", str(tmp_path / "more"))
    assert failing.exit_code == CHECK_FAILED and "1 of 2 takes done" in failing.output
    twice = call("--vary", "seed=1", "--vary", "seed=2")
    assert twice.exit_code == BAD_SCENE and "twice" in twice.output
