"""Accuracy targets: what `Within` promises is kept, and its estimates are honest, on scenes whose motion is known in closed form.

An estimate is good if the true error is below it in at least 95 % of the cases, and not over 20 times smaller in the median. One that is
the difference of two runs alone would be below the true error in most scenes of lasting contact (the gap at which contacts are held is
common to all runs) and in those where settings make no difference (the difference is zero).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse import gallery

TARGETS = (1e-1, 1e-4, 1e-7, 1e-10)
DURATIONS = {
    "bounce": 10.0, "tumbling_box": 5.0, "disks_in_a_box": 20.0, "pool_break": 3.0, "two_spheres": 2.0, "driven_oscillator": 0.5,
    "coupled_springs": 0.5, "stack_10": 1.0, "incline": 1.0, "stopping": 1.5, "sliding_to_rolling": 1.0,
}  # fmt: skip
EXPENSIVE = ("driven_oscillator", "coupled_springs")
"""Forces that vary: the tightest target takes a minute there."""


@cache
def measured(name: str, position: float) -> tuple[ri.Recording, float]:
    """A run with an accuracy target, and its true error, m."""
    entry = gallery.load(name)
    run = ri.simulate(entry.scene(), DURATIONS[name], accuracy=ri.Within(position=position))
    assert entry.exact is not None
    law = entry.exact(run.times)
    return run, max(float(np.linalg.norm(run.position(body) - place, axis=1).max()) for body, place in law.position.items())


def cases() -> list[tuple[str, float]]:
    return [(name, target) for name in DURATIONS for target in (TARGETS[:3] if name in EXPENSIVE else TARGETS)]


def test_estimates_are_above_the_error_and_not_far() -> None:
    ratios = []
    for name, target in cases():
        run, error = measured(name, target)
        assert run.choice is not None
        ratios.append(error / run.choice.error.position)
    assert np.mean(np.array(ratios) <= 1.0) >= 0.95, dict(zip(cases(), ratios, strict=True))
    assert np.median(ratios) >= 1.0 / 20.0


def test_accuracy_targets_that_are_said_to_be_met_are_met() -> None:
    runs = [(target, *measured(name, target)) for name, target in cases()]
    met = [(target, error) for target, run, error in runs if run.choice is not None and run.choice.met]
    assert len(met) > 20
    assert all(error <= target for target, error in met)


def test_a_target_that_cannot_be_met_is_reported() -> None:
    # Contacts are held at 1e-6 of a block's size: 1e-10 m is beyond what any step gives.
    run, _ = measured("incline", 1e-10)
    assert run.choice is not None and not run.choice.met
    assert not run.status.ok
    assert "accuracy not reached" in run.status.message
    assert "step" in run.status.message and "estimated error" in run.status.message


def test_a_shorter_time_asks_for_less() -> None:
    entry = gallery.load("spot")
    run = ri.simulate(entry.scene(), 1.0, accuracy=ri.Within(position=1e-2, until=0.5))
    assert run.choice is not None and run.choice.met and run.choice.until == 0.5
    assert run.times[-1] == 1.0
    assert run.status.ok and "chose step" in run.status.message


def test_time_is_kept_and_more_of_it_is_not_less_accurate() -> None:
    entry = gallery.load("incline")
    runs = [ri.simulate(entry.scene(), 0.5, accuracy=ri.InTime(per_frame=per_frame)) for per_frame in (1e-9, 10.0)]
    hasty, patient = (run.choice for run in runs)
    assert hasty is not None and not hasty.met and not runs[0].status.ok
    assert patient is not None and patient.met and runs[1].status.ok
    assert patient.accuracy.step < hasty.accuracy.step
    # The chosen run was among those that were timed, within the target.
    chosen = next(each for each in patient.tries if each.accuracy == patient.accuracy)
    assert chosen.seconds <= 10.0 * len(runs[1].times)


@pytest.mark.parametrize(
    ("target", "said"),
    [
        (lambda: ri.Within(), "sets no bound"), (lambda: ri.Within(position=0.0), "position"), (lambda: ri.Within(angle=np.nan), "angle"),
        (lambda: ri.Within(position=1.0, until=-1.0), "until"), (lambda: ri.InTime(per_frame=-1.0), "per_frame"),
    ],
)  # fmt: skip
def test_accuracy_targets_without_sense_are_refused(target, said: str) -> None:
    with pytest.raises(ri.SceneError, match=said):
        target()


def test_what_is_no_accuracy_is_refused() -> None:
    scene = ri.Scene(bodies=[ri.Body("ball", ri.Shape.sphere(1.0))])
    with pytest.raises(ri.SceneError, match="Within"):
        ri.simulate(scene, 1.0, accuracy=0.1)  # type: ignore[arg-type]


def test_two_neighbours_on_one_branch_do_not_meet_a_target() -> None:
    """Steps of 1/60 and 1/120 agree to 5e-6 m here, and are 0.2 m off what steps of 1/240 to 1/1920 give: a capsule rolls elsewhere."""
    trimesh = pytest.importorskip("trimesh")
    rng, scene = np.random.default_rng(4), ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    mesh = trimesh.creation.capsule(height=0.3, radius=0.1, count=(8, 8))
    for k in range(3):
        place, turn = (0.05 * k, 0, 1.0 + 0.6 * k), rng.normal(size=4)
        scene.add(ri.Body(f"c{k}", ri.Shape.from_trimesh(mesh), position=place, orientation=turn, material=ri.Material(restitution=0.3)))
    run, fine = ri.simulate(scene, 1.0, accuracy=ri.Within(position=1e-4)), ri.simulate(scene, 1.0, accuracy=ri.Accuracy(step=1 / 960))
    assert run.choice.met
    assert max(np.linalg.norm(run.position(name) - fine.position(name), axis=1).max() for name in run.names) < 1e-4
