"""Studies at a glance: words, what is claimed against runs that the study does not know, and what is left out."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from claims import wrong_claims
from hypothesis import given
from hypothesis import strategies as st

import rigidimpulse as ri
from rigidimpulse.studies.glance import words
from rigidimpulse.studies.glance.candidates import MOST_RATE, same_cost_rate
from rigidimpulse.studies.glance.figures import DEPTH, PLACE
from rigidimpulse.studies.glance.known import Glance
from rigidimpulse.studies.glance.page import contents

WOOD = ri.Material(density=600.0, restitution=0.0)
UNITS = {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9}


def metres(text: str) -> float:
    """The length that a text says."""
    value, unit = text.split(" ")
    return float(value) * UNITS[unit]


@given(st.floats(1e-10, 1e4))
def test_lengths_are_bounds_to_two_digits(value: float) -> None:
    """What is "within" is rounded up, what is "off" down, each by less than one in ten."""
    within, off = metres(words.length(value)), metres(words.length(value, up=False))
    assert value * (1.0 - 1e-9) <= within <= 1.1 * value + 1e-15
    assert value / 1.1 - 1e-15 <= off <= value * (1.0 + 1e-9)


def test_words_of_lengths_and_times() -> None:
    assert [words.length(value) for value in (4.01e-6, 0.0123, 1.2, 0.0, 99.96e-3)] == ["4.1 µm", "13 mm", "1.2 m", "0.1 nm", "100 mm"]
    assert words.length(math.inf) == "infinitely far"
    assert [words.seconds(value) for value in (0.0001, 0.5, 12.3)] == ["less than 1 ms", "0.5 s", "12 s"]
    assert words.cost(1.0, 1.2) == "the same time" and words.cost(1.0, 2.0) == "1 s"


@given(st.floats(1e-4, 1e2), st.floats(1e-4, 1e2), st.sampled_from([24, 60, 240]))
def test_a_fixed_step_of_the_same_cost_takes_no_longer(seconds: float, coarse: float, rate: int) -> None:
    """Time goes with the number of steps; the rate is a round multiple of the coarse one, within a factor of two of the same time."""
    found = same_cost_rate(seconds, coarse, rate)
    assert found % rate == 0 and found <= max(MOST_RATE, rate)
    if rate < found:
        assert coarse * found / rate <= seconds * (1.0 + 1e-9)
    if seconds >= coarse and 2 * found < MOST_RATE:
        assert coarse * found / rate > 0.49 * seconds


def tumbling() -> ri.Scene:
    scene = ri.Scene()
    bouncing = ri.Material(restitution=0.5, static_friction=0.3, dynamic_friction=0.3)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=bouncing))
    moving = {"position": (0, 0, 0.8), "velocity": (1, 0, 0), "angular_velocity": (3, 1, 2)}
    scene.add(ri.Body("box", ri.Shape.box((0.4, 0.3, 0.2)), material=bouncing, **moving))
    return scene


@pytest.fixture(scope="module")
def known() -> Glance:
    return ri.glance(tumbling(), 1.0, budget=30.0, peers=())


def test_the_sentence_is_true(known: Glance) -> None:
    assert known.measure == PLACE and known.finished and known.until > 0.3
    assert wrong_claims(known) == []
    verdict = known.verdict
    assert verdict is not None and verdict.recommended in ("preview", "standard")
    text = verdict.text()
    standard = next(claim for claim in verdict.claims if claim.name == "standard")
    assert f"Standard stays within {words.length(standard.within)} of the truth for {words.motion_time(standard.time)}" in text
    assert re.search(r"A fixed step of 1/\d+ s .*: [\d.]+ m?m off after [\d.]+ s\.", text)
    assert f'accuracy="{verdict.recommended}"' in text


def test_a_false_claim_is_found(known: Glance) -> None:
    """Runs that are not what their names say: the fixed step in the place of standard, and standard in the place of the fixed step."""
    verdict = known.verdict
    assert verdict is not None
    off = next(claim.name for claim in verdict.claims if claim.off == claim.off)
    by_name = {played.candidate.name: played.recording for played in known.runs}
    fixed, standard = by_name[off], by_name["standard"]
    assert fixed is not None and standard is not None
    wrong = wrong_claims(known, {"standard": fixed, off: standard})
    assert any(line.startswith("standard is") for line in wrong) and any(line.startswith(f"{off} is") for line in wrong)


def test_few_settings_are_run_and_each_has_its_seconds(known: Glance) -> None:
    names = [played.candidate.name for played in known.runs]
    assert names[:3] == ["preview", "standard", "exact"] and "fixed step 1/60" in names and "penalty" in names
    assert len(names) <= 10 and known.waiting == []
    assert all(played.seconds > 0.0 for played in known.runs)


def test_what_is_known_is_told_before_the_end() -> None:
    told: list[tuple[int, bool, bool]] = []
    ri.glance(
        tumbling(), 0.2, budget=10.0, peers=(), changed=lambda now: told.append((len(now.runs), now.verdict is not None, now.finished))
    )
    assert told[0] == (0, False, False) and told[-1][1:] == (True, True)
    assert [number for number, _, _ in told] == sorted(number for number, _, _ in told)
    sentence = next(number for number, said, _ in told if said)
    assert sentence == 3  # after the presets, before the rest


def test_a_pile_is_measured_by_depth() -> None:
    """Boxes that fall on each other at once: even a beginning of the motion is that of a pile."""
    random = np.random.default_rng(1)
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    for k in range(64):
        place = (0.52 * (k % 4), 0.52 * (k // 4 % 4), 0.251 + 0.503 * (k // 16))
        scene.add(ri.Body(f"box {k}", ri.Shape.box(0.5), position=place, velocity=random.normal(0.0, 0.5, 3), material=WOOD))
    told = []
    known = ri.glance(scene, 0.3, budget=6.0, peers=(), changed=lambda now: told.append((len(now.runs), now.verdict is not None)))
    verdict = known.verdict
    assert next(number for number, said in told if said) == 2  # the sentence does not wait for the exact run
    assert [run.candidate.name for run in known.runs[:3]] == ["preview", "standard", "exact"]
    assert known.measure == DEPTH and verdict is not None
    assert "inside another" in verdict.headline and "chaotic" in verdict.trust
    assert wrong_claims(known) == []


def test_the_index_holds_what_the_page_shows(known: Glance) -> None:
    index, block = contents(known)
    standard = next(run for run in index["runs"] if run["name"] == "standard")
    position = np.frombuffer(block, np.float32, standard["motion"]["position"][1], standard["motion"]["position"][0]).reshape(-1, 1, 3)
    recording = next(played.recording for played in known.runs if played.candidate.name == "standard")
    assert recording is not None and np.allclose(position[:, 0], recording.position("box"), atol=1e-6)
    told = [value for value in standard["curve"] if value is not None]
    assert max(told) <= standard["bound"] and len(told) == np.count_nonzero(known.times <= known.until)


def test_refused_scenes() -> None:
    floor = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    with pytest.raises(ri.SceneError, match="nothing in the scene moves freely"):
        ri.glance(floor, 1.0)
