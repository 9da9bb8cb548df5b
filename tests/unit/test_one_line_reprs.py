"""What prints of results is one line that says what a person wants to know."""

from __future__ import annotations

import math
from pathlib import Path

import rigidimpulse as ri
from rigidimpulse.recording.profile import Profile
from rigidimpulse.recording.status import Status
from rigidimpulse.studies.reference import Reference
from rigidimpulse.studies.wedges.wedge import Wedge
from rigidimpulse.studies.work_precision import Study

LONGEST = 600


def ball_on_floor() -> ri.Scene:
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0, 0, 0.5), material=ri.Material(restitution=0.5)))
    return scene


def one_line(thing: object) -> str:
    text = repr(thing)
    assert "\n" not in text and len(text) <= LONGEST and " object at 0x" not in text, text[:LONGEST]
    return text


def test_a_run_and_its_parts() -> None:
    scene = ball_on_floor()
    run = ri.simulate(scene, 0.5)
    assert one_line(scene) == "Scene(2 bodies, 0 effects)"
    one_line(scene["ball"])
    assert one_line(run).startswith(f"Recording(0.5 s, 31 frames, 2 bodies, {len(run.impacts)} impacts, Status(ok")
    assert "contact detection" in one_line(run.plan)
    for part in (run.profile, run.status, run.ledger, run.by_cause, run.settings, *run.status.events):
        assert one_line(part).startswith(type(part).__name__)


def test_a_status_of_several_problems_is_one_line() -> None:
    assert one_line(Status(False, "first\nsecond\nthird")) == "Status(not ok: first, and 2 more)"


def test_a_profile_names_the_longest_stage() -> None:
    assert one_line(Profile(2.0, {"forces": 0.5, "impacts": 1.0})) == "Profile(2 s, most in 'impacts': 50 %, 0 kernels)"
    assert one_line(Profile()) == "Profile(0 s, 0 kernels)"


def test_studies_and_wedges() -> None:
    study = Study("dice", 2.0, Reference("none", "", None, {}, math.inf), left=["a"])
    assert one_line(study) == "Study('dice', 2 s, 0 rows, 1 left, reference: none)"
    assert one_line(Wedge(Path("takes"), [], [])) == "Wedge(0 takes, 0 failed, in 'takes')"
