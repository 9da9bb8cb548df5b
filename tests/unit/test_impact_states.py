"""States at impacts, worked out again from the frames: they agree with the laws of the impact, and say so where they are not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.recording.impact_states import ImpactStates, impact_states
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.mass import masses_of
from rigidimpulse.view.impact_cards import MOST_CARDS, card_entries, card_rows, card_table
from rigidimpulse.view.joints import joint_entries
from rigidimpulse.view.spins import angular_momentum

CLOSE = 1e-4
"""Relative: points of contact are recorded half-way between two surfaces."""


def all_states(run: Recording) -> ImpactStates:
    """Of all impacts of a run."""
    return impact_states(run, np.arange(len(run.impacts)))


def bouncing(*effects: object) -> Recording:
    """A brick that tumbles onto the ground, and a ball that hits it on the way."""
    material = ri.Material(density=500, restitution=0.6, static_friction=0.4, dynamic_friction=0.3)
    scene = ri.Scene()
    scene.add(ri.Body("ground", ri.Shape.half_space(), motion="static", material=material))
    brick = ri.Shape.box((0.4, 0.25, 0.1))
    scene.add(ri.Body("brick", brick, position=(0, 0, 0.6), velocity=(0.5, 0, 0), angular_velocity=(2, 3, -1), material=material))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0.1, 0.02, 1.2), velocity=(0.4, 0, -3), material=material))
    for effect in effects:
        scene.add(effect)
    return ri.simulate(scene, 0.7, fps=30)


@pytest.fixture(scope="module")
def run() -> Recording:
    """The run of `bouncing`."""
    return bouncing()


def test_states_before_and_after_obey_the_laws_of_an_impact(run: Recording) -> None:
    """The impulse is the change of momentum of each body, and its speeds at the point are those that the run recorded."""
    states, impacts, checked = all_states(run), run.impacts, 0
    assert run.scene is not None
    masses = masses_of(run.scene.bodies)
    assert len(impacts) >= 3 and states.known[:3].all()
    for k in np.flatnonzero(states.known):
        impact = impacts[k]
        frame = int(np.searchsorted(run.times, impact["time"], side="left")) - 1
        if np.sum((impacts["time"] > run.times[frame]) & (impacts["time"] <= impact["time"])) > 1:
            continue  # only this impact since the frame: each body is on the parabola that begins there
        impulse = impact["impulse"] * impact["normal"] + impact["tangent_impulse"]
        flight, at_point = impact["time"] - run.times[frame], np.zeros((2, 2, 3))
        for side, (name, sign) in enumerate((("body_a", -1.0), ("body_b", 1.0))):
            i = impact[name]
            if np.isfinite(masses[i].mass):
                change = states.velocity[k, side, 1] - states.velocity[k, side, 0]
                assert np.allclose(masses[i].mass * change, sign * impulse, rtol=CLOSE, atol=CLOSE * impact["impulse"])
                centre = run.centers[frame, i] + flight * run.velocities[frame, i] + 0.5 * flight**2 * np.array([0, 0, -9.81])
                at_point[side] = states.velocity[k, side] + np.cross(states.angular_velocity[k, side], impact["point"] - centre)
        before, after = (at_point[1] - at_point[0]) @ impact["normal"]
        scale = CLOSE * (1.0 + abs(impact["approach_speed"]))
        assert (before, after) == pytest.approx((-impact["approach_speed"], impact["separation_speed"]), abs=scale)
        checked += 1
    assert checked >= 3


def test_parts_of_the_formula_add_up_to_the_recorded_impulse(run: Recording) -> None:
    states, impacts = all_states(run), run.impacts
    known = np.isfinite(states.slip)
    assert known[:3].all()
    total = states.inverse_mass.sum(1) + states.spin.sum(1) + states.slip + states.others
    speed = impacts["approach_speed"] + impacts["separation_speed"]
    assert np.allclose(speed[known] / total[known], impacts["impulse"][known], rtol=1e-3)
    assert run.scene is not None
    ball = run.names.index("ball")
    hits = known & (impacts["body_b"] == ball)
    assert hits.any() and np.allclose(states.inverse_mass[hits, 1], 1.0 / masses_of(run.scene.bodies)[ball].mass)
    # The energy that an impact takes is that of the bodies before less that after.
    first = states.energy[states.known & known]
    assert np.all(first < 0.0)


def test_the_energy_of_all_impacts_is_the_one_of_the_ledger() -> None:
    scene = ri.Scene(gravity=(0, 0, 0))
    material = ri.Material(density=1000, restitution=0.5, static_friction=0.3, dynamic_friction=0.3)
    box, ball = ri.Shape.box((0.2, 0.2, 0.2)), ri.Shape.sphere(0.1)
    scene.add(ri.Body("a", box, velocity=(1, 0, 0), angular_velocity=(0, 1, 2), material=material))
    scene.add(ri.Body("b", ball, position=(0.5, 0.03, 0.02), velocity=(-1, 0, 0), material=material))
    run = ri.simulate(scene, 0.4, fps=20)
    states = all_states(run)
    assert len(run.impacts) > 0 and states.known.all() and run.ledger is not None
    assert -states.energy.sum() == pytest.approx(run.ledger.dissipated["impact"][-1], rel=1e-4)


def test_a_body_that_a_joint_holds_has_the_velocities_of_its_frames() -> None:
    """Both sides: a joint acts at the instant of the impact too, so nothing may be worked out from the impulse alone."""
    run = bouncing(ri.BallJoint(None, "ball", (0.1, 0.02, 2.0)))
    states, ball = all_states(run), run.names.index("ball")
    held = (run.impacts["body_a"] == ball) | (run.impacts["body_b"] == ball)
    assert not states.known[held].any() and np.isnan(states.energy[held]).all()
    for k in np.flatnonzero(held)[:3]:
        frame = int(np.searchsorted(run.times, run.impacts["time"][k], side="left")) - 1
        side = 0 if run.impacts["body_a"][k] == ball else 1
        assert np.array_equal(states.velocity[k, side], run.velocities[[frame, frame + 1], ball])
    assert states.known[~held].any()


def test_a_planted_fault_is_not_taken_for_known(run: Recording) -> None:
    """A recording whose impulse is wrong by one part in a thousand does not agree with its own speeds."""
    wrong = run.impacts.copy()
    wrong["impulse"][0] *= 1.001
    states = all_states(replace(run, impacts=wrong))
    assert all_states(run).known[0] and not states.known[0]


def test_cards_are_those_of_the_strongest_impacts_in_order_of_time(run: Recording) -> None:
    rows = card_rows(run.impacts)
    assert np.all(np.diff(run.impacts["time"][rows]) >= 0.0)
    assert len(card_table(run, rows)) == len(rows) <= len(run.impacts)
    many = np.repeat(run.impacts[:1], MOST_CARDS + 5)
    many["impulse"] = 1.0 + np.arange(len(many))
    assert card_rows(many)[0] == 5 and len(card_rows(many)) == MOST_CARDS
    entries = card_entries(run, rows)
    assert entries["pairs"]["0,1"] == pytest.approx([0.6, 0.4, 0.3]) and entries["masses"][0] is None
    assert entries["numImpacts"] == len(run.impacts)


def test_joints_are_given_in_the_frames_of_their_bodies() -> None:
    run = bouncing(ri.HingeJoint("brick", None, (0.2, 0.0, 0.6), (0, 2, 0), lower=-0.5, upper=0.5, name="door", release_time=0.3))
    (entry,) = joint_entries(run)
    assert (entry["kind"], entry["name"], entry["a"], entry["b"], entry["until"]) == ("hinge", "door", "brick", None, 0.3)
    assert entry["anchorA"] == pytest.approx([0.2, 0.0, 0.0]) and entry["anchorB"] == pytest.approx([0.2, 0.0, 0.6])
    assert (entry["lower"], entry["upper"]) == (-0.5, 0.5)


def test_angular_momentum_about_the_common_centre_is_constant_in_free_flight() -> None:
    scene = ri.Scene()
    scene.add(ri.Body("top", ri.Shape.box((0.3, 0.2, 0.1)), position=(3, -2, 5), velocity=(1, 2, 3), angular_velocity=(1, 5, 2)))
    curves = angular_momentum(ri.simulate(scene, 0.5, fps=20))
    assert curves is not None and np.allclose(curves, curves[:, :1], rtol=1e-6, atol=1e-6 * np.abs(curves).max())
    still = ri.Scene()
    still.add(ri.Body("stone", ri.Shape.box((0.3, 0.2, 0.1))))
    assert angular_momentum(ri.simulate(still, 0.2, fps=20)) is None
