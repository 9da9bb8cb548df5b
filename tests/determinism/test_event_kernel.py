"""The event kernel changes nothing but the time a run takes: with it and without it runs agree in every bit.

Every scene is run twice, and frames, impacts, ledger, contact forces and status are compared exactly: a single rounding that differs
breaks the hash. What the kernel cannot do (heavy going over rest, several contacts at once, other shapes) it leaves to the loop in
Python in the middle of a step, so scenes are chosen that go to and fro between both.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.gallery import load

SMOOTH = ri.Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
ROUGH = ri.Material(restitution=0.8, static_friction=0.5, dynamic_friction=0.4)
GRIPPING = ri.Material(restitution=0.9, static_friction=0.9, dynamic_friction=0.7, tangential_restitution=0.6)


def box_of_planes(scene: ri.Scene, half: tuple[float, float, float], material: ri.Material) -> None:
    """Six half spaces around the origin."""
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = -sign
            wall = ri.Shape.half_space(tuple(normal), -half[axis])
            scene.add(ri.Body(f"wall {axis} {sign:+.0f}", wall, motion="static", material=material))


def scatter(scene: ri.Scene, count: int, half: float, radius: float, material: ri.Material, speed: float, height: float = 0.0) -> None:
    """Balls of several sizes on a grid, with random velocities and spins."""
    rng = np.random.default_rng(3)
    side = int(np.ceil(count ** (1.0 / 3.0)))
    pitch = 2.0 * half / side
    shapes = [ri.Shape.sphere(radius * factor) for factor in (1.0, 0.7, 0.4)]
    for k in range(count):
        place = (np.array([k % side, k // side % side, k // side**2]) + 0.5) * pitch - half + [0.0, 0.0, height]
        scene.add(
            ri.Body(
                f"ball {k}", shapes[k % 3], position=tuple(place), velocity=tuple(speed * rng.normal(size=3)), material=material,
                angular_velocity=tuple(5.0 * rng.normal(size=3)), mass=1.0 + k % 4,
            )
        )


def bounce() -> ri.Scene:
    """Spinning balls that bounce on a tilted floor until they roll away."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space((0.1, 0, 1)), motion="static", material=GRIPPING))
    scatter(scene, 8, 1.0, 0.1, GRIPPING, 1.0, height=2.5)
    return scene


def gas() -> ri.Scene:
    """Smooth balls of several sizes in a closed box."""
    scene = ri.Scene(gravity=(0, 0, 0))
    box_of_planes(scene, (2, 2, 2), SMOOTH)
    scatter(scene, 40, 1.9, 0.3, SMOOTH, 2.0)
    return scene


def rough_gas() -> ri.Scene:
    """Rough balls under gravity, which come to rest on the floor one by one."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    box_of_planes(scene, (2, 2, 2), ROUGH)
    scatter(scene, 20, 1.9, 0.3, ROUGH, 2.0)
    return scene


def mixed() -> ri.Scene:
    """Balls with a tumbling box among them, a ball that is held still, one that is driven, and a wall that moves."""
    scene = ri.Scene(gravity=(0, 0, 0))
    box_of_planes(scene, (2, 2, 2), SMOOTH)
    scatter(scene, 20, 1.9, 0.3, GRIPPING, 2.0)
    scene.add(ri.Body("box", ri.Shape.box((0.4, 0.5, 0.6)), position=(0.2, 0.1, 0.0), angular_velocity=(1, 2, 3), material=ROUGH))
    scene.add(ri.Body("post", ri.Shape.sphere(0.2), position=(1.2, 0.5, 0.4), motion="static", material=ROUGH))
    scene.add(ri.Body("driven", ri.Shape.sphere(0.15), position=(-1.2, 0.4, 0.5), velocity=(0.3, 0, 0), motion="kinematic", material=ROUGH))
    return scene


def pegs() -> ri.Scene:
    """Balls that fall through static balls."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
    for row in range(4):
        for k in range(5):
            place = (0.5 * (k - 2 + 0.5 * (row % 2)), 0.0, 1.0 + 0.5 * row)
            scene.add(ri.Body(f"peg {row} {k}", ri.Shape.sphere(0.05), position=place, motion="static", material=ROUGH))
    for k in range(5):
        scene.add(ri.Body(f"ball {k}", ri.Shape.sphere(0.1), position=(0.31 * (k - 2), 0.01 * k, 3.5), material=ROUGH))
    return scene


def ties() -> ri.Scene:
    """Balls that meet the floor at the same instants, and two pairs of which each is the other's mirror image."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=SMOOTH))
    for k in range(4):
        scene.add(ri.Body(f"ball {k}", ri.Shape.sphere(0.1), position=(k, 0, 2), material=SMOOTH))
        speed = 1.0 if k % 2 else -1.0
        scene.add(ri.Body(f"mate {k}", ri.Shape.sphere(0.1), position=(0.5 * k, 3, 5), velocity=(-speed, 0, 0), material=SMOOTH))
    return scene


def cradle() -> ri.Scene:
    """Five balls in a row, one of which flies in: contacts at the same instant."""
    scene = ri.Scene(gravity=(0, 0, 0))
    box_of_planes(scene, (3, 1, 1), SMOOTH)
    for k in range(5):
        scene.add(ri.Body(f"ball {k}", ri.Shape.sphere(0.1), position=(0.2 * k, 0, 0), material=SMOOTH))
    scene.add(ri.Body("first", ri.Shape.sphere(0.1), position=(-1, 0, 0), velocity=(2, 0, 0), material=SMOOTH))
    return scene


def closing_in() -> ri.Scene:
    """A light ball to and fro between a heavy one and a wall: many impacts in a short time (31 for a mass ratio of 100)."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("wall", ri.Shape.half_space((1, 0, 0)), motion="static", material=SMOOTH))
    scene.add(ri.Body("light", ri.Shape.sphere(0.1), position=(1, 0, 0), mass=1.0, material=SMOOTH))
    scene.add(ri.Body("heavy", ri.Shape.sphere(0.1), position=(2, 0, 0), velocity=(-1, 0, 0), mass=100.0, material=SMOOTH))
    return scene


SCENES = {scene.__name__: (scene, 3.0) for scene in (bounce, gas, rough_gas, mixed, pegs, ties, cradle, closing_in)}


def assert_same(scene, duration: float, fps: float = 60.0, accuracy: str | ri.Accuracy = "standard") -> ri.Recording:
    """Run a scene with and without the kernel and compare everything."""
    run = ri.simulate(scene(), duration, fps, accuracy=accuracy)
    other = ri.simulate(scene(), duration, fps, accuracy=accuracy, effects={"event kernel": False})
    assert not next(line for line in other.plan.lines if line.name == "event kernel").included
    assert run.impacts.tobytes() == other.impacts.tobytes()
    assert run.state_hash() == other.state_hash()
    assert run.contacts.tobytes() == other.contacts.tobytes()
    assert run.status == other.status
    for name in ("kinetic", "potential", "momentum", "angular_momentum"):
        assert np.array_equal(getattr(run.ledger, name), getattr(other.ledger, name))
    assert run.ledger.dissipated.keys() == other.ledger.dissipated.keys()
    assert all(np.array_equal(run.ledger.dissipated[cause], other.ledger.dissipated[cause]) for cause in run.ledger.dissipated)
    return run


LEFT_TO_PYTHON = {"bounce": 0, "gas": 0, "pegs": 0, "closing_in": 1, "ties": 3}
"""Impacts that the loop in Python deals with at most: those at one instant. A kernel that always hands over would agree, too."""


@pytest.mark.parametrize("name", SCENES)
def test_runs_with_and_without_the_kernel_agree(name: str) -> None:
    scene, duration = SCENES[name]
    run = assert_same(scene, duration)
    assert next(line for line in run.plan.lines if line.name == "event kernel").included
    # The comparison has something to compare, and the kernel did it.
    assert len(run.impacts) >= 5
    if name in LEFT_TO_PYTHON:
        assert sum(line.calls for line in run.plan.lines if line.stage == "respond") <= LEFT_TO_PYTHON[name]


@pytest.mark.parametrize("name", ["pool_break", "marbles", "galperin_2", "cradle_two", "superball"])
def test_gallery_scenes_agree(name: str) -> None:
    entry = load(name)
    assert_same(entry.scene, min(entry.duration, 3.0), entry.fps, entry.accuracy)


@pytest.mark.parametrize(
    "settings", [{"step": 1 / 240}, {"impact_time": "conservative"}, {"response": "simultaneous", "restitution": "poisson"}]
)
def test_settings_agree(settings: dict) -> None:
    assert_same(rough_gas, 1.0, 24.0, ri.Accuracy(**settings))
