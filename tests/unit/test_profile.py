"""Where the time of a run went: numbers that add up, of this run alone."""

import time

import pytest

import rigidimpulse as ri


def falling_box() -> ri.Scene:
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    scene.add(ri.Body("box", ri.Shape.box((1.0, 1.0, 1.0)), position=(0.0, 0.0, 1.0), angular_velocity=(1.0, 0.5, 0.0)))
    return scene


EVENTS = ("collision.time_of_impact.search.first_contacts", "engine.exact.event_loop.run_events")
"""Kernels that find impacts: the compiled order of events is used as soon as it lies in the cache."""


def test_stages_add_up_to_the_time_of_the_run() -> None:
    ri.simulate(falling_box(), 0.5)
    start = time.perf_counter()
    run = ri.simulate(falling_box(), 0.5)
    spent = time.perf_counter() - start
    profile = run.profile
    assert profile is not None
    assert 0.5 * spent <= profile.seconds <= spent
    assert sum(profile.stages.values()) == pytest.approx(profile.seconds)
    assert min(profile.stages.values()) > 0.0
    assert {"detect", "respond", "sweep", "integrate"} <= set(profile.stages)


def test_kernels_are_those_of_this_run() -> None:
    run, again = ri.simulate(falling_box(), 0.5), ri.simulate(falling_box(), 0.5)
    assert run.profile is not None
    assert again.profile is not None
    sweeps = [sum(p.kernels[name].calls for name in EVENTS if name in p.kernels) for p in (run.profile, again.profile)]
    assert sweeps[0] - sweeps[1] in (0, -1)  # the very first call may have loaded it, which counts elsewhere
    assert again.profile.preparing == 0.0
    times = [kernel.seconds for kernel in again.profile.kernels.values()]
    assert times == sorted(times, reverse=True)
    assert sum(times) < again.profile.seconds
    # A run in which nothing can touch calls no kernel of contacts.
    free = ri.simulate(ri.Scene(bodies=[ri.Body("box", ri.Shape.box((1.0, 1.0, 1.0)))]), 0.5)
    assert free.profile is not None
    assert not any(name.startswith(("collision", "dynamics", "engine.touching", "engine.pair_table")) for name in free.profile.kernels)


def test_the_table_names_stages_and_kernels() -> None:
    ri.simulate(falling_box(), 0.5)
    profile = ri.simulate(falling_box(), 0.5).profile
    assert profile is not None
    lines = profile.table().splitlines()
    assert lines[0].split() == ["stage", "s", "share"]
    assert any(line.startswith(EVENTS) for line in lines)
    assert lines[-1].startswith("loading or compiling kernels") and "0.000" in lines[-1]
