"""Thin and fast: what the guarded sweeps never pass, and what the unguarded one does.

Law: a body whose path crosses another's solid makes contact. The wall is 1 mm thick; at 1,000 m/s a bullet crosses 16.7 m in a
step of 1/60 s, 16,000 times the wall; at 500 rad/s a bar turns 1.3 times in a step. Without backing up time both pass: shown here too.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

STEEL = ri.Material(density=7800, restitution=0.3, static_friction=0.2)


def bullet_scene(seed: int, wall_motion: str, speed: float = 1000.0) -> ri.Scene:
    rng = np.random.default_rng(seed)
    scene = ri.Scene(gravity=(0, 0, 0))
    tilt = rng.normal(size=4) * 0.1 + np.array([1, 0, 0, 0])
    wall = {"velocity": (-300, 0, 0)} if wall_motion == "dynamic" else {}
    scene.add(
        ri.Body("wall", ri.Shape.box((0.001, 2, 2)), motion=wall_motion, orientation=tilt, material=STEEL, **wall)
    )
    aim = rng.uniform(-0.2, 0.2, 3)
    start = np.array([-8.0 - rng.uniform(0, 4), 0, 0])
    direction = (aim - start) / np.linalg.norm(aim - start)
    shape = [
        ri.Shape.sphere(0.005),
        ri.Shape.capsule(0.004, 0.01),
        ri.Shape.box((0.01, 0.01, 0.01)),
        ri.Shape.cylinder(0.005, 0.01),
        ri.Shape.convex_hull(rng.normal(size=(12, 3)) * 0.003),
    ][seed % 5]
    scene.add(
        ri.Body(
            "bullet", shape, position=start, velocity=speed * direction, angular_velocity=rng.normal(size=3) * 500,
            orientation=rng.normal(size=4), material=STEEL,
        )
    )
    return scene


def passed(run: ri.Recording) -> bool:
    """Whether the bullet ends on the far side of the wall's plane, as the wall lies there."""
    from rigidimpulse.core.quaternion import rotate

    normal = rotate(run.orientation("wall"), np.array([1.0, 0.0, 0.0]))
    side = ((run.position("bullet") - run.position("wall")) * normal).sum(1)
    return bool(np.sign(side[0]) != np.sign(side[-1]))


@pytest.mark.parametrize("method", ["bisection", "conservative"])
@pytest.mark.parametrize("wall_motion", ["static", "dynamic"])
@pytest.mark.parametrize("seed", range(10))
def test_bullet_never_passes_a_thin_wall(seed: int, wall_motion: str, method: str) -> None:
    run = ri.simulate(bullet_scene(seed, wall_motion), 0.03, fps=2000, accuracy=ri.Accuracy(impact_time=method))
    assert len(run.impacts) >= 1
    assert not passed(run)


def test_bullet_passes_when_time_is_not_backed_up() -> None:
    run = ri.simulate(bullet_scene(0, "static"), 0.03, accuracy=ri.Accuracy(impact_time="after"))
    assert passed(run)


@pytest.mark.parametrize("seed", range(6))
def test_fast_bar_never_passes_a_post(seed: int) -> None:
    """A thin bar at 500 rad/s sweeps a disc in which a post stands: it must hit it within one turn."""
    rng = np.random.default_rng(seed)
    scene = ri.Scene(gravity=(0, 0, 0))
    angle = rng.uniform(0.1, 2 * np.pi)
    post = ri.Shape.cylinder(0.002, 1.0) if seed % 2 else ri.Shape.box((0.002, 0.002, 1.0))
    scene.add(ri.Body("post", post, motion="static", position=(0.45 * np.cos(angle), 0.45 * np.sin(angle), 0)))
    scene.add(
        ri.Body("bar", ri.Shape.box((1.0, 0.01, 0.01)), angular_velocity=(0, 0, 500), material=STEEL)
    )
    half = angle % np.pi
    run = ri.simulate(scene, 2 * np.pi / 500, fps=10000)
    assert len(run.impacts) >= 1
    # The bar's side meets the post a little before its axis would: half its width and the post's, over 0.45 m.
    assert run.impacts["time"][0] <= half / 500
    assert run.impacts["time"][0] >= (half - 0.03) / 500
