"""Filters and triggers in runs: what shall not meet does not, and overlap begins and ends when it does.

A ball of radius r that falls from rest by h has the time sqrt(2 h / g). Times of overlap are found to 1e-9 s where the way
is free; one that is only looked at where steps end would be late by up to 1/60 s, and would miss a shot through a thin gate.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import rigidimpulse as ri

G, RADIUS = 9.81, 0.1
SHARP = 1e-8
"""s: bisection to 1e-9 s, and FCL's answer to 1e-12 of the size at some m/s."""


def overlaps(run: ri.Recording, trigger: str, body: str) -> list[float]:
    """Times at which overlap of a pair begins and ends, in turn."""
    events = [event for event in run.status.events if event.bodies == (trigger, body)]
    kinds = [event.kind for event in events]
    assert kinds == ["overlap begins", "overlap ends"] * (len(kinds) // 2)
    assert not any(event.is_problem for event in events)
    return [event.time for event in events]


def falling(**ball) -> ri.Scene:
    """A ball with its lowest point 1 m above a floor of thickness."""
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", collision_filter=ri.CollisionFilter(["hard"])))
    scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), position=(0, 0, 1 + RADIUS), **ball))
    return scene


def test_what_is_filtered_falls_through() -> None:
    """Through the floor it is in free fall all the time; without the filter it lies on it."""
    for other, height in ((["hard"], RADIUS), (["soft"], 1 + RADIUS - 0.5 * G)):
        run = ri.simulate(falling(collision_filter=ri.CollisionFilter(collide_with=other)), 1.0)
        assert run.position("ball")[-1, 2] == pytest.approx(height, abs=1e-5)
    assert not len(run.impacts)


def test_both_sides_must_agree() -> None:
    first = ri.CollisionFilter(["a"], ["b"])
    assert ri.CollisionFilter(["b"]).accepts(first) and first.accepts(ri.CollisionFilter(["b"]))
    assert not ri.CollisionFilter(["b"], None, ["a"]).accepts(first)
    with pytest.raises(ri.SceneError, match="list of names"):
        ri.CollisionFilter("a")


def test_overlap_of_a_falling_ball() -> None:
    scene = falling(collision_filter=ri.CollisionFilter(not_collide_with=["hard"]))
    scene.add(ri.Trigger("gate", ri.Shape.box((1, 1, 0.2)), position=(0, 0, 0.5)))
    scene.add(ri.Trigger("blind", ri.Shape.box(1), collision_filter=ri.CollisionFilter(collide_with=["none"])))
    run = ri.simulate(scene, 1.0)
    begins, ends = overlaps(run, "gate", "ball")
    assert begins == pytest.approx(math.sqrt(2 * 0.4 / G), abs=SHARP)
    assert ends == pytest.approx(math.sqrt(2 * (0.6 + 2 * RADIUS) / G), abs=SHARP)
    assert not overlaps(run, "blind", "ball")
    # It never pushes: free fall to round-off.
    assert run.position("ball")[-1, 2] == pytest.approx(1 + RADIUS - 0.5 * G, abs=1e-12)


def test_a_shot_through_a_thin_gate() -> None:
    """At 200 m/s it passes 1 cm and is 3.3 m farther at the end of the step."""
    scene = ri.Scene(gravity=(0, 0, 0), bodies=[ri.Body("shot", ri.Shape.sphere(0.01), position=(-1, 0, 0), velocity=(200, 0, 0))])
    scene.add(ri.Trigger("gate", ri.Shape.box((0.01, 1, 1))))
    assert np.allclose(overlaps(ri.simulate(scene, 0.1), "gate", "shot"), [0.985 / 200, 1.015 / 200], rtol=0, atol=SHARP)


@pytest.mark.parametrize("restitution", [0.0, 1.0])
@pytest.mark.parametrize("place", [9.0, 9.2, 9.4, 9.6])
def test_a_shot_through_a_gate_that_hits_a_wall_in_the_same_step(restitution: float, place: float) -> None:
    """100 m/s, 1.7 m a step: what was on the trajectory before the impact was not looked at, so that no overlap was reported at all."""
    scene = ri.Scene(gravity=(0, 0, 0), bodies=[ri.Body("wall", ri.Shape.box((1, 5, 5)), motion="static", position=(10.5, 0, 0))])
    material = ri.Material(restitution=restitution)
    scene.add(ri.Body("shot", ri.Shape.sphere(0.1), velocity=(100, 0, 0), material=material))
    scene.add(ri.Trigger("gate", ri.Shape.box((0.05, 1, 1)), position=(place, 0, 0)))
    there = [(place - 0.125) / 100, (place + 0.125) / 100]
    back = [0.198 - there[1], 0.198 - there[0]] if restitution else []
    assert np.allclose(overlaps(ri.simulate(scene, 0.3), "gate", "shot"), there + back, rtol=0, atol=SHARP)


@pytest.mark.parametrize("stiffness", [100.0, 1000.0])
def test_a_gate_on_the_way_of_a_ball_on_a_spring(stiffness: float) -> None:
    """x = cos(w t) in steps that many trajectories make up: to 3e-9 s, the path and the search.

    It was taken to go straight between those that are not the last.
    """
    w = math.sqrt(stiffness)
    scene = ri.Scene(gravity=(0, 0, 0), bodies=[ri.Body("ball", ri.Shape.sphere(0.05), mass=1.0, position=(1, 0, 0))])
    scene.add(ri.PDController("ball", position=(0, 0, 0), stiffness=stiffness))
    scene.add(ri.Trigger("gate", ri.Shape.sphere(0.05), position=(0.3, 0, 0)))
    once = [math.acos(0.4), math.acos(0.2), 2 * math.pi - math.acos(0.2), 2 * math.pi - math.acos(0.4)]
    times = [t for turn in range(3) for angle in once if (t := (angle + 2 * math.pi * turn) / w) < 0.65]
    events = [event.time for event in ri.simulate(scene, 0.65).status.events if event.kind in ("overlap begins", "overlap ends")]
    assert len(events) >= len(times)
    assert np.allclose(events[: len(times)], times, rtol=0, atol=3e-9)


def test_a_gate_below_a_ball_that_falls_through_air() -> None:
    """v_t^2 / g ln cosh(g t / v_t) with quadratic drag, to 3e-9 s."""
    scene = ri.Scene(gravity=(0, 0, -G), bodies=[ri.Body("ball", ri.Shape.sphere(0.05), mass=0.1, position=(0, 0, 20))])
    scene.add(ri.Drag(quadratic=0.05))
    scene.add(ri.Trigger("gate", ri.Shape.box((1, 1, 0.1)), position=(0, 0, 5)))
    terminal = math.sqrt(0.1 * G / 0.05)
    times = [terminal / G * math.acosh(math.exp(way * G / terminal**2)) for way in (14.9, 15.1)]
    assert np.allclose(overlaps(ri.simulate(scene, 5.0), "gate", "ball"), times, rtol=0, atol=3e-9)


def test_a_trigger_on_a_body() -> None:
    """It hangs 1 m ahead of a turning arm: a post at (0, 1, 0) is met a quarter of a turn later. Its own body is not reported."""
    spin, reach = 2.0, 0.1
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("arm", ri.Shape.box(0.2), angular_velocity=(0, 0, spin)))
    scene.add(ri.Body("post", ri.Shape.sphere(reach), motion="static", position=(0, 1, 0)))
    scene.add(ri.Trigger("eye", ri.Shape.sphere(reach), body="arm", position=(1, 0, 0)))
    half = 2 * math.asin(reach)  # the angle at which two spheres on the unit circle touch: chord 2 r
    times = [(math.pi / 2 - half) / spin, (math.pi / 2 + half) / spin]
    run = ri.simulate(scene, 1.5)
    assert np.allclose(overlaps(run, "eye", "post"), times, rtol=0, atol=1e-6) and not overlaps(run, "eye", "arm")


def test_inside_at_the_start_and_at_rest() -> None:
    """Who lies inside begins at time 0, and never ends."""
    scene = falling()
    scene.add(ri.Trigger("room", ri.Shape.box(4)))
    assert overlaps_open(ri.simulate(scene, 1.0), "room", "ball") == [0.0]


def overlaps_open(run: ri.Recording, trigger: str, body: str) -> list[float]:
    """Times of overlaps that begin and do not end."""
    events = [event for event in run.status.events if event.bodies == (trigger, body)]
    assert [event.kind for event in events] == ["overlap begins"]
    return [event.time for event in events]


def test_triggers_that_make_no_sense() -> None:
    nobody, flat = ri.Trigger("t", ri.Shape.box(1), body="nobody"), ri.Trigger("t", ri.Shape.sphere(-1.0))
    for bad, words in ((nobody, "nobody"), (flat, "trigger 't'")):
        scene = falling()
        scene.add(bad)
        with pytest.raises(ri.SceneError, match=words):
            ri.simulate(scene, 0.1)
