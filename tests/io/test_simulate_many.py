"""Many runs of one scene: the bits of single runs, wherever they run, and no run that loses another."""

from __future__ import annotations

import os
from itertools import count, islice
from pathlib import Path

import many_scenes
import numpy as np
import pytest
from many_scenes import balls, fatal, hash_and_process

import rigidimpulse as ri
from rigidimpulse.studies.wedges.vary import with_parameter

VARIATIONS = [
    {}, {"a.velocity": (2.0, 0.1, 0.0)}, {"material.restitution": 0.2, "gravity.z": -1.62}, {"b.mass": 3.0}, {"seed": 4},
    {"a.position.z": 0.5, "a.orientation": (1, 2, 3, 4)},
]  # fmt: skip


@pytest.fixture
def workers_find_scenes(monkeypatch):
    """Worker processes import the module of scenes."""
    folder = str(Path(many_scenes.__file__).parent)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([folder, os.environ.get("PYTHONPATH", "")]))


def single(variation, **settings):
    """The same run by itself."""
    scene = balls()
    for name, value in variation.items():
        scene = with_parameter(scene, name, value)
    return ri.simulate(scene, 0.6, **settings)


def test_each_run_has_the_bits_of_a_single_run():
    scene = balls()
    runs = list(ri.simulate_many(scene, VARIATIONS, 0.6))
    alone = [single(variation) for variation in VARIATIONS]
    assert [run.number for run in runs] == list(range(6)) and [run.parameters for run in runs] == VARIATIONS
    assert [run.kept.state_hash for run in runs] == [run.state_hash() for run in alone]
    assert len({run.kept.state_hash for run in runs}) == 6
    for run, one in zip(runs, alone, strict=True):
        last = run.kept
        np.testing.assert_array_equal(last.positions[last.index("b")], one.position("b")[-1])
        np.testing.assert_array_equal(last.angular_velocities, one.angular_velocities[-1])
        assert (last.impacts, last.time, last.status.message) == (len(one.impacts), one.times[-1], one.status.message)
    assert scene["a"].velocity == (1.0, 0, 0)
    with pytest.raises(ri.SceneError, match="unknown body 'c'"):
        last.index("c")


def test_runs_on_several_processes_have_the_same_bits_and_order(workers_find_scenes):
    runs = list(ri.simulate_many(balls(), VARIATIONS, 0.6, keep=hash_and_process, processes=2))
    here = [run.kept.state_hash for run in ri.simulate_many(balls(), VARIATIONS, 0.6)]
    assert [run.error for run in runs] == [None] * 6
    assert [run.kept[0] for run in runs] == here
    assert os.getpid() not in {run.kept[1] for run in runs}


def test_settings_of_the_run_may_be_varied_and_are_handed_on():
    vary = [{"fps": 30.0}, {"duration": 0.3}, {"accuracy.step": 0.01}]
    runs = ri.simulate_many(balls, vary, 0.6, accuracy="standard", effects={"friction": False}, keep=lambda run: run)
    first, short, fine = (run.kept for run in runs)
    assert first.state_hash() == single({}, fps=30.0, effects={"friction": False}).state_hash()
    assert (len(first.times), len(short.times), len(fine.times)) == (19, 19, 37)
    assert short.settings.duration == 0.3 and fine.settings.accuracy.step == 0.01


def test_runs_that_fail_are_told_and_lose_no_others():
    bad = [{}, {"a.position": "up"}, {"a.mass": -1.0}, 5, {"b.velocity.x": "fast"}, {"c.mass": 1.0}, {}]
    runs = list(ri.simulate_many(balls(), bad, 0.1))
    assert [run.error is None for run in runs] == [True, False, False, False, False, False, True]
    texts = [str(run.error) for run in runs]
    assert texts[1] == "variation 1, body 'a': position is 'up'; give three finite numbers, in m"
    assert texts[2].startswith("variation 2, body 'a': mass is -1.0 kg; give a mass > 0")
    assert texts[3].startswith("variation 3: it is 5; give values by name")
    assert texts[4] == "variation 4: b.velocity.x is 'fast'; give a finite number"
    assert texts[5].startswith("variation 5: nothing to vary is called 'c.mass'")
    assert all(run.kept is None for run in runs[1:6])

    def fails(run):
        return 1 / 0

    (run,) = ri.simulate_many(balls(), [{}], 0.1, keep=fails)
    assert str(run.error) == "variation 0: ZeroDivisionError: division by zero"


def test_a_process_that_dies_takes_no_other_run_with_it(workers_find_scenes):
    runs = list(ri.simulate_many(fatal, [{}, {"deadly": 1}, {"deadly": 2}, {}], 0.1, processes=2))
    assert [run.error and str(run.error) for run in runs] == [
        None, "variation 1: RuntimeError: its process died", "variation 2: RuntimeError: no such scene", None,
    ]  # fmt: skip
    assert runs[0].kept.state_hash == runs[3].kept.state_hash


def test_variations_are_taken_as_they_are_needed():
    taken = []

    def endless():
        for number in count():
            taken.append(number)
            yield {"a.velocity.x": 0.01 * number}

    runs = list(islice(ri.simulate_many(balls(), endless(), 0.05), 3))
    assert [run.number for run in runs] == [0, 1, 2] and len(taken) == 3
    assert list(ri.simulate_many(balls(), [], 0.1)) == []


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"duration": -1.0}, "duration"),
        ({"processes": 0}, "processes is 0; give a whole number"),
        ({"effects": {"glue": True}}, "unknown effect 'glue'"),
        ({"accuracy": "best"}, "best"),
        ({"variations": [{"die.mass": 1.0}]}, "variation 0: nothing to vary is called 'die.mass'"),
        ({"scene": ri.Scene()}, "no bodies"),
        ({"keep": lambda run: run, "processes": 2}, "scene or keep cannot be sent to other processes"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else None,
)
def test_what_is_wrong_with_all_runs_is_refused_at_once(changed, message):
    given = {"scene": balls(), "variations": [{}], "duration": 0.1, **changed}
    with pytest.raises(ri.SceneError, match=message):
        ri.simulate_many(given.pop("scene"), given.pop("variations"), given.pop("duration"), **given)
