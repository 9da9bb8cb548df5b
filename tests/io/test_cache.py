"""Caches: a run that is stopped at any moment goes on from its last checkpoint and ends with the very bits of one that was not."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from kept_runs import SCENES, gas, pile, run

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.cli.cli import BAD_SCENE, main

h5py = pytest.importorskip("h5py")
DURATIONS = {"pile": 0.5, "gas": 40.0, "forces": 0.4}


class Stopped(Exception):
    """Raised in the middle of a run."""


def stop_after(time):
    """Return a `progress` that raises once the run has come so far."""

    def progress(now):
        if now >= time:
            raise Stopped

    return progress


def same(a, b):
    """Assert that two runs agree in every bit, ledgers and reports included."""
    assert a.state_hash() == b.state_hash()
    np.testing.assert_array_equal(a.ledger.kinetic, b.ledger.kinetic)
    assert a.ledger.dissipated.keys() == b.ledger.dissipated.keys()
    for cause, lost in a.ledger.dissipated.items():
        np.testing.assert_array_equal(lost, b.ledger.dissipated[cause])
    assert a.contacts.tobytes() == b.contacts.tobytes()
    assert a.status == b.status


@pytest.mark.parametrize("name", SCENES)
def test_killed_runs_end_with_the_same_bits(name, tmp_path):
    cache = tmp_path / "run.h5"
    program = Path(__file__).with_name("kept_runs.py")
    command = [sys.executable, str(program), name, str(DURATIONS[name]), str(cache), "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    kills, digest = done.stdout.split()[-2:]
    assert int(kills) >= 2
    assert digest == run(name, DURATIONS[name], None).state_hash()


EFFECTS = ["spot", "pile", "cloth_on_ball", "rocket", "pendulum", "driven_oscillator", "smoothed_path", "pinned_shapes"]


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_goes_on(name, tmp_path):
    # Each step is a checkpoint, and the run is stopped three times on its way: what a checkpoint leaves out would show.
    entry = gallery.load(name)
    settings = {"duration": 0.3, "fps": entry.fps, "accuracy": entry.accuracy}
    whole = ri.simulate(entry.scene(), **settings)
    cache = ri.Cache(tmp_path / "run.h5", every=0.0)
    for time in (0.06, 0.15, 0.24):
        with pytest.raises(Stopped):
            ri.simulate(entry.scene(), **settings, cache=cache, progress=stop_after(time))
    same(ri.simulate(entry.scene(), **settings, cache=cache), whole)


@pytest.mark.parametrize("solver", ["substepped", "qp"])
def test_runs_go_on_with_methods_and_functions_in_their_state(solver, tmp_path):
    # Bodies that a joint keeps from colliding are asked for by a method of the world; the solver of rows is a function.
    scene = pile()
    for k, name in enumerate(("left", "right")):
        scene.add(ri.Body(name, ri.Shape.box((0.2, 0.2, 0.2)), position=(3 + 0.2 * k, 0, 0.1)))
    scene.add(ri.BallJoint("left", "right", (3.1, 0, 0.1)))
    accuracy = ri.Accuracy(contact_solver=solver)
    whole = ri.simulate(scene, 0.1, accuracy=accuracy)
    cache = ri.Cache(tmp_path / "run.h5", every=0.0)
    with pytest.raises(Stopped):
        ri.simulate(scene, 0.1, accuracy=accuracy, cache=cache, progress=stop_after(0.05))
    same(ri.simulate(scene, 0.1, accuracy=accuracy, cache=cache), whole)


def test_a_finished_cache_is_read_and_not_run_again(tmp_path):
    cache = tmp_path / "run.h5"
    first = ri.simulate(pile(), 0.5, cache=cache)
    looks = []
    same(ri.simulate(pile(), 0.5, cache=cache, progress=looks.append), first)
    assert looks == []
    loaded = ri.load_recording(cache)
    assert loaded.state_hash() == first.state_hash()
    assert loaded.contacts.tobytes() == first.contacts.tobytes()
    assert loaded.status.ok


def test_flexible_bodies_are_in_the_cache(tmp_path):
    entry = gallery.load("cloth_on_ball")
    first = ri.simulate(entry.scene(), 0.1, cache=tmp_path / "run.h5")
    loaded = ri.load_recording(tmp_path / "run.h5")
    for track in first.soft_bodies:
        np.testing.assert_array_equal(loaded.soft_body(track.name)[0], track.vertices)


def test_a_stopped_run_leaves_its_frames(tmp_path):
    cache = ri.Cache(tmp_path / "run.h5", every=0.0)
    with pytest.raises(Stopped):
        ri.simulate(pile(), 0.4, 100.0, cache=cache, progress=stop_after(0.25))
    left, whole = ri.load_recording(tmp_path / "run.h5"), ri.simulate(pile(), 0.4, 100.0)
    assert 20 <= len(left.times) <= 26
    frames = slice(0, len(left.times))
    np.testing.assert_array_equal(left.positions, whole.positions[frames])
    np.testing.assert_array_equal(left.orientations, whole.orientations[frames])
    impacts = whole.impacts[whole.impacts["time"] <= left.times[-1]]
    assert left.impacts[: len(impacts)].tobytes() == impacts.tobytes()
    assert not left.status.ok
    assert "go on from there" in left.status.message


def test_the_older_checkpoint_does_where_the_newer_one_is_damaged(tmp_path):
    cache = ri.Cache(tmp_path / "run.h5", every=0.0)
    with pytest.raises(Stopped):
        ri.simulate(pile(), 0.4, cache=cache, progress=stop_after(0.25))
    with h5py.File(cache.path, "r+") as file:
        newer = int(np.argmax(file["checkpoint/commits"]["number"]))
        number = int(file["checkpoint/commits"]["number"].max())
        file[f"checkpoint/{newer}"][100:200] = 0
    assert number > 2
    before = len(ri.load_recording(cache.path).times)
    assert before >= 14
    same(ri.simulate(pile(), 0.4, cache=cache), ri.simulate(pile(), 0.4))


def heavier():
    scene = pile()
    changed = ri.Scene()
    for body in scene.bodies:
        changed.add(replace(body, mass=np.nextafter(3.0, 4.0)) if body.name == "box3" else body)
    return changed


def pushed(strength):
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.5)))
    scene.add(ri.ForceField(lambda time, position, velocity: strength * np.ones_like(position), bodies=["ball"]))
    return scene


@pytest.mark.parametrize(
    ("made", "other", "told"),
    [
        ((pile(), 0.1, {}), (heavier(), 0.1, {}), "another scene"),
        ((pile(), 0.1, {}), (pile(), 0.2, {}), "duration 0.1 s, asked for is 0.2 s"),
        ((pile(), 0.1, {}), (pile(), 0.1, {"fps": 30.0}), "asked for is 30"),
        ((pile(), 0.1, {}), (pile(), 0.1, {"accuracy": "exact"}), "another accuracy"),
        ((pile(), 0.1, {}), (pile(), 0.1, {"effects": {"friction": False}}), "other effects"),
        ((pushed(1.0), 0.1, {}), (pushed(2.0), 0.1, {}), "another scene"),
    ],
)
def test_a_cache_of_something_else_is_refused_and_kept(made, other, told, tmp_path):
    cache = tmp_path / "run.h5"
    ri.simulate(made[0], made[1], cache=cache, **made[2])
    before = cache.read_bytes()
    with pytest.raises(ri.SceneError, match=told):
        ri.simulate(other[0], other[1], cache=cache, **other[2])
    assert cache.read_bytes() == before


def test_bad_caches_are_refused(tmp_path):
    (tmp_path / "text.h5").write_text("no HDF5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1.0
    for name in ("text.h5", "other.h5"):
        with pytest.raises(ri.SceneError, match=name):
            ri.simulate(gas(), 0.1, cache=tmp_path / name)
        with pytest.raises(ri.SceneError, match=name):
            ri.load_recording(tmp_path / name)
    with pytest.raises(ri.SceneError, match=r"ends in \.h5"):
        ri.simulate(gas(), 0.1, cache=tmp_path / "run.npz")
    with pytest.raises(ri.SceneError, match="every = -1"):
        ri.simulate(gas(), 0.1, cache=ri.Cache(tmp_path / "run.h5", every=-1.0))
    with pytest.raises(ri.SceneError, match=r"run\.choice\.accuracy"):
        ri.simulate(gas(), 0.1, cache=tmp_path / "run.h5", accuracy=ri.Within(position=0.1))


class OwnPin:
    """An energy of a user's own class: that of a pin."""

    def __init__(self, pin):
        self._pin = pin

    def compile(self, world):
        return OwnPin(self._pin.compile(world))

    def __getattr__(self, name):
        return getattr(self.__dict__["_pin"], name)


def test_objects_of_own_classes_are_refused_at_the_start(tmp_path):
    # Nothing could be made of them again. Functions are found again in the scene: see `forces` of kept_runs.
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("box", ri.Shape.box((1, 1, 1))))
    scene.add(ri.EnergyForce(OwnPin(ri.PinPoints(None, "box", (0, 0, 0), (0, 0, 0), 10.0)), name="pin"))
    assert ri.simulate(scene, 0.02).status.ok
    looks = []
    with pytest.raises(ri.SceneError, match=r"it holds a test_cache\.OwnPin; simulate it without a cache"):
        ri.simulate(scene, 0.02, cache=tmp_path / "run.h5", progress=looks.append)
    assert looks == []


def test_a_cache_that_is_written_to_is_left_alone(tmp_path):
    cache = tmp_path / "run.h5"
    program = f"import rigidimpulse as ri; from kept_runs import pile; ri.simulate(pile(), 0.1, cache={str(cache)!r})"

    def second(now):
        other = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=Path(__file__).parent)
        assert "another run writes to it" in other.stderr
        assert len(ri.load_recording(cache).times) <= 7  # looking is free
        raise Stopped

    with pytest.raises(Stopped):
        ri.simulate(pile(), 0.1, cache=cache, progress=second)


def test_cut_off_files_are_refused_or_gone_on_with(tmp_path):
    ri.simulate(gas(), 0.2, cache=tmp_path / "run.h5")
    whole = (tmp_path / "run.h5").read_bytes()
    for part in (0, 10, 500, len(whole) // 2, len(whole) - 1):
        (tmp_path / "cut.h5").write_bytes(whole[:part])
        with pytest.raises(ri.SceneError):
            ri.simulate(gas(), 0.2, cache=tmp_path / "cut.h5")


def test_the_command_line_goes_on(tmp_path):
    cache, output = tmp_path / "run.h5", tmp_path / "run.npz"
    command = ["simulate", "bounce", "--duration", "0.5", "--cache", str(cache), "-o", str(output)]
    told = [CliRunner().invoke(main, command) for _ in range(2)]
    assert [result.exit_code for result in told] == [0, 0], told[0].output
    assert "already had the beginning" not in told[0].output
    assert "already had the beginning" in told[1].output
    refused = CliRunner().invoke(main, ["simulate", "spot", "--duration", "0.5", "--cache", str(cache), "-o", str(output)])
    assert refused.exit_code == BAD_SCENE
    assert "another scene" in refused.output
