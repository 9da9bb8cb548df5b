"""Files in, and what the bodies of them do: parts of a file whose sense shows in the motion alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gltf_files import BALL, BOX, physics, shaped, with_physics

import rigidimpulse as ri

G = 9.81


def run(nodes: list[dict], tmp_path: Path, duration: float, **lists) -> ri.Recording:
    """Simulate a file with a box and a ball as its shapes."""
    path = with_physics(nodes, [BOX, BALL, {"type": "plane", "plane": {}}], **lists).save(tmp_path / "scene.glb")
    made = ri.simulate(ri.load_scene(path), duration)
    assert made.status.ok, made.status.message
    return made


def test_infinite_inertia_does_not_turn(tmp_path: Path) -> None:
    """A box that lands on a ball off its centre tips within a second; with infinite inertia it stays upright on it."""
    ball = {"name": "ball", "translation": [0.3, 0, 0], "extensions": physics(None, shaped(1))}
    for moments, turns in ((None, True), ([0, 0, 0], False)):
        motion = {"mass": 1} | ({} if moments is None else {"inertiaDiagonal": moments})
        made = run([ball, {"name": "box", "translation": [0, 1.2, 0], "extensions": physics(motion, shaped(0))}], tmp_path, 1.0)
        if turns:
            assert abs(made.orientation("box")[-1, 0]) < 0.95
        else:
            # The joint closes to 1e-12; the box rests on the top of the ball, half a side above it.
            assert np.allclose(made.orientation("box"), [1, 0, 0, 0], rtol=0, atol=1e-9)
            assert np.allclose(made.position("box")[-1], [0, 1, 0], rtol=0, atol=1e-4)


def test_infinite_mass_turns_in_place(tmp_path: Path) -> None:
    """A wheel with finite inertia about its axle keeps its place under gravity, and its spin."""
    motion = {"mass": 0, "inertiaDiagonal": [0, 0, 2], "angularVelocity": [0, 0, 3]}
    made = run([{"name": "wheel", "translation": [0, 5, 0], "extensions": physics(motion, shaped(0))}], tmp_path, 1.0)
    assert np.allclose(made.position("wheel"), [0, 5, 0], rtol=0, atol=1e-9)
    assert np.allclose(made.angular_velocity("wheel"), [0, 0, 3], rtol=0, atol=1e-9)


def test_a_plane_holds_and_gravity_has_its_factor(tmp_path: Path) -> None:
    """On the plane a box lies half its side high; with factor -0.5 it rises by g t^2 / 4."""
    nodes = [
        {"name": "floor", "extensions": physics(None, shaped(2))},
        {"name": "box", "translation": [0, 0.6, 0], "extensions": physics({"mass": 1}, shaped(0))},
        {"name": "balloon", "translation": [5, 1, 0], "extensions": physics({"mass": 1, "gravityFactor": -0.5}, shaped(1))},
    ]
    made = run(nodes, tmp_path, 1.0)
    assert made.position("box")[-1, 1] == pytest.approx(0.5, abs=1e-5)
    assert made.position("balloon")[-1, 1] == pytest.approx(1 + G / 4, abs=1e-12)


def test_an_animated_node_pushes(tmp_path: Path) -> None:
    """A wall that moves at 2 m/s for 1 s hits a ball at rest with e = 1: the ball leaves at 4 m/s, twice the speed of the keys."""
    material = [{"restitution": 1, "staticFriction": 0, "dynamicFriction": 0}]
    nodes = [
        {"name": "wall", "extensions": physics(None, shaped(0, physicsMaterial=0))},
        {"name": "ball", "translation": [1.5, 0, 0], "extensions": physics({"mass": 1, "gravityFactor": 0}, shaped(1, physicsMaterial=0))},
    ]
    file = with_physics(nodes, [BOX, BALL], physicsMaterials=material)
    file.animate(0, "translation", [0, 1], [[0, 0, 0], [2, 0, 0]])
    made = ri.simulate(ri.load_scene(file.save(tmp_path / "scene.glb")), 1.0)
    # They meet after 0.25 s, when 0.5 m are gone.
    assert np.allclose(made.velocity("ball")[-1], [4, 0, 0], rtol=0, atol=1e-6)
    assert made.position("ball")[-1, 0] == pytest.approx(1.5 + 4 * 0.75, abs=1e-5)


def test_parts_with_filters_stay_together(tmp_path: Path) -> None:
    """Of two stacked parts the lower one does not meet the floor: the upper one lies on it, and its twin is 1 m below."""
    filters = [{"collisionSystems": ["a"], "collideWithSystems": ["a"]}, {"collisionSystems": ["b"], "collideWithSystems": ["b"]}]
    nodes = [
        {"name": "floor", "extensions": physics(None, shaped(2, collisionFilter=0))},
        {"name": "it", "translation": [0, 0.8, 0], "extensions": physics({"mass": 1}), "children": [2, 3]},
        {"name": "upper", "extensions": physics(None, shaped(0, collisionFilter=0))},
        {"name": "lower", "translation": [0, -1, 0], "extensions": physics(None, shaped(0, collisionFilter=1))},
    ]
    made = run(nodes, tmp_path, 1.0, collisionFilters=filters)
    assert np.allclose(made.position("it")[-1], [0, 0.5, 0], rtol=0, atol=1e-4)
    assert np.allclose(made.position("it part 2") - made.position("it"), 0.0, rtol=0, atol=1e-6)
