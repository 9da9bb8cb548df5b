"""The preset "preview": what touches and what has joints goes to sub-steps, at the depth, gap and energy that the guide promises.

Planted faults: with "standard" nothing of these scenes is sub-stepped at first; a rung that forgot joints would have no sub-stepped step.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.engine.measure.measure import record_of_recording
from rigidimpulse.engine.measure.overlap import SUB_STEPPED, overlap_depths

G = 9.81
ROUGH = ri.Material(density=700, restitution=0.0, static_friction=0.5, dynamic_friction=0.4)


def steps(run: ri.Recording) -> int:
    """How many sub-stepped steps the run had."""
    return int(run.plan.line("sub-stepped islands").counts.get("steps", 0))


@pytest.mark.parametrize("heavy", [1.0, 1000.0])
def test_a_chain_keeps_its_joints_and_its_energy(heavy: float) -> None:
    """Twenty links on ball joints swing with a weight at the end: gaps of at most 1 mm, no energy made, at any ratio of masses."""
    scene, along = ri.Scene(gravity=(0, 0, -G)), np.array([1.0, 0.0, 0.0])
    for k in range(20):
        mass = heavy if k == 19 else 1.0
        scene.add(ri.Body(f"link {k}", ri.Shape.box((0.09, 0.04, 0.04)), position=(0.1 * k + 0.05) * along, mass=mass))
        scene.add(ri.BallJoint(f"link {k - 1}" if k else None, f"link {k}", 0.1 * k * along))
    run = ri.simulate(scene, 1.0, accuracy="preview")
    assert run.status.ok, run.status.message
    assert steps(run) >= 60
    ends = [run.position(f"link {k}") for k in range(20)]
    # Neighbours are at most a link apart, and the first at most half of one from its anchor.
    assert all(np.linalg.norm(b - a, axis=1).max() < 0.1 + 1e-3 for a, b in pairwise(ends))
    assert np.linalg.norm(ends[0], axis=1).max() < 0.05 + 1e-3
    total = run.ledger.kinetic + run.ledger.potential
    assert (total - np.minimum.accumulate(total)).max() < 1e-3 * run.ledger.kinetic.max()


def test_boxes_that_fall_lie_on_each_other() -> None:
    """A fall of boxes: sub-stepped from the first contact on; depths within the bound of soft contact; all at rest on the floor."""
    random, scene = np.random.default_rng(11), ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
    for k in range(8):
        place = (0.05 * random.normal(), 0.05 * random.normal(), 0.3 + 0.35 * k)
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.2, 0.15, 0.1)), position=place, material=ROUGH))
    run = ri.simulate(scene, 2.0, accuracy="preview")
    found = overlap_depths(record_of_recording(run))
    assert run.status.ok, run.status.message
    assert steps(run) > 60
    assert (found.depth / found.size).max(initial=0.0) < SUB_STEPPED
    assert run.positions[-1, 1:, 2].min() > 0.04
    assert np.linalg.norm(run.velocities[-1, 1:], axis=1).max() < 0.05


def test_what_only_flies_and_meets_in_the_air_is_exact() -> None:
    """Two balls meet head on: velocities are exchanged to round-off, and nothing is sub-stepped."""
    hard, scene = ri.Material(density=1000, restitution=1.0, static_friction=0.0, dynamic_friction=0.0), ri.Scene(gravity=(0, 0, 0))
    for name, x, v in (("a", -0.5, 1.0), ("b", 0.5, -2.0)):
        scene.add(ri.Body(name, ri.Shape.sphere(0.1), position=(x, 0, 0), velocity=(v, 0, 0), material=hard))
    run = ri.simulate(scene, 1.0, accuracy="preview")
    np.testing.assert_allclose([run.velocity("a")[-1, 0], run.velocity("b")[-1, 0]], [-2.0, 1.0], atol=1e-9)


def test_rolling_friction_is_not_forgotten() -> None:
    """A ball with rolling friction comes to rest after v0^2 / (2 a) with a = 5/7 g l / r, as at "standard"."""
    radius, length, speed = 0.1, 2e-3, 0.5
    rubber = ri.Material(static_friction=0.8, dynamic_friction=0.8, restitution=0.0, rolling_friction=length)
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=rubber))
    ball = {"position": (0, 0, radius), "velocity": (speed, 0, 0), "angular_velocity": (0, speed / radius, 0)}
    scene.add(ri.Body("ball", ri.Shape.sphere(radius), mass=1.0, material=rubber, **ball))
    ends = [ri.simulate(scene, 4.5, accuracy=preset) for preset in ("preview", "standard")]
    ways = [run.position("ball")[-1, 0] for run in ends]
    assert steps(ends[0]) == 0
    np.testing.assert_allclose(ways[0], ways[1], rtol=1e-6)
    assert abs(ends[0].velocity("ball")[-1, 0]) < 1e-9


@pytest.mark.parametrize("name", ["arm", "soft_hinge"])
def test_machines_with_springs_and_drives_are_ok(name: str) -> None:
    """The book of what drives give closes: no energy comes from nothing; it was 2 % of what moves."""
    entry = gallery.load(name)
    run = ri.simulate(entry.scene(), 1.5, entry.fps, accuracy="preview")
    assert run.status.ok, run.status.message
    assert run.ledger is not None
    made = run.ledger.dissipated.get("sub-stepping", np.zeros(1))
    assert abs(made).max() < 1e-3 * run.ledger.kinetic.max()


COSTS = {"bounce": 0, "incline": 0, "tippe_top": 60, "ladder": 0, "stack_10": 0, "spot": 0}
"""Scenes of one body, or of bodies that stand, which exact contact does at a fraction of what sub-steps cost; sub-steps in 1 s at most."""


@pytest.mark.parametrize("name", COSTS)
def test_what_is_cheap_stays_exact(name: str) -> None:
    """A preview must not be slower than "standard": these took 5 to 100 times as long, in 60 sub-stepped steps a second or more."""
    entry = gallery.load(name)
    duration = min(entry.duration, 1.0)
    run = ri.simulate(entry.scene(), duration, accuracy="preview")
    assert run.status.ok, run.status.message
    assert steps(run) <= COSTS[name] * duration
    if not COSTS[name]:
        exact = ri.simulate(entry.scene(), duration, accuracy="standard")
        # The same motion, except for the time of impact, which "preview" finds to 1e-7 of the size.
        np.testing.assert_allclose(run.positions, exact.positions, atol=1e-4 * np.abs(exact.positions).max())


def test_what_is_expensive_is_sub_stepped() -> None:
    """A disk that rings down is solved eighty times a step; sub-steps hold it at a tenth of the cost, and it goes on to turn as it did."""
    run = ri.simulate(gallery.load("euler_disk").scene(), 1.0, accuracy="preview")
    assert steps(run) > 30
    assert run.status.ok, run.status.message


def test_costs_repeat() -> None:
    """The choice follows counts and no clock: another run has the same bits."""
    entry = gallery.load("tippe_top")
    first, second = (ri.simulate(entry.scene(), 0.7, accuracy="preview") for _ in range(2))
    assert steps(first) == steps(second)
    assert first.state_hash() == second.state_hash()


def test_what_runs_away_stays_in_sub_steps() -> None:
    """Thirteen bodies that come to contact again and again are handed over at most once for each time they come apart."""
    run = ri.simulate(gallery.load("dominoes").scene(), 1.5, accuracy="preview")
    line = run.plan.line("sub-stepped islands")
    assert line.counts["steps"] > 30
    assert line.counts.get("refused: sub-steps cost more", 0) <= 2


@pytest.mark.parametrize("heavy", ["ball", "box"])
@pytest.mark.parametrize("ratio", [100.0, 2000.0])
def test_what_is_heavy_does_not_press_few_light_bodies_into_the_floor(heavy: str, ratio: float) -> None:
    """It falls on a plate of a hundredth of its mass and less: exact at "preview", too. Sub-steps pressed the plate in by 6 mm of 60."""
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("plate", ri.Shape.box((0.4, 0.3, 0.06)), position=(0, 0, 0.03), mass=1.0))
    shape = ri.Shape.sphere(0.12) if heavy == "ball" else ri.Shape.box((0.2, 0.2, 0.2))
    scene.add(ri.Body("heavy", shape, position=(0.05, 0.02, 0.3), orientation=(1, 0.3, 0.15, 0), mass=ratio))
    run = ri.simulate(scene, 1.0, 240.0, accuracy="preview")
    found = overlap_depths(record_of_recording(run))
    assert run.status.ok, run.status.message
    assert found.depth.max(initial=0.0) < 1e-5
