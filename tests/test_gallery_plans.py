"""What each gallery scene calls for, as its author says, and what the planner takes in for it.

A new scene needs a line here. Effects that go without saying are left out: steady load, impulses, impact time and exact flight where bodies
may meet, varying load and forced flight where forces vary; and the event kernel, which changes no result.
"""

from __future__ import annotations

import pytest

from rigidimpulse import gallery
from rigidimpulse.dynamics.forces import KINDS
from rigidimpulse.engine.begin import make_plan
from rigidimpulse.engine.compile_scene import compile_scene

CALLS_FOR = {
    "spot": "contact detection, gravity, gyroscopic term, friction, contact forces, sub-stepped islands",
    "disks_in_a_box": "contact detection",
    "pool_break": "contact detection",
    "dice": "contact detection, gravity, friction, contact forces, sub-stepped islands",
    "bounce": "contact detection, gravity, contact forces, sub-stepped islands",
    "tumbling_box": "gravity",
    "cradle_one": "contact detection",
    "cradle_two": "contact detection",
    "cradle_strings": "contact detection, gravity, joints, contact forces, sub-stepped islands",
    "superball": "contact detection, gravity, friction, contact forces, sub-stepped islands",
    "wing_nut": "",
    "galperin_0": "contact detection",
    "galperin_1": "contact detection",
    "galperin_2": "contact detection",
    "galperin_3": "contact detection",
    "two_spheres": "contact detection",
    "off_centre_disk": "contact detection, gyroscopic term, contact forces, sub-stepped islands",
    "rifle": "contact detection, gyroscopic term, contact forces, sub-stepped islands",
    "toss": "contact detection, gravity, friction, contact forces, sub-stepped islands",
    "toss_alone": "contact detection, gravity, friction, contact forces, sub-stepped islands",
    "rolling": "contact detection, gravity, friction, rolling friction, contact forces, sub-stepped islands",
    "arm": "contact detection, gravity, gyroscopic term, joints, friction, contact forces, sub-stepped islands",
    "pile": "contact detection, gravity, friction, contact forces, sub-stepped islands",
    "penalty_bounce": "penalty forces",
    "smoothed_path": "contact detection, gravity, gyroscopic term, friction, contact forces, sub-stepped islands",
    "settled_layout": "contact detection, gravity, gyroscopic term, friction, contact forces, sub-stepped islands",
    "emergency_stop": "contact detection, gravity, gyroscopic term, friction, contact forces, sub-stepped islands",
    "rear_end_crash": "contact detection, gravity, gyroscopic term, friction, contact forces, sub-stepped islands",
    "pendulum": "contact detection, gravity, joints, friction, contact forces, sub-stepped islands",
    "kinematic_bounce": "contact detection, gravity, friction, contact forces, sub-stepped islands",
    "backing_up_bisection": "contact detection, gravity, gyroscopic term, friction, contact forces, sub-stepped islands",
    "backing_up_linear": "contact detection, gravity, gyroscopic term, friction, contact forces, sub-stepped islands",
    "pool_aim": "contact detection, gravity, friction, rolling friction, contact forces, sub-stepped islands",
    "pool_follow": "contact detection, gravity, friction, rolling friction, contact forces, sub-stepped islands",
    "pool_draw": "contact detection, gravity, friction, rolling friction, contact forces, sub-stepped islands",
    "pool_swerve": "contact detection, gravity, friction, rolling friction, contact forces, sub-stepped islands",
    "table_on_four_feet": "contact detection, gravity, gyroscopic term, friction, contact forces, sub-stepped islands",
    "pendulum_drift": "contact detection, gravity, gyroscopic term, joints, friction, contact forces, sub-stepped islands",
    "soft_hinge": "contact detection, gravity, gyroscopic term, joints, friction, contact forces, sub-stepped islands",
    "crowd_momentum": "contact detection, gravity, gyroscopic term, joints, friction, contact forces, sub-stepped islands",
    "marbles": "contact detection, gravity, friction, contact forces, sub-stepped islands",
    "rocket": "contact detection, gravity, thrusters, gyroscopic term, friction, contact forces",
    "launcher": "contact detection, thrusters, gyroscopic term, joints, friction, contact forces",
    "handgun": "contact detection, springs, gyroscopic term, friction, contact forces, sub-stepped islands",
    "driven_oscillator": "contact detection, springs, harmonic forces, friction, contact forces, sub-stepped islands",
    "parachute": "contact detection, gravity, drag, gyroscopic term, joints, friction, contact forces, sub-stepped islands",
    "planets": "contact detection, attractors, friction, contact forces, sub-stepped islands",
    "coupled_springs": "contact detection, springs, friction, contact forces, sub-stepped islands",
    "held_arm": "contact detection, gravity, PD controllers, gyroscopic term, joints, friction, contact forces, sub-stepped islands",
    "pinned_shapes": "contact detection, gravity, drag, energy terms, gyroscopic term, friction, contact forces, sub-stepped islands",
    "cloth_on_ball": "flexible bodies",
    "trampoline": "contact detection, gravity, flexible bodies, gyroscopic term, friction, contact forces, sub-stepped islands",
    "jelly_on_stairs": "flexible bodies",
}
"""Names of effects, in the order of the loop."""
MEETING = {"impulses", "impact time"}
VARYING = {"varying load", "forced flight"}


@pytest.mark.parametrize("name", gallery.names())
def test_plan_takes_in_what_the_author_calls_for(name: str) -> None:
    entry = gallery.load(name)
    plan = make_plan(compile_scene(entry.scene(), entry.accuracy))
    wanted = set(CALLS_FOR[name].split(", ")) - {""}
    if "contact detection" in wanted:
        wanted |= MEETING
    wanted |= VARYING if wanted & (set(KINDS.values()) | {"penalty forces"}) else {"exact flight"}
    if wanted & (MEETING | VARYING | {"joints"}):
        wanted.add("steady load")
    assert {line.name for line in plan.lines if line.included} - {"event kernel"} == wanted
    text = plan.explain()
    assert all(line.name in text and line.reason and line.reason in text for line in plan.lines)
