"""Studies: references, error measures, the front, what is kept on disk. Charts are looked at in tests/browser."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.core.quaternion import quaternion_from_rotation_vector, rotate
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.fingerprint import fingerprint
from rigidimpulse.studies.measures import penetration
from rigidimpulse.studies.peers import PEERS
from rigidimpulse.studies.reference import CLOSED_FORM, NONE, SELF_CONVERGED, Reference
from rigidimpulse.studies.row import Errors, Row
from rigidimpulse.studies.settings import grid, rung
from rigidimpulse.studies.work_precision import Study

PRESETS = [setting for setting in grid() if setting.family == "presets"]


def dropped(height: float = 1.0) -> ri.Scene:
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("box", ri.Shape.box(0.5), position=(0, 0, height), orientation=(0.9, 0.3, 0.1, 0.2), angular_velocity=(1, 2, 0)))
    return scene


def closed_forms() -> list[str]:
    """Scenes with an exact motion; `toss_alone` has a recorded one."""
    return [name for name in (*gallery.names(), *gallery.hard_names()) if gallery.load(name).exact is not None and name != "toss_alone"]


@pytest.mark.parametrize("name", closed_forms())
def test_exact_motions_of_the_gallery_are_those_of_their_scenes(name: str) -> None:
    """The closed form starts where the scene does, and goes where the run goes: to the gaps of contact, 1e-6 m for each body of a stack."""
    entry = gallery.load(name)
    scene = entry.scene()
    run = ri.simulate(scene, 1.0)
    assert entry.exact is not None
    law = entry.exact(run.times)
    assert law.position
    for body, place in law.position.items():
        assert np.abs(place[0] - np.asarray(scene[body].position)).max() < 1e-12
        assert np.abs(place - run.position(body)).max() < 1.2e-6 * len(scene.bodies)
    for body, turn in law.orientation.items():
        assert np.abs(np.abs((turn * run.orientation(body)).sum(axis=1)) - 1.0).max() < 1e-10
    if law.impacts is not None:
        assert np.abs(np.sort(run.impacts["time"]) - law.impacts).max(initial=0.0) < 1e-9
    if law.energy is not None:
        assert run.ledger is not None
        total = run.ledger.total
        assert np.abs(total - total[0] - law.energy).max() < 1e-6 * (run.ledger.kinetic.max() + np.ptp(run.ledger.potential) + 1.0)


def test_closed_form_tells_the_error_of_a_late_impact() -> None:
    settings = [setting for setting in grid() if setting.name in ("standard", "after, step 1/120", "linear, step 1/30")]
    result = ri.study("bounce", settings=settings, budget=600.0)
    assert result.reference.kind == CLOSED_FORM and result.reference.until == 10.0
    rows = {row.name: row for row in result.rows}
    assert rows["standard"].whole.position < 1e-12 and rows["standard"].whole.impact_time < 1e-13
    # An impact seen after the fact is late by up to a step, at 13.7 m/s, and back up as much: 2 v h.
    late = rows["after, step 1/120"].whole
    assert 1e-4 < late.impact_time < 4 * 2.0 / 120 and late.impacts == 0
    assert late.position == pytest.approx(2.0 * 13.65 * late.impact_time, rel=0.5)
    assert rows["linear, step 1/30"].beginning.position <= rows["linear, step 1/30"].whole.position


def test_self_converged_reference_says_until_when() -> None:
    result = ri.study(dropped(), 2.0, settings=PRESETS, budget=60.0)
    reference = result.reference
    assert reference.kind == SELF_CONVERGED and 0.0 < reference.until <= 2.0
    assert reference.uncertainty < 1e-3
    assert "until" in reference.describe()
    assert all(math.isfinite(row.whole.position) for row in result.rows)
    # The default run is about as close as its estimate says: contact is of second order in the step.
    assert result.rows[1].whole.position < 0.1


def test_no_reference_where_nothing_moves() -> None:
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    result = ri.study(scene, 1.0, settings=PRESETS[:1])
    assert result.reference.kind == NONE and "nothing moves" in result.reference.describe()
    assert math.isnan(result.rows[0].whole.position)


def test_a_recorded_toss_is_a_reference_with_its_noise() -> None:
    result = ri.study("toss_alone", settings=PRESETS[1:2])
    assert result.reference.kind == "measured" and result.reference.uncertainty == 6e-5
    # 12 % of the width of 0.1 m in the mean over all tosses; this one is below it, and nothing simulated is within the noise.
    assert 6e-5 < result.rows[0].whole.position < 0.03
    with pytest.raises(ri.SceneError, match="148 frames"):
        ri.study("toss_alone", fps=60.0, settings=PRESETS[:1])


def test_refused_settings_say_why() -> None:
    setting = next(setting for setting in grid() if setting.family == "Runge-Kutta, step")
    result = ri.study("bounce", settings=[setting])
    assert not result.rows[0].ran and "refused" in result.rows[0].status


@pytest.mark.parametrize("depth", [0.2, 1e-3, 1e-6])
def test_penetration_of_boxes_is_the_way_out(depth: float) -> None:
    turn = quaternion_from_rotation_vector(np.array([0.3, -1.1, 0.6]))
    across = rotate(turn, np.array([1.0, 0.0, 0.0]))
    scene = ri.Scene(gravity=(0, 0, 0))
    for name, place in (("a", np.zeros(3)), ("b", (1.0 - depth) * across)):
        scene.add(ri.Body(name, ri.Shape.box(1.0), position=place, orientation=turn, motion="dynamic" if name == "b" else "static"))
    world = compile_scene(scene)
    apart = ri.simulate(ri.Scene(gravity=(0, 0, 0), bodies=[scene["b"]]), 0.0)
    run = ri.Recording(
        apart.times, ["a", "b"], np.array([[np.zeros(3), (1.0 - depth) * across]]), np.array([[turn, turn]]), *np.zeros((2, 1, 2, 3)),
        np.array([[np.zeros(3), (1.0 - depth) * across]]), np.zeros(0),
    )  # fmt: skip
    assert penetration(world, run)[0] == pytest.approx(depth, rel=2e-3)


def test_penetration_of_balls_and_planes() -> None:
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.5), position=(0, 0, 0.6), velocity=(0, 0, -1)))
    run = ri.simulate(scene, 0.2, 10.0, effects={"contact detection": False})
    assert np.allclose(penetration(compile_scene(scene), run), [0.0, 0.0, 0.1], atol=1e-12)


@given(st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(1e-15, 1.0)), min_size=1, max_size=30))
def test_nothing_beats_the_front(points: list[tuple[float, float]]) -> None:
    rows = [
        Row(str(k), "family", 1.0, cost, cost, Errors(error, *[math.nan] * 5)) for k, (cost, error) in enumerate(points)
    ]  # fmt: skip
    result = Study("", 1.0, Reference(NONE, "", None, {}, math.nan), rows)
    front = result.front()
    for row in rows:
        own = (row.cost, row.whole.position)
        others = [(other.cost, other.whole.position) for other in rows]
        beaten = any(cost <= own[0] and error <= own[1] and (cost, error) != own for cost, error in others)
        assert (row in front) <= (not beaten)
        assert beaten or own in [(other.cost, other.whole.position) for other in front]


def test_a_study_goes_on_where_it_was(tmp_path) -> None:
    first = ri.study(dropped(), 1.0, settings=PRESETS[:2], output=tmp_path)
    again = ri.study(dropped(), 1.0, settings=PRESETS, output=tmp_path, budget=600.0)
    # The reference is the old one, though there was more time for it now.
    assert again.reference.describe() == first.reference.describe() and again.reference.horizon == first.reference.horizon
    assert np.array_equal(again.reference.truth.position, first.reference.truth.position, equal_nan=True)
    # The very same times: the rows were read, not run.
    assert [row.cost for row in again.rows[:2]] == [row.cost for row in first.rows]
    assert len(again.rows) == 3
    assert (tmp_path / "study.png").stat().st_size > 10_000 and (tmp_path / "settings.html").stat().st_size > 1_000_000
    with (tmp_path / "study.csv").open() as file:
        assert file.readline().startswith("# study ")
        assert [cells["name"] for cells in csv.DictReader(file)] == [row.name for row in again.rows]


def test_a_line_cut_off_is_run_again_and_another_scene_is_put_aside(tmp_path) -> None:
    ri.study(dropped(), 0.2, settings=PRESETS[:2], output=tmp_path)
    path = tmp_path / "study.csv"
    path.write_text(path.read_text()[:-40])
    again = ri.study(dropped(), 0.2, settings=PRESETS[:2], output=tmp_path)
    assert len(again.rows) == 2 and all(row.ran for row in again.rows)
    ri.study(dropped(height=2.0), 0.2, settings=PRESETS[:1], output=tmp_path)
    assert (tmp_path / "study.old.csv").is_file()


def test_a_budget_leaves_out_and_says_what() -> None:
    result = ri.study("bounce", settings=PRESETS, budget=1e-6)
    assert result.rows == [] and result.left == [setting.name for setting in PRESETS]


def test_fingerprints_know_scenes_apart() -> None:
    assert fingerprint(dropped()) == fingerprint(dropped())
    assert fingerprint(dropped()) != fingerprint(dropped(height=1.0 + 1e-15))
    assert fingerprint(dropped(), 1.0) != fingerprint(dropped(), 2.0)
    sprung = dropped()
    sprung.add(ri.Spring(None, "box", (0, 0, 3), (0, 0, 1), 10.0))
    assert fingerprint(sprung) != fingerprint(dropped())


def test_the_ladder_halves_its_steps() -> None:
    steps = [rung(level).accuracy.step for level in range(5)]
    assert steps == [1.0 / 30.0 / 2**k for k in range(5)]
    names = [setting.name for setting in grid(full=True)]
    assert len(set(names)) == len(names) and {setting.name for setting in grid()} <= set(names)


@pytest.mark.parametrize("name", ["bounce", "tumbling_box", "disks_in_a_box"])
def test_front_is_a_thousand_times_more_accurate_than_other_engines_at_equal_time(name: str) -> None:
    result = ri.study(name, settings=PRESETS, peers=PEERS, budget=60.0, duration=min(gallery.load(name).duration, 10.0))
    found = result.advantage()
    assert {row.family for row, _, _ in found} == set(PEERS)
    assert min(ratio for _, _, ratio in found) > 1000.0
